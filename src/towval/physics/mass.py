"""Mass properties of the towed object: footprint, own mass and load to centre of mass and inertia."""

import numpy as np

from towval.model import MassSpread, Patch, TowedObject, TowingScene
from towval.model.checks import instance_of
from towval.model.geometry import polygon_area, polygon_centroid, polygon_second_moment


def towed_object(scene: TowingScene) -> TowedObject:
    """Mass, centre of mass and inertia of the object with its load.

    ASSUME: the object's own mass is spread evenly over its footprint unless the scene says otherwise; the load is a
    homogeneous box.

    Parameters
    ----------
    scene : TowingScene
        Footprint, masses, their places and heights, and anchor.

    Returns
    -------
    TowedObject
        All of it in the object's frame; the inertia is about the vertical through the common centre of mass.

    Examples
    --------
    >>> from towval.model import FrictionSpecification, Load, Patch, Tether
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> load = Load(5.0, (0.1, 0.0), (0.1, 0.1, 0.1))
    >>> friction = FrictionSpecification(0.4, 0.35, 0.005, 0.07)
    >>> towed = towed_object(TowingScene(square, 5.0, load, (0.2, 0.0), (0.0, 0.0), Tether(0.6, 1000.0), friction))
    >>> towed.mass, towed.centre_of_mass.round(3).tolist()
    (10.0, [0.05, 0.0])
    """
    instance_of(scene, "scene", TowingScene)
    own, load = scene.spread or spread_over(scene.patch), scene.load
    mass = scene.body_mass + load.mass
    centre_of_mass = (scene.body_mass * own.centre + load.mass * load.at) / mass
    about_own_centres = scene.body_mass * own.gyration**2 + load.mass * np.sum(load.size[:2] ** 2) / 12
    apart = own.centre - centre_of_mass, load.at - centre_of_mass
    steiner = scene.body_mass * np.sum(apart[0] ** 2) + load.mass * np.sum(apart[1] ** 2)
    return TowedObject(
        scene.patch,
        mass,
        centre_of_mass,
        float(about_own_centres + steiner),
        scene.anchor,
        scene.anchor_height,
        scene.centre_of_mass_height,
    )


def spread_over(patch: Patch) -> MassSpread:
    """A mass spread evenly over a surface, of several parts or with holes as a footprint.

    Examples
    --------
    >>> square = spread_over(Patch([[0.0, 0.0], [0.3, 0.0], [0.3, 0.3], [0.0, 0.3]]))
    >>> square.centre.round(3).tolist(), round(square.gyration**2, 6)  # (a² + b²) / 12
    ([0.15, 0.15], 0.015)
    """
    instance_of(patch, "patch", Patch)
    rings = [*patch.outlines, *patch.holes]
    signs = np.array([1.0] * len(patch.outlines) + [-1.0] * len(patch.holes))
    areas = signs * np.array([abs(polygon_area(ring)) for ring in rings])
    centre = areas @ np.array([polygon_centroid(ring) for ring in rings]) / areas.sum()
    second = signs @ np.array([abs(polygon_second_moment(ring, centre)) for ring in rings])
    return MassSpread(centre, float(np.sqrt(float(second) / float(areas.sum()))))
