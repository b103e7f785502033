"""The picture of the start page: a pinhole camera that sees what the filming camera sees."""

import cv2
import numpy as np
import pytest

from towval.model import Camera
from towval.report.start_page import without_distortion

SIZE = (1920, 1080)


def camera(focal_px, *distortion):
    matrix = np.array([[focal_px, 0, 950.0], [0, 1.01 * focal_px, 545.0], [0, 0, 1]])
    return Camera(SIZE, matrix, np.array([*distortion, *np.zeros(8 - len(distortion))]), "k1 k2 p1 p2")


@pytest.mark.parametrize("lens", [(0.0,), (-0.12, 0.02), (0.06,), (-0.1, 0.02, 1e-3, -2e-3)])
def test_every_pixel_of_the_camera_is_in_the_picture(lens):
    filming = camera(1500, *lens)
    shown, (width, height) = without_distortion(filming)
    pixels = np.stack(np.meshgrid(np.linspace(0, SIZE[0] - 1, 9), np.linspace(0, SIZE[1] - 1, 7)), -1).reshape(-1, 2)
    # OpenCV maps filmed pixels to those of the pinhole camera that the page has.
    there = cv2.undistortPoints(pixels[:, None], filming.matrix, filming.distortion, P=shown)[:, 0]
    assert there.min() > -0.01
    assert (there.max(axis=0) < np.array([width, height]) - 0.99).all()
    # No larger than it must be: some pixel lies at each border.
    assert there.min(axis=0).max() < 1
    assert (there.max(axis=0) > np.array([width, height]) - 2).all()


def test_without_a_lens_it_is_the_picture_itself():
    shown, size = without_distortion(camera(1500))
    assert size == SIZE
    np.testing.assert_array_equal(shown, camera(1500).matrix)


def test_a_very_wide_lens_makes_no_endless_picture():
    _, (width, height) = without_distortion(camera(800, -0.31, 0.11, 0, 0, -0.016))
    assert SIZE[0] <= width <= 1.51 * SIZE[0]
    assert SIZE[1] <= height <= 1.51 * SIZE[1]
