from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.scenes import ceiling, rectangle
from towval.model import Body
from towval.model.geometry import transform
from towval.optics.projection import project
from towval.tracking.interpolation import spline_value
from towval.tracking.planar_target import PlanarTarget


def target(height, camera, floor):
    return PlanarTarget(Body("rover", height, rectangle(0.6, 0.4)), camera, floor)


def test_a_linear_ramp_is_read_exactly():
    v, u = np.mgrid[0:40, 0:60]
    ramp = (20 + 2 * u + 3 * v).astype(np.uint8)
    for at_u, at_v in ((10.0, 12.0), (10.25, 12.7), (33.9, 5.5)):
        assert spline_value(ramp, at_u, at_v) == pytest.approx(20 + 2 * at_u + 3 * at_v, abs=1e-12)


@pytest.mark.parametrize(("u", "v"), [(0.5, 10), (10, 0.2), (58.1, 10), (10, 38.5), (np.nan, 10), (1e300, 10)])
def test_a_place_without_neighbours_is_outside(u, v):
    assert spline_value(np.full((40, 60), 7, np.uint8), u, v) == -1.0


def test_points_of_a_plane_are_projected_where_the_camera_model_puts_them():
    camera, floor = ceiling(distortion=(-0.2, 0.05, 1e-3, -2e-3, -0.01, 0.01, -0.002, 0.001))
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (50, 2))
    pose = np.array([0.4, -0.7, 2.1])
    on_floor = np.column_stack([transform(pose, points), np.full(50, 0.42)])
    assert np.allclose(target(0.42, camera, floor).pixels(points, pose), project(camera, floor, on_floor), atol=1e-9)


def test_points_of_a_plane_are_projected_where_a_fisheye_puts_them():
    camera, floor = ceiling(distortion=(-0.02, 0.005, 0, 0, -0.01))
    camera = replace(camera, lens_model="fisheye k1 k2 k3")
    points = np.random.default_rng(0).uniform(-3, 3, (50, 2))
    pose = np.array([0.4, -0.7, 2.1])
    on_floor = np.column_stack([transform(pose, points), np.full(50, 0.42)])
    assert np.allclose(target(0.42, camera, floor).pixels(points, pose), project(camera, floor, on_floor), atol=1e-9)


def test_a_point_behind_a_fisheye_is_outside_the_picture():
    camera, floor = ceiling()
    there = target(9.0, replace(camera, lens_model="fisheye"), floor)
    assert np.isnan(there.grey_values(np.zeros((1080, 1920), np.uint8), np.zeros((1, 2)), np.zeros(3))).all()


def test_a_point_behind_the_camera_is_outside_the_picture():
    camera, floor = ceiling()
    luma = np.zeros((1080, 1920), np.uint8)
    values = target(9.0, camera, floor).grey_values(luma, np.zeros((1, 2)), np.zeros(3))
    assert np.isnan(values).all()


def test_a_pixel_is_as_wide_as_height_over_focal_length():
    camera, floor = ceiling(tilt_rad=0.0, distortion=())
    width = target(1.0, camera, floor).metres_per_pixel(np.array([0.05, -0.03, 0.3]))
    assert width == pytest.approx(3.0 / 1560 / np.sqrt(1.001), rel=1e-6)
