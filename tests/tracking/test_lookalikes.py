from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.scenes import CeilingCamera, drive, small_camera, standard_scene
from towval.model.geometry import transform, wrapped
from towval.tracking.lookalikes import Lookalikes

PLACES = (drive((-0.5, 0.3, 0.2), 0.0), drive((-0.8, -0.5, 0.4), 0.0), drive((0.7, -0.4, 1.9), 0.0))


def filmed(texture_of_other):
    """Rover, object, and another body of the object's size, with its texture or one of its own."""
    scene = standard_scene(51, **small_camera())
    other = replace(scene.bodies[1], name="other")
    scene = replace(
        scene, bodies=(*scene.bodies, other), motions=PLACES, texture_of=(0, 1, texture_of_other), brightness=(150, 160)
    )
    return scene, CeilingCamera(scene).picture(0.0)


@pytest.mark.parametrize(("texture", "count"), [(1, 1), (2, 0)])
def test_a_twin_is_a_rival_and_a_stranger_is_none(texture, count):
    scene, luma = filmed(texture)
    lookalikes = Lookalikes(scene.target(1), luma, PLACES[1](0.0))
    rivals = lookalikes.rivals(lookalikes.candidates(luma), PLACES[1](0.0))
    assert len(rivals) == count
    for rival in rivals:
        assert np.linalg.norm(rival[:2] - PLACES[2](0.0)[:2]) < 0.03
        assert abs(wrapped(rival[2] - PLACES[2](0.0)[2])) < np.deg2rad(8)


def test_a_top_that_looks_the_same_turned_half_round_is_its_own_rival():
    scene, luma = filmed(2)
    pose = PLACES[1](0.0)
    # The lower half of the top is painted over with the upper one, turned by 180°.
    own = np.stack(np.meshgrid(np.linspace(-0.25, 0.25, 400), np.linspace(-0.175, 0.175, 300)), axis=-1)
    target = scene.target(1)
    grey = np.array(luma)
    here = np.round(target.picture_of(transform(pose, own))).astype(int)
    turned = np.round(target.picture_of(transform(pose, -own))).astype(int)
    lower = own[..., 1] < 0
    grey[here[lower][:, 1], here[lower][:, 0]] = luma[turned[lower][:, 1], turned[lower][:, 0]]
    lookalikes = Lookalikes(target, grey, pose)
    rivals = lookalikes.rivals(lookalikes.candidates(grey), pose)
    assert len(rivals) == 1
    assert abs(wrapped(rivals[0][2] - pose[2] - np.pi)) < np.deg2rad(8)


def test_a_place_where_the_body_is_not_is_no_candidate():
    scene, luma = filmed(2)
    lookalikes = Lookalikes(scene.target(1), luma, PLACES[1](0.0))
    best = lookalikes.candidates(luma)[0]
    assert np.linalg.norm(best.pose[:2] - PLACES[1](0.0)[:2]) < 0.03
    assert best.correlation > 0.8
    bare = np.full_like(luma, 120)
    assert lookalikes.rivals(lookalikes.candidates(bare), PLACES[1](0.0)) is None
