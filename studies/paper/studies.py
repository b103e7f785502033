"""The studies behind the paper's figures, cut into parts: what a part is, and the rows that it makes.

A part is a plain mapping, so that a workflow can hand it to a job, keep it as a parameter and see when it has changed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from studies.paper.mesh_studies import contact_rows, mesh_rows
from studies.paper.scene import CURVES, PaperScene, paper_scene
from studies.paper.sensitivity import (
    Row,
    cube_nominal,
    feedforward_motion,
    loop_numbers,
    loop_row,
    planned_loop,
    resting_patch,
    rms_in_time,
    speed_row,
    stiffness_rows,
    surface_grid,
    surface_rows,
    time_step_row,
)
from towval.model import Array, TowedObject
from towval.model.geometry import polygon_centroid
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import fitted_law
from towval.physics.quasistatic import QuasistaticMotion, quasistatic_plan
from towval.physics.wrench import sliding_patch
from towval.planning.paths import path_heading, timed
from towval.planning.planner import PlanCase

SHOWN_ROWS = 800
"""Rows kept of a path that is drawn."""

STEPS_AT_ANY_SPEED = 10_000
"""Time steps of the motions of Fig. 6(a): the same at each speed, so that they resolve the path alike."""

Part = dict[str, Any]


def paper_parts(plan: Mapping[str, Any]) -> dict[str, dict[str, Part]]:
    """Parts of each study by name, from the configuration's section ``plan``."""
    vary = plan["sensitivity"]
    speed = vary["fixed_speed_m_s"]
    shape, table = plan["general_object"], plan["table_1"]
    return {
        "contact": {"extreme": {"centre": shape["extreme_centre_of_mass_m"], "element_size": shape["element_size_m"]}},
        "meshes": {"boundary": {"element_size": None}}
        | {f"{1e4 * size:03.0f}": {"element_size": size} for size in table["element_sizes_m"]},
        "nominal": {
            f"{curve}_{centre}": {"curve": curve, "centre": centre}
            for curve in CURVES
            for centre in plan["general_object"]["centres_of_mass_m"]
        },
        "speeds": {f"{k:02d}": {"curve": "lemniscate", "speed": v} for k, v in enumerate(vary["mean_speeds_m_s"])},
        "time_steps": {
            f"{k:02d}": {"curve": "lemniscate", "speed": speed, "time_step": step}
            for k, step in enumerate(vary["time_steps_s"])
        },
        "stiffnesses": {
            "all": {"curve": "lemniscate", "speed": speed, "time_step": 0.1, "stiffnesses": vary["stiffnesses_n_m"]}
        },
        "feedforward_paths": {
            curve: {"curve": curve, "speeds": vary["shown_speeds_m_s"]} for curve in ("rounded_square", "lemniscate")
        },
        "starts": {law: {"law": law, "curve": "lemniscate", "speed": speed} for law in ("friction", "peaked_friction")},
        "loop": {"lemniscate": {"curve": "lemniscate", **_planner_keys(plan["closed_loop"])}},
        "thresholds": {
            curve: {"curve": curve, "thresholds": vary["thresholds_m"], "shown": vary["shown_thresholds_m"]}
            for curve in CURVES
        },
        "wheelbases": {
            f"{1000 * length:.0f}": {"curve": "lemniscate", "wheelbase": length, "thresholds": vary["thresholds_m"]}
            for length in vary["wheelbases_m"]
        },
        "surface": _surface_parts(vary),
    }


def _planner_keys(keys: Mapping[str, Any]) -> Part:
    return {"threshold": keys["threshold_m"], "look_ahead_steps": keys["look_ahead_steps"]}


def _surface_parts(vary: Mapping[str, Any]) -> dict[str, Part]:
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


def paper_rows(plan: Mapping[str, Any], study: str, part: Mapping[str, Any]) -> list[Row]:
    """The rows of one part of a study."""
    return _STUDIES[study](paper_scene(plan), **part)


def general_nominal(scene: PaperScene, curve: str, centre: str) -> QuasistaticMotion:
    """Quasi-static motion of the general object along a curve, with its centre of mass at a named place.

    ASSUME: the object starts as its footprint alone would settle, its centroid behind the anchor, whatever the load:
    so what an eccentric load does shows from the start.
    """
    towed = scene.general[centre]
    patch = sliding_patch(resting_pressure(towed), fitted_law(scene.friction).law)
    specification = timed(scene.curves[curve], scene.time_step, duration=scene.duration)
    heading = settled_heading(towed, path_heading(specification.position[:3])[0])
    return quasistatic_plan(towed, patch, specification, scene.tether, start_heading=heading)


def settled_heading(towed: TowedObject, direction: float) -> float:
    """Heading at which the centroid of the footprint lies straight behind the anchor [rad]."""
    lever = towed.anchor - polygon_centroid(towed.patch.outline)
    return float(direction - np.arctan2(lever[1], lever[0]))


def _nominal_rows(scene: PaperScene, curve: str, centre: str) -> list[Row]:
    nominal = general_nominal(scene, curve, centre)
    seconds = _cpu_seconds(lambda: general_nominal(scene, curve, centre))
    common = {
        "curve": curve,
        "centre": centre,
        "steps": len(nominal.time_s) - 1,
        "compute_time_s": seconds,
        "findings": " ".join(finding.code for finding in nominal.findings),
    }
    return [common | row for row in _motion_rows(nominal)]


def _motion_rows(nominal: QuasistaticMotion) -> list[Row]:
    shown = _shown(len(nominal.time_s))
    columns = {
        "time_s": nominal.time_s,
        "x_m": nominal.pose[:, 0],
        "y_m": nominal.pose[:, 1],
        "heading_rad": nominal.pose[:, 2],
        "hinge_x_m": nominal.hinge.position[:, 0],
        "hinge_y_m": nominal.hinge.position[:, 1],
        "force_x_n": nominal.tether_force[:, 0],
        "force_y_n": nominal.tether_force[:, 1],
    }
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*(v[shown] for v in columns.values()), strict=True)
    ]


def _shown(count: int) -> Array:
    return np.unique(np.linspace(0, count - 1, min(count, SHOWN_ROWS + 1)).round().astype(int))


def _path_rows(common: Row, position: Array) -> list[Row]:
    return [common | {"x_m": x, "y_m": y} for x, y in position[_shown(len(position))]]


def _feedforward_path_rows(scene: PaperScene, curve: str, speeds: list[float]) -> list[Row]:
    patch, rows = resting_patch(scene), []
    for speed in speeds:
        step = scene.curves[curve].length / speed / STEPS_AT_ANY_SPEED
        nominal = cube_nominal(scene, patch, curve, step, speed=speed)
        motion = feedforward_motion(scene, patch, nominal)
        rows += _path_rows({"curve": curve, "path": "feedforward", "mean_speed_m_s": speed}, motion.pose[:, :2])
    return rows + _path_rows({"curve": curve, "path": "nominal", "mean_speed_m_s": 0.0}, nominal.pose[:, :2])


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


def _loop_rows(scene: PaperScene, curve: str, **settings: Any) -> list[Row]:
    """Ways of rover and object step by step, with the planner's cases, Fig. 5; the first row holds the numbers."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    loop = planned_loop(scene, patch, nominal, **settings)
    seconds = _cpu_seconds(lambda: planned_loop(scene, patch, nominal, **settings))
    rows = [{"row": "numbers", "curve": curve, "compute_time_s": seconds} | settings | loop_numbers(loop, nominal)]
    rows += _path_rows({"row": "nominal object"}, nominal.pose[:, :2])
    rows += _path_rows({"row": "nominal rover"}, nominal.hinge.position)
    case_at = np.array([case.name for case in PlanCase])[loop.rover.case]
    at = np.searchsorted(loop.rover.time_s, loop.towed.time_s).clip(max=len(case_at) - 1)
    for name, position, case in (("rover", loop.rover.hinge, case_at), ("object", loop.towed.pose, case_at[at])):
        rows += [
            {"row": name, "x_m": x, "y_m": y, "case": letter}
            for (x, y), letter in zip(position[:, :2], case, strict=True)
        ]
    return rows


def _cpu_seconds(run: Callable[[], object]) -> float:
    start = time.process_time()
    run()
    return time.process_time() - start


def _threshold_rows(scene: PaperScene, curve: str, thresholds: list[float], shown: list[float]) -> list[Row]:
    """A row of numbers a threshold, and the paths of rover and object for those that are shown, Fig. 7."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    rows = _path_rows({"curve": curve, "row": "nominal object"}, nominal.pose[:, :2])
    rows += _path_rows({"curve": curve, "row": "nominal rover"}, nominal.hinge.position)
    for threshold in sorted({*thresholds, *shown}):
        loop = planned_loop(scene, patch, nominal, threshold=threshold)
        common = {"curve": curve, "threshold_m": threshold}
        rows.append(common | {"row": "numbers"} | loop_numbers(loop, nominal))
        if threshold in shown:
            rows += _path_rows(common | {"row": "object"}, loop.towed.pose[:, :2])
            rows += _path_rows(common | {"row": "rover"}, loop.rover.hinge)
    return rows


def _wheelbase_rows(scene: PaperScene, curve: str, wheelbase: float, thresholds: list[float]) -> list[Row]:
    """Which thresholds arrive with a rover of another wheelbase: the paper does not give its own."""
    positions = scene.rover.wheel_positions * [wheelbase / np.ptp(scene.rover.wheel_positions[:, 0]), 1.0]
    scene = replace(scene, rover=replace(scene.rover, wheel_positions=positions))
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, curve, scene.planner_step)
    common = {"curve": curve, "wheelbase_m": wheelbase}
    return [common | loop_row(scene, patch, nominal, threshold=threshold) for threshold in thresholds]


_STUDIES = {
    "contact": contact_rows,
    "meshes": mesh_rows,
    "nominal": _nominal_rows,
    "speeds": lambda scene, curve, speed: [speed_row(scene, curve, speed, STEPS_AT_ANY_SPEED)],
    "time_steps": lambda scene, curve, speed, time_step: [time_step_row(scene, curve, speed, time_step)],
    "stiffnesses": stiffness_rows,
    "feedforward_paths": _feedforward_path_rows,
    "starts": _start_rows,
    "loop": _loop_rows,
    "thresholds": _threshold_rows,
    "wheelbases": _wheelbase_rows,
    "surface": surface_rows,
}
