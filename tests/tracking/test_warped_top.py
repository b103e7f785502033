"""Tops of which a picture displaces parts against each other."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from painted import POSE, picture, target
from test_track import challenges, follow, small

from towval.tracking.template import make_template
from towval.tracking.warped_top import CONSTANTS, WarpedTop

OWN = target()
FIRST = picture(OWN, noise=2.0, seed=1)
PIXEL_M = OWN.metres_per_pixel(POSE)


def bent(luma, magnified):
    """A picture of which a part, in the middle of the body, is magnified."""
    at = OWN.pixels(np.zeros((1, 2)), POSE)[0]
    v, u = np.indices(luma.shape, dtype=np.float32)
    inwards = 1 - magnified * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * 25.0**2))
    places = (at[0] + (u - at[0]) * inwards).astype(np.float32), (at[1] + (v - at[1]) * inwards).astype(np.float32)
    return cv2.remap(luma, *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def looked_at(pictures):
    warp = WarpedTop(OWN, make_template(FIRST, OWN, POSE, 400))
    for i, luma in enumerate(pictures):
        warp.look(float(i), luma, POSE)
    return warp


def again(seed):
    return picture(OWN, noise=2.0, seed=seed)


TIME_S = np.arange(6.0)


@pytest.mark.parametrize("light", [1.0, 0.7])
def test_a_top_that_looks_as_it_did_is_not_warped(light):
    warp = looked_at([np.rint(light * again(i)).astype(np.uint8) for i in range(2, 8)])
    assert np.array(warp.rows).reshape(-1, 2)[:, 1].max() < CONSTANTS.scattered_px / 2
    assert not warp.scattered_px(TIME_S).any()
    assert not warp.findings(TIME_S)
    assert not any(part.any() for part in warp.widened(TIME_S))


def test_a_top_behind_a_drop_is_warped_and_its_poses_and_registration_are_as_uncertain():
    warp = looked_at([*(again(i) for i in range(2, 5)), *(bent(again(i), 0.08) for i in range(5, 8))])
    scattered_px = warp.scattered_px(TIME_S)
    assert not scattered_px[:2].any()
    assert 0.3 < scattered_px[4:].min() <= scattered_px.max() < 1.5
    assert [one.code for one in warp.findings(TIME_S)] == ["picture_warped"]
    assert "the top of box" in warp.findings(TIME_S)[0].text
    poses, start = warp.widened(TIME_S)
    assert np.sqrt(poses[:, 0, 0]) == pytest.approx(scattered_px * PIXEL_M)
    assert np.sqrt(poses[:, 2, 2]) == pytest.approx(scattered_px * PIXEL_M / OWN.body.reach_m)
    assert start == pytest.approx(poses.mean(axis=0))


@pytest.mark.parametrize(("scattered_px", "said"), [(0.25, False), (0.35, True)])
def test_a_top_is_warped_from_a_third_of_a_pixel_on(scattered_px, said):
    warp = looked_at([])
    for i in range(5):
        warp.rows.extend((float(i), scattered_px))
    assert bool(warp.findings(TIME_S)) == said


def test_what_hides_a_top_in_a_look_or_two_does_not_warp_it():
    warp = looked_at([])
    for i, scattered_px in enumerate((0.0, 0.9, 0.0, 0.0, 0.9, 0.0)):
        warp.rows.extend((float(i), scattered_px))
    assert not warp.scattered_px(TIME_S).any()


def test_a_top_of_which_too_little_was_seen_says_nothing():
    warp = WarpedTop(OWN, None)
    warp.look(0.0, FIRST, POSE)
    assert not warp.scattered_px(TIME_S).any()
    assert not any(part.any() for part in warp.widened(TIME_S))


def test_tracks_state_what_their_tops_are_warped_by(monkeypatch):
    challenge = small(challenges.metre(30, 1.2))
    challenge = replace(challenge, times=challenge.times[:12])
    sound = follow(challenge, 30)
    monkeypatch.setattr(WarpedTop, "scattered_px", lambda _, time_s: np.full(len(time_s), 0.5))
    for name, (warped, _) in follow(challenge, 30).items():
        before, _ = sound[name]
        assert [{found.code for found in one.findings} & {"picture_warped"} for one in (before, warped)] == [
            set(), {"picture_warped"},
        ]  # fmt: skip
        added = warped.start_covariance - before.start_covariance
        assert added[0, 0] > 0
        assert warped.covariance - before.covariance == pytest.approx(np.tile(added, (12, 1, 1)))
