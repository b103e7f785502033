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
from numpy.typing import ArrayLike

from towval.compiling import compiled
from towval.physics.contact import PressurePlane
from towval.physics.friction_table import (
    LOWEST,
    coefficient_over_speed,
    coefficient_slope,
    friction_table,
    radial_means,
)
from towval.types import Array, FrictionLaw, locked

# Centre of rotation within so many radii of the patch: the boundary. Beyond: a rule over the area, exact there to
# 1e-11, and beyond more radii still, where the integrand is almost linear, one with fewer nodes.
_NEAR, _FAR = 3.0, 25.0
_NODES_ALONG, _FEW_NODES_ALONG = 6, 4  # the sides of a triangle
_RULE_SIZES = (4, 6, 8, 10, 12, 14, 16)
_NEGLIGIBLE = 1e-13  # of the patch's radius: an edge as close as that to C adds nothing


ISOTROPIC = np.array([1.0, 0.0, 1.0])


class SlidingPatch(NamedTuple):
    """A pressed patch and its friction law, laid out for compiled code; build it with :func:`sliding_patch`.

    ``origin`` (2,) a point of the patch [m], body frame, that all else is relative to; ``edges`` (m, 5): start (x, y),
    unit tangent (x, y), length [m]; ``pressure`` (3,) at the origin [Pa] and its slopes [Pa/m]; ``area_nodes`` (k, 3):
    place (x, y) [m] and force p dS [N], and ``few_nodes``, fewer of them; ``radius`` [m] of the patch about the
    origin; ``table`` the friction law; ``anisotropy`` (3,) of the rule over the area, see ``physics.mesh``.

    A radius of zero keeps to the nodes over the area wherever C lies: so a mesh takes the same interface.
    """

    origin: Array
    edges: Array
    pressure: Array
    area_nodes: Array
    few_nodes: Array
    radius: float
    table: Array
    anisotropy: Array


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
    triangles = _triangles(contact) - origin
    edges = contact.edges
    vectors = edges[:, 2:] - edges[:, :2]
    lengths = np.linalg.norm(vectors, axis=1)
    kept = lengths > 0
    packed = np.column_stack([edges[:, :2] - origin, vectors / np.where(kept, lengths, 1.0)[:, None], lengths])[kept]
    radius = float(np.linalg.norm(corners - origin, axis=1).max())
    area_nodes, few_nodes = (_area_nodes(triangles, pressure, n) for n in (_NODES_ALONG, _FEW_NODES_ALONG))
    table = friction_table(law)
    packed = np.ascontiguousarray(packed)
    return SlidingPatch(origin, packed, pressure, area_nodes, few_nodes, radius, table, ISOTROPIC.copy())


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


def _triangles(contact: PressurePlane) -> Array:
    """A triangulation of the patch (k, 3, 2) [m]."""
    return np.array(
        [
            shapely.get_coordinates(triangle)[:3]
            for polygon in _polygons(contact.rings)
            for triangle in shapely.constrained_delaunay_triangles(polygon).geoms
        ]
    )


def _area_nodes(triangles: Array, pressure: Array, along: int) -> Array:
    """Gauss nodes over triangles (k, 3): place and force p dS, ``along`` squared in each."""
    nodes, weights = np.polynomial.legendre.leggauss(along)
    nodes, weights = (nodes + 1) / 2, weights / 2
    u, v = (grid.ravel() for grid in np.meshgrid(nodes, nodes, indexing="ij"))
    # Duffy: the square (u, v) on the triangle, u from a corner to the opposite side.
    share = (np.outer(weights, weights).ravel() * u)[None, :]
    a, ab, bc = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 1]
    points = a[:, None] + u[:, None] * ab[:, None] + (u * v)[:, None] * bc[:, None]
    double_area = np.abs(ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0])
    force = share * double_area[:, None] * (pressure[0] + points @ pressure[1:])
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
_LONGEST_PANEL, _LAST_RULE = float(_REACH[-1]), len(_REACH) - 1


@compiled()
def wrench_at_origin(patch: SlidingPatch, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
    """Force [N] and moment [N m] about ``patch.origin``, for the velocity there [m/s] and the heading rate [rad/s]."""
    if _centre_is_near(patch, vx, vy, omega):
        sums = _boundary_sums(patch.table, patch.edges, patch.pressure, vx, vy, omega)
        return sums[0], sums[1], sums[2]
    return _area_wrench(patch.table, _area_rule(patch, vx, vy, omega), patch.anisotropy, vx, vy, omega)


@compiled()
def wrench_and_slopes(
    patch: SlidingPatch, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench as :func:`wrench_at_origin`, then its symmetric Jacobian by the twist: xx, xy, yy, xω, yω, ωω.

    It is symmetric because the wrench is the gradient of the (negative) dissipation potential ∫ p Φ(|v|) dS, Φ′ = μ.
    """
    if not _centre_is_near(patch, vx, vy, omega):
        return _area_sums(patch.table, _area_rule(patch, vx, vy, omega), patch.anisotropy, vx, vy, omega)
    fx, fy, moment, sx, sy, s_moment, xx, xy, yy = _boundary_sums(
        patch.table, patch.edges, patch.pressure, vx, vy, omega
    )
    # Known are the slopes by the velocity and, from the law alone, those along the twist: J · twist = s. The column of
    # ω follows; ω is not small here, for the centre of rotation is near.
    x_omega = (sx - xx * vx - xy * vy) / omega
    y_omega = (sy - xy * vx - yy * vy) / omega
    omega_omega = (s_moment - x_omega * vx - y_omega * vy) / omega
    return fx, fy, moment, xx, xy, yy, x_omega, y_omega, omega_omega


@compiled(inline="always")
def _centre_is_near(patch: SlidingPatch, vx: float, vy: float, omega: float) -> bool:
    """Whether the boundary is to be used: C is near, and speeds are not so low that friction is linear in them."""
    speed, turning = math.hypot(vx, vy), abs(omega) * patch.radius
    return speed < _NEAR * turning and speed + turning > patch.table[LOWEST]


@compiled(inline="always")
def _area_rule(patch: SlidingPatch, vx: float, vy: float, omega: float) -> Array:
    """The nodes over the area that suffice for the distance of C."""
    far = math.hypot(vx, vy) > _FAR * abs(omega) * patch.radius
    return patch.few_nodes if far else patch.area_nodes


@compiled()
def _area_wrench(
    table: Array, nodes: Array, anisotropy: Array, vx: float, vy: float, omega: float
) -> tuple[float, float, float]:
    """Wrench by nodes over the area."""
    axx, axy, ayy = anisotropy[0], anisotropy[1], anisotropy[2]
    fx = fy = moment = 0.0
    for i in range(nodes.shape[0]):
        x, y = nodes[i, 0], nodes[i, 1]
        ux, uy = vx - omega * y, vy + omega * x
        wx, wy = axx * ux + axy * uy, axy * ux + ayy * uy
        friction = nodes[i, 2] * coefficient_over_speed(table, math.sqrt(ux * wx + uy * wy))
        fx -= friction * wx
        fy -= friction * wy
        moment -= friction * (x * wy - y * wx)
    return fx, fy, moment


@compiled()
def _area_sums(
    table: Array, nodes: Array, anisotropy: Array, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench and slopes by nodes over the area."""
    axx, axy, ayy = anisotropy[0], anisotropy[1], anisotropy[2]
    fx = fy = moment = xx = xy = yy = x_omega = y_omega = omega_omega = 0.0
    for i in range(nodes.shape[0]):
        x, y, force = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        ux, uy = vx - omega * y, vy + omega * x
        wx, wy = axx * ux + axy * uy, axy * ux + ayy * uy
        speed = math.sqrt(ux * wx + uy * wy)
        ratio = force * coefficient_over_speed(table, speed)
        fx -= ratio * wx
        fy -= ratio * wy
        moment -= ratio * (x * wy - y * wx)
        inverse = 1 / speed if speed > 0 else 0.0
        nx, ny = wx * inverse, wy * inverse
        steeper = force * coefficient_slope(table, speed) - ratio
        nxx = ratio * axx + steeper * nx * nx
        nxy = ratio * axy + steeper * nx * ny
        nyy = ratio * ayy + steeper * ny * ny
        xx -= nxx
        xy -= nxy
        yy -= nyy
        x_omega -= nxy * x - nxx * y
        y_omega -= nyy * x - nxy * y
        omega_omega -= (nyy * x - nxy * y) * x - (nxy * x - nxx * y) * y
    return fx, fy, moment, xx, xy, yy, x_omega, y_omega, omega_omega


@compiled()
def _boundary_sums(
    table: Array, edges: Array, plane: Array, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench, its derivative along the twist and its slopes xx, xy, yy by the velocity, from the edges.

    In an edge's own axes, τ along it and ν outward, e = τ t/ρ + ν d/ρ and k × e = −ν t/ρ + τ d/ρ.
    """
    cx, cy, rate = -vy / omega, vx / omega, abs(omega)
    gx, gy = plane[1], plane[2]
    pressure = plane[0] + gx * cx + gy * cy
    fx = fy = moment = sx = sy = s_moment = bxx = bxy = byx = byy = hx = hy = 0.0
    for i in range(edges.shape[0]):
        tx, ty, length = edges[i, 2], edges[i, 3], edges[i, 4]
        x, y = edges[i, 0] - cx, edges[i, 1] - cy
        start, distance = x * tx + y * ty, x * ty - y * tx
        if abs(distance) < _NEGLIGIBLE * (abs(start) + length):
            continue
        along = gx * tx + gy * ty
        across = (gx * ty - gy * tx) * (1.0 if distance > 0 else -1.0)
        sums = _edge_sums(table, start, start + length, distance, pressure, along, across, rate)
        f_t, f_d, f_m, k_t, k_d, k_m, b_t, b_d, h_t, h_d = sums
        fx += ty * f_t - tx * f_d
        fy -= tx * f_t + ty * f_d
        moment -= f_m
        sx += ty * k_t - tx * k_d
        sy -= tx * k_t + ty * k_d
        s_moment -= k_m
        bx, by = tx * b_d - ty * b_t, tx * b_t + ty * b_d
        bxx += bx * ty
        bxy -= bx * tx
        byx += by * ty
        byy -= by * tx
        hx += tx * h_d - ty * h_t
        hy += tx * h_t + ty * h_d
    sign = 1.0 if omega > 0 else -1.0
    fx, fy, sx, sy = sign * fx, sign * fy, sign * sx, sign * sy
    moment = sign * moment + cx * fy - cy * fx
    s_moment = sign * s_moment + cx * sy - cy * sx
    # dF/dC turned into dF/dv, C = k × v / ω.
    xx, xy, yy = (bxy - gy * hx) / rate, -(bxx - gx * hx) / rate, -(byx - gx * hy) / rate
    return fx, fy, moment, sx, sy, s_moment, xx, xy, yy


@compiled()
def _edge_sums(
    table: Array,
    start: float,
    end: float,
    distance: float,
    pressure: float,
    along: float,
    across: float,
    rate: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Integrals over one edge, t from ``start`` to ``end`` at ``distance`` from C.

    With p = p_C + ρ g·e from ``pressure``, ``along`` and ``across`` (slopes of p along the edge, and away from C), the
    integrals are: by dφ, (t/ρ, d/ρ, 1) times the radial integrals of μ p; the same of its derivative along the twist;
    by dt, (t/ρ, d/ρ) times μ p; and by dφ, (t/ρ, d/ρ) times G_1.
    In q all cosh q in denominators cancel: with s, c = sinh q, cosh q, ρ = |d| c, ρ g·e = |d| (along s + across) and,
    for instance, (t/ρ) G_1 dφ = d |d| m_1 s dq.
    """
    d = abs(distance)
    first, last = _exponential(start, d), _exponential(end, d)
    span = math.log(last / first)
    panels = math.ceil(span / _LONGEST_PANEL)
    half = span / (2 * panels)
    rule = 0
    while rule < _LAST_RULE and _REACH[rule] < 2 * half:
        rule += 1
    middle, step = math.sqrt(first * last), 1.0
    if panels > 1:
        middle, step = first * math.exp(half), math.exp(2 * half)
    m1_t = m1_d = m2_t = m2_d = m2_m = m3_m = mu_t = mu_d = mu_m = 0.0
    for _ in range(panels):
        inverse_middle = 1 / middle
        for j in range(_SIZES[rule] // 2):
            grown = _exp(half * _NODES[rule, j])
            shrunk = 1 / grown
            for side in range(2):
                if side == 0:
                    e, inverse = middle * grown, inverse_middle * shrunk
                else:
                    e, inverse = middle * shrunk, inverse_middle * grown
                c, s = 0.5 * (e + inverse), 0.5 * (e - inverse)
                mu, m1, m2, m3 = radial_means(table, rate * d * c)
                weight = _WEIGHTS[rule, j]
                slope = d * (along * s + across)
                w_mu, w_m1, w_m2 = weight * mu * (pressure + slope), weight * m1, weight * slope * m2
                m1_d += w_m1
                m1_t += w_m1 * s
                m2_d += w_m2
                m2_t += w_m2 * s
                mu_d += w_mu
                mu_t += w_mu * s
                square = c * c
                m2_m += weight * square * m2
                m3_m += weight * square * slope * m3
                mu_m += w_mu * square
        middle *= step
    # dφ has the sign of the distance, and so has d/ρ; dt = ρ dq has none.
    plain, signed = half * d * d, half * d * distance
    return (
        signed * (pressure * m1_t + m2_t),
        plain * (pressure * m1_d + m2_d),
        signed * d * (pressure * m2_m + m3_m),
        signed * (mu_t - 2 * pressure * m1_t - 3 * m2_t),
        plain * (mu_d - 2 * pressure * m1_d - 3 * m2_d),
        signed * d * (mu_m - 3 * pressure * m2_m - 4 * m3_m),
        half * d * mu_t,
        half * distance * mu_d,
        signed * m1_t,
        plain * m1_d,
    )


@compiled(inline="always")
def _exponential(t: float, d: float) -> float:
    """exp(asinh(t / d)) for d > 0, without cancellation."""
    rho = math.sqrt(t * t + d * d)
    return (t + rho) / d if t > 0 else d / (rho - t)


@compiled(inline="always")
def _exp(x: float) -> float:
    """exp(x) to rounding for |x| ≤ 2, without a call: Taylor's polynomial at x/8, squared three times."""
    z = 0.125 * x
    p = 1 / 479001600
    p = p * z + 1 / 39916800
    p = p * z + 1 / 3628800
    p = p * z + 1 / 362880
    p = p * z + 1 / 40320
    p = p * z + 1 / 5040
    p = p * z + 1 / 720
    p = p * z + 1 / 120
    p = p * z + 1 / 24
    p = p * z + 1 / 6
    p = p * z + 1 / 2
    p = p * z + 1
    p = p * z + 1
    p *= p
    p *= p
    return p * p
