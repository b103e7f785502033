"""The body frame by the outlines of a run: what sides that are too far apart say of its middle."""

import cv2
import numpy as np
import pytest
from painted import POSE

from studies.worlds.scenes import ceiling, rectangle
from towval.model import Body
from towval.model.geometry import inverse_transform
from towval.tracking.outline import OutlineFit, observe_outline
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.registration import registration

PIXEL_M = 1e-3
SHARP = np.diag([1e-5, 1e-5, 1e-4]) ** 2
NONE = np.zeros((3, 3))


def fits_of(corrections, sizes):
    return [
        OutlineFit(np.append(one, 0.0), SHARP, np.asarray(size)) for one, size in zip(corrections, sizes, strict=True)
    ]


def registered(fits, usual_m, pixel_m=PIXEL_M):
    return registration(fits, np.tile(NONE, (len(fits), 1, 1)), np.asarray(usual_m), NONE, pixel_m)


def stds_mm(fit):
    return 1e3 * np.sqrt(np.diag(fit.covariance)[:2])


@pytest.mark.parametrize(
    ("usual_mm", "expected_mm"),
    [
        ((0.0, 0.0), (0.0, 0.0)),
        ((-2.0, -2.0), (0.0, 0.0)),  # A bevel: all sides alike.
        ((2.0, 2.0), (2**0.5, 2**0.5)),  # Edges of something else lie outside.
        ((-2.0, 2.0), (2**0.5, 2**0.5)),
        ((-2.0, 0.0), (0.5**0.5, 0.5**0.5)),
    ],
)
def test_the_middle_is_as_unsure_as_sides_are_too_far_apart(usual_mm, expected_mm):
    usual_m = 1e-3 * np.array(usual_mm)
    fit = registered(fits_of(np.zeros((5, 2)), np.tile(usual_m, (5, 1))), usual_m)
    assert stds_mm(fit) == pytest.approx(np.array(expected_mm), abs=0.02)


def test_edges_that_stand_off_at_random_move_the_middle_by_the_stated_deviation():
    rng, bevel_m, std_m = np.random.default_rng(1), -0.0015, 0.0005
    left, right, lower, upper = bevel_m + std_m * rng.standard_normal((4, 4000))
    off = np.column_stack([right - left, upper - lower]) / 2
    sizes = np.column_stack([left + right, lower + upper])
    variances = [
        stds_mm(registered(fits_of([one], [size]), size, 6e-4)) ** 2 for one, size in zip(off, sizes, strict=True)
    ]
    assert np.mean(variances) == pytest.approx(1e6 * np.mean(off**2), rel=0.1)


@pytest.mark.parametrize(("apart_px", "counts"), [(0.3, False), (0.4, True)])
def test_sides_that_are_off_as_edges_usually_are_say_nothing(apart_px, counts):
    usual_m = np.array([0.0, apart_px * PIXEL_M])
    fit = registered(fits_of(np.zeros((5, 2)), np.tile(usual_m, (5, 1))), usual_m)
    assert (stds_mm(fit)[1] > 0.1) == counts


def test_noise_that_makes_sides_longer_counts_once():
    noisy = [OutlineFit(np.zeros(3), np.diag([1e-3, 1e-3, 1e-3]) ** 2, np.array([1e-3, -1e-3]))]
    without = registered(noisy, (0.0, 0.0))
    assert stds_mm(registered(noisy, (1e-3, -1e-3))) == pytest.approx(stds_mm(without))


@pytest.mark.parametrize("usual_m", [(0.0, 0.0), (0.0, 4e-3)])
def test_pictures_whose_sides_are_as_far_apart_as_stated_count_more(usual_m):
    """Even where most are not."""
    corrections = [(0.0, 0.0), (0.0, 0.0), (0.0, 2e-3), (0.0, 2.1e-3), (0.0, 1.9e-3)]
    sizes = [(0.0, 0.0), (0.0, 0.0), (0.0, 4e-3), (0.0, 4e-3), (0.0, 4e-3)]
    fit = registered(fits_of(corrections, sizes), usual_m)
    assert abs(fit.correction[1]) < 1e-5


def test_bevelled_pictures_count_more_than_those_where_an_edge_beyond_makes_up_for_the_bevel():
    corrections = [(0.0, 0.0), (0.0, 0.0), (0.0, 1e-3), (0.0, 1e-3)]
    sizes = [(-2e-3, -2e-3), (-2e-3, -2e-3), (-2e-3, 0.0), (-2e-3, 0.0)]
    fit = registered(fits_of(corrections, sizes), (-2e-3, -2e-3))
    assert abs(fit.correction[1]) < 1e-5


@pytest.mark.parametrize(("strip_grey", "strip_px", "bevel_px"), [(50, 1.2, 0.3), (70, 1.2, 0.3)])
def test_an_edge_taken_for_the_tops_is_within_the_stated_deviation(strip_grey, strip_px, bevel_px):
    """A dark strip beside one side, as of a foot seen from above: its far edge is the steeper one."""
    own = PlanarTarget(Body("box", 0.3, rectangle(0.6, 0.4)), *ceiling((480, 360), 1000.0))
    pixel_m = own.metres_per_pixel(POSE)
    rows, columns = np.indices((4 * 360, 4 * 480))
    x, y = inverse_transform(POSE, own.floor_xy((np.stack([columns, rows], -1).reshape(-1, 2) + 0.5) / 4 - 0.5)).T
    fine = np.full(len(x), 115.0)
    fine[y < -0.2], fine[x < -0.3], fine[x > 0.3] = 70.0, 60.0, 35.0
    fine[(np.abs(x) < 0.3) & (y > -0.2) & (y < 0.2 + strip_px * pixel_m)] = strip_grey
    fine[(np.abs(x) < 0.3 - bevel_px * pixel_m) & (np.abs(y) < 0.2 - bevel_px * pixel_m)] = 105.0
    soft = cv2.GaussianBlur(fine.reshape(360, 4, 480, 4).mean(axis=(1, 3)), (0, 0), 0.6)
    luma = (soft + np.random.default_rng(0).normal(0, 2, soft.shape)).round().astype(np.uint8)
    fit = observe_outline(luma, own, POSE)
    assert fit is not None
    assert abs(fit.correction[1]) > 5 * np.sqrt(fit.covariance[1, 1])
    sure = registered([fit] * 3, fit.size, pixel_m)
    assert sure is not None
    assert sure.correction == pytest.approx(fit.correction, rel=1e-6)
    assert abs(sure.correction[1]) < 2 * np.sqrt(sure.covariance[1, 1])


@pytest.mark.parametrize(("theirs", "left_out"), [(0, 0.0), (1, 0.25), (2, 0.4)])
def test_fits_that_are_left_out_count_by_the_share_of_what_they_know(theirs, left_out):
    rng = np.random.default_rng(4)
    there = np.array([3e-3, 1e-3])
    corrections = [*(1e-5 * rng.standard_normal((3, 2))), *(there + 1e-5 * rng.standard_normal((theirs, 2)))]
    fit = registered(fits_of(corrections, np.zeros((3 + theirs, 2))), (0.0, 0.0))
    assert np.abs(fit.correction[:2]).max() < 2e-5
    assert fit.covariance[:2, :2] == pytest.approx(left_out * np.outer(there, there), rel=0.03, abs=1e-9)


def test_a_registration_needs_an_outline():
    assert registered([], (0.0, 0.0)) is None
