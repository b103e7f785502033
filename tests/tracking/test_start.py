"""What can stand in for clicks: tags, and bodies proposed from motion."""

import numpy as np
import pytest

from marker_pictures import picture_with
from studies.worlds.scenes import CeilingCamera, ceiling, drive, small_camera, standard_scene
from towval.model import Body
from towval.model.errors import InputError
from towval.model.geometry import inside_polygon, transform
from towval.optics.projection import project
from towval.tracking.markers import Tag, clicks_from_tags
from towval.tracking.proposals import propose_bodies

TARGET = np.array([[-0.2, -0.15], [0.2, -0.15], [0.2, 0.15], [-0.2, 0.15]])


@pytest.mark.parametrize("dictionary", ["4X4_50", "APRILTAG_36h11"])
def test_tags_stand_in_for_clicks(dictionary):
    camera, floor = ceiling(distortion=(-0.05,))
    pose, body = np.array([0.4, -0.3, 2.0]), Body("object", 0.25, TARGET)
    tags = [
        Tag(dictionary, 3, 0.12, np.array([0.05, 0.02, 0.3])),
        Tag(dictionary, 5, 0.1, np.array([-0.11, -0.05, 0.0])),
    ]
    luma = picture_with(tags, pose, 0.25, camera, floor)
    clicks = clicks_from_tags(luma, body, tags, camera, floor)
    corners = transform(pose, TARGET)
    true = project(camera, floor, np.column_stack([corners, np.full(4, 0.25)]))
    # As good as clicks, which are 0.7 px off.
    assert np.abs(clicks - true).max() < 1.0


def test_tags_that_are_not_there_or_elsewhere_are_named():
    camera, floor = ceiling(distortion=(-0.05,))
    pose, body = np.array([0.4, -0.3, 2.0]), Body("object", 0.25, TARGET)
    tags = [Tag("4X4_50", 3, 0.12, np.array([0.05, 0.02, 0.3])), Tag("4X4_50", 5, 0.1, np.array([-0.11, -0.05, 0.0]))]
    luma = picture_with(tags, pose, 0.25, camera, floor)
    with pytest.raises(InputError, match="no tag of object is found"):
        clicks_from_tags(np.full_like(luma, 128), body, tags, camera, floor)
    moved = [tags[0], Tag("4X4_50", 5, 0.1, np.array([0.11, -0.05, 0.0]))]
    with pytest.raises(InputError, match="do not fit their places"):
        clicks_from_tags(luma, body, moved, camera, floor)
    with pytest.raises(InputError, match="dictionary is unknown"):
        clicks_from_tags(luma, body, [Tag("9X9", 1, 0.1, np.zeros(3))], camera, floor)


@pytest.mark.parametrize(("stated_m", "fits"), [(0.13, True), (0.15, False)])
def test_corners_of_a_tag_are_within_a_tenth_of_its_side(stated_m, fits):
    camera, floor = ceiling(distortion=(-0.05,))
    body = Body("object", 0.25, TARGET)
    luma = picture_with([Tag("4X4_50", 3, 0.12, np.zeros(3))], np.zeros(3), 0.25, camera, floor)
    tags = [Tag("4X4_50", 3, stated_m, np.zeros(3))]
    if fits:
        assert clicks_from_tags(luma, body, tags, camera, floor).shape == (4, 2)
    else:
        with pytest.raises(InputError, match="do not fit their places"):
            clicks_from_tags(luma, body, tags, camera, floor)


def test_bodies_are_proposed_where_something_moved():
    scene = standard_scene(21, **small_camera(), motions=(drive((-0.3, 0.4, 0.1), 0.3), drive((-0.9, -0.5, 0.2), 0.3)))
    film = CeilingCamera(scene)
    pictures = [film.picture(t) for t in np.linspace(0, 6, 7)]
    proposals, picture = propose_bodies(pictures)
    assert len(proposals) == 2
    assert picture.shape == (540, 960, 3)
    assert proposals[0].area_px > proposals[1].area_px
    for proposal, body, motion in zip(proposals, scene.bodies, scene.motions, strict=True):
        middle = np.append(motion(0.0)[:2], body.tracked_plane_height_m)[None]
        assert inside_polygon(proposal.corners_px, project(scene.camera, scene.floor, middle)).all()


def test_nothing_is_proposed_where_nothing_moves():
    scene = standard_scene(22, **small_camera(), motions=(drive((0, 0.4, 0.1), 0.0), drive((-0.9, -0.5, 0.2), 0.0)))
    film = CeilingCamera(scene)
    assert propose_bodies([film.picture(0.0) for _ in range(5)])[0] == []
    with pytest.raises(InputError, match="too few pictures"):
        propose_bodies([film.picture(0.0)])
