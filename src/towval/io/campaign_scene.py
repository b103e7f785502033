"""The scene of the simulation from campaign.yaml, and checks that its numbers do not contradict each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from towval.model import Array, FrictionSpecification, Ground, Load, MassSpread, Patch, Tether, TowingScene
from towval.model.errors import InputError
from towval.model.geometry import inside_polygon
from towval.model.inputs import deviations
from towval.physics.mass import spread_over, towed_object

Keys = Mapping[str, Any]

_BELOW = 2.0
"""Deviations of the difference by which static may be below kinetic friction and still mean "no peak"."""


def towing_scene(document: Keys) -> TowingScene:
    """The scene of a campaign.yaml that its schema has checked.

    Raises
    ------
    InputError
        When numbers contradict each other: feet or load not at the object, a weight beside the footprint, static
        friction below the kinetic one by more than their deviations, a mass given in two ways.
    """
    towed = document["object"]
    load, patch = _load(towed), _footprint(towed)
    scene = TowingScene(
        patch=patch,
        body_mass=towed["mass_kg"],
        load=load,
        anchor=np.array(towed["tether_anchor_m"], dtype=float),
        hinge=np.array(document["rover"]["tether_hinge_m"], dtype=float),
        tether=_tether(document["tether"]),
        friction=_friction(document["friction"]),
        spread=_spread(towed, patch),
        ground=Ground(gravity=document.get("gravity_m_per_s2", 9.81)),
    )
    _check_load(towed, load)
    _check_weight(scene)
    return _with_ordered_friction(scene, deviations(scene, document))


def outlines_of(rings: Sequence[Any]) -> list[Array]:
    """One ring [[x, y], ...] or a list of rings as a list of arrays (n, 2) [m]."""
    one = np.ndim(rings[0][0]) == 0
    return [np.array(ring, dtype=float) for ring in ([rings] if one else rings)]


def _footprint(towed: Keys) -> Patch:
    outlines = outlines_of(towed["footprint_m"])
    if len(outlines) > 1:
        top = np.array(towed["top_corners_m"], dtype=float)
        hull = shapely.MultiPoint(top).convex_hull
        for i, foot in enumerate(outlines):
            if not hull.intersects(shapely.Point(foot.mean(axis=0))):
                raise InputError(
                    f"campaign.yaml: object.footprint_m[{i}] is not under the object",
                    got=f"a foot about ({foot.mean(axis=0)[0]:g}, {foot.mean(axis=0)[1]:g}) m",
                    allowed=f"feet whose middle is within object.top_corners_m {top.tolist()}",
                    remedy="give the feet in metres, in the object's frame",
                )
    return Patch.of(outlines, towed.get("footprint_holes_m", ()))


def _spread(towed: Keys, patch: Patch) -> MassSpread | None:
    """Where the object's own mass is: as measured, or evenly over the top or the footprint."""
    measured = [key for key in ("centre_of_mass_m", "moment_of_inertia_kg_m2") if key in towed]
    if len(measured) == 1 or (measured and "mass_over" in towed):
        raise InputError(
            "campaign.yaml: how the object's mass is spread is not clear",
            got=", ".join(f"object.{key}" for key in (*measured, "mass_over") if key in towed),
            allowed="object.mass_over, or both object.centre_of_mass_m and object.moment_of_inertia_kg_m2",
        )
    if measured:
        inertia = towed["moment_of_inertia_kg_m2"]
        return MassSpread(towed["centre_of_mass_m"], float(np.sqrt(inertia / towed["mass_kg"])))
    over = towed.get("mass_over", "top" if patch.further else "footprint")
    return spread_over(Patch(towed["top_corners_m"])) if over == "top" else None


def _tether(tether: Keys) -> Tether:
    return Tether(
        rest_length=tether["rest_length_m"],
        stiffness=tether["stiffness_N_per_m"],
        damping=tether.get("damping_Ns_per_m", 0.0),
    )


def _friction(friction: Keys) -> FrictionSpecification:
    if friction["stiction_velocity_m_per_s"] >= friction["friction_velocity_m_per_s"]:
        raise InputError(
            "campaign.yaml: friction.stiction_velocity_m_per_s is not below friction_velocity_m_per_s",
            got=f"{friction['stiction_velocity_m_per_s']} and {friction['friction_velocity_m_per_s']} m/s",
            allowed="stiction velocity < friction velocity",
        )
    return FrictionSpecification(
        static=friction["static"],
        kinetic=friction["kinetic"],
        stiction_velocity=friction["stiction_velocity_m_per_s"],
        friction_velocity=friction["friction_velocity_m_per_s"],
        law=friction.get("law", "makkar"),
    )


def _with_ordered_friction(scene: TowingScene, std: Mapping[str, float]) -> TowingScene:
    """Static below kinetic friction within their deviations means that there is no peak."""
    friction = scene.friction
    least = friction.kinetic - _BELOW * float(np.hypot(std["friction"], std["static_friction"]))
    if friction.static >= friction.kinetic:
        return scene
    if friction.static < least:
        raise InputError(
            "campaign.yaml: friction.static is below friction.kinetic by more than their deviations explain",
            got=f"static {friction.static:g} ± {std['static_friction']:g}, "
            f"kinetic {friction.kinetic:g} ± {std['friction']:g}",
            allowed=f"static >= kinetic, or down to {least:.3g}, which is taken as no peak",
            remedy="measure both again, or state their real deviations (friction.static_std, friction.kinetic_std)",
        )
    return replace(scene, friction=replace(friction, static=friction.kinetic))


def _load(towed: Keys) -> Load:
    keys = towed.get("load", {"mass_kg": 0.0, "at_m": [0.0, 0.0]})
    return Load(
        mass=keys["mass_kg"],
        at=np.array(keys["at_m"], dtype=float),
        size=np.array(keys.get("size_m", [0, 0, 0]), dtype=float),
    )


def _check_load(towed: Keys, load: Load) -> None:
    """The load must stand on the top."""
    top = np.array(towed["top_corners_m"], dtype=float)
    if "load" in towed and not inside_polygon(top, load.at):
        raise InputError(
            "campaign.yaml: object.load.at_m is not on the object's top",
            got=load.at.tolist(),
            allowed=f"a point inside object.top_corners_m {top.tolist()}",
            remedy="give the centre of the load in metres, in the object's frame",
        )


def _check_weight(scene: TowingScene) -> None:
    """The weight of object and load must act within the hull of the footprint, or the object tips over."""
    hull = shapely.MultiPoint(scene.patch.corners).convex_hull
    centre = towed_object(scene).centre_of_mass
    point = shapely.Point(centre)
    if not hull.contains(point):
        raise InputError(
            "campaign.yaml: the weight of the object and its load is not on object.footprint_m",
            got=f"centre of mass ({centre[0]:.3f}, {centre[1]:.3f}) m, {hull.distance(point):.3f} m outside",
            allowed="a centre of mass inside the convex hull of the footprint",
            remedy="check object.footprint_m, object.mass_kg and object.load",
        )
