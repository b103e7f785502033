"""What decimating a track does to it and to the path simulated behind it: the stage's rule beside published ones."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from studies.comparators.smoothers import douglas_peucker, rts_smoother, smoothing_spline
from studies.comparators.tow_scenes import lap_scene
from studies.frame import Row, Scatter, Study, default_point, point
from studies.worlds.measured import measured_track
from towval.model import Array, TimedPath, Track
from towval.model.geometry import transform
from towval.physics.dynamics import feedback
from towval.validation.decimate import DecimateSettings, decimate

RATE_HZ, DURATION_S, STOP_S, GO_S = 25, 24.0, 10.0, 14.0
NOISE = np.array([3e-4, 3e-4, 5e-4])
"""Deviation of a pose's x, y [m] and heading [rad]."""

HINGE_M, DAMPING_NS_PER_M, TETHER_M = np.array([-0.42, 0.0]), 10.0, 0.6
"""Of the tow that is simulated behind the path."""

SIMULATED = "CPU time of decimating and simulating [s]"
"""The panel of the simulated path: its cost; the error is that of the path [mm]."""

_FINE = 40  # Times between two frames at which the ground truth is integrated and the paths are compared.
_EVERY = 20  # Of these times, how many apart the hinge's path is given to the dynamics.
_DECIMATING = ("every n-th pose, cubic", "poses farther apart than, linear", "Douglas-Peucker, linear")

Path = Callable[[Track, Array], tuple[int, Array]]
"""From a track and moments (m,) to the number of points kept and the poses (m, 3)."""


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


def towed_path(time_s: Array, pose: Array) -> Array:
    """Poses (m, 3) of a cube behind a rover with poses (n, 3), by the dynamics, from the same start whatever these."""
    cube = lap_scene()
    hinge = TimedPath(time_s[::_EVERY], transform(pose[::_EVERY], HINGE_M))
    tether = type(cube.tether)(TETHER_M, cube.tether.stiffness, DAMPING_NS_PER_M)
    start = (HINGE_M[0] - TETHER_M - cube.towed.anchor[0], 0.0, 0.0)
    return feedback(cube.towed, cube.patch, tether, hinge, start, time_s[::_FINE]).pose


@cache
def _true_tow() -> Array:
    return towed_path(*true_motion())


def decimation_rows(seed: int) -> list[Row]:
    """Two rows a rule and setting: points kept and error of the rover's path; CPU time and error of the simulated one.

    Errors are RMS distances [mm]. The time is that of decimating or smoothing, and simulating.
    """
    time_s, truth = true_motion()
    track, rows = measured(seed), []
    towed_path(time_s, truth)  # compiles
    for series, setting, rule in _rules():
        start = time.process_time()
        kept, pose = rule(track, time_s)
        towed = towed_path(time_s, pose)
        spent = time.process_time() - start
        default = series == "stage decimate" and float(setting) == DecimateSettings().excess
        named = {"series": series, "setting": setting, "default": default, "seed": seed}
        rows.append(named | {"panel": "Points kept of 601", "cost": kept, "error": _rms_mm(pose, truth)})
        rows.append(named | {"panel": SIMULATED, "cost": spent, "error": _rms_mm(towed, _true_tow())})
    return rows


def _rms_mm(pose: Array, truth: Array) -> float:
    return 1e3 * float(np.sqrt(np.mean(np.sum((pose[:, :2] - truth[: len(pose), :2]) ** 2, axis=1))))


def _rules() -> list[tuple[str, str, Path]]:
    """Rule, setting, and what it makes of a track."""
    rules = [("stage decimate", f"{excess:g}", _stage(excess)) for excess in (0.5, 1.0, 3.0, 10.0, 30.0, 100.0)]
    rules += [("every n-th pose, cubic", f"{every}", _every(every)) for every in (1, 3, 10, 30)]
    rules += [
        ("poses farther apart than, linear", f"{1e3 * apart:g} mm", _apart(apart)) for apart in (1e-3, 3e-3, 1e-2)
    ]
    rules += [("Douglas-Peucker, linear", f"{1e3 * off:g} mm", _peucker(off)) for off in (3e-4, 1e-3, 3e-3)]
    rules += [("RTS smoother, white jerk", f"{density:g}", _smoother(density)) for density in (1e-5, 1e-3, 1e-1)]
    return [*rules, ("smoothing spline", "cross-validated", _spline)]


def _stage(excess: float) -> Path:
    def rule(track: Track, moments: Array) -> tuple[int, Array]:
        thin = decimate(track, DecimateSettings(excess=excess))
        return len(thin.time_s), thin.poses_at(moments)

    return rule


def _every(every: int) -> Path:
    def rule(track: Track, moments: Array) -> tuple[int, Array]:
        rows = np.unique(np.append(np.arange(0, len(track.time_s), every), len(track.time_s) - 1))
        return len(rows), CubicSpline(track.time_s[rows], track.pose[rows])(moments)

    return rule


def _linear(track: Track, rows: Array, moments: Array) -> tuple[int, Array]:
    columns = [np.interp(moments, track.time_s[rows], track.pose[rows, k]) for k in range(3)]
    return len(rows), np.column_stack(columns)


def _apart(distance_m: float) -> Path:
    """Rows that are at least a distance from the row kept before, and the last."""

    def rule(track: Track, moments: Array) -> tuple[int, Array]:
        kept = [0]
        for row in range(1, len(track.pose)):
            if np.linalg.norm(track.pose[row, :2] - track.pose[kept[-1], :2]) >= distance_m:
                kept.append(row)
        return _linear(track, np.unique([*kept, len(track.pose) - 1]), moments)

    return rule


def _peucker(tolerance_m: float) -> Path:
    return lambda track, moments: _linear(track, douglas_peucker(track.pose[:, :2], tolerance_m), moments)


def _smoother(density: float) -> Path:
    return lambda track, moments: (len(track.time_s), rts_smoother(track.time_s, track.pose, NOISE, density, moments))


def _spline(track: Track, moments: Array) -> tuple[int, Array]:
    return len(track.time_s), smoothing_spline(track.time_s, track.pose, moments)


def _why(rows: pd.DataFrame) -> str:
    tow = rows[rows["panel"] == SIMULATED]
    default, spline = default_point(rows, SIMULATED), point(rows, "smoothing spline", "cross-validated", SIMULATED)
    smoothed = tow[tow["series"] == "RTS smoother, white jerk"]["error"] / default.error
    stage = tow[tow["series"] == default.series]["error"]
    others = tow[tow["series"].isin(_DECIMATING) & (tow["setting"] != "1")]
    best = others.loc[others["error"].idxmin()]
    return (
        f"The tow is then {default.error:.2g} mm off, over all excesses {stage.min():.2g} to {stage.max():.2g} mm; by "
        f"the best other rule that decimates ({best.series}, {best.setting}) {best.error:.2g} mm. A smoother needs a "
        f"density that no lab states: with 1e-5 to 0.1 it is {smoothed.min():.1f} to {smoothed.max():.1f} times as far "
        f"off. A spline is {spline.error / default.error:.1f} times as far off, in {spline.cost / default.cost:.0f} "
        "times the time."
    )


STUDY = Study(
    parts=lambda settings: {
        f"seed_{seed}": {"seed": seed} for seed in (range(1, 3) if settings.quick else range(27501, 27513))
    },
    rows=decimation_rows,
    chart=Scatter(
        title="Decimation of a track with bends and a pause, and the tow simulated behind it",
        cost="",
        error="RMS error of the path [mm]",
        note="Left the error of the rover's path, right that of the path simulated behind it. Noise of a pose: "
        "0.3 mm and 0.5 mrad. Labels: excess, n, distance or density of the jerk.",
        take="Take the stage's rule with an excess of 3, the default.",
        why=_why,
        truth="Truth of the right panel: the same dynamics behind the true rover.",
    ),
)
