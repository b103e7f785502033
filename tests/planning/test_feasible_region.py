"""The feasible region: brute force over the steering angles, closed forms of its tips, nearest points, symmetry."""

import numpy as np
import pytest

from studies import rover_geometry
from studies.rover_geometry import twist_about
from towval.model.errors import InputError
from towval.model.geometry import inside_polygon
from towval.planning import feasible_region as region
from towval.planning.kinematics import Rover, steering_of_twist, symmetric_rover

EXTENT = 6.0
OUTWARD = np.radians(33.7)
rng = np.random.default_rng(11)


def swept_by_every_wheel(rover, points, angles=181):
    """Brute force: steer each wheel through its range and see whether its axle line sweeps over the points.

    The distance of a point from the axle, along the wheel, is continuous in the angle: it is swept where the sign
    changes between two angles next to each other.
    """
    swept = np.ones(len(points), dtype=bool)
    for position, (least, greatest) in zip(rover.wheel_positions, rover.steering_ranges, strict=True):
        angle = np.linspace(least, greatest, angles)
        offset = points - position
        ahead = offset @ np.stack([np.cos(angle), np.sin(angle)])
        signs = np.signbit(ahead)
        swept &= (signs[:, 1:] != signs[:, :-1]).any(axis=1)
    return swept


def asymmetric_rover():
    symmetric = symmetric_rover(0.7, 0.4, 0.1, outward=0.5, inward=1.5)
    ranges = np.array([[-1.2, 0.7], [-0.4, 1.6], [-1.5, 0.5], [-0.6, 1.0]])
    return Rover(symmetric.wheel_positions, ranges, 0.1, np.zeros(2))


@pytest.mark.parametrize("build", [lambda r: r, lambda r: asymmetric_rover()], ids=["paper", "asymmetric"])
def test_agrees_with_brute_force_over_the_steering_angles_on_100000_points(rover, build):
    rover = build(rover)
    points = rng.uniform(-EXTENT, EXTENT, size=(100_000, 2))
    polygons = [piece.polygon(EXTENT) for piece in rover_geometry.feasible_pieces(rover, EXTENT)]
    inside = np.any([inside_polygon(polygon, points) for polygon in polygons], axis=0)
    brute = np.concatenate([swept_by_every_wheel(rover, chunk) for chunk in np.split(points, 20)])
    assert (inside == brute).all()
    assert (rover_geometry.is_feasible(rover, points) == brute).all()
    assert 0.05 < inside.mean() < 0.95


def test_tips_of_the_flanks_lie_beside_the_rover_where_the_outward_limit_puts_them(rover):
    radius = 0.25 + 0.3 / np.tan(OUTWARD)
    tips = region.flanks(rover).tips
    np.testing.assert_allclose(tips, [[0.0, radius], [0.0, -radius]], atol=1e-8)


def test_flanks_are_wedges_as_wide_as_the_outward_limit(rover):
    polygon = region.feasible_piece(rover, (1, 1, 1, 1)).polygon(EXTENT)
    tip = 0.25 + 0.3 / np.tan(OUTWARD)
    half_width = (EXTENT - tip) * np.tan(OUTWARD)
    expected = np.array([[0, tip], [half_width, EXTENT], [-half_width, EXTENT]])
    assert len(polygon) == 3
    gap = np.linalg.norm(polygon[:, None] - expected[None], axis=-1).min(axis=1)
    assert gap.max() < 1e-12


def test_the_rover_can_turn_on_the_spot_under_its_belly(rover):
    assert rover_geometry.is_feasible(rover, [0.0, 0.0])


def test_pieces_do_not_overlap(rover):
    points = rng.uniform(-EXTENT, EXTENT, size=(20_000, 2))
    assert sum(piece.contains(points).astype(int) for piece in rover_geometry.feasible_pieces(rover, EXTENT)).max() == 1


def test_pieces_of_the_symmetric_rover_are_mirror_images(rover):
    points = rng.uniform(-EXTENT, EXTENT, size=(20_000, 2))
    for mirror in ([1, -1], [-1, 1]):
        assert (rover_geometry.is_feasible(rover, points) == rover_geometry.is_feasible(rover, points * mirror)).all()


def test_nearest_centre_beats_every_sampled_one(rover):
    flanks = region.flanks(rover)
    left = region.feasible_piece(rover, (1, 1, 1, 1))
    samples = rng.uniform(-EXTENT, EXTENT, size=(200_000, 2))
    samples = samples[left.contains(samples)]
    for point in rng.uniform(-4, 4, size=(50, 2)):
        x, y, distance = region.nearest_centre(flanks.normals[0], flanks.offsets[0], flanks.corners[0], *point)
        assert distance == pytest.approx(np.hypot(x - point[0], y - point[1]), abs=1e-12)
        assert left.contains([x, y + 1e-8])
        sampled = np.linalg.norm(samples - point, axis=1).min()
        assert distance <= sampled + 1e-8
        assert distance >= sampled - 0.1  # how densely the samples lie


def test_a_feasible_centre_is_its_own_nearest(rover):
    flanks = region.flanks(rover)
    nearest = region.nearest_centre(flanks.normals[1], flanks.offsets[1], flanks.corners[1], 0.1, -3.0)
    assert nearest == (0.1, -3.0, 0.0)


def test_steering_polygon_is_the_flanks_seen_through_the_bicycle(rover):
    corners = region.flanks(rover).steering_corners
    tangents = rng.uniform(-1.5, 1.5, size=(20_000, 2))
    rate = (tangents[:, 0] - tangents[:, 1]) / 0.6
    twist = np.stack([np.ones(len(rate)), tangents[:, 0] - rate * 0.3, rate], axis=1)
    steering = steering_of_twist(rover.wheel_positions, twist)
    in_range = ((steering >= rover.steering_ranges[:, 0]) & (steering <= rover.steering_ranges[:, 1])).all(axis=1)
    assert (inside_polygon(corners, tangents) == in_range).all()
    assert 0.05 < in_range.mean() < 0.95


def test_nearest_in_polygon_keeps_inside_points_and_finds_edges_and_corners():
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    assert region.nearest_in_polygon(square, 0.3, -0.9) == (0.3, -0.9)
    assert region.nearest_in_polygon(square, 0.25, -4.0) == (0.25, -1.0)
    assert region.nearest_in_polygon(square, 3.0, 4.0) == (1.0, 1.0)


def test_centres_within_the_flanks_keep_every_wheel_in_range(rover):
    points = rng.uniform(-EXTENT, EXTENT, size=(20_000, 2))
    left = points[region.feasible_piece(rover, (1, 1, 1, 1)).contains(points)]
    steering = steering_of_twist(rover.wheel_positions, twist_about(left))
    assert (steering >= rover.steering_ranges[:, 0] - 1e-12).all()
    assert (steering <= rover.steering_ranges[:, 1] + 1e-12).all()


@pytest.mark.parametrize(
    ("sides", "guard", "words"),
    [((1,), 0.0, "wrong shape"), ((0, 0, 0, 0), 0.0, "no side"), ((1,) * 4, 9.0, "leaves nothing")],
)
def test_a_piece_of_no_sides_is_refused(rover, sides, guard, words):
    """One side counted for all wheels, and no side left the whole plane."""
    with pytest.raises(InputError, match=words):
        region.feasible_piece(rover, sides, guard)
