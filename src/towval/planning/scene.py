"""The scene of a plan: object, tether, rover, planner and curves, from ``plan.yaml``."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from towval.model import Array, FrictionSpecification, Ground, Patch, Sliding, Tether, TowedObject
from towval.model.geometry import polygon_area, polygon_centroid
from towval.physics.contact import pressure_plane
from towval.physics.friction_laws import fitted_law
from towval.physics.spatial.tow import is_planar
from towval.physics.wrench import SlidingPatch, sliding_patch
from towval.planning import paths
from towval.planning.kinematics import Rover, symmetric_rover
from towval.planning.planner import PlannerSettings


@dataclass(frozen=True)
class PlanScene:
    """Towed object, tether, rover and desired paths.

    ``cube`` is the towed object; ``friction`` the four numbers of its law; ``planner_step`` the time step of the
    rover's control [s]; ``curves`` the desired paths by name; ``duration`` [s] of a path without times;
    ``ground``; ``hinge_height`` above the floor [m].
    """

    cube: TowedObject
    friction: FrictionSpecification
    tether: Tether
    rover: Rover
    planner: PlannerSettings
    planner_step: float
    curves: dict[str, paths.Curve]
    duration: float
    ground: Ground = field(default_factory=Ground, kw_only=True)
    hinge_height: float = field(default=0.0, kw_only=True)


def plan_scene(plan: Mapping[str, Any]) -> PlanScene:
    """The scene of a ``plan.yaml`` that its schema has checked."""
    load, tether, rover, planner = plan["cube"], plan["tether"], plan["rover"], plan["planner"]
    half = load["side_m"] / 2
    square = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return PlanScene(
        cube=replace(
            towed_object(square, load["mass_kg"], load["centre_of_mass_m"], load["anchor_m"]),
            anchor_height=load.get("anchor_height_m", 0.0),
            centre_of_mass_height=load.get("centre_of_mass_height_m", 0.0),
        ),
        friction=friction_of(plan["friction"]),
        tether=Tether(
            tether["rest_length_m"], tether["stiffness_n_m"], mass_per_length=tether.get("mass_kg_per_m", 0.0)
        ),
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
        ground=Ground(
            gravity=plan.get("gravity_m_s2", 9.81), slope=1e-3 * np.array(plan.get("slope_mm_per_m", (0.0, 0.0)))
        ),
        hinge_height=rover.get("hinge_height_m", 0.0),
    )


def friction_of(keys: Mapping[str, float]) -> FrictionSpecification:
    """The four numbers of a friction law from a section of ``plan.yaml``."""
    return FrictionSpecification(
        keys["static"], keys["kinetic"], keys["stiction_velocity_m_s"], keys["friction_velocity_m_s"]
    )


def _curves(sizes: Mapping[str, float]) -> dict[str, paths.Curve]:
    curves = (
        paths.line(sizes["line_length_m"]),
        paths.circle(sizes["circle_radius_m"]),
        paths.lemniscate(sizes["lemniscate_width_m"]),
        paths.rounded_square(sizes["square_side_m"], sizes["square_corner_radius_m"]),
    )
    return {curve.name: curve for curve in curves}


def towed_object(outline: Array, mass: float, centre_of_mass: Array, anchor: Array) -> TowedObject:
    """An object of uniform thickness with a load that displaces the centre of mass.

    ``outline`` (n, 2), ``centre_of_mass`` (2,) and ``anchor`` (2,) in the object's frame [m]; ``mass`` with the load
    [kg]. ASSUME: the moment of inertia is that of the uniform footprint about its centroid plus Steiner's term, since
    the paper gives neither the load nor its position.
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


def friction_under(scene: PlanScene) -> Sliding | SlidingPatch:
    """Friction of the object: prepared for the plane of the floor where the scene does not leave it."""
    friction = scene.friction
    sliding = Sliding(fitted_law(friction).law, friction.across_over_along, friction.radius_over_planar)
    if is_planar(scene.cube, sliding, scene.tether, scene.ground, scene.hinge_height, None):
        return resting_patch(scene)
    return sliding


def resting_patch(scene: PlanScene) -> SlidingPatch:
    """The object's footprint under its weight, with its friction law."""
    weight = scene.cube.mass * scene.ground.gravity
    resting = pressure_plane(scene.cube.patch, [(weight, scene.cube.centre_of_mass)])
    return sliding_patch(resting, fitted_law(scene.friction).law)
