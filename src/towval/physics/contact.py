"""Pressure under a footprint that can only push, exact by clipping.

The footprint S lies on a sheet of springs, so the pressure is a plane cut off at zero, ``p = max(0, a ξ + b η + c)``
(SOURCE: eqs. (1), (2); the stiffness of the ground only scales the penetration and drops out). Equilibrium with the
loads, eqs. (6) to (8), is the stationary point of the convex function

    Φ(a, b, c) = ½ ∫_S max(0, a ξ + b η + c)² dS − N (a ξ_G + b η_G + c),

so the plane is unique. Newton's step on Φ is the paper's "solve on the part in contact, drop what is in traction,
solve again"; a line search makes it converge from anywhere. The part in contact is the polygon clipped by a straight
line, and its moments have closed forms (Green), so no mesh is needed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Patch, TowedObject, locked
from towval.model.checks import instance_of, lock, short_repr
from towval.model.compiling import compiled
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import polygon_area
from towval.physics.footprint import footprint_polygon, footprint_size, refuse_tipping

_RESIDUAL_LIMIT = 1e-10
"""Largest equilibrium residual that is vouched for, as a part of N and of N times the footprint's size."""

_STEP_LIMIT = 200


@dataclass(frozen=True)
class PressurePlane:
    """Contact pressure under an object at rest on a rigid floor, in the body frame.

    ``coefficients`` (a, b, c) [Pa/m, Pa/m, Pa] of ``p = max(0, a ξ + b η + c)``; ``normal_force`` N [N] and where the
    loads act together, ``centre`` (2,) [m], which is the centre of pressure; ``rings`` (n, 2) around the part in
    contact [m], outer ones counter-clockwise, holes clockwise; ``residual`` of the equilibrium over the rings, the
    largest of force / N and moments / (N size).
    """

    coefficients: Array
    normal_force: float
    centre: Array
    rings: tuple[Array, ...]
    residual: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        lock(self, coefficients=(3,), centre=(2,))
        object.__setattr__(self, "rings", tuple(locked(r, "PressurePlane.rings", (None, 2)) for r in self.rings))

    @property
    def edges(self) -> Array:
        """Edges of all rings (m, 4) [m], (ξ0, η0, ξ1, η1), the part in contact on their left."""
        return np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in self.rings])

    @property
    def contact_area(self) -> float:
        """Area in contact [m²]."""
        return sum(polygon_area(ring) for ring in self.rings)

    def pressure(self, points: ArrayLike) -> Array:
        """Pressure [Pa] at points (..., 2) of the footprint in the body frame [m]; zero where it has lifted."""
        points = np.asarray(points, dtype=np.float64)
        pressure: Array = np.maximum(0.0, points @ self.coefficients[:2] + self.coefficients[2])
        return pressure


def resultant(loads: Iterable[tuple[float, ArrayLike]]) -> tuple[float, Array]:
    """Sum N of vertical loads [N] and where it acts (ξ_G, η_G) [m].

    ``loads`` are forces on the floor [N] and their places (2,) in the body frame [m]. `RefusedError` where they do not
    press the object to the floor.
    """
    try:
        pairs = [(force, place) for force, place in loads]
    except (TypeError, ValueError):
        raise InputError("the loads are no pairs", allowed="each a force [N] and its place (2,) [m]") from None
    forces = [
        (float(locked(force, "a load", (), finite=False)), locked(place, "place of a load", (2,)))
        for force, place in pairs
    ]
    total = sum((force for force, _ in forces), start=0.0)
    if not total > 0 or not np.isfinite(total):
        raise RefusedError("the loads do not press the object to the floor", got=f"{total} N", allowed="above zero")
    moment: Array = sum((force * place for force, place in forces), start=np.zeros(2))
    return total, moment / total


def pressure_plane(patch: Patch, loads: Sequence[tuple[float, ArrayLike]]) -> PressurePlane:
    """Pressure under a footprint with vertical loads, unilateral and exact.

    SOURCE: eqs. (1), (2) and (6) to (8); see the head of this module for the method.

    Parameters
    ----------
    patch : Patch
        Footprint: simple polygons, with holes or without [m].
    loads : sequence of (float, array_like (2,))
        Each a force on the floor [N] and where it acts in the body frame [m].

    Raises
    ------
    InputError
        When the footprint is no simple polygon.
    RefusedError
        When the loads act outside the convex hull of the footprint, where the object tips over, or so close to its
        edge (1e-9 of the size) that the contact degenerates to a line.

    Examples
    --------
    A load of 50 N on a square of 0.4 m presses it evenly; off the middle by a quarter of the side, on 3/4 of it.

    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> round(pressure_plane(square, [(50.0, (0.0, 0.0))]).pressure((0.1, 0.1)).item(), 6)
    312.5
    >>> round(pressure_plane(square, [(50.0, (0.1, 0.0))]).contact_area / 0.16, 6)
    0.75
    """
    instance_of(patch, "patch", Patch)
    polygon, size = footprint_polygon(patch), footprint_size(patch)
    normal_force, centre = resultant(loads)
    refuse_tipping(patch, centre)
    rings = oriented_rings(polygon)
    vertices = (np.concatenate(rings) - centre) / size
    ring_ends = np.cumsum([len(ring) for ring in rings], dtype=np.int64)
    plane = np.empty(3)
    solve_plane(vertices, ring_ends, _STEP_LIMIT, plane)
    contact = _in_contact(rings, polygon, plane, centre, size)
    residual = _residual(contact, plane, centre, size)
    if not residual <= _RESIDUAL_LIMIT:
        raise RefusedError(
            "the pressure under the footprint did not converge",
            got=f"residual {residual:.2e}",
            allowed=f"at most {_RESIDUAL_LIMIT:.0e}",
            remedy="check the footprint for slivers much thinner than its size and loads at its hull's edge",
        )
    # The plane is that of unit force on a footprint of unit size, about the centre of pressure.
    slopes = plane[1:] * normal_force / size**3
    coefficients = np.array([*slopes, plane[0] * normal_force / size**2 - np.sum(slopes * centre)])
    return PressurePlane(coefficients, normal_force, centre, contact, residual)


def resting_pressure(towed: TowedObject, gravity: float = GRAVITY_M_PER_S2) -> PressurePlane:
    """Pressure under an object at rest, its weight acting at its centre of mass; raises as :func:`pressure_plane`.

    Examples
    --------
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> round(resting_pressure(towed).normal_force, 2)
    49.05
    """
    instance_of(towed, "towed", TowedObject)
    instance_of(gravity, "gravity", float, int, np.number)
    return pressure_plane(towed.patch, [(towed.mass * gravity, towed.centre_of_mass)])


def oriented_rings(polygon: shapely.Polygon | shapely.MultiPolygon) -> list[Array]:
    """Rings of oriented polygons as open arrays of corners, each outline before its holes."""
    parts = shapely.get_parts(polygon)
    return [shapely.get_coordinates(ring)[:-1] for part in parts for ring in (part.exterior, *part.interiors)]


def _in_contact(
    rings: list[Array], polygon: shapely.Polygon | shapely.MultiPolygon, plane: Array, centre: Array, size: float
) -> tuple[Array, ...]:
    """Rings of the part of the polygon where the plane is positive."""
    corners = (np.concatenate(rings) - centre) / size
    if (plane[0] + corners @ plane[1:] >= 0).all():
        return tuple(rings)
    steepness = np.hypot(*plane[1:])
    along = plane[1:] / steepness
    across = np.array([-along[1], along[0]])
    foot = -plane[0] / steepness * along
    # The half-plane z > 0 as a box that reaches beyond the footprint, which is at most one size across.
    box = foot + 4 * np.array([-across, across, across + along, along - across])
    kept = shapely.orient_polygons(polygon.intersection(shapely.Polygon(centre + size * box)))
    parts = [part for part in getattr(kept, "geoms", [kept]) if isinstance(part, shapely.Polygon)]
    return tuple(ring for part in parts for ring in oriented_rings(part))


def _residual(contact: tuple[Array, ...], plane: Array, centre: Array, size: float) -> float:
    vertices = (np.concatenate(contact) - centre) / size
    moments = np.empty(6)
    clipped_moments(vertices, np.cumsum([len(ring) for ring in contact]), 1.0, 0.0, 0.0, moments)
    return max(map(abs, _imbalance(moments, *plane)))


@compiled(allocates=False)
def add_edge_moments(m: Array, x0: float, y0: float, x1: float, y1: float) -> None:
    """Add an edge's share to the moments 1, x, y, xx, xy, yy of the area (Green)."""
    cross = x0 * y1 - x1 * y0
    m[0] += cross / 2
    m[1] += cross * (x0 + x1) / 6
    m[2] += cross * (y0 + y1) / 6
    m[3] += cross * (x0 * x0 + x0 * x1 + x1 * x1) / 12
    m[4] += cross * (x0 * y1 + 2 * x0 * y0 + 2 * x1 * y1 + x1 * y0) / 24
    m[5] += cross * (y0 * y0 + y0 * y1 + y1 * y1) / 12


@compiled(allocates=False)
def clipped_moments(
    vertices: Array, ring_ends: NDArray[np.int64] | Array, c: float, a: float, b: float, m: Array
) -> None:
    """Moments 1, x, y, xx, xy, yy of the rings where ``c + a x + b y > 0``, into ``m`` (6,).

    Clipping ring by ring leaves seams along the cut; they run there and back and cancel in Green's sums.
    """
    for i in range(6):
        m[i] = 0.0
    start = 0
    for ring in range(len(ring_ends)):
        end = int(ring_ends[ring])
        started = False
        first_x = first_y = last_x = last_y = 0.0
        for i in range(start, end):
            j = i + 1 if i + 1 < end else start
            x0, y0, x1, y1 = vertices[i, 0], vertices[i, 1], vertices[j, 0], vertices[j, 1]
            z0 = c + a * x0 + b * y0
            z1 = c + a * x1 + b * y1
            if z0 <= 0 and z1 <= 0:
                continue
            if z0 <= 0 or z1 <= 0:
                s = z0 / (z0 - z1)
                x, y = x0 + s * (x1 - x0), y0 + s * (y1 - y0)
                if z0 <= 0:
                    x0, y0 = x, y
                else:
                    x1, y1 = x, y
            if not started:
                started, first_x, first_y = True, x0, y0
            elif last_x != x0 or last_y != y0:
                add_edge_moments(m, last_x, last_y, x0, y0)
            add_edge_moments(m, x0, y0, x1, y1)
            last_x, last_y = x1, y1
        if last_x != first_x or last_y != first_y:
            add_edge_moments(m, last_x, last_y, first_x, first_y)
        start = end


@compiled(allocates=False)
def _plane_on(m: Array) -> tuple[float, float, float]:
    """Plane of unit force through the origin for a region taken as fixed, from its moments about its own centroid."""
    x, y = m[1] / m[0], m[2] / m[0]
    xx, xy, yy = m[3] - m[0] * x * x, m[4] - m[0] * x * y, m[5] - m[0] * y * y
    determinant = xx * yy - xy * xy
    slope_x = -(yy * x - xy * y) / determinant
    slope_y = -(xx * y - xy * x) / determinant
    return 1 / m[0] - slope_x * x - slope_y * y, slope_x, slope_y


@compiled(allocates=False)
def _imbalance(m: Array, c: float, a: float, b: float) -> tuple[float, float, float]:
    """Force and moments ∫p, ∫xp, ∫yp of a plane over a region with moments ``m``, less the unit load at the origin."""
    return m[0] * c + m[1] * a + m[2] * b - 1.0, m[1] * c + m[3] * a + m[4] * b, m[2] * c + m[4] * a + m[5] * b


@compiled()
def solve_plane(vertices: Array, ring_ends: NDArray[np.int64], step_limit: int, best: Array) -> None:
    """Minimise Φ for unit force at the origin; the plane (pressure there, slopes) into ``best``."""
    m = np.empty(6)
    clipped_moments(vertices, ring_ends, 1.0, 0.0, 0.0, m)
    c, a, b = _plane_on(m)
    clipped_moments(vertices, ring_ends, c, a, b, m)
    best_residual = np.inf
    for _ in range(step_limit):
        g0, g1, g2 = _imbalance(m, c, a, b)
        residual = max(abs(g0), abs(g1), abs(g2))
        # Newton doubles the digits; once it no longer halves a small residual, rounding is all that is left.
        settled = best_residual < _RESIDUAL_LIMIT and residual > 0.5 * best_residual
        if residual < best_residual:
            best[0], best[1], best[2], best_residual = c, a, b, residual
        if settled or best_residual < 1e-15:
            return
        full_c, full_a, full_b = _plane_on(m)
        dc, da, db = full_c - c, full_a - a, full_b - b
        descent = abs(g0 * dc + g1 * da + g2 * db)
        fraction = 1.0
        while True:
            trial_c, trial_a, trial_b = c + fraction * dc, a + fraction * da, b + fraction * db
            clipped_moments(vertices, ring_ends, trial_c, trial_a, trial_b, m)
            t0, t1, t2 = _imbalance(m, trial_c, trial_a, trial_b)
            # Φ is convex: its slope along the step grows from −descent; where it has come to +descent / 2 we went
            # too far. Slopes, unlike values of Φ, keep their digits near the solution.
            if m[0] > 0 and t0 * dc + t1 * da + t2 * db <= 0.5 * descent + 1e-15:
                break
            fraction *= 0.5
            if fraction < 1e-12:
                return
        c, a, b = trial_c, trial_a, trial_b
