"""The footprint as a polygon: whether it is one, how large it is, and whether what stands on it tips over.

Nothing here is compiled, so that reading a campaign waits for no compiler.
"""

import functools

import numpy as np
import shapely

from towval.model import Array, Patch
from towval.model.errors import InputError, RefusedError

_EDGE_DISTANCE_LIMIT = 1e-9  # of the size: closer to the hull's edge the contact is a line, and no pressure is finite


def footprint_polygon(patch: Patch) -> shapely.Polygon | shapely.MultiPolygon:
    """The footprint as an oriented polygon, several where its parts are apart; made once, for many simulations.

    Raises `InputError` when a part is no simple polygon, or parts overlap or share an edge.
    """
    return _polygon(tuple(ring.tobytes() for ring in patch.outlines), tuple(ring.tobytes() for ring in patch.holes))


@functools.lru_cache(maxsize=64)
def _polygon(outer: tuple[bytes, ...], inner: tuple[bytes, ...]) -> shapely.Polygon | shapely.MultiPolygon:
    """The same from the bytes of its rings, by which it is known again."""
    outlines, rings = ([np.frombuffer(ring).reshape(-1, 2) for ring in kind] for kind in (outer, inner))
    around = [shapely.Polygon(ring) for ring in outlines]
    holes: list[list[Array]] = [[] for _ in around]
    for hole in rings:
        within = [part for part, outline in enumerate(around) if outline.contains(shapely.Point(hole[0]))]
        holes[within[0] if within else 0].append(hole)  # In the wrong place it makes the polygon invalid.
    parts = [shapely.Polygon(outline.exterior, inside) for outline, inside in zip(around, holes, strict=True)]
    polygon = parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)
    if not polygon.is_valid or polygon.area <= 0:
        raise InputError(
            "the footprint is no simple polygon",
            got=shapely.is_valid_reason(polygon),
            allowed="edges that do not cross, holes inside their outline, parts apart from each other, area above zero",
        )
    return shapely.orient_polygons(polygon)


def footprint_size(patch: Patch) -> float:
    """Diagonal of the box around the footprint [m]."""
    return float(np.linalg.norm(np.ptp(patch.corners, axis=0)))


def convex_hull(patch: Patch) -> shapely.Polygon:
    """The convex hull of the footprint; raises as :func:`footprint_polygon`."""
    return _convex_hull(footprint_polygon(patch))


def refuse_tipping(patch: Patch, centre: Array) -> None:
    """Raise RefusedError where the centre of the loads is outside the convex hull of the footprint, or on its edge."""
    hull, point = convex_hull(patch), shapely.Point(centre)
    distance, least = hull.exterior.distance(point), _EDGE_DISTANCE_LIMIT * footprint_size(patch)
    if not hull.contains(point) or distance < least:
        side = "on the edge of" if distance < least else f"{distance:.4g} m outside"
        raise RefusedError(
            "the object tips over: its loads act outside the footprint",
            got=f"{tuple(centre.tolist())} m, {side} the convex hull of the footprint",
            allowed="inside the convex hull",
            remedy="check the place and mass of the loads and the outline of the footprint",
        )


@functools.lru_cache(maxsize=64)
def _convex_hull(polygon: shapely.Polygon | shapely.MultiPolygon) -> shapely.Polygon:
    return polygon.convex_hull
