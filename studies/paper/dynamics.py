"""Error of feedforward and feedback dynamics over speed, time step, stiffness and start, Fig. 6.

Errors are taken at equal times, for the nominal motion is a motion in time.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.frame import Part, Row
from studies.paper.nominal import cube_nominal, path_rows
from studies.paper.scene import PaperScene, paper_study
from towval.model import Array, SimulatedMotion, Tether, TimedPath
from towval.model.geometry import transform
from towval.physics.dynamics import feedback, feedforward
from towval.physics.quasistatic import QuasistaticMotion, quasistatic_plan
from towval.physics.wrench import SlidingPatch
from towval.planning.paths import timed
from towval.planning.scene import resting_patch

COMPARED_TIMES = 2000
"""At how many times a motion is compared with the nominal one."""

STEPS_AT_ANY_SPEED = 10_000
"""Time steps of the motions of Fig. 6(a): the same at each speed, so that they resolve the path alike."""

TIMED_RUNS = 9
"""How often a motion is timed."""


def feedforward_motion(
    scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion, *, from_rest: bool = False
) -> SimulatedMotion:
    """The cube under the nominal tow force alone. SOURCE: section 2.3, case 1."""
    force = TimedPath(nominal.time_s, nominal.tether_force)
    twist = np.zeros(3) if from_rest else nominal.twist[0]
    return feedforward(scene.towed, patch, force, nominal.pose[0], _compared_times(nominal), start_twist=twist)


def feedback_motion(
    scene: PaperScene,
    patch: SlidingPatch,
    nominal: QuasistaticMotion,
    *,
    tether: Tether | None = None,
    at_rest_length: bool = False,
    times: Array | None = None,
) -> SimulatedMotion:
    """The cube behind a hinge on its nominal path, at the compared times or others. SOURCE: section 2.3, case 2.

    With ``at_rest_length`` the hinge stays at the rest length from the nominal anchor, as if the tether did not
    stretch: the paper does not say whether its rover path contains the stretch |T|/κ.
    """
    hinge = nominal.hinge
    if at_rest_length:
        anchor = transform(nominal.pose, scene.towed.anchor)
        direction = nominal.tether_force / np.linalg.norm(nominal.tether_force, axis=1, keepdims=True)
        hinge = TimedPath(nominal.time_s, anchor + scene.tether.rest_length * direction)
    return feedback(
        scene.towed,
        patch,
        tether or scene.tether,
        hinge,
        nominal.pose[0],
        _compared_times(nominal) if times is None else times,
        start_twist=nominal.twist[0],
    )


def _compared_rows(nominal: QuasistaticMotion) -> NDArray[np.int_]:
    count = len(nominal.time_s)
    return np.unique(np.linspace(0, count - 1, min(count, COMPARED_TIMES + 1)).round().astype(int))


def _compared_times(nominal: QuasistaticMotion) -> Array:
    return nominal.time_s[_compared_rows(nominal)]


def rms_in_time(motion: SimulatedMotion, nominal: QuasistaticMotion) -> float:
    """Root mean square distance of the object from its nominal place at equal times [m]; NaN when it ended early."""
    rows = _compared_rows(nominal)
    if len(motion.time_s) < len(rows):
        return float("nan")
    gap = motion.pose[:, :2] - nominal.pose[rows, :2]
    return float(np.sqrt(np.mean(np.sum(gap**2, axis=1))))


def _speed_rows(scene: PaperScene, curve: str, speed: float) -> list[Row]:
    """RMS of feedforward and feedback at a mean speed [m/s], Fig. 6(a)."""
    patch = resting_patch(scene)
    step = scene.curves[curve].length / speed / STEPS_AT_ANY_SPEED
    nominal = cube_nominal(scene, patch, curve, step, speed=speed)
    return [{"curve": curve, "mean_speed_m_s": speed} | _dynamics(scene, patch, nominal)]


def _time_step_rows(scene: PaperScene, curve: str, speed: float, time_step: float) -> list[Row]:
    """RMS of feedforward and feedback with a time step of model and splines [s], Fig. 6(b)."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, time_step, speed=speed)
    return [{"curve": curve, "mean_speed_m_s": speed, "time_step_s": time_step} | _dynamics(scene, patch, nominal)]


def _dynamics(scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion) -> Row:
    row: Row = {}
    motions = {
        "feedforward": feedforward_motion(scene, patch, nominal),
        "feedforward_from_rest": feedforward_motion(scene, patch, nominal, from_rest=True),
        "feedback": feedback_motion(scene, patch, nominal),
        "feedback_at_rest_length": feedback_motion(scene, patch, nominal, at_rest_length=True),
    }
    for name, motion in motions.items():
        row |= {f"{name}_rms_m": rms_in_time(motion, nominal), f"{name}_outcome": motion.outcome}
    return row


def stiffness_rows(
    scene: PaperScene, curve: str, speed: float, time_step: float, stiffnesses: Iterable[float]
) -> list[Row]:
    """RMS and computing time of feedback with tethers of several stiffnesses [N/m], Fig. 6(c).

    The time is that of the processor for the dynamics alone, compiled beforehand: the least of several, taken in turns
    over the stiffnesses, so that whatever else the machine does touches all of them alike.
    """
    patch, specification = resting_patch(scene), timed(scene.curves[curve], time_step, mean_speed=speed)
    tethers = [replace(scene.tether, stiffness=stiffness) for stiffness in stiffnesses]
    plans = [quasistatic_plan(scene.towed, patch, specification, tether) for tether in tethers]
    rows: list[Row] = [{"curve": curve, "stiffness_n_m": tether.stiffness} for tether in tethers]
    for name, at_rest_length in (("feedback", False), ("feedback_at_rest_length", True)):
        for row, tether, nominal in zip(rows, tethers, plans, strict=True):
            motion = feedback_motion(scene, patch, nominal, tether=tether, at_rest_length=at_rest_length)
            row |= {
                f"{name}_rms_m": rms_in_time(motion, nominal),
                f"{name}_outcome": motion.outcome,
                f"{name}_steps": motion.statistics["steps"],
                f"{name}_compute_time_s": np.inf,
            }
        for _ in range(TIMED_RUNS):
            for row, tether, nominal in zip(rows, tethers, plans, strict=True):
                start, ends = time.process_time(), nominal.time_s[[0, -1]]
                feedback_motion(scene, patch, nominal, tether=tether, at_rest_length=at_rest_length, times=ends)
                row[f"{name}_compute_time_s"] = min(row[f"{name}_compute_time_s"], time.process_time() - start)
    return rows


def _feedforward_path_rows(scene: PaperScene, curve: str, speeds: list[float]) -> list[Row]:
    patch, rows = resting_patch(scene), []
    for speed in speeds:
        step = scene.curves[curve].length / speed / STEPS_AT_ANY_SPEED
        nominal = cube_nominal(scene, patch, curve, step, speed=speed)
        motion = feedforward_motion(scene, patch, nominal)
        rows += path_rows({"curve": curve, "path": "feedforward", "mean_speed_m_s": speed}, motion.pose[:, :2])
    return rows + path_rows({"curve": curve, "path": "nominal", "mean_speed_m_s": 0.0}, nominal.pose[:, :2])


def _start_rows(scene: PaperScene, law: str, curve: str, speed: float) -> list[Row]:
    """Feedforward dynamics from rest and from the nominal velocity, with and without a peak of friction."""
    scene = scene if law == "friction" else replace(scene, friction=scene.peaked_friction)
    patch, rows = resting_patch(scene), []
    nominal = cube_nominal(scene, patch, curve, 0.1, speed=speed)
    for from_rest in (True, False):
        motion = feedforward_motion(scene, patch, nominal, from_rest=from_rest)
        numbers = {"rms_m": rms_in_time(motion, nominal), "outcome": motion.outcome}
        rows.append({"law": law, "start": "rest" if from_rest else "nominal velocity"} | numbers)
    return rows


def _speed_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    speeds = plan["sensitivity"]["mean_speeds_m_s"]
    return {f"{k:02d}": {"curve": "lemniscate", "speed": speed} for k, speed in enumerate(speeds)}


def _time_step_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    vary = plan["sensitivity"]
    common = {"curve": "lemniscate", "speed": vary["fixed_speed_m_s"]}
    return {f"{k:02d}": {**common, "time_step": step} for k, step in enumerate(vary["time_steps_s"])}


def _stiffness_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    vary = plan["sensitivity"]
    common = {"curve": "lemniscate", "speed": vary["fixed_speed_m_s"], "time_step": 0.1}
    return {"all": {**common, "stiffnesses": vary["stiffnesses_n_m"]}}


def _feedforward_path_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    speeds = plan["sensitivity"]["shown_speeds_m_s"]
    return {curve: {"curve": curve, "speeds": speeds} for curve in ("rounded_square", "lemniscate")}


def _start_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    speed = plan["sensitivity"]["fixed_speed_m_s"]
    return {law: {"law": law, "curve": "lemniscate", "speed": speed} for law in ("friction", "peaked_friction")}


SPEEDS = paper_study(_speed_parts, _speed_rows)
TIME_STEPS = paper_study(_time_step_parts, _time_step_rows)
STIFFNESSES = paper_study(_stiffness_parts, stiffness_rows)
FEEDFORWARD_PATHS = paper_study(_feedforward_path_parts, _feedforward_path_rows)
STARTS = paper_study(_start_parts, _start_rows)
