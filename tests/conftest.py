"""What tests share: where data is, and small results with known content."""

import os
from pathlib import Path

import numpy as np
import pytest

from towval.types import Track, TrackStatus

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
        n = len(time_s)
        std = np.asarray(std, dtype=float)
        pose = motion(time_s) + np.random.default_rng(seed).normal(size=(n, 3)) * std
        covariance = np.tile(np.diag(std**2), (n, 1, 1))
        status = np.full(n, TrackStatus.TRACKED, dtype=np.uint8)
        for i in lost:
            status[i], pose[i], covariance[i] = TrackStatus.LOST, np.nan, np.nan
        return Track(
            body=body,
            time_s=time_s,
            pose=pose,
            covariance=covariance,
            status=status,
            inlier_fraction=np.ones(n),
            residual=np.full(n, 0.1),
            start_covariance=np.diag([1e-6, 1e-6, 1e-6]),
        )

    return make
