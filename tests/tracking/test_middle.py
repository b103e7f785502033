"""A body's frame may lie anywhere: what is found of the body is the same."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.scenes import CeilingCamera
from studies.worlds.tows import spread, towed
from towval.model import Body, Track, TrackStatus
from towval.model.geometry import compose, turned_covariance
from towval.tracking.clicks import check_clicks
from towval.tracking.middle import about_middle, registration_of, track_of
from towval.tracking.start import find_starts
from towval.tracking.track import track

SHIFTS = np.array([[0.9, 0.6], [-1.1, 0.4]])
"""Of the tops of rover and object in frames that lie beside them [m]."""


@pytest.fixture(scope="module")
def scene():
    """A tow of seed 5, its tether, and bodies and tether in frames beside the tops."""
    scene, tow = towed(5)
    beside = [
        replace(body, top_corners_m=body.top_corners_m + shift)
        for body, shift in zip(scene.bodies, SHIFTS, strict=True)
    ]
    return scene, tow, beside, replace(tow, hinge=tow.hinge + SHIFTS[0], anchor=tow.anchor + SHIFTS[1])


def by_draws(covariance, pose, shift, draws=200_000):
    """Covariance of the poses of a frame that lies ``-shift`` from the origin of another, by draws."""
    off = np.random.default_rng(3).multivariate_normal(np.zeros(3), covariance, draws)
    back = np.array([*-shift, 0.0])
    moved = compose(pose + off, back) - compose(pose, back)
    return np.cov(moved, rowvar=False)


def test_covariances_are_those_of_draws(scene):
    filmed, _, beside, _ = scene
    own = np.diag([1e-3, 2e-3, 3e-3]) ** 2
    own[0, 2] = own[2, 0] = 1e-6
    pose = np.array([0.3, -0.2, 0.7])
    track_in_middle = one_pose(filmed.bodies[0].name, pose, own)
    moved = track_of(beside[0], track_in_middle)
    expected = by_draws(own, pose, SHIFTS[0])
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(moved.covariance[1] / scale, expected / scale, atol=0.02)
    np.testing.assert_allclose(moved.pose[1], compose(pose, [*-SHIFTS[0], 0.0]))
    assert np.isnan(moved.pose[0]).all()
    assert np.isnan(moved.covariance[0]).all()
    # A registration is given in the axes of the body: turned, it adds what the moved poses' covariance holds.
    in_floor_axes = turned_covariance(registration_of(beside[0], own), pose[2])
    from_floor = track_of(beside[0], one_pose("rover", pose, turned_covariance(own, pose[2]))).covariance[1]
    np.testing.assert_allclose(in_floor_axes, from_floor, atol=1e-18)


def one_pose(name, pose, covariance):
    """A track that is lost in its first picture and seen in its second."""
    nan = np.full(3, np.nan)
    return Track(
        body=name,
        time_s=np.array([0.0, 0.1]),
        pose=np.array([nan, pose]),
        covariance=np.array([np.full((3, 3), np.nan), covariance]),
        status=np.array([TrackStatus.LOST, TrackStatus.TRACKED], dtype=np.uint8),
        inlier_fraction=np.ones(2),
        residual=np.ones(2),
        start_covariance=np.asarray(covariance),
    )


def test_a_frame_in_the_middle_stays():
    body = Body("box", 0.2, np.array([[-0.3, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.3, 0.1]]))
    assert about_middle(body) is body
    found = one_pose("box", np.zeros(3), np.eye(3))
    assert track_of(body, found) is found


def test_clicks_are_checked_alike_wherever_the_frame_lies(scene):
    filmed, tow, beside, tow_beside = scene
    pictures, clicks = spread(filmed, np.array([0.0, 4.0])), filmed.clicks(np.random.default_rng(5))
    clicks["object"] = np.roll(clicks["object"], 2, axis=0) + 4.0
    own = check_clicks(pictures, filmed.calibration, filmed.bodies, clicks, tow)
    found = check_clicks(pictures, filmed.calibration, beside, clicks, tow_beside)
    for body in beside:
        np.testing.assert_allclose(found[body.name].corners_px, own[body.name].corners_px, atol=1e-6)
        assert found[body.name].findings == own[body.name].findings
        np.testing.assert_allclose(found[body.name].spread, registration_of(body, own[body.name].spread), atol=1e-15)


def test_starts_are_found_alike_wherever_the_frame_lies(scene):
    filmed, tow, beside, tow_beside = scene
    pictures = spread(filmed, np.linspace(0.0, 4.0, 5))
    own = find_starts(pictures, filmed.calibration, filmed.bodies, tow)
    found = find_starts(pictures, filmed.calibration, beside, tow_beside)
    for body, shift in zip(beside, SHIFTS, strict=True):
        np.testing.assert_allclose(found[body.name].corners_px, own[body.name].corners_px, atol=1e-6)
        np.testing.assert_allclose(found[body.name].pose, compose(own[body.name].pose, [*-shift, 0.0]), atol=1e-9)
        assert found[body.name].doubt == own[body.name].doubt == ""


def test_tracks_are_alike_wherever_the_frame_lies(scene):
    filmed, _, beside, _ = scene
    pictures, clicks = list(CeilingCamera(filmed).frames(np.arange(30) / 25)), filmed.clicks(np.random.default_rng(5))
    own = track(iter(pictures), filmed.calibration, filmed.bodies, clicks)
    found = track(iter(pictures), filmed.calibration, beside, clicks)
    for body, shift in zip(beside, SHIFTS, strict=True):
        name = body.name
        np.testing.assert_allclose(found[name].pose, compose(own[name].pose, [*-shift, 0.0]), atol=1e-9)
        assert found[name].findings == own[name].findings
        # The heading is known as it is; the place of a frame a metre away, worse by it.
        np.testing.assert_allclose(
            found[name].total_covariance[:, 2, 2], own[name].total_covariance[:, 2, 2], rtol=1e-6
        )
        widened = np.linalg.norm(shift) ** 2 * own[name].total_covariance[:, 2, 2]
        trace = np.trace(found[name].total_covariance[:, :2, :2], axis1=1, axis2=2)
        assert (trace > 0.9 * widened).all()
