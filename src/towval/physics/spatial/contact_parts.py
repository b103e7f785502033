"""Which parts of the soles friction acts on: cut where the pressure ends, counted again within regions of the floor.

The soles are clipped ring by ring; the seams along the cut run there and back and cancel in every sum over edges.
"""

from __future__ import annotations

import math

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.spatial.soles import (
    ACTIVE,
    ANY_CUT,
    CIRCLE,
    CUT_EDGES,
    END,
    EXCESS,
    FIRST,
    IS_CUT,
    PIECE,
    PLAIN,
    SOLE,
    STRETCH,
    WEIGHT,
    Regions,
    Soles,
    Work,
    all_parts,
)

Frame = tuple[float, float, float, float]
"""Place (x, y) of G on the floor [m], cosine and sine of the heading."""


@compiled(allocates=False, forceinline=True)
def contact_parts(soles: Soles, regions: Regions, frame: Frame, work: Work) -> None:
    """Set the active parts for ``work.pressure``; ``work.counts[ANY_CUT]`` is set if anything is cut."""
    x, edges = work.pressure, soles.edges
    whole = True
    for e in range(edges.shape[0]):
        if x[0] + x[1] * edges[e, PLAIN] + x[2] * edges[e, PLAIN + 1] < 0:
            whole = False
            break
    if whole:
        all_parts(soles, work)
    else:
        _cut_by_pressure(soles, work)
    if regions.pieces.shape[0] > 0:
        _add_regions(soles, regions, frame, work)


@compiled(allocates=False)
def _cut_by_pressure(soles: Soles, work: Work) -> None:
    x, stretch = work.pressure, soles.numbers[STRETCH]
    n = ring = 0
    for part in range(soles.parts.shape[0]):
        first = n
        start = int(soles.parts[part, FIRST])
        while ring < soles.rings.shape[0] and int(soles.rings[ring, 1]) == part:
            end = int(soles.rings[ring, 0])
            for i in range(end - start):
                corner = soles.edges[start + i]
                work.corners[1, i, 0], work.corners[1, i, 1] = corner[PLAIN], corner[PLAIN + 1]
            count = _clipped_ring(work.corners[1], end - start, x[0], x[1], x[2], work.corners[0])
            n = _append_ring(work.corners[0], count, stretch, work.cut, n)
            start = end
            ring += 1
        active = work.active[part]
        active[FIRST], active[END], active[IS_CUT], active[WEIGHT], active[SOLE] = first, n, 1.0, 1.0, part
    work.counts[ACTIVE], work.counts[ANY_CUT], work.counts[CUT_EDGES] = soles.parts.shape[0], 1.0, n


@compiled(allocates=False)
def _clipped_ring(corners: Array, count: int, c: float, a: float, b: float, out: Array) -> int:
    """Corners of a ring where ``c + a x + b y > 0``, into ``out``; returns how many."""
    n = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        x0, y0, x1, y1 = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
        z0, z1 = c + a * x0 + b * y0, c + a * x1 + b * y1
        if z0 > 0:
            out[n, 0], out[n, 1] = x0, y0
            n += 1
        if (z0 > 0) != (z1 > 0):
            s = z0 / (z0 - z1)
            out[n, 0], out[n, 1] = x0 + s * (x1 - x0), y0 + s * (y1 - y0)
            n += 1
    return n


@compiled(allocates=False)
def _append_ring(corners: Array, count: int, stretch: float, cut: Array, n: int) -> int:
    """Append the edges of a ring to the cut edges from number ``n`` on; returns the number after the last."""
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        edge = cut[n]
        tx, ty = stretch * (corners[j, 0] - corners[i, 0]), corners[j, 1] - corners[i, 1]
        length = math.sqrt(tx * tx + ty * ty)
        if length <= 0:
            continue
        edge[0], edge[1], edge[2], edge[3], edge[4] = (
            stretch * corners[i, 0],
            corners[i, 1],
            tx / length,
            ty / length,
            length,
        )
        edge[5], edge[6], edge[7], edge[8] = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
        n += 1
    return n


@compiled(allocates=False)
def _add_regions(soles: Soles, regions: Regions, frame: Frame, work: Work) -> None:
    """Add, for each piece of a region, the weight factor − 1 to the parts within it, or append what lies within."""
    stretch = soles.numbers[STRETCH]
    parts, n = soles.parts.shape[0], int(work.counts[CUT_EDGES]) if work.counts[ANY_CUT] > 0 else 0
    k = parts
    for piece in range(regions.pieces.shape[0]):
        for part in range(parts):
            cx, cy = soles.parts[part, CIRCLE] / stretch, soles.parts[part, CIRCLE + 1]
            radius = soles.parts[part, CIRCLE + 2] / min(1.0, stretch)
            source, row = work.active[part], work.active[k]
            depth = _least_depth(regions, piece, cx, cy, frame)
            if depth < -radius:
                continue
            if depth > radius:  # All of it lies within.
                source[WEIGHT] += regions.pieces[piece, EXCESS]
                continue
            first = n
            n = _within(soles, regions, piece, source, frame, work, n)
            if n > first:
                row[FIRST], row[END], row[IS_CUT], row[WEIGHT] = first, n, 1.0, regions.pieces[piece, EXCESS]
                row[SOLE], row[PIECE] = part, piece
                k += 1
    work.counts[ACTIVE] = k


@compiled(allocates=False)
def half_plane(regions: Regions, plane: int, frame: Frame) -> tuple[float, float, float]:
    """A half-plane of the floor in body axes about G: c, a, b of ``c + a x + b y >= 0``."""
    x, y, cos, sin = frame
    nx, ny, c = regions.planes[plane, 0], regions.planes[plane, 1], regions.planes[plane, 2]
    return c + nx * x + ny * y, nx * cos + ny * sin, ny * cos - nx * sin


@compiled(allocates=False)
def _least_depth(regions: Regions, piece: int, cx: float, cy: float, frame: Frame) -> float:
    """How far a place in body axes lies within the half-planes of a piece, of which it is in least [m]."""
    depth = math.inf
    for plane in range(int(regions.pieces[piece, FIRST]), int(regions.pieces[piece, END])):
        c, a, b = half_plane(regions, plane, frame)
        depth = min(depth, c + a * cx + b * cy)
    return depth


@compiled(allocates=False)
def _within(soles: Soles, regions: Regions, piece: int, source: Array, frame: Frame, work: Work, n: int) -> int:
    """Append the part ``source`` within a piece to the cut edges, ring by ring; returns the number after the last."""
    edges, stretch = work.cut if source[IS_CUT] > 0 else soles.edges, soles.numbers[STRETCH]
    start, end = int(source[FIRST]), int(source[END])
    while start < end:
        # A ring ends where the next edge does not go on.
        count = 1
        while start + count < end and (
            edges[start + count, PLAIN] == edges[start + count - 1, PLAIN + 2]
            and edges[start + count, PLAIN + 1] == edges[start + count - 1, PLAIN + 3]
        ):
            count += 1
        kept = count
        for i in range(count):
            work.corners[0, i, 0], work.corners[0, i, 1] = edges[start + i, PLAIN], edges[start + i, PLAIN + 1]
        now = 0
        for plane in range(int(regions.pieces[piece, FIRST]), int(regions.pieces[piece, END])):
            c, a, b = half_plane(regions, plane, frame)
            kept = _clipped_ring(work.corners[now], kept, c, a, b, work.corners[1 - now])
            now = 1 - now
        n = _append_ring(work.corners[now], kept, stretch, work.cut, n)
        start += count
    return n
