"""Constraint matrices, steering and centre: written out again, round trips, exact arcs, refusals."""

import numpy as np
import pytest

from studies import rover_geometry
from towval.model.errors import InputError
from towval.model.geometry import compose, rotation, wrapped
from towval.planning import kinematics

rng = np.random.default_rng(5)
TWISTS = rng.normal(loc=[3.0, 0.0, 0.0], size=(200, 3))


def test_rows_of_the_matrices_are_velocity_along_and_across_the_wheel(rover):
    steering = rng.uniform(-1, 1, size=4)
    velocity = kinematics.wheel_velocities(rover.wheel_positions, TWISTS[0])
    along = np.stack([np.cos(steering), np.sin(steering)], axis=1)
    across = np.stack([-np.sin(steering), np.cos(steering)], axis=1)
    rolling = kinematics.rolling_matrix(rover.wheel_positions, steering) @ TWISTS[0]
    sliding = rover_geometry.sliding_matrix(rover.wheel_positions, steering) @ TWISTS[0]
    np.testing.assert_allclose(rolling, np.sum(velocity * along, axis=1), atol=1e-14)
    np.testing.assert_allclose(sliding, np.sum(velocity * across, axis=1), atol=1e-14)


def test_steering_of_a_twist_leaves_no_slip(rover):
    steering = kinematics.steering_of_twist(rover.wheel_positions, TWISTS)
    rates = kinematics.wheel_rates(rover, steering, TWISTS)
    assert rover_geometry.constraint_residual(rover, steering, rates, TWISTS).max() < 1e-14


@pytest.mark.parametrize("twist", TWISTS[:20])
def test_centre_to_steering_and_back(rover, twist):
    steering = kinematics.steering_of_twist(rover.wheel_positions, twist)
    back, misalignment = rover_geometry.twist_of_steering(rover.wheel_positions, steering)
    assert misalignment < 1e-14
    np.testing.assert_allclose(back, twist / np.linalg.norm(twist), atol=1e-12)
    np.testing.assert_allclose(
        rover_geometry.instantaneous_centre(back), rover_geometry.instantaneous_centre(twist), rtol=1e-9, atol=1e-12
    )


def test_the_bicycle_moves_as_the_four_wheels_do(rover):
    steering = kinematics.steering_of_twist(rover.axles, TWISTS[3])
    twist, _ = rover_geometry.twist_of_steering(rover.axles, steering)
    np.testing.assert_allclose(twist, TWISTS[3] / np.linalg.norm(TWISTS[3]), atol=1e-12)


def test_wheels_that_do_not_meet_are_misaligned(rover):
    _, misalignment = rover_geometry.twist_of_steering(rover.wheel_positions, np.radians([20, -20, -20, 20]))
    assert misalignment > 0.01


def test_collinear_axles_do_not_determine_the_motion(rover):
    with pytest.raises(InputError, match="do not determine the motion"):
        rover_geometry.twist_of_steering(rover.axles, [np.pi / 2, np.pi / 2])


def test_twist_about_a_centre_turns_about_it_and_moves_forward():
    centres = rng.normal(size=(100, 2)) * 2
    twist = rover_geometry.twist_about(centres)
    np.testing.assert_allclose(rover_geometry.instantaneous_centre(twist), centres, atol=1e-12)
    np.testing.assert_allclose(np.hypot(twist[:, 0], twist[:, 1]), 1.0)
    assert (twist[:, 0] > 0).all()


def test_centre_between_poses_keeps_its_place_in_both():
    start, end = np.array([0.3, -0.2, 0.4]), np.array([1.1, 0.5, 1.6])
    centre, turn = rover_geometry.centre_between(start, end)
    assert turn == pytest.approx(1.2)
    np.testing.assert_allclose(centre + rotation(turn) @ (start[:2] - centre), end[:2])


def test_moving_about_the_centre_between_two_poses_arrives():
    start = np.zeros(3)
    end = np.array([0.5, 0.1, 0.6])
    centre, turn = rover_geometry.centre_between(start, end)
    twist = rover_geometry.twist_about(centre)
    np.testing.assert_allclose(rover_geometry.moved_by(start, twist, turn / twist[2]), end, atol=1e-14)


def test_moving_is_exact_whatever_the_step():
    twist = TWISTS[7]
    whole = rover_geometry.moved_by(np.zeros(3), twist, 1.0)
    parts = np.zeros(3)
    for _ in range(16):
        parts = rover_geometry.moved_by(parts, twist, 1 / 16)
    np.testing.assert_allclose(parts, whole, atol=1e-13)


def test_moving_straight_is_the_limit_of_turning():
    straight = rover_geometry.moved_by(np.zeros(3), [1.0, 0.2, 0.0], 2.0)
    np.testing.assert_allclose(straight, [2.0, 0.4, 0.0])
    np.testing.assert_allclose(rover_geometry.moved_by(np.zeros(3), [1.0, 0.2, 1e-12], 2.0), straight, atol=1e-11)


def test_moving_commutes_with_a_change_of_frame():
    frame = np.array([3.0, -1.0, 2.2])
    pose, twist = np.array([0.4, 0.1, -0.7]), TWISTS[9]
    moved = rover_geometry.moved_by(compose(frame, pose), twist, 0.5)
    expected = compose(frame, rover_geometry.moved_by(pose, twist, 0.5))
    np.testing.assert_allclose(moved[:2], expected[:2], atol=1e-14)
    assert wrapped(moved[2] - expected[2]) == pytest.approx(0, abs=1e-14)


@pytest.mark.parametrize(
    ("outward", "inward", "wheelbase", "radius"),
    [(0.0, 1.6, 0.6, 0.1), (1.6, 1.6, 0.6, 0.1), (0.5, 1.6, 0.0, 0.1), (0.5, 1.6, 0.6, 0.0)],
)
def test_impossible_rovers_are_refused(outward, inward, wheelbase, radius):
    with pytest.raises(InputError):
        kinematics.symmetric_rover(wheelbase, 0.5, radius, outward=outward, inward=inward)
