"""Closed loops of planner, rover and cube: paths (Fig. 5), thresholds (Fig. 7), response surface (Fig. 8), wheelbases.

Errors are distances between curves, for a rover at constant speed keeps its own schedule.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from studies.costs import cpu_seconds
from studies.frame import Part, Row
from studies.paper.nominal import cube_nominal, path_rows
from studies.paper.scene import CURVES, PaperScene, paper_study
from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import inverse_transform, path_length
from towval.physics.quasistatic import QuasistaticMotion
from towval.physics.wrench import SlidingPatch
from towval.planning.paths import distance_to_polyline, path_heading
from towval.planning.plan import ClosedLoop, close_loop
from towval.planning.planner import PlanCase, RoverPlan
from towval.planning.scene import resting_patch

PLANNER_STEPS_S = (0.025, 0.05, 0.1, 0.2, 0.4)
"""Time steps Δt of the planner [s]; the paper's is not given."""

REPORT_STRIDE = 10
"""The towed object is computed and compared at every so many steps of the planner."""


def planned_loop(scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion, **settings: Any) -> ClosedLoop:
    """The cube behind the rover planned along its nominal path, with planner settings that differ from the scene's."""
    planner = replace(scene.planner, **settings)
    return close_loop(nominal, scene.towed, patch, scene.tether, scene.rover, planner, report_stride=REPORT_STRIDE)


def loop_row(scene: PaperScene, patch: SlidingPatch, nominal: QuasistaticMotion, **settings: Any) -> Row:
    """Outcome and RMS of rover and object with planner settings that differ from the scene's, Figs. 7 and 8."""
    return settings | loop_numbers(planned_loop(scene, patch, nominal, **settings), nominal)


def loop_numbers(loop: ClosedLoop, nominal: QuasistaticMotion) -> Row:
    """The numbers of a closed loop for tables and ledger."""
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


def _loop_rows(scene: PaperScene, curve: str, **settings: Any) -> list[Row]:
    """Paths of rover and object step by step, with the planner's cases, Fig. 5; the first row holds the numbers."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    loop = planned_loop(scene, patch, nominal, **settings)
    seconds = cpu_seconds(lambda: planned_loop(scene, patch, nominal, **settings))
    rows = [{"row": "numbers", "curve": curve, "compute_time_s": seconds} | settings | loop_numbers(loop, nominal)]
    rows += path_rows({"row": "nominal object"}, nominal.pose[:, :2])
    rows += path_rows({"row": "nominal rover"}, nominal.hinge.position)
    case_at = np.array([case.name for case in PlanCase])[loop.rover.case]
    at = np.searchsorted(loop.rover.time_s, loop.towed.time_s).clip(max=len(case_at) - 1)
    columns: tuple[dict[str, Any], dict[str, Any]] = (
        {
            "gap_m": distance_to_polyline(loop.rover.hinge, nominal.hinge.position),
            "miss_m": _misses(scene, loop.rover, nominal),
            "curvature_1_m": _curvature(nominal.hinge.position)[loop.rover.target],
        },
        {
            "gap_m": distance_to_polyline(loop.towed.pose[:, :2], nominal.pose[:, :2]),
            "case_ahead": case_at[(at - _delay(scene, nominal)).clip(min=0)],
        },
    )
    for name, position, case, values in (
        ("rover", loop.rover.hinge, case_at, columns[0]),
        ("object", loop.towed.pose, case_at[at], columns[1]),
    ):
        given = {"x_m": position[:, 0], "y_m": position[:, 1], "case": case} | values
        rows += [{"row": name} | dict(zip(given, row, strict=True)) for row in zip(*given.values(), strict=True)]
    return rows


def _delay(scene: PaperScene, nominal: QuasistaticMotion) -> int:
    """Steps of the planner in which the hinge travels a tether's length: after so many the object is where it was."""
    return round(scene.tether.rest_length * (len(nominal.time_s) - 1) / path_length(nominal.hinge.position))


def _curvature(position: Array) -> Array:
    """Curvature of a sampled path (n, 2) [m] at its points, without sign (n,) [1/m]."""
    along = np.linalg.norm(np.gradient(position, axis=0), axis=1)
    return np.abs(np.gradient(path_heading(position))) / along


def _misses(scene: PaperScene, plan: RoverPlan, nominal: QuasistaticMotion) -> Array:
    """How far the arc of each step, driven on, passes the point aimed at (n,) [m]."""
    aim = inverse_transform(plan.pose, nominal.hinge.position[plan.target]) - scene.rover.hinge
    turning = plan.twist[:, 2:]
    velocity = plan.twist[:, :2] + turning * np.array([-scene.rover.hinge[1], scene.rover.hinge[0]])
    normal = np.column_stack([-velocity[:, 1], velocity[:, 0]]) / np.linalg.norm(velocity, axis=1, keepdims=True)
    # A point at ``aim`` is on the circle through the hinge where 2 aim·n = κ |aim|², which holds for a line as well.
    curvature = turning[:, 0] / np.linalg.norm(velocity, axis=1)
    side = 2 * np.sum(aim * normal, axis=1) - curvature * np.sum(aim**2, axis=1)
    centre_gap = np.sqrt(np.maximum(1 - curvature * side, 0.0))
    return np.abs(side) / (1 + centre_gap)


def _planner_step_rows(scene: PaperScene, curve: str, time_step: float) -> list[Row]:
    """Outcome and RMS with another time step Δt of the planner, its look-ahead kept as a time."""
    patch, settings = resting_patch(scene), scene.planner
    nominal = cube_nominal(scene, patch, curve, time_step)
    look_ahead = round(settings.look_ahead_steps * scene.planner_step / time_step)
    return [{"curve": curve, "time_step_s": time_step} | loop_row(scene, patch, nominal, look_ahead_steps=look_ahead)]


def _threshold_rows(scene: PaperScene, curve: str, thresholds: list[float], shown: list[float]) -> list[Row]:
    """A row of numbers a threshold, and the paths of rover and object for those that are shown, Fig. 7."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    rows = path_rows({"curve": curve, "row": "nominal object"}, nominal.pose[:, :2])
    rows += path_rows({"curve": curve, "row": "nominal rover"}, nominal.hinge.position)
    for threshold in sorted({*thresholds, *shown}):
        loop = planned_loop(scene, patch, nominal, threshold=threshold)
        common = {"curve": curve, "threshold_m": threshold}
        rows.append(common | {"row": "numbers"} | loop_numbers(loop, nominal))
        if threshold in shown:
            rows += path_rows(common | {"row": "object"}, loop.towed.pose[:, :2])
            rows += path_rows(common | {"row": "rover"}, loop.rover.hinge)
    return rows


def _wheelbase_rows(scene: PaperScene, curve: str, wheelbase: float, thresholds: list[float]) -> list[Row]:
    """Which thresholds arrive with a rover of another wheelbase: the paper does not give its own."""
    positions = scene.rover.wheel_positions * [wheelbase / np.ptp(scene.rover.wheel_positions[:, 0]), 1.0]
    scene = replace(scene, rover=replace(scene.rover, wheel_positions=positions))
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    common = {"curve": curve, "wheelbase_m": wheelbase}
    return [common | loop_row(scene, patch, nominal, threshold=threshold) for threshold in thresholds]


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


def _loop_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    keys = plan["closed_loop"]
    settings = {"threshold": keys["threshold_m"], "look_ahead_steps": keys["look_ahead_steps"]}
    return {"lemniscate": {"curve": "lemniscate", **settings}}


def _threshold_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    vary = plan["sensitivity"]
    values = {"thresholds": vary["thresholds_m"], "shown": vary["shown_thresholds_m"]}
    return {curve: {"curve": curve, **values} for curve in CURVES}


def _planner_step_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    return {
        f"{curve}_{1000 * step:.0f}": {"curve": curve, "time_step": step}
        for curve in ("lemniscate", "rounded_square")
        for step in PLANNER_STEPS_S
    }


def _wheelbase_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    vary = plan["sensitivity"]
    return {
        f"{1000 * length:.0f}": {"curve": "lemniscate", "wheelbase": length, "thresholds": vary["thresholds_m"]}
        for length in vary["wheelbases_m"]
    }


def _surface_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    vary = plan["sensitivity"]
    thresholds = surface_grid(*vary["surface_thresholds_m"]).tolist()
    look_aheads = surface_grid(*vary["surface_look_aheads_steps"]).tolist()
    blocks = np.array_split(np.arange(len(thresholds)), min(vary["surface_blocks"], len(thresholds)))
    return {
        f"{curve}_{index:02d}": {
            "curve": curve,
            "thresholds": [thresholds[row] for row in block],
            "look_aheads": look_aheads,
        }
        for curve in ("lemniscate", "rounded_square")
        for index, block in enumerate(blocks)
    }


LOOP = paper_study(_loop_parts, _loop_rows)
THRESHOLDS = paper_study(_threshold_parts, _threshold_rows)
WHEELBASES = paper_study(_wheelbase_parts, _wheelbase_rows)
PLANNER_STEPS = paper_study(_planner_step_parts, _planner_step_rows)
SURFACE = paper_study(_surface_parts, surface_rows)
