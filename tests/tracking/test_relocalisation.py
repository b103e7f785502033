from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.scenes import CeilingCamera, ceiling, drive, small_camera, standard_scene
from towval.model import Body
from towval.model.geometry import transform, wrapped
from towval.optics.view_motion import moved_view
from towval.tracking import relocalisation
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.relocalisation import Lookalikes, Relocaliser

PLACES = (drive((-0.5, 0.3, 0.2), 0.0), drive((-0.8, -0.5, 0.4), 0.0), drive((0.7, -0.4, 1.9), 0.0))


def test_a_body_is_found_wherever_it_went():
    scene = standard_scene(31, **small_camera())
    film, motion = CeilingCamera(scene), scene.motions[0]
    finder = Relocaliser(scene.target(0), film.picture(0.0), motion(0.0))
    for time_s in (2.0, 8.0):
        found = finder.find(film.picture(time_s))
        # Good enough to start an alignment from: two pixels of 4.7 mm, and of 1 % of the body's half length in heading.
        assert np.linalg.norm(found[:2] - motion(time_s)[:2]) < 9e-3
        assert np.sin(found[2] - motion(time_s)[2]) == pytest.approx(0.0, abs=0.02)


def test_a_body_is_found_after_the_camera_was_moved():
    """By 40 pixels, from one search to the next."""
    scene = standard_scene(31, **small_camera())
    film, motion, target = CeilingCamera(scene), scene.motions[0], scene.target(0)
    finder = Relocaliser(target, film.picture(0.0), motion(0.0))
    assert finder.find(film.picture(2.0)) is not None
    target.camera, target.floor = moved_view(target.camera, target.floor, np.append(np.zeros(7), [40.0, 0.0]))
    found = finder.find(np.roll(film.picture(8.0), 40, axis=1))
    assert np.linalg.norm(found[:2] - motion(8.0)[:2]) < 9e-3


def test_tiles_hold_the_features_of_the_whole_picture(monkeypatch):
    """Of those that are smaller than a body; and none of them twice, where tiles overlap."""
    scene = standard_scene(31, **small_camera())
    luma = CeilingCamera(scene).picture(0.0)
    finder = Relocaliser(scene.target(0), luma, scene.motions[0](0.0))
    pixels = finder._rectified[1]
    whole = []
    for side in (10 * max(pixels.shape), 150):
        monkeypatch.setattr(relocalisation, "CONSTANTS", replace(relocalisation.CONSTANTS, tile_cells=side))
        places, descriptors = finder._features(luma, pixels)
        assert len(places) == len(descriptors) <= relocalisation.CONSTANTS.features
        whole.append({tuple(place) for place in np.round(places).astype(int)})
    assert len(whole[0] & whole[1]) > 0.95 * len(whole[0])
    assert len(whole[1]) < 1.05 * len(whole[0])


def test_where_it_is_not_it_is_not_found():
    scene = standard_scene(31, **small_camera(), hidden=lambda t: ("rover",) if t > 1 else ())
    film = CeilingCamera(scene)
    finder = Relocaliser(scene.target(0), film.picture(0.0), scene.motions[0](0.0))
    assert finder.find(film.picture(2.0)) is None


def test_a_plain_target_has_nothing_to_be_found_by():
    camera, floor = ceiling()
    flat = np.full((1080, 1920), 128, np.uint8)
    body = Body("rover", 0.3, np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]))
    assert Relocaliser(PlanarTarget(body, camera, floor), flat, np.zeros(3)).find(flat) is None


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


def test_a_target_that_looks_the_same_turned_half_round_is_its_own_rival():
    scene, luma = filmed(2)
    pose = PLACES[1](0.0)
    # The lower half of the target is painted over with the upper one, turned by 180°.
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
