"""The plane tracker on tops whose noise looks like texture."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tracking import painted
from towval.model.geometry import compose
from towval.model.tracks import TrackStatus
from towval.tracking import plane_tracker
from towval.tracking.follow import Follower
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.pose import Measurement


@pytest.fixture
def slopes_stay(monkeypatch):
    """A function after whose call the slopes of no template are averaged."""
    never = replace(plane_tracker.CONSTANTS, noisy_share=0.0)
    return lambda: monkeypatch.setattr(plane_tracker, "CONSTANTS", never)


def followed(noise, contrast):
    """Errors (n,) [px] of the poses of a top that creeps, from starts a pixel off, and the tracker after them."""
    own, grey, rng = painted.target(), painted.texture(contrast=contrast), np.random.default_rng(3)
    tracker, errors = PlaneTracker(own, painted.picture(own, grey=grey, noise=noise, seed=1000), painted.POSE), []
    for k in range(40):
        true = compose(painted.POSE, np.array([0.3 * tracker.pixel_m * k, 0.0, 0.002 * k]))
        start = compose(
            true, np.array([*(1.2 * tracker.pixel_m * rng.standard_normal(2)), 0.01 * rng.standard_normal()])
        )
        found = tracker.measure(painted.picture(own, true, grey, noise=noise, seed=k), start)
        if found is not None:
            found.learn()
            errors.append(own.apart_m(found.pose, true) / tracker.pixel_m)
    return np.array(errors), tracker


@pytest.mark.parametrize(("noise", "contrast"), [(6.0, 4.0), (6.0, 6.0), (4.0, 4.0), (3.0, 6.0)])
def test_slopes_that_noise_made_steep_are_averaged(noise, contrast, slopes_stay):
    averaged, tracker = followed(noise, contrast)
    assert np.linalg.eigvals(tracker.response.share).real.min() > 0.8
    slopes_stay()
    alone, tracker = followed(noise, contrast)
    assert np.linalg.eigvals(tracker.response.share).real.min() < 0.75
    assert len(averaged) >= len(alone)
    assert np.sqrt(np.mean(averaged[-25:] ** 2)) < 0.9 * np.sqrt(np.mean(alone[-25:] ** 2))


def test_slopes_of_a_top_that_shows_texture_stay_those_of_the_first_picture(slopes_stay):
    kept, _ = followed(2.0, 30.0)
    slopes_stay()
    alone, _ = followed(2.0, 30.0)
    np.testing.assert_array_equal(kept, alone)


def test_a_top_of_which_nothing_is_confirmed_keeps_its_slopes():
    own = painted.target()
    tracker = PlaneTracker(own, painted.picture(own, noise=2.0, seed=1), painted.POSE)
    slopes = tracker.template.slopes
    for _ in range(12):
        tracker.response.learn(tracker.free_slopes, np.zeros_like(slopes), np.ones(len(slopes)))
        tracker._average(np.zeros_like(slopes), np.ones(len(slopes)))
    assert tracker.response.whole is None
    assert tracker.template.slopes is slopes


@pytest.mark.parametrize(
    ("status", "found_there", "seen"),
    [(TrackStatus.TRACKED, True, True), (TrackStatus.LOST, True, False), (TrackStatus.TRACKED, False, False)],
)
def test_where_the_outline_leads_to_nothing_the_texture_leads(status, found_there, seen):
    """The outline hopped by 9 px, which the prediction carries on: only where the texture leads is the body seen."""
    led, predicted = np.zeros(3), np.array([9.0, 0.0, 0.0])
    tried = []

    def measure(luma, start, velocity):
        tried.append(start)
        return Measurement(led, np.eye(3), residual=1.0) if found_there and not start.any() else None

    follower = SimpleNamespace(
        texture_motion=SimpleNamespace(predict=lambda time_s: led, velocity=np.zeros(3)),
        target=SimpleNamespace(apart_m=lambda one, other: float(np.abs(one - other).max())),
        tracker=SimpleNamespace(measure=measure),
        record=SimpleNamespace(last_status=status),
        pixel_m=1.0,
    )
    first = measure(None, predicted, None)
    found = Follower._as_the_texture_went(follower, 1.0, None, predicted, first)
    assert (found is not None) == seen
    assert len(tried) == (1 if status == TrackStatus.LOST else 2)
