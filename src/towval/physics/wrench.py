"""The friction wrench of a sliding patch as an integral over its boundary.

SOURCE: eqs. (4), (5), ``F = −∫ μ p v/|v| dS``, ``M = −∫ r × (μ p v/|v|) dS``. With the origin at the instantaneous
centre of rotation C the radial part of both is known in closed form once μ is tabulated (``friction_table``), and
what is left runs along the edges of the patch (``edge_integrals``); docs/physics.md derives it.

Where C is far away (pure translation in the limit) the differences would cancel. There the integrand is smooth over the
patch and Gauss rules over its area, made once, take over (``area_rules``). The two agree to 1e-10 of μN where they
meet.

Valid for uniform, isotropic friction.
"""

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from towval.model import Array, FrictionLaw, locked
from towval.model.checks import instance_of, numbers_of, short_repr
from towval.model.compiling import compiled
from towval.physics.area_rules import area_rules, polygons_of
from towval.physics.contact import PressurePlane
from towval.physics.edge_integrals import edge_integrals, prepared_edge
from towval.physics.friction_table import LOWEST, coefficient_over_speed, friction_table, ratio_and_slope

# Centre of rotation within so many radii of a part of the patch: the boundary. Beyond: a rule over the area, exact
# there to 1e-10. Parts count by themselves, for a patch may touch the floor at small tips far apart: in between the
# boundary's sums cancel.
_NEAR = 4.0

ISOTROPIC = np.array([1.0, 0.0, 1.0])


class SlidingPatch(NamedTuple):
    """A pressed patch and its friction law, laid out for compiled code; build it with :func:`sliding_patch`.

    ``origin`` (2,) a point of the patch [m], body frame, that all else is relative to; ``edges`` (m, 5): start (x, y),
    unit tangent (x, y), length [m]; ``pressure`` (3,) at the origin [Pa] and its slopes [Pa/m]; ``area_nodes`` (k, 3):
    place (x, y) [m] and force p dS [N] of the nodes of several rules over the area, finest first, and ``area_rules``
    (r, 3): first node, number of nodes, and from how many radii on the rule serves; ``circles`` (n, 3): centre (x, y)
    and radius [m] of circles around the connected parts; ``radius`` [m] of the whole about the origin; ``per_force``
    1/N [1/N]; ``table`` the friction law; ``anisotropy`` (3,) the entries xx, xy, yy of A in the friction on a node of
    these rules, ``−p dS μ(w) A v / w`` with ``w = √(vᵀ A v)``.

    Without circles the nodes over the area serve wherever C lies, so that a mesh fits the same interface.
    """

    origin: Array
    edges: Array
    pressure: Array
    area_nodes: Array
    area_rules: Array
    circles: Array
    radius: float
    per_force: float
    table: Array
    anisotropy: Array

    def __repr__(self) -> str:
        return short_repr(self)


def sliding_patch(contact: PressurePlane, law: FrictionLaw) -> SlidingPatch:
    """Prepare a pressed patch and a friction law for fast evaluation: some milliseconds, once a scene.

    Parameters
    ----------
    contact : PressurePlane
        Pressure under the patch.
    law : FrictionLaw
        Friction coefficient, the same all over the patch and in all directions.

    Examples
    --------
    See :func:`friction_wrench`.

    >>> from towval.physics import Coulomb, Patch, pressure_plane
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> round(sliding_patch(pressure_plane(square, [(50.0, (0.0, 0.0))]), Coulomb(0.35, 1e-3)).radius, 4)
    0.2828
    """
    instance_of(contact, "contact", PressurePlane)
    origin = contact.centre.copy()
    a, b, _ = contact.coefficients
    pressure = np.array([contact.coefficients @ (*origin, 1.0), a, b])
    rings = tuple(ring - origin for ring in contact.rings)
    nodes, rules = area_rules(rings, pressure)
    starts, vectors = contact.edges[:, :2] - origin, contact.edges[:, 2:] - contact.edges[:, :2]
    lengths = np.linalg.norm(vectors, axis=1)
    kept = lengths > 0
    return SlidingPatch(
        origin=origin,
        edges=np.column_stack([starts, vectors / np.where(kept, lengths, 1.0)[:, None], lengths])[kept],
        pressure=pressure,
        area_nodes=nodes,
        area_rules=rules,
        circles=np.array([_circle(shapely.get_coordinates(polygon)) for polygon in polygons_of(rings)]),
        radius=float(np.linalg.norm(np.concatenate(rings), axis=1).max()),
        per_force=1 / contact.normal_force,
        table=friction_table(law),
        anisotropy=ISOTROPIC.copy(),
    )


def friction_wrench(patch: SlidingPatch, twist: ArrayLike) -> Array:
    """Friction force and moment on a sliding patch, for one twist or many.

    SOURCE: eqs. (4), (5), by the boundary integral.

    Parameters
    ----------
    twist : array_like (..., 3)
        Velocity of the body frame's origin and heading rate, in body axes [m/s, m/s, rad/s].

    Returns
    -------
    ndarray (..., 3)
        Force in body axes and moment about the body frame's origin [N, N, N m].

    Raises
    ------
    InputError
        When ``patch`` is no sliding patch or ``twist`` no finite numbers of that shape.

    Examples
    --------
    A square of 0.4 m under 50 N slides along, turns about its middle, and about a point beside it.

    >>> from towval.physics import Coulomb, Patch, pressure_plane
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> patch = sliding_patch(pressure_plane(square, [(50.0, (0.0, 0.0))]), Coulomb(0.35, 1e-3))
    >>> friction_wrench(patch, [[0.1, 0.0, 0.0], [0.0, 0.0, 1.0], [0.1, 0.0, 1.0]]).round(3) + 0.0
    array([[-17.5  ,   0.   ,   0.   ],
           [  0.   ,   0.   ,  -2.678],
           [ -7.571,   0.   ,  -2.303]])
    """
    instance_of(patch, "patch", SlidingPatch)
    given = numbers_of(twist, "twist", 3)
    shape, twists = given.shape, locked(given.reshape(-1, 3), "twist", (None, 3))
    wrenches = np.empty((len(twists), 3))
    _friction_wrenches(patch, twists, wrenches)
    return wrenches.reshape(shape)


@compiled(allocates=False)
def _friction_wrenches(patch: SlidingPatch, twists: Array, wrenches: Array) -> None:
    """Wrenches (n, 3) about the body frame's origin."""
    x, y = patch.origin[0], patch.origin[1]
    for i in range(len(twists)):
        vx, vy, omega = twists[i, 0], twists[i, 1], twists[i, 2]
        fx, fy, moment = wrench_at_origin(patch, vx - omega * y, vy + omega * x, omega)
        wrenches[i, 0], wrenches[i, 1], wrenches[i, 2] = fx, fy, moment + x * fy - y * fx


def _circle(corners: Array) -> tuple[float, float, float]:
    """Centre (x, y) and radius of a circle around corners."""
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return (*centre, float(np.linalg.norm(corners - centre, axis=1).max()))


@compiled(allocates=False, forceinline=True)
def wrench_at_origin(patch: SlidingPatch, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
    """Force [N] and moment [N m] about ``patch.origin``, for the velocity there [m/s] and the heading rate [rad/s]."""
    if _centre_is_near(patch, vx, vy, omega):
        sums = _boundary_sums(patch, vx, vy, omega)
        return sums[0], sums[1], sums[2]
    return _area_wrench(patch, vx, vy, omega)


@compiled(allocates=False)
def wrench_and_slopes(
    patch: SlidingPatch, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench as :func:`wrench_at_origin`, then its symmetric Jacobian by the twist: xx, xy, yy, xω, yω, ωω.

    It is symmetric because the wrench is the gradient of the (negative) dissipation potential ∫ p Φ(|v|) dS, Φ′ = μ.
    """
    if not _centre_is_near(patch, vx, vy, omega):
        return _area_sums(patch, vx, vy, omega)
    fx, fy, moment, sx, sy, s_moment, xx, xy, yy = _boundary_sums(patch, vx, vy, omega)
    # Known are the slopes by the velocity and, from the law alone, those along the twist: J · twist = s. The column of
    # ω follows; ω is not small here, for the centre of rotation is near.
    x_omega = (sx - xx * vx - xy * vy) / omega
    y_omega = (sy - xy * vx - yy * vy) / omega
    omega_omega = (s_moment - x_omega * vx - y_omega * vy) / omega
    return fx, fy, moment, xx, xy, yy, x_omega, y_omega, omega_omega


@compiled(allocates=False, inline="always")
def _centre_is_near(patch: SlidingPatch, vx: float, vy: float, omega: float) -> bool:
    """Whether the boundary is to be used: C is near, and speeds are not so low that friction is linear in them."""
    # Roots and squares: the C library's hypot, safe from overflow, takes as long as a node.
    if math.sqrt(vx * vx + vy * vy) + abs(omega) * patch.radius <= patch.table[LOWEST]:
        return False
    for i in range(patch.circles.shape[0]):
        ux, uy = vx - omega * patch.circles[i, 1], vy + omega * patch.circles[i, 0]
        reach = _NEAR * omega * patch.circles[i, 2]
        if ux * ux + uy * uy < reach * reach:
            return True
    return False


@compiled(allocates=False)
def _area_rule(patch: SlidingPatch, vx: float, vy: float, omega: float) -> tuple[int, int]:
    """First and last but one of the nodes over the area that suffice for the distance of C."""
    distance, turning = math.sqrt(vx * vx + vy * vy), abs(omega) * patch.radius
    rule = 0
    while rule + 1 < patch.area_rules.shape[0] and distance > patch.area_rules[rule + 1, 2] * turning:
        rule += 1
    first = int(patch.area_rules[rule, 0])
    return first, first + int(patch.area_rules[rule, 1])


@compiled(allocates=False, forceinline=True)
def _area_wrench(patch: SlidingPatch, vx: float, vy: float, omega: float) -> tuple[float, float, float]:
    """Wrench by nodes over the area."""
    table, nodes, (axx, axy, ayy) = patch.table, patch.area_nodes, patch.anisotropy
    first, end = _area_rule(patch, vx, vy, omega)
    fx = fy = moment = 0.0
    for i in range(first, end):
        x, y = nodes[i, 0], nodes[i, 1]
        ux, uy = vx - omega * y, vy + omega * x
        wx, wy = axx * ux + axy * uy, axy * ux + ayy * uy
        friction = nodes[i, 2] * coefficient_over_speed(table, math.sqrt(ux * wx + uy * wy))
        fx -= friction * wx
        fy -= friction * wy
        moment -= friction * (x * wy - y * wx)
    return fx, fy, moment


@compiled(allocates=False)
def _area_sums(
    patch: SlidingPatch, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench and slopes by nodes over the area.

    With the metric A of ``anisotropy``, velocity u = v + ω k × r and s = √(u·Au), friction is −(μ/s) A u: linear in the
    moments of μ/s over the patch. So is the first part of its slopes; the second is (dμ/ds − μ/s) n nᵀ, n = Au/s.
    """
    table, nodes, (axx, axy, ayy) = patch.table, patch.area_nodes, patch.anisotropy
    first, end = _area_rule(patch, vx, vy, omega)
    # Moments 1, x, y, xx, xy, yy of μ/s, and of dμ/ds − μ/s the products of n and its lever.
    r_1 = r_x = r_y = r_xx = r_xy = r_yy = s_xx = s_xy = s_yy = s_xm = s_ym = s_mm = 0.0
    for i in range(np.uint64(first), np.uint64(end)):
        x, y, force = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        ux, uy = vx - omega * y, vy + omega * x
        wx, wy = axx * ux + axy * uy, axy * ux + ayy * uy
        speed = math.sqrt(ux * wx + uy * wy)
        inverse = 1 / speed if speed > 0 else 0.0
        ratio, slope = ratio_and_slope(table, speed, inverse)
        steeper = force * (slope - ratio)
        ratio *= force
        ratio_x, ratio_y = ratio * x, ratio * y
        r_1 += ratio
        r_x += ratio_x
        r_y += ratio_y
        r_xx += ratio_x * x
        r_xy += ratio_x * y
        r_yy += ratio_y * y
        nx, ny = wx * inverse, wy * inverse
        lever = x * ny - y * nx
        steeper_x, steeper_y = steeper * nx, steeper * ny
        s_xx += steeper_x * nx
        s_xy += steeper_x * ny
        s_yy += steeper_y * ny
        s_xm += steeper_x * lever
        s_ym += steeper_y * lever
        s_mm += steeper * lever * lever
    xx, xy, yy = axx * r_1, axy * r_1, ayy * r_1
    x_omega, y_omega = axy * r_x - axx * r_y, ayy * r_x - axy * r_y
    omega_omega = ayy * r_xx - 2 * axy * r_xy + axx * r_yy
    return (
        -(xx * vx + xy * vy + x_omega * omega),
        -(xy * vx + yy * vy + y_omega * omega),
        -(x_omega * vx + y_omega * vy + omega_omega * omega),
        -(xx + s_xx),
        -(xy + s_xy),
        -(yy + s_yy),
        -(x_omega + s_xm),
        -(y_omega + s_ym),
        -(omega_omega + s_mm),
    )


@compiled(allocates=False, forceinline=True)
def _boundary_sums(
    patch: SlidingPatch, vx: float, vy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Wrench, its derivative along the twist and its slopes xx, xy, yy by the velocity, from the edges.

    In an edge's own axes, τ along it and ν outward, e = τ t/ρ + ν d/ρ and k × e = −ν t/ρ + τ d/ρ.
    """
    edges, plane = patch.edges, patch.pressure
    cx, cy, rate = -vy / omega, vx / omega, abs(omega)
    gx, gy = plane[1], plane[2]
    pressure = plane[0] + gx * cx + gy * cy
    bound = (patch.per_force * abs(pressure), patch.per_force * math.sqrt(gx * gx + gy * gy), 1 / patch.radius)
    fx = fy = moment = sx = sy = s_moment = bxx = bxy = byx = byy = hx = hy = 0.0
    following = prepared_edge(edges[0], cx, cy, bound)
    for i in range(edges.shape[0]):
        current = following
        # The next edge is prepared before this one is summed up, for its roots and divisions take long but little.
        if i + 1 < edges.shape[0]:
            following = prepared_edge(edges[i + 1], cx, cy, bound)
        distance, pairs = current[0], current[4]
        if pairs == 0:
            continue
        tx, ty = edges[i, 2], edges[i, 3]
        along = gx * tx + gy * ty
        across = (gx * ty - gy * tx) * (1.0 if distance > 0 else -1.0)
        f_t, f_d, f_m, k_t, k_d, k_m, b_t, b_d, h_t, h_d = edge_integrals(
            patch.table, current, (pressure, along, across), rate
        )
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
