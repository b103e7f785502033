"""References by quadrature: equilibrium of a pressure; the friction wrench, with centres that are hard for it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import shapely

from towval.model import Array, FrictionLaw
from towval.physics.contact import PressurePlane


def imbalance(outline: Array, force: float, place: Array, contact: PressurePlane) -> float:
    """How far a pressure is from balancing a force at a place: the largest of force / N and moments / (N size).

    Of the program only the plane's coefficients are used: the outline is cut into triangles, each is clipped where the
    plane is positive, and a rule that is exact for second degrees sums the pressure and its moments over it.
    """
    size = float(np.linalg.norm(np.ptp(outline, axis=0)))
    slopes, level = contact.coefficients[:2], float(contact.coefficients @ (*place, 1.0))
    total = np.zeros(3)
    for triangle in shapely.constrained_delaunay_triangles(shapely.Polygon(outline - place)).geoms:
        corners = _positive_part(shapely.get_coordinates(triangle)[:3], slopes, level)
        for a, b in itertools.pairwise(corners[1:]):
            middles = np.array([corners[0] + a, a + b, b + corners[0]]) / 2
            sides = a - corners[0], b - corners[0]
            area = abs(sides[0][0] * sides[1][1] - sides[0][1] * sides[1][0]) / 2
            total += area / 3 * (middles @ slopes + level) @ np.column_stack([np.ones(3), middles / size])
    return float(np.abs(total / force - [1.0, 0.0, 0.0]).max())


def _positive_part(corners: Array, slopes: Array, level: float) -> list[Array]:
    """Corners of the part of a convex polygon where a plane is positive."""
    heights = corners @ slopes + level
    kept = []
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if heights[i] > 0:
            kept.append(corners[i])
        if heights[i] * heights[j] < 0:
            kept.append(corners[i] + heights[i] / (heights[i] - heights[j]) * (corners[j] - corners[i]))
    return kept


def reference_wrench(
    contact: PressurePlane, law: FrictionLaw, twist: Array, order: int = 40, levels: int = 12
) -> Array:
    """The friction wrench by quadrature of high order that shares nothing with ``physics.wrench``.

    With the centre of rotation C far from every connected part, Gauss nodes over triangles. Else every edge spans a
    signed triangle with C; on it the radius is integrated from C by Gauss panels graded towards C, and the edge by
    Gauss panels graded towards the foot of C. ω must not be zero. The moment is about the centre of pressure.
    """
    vx, vy, omega = twist
    centre = np.array([-vy, vx]) / omega
    if all(np.hypot(*(centre - ring.mean(axis=0))) > 3 * np.ptp(ring, axis=0).max() for ring in contact.rings):
        return _wrench_over_triangles(contact, law, centre, omega)
    x, w = _unit_gauss(order)
    grade = np.concatenate([[0.0], 4.0 ** np.arange(-levels, 1)])
    radial = np.concatenate([a + (b - a) * x for a, b in itertools.pairwise(grade)])
    radial_weight = np.concatenate([(b - a) * w for a, b in itertools.pairwise(grade)])
    total = np.zeros(3)
    for x0, y0, x1, y1 in contact.edges:
        start, side = np.array([x0, y0]) - centre, np.array([x1 - x0, y1 - y0])
        foot = np.clip(-(start @ side) / (side @ side), 0, 1)
        cuts = np.unique(np.concatenate([[0.0, 1.0, foot], foot - grade[1:] * foot, foot + grade[1:] * (1 - foot)]))
        for u0, u1 in itertools.pairwise(cuts):
            u, along = u0 + (u1 - u0) * x, (u1 - u0) * w
            rays = start + u[:, None] * side
            s = rays[:, None, :] * radial[None, :, None]
            area = (rays[:, 0] * side[1] - rays[:, 1] * side[0])[:, None] * radial[None, :]
            total += _force_and_moment(contact, law, centre, omega, s, along[:, None] * radial_weight * area)
    return total


def _wrench_over_triangles(contact: PressurePlane, law: FrictionLaw, centre: Array, omega: float) -> Array:
    x, w = _unit_gauss(30)
    u, v = (grid.ravel() for grid in np.meshgrid(x, x, indexing="ij"))
    weight = np.outer(w, w).ravel() * u
    total = np.zeros(3)
    for a, b, c in _triangles(contact):
        points = a + u[:, None] * (b - a) + (u * v)[:, None] * (c - b)
        area = abs((b - a)[0] * (c - b)[1] - (b - a)[1] * (c - b)[0])
        total += _force_and_moment(contact, law, centre, omega, points - centre, weight * area)
    return total


def _triangles(contact: PressurePlane) -> Iterator[Array]:
    shell = [shapely.Polygon(ring) for ring in contact.rings]
    if not all(shapely.is_ccw(shapely.LinearRing(ring)) for ring in contact.rings):
        raise ValueError("the reference takes no holes")
    for polygon in shell:
        for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
            yield shapely.get_coordinates(triangle)[:3]


def _unit_gauss(order: int) -> tuple[Array, Array]:
    x, w = np.polynomial.legendre.leggauss(order)
    return (x + 1) / 2, w / 2


def _force_and_moment(
    contact: PressurePlane, law: FrictionLaw, centre: Array, omega: float, s: Array, weight: Array
) -> Array:
    """Sum over nodes at ``s`` from C."""
    rho, place = np.hypot(s[..., 0], s[..., 1]), s + centre
    pressure = (place - contact.centre) @ contact.coefficients[:2] + contact.coefficients @ (*contact.centre, 1.0)
    force = -np.sign(omega) * weight * pressure * law.coefficient(abs(omega) * rho)
    force /= np.where(rho > 0, rho, 1.0)
    fx, fy = -s[..., 1] * force, s[..., 0] * force
    x, y = np.moveaxis(place - contact.centre, -1, 0)
    return np.array([fx.sum(), fy.sum(), (x * fy - y * fx).sum()])


def _direction(rng: np.random.Generator) -> Array:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def centre_of_rotation(rng: np.random.Generator, contact: PressurePlane, size: float, kind: str) -> Array:
    """A centre of rotation: on a "vertex", on an "edge", "close to an edge", "inside", "around" or "outside"."""
    edge = contact.edges[rng.integers(len(contact.edges))]
    start, side = edge[:2], edge[2:] - edge[:2]
    if kind == "vertex":
        return start
    if kind == "edge":
        return start + rng.uniform() * side
    if kind == "close to an edge":
        normal = np.array([-side[1], side[0]]) / np.hypot(*side)
        return start + rng.uniform() * side + 10 ** rng.uniform(-9, -1) * size * normal
    if kind == "inside":
        return contact.centre + 0.3 * size * rng.uniform(-1, 1, 2)
    if kind == "around":
        radius = np.linalg.norm(np.concatenate(contact.rings) - contact.centre, axis=1).max()
        return contact.centre + 10 ** rng.uniform(-0.5, 0.7) * radius * _direction(rng)
    return contact.centre + 10 ** rng.uniform(0, 1.5) * size * rng.normal(size=2)


CENTRES = ("vertex", "edge", "close to an edge", "inside", "around", "outside")
