"""The floor frame and the first guess of it."""

import cv2
import numpy as np
import pytest

from studies.worlds.boards import board_corners, calibration_set
from towval.calibration.blocks import Estimate
from towval.calibration.corners import BoardObservation
from towval.calibration.floor import in_floor_axes, place_of_pose, place_on_floor
from towval.calibration.observations import first_guess
from towval.model import FloorReference
from towval.model.errors import InputError
from towval.optics.plane_uncertainty import shared_parameters


def seen_from_above(turn: float) -> BoardObservation:
    """The board of 9 × 6 corners seen straight from above, 500 px a metre, turned in the picture."""
    corners = board_corners()
    c, s = np.cos(turn), np.sin(turn)
    pixels = 500 * (corners @ np.array([[c, s], [-s, c]])) * [1, -1] + [600, 400]
    return BoardObservation("floor", pixels, corners)


@pytest.mark.parametrize("turn", [0.0, 0.9, 2.5, -1.8])
@pytest.mark.parametrize(("origin", "end"), [(0, 8), (8, 53), (53, 45), (45, 0)])
def test_origin_and_axis_are_where_the_pixels_point(turn, origin, end):
    observation = seen_from_above(turn)
    near = np.array([3.0, -4.0])
    reference = FloorReference(observation.corners_px[origin] + near, observation.corners_px[end] - near)
    on_floor = in_floor_axes(observation, reference).board_m
    np.testing.assert_allclose(on_floor[origin], 0, atol=1e-12)
    assert on_floor[end][0] > 0.19
    assert on_floor[end][1] == pytest.approx(0, abs=1e-12)
    # z is up: x to y runs counter-clockwise for the camera above, clockwise in pixels (v runs down).
    x, y = on_floor.T
    u, v = (observation.corners_px - observation.corners_px[origin]).T
    assert (
        np.sign(np.linalg.det(np.linalg.lstsq(np.column_stack([x, y]), np.column_stack([u, v]), rcond=None)[0])) == -1
    )


def test_a_pixel_off_the_board_is_named_with_the_nearest_corner():
    observation = seen_from_above(0.0)
    reference = FloorReference(observation.corners_px[0] + [-60, 60], observation.corners_px[8])
    with pytest.raises(InputError, match=r"floor.origin_corner_px is not at a corner[\s\S]*nearest"):
        in_floor_axes(observation, reference)


def test_one_corner_cannot_be_origin_and_axis():
    observation = seen_from_above(0.0)
    with pytest.raises(InputError, match="x_axis_end_corner_px is the corner of"):
        in_floor_axes(observation, FloorReference(observation.corners_px[0], observation.corners_px[0] + 1))


def test_the_axis_runs_along_a_row_not_across_the_board():
    observation = seen_from_above(0.9)
    with pytest.raises(InputError, match="neither in the row nor in the column"):
        in_floor_axes(observation, FloorReference(observation.corners_px[0], observation.corners_px[53]))


def test_half_a_floor_frame_is_refused():
    with pytest.raises(InputError, match="the floor frame is not fixed"):
        FloorReference(origin_corner_px=np.zeros(2))


@pytest.mark.parametrize("floor", ["marks", "boards"])
def test_first_guess_is_near_enough_to_start_from(floor):
    scene = calibration_set(31, floor=floor, noise_px=0.0)
    guess = first_guess(scene.seen)
    apart = guess.T_camera_floor @ np.linalg.inv(scene.floor.T_camera_floor)
    # Its camera has no lens yet, which bends the boards by some degrees.
    assert np.degrees(np.arccos((np.trace(apart[:3, :3]) - 1) / 2)) < 8
    assert len(guess.places) == len(scene.seen.blocks)


def test_a_board_whose_pose_is_known_is_where_it_lies():
    scene = calibration_set(31)
    estimate = Estimate(shared_parameters(scene.camera, scene.floor), ())
    turned = np.eye(4)
    turned[:2, :2], turned[:2, 3] = [[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]], [0.4, -0.9]
    T = scene.floor.T_camera_floor @ turned
    pose = np.concatenate([cv2.Rodrigues(T[:3, :3])[0].ravel(), T[:3, 3]])
    np.testing.assert_allclose(place_of_pose(pose, estimate), [0.4, -0.9, 0.7], atol=1e-9)


def test_a_board_is_found_where_it_lies():
    scene = calibration_set(32, floor="boards", noise_px=0.0)
    exact = Estimate(shared_parameters(scene.camera, scene.floor), ())
    first = scene.seen.floor_boards[0]
    place = place_on_floor(first.board_m, first.corners_px, exact, 0.003)
    np.testing.assert_allclose(place, 0, atol=1e-6)
