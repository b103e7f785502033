"""Gauss rules over the area of a sliding patch, for centres of rotation far from it.

The integrand of ``wrench`` is smooth there, and how many nodes it needs follows from the distance alone. The patch is
cut into convex quadrilaterals and the triangles that are left over; a product rule of Gauss serves both, a triangle
being a quadrilateral with two corners in one place.
"""

import functools

import numpy as np
import shapely

from towval.model import Array

# Nodes along each side of a piece, and from how many radii of the whole patch on they err by some 1e-10 of μN.
_RULES = ((6, 0.0), (5, 7.0), (4, 20.0))


@functools.cache
def gauss_rule(along: int) -> tuple[Array, Array]:
    """Nodes and weights (along,) of Gauss' rule over 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(along)
    return (nodes + 1) / 2, weights / 2


def area_rules(rings: tuple[Array, ...], pressure: Array) -> tuple[Array, Array]:
    """Nodes (k, 3) and rules (r, 3) over a patch, the finest rule first.

    A node is a place (x, y) [m] and the force p dS [N]; a rule is its first node, the number of its nodes, and from how
    many radii of the patch on it serves. ``rings`` (n, 2) [m] are oriented: a clockwise one is a hole of the
    counter-clockwise one before it. ``pressure`` (3,) is that at the origin [Pa] and its slopes [Pa/m].
    """
    triangles = np.concatenate([_triangles(polygon) for polygon in polygons_of(rings)])
    pieces = _pieces(triangles)
    nodes = [_gauss_nodes(pieces, pressure, along) for along, _ in _RULES]
    counts = np.array([len(rule) for rule in nodes])
    rules = np.column_stack([np.cumsum(counts) - counts, counts, [reach for _, reach in _RULES]])
    return np.concatenate(nodes), rules


def nodes_over(polygon: shapely.Polygon, along: int) -> Array:
    """Nodes (k, 3) of a rule over a polygon [m]: place (x, y) [m] and area [m²]; ``along`` each side of a piece."""
    return _gauss_nodes(_pieces(_triangles(polygon)), np.array([1.0, 0.0, 0.0]), along)


def polygons_of(rings: tuple[Array, ...]) -> list[shapely.Polygon]:
    """Oriented rings as polygons: a clockwise ring is a hole of the counter-clockwise ring before it."""
    polygons: list[shapely.Polygon] = []
    for ring in rings:
        if shapely.is_ccw(shapely.LinearRing(ring)):
            polygons.append(shapely.Polygon(ring))
        else:
            outer = polygons.pop()
            polygons.append(shapely.Polygon(outer.exterior, [*outer.interiors, ring]))
    return polygons


def _triangles(polygon: shapely.Polygon) -> Array:
    """A triangulation (k, 3, 2) [m], counter-clockwise."""
    triangles = shapely.orient_polygons(shapely.constrained_delaunay_triangles(polygon).geoms)
    return np.array([shapely.get_coordinates(triangle)[:3] for triangle in triangles])


def _pieces(triangles: Array) -> Array:
    """Corners (k, 4, 2) of convex pieces: triangles joined in pairs, and the rest with their first corner doubled.

    Longest common sides go first, so that the pieces are hardly larger than the triangles were.
    """
    opposite: dict[frozenset[tuple[float, float]], list[tuple[int, int]]] = {}
    for t, triangle in enumerate(triangles.tolist()):
        for k in range(3):
            side = frozenset([tuple(triangle[(k + 1) % 3]), tuple(triangle[(k + 2) % 3])])
            opposite.setdefault(side, []).append((t, k))
    common = [pair for pair in opposite.values() if len(pair) == 2]
    common.sort(key=lambda pair: -_length_opposite(triangles, *pair[0]))
    alone, pieces = set(range(len(triangles))), []
    for (t, k), (s, j) in common:
        if not {t, s} <= alone:
            continue
        around = np.roll(triangles[t], -k, axis=0)
        joined = np.array([around[0], around[1], triangles[s, j], around[2]])
        if _turns_left(joined):
            alone -= {t, s}
            pieces.append(joined)
    return np.array(pieces + [triangles[t, [0, 1, 2, 0]] for t in sorted(alone)])


def _length_opposite(triangles: Array, t: int, corner: int) -> float:
    a, b = triangles[t, (corner + 1) % 3], triangles[t, (corner + 2) % 3]
    return float(np.linalg.norm(b - a))


def _turns_left(corners: Array) -> bool:
    """Whether a polygon turns left at every corner (n, 2): convex and counter-clockwise."""
    sides = np.roll(corners, -1, axis=0) - corners
    following = np.roll(sides, -1, axis=0)
    return bool((sides[:, 0] * following[:, 1] > sides[:, 1] * following[:, 0]).all())


def _gauss_nodes(pieces: Array, pressure: Array, along: int) -> Array:
    """Nodes over pieces (k, 3): place and force p dS, ``along`` squared in each."""
    nodes, weights = gauss_rule(along)
    # The unit square on the piece by the bilinear map; on a doubled corner it is Duffy's.
    u, v = (grid.reshape(-1, 1) for grid in np.meshgrid(nodes, nodes, indexing="ij"))
    a, b, c, d = (corner[:, None] for corner in np.moveaxis(pieces, 1, 0))
    twist = a - b + c - d
    points = a + u * (b - a) + v * (d - a) + u * v * twist
    by_u, by_v = b - a + v * twist, d - a + u * twist
    stretch = by_u[..., 0] * by_v[..., 1] - by_u[..., 1] * by_v[..., 0]
    force = np.outer(weights, weights).ravel() * stretch * (pressure[0] + points @ pressure[1:])
    return np.concatenate([points, force[..., None]], axis=-1).reshape(-1, 3)
