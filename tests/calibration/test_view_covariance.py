"""The covariance from views: against the jackknife on photographs, and against known errors of synthetic sets."""

from dataclasses import replace

import numpy as np
import pytest

from studies.real.jackknife import SETS, normalised_errors, over_jackknife
from studies.worlds.boards import calibration_set
from towval.calibration.blocks import Estimate, residuals
from towval.calibration.bundle_adjustment import marginal_covariance
from towval.calibration.observations import first_guess
from towval.calibration.view_covariance import view_covariance
from towval.optics.plane_uncertainty import shared_parameters


@pytest.mark.shared
@pytest.mark.parametrize("folder", SETS)
def test_stated_deviations_are_those_of_the_jackknife(shared_dir, folder):
    stated, alone = over_jackknife(shared_dir / "real" / folder)
    assert (stated > 0.8).all()
    assert (stated < 1.25).all()
    assert (alone < 0.7).all()


@pytest.mark.parametrize("floor", ["marks", "boards"])
@pytest.mark.parametrize(("size_px", "fewest"), [(0.0, 0.7), (0.3, 2.0)])
def test_normalised_errors_are_about_one(floor, size_px, fewest):
    """Of fx, fy, cx, cy and k1; corners taken for independent understate them where they are not."""
    by_view, by_corner = normalised_errors(range(9200, 9240), size_px, floor)
    assert 0.8 < by_view < 1.3
    assert by_corner > fewest


def test_marks_alone_enter_with_their_stated_deviation():
    scene = calibration_set(9120)
    seen = replace(scene.seen, boards=())
    truth = Estimate(shared_parameters(scene.camera, scene.floor), (np.zeros(0),), noise_px=1.0)
    floor = np.arange(12, 18)
    np.testing.assert_allclose(
        view_covariance(seen.blocks, truth, floor),
        marginal_covariance(seen.blocks, truth, floor)[0][np.ix_(floor, floor)],
        rtol=1e-6,
    )


def test_eight_views_weigh_as_much_as_what_is_known_before():
    """Views without any scatter halve the variance that independent corners would state."""
    seen = calibration_set(9120, views=8).seen
    guess = first_guess(seen)
    places, blocks = guess.places[:8], seen.blocks[:8]
    misfits = residuals(blocks, replace(guess, places=places))
    exact = [replace(b, pixels=b.pixels - r) for b, r in zip(blocks, misfits, strict=True)]
    estimate, camera = Estimate(guess.shared, places, noise_px=1.0), np.arange(4)
    alone = marginal_covariance(exact, estimate, camera)[0][np.ix_(camera, camera)]
    share = np.diag(view_covariance(exact, estimate, camera)) / np.diag(alone)
    np.testing.assert_allclose(share, 0.5, atol=0.1)


def test_what_one_view_alone_tells_is_not_taken_to_be_repeated_by_others():
    """A single board on the floor: no other view shows its slope and height, which came out twice as sure."""
    seen = calibration_set(9120, floor="boards").seen
    seen = replace(seen, floor_boards=seen.floor_boards[:1])
    guess, blocks, floor = first_guess(seen), seen.blocks, np.arange(12, 18)
    exact = [replace(b, pixels=b.pixels - r) for b, r in zip(blocks, residuals(blocks, guess), strict=True)]
    estimate = replace(guess, noise_px=1.0)
    np.testing.assert_allclose(
        view_covariance(exact, estimate, floor),
        marginal_covariance(exact, estimate, floor)[0][np.ix_(floor, floor)],
        rtol=1e-6,
    )
