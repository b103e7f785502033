"""The scene of a plan: object, tether, rover, planner and curves, from ``plan.yaml``."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from towval.model import Array, FrictionSpecification, Ground, Patch, Sliding, Tether, TowedObject
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import fitted_law
from towval.physics.mass import spread_over
from towval.physics.spatial.tow import is_planar
from towval.physics.wrench import SlidingPatch, sliding_patch
from towval.planning import paths
from towval.planning.kinematics import Rover, symmetric_rover
from towval.planning.planner import PlannerSettings


@dataclass(frozen=True)
class PlanScene:
    """Towed object, tether, rover and desired paths.

    ``towed``, the object; ``friction`` the four numbers of its law; ``planner_step`` the time step of the rover's
    control [s]; ``curves`` the desired paths by name; ``duration`` [s] of a path without times; ``ground``;
    ``hinge_height`` above the floor [m].
    """

    towed: TowedObject
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
    cube, tether, rover, planner = plan["cube"], plan["tether"], plan["rover"], plan["planner"]
    half = cube["side_m"] / 2
    square = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return PlanScene(
        towed=replace(
            object_with_load(square, cube["mass_kg"], cube["centre_of_mass_m"], cube["anchor_m"]),
            anchor_height=cube.get("anchor_height_m", 0.0),
            centre_of_mass_height=cube.get("centre_of_mass_height_m", 0.0),
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
            gravity=plan.get("gravity_m_s2", Ground.gravity),
            slope=1e-3 * np.array(plan.get("slope_mm_per_m", (0.0, 0.0))),
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


def object_with_load(outline: Array, mass: float, centre_of_mass: Array, anchor: Array) -> TowedObject:
    """An object of uniform thickness with a load that displaces the centre of mass.

    ``outline`` (n, 2), ``centre_of_mass`` (2,) and ``anchor`` (2,) in the object's frame [m]; ``mass`` with the load
    [kg]. ASSUME: the moment of inertia is that of the uniform footprint about its centroid plus Steiner's term, since
    the paper gives neither the load nor its position.
    """
    spread = spread_over(Patch(outline))
    offset = np.asarray(centre_of_mass, dtype=np.float64) - spread.centre
    inertia = mass * (spread.gyration**2 + offset @ offset)
    return TowedObject(Patch(outline), mass, centre_of_mass, float(inertia), anchor)


def friction_under(scene: PlanScene) -> Sliding | SlidingPatch:
    """Friction of the object: prepared for the plane of the floor where the scene does not leave it."""
    friction = scene.friction
    sliding = Sliding(fitted_law(friction).law, friction.across_over_along, friction.radius_over_planar)
    if is_planar(scene.towed, sliding, scene.tether, scene.ground, scene.hinge_height, None):
        return resting_patch(scene)
    return sliding


def resting_patch(scene: PlanScene) -> SlidingPatch:
    """The object's footprint under its weight, with its friction law."""
    return sliding_patch(resting_pressure(scene.towed, scene.ground.gravity), fitted_law(scene.friction).law)
