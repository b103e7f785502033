"""Small studies of single sentences of the paper that belong to none of its figures.

Every part gives rows that share one table; the column ``row`` names the part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
import shapely

from studies.frame import Part, Row
from studies.paper.closed_loop import planned_loop
from studies.paper.dynamics import feedback_motion, feedforward_motion, rms_in_time
from studies.paper.finite_volumes import mesh_pressure, meshed_patch
from studies.paper.law_shapes import law_shape_rows
from studies.paper.nominal import cube_nominal
from studies.paper.scene import PaperScene, paper_study
from studies.rover_geometry import feasible_pieces, is_feasible
from towval.model import Array, Sliding
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.physics.friction_laws import Makkar, fitted_law
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.wrench import SlidingPatch, friction_wrench
from towval.planning.feasible_region import feasible_piece, flanks
from towval.planning.kinematics import Rover, rolling_matrix, steering_of_twist
from towval.planning.paths import lemniscate, timed
from towval.planning.scene import resting_patch

UNLIMITED = np.radians(89.9)
"""Steering range to either side of a rover whose steering is not limited [rad]."""

WIDER = 2.0
"""How much wider the wider lemniscate is."""

LESS_FRICTION = 0.99
"""Part of its planned friction that the disturbed object meets."""

ANISOTROPY = 1.1
"""Friction across over that along the body of the anisotropic object."""

EXTENT_M = 6.0
"""Half width of the square about the rover in which feasible centres are looked for [m]."""

SEGMENTS = 1000


def limit_rows(scene: PaperScene, threshold: float, look_ahead_steps: int) -> list[Row]:
    """RMS of the rover on the lemniscate with its steering limits and without, with the settings of Fig. 5."""
    patch = resting_patch(scene)
    nominal = cube_nominal(scene, patch, "lemniscate", scene.planner_step)
    rows: list[Row] = []
    for steering, rover in (("limited", scene.rover), ("unlimited", without_limits(scene.rover))):
        loop = planned_loop(
            replace(scene, rover=rover), patch, nominal, threshold=threshold, look_ahead_steps=look_ahead_steps
        )
        rows.append({"steering": steering, "rover_rms_m": loop.rover.rms, "outcome": str(loop.rover.outcome)})
    return rows


def without_limits(rover: Rover) -> Rover:
    """The rover with wheels that steer by a quarter turn to either side."""
    return replace(rover, steering_ranges=np.tile([-UNLIMITED, UNLIMITED], (4, 1)))


def wider_rows(scene: PaperScene, thresholds: list[float], width: float) -> list[Row]:
    """Which thresholds arrive on the paper's lemniscate and on a wider one."""
    patch, rows = resting_patch(scene), []
    for factor in (1.0, WIDER):
        wide = replace(scene, curves={**scene.curves, "lemniscate": lemniscate(factor * width)})
        nominal = cube_nominal(wide, patch, "lemniscate", scene.planner_step)
        for threshold in thresholds:
            loop = planned_loop(wide, patch, nominal, threshold=threshold)
            rows.append({"width_m": factor * width, "threshold_m": threshold, "outcome": str(loop.rover.outcome)})
    return rows


def disturbed_rows(scene: PaperScene, speed: float) -> list[Row]:
    """RMS of feedforward and feedback where friction is as planned and where it is a little less."""
    patch, rows = resting_patch(scene), []
    nominal = cube_nominal(scene, patch, "lemniscate", 0.1, speed=speed)
    for part, met in ((1.0, patch), (LESS_FRICTION, slippery(scene))):
        motions = {
            "feedforward": feedforward_motion(scene, met, nominal),
            "feedback": feedback_motion(scene, met, nominal),
        }
        rows += [
            {"friction": part, "dynamics": name, "rms_m": rms_in_time(motion, nominal)}
            for name, motion in motions.items()
        ]
    return rows


def slippery(scene: PaperScene) -> SlidingPatch:
    """The object on a floor with a little less friction."""
    friction = scene.friction
    less = replace(friction, static=LESS_FRICTION * friction.static, kinetic=LESS_FRICTION * friction.kinetic)
    return resting_patch(replace(scene, friction=less))


def law_rows(scene: PaperScene) -> list[Row]:
    """Makkar's law beside the four numbers that it is made for: its peak, where it is, and what is left behind it."""
    asked = scene.peaked_friction
    law = cast(Makkar, fitted_law(asked).law)
    speed = np.geomspace(0.01 * asked.stiction_velocity, 100 * asked.friction_velocity, 20001)
    friction = law.coefficient(speed)
    settled = law.coefficient(asked.friction_velocity) - asked.kinetic
    return [
        {
            "static": float(friction.max() / asked.static),
            "stiction_velocity": float(speed[np.argmax(friction)] / asked.stiction_velocity),
            "kinetic": float(friction[-1] / asked.kinetic),
            "left_at_friction_velocity": float(settled / (asked.static - asked.kinetic)),
        }
    ]


def steered_rows(scene: PaperScene) -> list[Row]:
    """How far four wheels are from rolling together halfway from straight ahead to the tightest turn.

    Each wheel under the same PD control is then halfway to its own angle; so are both of the equivalent bicycle, whose
    motion the four wheels follow.
    """
    rover, tip = scene.rover, flanks(scene.rover).tips[0]
    turned = np.array([tip[1], -tip[0], 1.0])
    bicycle = 0.5 * steering_of_twist(rover.axles, turned)
    rate = (np.tan(bicycle[0]) - np.tan(bicycle[1])) / (rover.axles[0, 0] - rover.axles[1, 0])
    twist = np.array([1.0, np.tan(bicycle[0]) - rate * rover.axles[0, 0], rate])
    ways = {
        "four wheels": 0.5 * steering_of_twist(rover.wheel_positions, turned),
        "bicycle": steering_of_twist(rover.wheel_positions, twist),
    }
    return [{"control": name, "misaligned_rad": misalignment(rover, angles)} for name, angles in ways.items()]


def misalignment(rover: Rover, steering: Array) -> float:
    """Greatest angle between a wheel and the motion that suits all wheels best [rad]."""
    # A wheel slips sideways by what it would roll, were it steered a quarter turn further.
    slip = rolling_matrix(rover.wheel_positions, steering + np.pi / 2)
    twist = np.linalg.svd(slip)[2][-1]
    twist = twist * np.sign(np.sum(rolling_matrix(rover.wheel_positions, steering) @ twist))
    apart = steering_of_twist(rover.wheel_positions, twist) - steering
    return float(np.abs(np.arctan2(np.sin(apart), np.cos(apart))).max())


def area_rows(scene: PaperScene) -> list[Row]:
    """The areas of feasible centres; of segments between points of a flank, how many stay feasible."""
    rover, sides = scene.rover, {(1,) * 4, (-1,) * 4}
    rows: list[Row] = [
        {
            "area": "flank" if piece.sides in sides else "other",
            "size_m2": shapely.Polygon(piece.polygon(EXTENT_M)).area,
            "under_the_rover": float(piece.contains(np.zeros(2))),
        }
        for piece in feasible_pieces(rover, EXTENT_M)
    ]
    random = np.random.default_rng(1)
    points = random.uniform(-EXTENT_M, EXTENT_M, (40 * SEGMENTS, 2))
    inside = points[feasible_piece(rover, (1,) * 4).contains(points)]
    starts, ends = inside[:SEGMENTS], random.permutation(inside)[:SEGMENTS]
    along = starts[:, None] + np.linspace(0, 1, 51)[:, None] * (ends - starts)[:, None]
    return [*rows, {"area": "segments", "feasible": float(is_feasible(rover, along).all(axis=1).mean())}]


def plane_rows(scene: PaperScene, heights: float) -> list[Row]:
    """The nominal motion with the pressure computed once, and solved anew at every instant together with the friction.

    A tether with a trace of mass makes the package leave the plane, in which it knows that the pressure stays.
    """
    specification = timed(scene.curves["lemniscate"], 1.0, duration=scene.duration)
    law = Sliding(fitted_law(scene.friction).law)
    once = quasistatic_plan(scene.towed, law, specification, scene.tether)
    always = quasistatic_plan(
        replace(scene.towed, anchor_height=heights),
        law,
        specification,
        replace(scene.tether, mass_per_length=1e-9),
        hinge_height=heights,
    )
    weight = scene.towed.mass * GRAVITY_M_PER_S2
    return [
        {
            "force_apart": float(np.abs(always.tether_force - once.tether_force).max() / weight),
            "heading_apart_rad": float(np.abs(always.pose[:, 2] - once.pose[:, 2]).max()),
        }
    ]


def direction_rows(scene: PaperScene, element_size: float) -> list[Row]:
    """Friction along and across the body on a mesh, where friction across is larger."""
    towed = scene.towed
    pressure = mesh_pressure(towed.patch, [(towed.mass * GRAVITY_M_PER_S2, towed.centre_of_mass)], element_size)
    patch = anisotropic_patch(pressure, scene)
    along, across = np.abs(friction_wrench(patch, [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]))[[0, 1], [0, 1]]
    return [{"along_n": float(along), "across_n": float(across)}]


def anisotropic_patch(pressure: Any, scene: PaperScene) -> SlidingPatch:
    """A pressed mesh with more friction across the body than along it."""
    return meshed_patch(pressure, fitted_law(scene.friction).law, anisotropy=[[1.0, 0.0], [0.0, ANISOTROPY**2]])


_ROWS: dict[str, Callable[..., list[Row]]] = {
    "limits": limit_rows,
    "wider": wider_rows,
    "disturbed": disturbed_rows,
    "law": law_rows,
    "law_shapes": law_shape_rows,
    "steered": steered_rows,
    "areas": area_rows,
    "plane": plane_rows,
    "direction": direction_rows,
}


def _rows(scene: PaperScene, part: str, **given: Any) -> list[Row]:
    return [{"row": part} | row for row in _ROWS[part](scene, **given)]


def _parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    loop, vary = plan["closed_loop"], plan["sensitivity"]
    given: dict[str, Part] = {
        "limits": {"threshold": loop["threshold_m"], "look_ahead_steps": loop["look_ahead_steps"]},
        "wider": {"thresholds": vary["thresholds_m"], "width": plan["curves"]["lemniscate_width_m"]},
        "disturbed": {"speed": vary["fixed_speed_m_s"]},
        "law_shapes": {"speed": vary["fixed_speed_m_s"]},
        "plane": {"heights": 0.0},
        "direction": {"element_size": plan["general_object"]["element_size_m"]},
    }
    return {name: {"part": name, **given.get(name, {})} for name in _ROWS}


STUDY = paper_study(_parts, _rows)
