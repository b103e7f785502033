"""Limits of the calibration, each from both sides: what is still accepted, and what no longer is."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from board_pictures import chessboard_pattern, pattern_to_image, picture, true_corners
from studies.worlds.boards import calibration_set
from towval.calibration.adequacy import ViewStatistics, view_findings
from towval.calibration.behind_boards import _common_motion, _Features
from towval.calibration.bundle_adjustment import adjust
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.corners import observe_charuco, refine
from towval.calibration.lens import LensTrial, active_parameters
from towval.calibration.observations import first_guess
from towval.model import Board
from towval.model.errors import RefusedError
from towval.model.findings import Severity

QUICK = CalibrateSettings(lens_models=("k1",), folds=2)


@pytest.mark.parametrize(
    ("change", "code", "severity"),
    [
        ({}, None, None),
        ({"tilt_deg": np.full(12, 6.0)}, "no-tilt", Severity.WARNING),
        ({"tilt_deg": np.full(12, 10.0)}, None, None),
        ({"covered": 0.3}, "centre-only", Severity.WARNING),
        ({"covered": 0.5}, None, None),
        ({"held": 5}, "few-views", Severity.WARNING),
        ({"held": 8}, None, None),
        ({"focal_std_share": 0.005}, None, None),
        ({"focal_std_share": 0.008}, "focal-length-uncertain", Severity.WARNING),
        ({"focal_std_share": 0.015}, "focal-length-uncertain", Severity.WARNING),
        ({"focal_std_share": 0.025}, "focal-length-uncertain", Severity.REFUSAL),
    ],
)
def test_a_set_of_views_is_adequate_within_its_limits(change, code, severity):
    good = {"held": 12, "tilt_deg": np.full(12, 25.0), "covered": 0.8, "focal_std_share": 0.001}
    found = [(finding.code, finding.severity) for finding in view_findings(ViewStatistics(**(good | change)))]
    assert found == ([(code, severity)] if code else [])


@pytest.mark.parametrize(("views", "enough"), [(2, False), (4, True)])
def test_three_views_are_the_least(views, enough):
    seen = calibration_set(91, views=views).seen
    if enough:
        assert calibrate_observations(seen, QUICK, {}).camera.lens_model == "k1"
    else:
        with pytest.raises(RefusedError, match="too few views"):
            calibrate_observations(seen, QUICK, {})


@pytest.mark.parametrize(("noise_px", "dropped"), [(0.07, False), (0.14, True)])
def test_a_view_that_fits_to_a_tenth_of_a_pixel_is_kept_however_good_the_others_are(noise_px, dropped):
    seen = calibration_set(92, noise_px=0.005, views=8).seen
    worse = seen.boards[2]
    rng = np.random.default_rng(0)
    noisy = replace(worse, corners_px=worse.corners_px + noise_px * rng.standard_normal(worse.corners_px.shape))
    seen = replace(seen, boards=(*seen.boards[:2], noisy, *seen.boards[3:]))
    views = calibrate_observations(seen, CalibrateSettings(lens_models=("k1 k2",), folds=2), {}).views
    assert bool(next(view for view in views if view.name == worse.name).dropped) == dropped


@pytest.mark.parametrize(("condition", "determined"), [(0.7e8, True), (1.6e8, False)])
def test_coefficients_are_determined_up_to_a_condition_of_1e8(condition, determined):
    assert LensTrial("k1", np.ones(3), None, condition).determined == determined


@pytest.mark.parametrize(("wild", "low", "high"), [(3.5, 0.9, 1.1), (100.0, 2.8, 5.5)])
def test_a_corner_pulls_as_far_as_five_deviations_of_its_picture(wild, low, high):
    """The shift of a fit by one corner, over the shift that its residual in full would give, times that residual."""
    seen = calibration_set(93).seen
    active = active_parameters("k1", with_floor=True)
    clean = adjust(seen.blocks, first_guess(seen), active)
    spread = 0.2

    def shift(deviations):
        pixels = seen.blocks[2].pixels.copy()
        pixels[20, 0] += deviations * spread
        blocks = [*seen.blocks[:2], replace(seen.blocks[2], pixels=pixels), *seen.blocks[3:]]
        return (adjust(blocks, clean, active).places[2] - clean.places[2])[3]

    one = shift(1.5) / 1.5
    pulled = shift(wild) / one
    assert low < pulled / (wild if wild < 5 else 1.0) < high


def board_picture(square_px=40.0):
    pattern = chessboard_pattern(5, 4, 40)
    size = square_px / 40 * np.array([pattern.shape[1], pattern.shape[0]])
    quad = np.array([[20.0, 20], [20 + size[0], 24], [18 + size[0], 24 + size[1]], [22, 18 + size[1]]])
    homography = pattern_to_image(pattern, quad)
    return picture(pattern, homography, (640, 480)), true_corners(5, 4, 40, homography)


def test_the_window_of_a_corner_is_a_third_of_a_square_and_at_most_fifteen_pixels(monkeypatch):
    half_widths = []
    monkeypatch.setattr(cv2, "cornerSubPix", lambda image, part, size, *_: half_widths.append(size[0]) or part)
    corners = np.array([[100.0, 100.0]])
    for spacing in (20.0, 200.0):
        refine(np.zeros((480, 640), np.uint8), corners, np.array([spacing]))
    assert 4 <= half_widths[0] <= 8
    assert 10 <= half_widths[1] <= 20


@pytest.mark.parametrize(("move", "kept"), [(0.22, True), (0.4, False)])
def test_a_corner_that_moves_by_more_than_a_third_of_a_square_stays_where_it_was(monkeypatch, move, kept):
    monkeypatch.setattr(cv2, "cornerSubPix", lambda image, part, *_: part.__iadd__(np.float32([40 * move, 0])))
    corners = np.array([[100.0, 100.0]])
    refined = refine(np.zeros((480, 640), np.uint8), corners, np.array([40.0]))
    assert (refined[0, 0] > 101) == kept


@pytest.mark.parametrize(("rows", "enough"), [(2, False), (4, True)])
def test_a_charuco_board_needs_eight_corners_in_view(rows, enough):
    board = Board("charuco", (3, 5), 0.04, 0.03, "DICT_4X4_50")
    pattern = cv2.aruco.CharucoBoard((4, 6), 0.04, 0.03, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    image = cv2.copyMakeBorder(pattern.generateImage((320, 480)), 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    # Rows of squares from the top, 80 px each: so many rows of three inner corners are in view.
    image[40 + 80 * (rows + 1) :] = 255
    assert (observe_charuco("a", image, board) is not None) == enough


@pytest.mark.parametrize(("count", "tells"), [(20, False), (30, True)])
def test_what_stands_behind_a_board_tells_by_25_matches_that_agree(count, tells):
    rng = np.random.default_rng(count)
    places, descriptors = rng.uniform(-500, 500, (count, 2)), rng.standard_normal((count, 128)).astype(np.float32)
    found = _common_motion(
        _Features(places, descriptors, 1.0), _Features(places + np.array([30.0, 0.0]), descriptors, 1.0)
    )
    assert (found is not None) == tells
    if found:
        np.testing.assert_allclose(found[0][:2, 2] / found[0][2, 2], [30.0, 0.0], atol=1e-3)
