"""Effect of input faults on the paths: frame rate, height, clicks, mass, centre of mass.

The run is the synthetic campaign's, filmed for ten seconds by a camera without error; the effect of a fault on the
measured poses is computed on the poses, not in pictures. None of these faults can be detected in the data alone: the
standard deviations in campaign.yaml have to cover them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from studies.frame import Part, Row, Scatter, Settings, Study
from studies.worlds import campaign
from studies.worlds.measured import measured_track
from studies.worlds.scenes import drive
from towval.model import Array, FrictionSpecification, Load, Patch, Tether, TowingScene
from towval.model.geometry import compose
from towval.validation.decimate import decimate
from towval.validation.simulate import simulate

DURATION_S = 10.0
NOISE = np.array([2e-4, 2e-4, 4e-4])

START = np.array([-1.2, 0.0, 0.15])


@dataclass(frozen=True)
class _Run:
    """Input of the stages: the scene and both bodies' poses (n, 3) at times (n,)."""

    scene: TowingScene
    time_s: Array
    rover: Array
    towed: Array


def true_run(seed: int) -> tuple[_Run, Array]:
    """A run on an arc without a fault, measured with noise, and the object's true poses (n, 3)."""
    rng = np.random.default_rng(seed)
    rover = drive((-0.15, 0.05, 0.1), speed=0.12, turn=rng.uniform(-0.9, 0.9), rest_s=0.3)
    times = np.arange(round(DURATION_S * campaign.RATE_HZ)) / campaign.RATE_HZ
    towed = campaign.towed_motion(rover, START, times)
    scene = TowingScene(
        patch=Patch(campaign.OBJECT.top_corners_m),
        body_mass=campaign.MASS,
        load=Load(campaign.LOAD, campaign.LOAD_AT, np.array(campaign.LOAD_SIZE)),
        anchor=campaign.ANCHOR,
        hinge=campaign.HINGE,
        tether=Tether(campaign.REST_LENGTH, campaign.STIFFNESS),
        friction=FrictionSpecification(campaign.FRICTION, campaign.FRICTION, 0.005, 0.05),
    )
    poses = [np.array([rover(t) for t in times]), towed]
    noisy = [pose + NOISE * rng.standard_normal(pose.shape) for pose in poses]
    return _Run(scene, times, *noisy), towed


def _slower(run: _Run, rate_hz: float) -> _Run:
    rows = slice(None, None, round(campaign.RATE_HZ / rate_hz))
    return replace(run, time_s=run.time_s[rows], rover=run.rover[rows], towed=run.towed[rows])


def _with_poses(run: _Run, body: str, pose: Array) -> _Run:
    """The run with other poses of one body, "rover" or "towed"."""
    return replace(run, rover=pose) if body == "rover" else replace(run, towed=pose)


def _higher(run: _Run, mm: float, body: str) -> _Run:
    """A planar target assumed too high: every pose moves towards the nadir."""
    height = {"rover": campaign.ROVER, "towed": campaign.OBJECT}[body].tracked_plane_height_m
    shrink = (CAMERA_HEIGHT_M - height - 1e-3 * mm) / (CAMERA_HEIGHT_M - height)
    return _with_poses(run, body, getattr(run, body) * [shrink, shrink, 1])


def _clicked(run: _Run, mm: float, body: str) -> _Run:
    """A body frame displaced on its body, across it, and turned by as much over half a metre."""
    return _with_poses(run, body, compose(getattr(run, body), np.array([0.0, 1e-3 * mm, 1e-3 * mm / 0.5])))


def _heavier(run: _Run, percent: float) -> _Run:
    scene = run.scene
    load = replace(scene.load, mass=scene.load.mass * (1 + percent / 100))
    return replace(run, scene=replace(scene, body_mass=scene.body_mass * (1 + percent / 100), load=load))


def _displaced(run: _Run, mm: float) -> _Run:
    load = replace(run.scene.load, at=run.scene.load.at + np.array([0.0, 1e-3 * mm]))
    return replace(run, scene=replace(run.scene, load=load))


CAMERA_HEIGHT_M = 4.0

FAULTS: dict[str, Callable[[_Run, float], _Run]] = {
    "frame rate [Hz]": _slower,
    "rover's top too high by [mm]": lambda run, mm: _higher(run, mm, "rover"),
    "object's top too high by [mm]": lambda run, mm: _higher(run, mm, "towed"),
    "rover's frame off by [mm]": lambda run, mm: _clicked(run, mm, "rover"),
    "object's frame off by [mm]": lambda run, mm: _clicked(run, mm, "towed"),
    "masses too large by [%]": _heavier,
    "load off its place by [mm]": _displaced,
}
"""Faults by the panel that shows them, as functions of their size."""


def carry_over_rows(fault: str, sizes: list[float], seeds: list[int]) -> list[Row]:
    """A row a seed, size and quantity: RMS in mm of measured and simulated path from the truth, and from each other."""
    return [row for seed in seeds for row in _rows_of_run(fault, sizes, seed)]


def _rows_of_run(fault: str, sizes: list[float], seed: int) -> list[Row]:
    run, truth = true_run(seed)
    true_times = run.time_s
    rows = []
    for size in sizes:
        given = FAULTS[fault](run, size)
        tracks = {name: measured_track(name, given.time_s, getattr(given, name), NOISE) for name in ("rover", "towed")}
        motion = simulate(given.scene, decimate(tracks["rover"]), decimate(tracks["towed"]), given.time_s)
        true = np.column_stack([np.interp(motion.time_s, true_times, truth[:, k]) for k in range(3)])
        seen = given.towed[np.searchsorted(given.time_s, motion.time_s - 1e-9)]
        flags = sorted({finding.code for finding in motion.findings if finding.severity != "note"})
        gaps = {
            "measured path": seen - true,
            "simulated path": motion.pose - true,
            "simulated - measured": motion.pose - seen,
        }
        for series, gap in gaps.items():
            error = 1e3 * float(np.sqrt(np.mean(np.sum(gap[:, :2] ** 2, axis=1))))
            cell = {"setting": "", "cost": size, "error": error, "default": False, "flags": " ".join(flags)}
            rows.append({"panel": fault, "series": series, "seed": seed} | cell)
    return rows


def _parts(settings: Settings) -> dict[str, Part]:
    sizes: dict[str, list[float]] = {
        "frame rate [Hz]": [25.0, 12.5, 5.0, 2.5, 1.0],
        "masses too large by [%]": [1, 3, 10, 30],
    }
    chosen = list(FAULTS)[:2] if settings.quick else list(FAULTS)
    keys = {fault: [float(v) for v in sizes.get(fault, [1, 3, 10, 30])] for fault in chosen}
    seeds = [5] if settings.quick else list(range(27400, 27410))
    return {
        f"fault_{k}": {"fault": fault, "sizes": values, "seeds": seeds}
        for k, (fault, values) in enumerate(keys.items())
    }


def _why(rows: pd.DataFrame) -> str:
    """What a fault of ten units does, by its panel; another frame rate is not a fault of this kind."""
    ten = rows[(rows["series"] == "simulated - measured") & (rows["cost"] == 10) & ~rows["panel"].str.endswith("[Hz]")]
    found = [f"{row.panel} 10: {row.error:.2g} mm" for row in ten.sort_values("error", ascending=False).itertuples()]
    return f"Simulated - measured, the worst first: {'; '.join(found)}."


STUDY = Study(
    parts=_parts,
    rows=carry_over_rows,
    chart=Scatter(
        title="Effect of input faults on the paths",
        cost="",
        error="RMS distance [mm]",
        note="Distance of measured and simulated path from ground truth, and from each other, on random arcs: ten "
        "seconds, 0.9 m of path, camera at 4 m.",
        take="State the standard deviations of what you measured: most of these faults do not show in the data.",
        why=_why,
        front=False,
    ),
)
