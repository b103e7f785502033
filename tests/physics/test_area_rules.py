import numpy as np
import pytest
import shapely

from footprints import random_star
from towval.physics.area_rules import area_rules

HOLE = np.array([[0.2, 0.2], [0.2, 0.4], [0.4, 0.2]])
L_SHAPE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.5, 0.5], [0.5, 1.0], [0.0, 1.0]])
RECTANGLE = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
ALONG = np.array([6, 5, 4])
GAUSS = np.polynomial.legendre.leggauss(12)
PRESSURE = np.array([3.0, 0.4, -0.7])


def polygon_moment(rings, i, j):
    """∫ xⁱ yʲ dS = ∮ xⁱ⁺¹ yʲ / (i + 1) dy, along the edges by Gauss nodes that are exact."""
    total = 0.0
    for ring in rings:
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            for node, weight in zip(*GAUSS, strict=True):
                x, y = a + (b - a) * (node + 1) / 2
                total += weight / 2 * x ** (i + 1) * y**j / (i + 1) * (b - a)[1]
    return total


def loaded_moment(rings, i, j):
    shares = zip(PRESSURE, ((0, 0), (1, 0), (0, 1)), strict=True)
    return sum(slope * polygon_moment(rings, i + di, j + dj) for slope, (di, dj) in shares)


def star(seed):
    ring = random_star(np.random.default_rng(seed), corners=(5, 12))
    return (ring - ring.mean(axis=0)) / np.ptp(ring)


@pytest.mark.parametrize("rings", [(RECTANGLE,), (L_SHAPE, HOLE), *((star(seed),) for seed in range(5))])
def test_rules_are_exact_for_polynomials(rings):
    """n nodes along a side: exact to degree 2 n − 1 in each direction, one of it the pressure's, one the map's."""
    nodes, rules = area_rules(rings, PRESSURE)
    for along, (first, count, _) in zip(ALONG, rules.astype(int), strict=True):
        x, y, force = nodes[first : first + count].T
        degree = 2 * along - 3
        for i in range(degree + 1):
            for j in range(degree + 1 - i):
                assert force @ (x**i * y**j) == pytest.approx(loaded_moment(rings, i, j), rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("rings", [(RECTANGLE,), (L_SHAPE, HOLE), *((star(seed),) for seed in range(5))])
def test_nodes_stand_within_the_patch_and_press(rings):
    nodes, _ = area_rules(rings, PRESSURE)
    patch = shapely.Polygon(rings[0], rings[1:])
    assert shapely.contains_xy(patch, nodes[:, :2]).all()
    assert (nodes[:, 2] > 0).all()


def test_triangles_are_joined_in_pairs():
    """A rectangle is one piece, and the four triangles of an L are two; each piece has as many nodes as any."""
    _, rules = area_rules((RECTANGLE,), PRESSURE)
    assert (rules[:, 1] == ALONG**2).all()
    _, rules = area_rules((L_SHAPE,), PRESSURE)
    assert (rules[:, 1] == 2 * ALONG**2).all()
    _, rules = area_rules((L_SHAPE[:3],), PRESSURE)
    assert (rules[:, 1] == ALONG**2).all()


def test_triangles_that_only_join_to_a_dart_stay_apart():
    """Both triangles of a dart share a side, but the dart turns right at one corner."""
    dart = np.array([[0.0, 0.0], [1.0, -0.5], [0.3, 0.0], [1.0, 0.5]])
    _, rules = area_rules((dart,), PRESSURE)
    assert (rules[:, 1] == 2 * ALONG**2).all()
