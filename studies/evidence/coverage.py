"""Check of the stated deviations of poses on filmed campaigns: how large they are, how many frames lie within two."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import flawed, replaced, result_of
from towval.commands import calibrate, track
from towval.io.records import read_tracks
from towval.model import Array, Track
from towval.model.geometry import wrapped
from towval.tracking import track as tracking

_RUNS = {"lab_a": "ab", "lab_c": "g"}
_COORDINATES = ("x", "y", "heading")


def _measure() -> Values:
    found: dict[str, float] = {}
    for name, runs in _RUNS.items():
        source = shared_folder() / "footage" / name
        with TemporaryDirectory() as folder:
            camera, tracks = Path(folder) / "camera.mcap", Path(folder) / "track.mcap"
            calibrate.run(source, camera)
            for run in runs:
                track.run(source, run, camera, tracks)
                truth = pd.read_csv(source / f"{run}_truth.csv")
                for body, each in read_tracks(tracks).items():
                    of_body = f"{name} {run}, {body}"
                    shares = zip(_COORDINATES, _within(each, truth), strict=True)
                    found |= {f"{of_body}, {coordinate}": share for coordinate, share in shares}
                    position_m, heading_rad = _stated(each)
                    found[f"{of_body}, position stated"] = 1e3 * position_m
                    found[f"{of_body}, heading stated"] = float(np.rad2deg(heading_rad))
                os.remove(tracks)
    return found


def _within(found: Track, truth: pd.DataFrame) -> Array:
    """Share of the seen frames [%] whose x, y and heading lie within two total deviations of the truth."""
    assert found.total_covariance is not None
    names = [f"{found.body}_x_m", f"{found.body}_y_m", f"{found.body}_heading_rad"]
    off = found.pose - np.column_stack([np.interp(found.time_s, truth["t_s"], truth[name]) for name in names])
    off[:, 2] = wrapped(off[:, 2])
    std = np.sqrt(np.diagonal(found.total_covariance, axis1=1, axis2=2))
    return 100 * np.mean(np.abs(off[found.seen]) <= 2 * std[found.seen], axis=0)


def _stated(found: Track) -> tuple[float, float]:
    """Total deviations of position [m] and heading [rad] of the seen frames, root mean squares."""
    assert found.total_covariance is not None
    square = np.diagonal(found.total_covariance, axis1=1, axis2=2)[found.seen].mean(axis=0)
    return float(np.sqrt(square[0] + square[1])), float(np.sqrt(square[2]))


def _turned(tracks: Mapping[str, Track]) -> dict[str, Track]:
    return {body: replace(each, pose=each.pose + np.deg2rad([0.0, 0.0, 0.3])) for body, each in tracks.items()}


COVERAGE = Check(
    _measure,
    {
        "the total is the frame's own covariance alone": replaced(
            tracking, "with_total", lambda _: lambda each, *_: replace(each, total_covariance=each.covariance)
        ),
        "the total deviations are three times as large": replaced(
            tracking, "with_scatter", result_of(lambda each: replace(each, total_covariance=9 * each.total_covariance))
        ),
        "poses scatter by 4 mm and 0.3°": replaced(track, "track", flawed(4e-3, 5e-3)),
        "bodies are turned by 0.3°": replaced(track, "track", result_of(_turned)),
    },
    needs=("footage/lab_a", "footage/lab_c"),
)
