"""Uncertainty of positions against finite differences and simple cases."""

import cv2
import numpy as np
import pytest

from studies.worlds.boards import ceiling_camera
from towval.model import Body, Calibration, Camera, Floor
from towval.optics.moved_view import pose_sensitivity
from towval.optics.plane_uncertainty import (
    camera_position_covariance,
    pixel_grid,
    position_covariance,
    position_sensitivity,
    shared_parameters,
    uncertainty_map,
)
from towval.optics.projection import to_plane

PIXELS = np.array([[100.0, 80.0], [960.0, 540.0], [1800.0, 900.0]])


def from_parameters(shared: np.ndarray) -> tuple[Camera, Floor]:
    matrix = np.array([[shared[0], 0, shared[2]], [0, shared[1], shared[3]], [0, 0, 1]])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = cv2.Rodrigues(shared[12:15])[0], shared[15:]
    return Camera((1920, 1080), matrix, shared[4:12], "rational"), Floor(T)


@pytest.fixture(scope="module")
def seen() -> tuple[Camera, Floor]:
    return ceiling_camera(np.random.default_rng(41))


def calibration(seen: tuple[Camera, Floor], covariance: np.ndarray) -> Calibration:
    return Calibration(*seen, covariance, 0.1)


@pytest.mark.parametrize("height", [0.0, 0.35])
def test_sensitivity_is_the_derivative_of_the_position(seen, height):
    by_parameters, by_height = position_sensitivity(*seen, PIXELS, height)
    shared = shared_parameters(*seen)
    for k in range(18):
        step = np.zeros(18)
        step[k] = 1e-6 * max(1.0, abs(shared[k]))
        ahead, behind = (to_plane(*from_parameters(shared + s), PIXELS, height) for s in (step, -step))
        np.testing.assert_allclose(by_parameters[:, :, k], (ahead - behind) / (2 * step[k]), rtol=1e-4, atol=1e-7)
    ahead, behind = (to_plane(*seen, PIXELS, height + s) for s in (1e-6, -1e-6))
    np.testing.assert_allclose(by_height, (ahead - behind) / 2e-6, rtol=1e-5, atol=1e-8)


def test_a_target_moves_towards_the_nadir_as_it_rises(seen):
    _, by_height = position_sensitivity(*seen, PIXELS, 0.3)
    position = to_plane(*seen, PIXELS, 0.3)
    nadir, camera_height = seen[1].camera_position_m[:2], seen[1].camera_position_m[2]
    np.testing.assert_allclose(by_height, -(position - nadir) / (camera_height - 0.3), rtol=1e-9)


def test_only_the_height_uncertain(seen):
    covariance = position_covariance(calibration(seen, np.zeros((18, 18))), PIXELS, 0.3, height_std_m=0.002)
    _, by_height = position_sensitivity(*seen, PIXELS, 0.3)
    np.testing.assert_allclose(
        np.sqrt(np.trace(covariance, axis1=1, axis2=2)), 0.002 * np.linalg.norm(by_height, axis=1)
    )


def test_map_covers_the_picture_and_marks_the_sky(seen):
    covariance = np.zeros((18, 18))
    covariance[15, 15] = 1e-6
    found = uncertainty_map(calibration(seen, covariance), 0.0, columns=16)
    assert found.std_m.shape == (9, 16)
    np.testing.assert_allclose(found.pixels[-1, -1], [1919, 1079])
    assert np.isfinite(found.std_m).all()
    level = Floor(np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 3], [0, 0, 0, 1]]))
    horizon = uncertainty_map(calibration((seen[0], level), covariance), -1.0, columns=16)
    assert np.isnan(horizon.std_m[0]).all()
    assert np.isfinite(horizon.std_m[-1]).all()


def test_camera_place_follows_the_shift_and_the_rotation(seen):
    rng = np.random.default_rng(0)
    root = rng.normal(size=(18, 18)) * 1e-4
    covariance = root @ root.T
    shared, jacobian = shared_parameters(*seen), np.zeros((3, 18))
    for k in range(12, 18):
        step = np.zeros(18)
        step[k] = 1e-6
        ahead, behind = (from_parameters(shared + s)[1].camera_position_m for s in (step, -step))
        jacobian[:, k] = (ahead - behind) / 2e-6
    found = camera_position_covariance(calibration(seen, covariance))
    np.testing.assert_allclose(found, jacobian @ covariance @ jacobian.T, rtol=1e-5, atol=1e-14)


def test_grid_reaches_the_corners():
    grid = pixel_grid((640, 480), 9)
    np.testing.assert_array_equal(grid[0, 0], [0, 0])
    np.testing.assert_array_equal(grid[-1, -1], [639, 479])


def test_no_poses_have_no_sensitivities(seen):
    """numpy cannot tell a size from an array without elements."""
    body = Body("rover", 0.4, np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
    assert [part.shape for part in pose_sensitivity(*seen, body, np.zeros((0, 3)))] == [(0, 3, 18), (0, 3)]
