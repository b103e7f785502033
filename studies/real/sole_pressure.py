"""One-parameter families of pressure under a triangular sole, all with the same resultant, and which one pushes show.

- ``radius``: planar pressure on the footprint scaled by s about its centroid; 1 is the planar pressure.
- ``corners``: a share α of the load stands on the three corners, the rest is planar; 0 is the planar pressure.
- ``lobes``: ``p = Σ q_i λ_i^k`` in barycentric λ, parameter β = 1/k; 1 is the planar pressure, 0 the corners alone.

In each the loads balance the same weight and the same push at a height (three unknowns, three equations). SOURCE of
the planar pressure: eqs. (1), (2), which ``physics.contact.pressure_plane`` solves; the same here on cells of
``studies.paper.finite_volumes.triangulate``, for a point load has no pressure plane.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from studies.paper.finite_volumes import triangulate
from studies.real.point_friction import pushing_wrench, sliding_twist
from studies.real.push_data import angle_deg, scaled_twist, scaled_wrench
from towval.model import Array, Patch
from towval.model.errors import RefusedError


@dataclass(frozen=True)
class Sole:
    """A triangle cut into cells: ``corners`` (3, 2), ``places`` (m, 2) [m] and ``areas`` (m,) [m²] of the cells."""

    corners: Array
    places: Array
    areas: Array

    @property
    def barycentric(self) -> Array:
        """(m, 3) of the cells' places."""
        system = np.vstack([np.ones(3), self.corners.T])
        solved: Array = np.linalg.solve(system, np.vstack([np.ones(len(self.places)), self.places.T])).T
        return solved


def sole(corners: ArrayLike, element_size: float) -> Sole:
    """A triangular sole in cells of about that size [m]."""
    corners = np.asarray(corners, dtype=np.float64)
    mesh = triangulate(Patch(corners), element_size)
    return Sole(corners, np.asarray(mesh.centroids), np.asarray(mesh.areas))


Loads = Callable[[float, Array], tuple[Array, Array]]
"""Weight [N] and centre of pressure (2,) [m] → places (k, 2) and loads (k,) [N]."""


def radius_loads(of: Sole, scale: float) -> Loads:
    """Planar pressure on the footprint scaled about its centroid."""
    centroid = of.areas @ of.places / of.areas.sum()
    places = centroid + scale * (of.places - centroid)
    shapes = of.areas[:, None] * np.column_stack([np.ones(len(places)), places])
    return lambda weight, centre: (places, _balanced(places, shapes, weight, centre))


def corner_loads(of: Sole, share: float) -> Loads:
    """A share of the load on the three corners, the rest planar."""
    planar = radius_loads(of, 1.0)
    places = np.vstack([of.places, of.corners])

    def loads(weight: float, centre: Array) -> tuple[Array, Array]:
        at_corners = _balanced(of.corners, np.eye(3), weight, centre)
        return places, np.concatenate([(1 - share) * planar(weight, centre)[1], share * at_corners])

    return loads


def lobe_loads(of: Sole, inverse_power: float) -> Loads:
    """Powers k of the barycentric coordinates, from 1/k; at k = 1 they span all planes."""
    shapes = of.areas[:, None] * of.barycentric ** (1 / inverse_power)
    return lambda weight, centre: (of.places, _balanced(of.places, shapes, weight, centre))


def _balanced(places: Array, shapes: Array, weight: float, centre: Array) -> Array:
    """The combination of three shapes of load (k, 3) that has a resultant, none of it in traction."""
    moments = np.vstack([shapes.sum(axis=0), places.T @ shapes])
    loads: Array = shapes @ np.linalg.solve(moments, weight * np.array([1.0, *centre]))
    if loads.min() < 0:
        raise RefusedError("part of the sole lifts", got=f"{loads.min():.3g} N on a cell", allowed="zero or more")
    return loads


def wrench_while_sliding(loads: Loads, weight: float, twist: Array, height: float, friction: float) -> Array:
    """The pusher's wrench (3,) for μ = 1; its force moves the centre of pressure by h μF / W. A fixed point."""
    centre = np.zeros(2)
    for _ in range(12):  # contracts by h μ over the size of the sole, about 0.05 a step
        wrench = pushing_wrench(*loads(weight, centre), twist)
        new = height * friction * wrench[:2] / weight
        if np.abs(new - centre).max() < 1e-9:
            break
        centre = new
    return wrench


def push_errors_deg(
    loads: Loads, weight: float, pushes: tuple[Array, Array], height: float, friction: float
) -> tuple[Array, Array]:
    """Angles (n,), (n,) [deg] of twist from wrench and wrench from twist over pushes (wrenches, twists)."""
    of_twist, of_wrench = [], []
    for wrench, twist in zip(*pushes, strict=True):
        places, forces = loads(weight, height * wrench[:2] / weight)
        of_twist.append(angle_deg(scaled_twist(sliding_twist(places, forces, wrench)), scaled_twist(twist)))
        predicted = wrench_while_sliding(loads, weight, twist, height, friction)
        of_wrench.append(angle_deg(scaled_wrench(predicted), scaled_wrench(wrench)))
    return np.array(of_twist), np.array(of_wrench)


def friction_radius(places: Array, loads: Array) -> float:
    """Mean distance of the loads from their centre [m]: the moment in pure rotation over μN."""
    centre = loads @ places / loads.sum()
    return float(loads @ np.linalg.norm(places - centre, axis=1) / loads.sum())
