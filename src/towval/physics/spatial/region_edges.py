"""Slopes of the friction by place and heading where the edge of a region of the floor passes under the soles.

What lies within a region changes by what its edge sweeps over as the body moves: with r' the shift of the floor in body
axes, n the outward normal of the part and f the friction per area of the region's share,

    dF = ∫ f (r' · n) dl    along the edge within the soles.

It enters the Jacobian alone, so Gauss nodes along each edge are enough.
"""

from __future__ import annotations

import math

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.area_rules import gauss_rule
from towval.physics.friction_table import coefficient_over_speed
from towval.physics.spatial.contact_parts import Frame, half_plane
from towval.physics.spatial.soles import (
    ACTIVE,
    END,
    FIRST,
    LEVER,
    PIECE,
    PLAIN,
    RADIUS,
    STRETCH,
    WEIGHT,
    Regions,
    Soles,
    Work,
)
from towval.physics.spatial.unit_wrenches import MOVED

_ALONG, _SHARE = gauss_rule(12)
_LEAST_SCALE = 0.01  # of an edge: over which its nodes lie densest where the centre of rotation is on it
_ON_EDGE = 1e-9  # of the radius of the soles: what a corner that was cut off lies beside the line that cut it


@compiled(allocates=False)
def region_slopes(
    soles: Soles, regions: Regions, table: Array, frame: Frame, twist: tuple[float, float, float], work: Work
) -> None:
    """Slopes of the wrench in body axes by place and heading into the columns of ``work.matrices[MOVED]``."""
    moved, beside = work.matrices[MOVED], _ON_EDGE * soles.numbers[RADIUS]
    for i in range(3):
        for j in range(3):
            moved[i, j] = 0.0
    for k in range(soles.parts.shape[0], int(work.counts[ACTIVE])):
        row = work.active[k]
        piece = int(row[PIECE])
        for e in range(int(row[FIRST]), int(row[END])):
            edge = work.cut[e]
            if _bounds_the_region(regions, piece, frame, edge, beside):
                _sweep(soles, table, frame, twist, edge, row[WEIGHT], work)


@compiled(allocates=False)
def _bounds_the_region(regions: Regions, piece: int, frame: Frame, edge: Array, beside: float) -> bool:
    """Whether an edge lies on the border of the piece that it was cut by, not on that of a sole."""
    for plane in range(int(regions.pieces[piece, FIRST]), int(regions.pieces[piece, END])):
        c, a, b = half_plane(regions, plane, frame)
        first = c + a * edge[PLAIN] + b * edge[PLAIN + 1]
        if abs(first) <= beside and abs(c + a * edge[PLAIN + 2] + b * edge[PLAIN + 3]) <= beside:
            return True
    return False


@compiled(allocates=False)
def _sweep(
    soles: Soles, table: Array, frame: Frame, twist: tuple[float, float, float], edge: Array, weight: float, work: Work
) -> None:
    """Add what an edge sweeps over, to both sides of its place that is nearest to the centre of rotation."""
    ex, ey = edge[PLAIN + 2] - edge[PLAIN], edge[PLAIN + 3] - edge[PLAIN + 1]
    square = ex * ex + ey * ey
    if square == 0:
        return
    vx, vy, omega = twist[0], twist[1], soles.numbers[LEVER] * twist[2]
    nearest, scale = 0.0, 1.0
    if omega != 0:
        cx, cy = -vy / omega - edge[PLAIN], vx / omega - edge[PLAIN + 1]
        nearest = min(max((cx * ex + cy * ey) / square, 0.0), 1.0)
        scale = max(math.sqrt((cx - nearest * ex) ** 2 + (cy - nearest * ey) ** 2) / math.sqrt(square), _LEAST_SCALE)
    for end in range(2):
        length = end - nearest
        if length == 0:
            continue
        # Nodes lie densest where the direction of sliding turns fastest: over the distance of the centre of rotation.
        whole = math.asinh(length / scale)
        for i in range(len(_ALONG)):
            raised = math.exp(_ALONG[i] * whole)
            along = nearest + 0.5 * scale * (raised - 1 / raised)
            share = abs(whole) * _SHARE[i] * 0.5 * scale * (raised + 1 / raised)
            _add_node(soles, table, frame, twist, edge, along, share * weight, work)


@compiled(allocates=False)
def _add_node(
    soles: Soles,
    table: Array,
    frame: Frame,
    twist: tuple[float, float, float],
    edge: Array,
    along: float,
    weight: float,
    work: Work,
) -> None:
    stretch, lever = soles.numbers[STRETCH], soles.numbers[LEVER]
    x, moved = work.pressure, work.matrices[MOVED]
    _, _, cos, sin = frame
    ex, ey = edge[PLAIN + 2] - edge[PLAIN], edge[PLAIN + 3] - edge[PLAIN + 1]
    px, py = edge[PLAIN] + along * ex, edge[PLAIN + 1] + along * ey
    ux, uy = twist[0] - lever * twist[2] * py, stretch * (twist[1] + lever * twist[2] * px)
    force = weight * (x[0] + x[1] * px + x[2] * py) * coefficient_over_speed(table, math.sqrt(ux * ux + uy * uy))
    fx, fy = -force * ux, -force * stretch * uy
    moment = lever * (px * fy - py * fx)
    for j in range(3):
        swept = -cos * ey - sin * ex if j == 0 else (cos * ex - sin * ey if j == 1 else py * ey + px * ex)
        moved[0, j] += fx * swept
        moved[1, j] += fy * swept
        moved[2, j] += moment * swept
