"""What tests share: where data is, and small results with known content."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.worlds.measured import measured_track
from towval.model import TrackStatus

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def repository() -> Path:
    return REPOSITORY


@pytest.fixture(scope="session")
def lab_small() -> Path:
    return REPOSITORY / "data_samples" / "lab_small"


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """Footage that is not part of the repository: beside it, or where TOWVAL_SHARED says."""
    folder = Path(os.environ.get("TOWVAL_SHARED", REPOSITORY.parent / "shared"))
    if not folder.is_dir():
        pytest.skip(f"no shared footage at {folder}: set TOWVAL_SHARED to its folder")
    return folder


@pytest.fixture(scope="session")
def make_track():
    """A function that measures a motion: pose of time, seen with white noise of given deviation."""

    def make(motion, *, body="rover", duration_s=12.0, rate_hz=25.0, std=(1e-4, 1e-4, 2e-4), seed=0, lost=()):
        time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
        noise = np.random.default_rng(seed).normal(size=(len(time_s), 3)) * np.asarray(std, dtype=float)
        seen = measured_track(body, time_s, motion(time_s) + noise, std, start_std=(1e-3, 1e-3, 1e-3))
        gone = np.isin(np.arange(len(time_s)), list(lost))
        return replace(
            seen,
            pose=np.where(gone[:, None], np.nan, seen.pose),
            covariance=np.where(gone[:, None, None], np.nan, seen.covariance),
            status=np.where(gone, TrackStatus.LOST, seen.status).astype(np.uint8),
        )

    return make
