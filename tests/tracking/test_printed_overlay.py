"""What stands still over a body in the first picture is left out of its template."""

import cv2
import numpy as np
import pytest
from painted import POSE
from painted import target as painted_target

from studies.worlds.scenes import CeilingCamera, drive, small_camera, standard_scene
from towval.model.geometry import inside_polygon, inverse_transform
from towval.tracking.overlay import standing_still

MOTIONS = (drive((-0.3, 0.4, 0.1), 0.3), drive((-0.9, -0.5, 0.2), 0.3))


@pytest.fixture(scope="module")
def scene():
    return standard_scene(31, **small_camera(), motions=MOTIONS)


def with_banner(luma, at, digits):
    marked = luma.copy()
    u, v = np.round(at).astype(int)
    cv2.rectangle(marked, (u - 20, v - 8), (u + 20, v + 8), 30, -1)
    cv2.putText(marked, digits, (u - 18, v + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.4, 250, 1)
    return marked


@pytest.mark.parametrize("index", [0, 1])
def test_a_banner_is_found_and_what_moves_is_not(scene, index):
    film, target, pose = CeilingCamera(scene), scene.target(index), MOTIONS[index](0.0)
    first, last = film.picture(0.0), film.picture(4.0)
    assert standing_still(first, last, target, pose) == []
    middle = target.pixels(np.zeros((1, 2)), pose)[0]
    (found,) = standing_still(with_banner(first, middle, "12:31"), with_banner(last, middle, "12:35"), target, pose)
    signs = np.array([[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]])
    banner = inverse_transform(pose, target.floor_xy(middle + signs * [20, 8]))
    assert inside_polygon(found, banner).all()
    assert not inside_polygon(found, 0.9 * target.body.top_corners_m).any()


def test_a_body_that_stays_is_no_overlay(scene):
    film, target = CeilingCamera(scene), scene.target(1)
    # It drives after ten seconds only; the noise is another in each picture.
    first, again = film.picture(0.0), film.picture(0.0)
    assert standing_still(first, again, target, MOTIONS[1](0.0)) == []


@pytest.mark.parametrize(("apart_px", "outlines"), [(12, 1), (24, 2)])
def test_letters_within_fifteen_pixels_are_one_banner(apart_px, outlines):
    """Two squares with a check pattern, on a top whose own texture is another in the last picture."""
    own, rng = painted_target(), np.random.default_rng(3)
    corners = np.round(own.pixels(own.body.top_corners_m, POSE)).astype(int)
    first, last = (rng.integers(60, 180, (240, 320)).astype(np.uint8) for _ in range(2))
    v, u = corners.mean(axis=0).astype(int)[::-1]
    letter = np.kron(np.indices((7, 7)).sum(axis=0) % 2, np.full((2, 2), 255)).astype(np.uint8)
    for luma in (first, last):
        for left in (u - apart_px // 2 - 14, u + apart_px // 2):
            luma[v - 7 : v + 7, left : left + 14] = letter
    assert len(standing_still(first, last, own, POSE)) == outlines


@pytest.mark.parametrize(("changed", "told"), [(0.19, False), (0.3, True)])
def test_a_fifth_of_a_top_must_change_for_the_rest_to_stand_still(changed, told):
    own, rng = painted_target(), np.random.default_rng(3)
    first = rng.integers(60, 180, (240, 320)).astype(np.uint8)
    last, corners = first.copy(), own.pixels(own.body.top_corners_m, POSE)
    left, right = corners[:, 0].min(), corners[:, 0].max()
    part = slice(round(left), round(left + changed * (right - left)))
    last[:, part] = rng.integers(60, 180, last[:, part].shape)
    assert bool(standing_still(first, last, own, POSE)) == told
