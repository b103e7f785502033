"""Friction wrench of three basis pressures, 1, X and Y about G, from one pass over the boundary of the soles.

The wrench is linear in the pressure at a given twist, so its 3 × 3 matrix W serves every pressure plane; the sums of
``edge_integrals`` that it needs are those of one plane. Per edge 11 moments are kept, from which the slopes by the
twist at a pressure that is then known follow without another pass. Near and far from the centre of rotation is decided
for each sole by itself; far from it Gauss nodes over the sole take over.
"""

from __future__ import annotations

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.edge_integrals import edge_moments, prepared_edge
from towval.physics.friction_table import LOWEST, coefficient_over_speed, ratio_and_slope
from towval.physics.lanes import unpacked
from towval.physics.spatial.soles import (
    ACTIVE,
    CIRCLE,
    END,
    FIRST,
    FROM_NODE,
    IS_CUT,
    LEVER,
    METHOD,
    NODES,
    PER_AREA,
    PLAIN,
    RADIUS,
    RULE_REACHES,
    SOLE,
    STRETCH,
    TO_NODE,
    WEIGHT,
    Soles,
    Work,
)

_NEAR = 4.0  # radii of a sole, as in ``wrench``
W, S, J, EQUILIBRIUM, SCRATCH, MOVED = 0, 1, 2, 3, 4, 5  # of Work.matrices
_LEFT_OUT, _BOUNDARY, _NODES, _CUT_NODES = 0.0, 1.0, 2.0, 3.0  # how an active part was integrated

# Nodes along each side of a piece of a cut part, by the reaches of the rules over whole ones.
_ALONG = (4, 4, 3, 3)
_GAUSS = np.zeros((len(_ALONG), max(_ALONG), 2))
for _rule, _along in enumerate(_ALONG):
    _GAUSS[_rule, :_along] = np.column_stack(np.polynomial.legendre.leggauss(_along)) / 2 + [0.5, 0.0]
_ALONG_OF = np.array(_ALONG)


@compiled(allocates=False, forceinline=True)
def unit_wrenches(soles: Soles, table: Array, vx: float, vy: float, omega: float, work: Work) -> None:
    """Fill W: column j is force [N] and moment [N m] about G per unit of pressure coefficient j, for a twist of G."""
    numbers, parts, active = soles.numbers, soles.parts, work.active
    stretch, lever = numbers[STRETCH], numbers[LEVER]
    vy, omega = stretch * vy, lever * omega
    matrix, total = work.matrices[W], work.accumulated
    for i in range(3):
        for j in range(3):
            matrix[i, j] = total[3 * i + j] = 0.0
    rate = abs(omega)
    slow = math.sqrt(vx * vx + vy * vy) + rate * numbers[RADIUS] <= table[LOWEST]
    any_near, filled = False, 0
    for k in range(int(work.counts[ACTIVE])):
        row = active[k]
        part, is_cut = int(row[SOLE]), row[IS_CUT] > 0
        row[METHOD] = _LEFT_OUT
        if row[END] <= row[FIRST]:
            continue
        ux, uy = vx - omega * parts[part, CIRCLE + 1], vy + omega * parts[part, CIRCLE]
        away, near_speed = math.sqrt(ux * ux + uy * uy), rate * parts[part, CIRCLE + 2]
        if not slow and away < _NEAR * near_speed:
            row[METHOD], any_near = _BOUNDARY, True
            _add_boundary(soles, table, row, vx, vy, omega, work)
            continue
        rule = 0
        while not slow and rule + 1 < len(RULE_REACHES) and away > RULE_REACHES[rule + 1] * near_speed:
            rule += 1
        if is_cut:
            row[METHOD], row[FROM_NODE] = _CUT_NODES, filled
            filled = _fill_nodes(work, row, rule, filled)
            row[TO_NODE] = filled
            _add_nodes(table, work.cut_nodes, row, vx, vy, omega, matrix, work.at_nodes)
        else:
            row[METHOD], row[FROM_NODE], row[TO_NODE] = _NODES, parts[part, NODES + rule], parts[part, NODES + rule + 1]
            _add_nodes(table, soles.nodes, row, vx, vy, omega, matrix, work.at_nodes)
    if any_near:
        _about_origin(total, -vy / omega, vx / omega, 1.0 if omega > 0 else -1.0, matrix)
    if stretch != 1.0 or lever != 1.0:
        for j in range(3):
            share = 1 / stretch if j != 1 else 1 / (stretch * stretch)
            matrix[0, j] *= share
            matrix[1, j] *= share * stretch
            matrix[2, j] *= share * lever


@compiled(allocates=False)
def _about_origin(total: Array, cx: float, cy: float, sign: float, matrix: Array) -> None:
    """Turn sums about the centre of rotation C, of pressures relative to C, into wrenches about G and add them."""
    for j in range(3):
        total[6 + j] += cx * total[3 + j] - cy * total[j]
    for i in range(3):
        matrix[i, 0] += sign * total[3 * i]
        matrix[i, 1] += sign * (total[3 * i + 1] + cx * total[3 * i])
        matrix[i, 2] += sign * (total[3 * i + 2] + cy * total[3 * i])


@compiled(allocates=False)
def _add_boundary(soles: Soles, table: Array, row: Array, vx: float, vy: float, omega: float, work: Work) -> None:
    """Add a part's edges to the sums about C (force x, y and moment, each of the three pressures), kept per edge."""
    edges = work.cut if row[IS_CUT] > 0 else soles.edges
    offset = soles.edges.shape[0] if row[IS_CUT] > 0 else 0
    total, weight, rate = work.accumulated, row[WEIGHT], abs(omega)
    inverse = 1 / soles.numbers[RADIUS]
    bound = (soles.numbers[PER_AREA], soles.numbers[PER_AREA] * inverse, inverse)
    cx, cy = -vy / omega, vx / omega
    for e in range(int(row[FIRST]), int(row[END])):
        prepared = prepared_edge(edges[e], cx, cy, bound)
        kept = work.sums[offset + e]
        kept[0], kept[1] = prepared[0], prepared[4]
        if prepared[4] == 0:
            continue
        d = abs(prepared[0])
        by_1, by_s, by_s2, by_s3 = edge_moments(table, prepared, rate * d)
        mu0, m1_d, m2_0, m3_0 = unpacked(by_1)
        mu1, m1_t, m2_1, m3_1 = unpacked(by_s)
        mu2, _, m2_2, m3_2 = unpacked(by_s2)
        mu3, _, _, m3_3 = unpacked(by_s3)
        kept[2], kept[3], kept[4], kept[5], kept[6], kept[7] = mu0, mu1, mu2, mu3, m1_d, m1_t
        kept[8], kept[9], kept[10], kept[11], kept[12] = m2_0, m2_1, m2_2, m3_0 + m3_2, m3_1 + m3_3
        tx, ty, sign = edges[e, 2], edges[e, 3], 1.0 if prepared[0] > 0 else -1.0
        square = weight * d * d
        cube = square * d
        _add_column(total, 0, tx, ty, sign * square * m1_t, square * m1_d, sign * cube * (m2_0 + m2_2))
        # A pressure that rises by one along the edge, and by one away from C.
        along_t, along_d, along_m = sign * cube * m2_2, cube * m2_1, sign * cube * d * kept[12]
        across_t, across_d, across_m = sign * cube * m2_1, cube * m2_0, sign * cube * d * kept[11]
        for j in range(2):
            a, c = (tx, ty * sign) if j == 0 else (ty, -tx * sign)
            f_t, f_d, f_m = a * along_t + c * across_t, a * along_d + c * across_d, a * along_m + c * across_m
            _add_column(total, 1 + j, tx, ty, f_t, f_d, f_m)


@compiled(allocates=False, inline="always")
def _add_column(total: Array, j: int, tx: float, ty: float, f_t: float, f_d: float, f_m: float) -> None:
    total[j] += ty * f_t - tx * f_d
    total[3 + j] -= tx * f_t + ty * f_d
    total[6 + j] -= f_m


@compiled(allocates=False)
def _add_nodes(
    table: Array, nodes: Array, row: Array, vx: float, vy: float, omega: float, matrix: Array, kept: Array
) -> None:
    """Add a part by nodes over its area: W is linear in eight moments of μ/s.

    One loop a step, not one for all: a processor looks only so far ahead, and then at more nodes at once.
    """
    weight, first, end = row[WEIGHT], np.uint64(row[FROM_NODE]), np.uint64(row[TO_NODE])
    _speeds(nodes, first, end, vx, vy, omega, kept)
    for i in range(first, end):
        kept[1, i] = weight * nodes[i, 2] * coefficient_over_speed(table, kept[0, i])
    r_1 = r_x = r_y = r_xx = r_xy = r_yy = r_xr = r_yr = 0.0
    for i in range(first, end):
        x, y, ratio = nodes[i, 0], nodes[i, 1], kept[1, i]
        ratio_x, ratio_y = ratio * x, ratio * y
        xx, yy = ratio_x * x, ratio_y * y
        r_1 += ratio
        r_x += ratio_x
        r_y += ratio_y
        r_xx += xx
        r_xy += ratio_x * y
        r_yy += yy
        r_xr += (xx + yy) * x
        r_yr += (xx + yy) * y
    matrix[0, 0] -= vx * r_1 - omega * r_y
    matrix[1, 0] -= vy * r_1 + omega * r_x
    matrix[2, 0] -= vy * r_x - vx * r_y + omega * (r_xx + r_yy)
    matrix[0, 1] -= vx * r_x - omega * r_xy
    matrix[1, 1] -= vy * r_x + omega * r_xx
    matrix[2, 1] -= vy * r_xx - vx * r_xy + omega * r_xr
    matrix[0, 2] -= vx * r_y - omega * r_yy
    matrix[1, 2] -= vy * r_y + omega * r_xy
    matrix[2, 2] -= vy * r_xy - vx * r_yy + omega * r_yr


@compiled(allocates=False, inline="always")
def _speeds(nodes: Array, first: np.uint64, end: np.uint64, vx: float, vy: float, omega: float, kept: Array) -> None:
    for i in range(first, end):
        ux, uy = vx - omega * nodes[i, 1], vy + omega * nodes[i, 0]
        kept[0, i] = math.sqrt(ux * ux + uy * uy)


@compiled(allocates=False)
def _fill_nodes(work: Work, row: Array, rule: int, n: int) -> int:
    """Nodes of a cut part from number ``n`` on, over signed quadrilaterals of a corner and two edges each.

    The bilinear map of the unit square covers what its border goes around, with sign, whatever its shape.
    """
    first, end, along, nodes = int(row[FIRST]), int(row[END]), _ALONG_OF[rule], work.cut_nodes
    ox, oy = work.cut[first, 0], work.cut[first, 1]
    e = first + 1
    while e < end:
        edge, following = work.cut[e], work.cut[min(e + 1, end - 1)]
        e += 1
        ax, ay = edge[0] - ox, edge[1] - oy
        bx, by = ax + edge[2] * edge[4], ay + edge[3] * edge[4]
        cx, cy = bx, by
        if e < end and following[PLAIN] == edge[PLAIN + 2] and following[PLAIN + 1] == edge[PLAIN + 3]:
            e += 1
            cx, cy = following[0] + following[2] * following[4] - ox, following[1] + following[3] * following[4] - oy
        # From (0, 0) by u to a, by v to c, across to b.
        twist_x, twist_y = bx - ax - cx, by - ay - cy
        for i in range(along):
            u = _GAUSS[rule, i, 0]
            to_x, to_y = cx + u * twist_x, cy + u * twist_y
            for j in range(along):
                v = _GAUSS[rule, j, 0]
                by_x, by_y = ax + v * twist_x, ay + v * twist_y
                nodes[n, 0], nodes[n, 1] = ox + u * ax + v * to_x, oy + u * ay + v * to_y
                nodes[n, 2] = _GAUSS[rule, i, 1] * _GAUSS[rule, j, 1] * (by_x * to_y - by_y * to_x)
                n += 1
    return n


@compiled(allocates=False)
def _add_node_slopes(
    table: Array,
    nodes: Array,
    row: Array,
    plane: tuple[float, float, float],
    vx: float,
    vy: float,
    omega: float,
    slopes: Array,
    kept: Array,
) -> None:
    """Add a part by nodes over its area, under the pressure of a ``plane``, as :func:`_add_nodes`."""
    weight, first, end = row[WEIGHT], np.uint64(row[FROM_NODE]), np.uint64(row[TO_NODE])
    _speeds(nodes, first, end, vx, vy, omega, kept)
    for i in range(first, end):
        speed = kept[0, i]
        inverse = 1 / speed if speed > 0 else 0.0
        ratio, slope = ratio_and_slope(table, speed, inverse)
        kept[0, i], kept[1, i], kept[2, i] = inverse, ratio, slope - ratio
    xx, xy, yy, x_omega, y_omega, omegas = (
        slopes[0, 0], slopes[0, 1], slopes[1, 1], slopes[0, 2], slopes[1, 2], slopes[2, 2],
    )  # fmt: skip
    for i in range(first, end):
        x, y, inverse = nodes[i, 0], nodes[i, 1], kept[0, i]
        force = weight * nodes[i, 2] * (plane[0] + plane[1] * x + plane[2] * y)
        nx, ny, steeper = (vx - omega * y) * inverse, (vy + omega * x) * inverse, force * kept[2, i]
        ratio = kept[1, i] * force
        lever = x * ny - y * nx
        xx -= ratio + steeper * nx * nx
        xy -= steeper * nx * ny
        yy -= ratio + steeper * ny * ny
        x_omega -= steeper * nx * lever - ratio * y
        y_omega -= steeper * ny * lever + ratio * x
        omegas -= ratio * (x * x + y * y) + steeper * lever * lever
    slopes[0, 0], slopes[0, 1], slopes[1, 1] = xx, xy, yy
    slopes[0, 2], slopes[1, 2], slopes[2, 2] = x_omega, y_omega, omegas


@compiled(allocates=False)
def wrench_slopes(soles: Soles, table: Array, vx: float, vy: float, omega: float, work: Work) -> None:
    """Fill J, the slopes of the wrench of ``work.pressure`` by the twist of G, after :func:`unit_wrenches` with it."""
    numbers, pressure = soles.numbers, work.pressure
    stretch, lever = numbers[STRETCH], numbers[LEVER]
    vy, omega = stretch * vy, lever * omega
    slopes, total = work.matrices[J], work.accumulated
    for i in range(3):
        for j in range(3):
            slopes[i, j] = total[3 * i + j] = 0.0
    gx, gy = pressure[1] / stretch, pressure[2]
    any_near = False
    for k in range(int(work.counts[ACTIVE])):
        row = work.active[k]
        if row[METHOD] == _BOUNDARY:
            any_near = True
            _add_boundary_slopes(soles, row, gx, gy, vx, vy, omega, work)
        elif row[METHOD] != _LEFT_OUT:
            nodes, plane = work.cut_nodes if row[METHOD] == _CUT_NODES else soles.nodes, (pressure[0], gx, gy)
            _add_node_slopes(table, nodes, row, plane, vx, vy, omega, slopes, work.at_nodes)
    if any_near:
        _complete_slopes(total, vx, vy, omega, gx, gy, slopes)
    slopes[0, 0] /= stretch
    slopes[1, 1] *= stretch
    slopes[0, 2] *= lever / stretch
    slopes[1, 2] *= lever
    slopes[2, 2] *= lever * lever / stretch
    slopes[1, 0], slopes[2, 0], slopes[2, 1] = slopes[0, 1], slopes[0, 2], slopes[1, 2]


@compiled(allocates=False)
def _add_boundary_slopes(
    soles: Soles, row: Array, gx: float, gy: float, vx: float, vy: float, omega: float, work: Work
) -> None:
    """Add to the sums s (3), b (xx, xy, yx, yy) and h (2) of ``wrench._boundary_sums``, from the moments kept."""
    edges = work.cut if row[IS_CUT] > 0 else soles.edges
    offset = soles.edges.shape[0] if row[IS_CUT] > 0 else 0
    total = work.accumulated
    pressure = work.pressure[0] + (vx * gy - vy * gx) / omega
    for e in range(int(row[FIRST]), int(row[END])):
        kept = work.sums[offset + e]
        if kept[1] == 0:
            continue
        distance, weight = kept[0], row[WEIGHT]
        d = abs(distance)
        mu0, mu1, mu2, mu3, m1_d, m1_t = kept[2], kept[3], kept[4], kept[5], kept[6], kept[7]
        tx, ty = edges[e, 2], edges[e, 3]
        along, across = d * (gx * tx + gy * ty), distance * (gx * ty - gy * tx)
        near = pressure + across
        mu_d, mu_t, mu_m = near * mu0 + along * mu1, near * mu1 + along * mu2, near * (mu0 + mu2) + along * (mu1 + mu3)
        m2_d, m2_t, m2_m = across * kept[8] + along * kept[9], across * kept[9] + along * kept[10], kept[8] + kept[10]
        m3_m = across * kept[11] + along * kept[12]
        plain, signed = weight * d * d, weight * d * distance
        k_t, k_d = signed * (mu_t - 2 * pressure * m1_t - 3 * m2_t), plain * (mu_d - 2 * pressure * m1_d - 3 * m2_d)
        b_t, b_d, h_t, h_d = weight * d * mu_t, weight * distance * mu_d, signed * m1_t, plain * m1_d
        total[0] += ty * k_t - tx * k_d
        total[1] -= tx * k_t + ty * k_d
        total[2] -= signed * d * (mu_m - 3 * pressure * m2_m - 4 * m3_m)
        bx, by = tx * b_d - ty * b_t, tx * b_t + ty * b_d
        total[3] += bx * ty
        total[4] -= bx * tx
        total[5] += by * ty
        total[6] -= by * tx
        total[7] += tx * h_d - ty * h_t
        total[8] += tx * h_t + ty * h_d


@compiled(allocates=False)
def _complete_slopes(total: Array, vx: float, vy: float, omega: float, gx: float, gy: float, slopes: Array) -> None:
    """Slopes from the sums over the boundary; the column of ω from those along the twist, as in ``wrench``."""
    cx, cy, rate, sign = -vy / omega, vx / omega, abs(omega), 1.0 if omega > 0 else -1.0
    sx, sy = sign * total[0], sign * total[1]
    s_moment = sign * total[2] + cx * sy - cy * sx
    xx, xy, yy = (
        (total[4] - gy * total[7]) / rate,
        -(total[3] - gx * total[7]) / rate,
        -(total[5] - gx * total[8]) / rate,
    )
    x_omega = (sx - xx * vx - xy * vy) / omega
    y_omega = (sy - xy * vx - yy * vy) / omega
    slopes[0, 0] += xx
    slopes[0, 1] += xy
    slopes[1, 1] += yy
    slopes[0, 2] += x_omega
    slopes[1, 2] += y_omega
    slopes[2, 2] += (s_moment - x_omega * vx - y_omega * vy) / omega
