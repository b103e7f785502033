"""Random polygons, pressures and twists, and a reference for the wrench, for the physics benchmarks and tests."""

from __future__ import annotations

import itertools

import numpy as np
import shapely

from towval.physics.contact import PressurePlane
from towval.physics.friction_law import friction_coefficient
from towval.types import Array, FrictionLaw


def random_star(rng: np.random.Generator, corners: tuple[int, int] = (3, 16)) -> Array:
    """A simple polygon, mostly not convex, anywhere and of any size."""
    while True:
        n = int(rng.integers(*corners))
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
        if gaps.max() < 3.0 and gaps.min() > 1e-3:
            break
    radius = rng.uniform(0.1, 1.0, n)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return outline * np.exp(rng.normal()) + rng.normal(size=2)


def random_load(rng: np.random.Generator, outline: Array) -> Array:
    """A place inside the hull of a polygon, down to 1e-3 of its size from the hull's edge."""
    hull = shapely.Polygon(outline).convex_hull
    size = np.linalg.norm(np.ptp(outline, axis=0))
    middle = shapely.get_coordinates(hull.centroid)[0]
    while True:
        edge = shapely.get_coordinates(hull.exterior.interpolate(rng.uniform(0, hull.exterior.length)))[0]
        place = edge + 10 ** rng.uniform(-3, 0) * (middle - edge)
        if hull.exterior.distance(shapely.Point(place)) >= 1e-3 * size:
            return place


def reference_wrench(
    contact: PressurePlane, law: FrictionLaw, twist: Array, order: int = 40, levels: int = 12
) -> Array:
    """The friction wrench by quadrature of high order that shares nothing with ``physics.wrench``.

    Every edge spans a signed triangle with the centre of rotation C; on it the radius is integrated from C by Gauss
    panels graded towards C, and the edge by Gauss panels graded towards the foot of C. ω must not be zero.
    """
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    grade = np.concatenate([[0.0], 4.0 ** np.arange(-levels, 1)])
    radial = np.concatenate([a + (b - a) * x for a, b in itertools.pairwise(grade)])
    radial_weight = np.concatenate([(b - a) * w for a, b in itertools.pairwise(grade)])
    vx, vy, omega = twist
    centre = np.array([-vy, vx]) / omega
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
            rho, place = np.hypot(s[..., 0], s[..., 1]), s + centre
            pressure = place @ contact.coefficients[:2] + contact.coefficients[2]
            force = along[:, None] * radial_weight * area * pressure * friction_coefficient(law, abs(omega) * rho)
            force *= -np.sign(omega) / np.where(rho > 0, rho, 1.0)
            fx, fy = -s[..., 1] * force, s[..., 0] * force
            total += [fx.sum(), fy.sum(), (place[..., 0] * fy - place[..., 1] * fx).sum()]
    return total


def centre_of_rotation(rng: np.random.Generator, contact: PressurePlane, size: float, kind: str) -> Array:
    """A centre of rotation: on a "vertex", on an "edge", "close to an edge", "inside" or "outside"."""
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
    return contact.centre + 10 ** rng.uniform(0, 1.5) * size * rng.normal(size=2)


CENTRES = ("vertex", "edge", "close to an edge", "inside", "outside")
