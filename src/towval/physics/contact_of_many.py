"""Pressure under one footprint for many loads at once."""

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Patch, locked
from towval.model.checks import instance_of
from towval.model.compiling import compiled
from towval.model.errors import RefusedError
from towval.physics.contact import (
    EDGE_DISTANCE_LIMIT,
    RESIDUAL_LIMIT,
    STEP_LIMIT,
    clipped_moments,
    footprint_polygon,
    footprint_size,
    imbalance,
    in_body_frame,
    not_converged,
    oriented_rings,
    refuse_tipping,
    solve_plane,
)


def pressure_coefficients(patch: Patch, normal_force: ArrayLike, centre: ArrayLike) -> Array:
    """Pressure planes of many loads at once, each as :func:`pressure_plane` gives it.

    Parameters
    ----------
    normal_force : array_like (n,)
        Sum of the loads N [N].
    centre : array_like (n, 2)
        Where they act together, body frame [m].

    Returns
    -------
    ndarray (n, 3)
        (a, b, c) [Pa/m, Pa/m, Pa] of ``p = max(0, a ξ + b η + c)``.

    Raises
    ------
    InputError, RefusedError
        As :func:`pressure_plane`, for the first load that is refused.

    Examples
    --------
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> pressure_coefficients(square, [50.0, 100.0], [[0.0, 0.0], [0.05, 0.0]]).round(6) + 0.0
    array([[   0.  ,    0.  ,  312.5 ],
           [2343.75,    0.  ,  625.  ]])
    """
    instance_of(patch, "patch", Patch)
    polygon, size = footprint_polygon(patch), footprint_size(patch)
    centres = locked(centre, "centre of the loads", (None, 2))
    forces = locked(normal_force, "normal force", (len(centres),))
    if not (forces > 0).all():
        raise RefusedError("the loads do not press the object to the floor", got=f"{forces.min()} N", allowed="above 0")
    hull, points = polygon.convex_hull, shapely.points(centres)
    inside = shapely.contains(hull, points) & (shapely.distance(hull.exterior, points) >= EDGE_DISTANCE_LIMIT * size)
    if not inside.all():
        refuse_tipping(polygon, centres[~inside][0], size)
    rings = oriented_rings(polygon)
    planes, residuals = np.empty((len(centres), 3)), np.empty(len(centres))
    ring_ends = np.cumsum([len(ring) for ring in rings], dtype=np.int64)
    _solve_planes(np.concatenate(rings) / size, ring_ends, centres / size, STEP_LIMIT, planes, residuals)
    if not (residuals <= RESIDUAL_LIMIT).all():
        raise not_converged(residuals.max())
    return in_body_frame(planes, forces, centres, size)


@compiled()
def _solve_planes(
    vertices: Array, ring_ends: NDArray[np.int64], centres: Array, step_limit: int, planes: Array, residuals: Array
) -> None:
    """Planes (n, 3) of unit force at each of the centres (n, 2), and the residuals (n,) of their equilibrium."""
    m, moved = np.empty(6), np.empty_like(vertices)
    for i in range(len(centres)):
        for k in range(len(vertices)):
            moved[k, 0], moved[k, 1] = vertices[k, 0] - centres[i, 0], vertices[k, 1] - centres[i, 1]
        solve_plane(moved, ring_ends, step_limit, planes[i])
        c, a, b = planes[i]
        clipped_moments(moved, ring_ends, c, a, b, m)
        g0, g1, g2 = imbalance(m, c, a, b)
        residuals[i] = max(abs(g0), abs(g1), abs(g2))
