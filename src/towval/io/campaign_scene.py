"""The scene of the simulation from campaign.yaml, and checks that its numbers do not contradict each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from towval.model import Array, FloorRegion, FrictionSpecification, Ground, Load, MassSpread, Patch, Tether, TowingScene
from towval.model.errors import Faults, InputError
from towval.model.geometry import inside_polygon, polygon_area
from towval.model.inputs import INPUTS, deviations, stated_in
from towval.physics.footprint import convex_hull, footprint_polygon
from towval.physics.mass import spread_over, towed_object

Keys = Mapping[str, Any]

LEAST_TOP_M2 = 1e-4
"""A square centimetre: less is a slip of the unit or three corners in a row."""

_LEAST_FOOT_M2 = 1e-10

_TOUCHING_M2 = 1e-9
"""Regions side by side overlap by rounding where a corner of one lies along a slanted edge of the other."""

_BELOW = 2.0
"""Deviations of the difference by which static may be below kinetic friction and still mean "no peak"."""


def towing_scene(document: Keys) -> TowingScene:
    """The scene of a campaign.yaml that its schema has checked.

    Raises `InputError` where numbers contradict each other (footprint, load, masses, tether, friction and its regions)
    or the object would slide down the floor or tip over.
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
        anchor_height=towed.get("tether_anchor_height_m", 0.0),
        hinge_height=document["rover"].get("tether_hinge_height_m", 0.0),
        centre_of_mass_height=_centre_of_mass_height(document),
        ground=_ground(document),
    )
    faults = Faults()
    scene = faults.attempt(_with_ordered_friction, scene, deviations(scene, document)) or scene
    stiffening, full_load = document["tether"].get("stiffening", 0.0), scene.friction.static * scene.weight
    scene = replace(scene, tether=replace(scene.tether, stiffening=stiffening, full_load=full_load))
    faults.attempt(_check_load, towed, load)
    faults.attempt(_check_proportions, scene, towed)
    faults.attempt(_check_extent, scene, towed)
    faults.attempt(_check_deviations, scene, document)
    faults.attempt(_check_weight, scene)
    faults.attempt(_check_tether, scene)
    if not faults:
        faults.attempt(_check_tipping, scene)
    faults.raise_any("campaign.yaml")
    return scene


def outline(corners: Any, key: str, least: float) -> Array:
    """The corners (n, 2) of an outline that encloses at least an area and does not cross itself.

    ``least`` is in the square of the unit of the corners; raises `InputError` with the key of campaign.yaml.
    """
    points = np.array(corners, dtype=float)
    wrong = (
        f"{key} encloses no area"
        if not abs(polygon_area(points)) >= least
        else f"the outline of {key} crosses itself"
        if not shapely.Polygon(points).is_valid
        else None
    )
    if wrong:
        raise InputError(
            f"campaign.yaml: {wrong}",
            got=points.tolist(),
            allowed="the corners of a polygon, one after the other around it",
        )
    return points


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
    for i, ring in enumerate(outlines):
        outline(ring, f"object.footprint_m[{i}]" if len(outlines) > 1 else "object.footprint_m", _LEAST_FOOT_M2)
    patch = Patch.of(outlines, towed.get("footprint_holes_m", ()))
    try:
        footprint_polygon(patch)
    except InputError as error:
        keys = "campaign.yaml: object.footprint_m with its footprint_holes_m"
        raise InputError(f"{keys} is no simple polygon", got=error.got, allowed=error.allowed) from None
    return patch


def _spread(towed: Keys, patch: Patch) -> MassSpread:
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
    if over == "top":
        return spread_over(Patch(outline(towed["top_corners_m"], "object.top_corners_m", LEAST_TOP_M2)))
    return spread_over(patch)


def _tether(tether: Keys) -> Tether:
    return Tether(
        rest_length=tether["rest_length_m"],
        stiffness=tether["stiffness_N_per_m"],
        damping=tether.get("damping_Ns_per_m", 0.0),
        mass_per_length=tether.get("mass_kg_per_m", 0.0),
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
        law=friction.get("law", FrictionSpecification.law),
        across_over_along=friction.get("across_over_along", 1.0),
        radius_over_planar=friction.get("radius_over_planar", 1.0),
    )


def _centre_of_mass_height(document: Keys) -> float:
    """The stated height; else half that of the top if a height of the tether's ends or a slope is stated, else 0."""
    towed, rover = document["object"], document["rover"]
    heights = "tether_anchor_height_m" in towed or "tether_hinge_height_m" in rover
    default = 0.5 * towed["tracked_plane_height_m"] if heights or "slope_mm_per_m" in document["floor"] else 0.0
    return float(towed.get("centre_of_mass_height_m", default))


def _ground(document: Keys) -> Ground:
    slope = 1e-3 * np.array(document["floor"].get("slope_mm_per_m", [0.0, 0.0]))
    regions = document["friction"].get("regions", ())
    polygons = [shapely.Polygon(region["outline_m"]) for region in regions]
    for i, polygon in enumerate(polygons):
        where = f"campaign.yaml: friction.regions[{i}].outline_m"
        if not polygon.is_valid:
            raise InputError(f"{where} is no simple polygon", got=shapely.is_valid_reason(polygon))
        others = [j for j in range(i) if polygon.intersection(polygons[j]).area > _TOUCHING_M2]
        if others:
            raise InputError(
                f"{where} overlaps another region", got=f"regions {others[0]} and {i}", allowed="regions side by side"
            )
    return Ground(
        gravity=document.get("gravity_m_per_s2", Ground.gravity),
        slope=slope,
        regions=tuple(FloorRegion(region["outline_m"], region["factor"]) for region in regions),
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
    """Refuse a load whose centre is not on the top."""
    top = np.array(towed["top_corners_m"], dtype=float)
    if "load" in towed and not inside_polygon(top, load.at):
        raise InputError(
            "campaign.yaml: object.load.at_m is not on the object's top",
            got=load.at.tolist(),
            allowed=f"a point inside object.top_corners_m {top.tolist()}",
            remedy="give the centre of the load in metres, in the object's frame",
        )


_DENSITIES = 1.0, 25_000.0
_MOST_STRETCH = 5.0
_MOST_DAMPING = 20.0
"""Densities from foam to osmium [kg/m³]; stretch at the friction limit over the rest length; damping over critical."""


def _check_proportions(scene: TowingScene, towed: Keys) -> None:
    """Question numbers that are possible alone but not together: usually a wrong unit or a misplaced point."""
    top = abs(polygon_area(np.array(towed["top_corners_m"], dtype=float)))
    bodies = {"object.mass_kg": (scene.body_mass, top * towed["tracked_plane_height_m"])}
    if scene.load.mass > 0:
        bodies["object.load.mass_kg"] = scene.load.mass, float(np.prod(scene.load.size))
    for key, (mass, volume) in bodies.items():
        if volume > 0 and not _DENSITIES[0] <= mass / volume <= _DENSITIES[1]:
            raise InputError(
                f"campaign.yaml: {key} does not go with its size",
                got=f"{mass:g} kg in {1e3 * volume:.3g} litres",
                allowed=f"{_DENSITIES[0]:g} to {_DENSITIES[1]:g} kg/m³",
                remedy="check the units: kilograms and metres",
            )
    tether, pull = scene.tether, scene.friction.static * scene.weight
    if pull > _MOST_STRETCH * tether.stiffness * tether.rest_length:
        raise InputError(
            "campaign.yaml: tether.rest_length_m and tether.stiffness_N_per_m do not go with the weight of the object",
            got=f"{pull / tether.stiffness:.3g} m of stretch before the object slides, on {tether.rest_length:g} m",
            allowed=f"at most {_MOST_STRETCH:g} times the rest length",
            remedy="check the units: metres of rest length, newtons per metre of stretch",
        )
    critical = scene.critical_damping
    if tether.damping > _MOST_DAMPING * critical:
        raise InputError(
            "campaign.yaml: tether.damping_Ns_per_m is out of proportion",
            got=f"{tether.damping:g}, {tether.damping / critical:.0f} times the critical damping",
            allowed=f"at most {_MOST_DAMPING * critical:.3g}",
            remedy="check the units: newtons per metre a second",
        )


_LEAST_GYRATION = 0.1
"""Radius of gyration over the object's reach; evenly spread masses have half of it or more."""


def _check_extent(scene: TowingScene, towed: Keys) -> None:
    """Question where the object's mass and its sole are beside its top, which the camera sees."""
    top = np.array(towed["top_corners_m"], dtype=float)
    highest = towed["tracked_plane_height_m"] + float(scene.load.size[2])
    if "centre_of_mass_height_m" in towed and scene.centre_of_mass_height > highest:
        raise InputError(
            "campaign.yaml: object.centre_of_mass_height_m is above the object",
            got=f"{scene.centre_of_mass_height:g} m",
            allowed=f"at most {highest:g} m, where the top (object.tracked_plane_height_m) with the load ends",
            remedy="check the units: metres above the floor",
        )
    reach = float(np.max(np.hypot(*(top[:, None] - top[None]).T)))
    sole = shapely.MultiPoint(convex_hull(scene.patch).exterior.coords).geoms
    beyond = max(shapely.Polygon(top).distance(corner) for corner in sole)
    if beyond > reach:
        raise InputError(
            "campaign.yaml: object.footprint_m does not go with object.top_corners_m",
            got=f"a corner {beyond:.3g} m outside a top of {reach:.3g} m",
            allowed="a footprint that reaches no farther beyond the top than that is long",
            remedy="check the units: metres in the object's frame",
        )
    if scene.spread is None or "moment_of_inertia_kg_m2" not in towed:
        return
    gyration = scene.spread.gyration
    if not _LEAST_GYRATION * reach / 2 <= gyration <= reach:
        raise InputError(
            "campaign.yaml: object.moment_of_inertia_kg_m2 does not go with the object's mass and size",
            got=f"{towed['moment_of_inertia_kg_m2']:g} kg m², as of {scene.body_mass:g} kg at {gyration:.3g} m from "
            "the middle",
            allowed=f"{_LEAST_GYRATION * reach / 2:.2g} to {reach:.2g} m",
            remedy="check the units: kilograms times square metres, without the load",
        )


def _check_deviations(scene: TowingScene, document: Keys) -> None:
    """Question stated deviations of positive inputs that are no smaller than their values: usually a wrong unit."""
    for row in INPUTS.values():
        key, value = row.stated.key if row.stated else "", row.values(scene)
        std = stated_in(document, key)
        # Inputs that act by their size, such as heights and damping, may be known to be small and no more.
        if std is None or len(value) > 1 or not 0 < value[0] <= std or row.acts_by_size(scene, -float(value[0])):
            continue
        raise InputError(
            f"campaign.yaml: {key} is not below the value it belongs to",
            got=f"{row.label} {value[0]:g} ± {std:g} {row.unit}".rstrip(),
            allowed=f"below {value[0]:g}",
            remedy="check the units: a deviation has that of its value",
        )


def _check_weight(scene: TowingScene) -> None:
    """The weight of object and load must act within the hull of the footprint, or the object tips over."""
    hull = convex_hull(scene.patch)
    centre = towed_object(scene).centre_of_mass
    point = shapely.Point(centre)
    if not hull.contains(point):
        raise InputError(
            "campaign.yaml: the weight of the object and its load is not on object.footprint_m",
            got=f"centre of mass ({centre[0]:.3f}, {centre[1]:.3f}) m, {hull.distance(point):.3f} m outside",
            allowed="a centre of mass inside the convex hull of the footprint",
            remedy="check object.footprint_m, object.mass_kg and object.load",
        )


def _check_tether(scene: TowingScene) -> None:
    """It must reach from the height of the anchor to that of the hinge, and be lighter than what it tows."""
    tether, rise = scene.tether, abs(scene.hinge_height - scene.anchor_height)
    if rise >= tether.rest_length:
        raise InputError(
            "campaign.yaml: the tether is shorter than its ends are apart in height",
            got=f"tether.rest_length_m {tether.rest_length:g}, heights of hinge and anchor {scene.hinge_height:g} "
            f"and {scene.anchor_height:g} m",
            allowed=f"a rest length above {rise:g} m",
            remedy="check rover.tether_hinge_height_m and object.tether_anchor_height_m",
        )
    if tether.mass_per_length * tether.rest_length > scene.mass:
        raise InputError(
            "campaign.yaml: the tether is heavier than the object and its load",
            got=f"tether.mass_kg_per_m {tether.mass_per_length:g} over {tether.rest_length:g} m, object "
            f"{scene.mass:g} kg",
            allowed="a tether lighter than what it tows",
            remedy="check the units: kilograms per metre",
        )


def _check_tipping(scene: TowingScene) -> None:
    """Refuse an object that slides down the slope, or whose centre of pressure leaves the footprint's hull when towed.

    Under a pull with the horizontal part ``T = μ N`` and the slope tan β, ``N = W / (1 + μ tan β)``, and the moment
    about the centre of mass puts the centre of pressure ``μ (h_a − q tan β)`` ahead of it, q the lever of the anchor.
    """
    friction, slope = scene.friction, float(np.hypot(*scene.ground.slope))
    if slope >= friction.static:
        raise InputError(
            "campaign.yaml: the object slides down the floor by itself",
            got=f"a slope of {1e3 * slope:.0f} mm per m with friction.static {friction.static:g}",
            allowed=f"below {1e3 * friction.static:.0f} mm per m",
        )
    towed = towed_object(scene)
    lever = towed.anchor - towed.centre_of_mass
    reach, rise = float(np.hypot(*lever)), scene.hinge_height - scene.anchor_height
    # The longer a soft tether gets until the object slides, the less it slopes.
    length = scene.tether.rest_length + friction.kinetic * scene.weight / scene.tether.stiffness
    incline = rise / np.sqrt(length**2 - rise**2)
    ahead = friction.kinetic * (scene.anchor_height - reach * incline)
    hull = convex_hull(scene.patch)
    place = towed.centre_of_mass + (ahead / reach * lever if reach > 0 else 0.0)
    if reach > 0 and not hull.contains(shapely.Point(place)):
        raise InputError(
            "campaign.yaml: the object tips over when it is towed",
            got=f"anchor {scene.anchor_height:g} m and hinge {scene.hinge_height:g} m above the floor, which puts the "
            f"centre of pressure {abs(ahead):.3f} m from the centre of mass, outside object.footprint_m",
            allowed="a centre of pressure within the footprint",
            remedy="check object.tether_anchor_height_m and rover.tether_hinge_height_m, in metres",
        )
