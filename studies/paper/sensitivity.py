"""Sensitivity studies of the paper's section 3: each function makes one row or block, a job of its own.

Errors of the dynamics (Fig. 6) are taken at equal times, for the nominal motion is a motion in time; those of the
planned rover (Figs. 7 and 8) between curves, for a rover at constant speed keeps its own schedule.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from studies.paper.scene import PaperScene
from towval.model import Array, SimulatedMotion, Tether, TimedPath
from towval.model.errors import InputError
from towval.model.geometry import inverse_transform, transform
from towval.physics.dynamics import feedback, feedforward
from towval.physics.quasistatic import QuasistaticMotion, quasistatic_plan
from towval.physics.wrench import SlidingPatch
from towval.planning.paths import timed
from towval.planning.plan import ClosedLoop, close_loop
from towval.planning.planner import PlanCase, RoverPlan
from towval.planning.scene import resting_patch

COMPARED_TIMES = 2000
"""At how many times a motion is compared with the nominal one."""

REPORT_STRIDE = 10
"""The towed object is computed and compared at every so many steps of the planner."""

TIMED_RUNS = 9
"""How often a motion is timed."""

Row = dict[str, Any]


def cube_nominal(
    scene: PaperScene, patch: SlidingPatch, curve: str, time_step: float, *, speed: float | None = None
) -> QuasistaticMotion:
    """Quasi-static motion of the cube along a curve, at a mean speed [m/s] or, without, in the paper's 600 s."""
    duration = scene.duration if speed is None else None
    specification = timed(scene.curves[curve], time_step, mean_speed=speed, duration=duration)
    return quasistatic_plan(scene.cube, patch, specification, scene.tether)


def feedforward_motion(
    scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion, *, from_rest: bool = False
) -> SimulatedMotion:
    """The cube under the nominal tow force, blindly. SOURCE: section 2.3, case 1."""
    force = TimedPath(nominal.time_s, nominal.tether_force)
    twist = np.zeros(3) if from_rest else nominal.twist[0]
    return feedforward(scene.cube, patch, force, nominal.pose[0], _compared_times(nominal), start_twist=twist)


def feedback_motion(
    scene: PaperScene,
    patch: SlidingPatch,
    nominal: QuasistaticMotion,
    *,
    tether: Tether | None = None,
    at_rest_length: bool = False,
    times: Array | None = None,
) -> SimulatedMotion:
    """The cube behind a hinge on its nominal way, at the compared times or others. SOURCE: section 2.3, case 2.

    With ``at_rest_length`` the hinge stays at the rest length from the nominal anchor, as if the tether did not
    stretch: the paper does not say whether its rover path contains the stretch |T|/κ.
    """
    hinge = nominal.hinge
    if at_rest_length:
        anchor = transform(nominal.pose, scene.cube.anchor)
        direction = nominal.tether_force / np.linalg.norm(nominal.tether_force, axis=1, keepdims=True)
        hinge = TimedPath(nominal.time_s, anchor + scene.tether.rest_length * direction)
    return feedback(
        scene.cube,
        patch,
        tether or scene.tether,
        hinge,
        nominal.pose[0],
        _compared_times(nominal) if times is None else times,
        start_twist=nominal.twist[0],
    )


def _compared_rows(nominal: QuasistaticMotion) -> Array:
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


def speed_row(scene: PaperScene, curve: str, speed: float, steps: int) -> Row:
    """RMS of feedforward and feedback at a mean speed [m/s], Fig. 6(a), in a number of equal time steps."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.curves[curve].length / speed / steps, speed=speed)
    return {"curve": curve, "mean_speed_m_s": speed} | _dynamics(scene, patch, nominal)


def time_step_row(scene: PaperScene, curve: str, speed: float, time_step: float) -> Row:
    """RMS of feedforward and feedback with a time step of model and splines [s], Fig. 6(b)."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, time_step, speed=speed)
    return {"curve": curve, "mean_speed_m_s": speed, "time_step_s": time_step} | _dynamics(scene, patch, nominal)


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
    plans = [quasistatic_plan(scene.cube, patch, specification, tether) for tether in tethers]
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


def loop_row(scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion, **settings: Any) -> Row:
    """Outcome and RMS of rover and object with planner settings that differ from the scene's, Figs. 7 and 8."""
    return settings | loop_numbers(planned_loop(scene, patch, nominal, **settings), nominal)


def planned_loop(scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion, **settings: Any) -> ClosedLoop:
    """The cube behind the rover planned along its nominal way, with planner settings that differ from the scene's."""
    planner = replace(scene.planner, **settings)
    return close_loop(nominal, scene.cube, patch, scene.tether, scene.rover, planner, report_stride=REPORT_STRIDE)


def loop_numbers(loop: ClosedLoop, nominal: QuasistaticMotion) -> Row:
    """The numbers of a closed loop that tables and ledger want."""
    shares = {f"case_{case.name.lower()}_share": loop.rover.share_of(case) for case in PlanCase}
    return {
        "rover_rms_m": loop.rover.rms,
        "object_rms_m": loop.object_rms,
        "outcome": str(loop.rover.outcome),
        "object_outcome": loop.towed.outcome,
        "first_tip_turns_away": _first_tip_turns_away(loop.rover, nominal),
        "advice": loop.rover.advice,
    } | shares


def _first_tip_turns_away(plan: RoverPlan, nominal: QuasistaticMotion) -> float:
    """1 where the first step in case C turns away from the point aimed at, 0 where towards it, NaN without case C."""
    steps = np.flatnonzero(plan.case == PlanCase.C)
    if not len(steps):
        return float("nan")
    first = steps[0]
    aim = inverse_transform(plan.pose[first], nominal.hinge.position[plan.target[first]])
    return float(np.sign(plan.twist[first, 2]) != np.sign(aim[1]))


def surface_grid(first: float, last: float, count: int) -> Array:
    """The values of one axis of the response surface (count,), equally spaced."""
    if count < 2 or last <= first:
        raise InputError(
            "an axis of the response surface is empty",
            got=f"{count} values from {first} to {last}",
            allowed="two values or more, the last above the first",
        )
    return np.linspace(first, last, int(count))


def surface_rows(scene: PaperScene, curve: str, thresholds: Iterable[float], look_aheads: Iterable[float]) -> list[Row]:
    """One block of the response surface of RMS over d_t [m] and ϑ_lh [steps], Fig. 8."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    look_aheads = [round(value) for value in look_aheads]
    return [
        {"curve": curve} | loop_row(scene, patch, nominal, threshold=threshold, look_ahead_steps=steps)
        for threshold in thresholds
        for steps in look_aheads
    ]
