"""Pictures of starts: that of the page, which a pinhole camera sees like the filming one, and the drawn one."""

import cv2
import numpy as np
import pytest

from report_scenes import small_calibration
from towval.model import Body, Camera, FrictionSpecification, Load, Patch, Tether, TowingScene
from towval.optics.projection import project
from towval.report.preview import draw_start
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


def test_the_tether_is_drawn_from_its_hinge_to_its_anchor_at_their_heights():
    """Beside the middle of the picture its height shifts an end by several pixels."""
    calibration = small_calibration()
    corners = [[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]]
    scene = TowingScene(
        Patch(corners), 4.0, Load(0.0, (0.0, 0.0), (0.0, 0.0, 0.0)), (0.2, 0.0), (-0.2, 0.0), Tether(0.5, 800.0),
        FrictionSpecification(0.4, 0.35, 0.005, 0.07), hinge_height=0.4, anchor_height=0.05,
    )  # fmt: skip
    poses = {"rover": (0.6, 0.8, 0.0), "object": (-0.3, 0.8, 0.0)}
    bodies = {name: (Body(name, 0.3, np.array(corners)), np.array(pose)) for name, pose in poses.items()}
    width, height = calibration.camera.resolution_px
    picture = draw_start(np.zeros((height, width), np.uint8), calibration, scene, bodies)
    ends = np.array([[0.4, 0.8, 0.4], [-0.1, 0.8, 0.05]])
    blue, green, red = np.moveaxis(picture.astype(int), -1, 0)
    drawn = np.argwhere((red > 2 * blue) & (green > 2 * blue))[:, ::-1]  # Yellow, as nothing else is.
    for pixel in project(calibration.camera, calibration.floor, ends):
        assert np.linalg.norm(drawn - pixel, axis=1).min() < 1.5
