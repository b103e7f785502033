"""A floor that moved under the bodies, told from a camera that moved."""

import numpy as np
import pytest

from studies.worlds.scenes import ceiling, rectangle
from towval.model import Body, Track, TrackStatus
from towval.optics.moved_view import parameters_by_motion, pose_sensitivity
from towval.tracking.camera_motion import ViewMotion
from towval.tracking.moved_floor import moved_floor_findings
from towval.tracking.planar_target import PlanarTarget

CAMERA, FLOOR = ceiling((640, 480), 600.0)
BODIES = Body("rover", 0.4, rectangle(0.8, 0.5)), Body("object", 0.25, rectangle(0.5, 0.3))
TIME = np.arange(100) / 25
SIZE = len(TIME), 9
RAMP = {
    "pulled": np.clip((TIME - 2.0) / 0.3, 0, 1),
    "crept": TIME / TIME[-1],
    "copied": np.floor(TIME / 0.2) / 20,
    "shaken": np.random.default_rng(2).normal(size=len(TIME)) / 6,
    "still": 0 * TIME,
}


def seen(how: str, moved: tuple[str, ...], swing_m: float = 0.0, own_px: float = 0.0, leap_m: float = 0.0) -> list[str]:
    """Findings where the picture of the floor is displaced by 6 px, and bodies were ``moved`` by its correction.

    The object swings by ``swing_m`` on its tether. Each picture of the floor is uncertain by ``own_px``, and all bodies
    leap by ``leap_m``.
    """
    motion = np.zeros(SIZE)
    motion[:, 7] = 6.0 * RAMP[how]
    flat, own_by = np.zeros((9, 9)), np.zeros(SIZE)
    own_by[:, 7] = own_px**2
    view = ViewMotion(CAMERA, FLOOR, TIME, motion, motion, np.ones(len(TIME), bool), flat, own_by, np.eye(9))
    rng, tracks, targets = np.random.default_rng(0), {}, {}
    for body, start in zip(BODIES, (0.0, -1.0), strict=True):
        path = np.stack([start + 0.15 * TIME, 0.02 * np.sin(3 * TIME), 0.05 * TIME], axis=-1)
        by_motion = pose_sensitivity(CAMERA, FLOOR, body, path)[0] @ parameters_by_motion(CAMERA, FLOOR)
        path += 2e-4 * rng.normal(size=path.shape)
        path[:, 0] += swing_m * np.sin(12 * TIME) * (body.name == "object")
        path[TIME > 2.0, 0] += leap_m
        if body.name in moved:
            path += np.einsum("nap,np->na", by_motion, motion)
        n, own = len(TIME), np.tile(1e-8 * np.eye(3), (len(TIME), 1, 1))
        status = np.full(n, TrackStatus.TRACKED)
        tracks[body.name] = Track(body.name, TIME, path, own, status, np.ones(n), np.ones(n), 1e-6 * np.eye(3))
        targets[body.name] = PlanarTarget(body, CAMERA, FLOOR)
    return [one.code for one in moved_floor_findings(tracks, targets, view)]


@pytest.mark.parametrize(
    ("how", "moved", "found"),
    [
        ("pulled", ("rover", "object"), ["floor_moved"]),
        ("pulled", (), []),
        ("pulled", ("object",), []),
        ("crept", ("rover", "object"), []),
        ("still", (), []),
    ],
)
def test_a_floor_that_is_pulled_under_the_bodies_is_no_camera_that_moved(how, moved, found):
    """A mat slipped by 30 mm: the camera was said to move, poses were off by that, and a right model disagreed."""
    assert seen(how, moved) == found


@pytest.mark.parametrize("swing_m", [-0.02, 0.02])
def test_an_object_that_swings_on_its_tether_does_not_tell_but_the_rover_does(swing_m):
    """Its own jerks are as large as the floor's: they may look like them, or hide them."""
    assert seen("pulled", ("rover", "object"), swing_m) == ["floor_moved"]
    assert seen("pulled", (), swing_m) == []


@pytest.mark.parametrize(("own_px", "found"), [(0.02, ["floor_moved"]), (0.2, [])])
def test_a_floor_that_a_codec_copies_for_some_pictures_has_not_moved(own_px, found):
    """The camera crept, and the floor in the pictures went after it in steps of 0.3 px, which are its noise."""
    assert seen("copied", ("rover", "object"), own_px=own_px) == found


@pytest.mark.parametrize("leap_m", [-0.4, 0.2, 0.4])
def test_bodies_that_leap_while_the_camera_shakes_do_not_tell_of_a_floor_that_moved(leap_m):
    """A part of the picture had stood still: the leap out of it looks like a jerk of the floor, or like none."""
    assert seen("shaken", (), leap_m=leap_m) == []
