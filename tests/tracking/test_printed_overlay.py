"""What stands still over a body in the first picture is left out of its template."""

import cv2
import numpy as np
import pytest

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
