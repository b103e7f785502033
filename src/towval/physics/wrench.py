"""The friction wrench of a sliding patch as an integral over its boundary.

SOURCE: eqs. (4), (5), ``F = −∫ μ p v/|v| dS``, ``M = −∫ r × (μ p v/|v|) dS``. With the origin at the instantaneous
centre of rotation C the radial part of both is known in closed form once μ is tabulated (``friction_table``), and
what is left runs along the edges of the patch; docs/physics.md derives it. In ``t = |d| sinh q`` along an edge at
distance d from C the integrand is analytic for |Im q| < π/2, whatever the law and wherever C lies, so the number of
Gauss nodes follows from the length of the edge in q alone.

Where C is far away (pure translation in the limit) the differences would cancel. There the integrand is smooth over the
patch and a Gauss rule on its triangles, made once, takes over. The two agree to rounding where they meet.

Valid for uniform, isotropic friction; ``physics.mesh`` has the paper's finite volumes for the rest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numba import njit
from numpy.typing import ArrayLike

from towval.physics.contact import PressurePlane
from towval.physics.friction_table import LOWEST, coefficient_and_slope, friction_table, radial_means
from towval.types import Array, FrictionLaw, locked

_FAR = 3.5  # instantaneous centre beyond this many radii of the patch: the rule over the area is exact to 1e-11
_AREA_NODES = 6  # along each side of a triangle
_RULE_SIZES = (4, 6, 8, 10, 12, 14, 16)
_LONGEST_PANEL = 3.6
_NEGLIGIBLE = 1e-13  # of the patch's radius: an edge as close as that to C adds nothing


class SlidingPatch(NamedTuple):
    """A pressed patch and its friction law, laid out for compiled code; build it with :func:`sliding_patch`.

    ``origin`` (2,) a point of the patch [m], body frame, that all else is relative to; ``edges`` (m, 5): start (x, y),
    unit tangent (x, y), length [m]; ``pressure`` (3,) at the origin [Pa] and its slopes [Pa/m]; ``area_nodes`` (k, 3):
    place (x, y) [m] and force p dS [N]; ``radius`` [m] of the patch about the origin; ``table`` the friction law.
    """

    origin: Array
    edges: Array
    pressure: Array
    area_nodes: Array
    radius: float
    table: Array


def sliding_patch(contact: PressurePlane, law: FrictionLaw) -> SlidingPatch:
    """Prepare a pressed patch and a friction law for fast evaluation: some milliseconds, once a scene.

    Parameters
    ----------
    contact : PressurePlane
        Pressure under the patch.
    law : FrictionLaw
        Friction coefficient, the same all over the patch and in all directions.
    """
    corners = np.concatenate(contact.rings)
    origin = contact.centre.copy()
    a, b, _ = contact.coefficients
    pressure = np.array([contact.coefficients @ (*origin, 1.0), a, b])
    area_nodes = _area_nodes(contact)
    area_nodes[:, :2] -= origin
    edges = contact.edges
    vectors = edges[:, 2:] - edges[:, :2]
    lengths = np.linalg.norm(vectors, axis=1)
    kept = lengths > 0
    packed = np.column_stack([edges[:, :2] - origin, vectors / np.where(kept, lengths, 1.0)[:, None], lengths])[kept]
    radius = float(np.linalg.norm(corners - origin, axis=1).max())
    return SlidingPatch(origin, np.ascontiguousarray(packed), pressure, area_nodes, radius, friction_table(law))


def friction_wrench(patch: SlidingPatch, twist: ArrayLike) -> Array:
    """Friction force and moment on a sliding patch.

    SOURCE: eqs. (4), (5), by the boundary integral.

    Parameters
    ----------
    patch : SlidingPatch
    twist : array_like (3,)
        Velocity of the body frame's origin and heading rate, in body axes [m/s, m/s, rad/s].

    Returns
    -------
    ndarray (3,)
        Force in body axes and moment about the body frame's origin [N, N, N m].
    """
    vx, vy, omega = locked(twist, "twist", (3,))
    x, y = patch.origin
    fx, fy, moment = wrench_at_origin(patch, vx - omega * y, vy + omega * x, omega)
    return np.array([fx, fy, moment + x * fy - y * fx])


def _area_nodes(contact: PressurePlane) -> Array:
    """Gauss nodes over the triangles of the patch (k, 3): place and force p dS."""
    shell_and_holes = _polygons(contact.rings)
    triangles = np.array(
        [
            shapely.get_coordinates(triangle)[:3]
            for polygon in shell_and_holes
            for triangle in shapely.constrained_delaunay_triangles(polygon).geoms
        ]
    )
    nodes, weights = np.polynomial.legendre.leggauss(_AREA_NODES)
    nodes, weights = (nodes + 1) / 2, weights / 2
    u, v = (grid.ravel() for grid in np.meshgrid(nodes, nodes, indexing="ij"))
    # Duffy: the square (u, v) on the triangle, u from a corner to the opposite side.
    share = (np.outer(weights, weights).ravel() * u)[None, :]
    a, ab, bc = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 1]
    points = a[:, None] + u[:, None] * ab[:, None] + (u * v)[:, None] * bc[:, None]
    double_area = np.abs(ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0])
    force = share * double_area[:, None] * contact.pressure(points)
    return np.ascontiguousarray(np.concatenate([points, force[..., None]], axis=-1).reshape(-1, 3))


def _polygons(rings: tuple[Array, ...]) -> list[shapely.Polygon]:
    """Oriented rings as polygons: a clockwise ring is a hole of the counter-clockwise ring before it."""
    polygons: list[shapely.Polygon] = []
    for ring in rings:
        if shapely.is_ccw(shapely.LinearRing(ring)):
            polygons.append(shapely.Polygon(ring))
        else:
            outer = polygons.pop()
            polygons.append(shapely.Polygon(outer.exterior, [*outer.interiors, ring]))
    return polygons


def _gauss_rules() -> tuple[Array, Array, Array]:
    """Nodes above zero and weights of symmetric Gauss rules, one a row, and their sizes."""
    nodes, weights = np.zeros((len(_RULE_SIZES), 8)), np.zeros((len(_RULE_SIZES), 8))
    for row, size in enumerate(_RULE_SIZES):
        x, w = np.polynomial.legendre.leggauss(size)
        nodes[row, : size // 2], weights[row, : size // 2] = x[size // 2 :], w[size // 2 :]
    return nodes, weights, np.array(_RULE_SIZES)


def _longest_in_q(sizes: Array, tolerance: float = 1e-10) -> Array:
    """Longest edge in q that each rule integrates to a tolerance: its ellipse of analyticity reaches to π/2."""
    radius = tolerance ** (-1 / (2 * sizes))  # ρ^(−2n) is the error of n nodes on the ellipse ρ
    return np.pi / ((radius - 1 / radius) / 2)


_NODES, _WEIGHTS, _SIZES = _gauss_rules()
_REACH = _longest_in_q(_SIZES)


@njit(cache=True)
def wrench_at_origin(patch: SlidingPatch, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
    """Force [N] and moment [N m] about ``patch.origin``, for the velocity there [m/s] and the heading rate [rad/s]."""
    if _is_far(patch, vx, vy, omega):
        sums = _area_sums(patch, vx, vy, omega)
    else:
        sums = _boundary_sums(patch, vx, vy, omega, False)
    return sums[0], sums[1], sums[2]


@njit(cache=True)
def wrench_and_slopes(
    patch: SlidingPatch, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench as :func:`wrench_at_origin`, then its symmetric Jacobian by the twist: xx, xy, yy, xω, yω, ωω.

    It is symmetric because the wrench is the gradient of the (negative) dissipation potential ∫ p Φ(|v|) dS, Φ′ = μ.
    """
    if _is_far(patch, vx, vy, omega):
        return _area_sums(patch, vx, vy, omega)
    fx, fy, moment, sx, sy, s_moment, xx, xy, yy = _boundary_sums(patch, vx, vy, omega, True)
    # Known are the slopes by the velocity and, from the law alone, those along the twist: J · twist = s. The column of
    # ω follows; ω is not small here, for the centre of rotation is near.
    x_omega = (sx - xx * vx - xy * vy) / omega
    y_omega = (sy - xy * vx - yy * vy) / omega
    omega_omega = (s_moment - x_omega * vx - y_omega * vy) / omega
    return fx, fy, moment, xx, xy, yy, x_omega, y_omega, omega_omega


@njit(cache=True, inline="always")
def _is_far(patch: SlidingPatch, vx: float, vy: float, omega: float) -> bool:
    """Whether the centre of rotation is far off, or all speeds so low that friction is linear in them."""
    speed, turning = math.hypot(vx, vy), abs(omega) * patch.radius
    return speed >= _FAR * turning or speed + turning < patch.table[LOWEST]


@njit(cache=True, fastmath={"contract"})
def _area_sums(
    patch: SlidingPatch, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench and slopes by the rule over the area."""
    fx = fy = moment = xx = xy = yy = x_omega = y_omega = omega_omega = 0.0
    nodes = patch.area_nodes
    for i in range(nodes.shape[0]):
        x, y, force = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        ux, uy = vx - omega * y, vy + omega * x
        speed_squared = ux * ux + uy * uy
        ratio, slope = coefficient_and_slope(patch.table, math.sqrt(speed_squared))
        fx -= force * ratio * ux
        fy -= force * ratio * uy
        moment -= force * ratio * (x * uy - y * ux)
        steeper = (slope - ratio) / speed_squared if speed_squared > 0 else 0.0
        nxx = force * (ratio + steeper * ux * ux)
        nxy = force * steeper * ux * uy
        nyy = force * (ratio + steeper * uy * uy)
        xx -= nxx
        xy -= nxy
        yy -= nyy
        x_omega -= nxy * x - nxx * y
        y_omega -= nyy * x - nxy * y
        omega_omega -= (nyy * x - nxy * y) * x - (nxy * x - nxx * y) * y
    return fx, fy, moment, xx, xy, yy, x_omega, y_omega, omega_omega


@njit(cache=True, fastmath={"contract"})
def _boundary_sums(
    patch: SlidingPatch, vx: float, vy: float, omega: float, with_slopes: bool
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench, its derivative along the twist and its slopes xx, xy, yy by the velocity, from the edges.

    In an edge's own axes, τ along it and ν outward, e = τ t/ρ + ν d/ρ and k × e = −ν t/ρ + τ d/ρ.
    """
    cx, cy, rate = -vy / omega, vx / omega, abs(omega)
    _, gx, gy = patch.pressure
    pressure = patch.pressure[0] + gx * cx + gy * cy
    fx = fy = moment = sx = sy = s_moment = bxx = bxy = byx = byy = hx = hy = 0.0
    for i in range(patch.edges.shape[0]):
        x, y, tx, ty, length = patch.edges[i]
        x, y = x - cx, y - cy
        start, distance = x * tx + y * ty, x * ty - y * tx
        if abs(distance) < _NEGLIGIBLE * patch.radius:
            continue
        along = gx * tx + gy * ty
        across = (gx * ty - gy * tx) * (1.0 if distance > 0 else -1.0)
        e = _edge_sums(patch.table, start, start + length, distance, pressure, along, across, rate, with_slopes)
        fx += ty * e[0] - tx * e[1]
        fy -= tx * e[0] + ty * e[1]
        moment -= e[2]
        if with_slopes:
            sx += ty * e[3] - tx * e[4]
            sy -= tx * e[3] + ty * e[4]
            s_moment -= e[5]
            bx, by = tx * e[7] - ty * e[6], tx * e[6] + ty * e[7]
            bxx += bx * ty
            bxy -= bx * tx
            byx += by * ty
            byy -= by * tx
            hx += tx * e[9] - ty * e[8]
            hy += tx * e[8] + ty * e[9]
    sign = 1.0 if omega > 0 else -1.0
    fx, fy, sx, sy = sign * fx, sign * fy, sign * sx, sign * sy
    moment = sign * moment + cx * fy - cy * fx
    s_moment = sign * s_moment + cx * sy - cy * sx
    # dF/dC turned into dF/dv, C = k × v / ω.
    return (
        fx,
        fy,
        moment,
        sx,
        sy,
        s_moment,
        (bxy - gy * hx) / rate,
        -(bxx - gx * hx) / rate,
        -(byx - gx * hy) / rate,
    )


@njit(cache=True, fastmath={"contract"})
def _edge_sums(
    table: Array,
    start: float,
    end: float,
    distance: float,
    pressure: float,
    along: float,
    across: float,
    rate: float,
    with_slopes: bool,
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Integrals over one edge, t from ``start`` to ``end`` at ``distance`` from C.

    With s = p_C and g·e from ``pressure``, ``along`` and ``across`` (slopes of p along the edge, and away from C), the
    integrals by dφ are: (t/ρ, |d|/ρ, 1) times the radial integrals of μ p; the same of its derivative along the twist;
    (t/ρ, d/ρ) times μ p by dt; and (t/ρ, d/ρ) times G_1.
    """
    d = abs(distance)
    first, last = _exponential(start, d), _exponential(end, d)
    span = math.log(last / first)
    panels = int(span / _LONGEST_PANEL) + 1
    half = span / (2 * panels)
    rule = 0
    while _REACH[rule] < 2 * half:
        rule += 1
    step = math.exp(2 * half) if panels > 1 else 1.0
    middle = first * math.exp(half) if panels > 1 else math.sqrt(first * last)
    f_t = f_d = f_m = k_t = k_d = k_m = b_t = b_d = h_t = h_d = 0.0
    for _ in range(panels):
        for j in range(_SIZES[rule] // 2):
            factor = math.exp(half * _NODES[rule, j])
            for side in range(2):
                e = middle * factor if side == 0 else middle / factor
                inverse = 1 / e
                c, s = 0.5 * (e + inverse), 0.5 * (e - inverse)
                sech = 1 / c
                rho = d * c
                weight = _WEIGHTS[rule, j] * sech
                cos_t, cos_d = s * sech, sech
                mu, m1, m2, m3 = radial_means(table, rate * rho)
                slope = (along * cos_t + across * cos_d) * rho
                weight *= rho * rho
                force = weight * (pressure * m1 + slope * m2)
                f_t += force * cos_t
                f_d += force * cos_d
                f_m += weight * rho * (pressure * m2 + slope * m3)
                if with_slopes:
                    force = weight * (pressure * (mu - 2 * m1) + slope * (mu - 3 * m2))
                    k_t += force * cos_t
                    k_d += force * cos_d
                    k_m += weight * rho * (pressure * (mu - 3 * m2) + slope * (mu - 4 * m3))
                    b = _WEIGHTS[rule, j] * rho * mu * (pressure + slope)
                    b_t += b * cos_t
                    b_d += b * cos_d
                    h_t += weight * m1 * cos_t
                    h_d += weight * m1 * cos_d
        middle *= step
    # dφ has the sign of the distance; so has d/ρ, while dt = ρ dq has none.
    turn = half if distance > 0 else -half
    return (
        turn * f_t,
        half * f_d,
        turn * f_m,
        turn * k_t,
        half * k_d,
        turn * k_m,
        half * b_t,
        turn * b_d,
        turn * h_t,
        half * h_d,
    )


@njit(cache=True, inline="always")
def _exponential(t: float, d: float) -> float:
    """exp(asinh(t / d)) for d > 0, without cancellation."""
    rho = math.sqrt(t * t + d * d)
    return (t + rho) / d if t > 0 else d / (rho - t)
