"""The scene of the paper's figures, built from the configuration's section ``plan``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from towval.geometry import polygon_area, polygon_centroid
from towval.physics.friction_law import fit_makkar
from towval.rover import paths
from towval.rover.kinematics import Rover, symmetric_rover
from towval.rover.planner import PlannerSettings
from towval.types import Array, FrictionLaw, FrictionWish, Patch, Tether, TowedObject

CURVES = ("line", "circle", "lemniscate", "rounded_square")
"""The four curves in the order of Fig. 4."""


@dataclass(frozen=True)
class PaperScene:
    """What all of the paper's figures share.

    ``general`` objects by the name of their centre of mass and ``cube``; ``friction`` the four numbers of the
    law, ``peaked_friction`` those of another with a peak;
    ``planner_step`` [s] the step of the rover's control; ``duration`` and ``time_step`` [s] of the nominal paths.
    """

    general: dict[str, TowedObject]
    cube: TowedObject
    friction: FrictionWish
    peaked_friction: FrictionWish
    tether: Tether
    rover: Rover
    planner: PlannerSettings
    planner_step: float
    curves: dict[str, paths.Curve]
    duration: float
    time_step: float


def paper_scene(plan: Mapping[str, Any]) -> PaperScene:
    """Build the scene from a section ``plan`` that its schema has checked."""
    shape, load, tether = plan["general_object"], plan["cube"], plan["tether"]
    rover, planner = plan["rover"], plan["planner"]
    half = load["side_m"] / 2
    square = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return PaperScene(
        general={
            name: towed_object(shape["outline_m"], shape["mass_kg"], centre, shape["anchor_m"])
            for name, centre in shape["centres_of_mass_m"].items()
        },
        cube=towed_object(square, load["mass_kg"], load["centre_of_mass_m"], load["anchor_m"]),
        friction=_friction(plan["friction"]),
        peaked_friction=_friction(plan["peaked_friction"]),
        tether=Tether(tether["rest_length_m"], tether["stiffness_n_m"]),
        rover=symmetric_rover(
            rover["wheelbase_m"],
            rover["track_m"],
            rover["wheel_radius_m"],
            outward=np.radians(rover["outward_deg"]),
            inward=np.radians(rover["inward_deg"]),
            hinge=rover["hinge_m"],
        ),
        planner=PlannerSettings(
            threshold=planner["threshold_m"],
            look_ahead_steps=planner["look_ahead_steps"],
            proportional_gain=planner["proportional_gain"],
            derivative_gain=planner["derivative_gain"],
            close_distance=planner["close_distance_m"],
            arrival_distance=planner["arrival_distance_m"],
            stray_distance=planner["stray_distance_m"],
        ),
        planner_step=planner["time_step_s"],
        curves=_curves(plan["curves"]),
        duration=plan["quasi_static"]["duration_s"],
        time_step=plan["quasi_static"]["time_step_s"],
    )


def _friction(keys: Mapping[str, float]) -> FrictionWish:
    return FrictionWish(keys["static"], keys["kinetic"], keys["stiction_velocity_m_s"], keys["friction_velocity_m_s"])


def friction_law(wish: FrictionWish) -> FrictionLaw:
    """Makkar's law for the four numbers."""
    return fit_makkar(wish.static, wish.kinetic, wish.stiction_velocity, wish.friction_velocity).law


def _curves(sizes: Mapping[str, float]) -> dict[str, paths.Curve]:
    curves = (
        paths.line(sizes["line_length_m"]),
        paths.circle(sizes["circle_radius_m"]),
        paths.lemniscate(sizes["lemniscate_width_m"]),
        paths.rounded_square(sizes["square_side_m"], sizes["square_corner_radius_m"]),
    )
    return {curve.name: curve for curve in curves}


def towed_object(outline: Array, mass: float, centre_of_mass: Array, anchor: Array) -> TowedObject:
    """An object of uniform thickness on which a load has moved the centre of mass.

    ASSUME: the moment of inertia is that of the uniform footprint about its centroid, with the mass moved by Steiner's
    term to the centre of mass: the paper gives neither the load nor its place.

    Parameters
    ----------
    outline : array_like (n, 2)
        Footprint in the object's frame [m].
    mass : float
        With the load [kg].
    centre_of_mass, anchor : array_like (2,)
        In the object's frame [m].
    """
    patch = Patch(outline)
    centroid = polygon_centroid(patch.outline)
    offset = np.asarray(centre_of_mass, dtype=np.float64) - centroid
    inertia = mass * (_polar_radius_squared(patch.outline - centroid) + offset @ offset)
    return TowedObject(patch, mass, centre_of_mass, float(inertia), anchor)


def _polar_radius_squared(outline: Array) -> float:
    """Mean of ξ² + η² over a simple polygon about its own origin [m²] (Green)."""
    x, y = outline.T
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y1 - x1 * y
    moment = np.sum(cross * (x * x + x * x1 + x1 * x1 + y * y + y * y1 + y1 * y1)) / 12
    return float(moment / polygon_area(outline))
