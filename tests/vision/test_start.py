"""What can stand in for clicks: tags, and bodies proposed from motion."""

import cv2
import numpy as np
import pytest

from towval.errors import InputError
from towval.geometry import inside_polygon, transform
from towval.synthetic.scenes import CeilingCamera, ceiling, drive, small_camera, standard_scene
from towval.types import Body
from towval.vision.camera import project
from towval.vision.propose import propose_bodies
from towval.vision.tags import Tag, clicks_from_tags

TOP = np.array([[-0.2, -0.15], [0.2, -0.15], [0.2, 0.15], [-0.2, 0.15]])


def picture_with(tags, pose, height, camera, floor):
    """A grey picture with tags drawn on the top of a body."""
    width, rows = camera.resolution_px
    image = np.full((rows, width), 150, np.uint8)
    for tag in tags:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{tag.dictionary}"))
        marker = np.full((400, 400), 255, np.uint8)
        marker[50:350, 50:350] = cv2.aruco.generateImageMarker(dictionary, tag.number, 300)
        corners = transform(pose, tag.corners_m())
        seen = project(camera, floor, np.column_stack([corners, np.full(4, height)])).astype(np.float32)
        # The black square runs from the outer border of pixel 50 to that of pixel 349.
        black = np.array([[49.5, 49.5], [349.5, 49.5], [349.5, 349.5], [49.5, 349.5]], np.float32)
        warp = cv2.getPerspectiveTransform(black, seen)
        drawn = cv2.warpPerspective(marker, warp, (width, rows), flags=cv2.INTER_AREA)
        mask = cv2.warpPerspective(np.full_like(marker, 255), warp, (width, rows)) > 127
        image[mask] = drawn[mask]
    return cv2.GaussianBlur(image, (0, 0), 0.6)


@pytest.mark.parametrize("dictionary", ["4X4_50", "APRILTAG_36h11"])
def test_tags_stand_in_for_clicks(dictionary):
    camera, floor = ceiling(distortion=(-0.05,))
    pose, body = np.array([0.4, -0.3, 2.0]), Body("object", 0.25, TOP)
    tags = [
        Tag(dictionary, 3, 0.12, np.array([0.05, 0.02, 0.3])),
        Tag(dictionary, 5, 0.1, np.array([-0.11, -0.05, 0.0])),
    ]
    luma = picture_with(tags, pose, 0.25, camera, floor)
    clicks = clicks_from_tags(luma, body, tags, camera, floor)
    corners = transform(pose, TOP)
    true = project(camera, floor, np.column_stack([corners, np.full(4, 0.25)]))
    # As good as clicks, which are 0.7 px off.
    assert np.abs(clicks - true).max() < 1.0


def test_tags_that_are_not_there_or_elsewhere_are_named():
    camera, floor = ceiling(distortion=(-0.05,))
    pose, body = np.array([0.4, -0.3, 2.0]), Body("object", 0.25, TOP)
    tags = [Tag("4X4_50", 3, 0.12, np.array([0.05, 0.02, 0.3])), Tag("4X4_50", 5, 0.1, np.array([-0.11, -0.05, 0.0]))]
    luma = picture_with(tags, pose, 0.25, camera, floor)
    with pytest.raises(InputError, match="no tag of object is seen"):
        clicks_from_tags(np.full_like(luma, 128), body, tags, camera, floor)
    moved = [tags[0], Tag("4X4_50", 5, 0.1, np.array([0.11, -0.05, 0.0]))]
    with pytest.raises(InputError, match="do not fit their places"):
        clicks_from_tags(luma, body, moved, camera, floor)
    with pytest.raises(InputError, match="dictionary is unknown"):
        clicks_from_tags(luma, body, [Tag("9X9", 1, 0.1, np.zeros(3))], camera, floor)


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
