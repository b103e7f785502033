"""A footprint of one or more soles laid out about the centre of mass for compiled code, and the arrays it works in.

Friction that depends on the direction of sliding, an ellipse with semi-axes 1 and ρ along the body's axes, is isotropic
friction on the footprint stretched by ρ along x, at the twist stretched by ρ in v_y. So edges and nodes are kept
stretched.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import shapely

from towval.model import Array, Ground, Patch
from towval.model.compiling import compiled
from towval.physics.area_rules import nodes_over
from towval.physics.contact import clipped_moments, oriented_rings
from towval.physics.footprint import footprint_polygon

# Nodes along each side of a piece of a sole, and from how many radii of the sole on they err by some 1e-10 of μNR.
_RULES = ((6, 0.0), (5, 7.0), (4, 20.0), (3, 100.0))
RULE_REACHES = np.array([reach for _, reach in _RULES])

# Columns of an edge: stretched start (x, y), unit tangent (x, y) and length; plain start (x, y) and end (x, y).
START, PLAIN, EDGE_COLUMNS = 0, 5, 9
# Columns of a part, one sole: first edge and the one after its last, circle (x, y, radius), first node of each rule.
FIRST, END, CIRCLE, NODES = 0, 1, 2, 5
# Numbers of the soles: stretch ρ, radius, one over the stretched area, share of the lever arm, six moments of the area.
STRETCH, RADIUS, PER_AREA, LEVER, MOMENTS = 0, 1, 2, 3, 4
# Column of a piece of a region, after its first half-plane and the one after its last: the factor on μ less one.
EXCESS = 2
# Columns of an active part: first edge and the one after its last, whether these are among the cut ones, weight of its
# friction, the sole it is of, how it was integrated last, its first node then and the one after its last, and the piece
# of a region that it lies within.
IS_CUT, WEIGHT, SOLE, METHOD, FROM_NODE, TO_NODE, PIECE = range(2, 9)
# Of the counts: active parts, whether anything is cut, edges that are.
ACTIVE, ANY_CUT, CUT_EDGES = range(3)


class Soles(NamedTuple):
    """A footprint about G in body axes [m].

    ``edges`` (n, 9), ``parts`` (p, 10), ``nodes`` (k, 3) stretched place and area, ``numbers`` (10,): columns above;
    ``rings`` (r, 2) the edge after the last of each ring, and its part.
    """

    edges: Array
    parts: Array
    rings: Array
    nodes: Array
    numbers: Array


class Regions(NamedTuple):
    """Convex pieces of regions of the floor.

    ``pieces`` (k, 3): first half-plane, the one after the last, factor on μ less one; ``planes`` (m, 3): a piece is
    where ``n_x X + n_y Y + c >= 0`` for all of its half-planes, floor axes [m].
    """

    pieces: Array
    planes: Array


class Work(NamedTuple):
    """Arrays that compiled code writes to; one set serves one motion.

    ``matrices`` (6, 3, 3): wrench of the basis pressures W, inverse of the equilibrium S, slopes by the twist J, the
    equilibrium itself, scratch, slopes by place and heading over the edge of a region; ``pressure`` (3,): at G [Pa] and
    its slopes [Pa/m]; ``moments`` (6,) of the area in contact; ``active`` (m, 9) and ``counts`` (3,): the parts that
    friction acts on, columns above, see ``contact_parts``; ``cut`` their edges where they are cut; ``sums`` (edges, 13)
    of the last pass over the boundary; ``accumulated`` (9,); ``corners`` (2, c, 2) of rings being clipped;
    ``cut_nodes`` (k, 3) over the area of cut parts, as ``Soles.nodes``; ``at_nodes`` (3, k) what a loop over nodes
    leaves to the next; ``friction_error`` (1,) relative, that may be left where the contact is cut; ``hanging`` (5,)
    the last distance of a tether with mass and its forces, see ``following_forces``.
    """

    matrices: Array
    pressure: Array
    moments: Array
    active: Array
    counts: Array
    cut: Array
    sums: Array
    accumulated: Array
    corners: Array
    cut_nodes: Array
    at_nodes: Array
    friction_error: Array
    hanging: Array


def soles(patch: Patch, centre: Array, across_over_along: float = 1.0, radius_over_planar: float = 1.0) -> Soles:
    """Lay out a footprint about ``centre`` (2,), the centre of mass in the body frame [m].

    ``across_over_along`` and ``radius_over_planar`` as in :class:`towval.model.Sliding`.
    """
    edges, parts, rings, nodes = [], [], [], []
    stretch = np.array([across_over_along, 1.0])
    first = first_node = 0
    for number, (outlines, rules) in enumerate(_laid_out(footprint_polygon(patch))):
        moved = [ring - centre for ring in outlines]
        edges += [_edges(ring, stretch) for ring in moved]
        ends = first + np.cumsum([len(ring) for ring in moved])
        rings += [(end, number) for end in ends]
        corners = moved[0] * stretch
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        starts = first_node + np.concatenate([[0], np.cumsum([len(rule) for rule in rules])])
        reach = np.linalg.norm(corners - middle, axis=1).max()
        parts.append([first, ends[-1], *middle, reach, *starts])
        nodes += rules
        first, first_node = int(ends[-1]), int(starts[-1])
    all_edges, all_nodes = np.concatenate(edges), np.concatenate(nodes)
    all_nodes[:, :2] = (all_nodes[:, :2] - centre) * stretch
    all_nodes[:, 2] *= across_over_along
    moments = np.empty(6)
    clipped_moments(all_edges[:, PLAIN : PLAIN + 2].copy(), np.array([r[0] for r in rings]), 1.0, 0.0, 0.0, moments)
    radius = float(np.linalg.norm(all_edges[:, :2], axis=1).max())
    numbers = [across_over_along, radius, 1 / (moments[0] * across_over_along), radius_over_planar, *moments]
    return Soles(all_edges, np.array(parts, float), np.array(rings, float), all_nodes, np.array(numbers))


@functools.lru_cache(maxsize=64)
def _laid_out(polygon: shapely.Polygon | shapely.MultiPolygon) -> list[tuple[list[Array], list[Array]]]:
    """Rings and nodes of each rule of each sole, in the body frame; made once a footprint, for many simulations."""
    parts = shapely.get_parts(polygon)
    return [(oriented_rings(part), [nodes_over(part, along) for along, _ in _RULES]) for part in parts]


def _edges(ring: Array, stretch: Array) -> Array:
    ends = np.roll(ring, -1, axis=0)
    vectors = (ends - ring) * stretch
    lengths = np.linalg.norm(vectors, axis=1)
    return np.column_stack([ring * stretch, vectors / lengths[:, None], lengths, ring, ends])


def regions_of(ground: Ground) -> Regions:
    """The regions of a floor as convex pieces; overlapping ones add up."""
    pieces: list[list[float]] = []
    planes: list[list[float]] = []
    for region in ground.regions:
        triangles = shapely.constrained_delaunay_triangles(shapely.Polygon(region.outline)).geoms
        for piece in _convex_pieces(region.outline, triangles):
            ends = np.roll(piece, -1, axis=0)
            inward = np.column_stack([-(ends - piece)[:, 1], (ends - piece)[:, 0]])
            inward /= np.linalg.norm(inward, axis=1)[:, None]
            pieces.append([len(planes), len(planes) + len(piece), region.factor - 1])
            planes += np.column_stack([inward, -np.sum(inward * piece, axis=1)]).tolist()
    return Regions(np.array(pieces, float).reshape(-1, 3), np.array(planes, float).reshape(-1, 3))


def _convex_pieces(outline: Array, triangles: list[shapely.Polygon]) -> list[Array]:
    """The outline itself where it is convex, else its triangles; counter-clockwise."""
    whole = shapely.orient_polygons(shapely.Polygon(outline))
    hull = whole.convex_hull
    parts = [whole] if hull.area - whole.area <= 1e-12 * hull.area else shapely.orient_polygons(list(triangles))
    return [shapely.get_coordinates(part)[:-1] for part in parts]


def work_for(soles: Soles, regions: Regions, friction_error: float = 1e-12) -> Work:
    """Arrays for motions of these soles over these regions; the error of friction that may be left, relative."""
    n, p, pieces = len(soles.edges), len(soles.parts), len(regions.pieces)
    most = int(np.diff(regions.pieces[:, :2], axis=1).max()) if pieces else 0
    kept = 3 * n + 4  # A cut adds an edge to an edge at most, and a ring's seam.
    corners = kept * (1 + most)
    most_nodes = 25 * (kept + pieces * corners)
    work = Work(
        matrices=np.zeros((6, 3, 3)),
        pressure=np.zeros(3),
        moments=soles.numbers[MOMENTS : MOMENTS + 6].copy(),
        active=np.zeros((p * (1 + pieces), 9)),
        counts=np.zeros(3),
        cut=np.zeros((kept + pieces * corners, EDGE_COLUMNS)),
        sums=np.zeros((n + kept + pieces * corners, 13)),
        accumulated=np.zeros(9),
        corners=np.zeros((2, corners, 2)),
        cut_nodes=np.zeros((most_nodes, 3)),
        at_nodes=np.zeros((3, max(most_nodes, len(soles.nodes)))),
        friction_error=np.array([friction_error]),
        hanging=np.zeros(5),
    )
    all_parts(soles, work)
    return work


@compiled(allocates=False)
def all_parts(soles: Soles, work: Work) -> None:
    """Let friction act on all soles, nothing cut."""
    for part in range(soles.parts.shape[0]):
        active = work.active[part]
        active[FIRST], active[END], active[IS_CUT], active[WEIGHT] = (
            soles.parts[part, FIRST],
            soles.parts[part, END],
            0.0,
            1.0,
        )
        active[SOLE] = part
    work.counts[ACTIVE], work.counts[ANY_CUT] = soles.parts.shape[0], 0.0
    for i in range(6):
        work.moments[i] = soles.numbers[MOMENTS + i]
