"""How many poses a path needs: kept points against path error, for the stage's rule and for simpler ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from studies.frame import Row, Scatter, Study
from studies.worlds.measured import measured_track
from towval.model import Array, Track
from towval.validation.decimate import DecimateSettings, decimate

RATE_HZ, DURATION_S, STOP_S, GO_S = 25, 24.0, 10.0, 14.0
NOISE = np.array([3e-4, 3e-4, 5e-4])
"""Deviation of a pose's x, y [m] and heading [rad]."""

_FINE = 40  # Times between two frames at which the ground truth is integrated and the paths are compared.


def true_motion() -> tuple[Array, Array]:
    """Times (n,) [s] and poses (n, 3) of a rover that drives through bends, stands for four seconds, and drives on."""
    time_s = np.arange(round(DURATION_S * RATE_HZ) * _FINE + 1) / (RATE_HZ * _FINE)
    moving = 0.5 * (np.tanh((STOP_S - time_s) / 0.3) + 1) + 0.5 * (np.tanh((time_s - GO_S) / 0.3) + 1)
    step = np.diff(time_s, prepend=time_s[0])
    path = np.cumsum(0.08 * moving * step)
    heading = 0.8 * np.sin(3.0 * path)
    along = np.diff(path, prepend=0.0)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    return time_s, np.column_stack([np.cumsum(along, axis=0), heading])


def measured(seed: int) -> Track:
    """The motion as a camera measures it, with white noise."""
    time_s, pose = true_motion()
    time_s, pose = (
        time_s[::_FINE],
        pose[::_FINE] + np.random.default_rng(seed).normal(size=(len(time_s[::_FINE]), 3)) * NOISE,
    )
    return measured_track("rover", time_s, pose, NOISE)


def decimation_rows(seeds: list[int]) -> list[Row]:
    """A row a rule and setting: points kept, RMS error of the path through them in mm, medians over seeds."""
    time_s, truth = true_motion()
    found: dict[tuple[str, str], list[tuple[int, float]]] = {}
    for seed in seeds:
        for series, setting, kept, path in _paths(measured(seed), time_s):
            error = 1e3 * float(np.sqrt(np.mean(np.sum((path - truth[:, :2]) ** 2, axis=1))))
            found.setdefault((series, setting), []).append((kept, error))
    return [
        {
            "panel": "",
            "series": series,
            "setting": setting,
            "cost": float(np.median([kept for kept, _ in values])),
            "error": float(np.median([error for _, error in values])),
            "default": series == "stage decimate" and float(setting) == DecimateSettings().excess,
        }
        for (series, setting), values in found.items()
    ]


def _paths(track: Track, time_s: Array) -> Iterator[tuple[str, str, int, Array]]:
    """Rule, setting, number of points kept and the path (n, 2) through them."""
    for excess in (0.5, 1.0, 3.0, 10.0, 30.0, 100.0):
        thin = decimate(track, DecimateSettings(excess=excess))
        yield "stage decimate", f"{excess:g}", len(thin.time_s), thin.spline()(time_s)[:, :2]
    for every in (1, 3, 10, 30, 60):
        rows = np.unique(np.append(np.arange(0, len(track.time_s), every), len(track.time_s) - 1))
        spline = CubicSpline(track.time_s[rows], track.pose[rows, :2])
        yield "every n-th pose, cubic", f"{every}", len(rows), spline(time_s)
    for apart in (2e-4, 5e-4, 1e-3, 3e-3, 1e-2):
        rows = _apart(track.pose[:, :2], apart)
        path = np.column_stack([np.interp(time_s, track.time_s[rows], track.pose[rows, k]) for k in (0, 1)])
        yield "poses farther apart than, linear", f"{1e3 * apart:g} mm", len(rows), path


def _apart(place: Array, distance_m: float) -> Array:
    """Rows that are at least a distance from the row kept before, and the last."""
    kept = [0]
    for row in range(1, len(place)):
        if np.linalg.norm(place[row] - place[kept[-1]]) >= distance_m:
            kept.append(row)
    return np.unique([*kept, len(place) - 1])


STUDY = Study(
    parts=lambda settings: {"bends": {"seeds": [1] if settings.quick else [1, 2, 3, 4, 5]}},
    rows=decimation_rows,
    chart=Scatter(
        title="Decimation of a track with bends and a pause",
        cost="Points kept of 601",
        error="RMS error of the path [mm]",
        note="Noise of a pose: 0.3 mm and 0.5 mrad. Labels: excess, n, or distance. Medians over seeds.",
    ),
)
