"""Limits of the tracker, each from both sides: what is still accepted, and what no longer is."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from painted import FLOOR, POSE, picture, target, texture

from studies.worlds.scenes import ceiling, rectangle
from towval.model import Body, TrackStatus
from towval.model.errors import InputError
from towval.model.geometry import compose, transform
from towval.tracking import alignment, blur, finished_track, follow, outline, plane_tracker, two_measurements
from towval.tracking import noise as noise_module
from towval.tracking.alignment import align
from towval.tracking.blur import Shutter
from towval.tracking.camera_motion import CameraMotion
from towval.tracking.finished_track import finished, honest_covariance, judge_observations, judge_registration, moves_on
from towval.tracking.floor_registration import Registered
from towval.tracking.follow import Follower
from towval.tracking.klt import KltTracker, _flow
from towval.tracking.light import evened, light_misfit, without_dead
from towval.tracking.noise import hold_rest, local_scatter, scatter_factors
from towval.tracking.outline import OutlineFit, combine_fits, observe_outline, pose_from_clicks, stretches_of
from towval.tracking.outline_search import OutlineSearch
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import PlaneTracker, _Response
from towval.tracking.pose import Measurement, Motion, Tracker
from towval.tracking.registration import registration
from towval.tracking.relocalisation import Candidate, Lookalikes, Relocaliser
from towval.tracking.template import clearance_m, make_template
from towval.tracking.track import TrackSettings, _sample_findings

BOX = target()
PIXEL_M = BOX.metres_per_pixel(POSE)
OUTLINE = BOX.pixels(BOX.body.top_corners_m, POSE)
EMPTY = np.full((240, 320), 90, dtype=np.uint8)


def aligned(luma, start=POSE, most_scale=20.0):
    template = make_template(picture(BOX), BOX, POSE)
    return align(luma, template, np.ones(len(template.points)), start, BOX, most_scale)


class Scripted(Tracker):
    """Reports the poses that a test gives it, by a function of the start."""

    def __init__(self, answer):
        self.answer, self.std_m = answer, 1e-4

    def measure(self, luma, predicted, velocity=None):
        pose = self.answer(predicted)
        return None if pose is None else Measurement(np.asarray(pose, dtype=float), self.std_m**2 * np.eye(3))


@pytest.fixture
def follower():
    """A follower of the painted box whose tracker, search and rivals a test scripts."""
    own = Follower(BOX, 0.0, picture(BOX), OUTLINE, lambda *_: Scripted(lambda start: start), 0.1)
    own.relocaliser = SimpleNamespace(find=lambda _: None)
    own.lookalikes = SimpleNamespace(candidates=lambda _: [], rivals=lambda *_: [], twins=[])
    return own


# Light


@pytest.mark.parametrize(("contrast", "shown"), [(0.3, True), (0.15, False)])
def test_a_target_that_fades_to_a_fifth_is_not_shown(contrast, shown):
    found = aligned(picture(BOX, grey=texture(contrast=30 * contrast)))
    assert (found.inlier_fraction > 0.5) == shown


@pytest.mark.parametrize(("gain", "followed"), [(4.0, True), (8.0, False)])
def test_light_is_followed_up_to_five_times_the_contrast(gain, followed):
    dark = texture(contrast=6.0)
    template = make_template(picture(BOX, grey=dark), BOX, POSE)
    bright = picture(BOX, grey=lambda xy: 120 + gain * (dark(xy) - 120))
    found = align(bright, template, np.ones(len(template.points)), POSE, BOX, 20.0)
    assert (found.scale < 1.0) == followed


def test_a_tile_as_faint_as_the_noise_keeps_a_gain_near_one():
    template = np.tile([-2.0, 2.0], 10)
    values, tile, weight = 50 + 0.5 * template, np.zeros(20, dtype=int), np.ones(20)
    # The least-squares gain is 0.5; a prior of one, give or take a half, at residuals of 4 draws it to about 0.7.
    gain = 0.5 + np.sqrt(light_misfit(values, template, tile, 1, weight, 4.0) / 80)
    assert 0.65 < gain < 0.8


@pytest.mark.parametrize(("dead", "replaced"), [(40, False), (65, True)])
def test_a_twenty_thousandth_of_the_pixels_may_be_dead(dead, replaced):
    luma = np.full((1000, 1000), 100, dtype=np.uint8)
    at = 10 + 100 * np.arange(dead)
    luma[10 + 10 * (at // 1000), at % 1000] = 255
    assert (without_dead(luma).max() == 100) == replaced


# Template and alignment


def depths(template, own):
    x, y = np.abs(template.points).T
    length, width = np.ptp(own.body.top_corners_m, axis=0) / 2
    return np.minimum(length - x, width - y)


def test_template_points_keep_three_pixels_from_the_outline_or_an_eighth_of_a_small_body():
    template = make_template(picture(BOX), BOX, POSE)
    assert 2.9 < depths(template, BOX).min() / PIXEL_M < 5.0
    assert 2.0 < clearance_m(BOX.body, PIXEL_M) / PIXEL_M < 4.5
    small = Body("small", 0.3, rectangle(12 * PIXEL_M, 10 * PIXEL_M))
    assert 0.8 < clearance_m(small, PIXEL_M) / PIXEL_M < 1.8


@pytest.mark.parametrize(("samples", "enough"), [(30, False), (70, True)])
def test_a_template_needs_forty_points(samples, enough):
    assert (make_template(picture(BOX), BOX, POSE, samples) is not None) == enough


def test_tiles_are_a_fifth_of_the_target_but_never_few_pixels():
    square = target(1.0, 1.0)
    assert 16 <= make_template(picture(square), square, POSE).tiles <= 36
    small = target(0.4, 0.4)
    assert 2 <= make_template(picture(small), small, POSE).tiles <= 9


def test_an_exact_picture_has_the_scale_of_rounding():
    assert 0.3 < aligned(picture(BOX)).scale < 0.8


@pytest.mark.parametrize(("hidden", "correlated"), [(0.55, True), (0.9, False)])
def test_the_better_tiles_decide_the_correlation(hidden, correlated):
    luma = picture(BOX)
    columns = np.sort(OUTLINE[:, 0])
    edge = int(columns[0] + hidden * (columns[-1] - columns[0]))
    luma[:, :edge] = np.random.default_rng(1).integers(60, 180, luma[:, :edge].shape)
    found = aligned(luma)
    assert (found is not None and found.correlation > 0.6) == correlated


def test_a_direction_without_texture_is_open():
    own = target()
    stripes = picture(own, pose=np.zeros(3), grey=lambda xy: 120 + 40 * np.sin(40 * xy.sum(axis=1)))
    template = make_template(stripes, own, np.zeros(3))
    assert align(stripes, template, np.ones(len(template.points)), np.zeros(3), own, 20.0) is None


def converges(contrast, seed, off_px, *, wide=False):
    """Whether the alignment of a faint target with much noise converges from so far off."""
    faint = texture(contrast=contrast)
    template = make_template(picture(BOX, grey=faint, noise=8.0, seed=5), BOX, POSE)
    start = compose(POSE, np.array([off_px * PIXEL_M, 0.0, 0.0]))
    luma = picture(BOX, grey=faint, noise=8.0, seed=seed)
    return align(luma, template, np.ones(len(template.points)), start, BOX, 20.0, wide=wide).converged


@pytest.mark.parametrize(("off_px", "converged"), [(5.0, True), (6.0, False)])
def test_a_faint_noisy_target_converges_from_five_pixels_within_the_rounds(off_px, converged):
    assert converges(6.0, 1, off_px) == converged


@pytest.mark.parametrize(("determinant", "determined"), [(1.4e-4, True), (0.7e-4, False)])
def test_a_direction_is_open_below_a_determinant_of_1e_4(determinant, determined):
    sharp = make_template(picture(BOX), BOX, POSE)

    def skewed(share):
        """The template with slopes along y that are those along x but for a share."""
        slopes = sharp.slopes.copy()
        slopes[:, 1] = slopes[:, 0] + share * slopes[:, 1]
        return align(picture(BOX), replace(sharp, slopes=slopes), np.ones(len(slopes)), POSE, BOX, 20.0)

    information = np.linalg.inv(skewed(0.2).covariance)
    size = np.sqrt(np.diag(information))
    of_share = np.linalg.det(information / np.outer(size, size)) / 0.2**2
    assert (skewed(np.sqrt(determinant / of_share)) is not None) == determined


def test_an_inlier_is_within_three_times_the_scale():
    template = make_template(picture(BOX), BOX, POSE)
    rng = np.random.default_rng(0)
    residual = np.clip(rng.standard_normal(len(template.points)), -2, 2)
    far = rng.uniform(size=len(residual)) < 0.3
    residual[far] = 5.0 * rng.choice([-1, 1], far.sum())
    disturbed = replace(template, values=template.values + residual)
    found = align(picture(BOX), disturbed, np.ones(len(residual)), POSE, BOX, 20.0)
    assert 2.7 < np.quantile(np.abs(found.residual) / found.scale, found.inlier_fraction) < 3.45


@pytest.mark.parametrize(("points", "counts"), [(6, False), (12, True)])
def test_a_tile_of_eight_points_has_a_correlation(points, counts):
    template = make_template(picture(BOX), BOX, POSE)
    template = replace(template, tile=np.arange(len(template.points)) // points)
    template = replace(template, tiles=int(template.tile.max()) + 1)
    found = align(picture(BOX), template, np.ones(len(template.points)), POSE, BOX, 20.0)
    assert (found.correlation > 0.9) == counts


# Motion blur


@pytest.fixture
def shutter(monkeypatch):
    own = Shutter(BOX, picture(BOX), POSE, make_template(picture(BOX), BOX, POSE))
    own.compared = []
    monkeypatch.setattr(blur, "light_misfit", lambda values, *_: own.compared.append(len(values)) or 0.0)
    return own


LONGEST_S = blur._CANDIDATES_S[-1]
CANDIDATES = len(blur._CANDIDATES_S)


def learns(shutter, path_px):
    """Let a shutter learn from a picture in which the body moves so far during the longest candidate."""
    velocity = np.array([path_px * PIXEL_M / LONGEST_S, 0.0, 0.0])
    shutter.learn(picture(BOX), aligned(picture(BOX)), shutter.sharp.template, velocity)


@pytest.mark.parametrize(("path_px", "learned"), [(2.2, False), (4.5, True)])
def test_the_exposure_is_learned_from_motion_of_three_pixels(shutter, path_px, learned):
    learns(shutter, path_px)
    assert bool(shutter.compared) == learned


def test_the_exposure_is_learned_from_some_hundred_points_often_at_first_and_seldom_later(shutter):
    for _ in range(60):
        learns(shutter, 4.0)
    assert 14 <= len(shutter.compared) / CANDIDATES <= 17
    assert 250 < max(shutter.compared) <= 500


@pytest.mark.parametrize(("path_px", "blurred"), [(0.4, False), (0.7, True)])
def test_less_than_half_a_pixel_is_no_blur(shutter, path_px, blurred):
    assert (shutter.sharp.blurred(np.array([path_px * PIXEL_M, 0, 0])) is not None) == blurred


def test_a_blur_is_read_about_every_pixel_and_a_half(shutter, monkeypatch):
    read, times = blur.SharpTarget.read, []
    monkeypatch.setattr(blur.SharpTarget, "read", lambda *given: times.append(1) or read(*given))
    shutter.sharp.blurred(np.array([6.0 * PIXEL_M, 0, 0]))
    assert 4 <= len(times) <= 6


@pytest.mark.parametrize(("change_px", "anew"), [(0.4, False), (0.7, True)])
def test_a_blurred_template_is_kept_until_the_motion_changes_by_half_a_pixel(shutter, monkeypatch, change_px, anew):
    monkeypatch.setattr(Shutter, "exposure_s", 1.0)
    before = shutter.template(np.array([3.0 * PIXEL_M, 0, 0]))
    assert (shutter.template(np.array([(3.0 + change_px) * PIXEL_M, 0, 0])) is not before) == anew


@pytest.mark.parametrize(("path_m", "usable"), [(0.28, True), (0.62, False)])
def test_a_blurred_template_keeps_more_than_half_of_the_points(shutter, path_m, usable):
    assert (shutter.sharp.blurred(np.array([path_m, 0, 0])) is not None) == usable


# Plane tracker


@pytest.fixture(scope="module")
def plane():
    return PlaneTracker(BOX, picture(BOX), POSE)


@pytest.fixture(scope="module")
def good():
    return aligned(picture(BOX))


@pytest.mark.parametrize(
    ("change", "usual", "trusted"),
    [
        ({}, 1.0, True),
        ({"inlier_fraction": 0.4}, 1.0, True),
        ({"inlier_fraction": 0.25}, 1.0, False),
        ({"correlation": 0.5}, 0.1, True),
        ({"correlation": 0.3}, 0.1, False),
        ({"correlation": 0.7}, 1.0, True),
        ({"correlation": 0.5}, 1.0, False),
        ({"covariance": np.diag([0.3, 0.1, 0.1]) ** 2 * PIXEL_M**2}, 1.0, True),
        ({"covariance": np.diag([0.45, 0.1, 0.1]) ** 2 * PIXEL_M**2}, 1.0, False),
        ({"converged": False}, 1.0, False),
    ],
)
def test_an_alignment_is_trusted_within_its_gates(good, change, usual, trusted):
    tracker = PlaneTracker(BOX, picture(BOX), POSE)
    tracker.usual_correlation = usual
    assert tracker._trusted(replace(good, **change)) == trusted


@pytest.mark.parametrize(("off_px", "coarse"), [(2.0, False), (4.5, True)])
def test_a_pose_far_from_the_prediction_is_tried_from_the_coarse_scale(plane, monkeypatch, off_px, coarse):
    tried = []
    monkeypatch.setattr(plane, "_align_coarsely", lambda *_: tried.append(1))
    plane.measure(picture(BOX), compose(POSE, np.array([off_px * PIXEL_M, 0.0, 0.0])))
    assert bool(tried) == coarse


def test_a_place_that_is_measured_and_not_taken_for_the_body_teaches_nothing():
    tracker, faded = PlaneTracker(BOX, picture(BOX), POSE), picture(BOX, grey=texture(contrast=20.0))
    before = tracker.template.values
    found = tracker.measure(faded, POSE)
    assert tracker.template.values is before
    found.learn()
    assert not np.array_equal(tracker.template.values, before)


def test_the_coarse_scale_shows_a_body_of_a_hundred_pixels_with_a_few_hundred_points():
    camera, floor = ceiling((1280, 960), 1200.0)
    large = PlanarTarget(BOX.body, camera, floor)
    grey = np.random.default_rng(0).integers(0, 255, (960, 1280)).astype(np.uint8)
    tracker = PlaneTracker(large, cv2.GaussianBlur(grey, (0, 0), 2), np.zeros(3))
    length_px = 2 * large.reach_m / tracker.pixel_m / tracker.factor
    assert 65 < length_px < 130
    assert 200 < len(tracker.coarse.points) < 500


@pytest.mark.parametrize(("share", "learns"), [(0.7, False), (0.9, True)])
def test_only_a_body_in_full_view_refreshes_the_template(good, share, learns):
    tracker = PlaneTracker(BOX, picture(BOX), POSE)
    before = tracker.template.values
    tracker._refresh(replace(good, inlier_fraction=share, residual=good.residual + 5.0 * (tracker.template.tile == 0)))
    assert (not np.array_equal(tracker.template.values, before)) == learns


def test_the_template_is_refreshed_often_at_first_and_seldom_later(good):
    tracker = PlaneTracker(BOX, picture(BOX), POSE)
    for _ in range(61):
        tracker._refresh(replace(good, inlier_fraction=0.9))
    assert 19 <= tracker.refreshed <= 23


def test_residuals_of_an_inlier_are_within_half_the_contrast():
    tracker = PlaneTracker(BOX, picture(BOX), POSE)
    assert 0.35 < tracker.most_scale / np.std(tracker.template.values) < 0.7


@pytest.mark.parametrize(("samples", "flagged"), [(700, True), (1500, False)])
def test_a_template_of_some_hundred_points_is_flagged(samples, flagged):
    assert bool(_sample_findings(TrackSettings(samples=samples))) == flagged


def test_the_response_is_learned_often_at_first_and_forgets_over_twenty_lessons():
    response, due = _Response(), 0
    slopes = np.random.default_rng(0).standard_normal((50, 3))
    for _ in range(100):
        if response.is_due():
            due += 1
            response.learn(slopes, slopes, np.ones(50))
    assert 13 <= due <= 16
    for _ in range(46):
        response.learn(slopes, slopes, np.ones(50))
    for _ in range(20):
        response.learn(slopes, 0.5 * slopes, np.ones(50))
    assert 0.62 < response.share[0, 0] < 0.74


@pytest.mark.parametrize(("share", "known"), [(0.12, True), (0.085, False)])
def test_a_template_that_shows_less_than_a_tenth_of_a_motion_is_not_used(share, known):
    response, slopes = _Response(), np.random.default_rng(0).standard_normal((50, 3))
    response.learn(slopes, share * slopes, np.ones(50))
    assert (response.whole is not None) == known


def inliers(template, share):
    """Weights (n,) by which so many of a template's points are inliers."""
    return np.where(np.arange(len(template.points)) < share * len(template.points), 1.0, 0.0)


@pytest.mark.parametrize(("share", "elsewhere"), [(0.6, True), (0.9, False)])
def test_another_place_is_tried_where_inliers_hold_less_than_three_quarters_of_the_information(
    plane, good, monkeypatch, share, elsewhere
):
    tried, found = [], replace(good, weight=inliers(plane.template, share))
    monkeypatch.setattr(plane, "_align", lambda *_: found)
    monkeypatch.setattr(plane, "_at_its_edges", lambda *_: tried.append(1) or found)
    plane.measure(picture(BOX), POSE)
    assert bool(tried) == elsewhere


@pytest.mark.parametrize(
    ("apart_px", "left", "plain", "taken"),
    [
        (0.3, 0.1, False, False),
        (0.3, 0.1, True, True),
        (0.3, 0.97, True, False),
        (0.65, 0.1, False, True),
        (1.5, 0.75, False, True),
        (1.5, 0.97, False, False),
    ],
)
def test_another_place_half_a_pixel_off_is_taken_where_it_leaves_a_tenth_less(
    plane, good, monkeypatch, apart_px, left, plain, taken
):
    """Of the points a fifth do not fit at the first place, and ``left`` of that at the other one.

    Where the first holds hardly more than what is ``plain``, the other may be nearer.
    """
    points = len(good.residual)

    def leaving(share, pose):
        return replace(good, pose=pose, scale=1.0, residual=np.where(np.arange(points) < share * points, 100.0, 0.0))

    first = leaving(0.2, POSE)
    other = leaving(0.2 * left, POSE + np.array([apart_px * PIXEL_M, 0.0, 0.0]))
    monkeypatch.setattr(plane, "_align", lambda *_, **__: other)
    monkeypatch.setattr(plane_tracker, "information_of_inliers", lambda *_: 0.05 if plain else 0.5)
    found = plane._at_its_edges(picture(BOX), POSE, first, plane.template, plane.response)
    assert (found is other) == taken


@pytest.mark.parametrize(("share", "averaged"), [(0.7, True), (0.9, False)])
def test_slopes_are_averaged_where_pictures_show_less_than_four_fifths_of_a_motion(share, averaged):
    tracker = PlaneTracker(BOX, picture(BOX), POSE)
    slopes, seen = tracker.template.slopes, np.ones(len(tracker.template.points))
    for _ in range(10):
        tracker.response.learn(tracker.free_slopes, share * tracker.free_slopes, seen)
    tracker._average(share * slopes, seen)
    assert np.allclose(tracker.template.slopes, share * slopes if averaged else slopes)


# Following


def test_edges_and_size_are_fitted_twice_a_second_and_half_as_often_after_each_dozen(follower, monkeypatch):
    now_s, read_s = 0.0, []
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: None)
    monkeypatch.setattr(follow, "observe_size", lambda *_: read_s.append(now_s))
    for k in range(1, 201):
        now_s = 0.1 * k
        follower.follow(now_s, None)
    gaps_s = np.diff(read_s)
    assert gaps_s[:9] == pytest.approx(0.5)
    assert gaps_s[12:20] == pytest.approx(1.0)


def test_fits_of_the_registration_are_as_unsure_as_where_the_clicks_led_makes_them(follower, monkeypatch):
    fit = OutlineFit(np.zeros(3), 1e-8 * np.eye(3))
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: fit)
    monkeypatch.setattr(follow, "observe_size", lambda *_: None)
    monkeypatch.setattr(follow, "as_begun", lambda *given: OutlineFit(given[3].correction, given[4]))
    follower.follow(1.0, None)
    assert np.array_equal(follower.outline_fits[-1].covariance, follower.start_covariance)


@pytest.mark.parametrize(("correction_px", "found"), [(2.5, True), (4.0, False)])
def test_a_registration_is_near_the_clicks(follower, correction_px, found):
    fit = OutlineFit(np.array([correction_px * PIXEL_M, 0, 0]), 1e-8 * np.eye(3))
    fit = registration([fit], np.zeros((1, 3, 3)), np.zeros(2), np.zeros((3, 3)), PIXEL_M)
    assert (fit is not None) == found
    findings = judge_registration(follower.followed(), fit, np.zeros(2))
    assert ("edges_not_found" in {finding.code for finding in findings}) != found


@pytest.mark.parametrize(("std_px", "unsure"), [(0.12, False), (0.2, True)])
def test_a_registration_that_edges_leave_open_is_flagged(follower, std_px, unsure):
    fit = OutlineFit(np.zeros(3), (std_px * PIXEL_M) ** 2 * np.eye(3))
    findings = judge_registration(follower.followed(), fit, np.array([0.0012, -0.0008]))
    assert [finding.code for finding in findings] == (["edges_unsure"] if unsure else [])
    assert all("length +1.2 mm, width -0.8 mm" in finding.text for finding in findings)


def test_clicks_that_miss_their_corners_are_flagged_and_of_another_body_refused():
    pixel_m = 1.5 / 200  # The box is 200 px long from corner to corner.
    assert outline.judge_clicks(BOX.body, 5.0, pixel_m) == []
    assert [finding.code for finding in outline.judge_clicks(BOX.body, 7.0, pixel_m)] == ["clicks_misfit"]
    assert outline.judge_clicks(BOX.body, 14.0, pixel_m)
    with pytest.raises(InputError, match="do not fit its outline"):
        outline.judge_clicks(BOX.body, 18.0, pixel_m)


@pytest.mark.parametrize(
    ("after_s", "off_m", "surprising"), [(0.01, 0.030, False), (0.01, 0.045, True), (0.5, 1.0, False), (0.5, 1.6, True)]
)
def test_a_pose_is_surprising_beyond_three_pixels_and_what_acceleration_explains(follower, after_s, off_m, surprising):
    there = compose(follower.motion.pose, np.array([off_m, 0.0, 0.0]))
    assert follower._surprising(after_s, there) == surprising


def test_no_pose_is_surprising_to_which_the_texture_or_the_outline_has_moved(follower):
    """An outline that hops by 0.2 m takes the motion along, and the texture's own one leads to the body."""
    stayed, hopped = follower.first_pose, compose(follower.first_pose, np.array([0.2, 0.0, 0.0]))
    follower.motion, follower.texture_motion = Motion(0.0, hopped), Motion(0.0, stayed)
    between = compose(stayed, np.array([0.1, 0.0, 0.0]))
    assert [follower._surprising(0.01, pose) for pose in (stayed, hopped, between)] == [False, False, True]


@pytest.mark.parametrize("rate_hz", [25, 30, 60])
def test_a_lost_body_is_searched_at_once_and_in_each_way_twice_a_second(follower, rate_hz):
    features, appearance = [], []
    follower.tracker.answer = lambda start: None
    follower.relocaliser.find = lambda _: features.append(now)
    follower.lookalikes.candidates = lambda _: appearance.append(now) or []
    for now in np.arange(1, 4 * rate_hz) / rate_hz:
        follower.follow(float(now), EMPTY)
    assert features[0] == appearance[0] == 1 / rate_hz
    for times in (features, appearance):
        # Seldom enough that a lost frame costs ten tracked ones at most, often enough for half a second.
        assert np.diff(times).max() < 0.5
        assert np.diff(times)[1:].min() > 0.4


def test_a_search_that_confirms_a_shaken_body_serves_the_next_pictures(follower):
    """Each picture is displaced by more than a body can accelerate, so each measurement is surprising."""
    searched, time_s = [], np.arange(1, 51) / 25
    places = [compose(POSE, np.array([(-1) ** i * 10 * PIXEL_M, 0, 0])) for i in range(50)]
    follower.tracker.answer = lambda _: here
    follower.relocaliser.find = lambda _: searched.append(now) or here
    follower.lookalikes.rivals = lambda *_: []
    for now, here in zip(time_s, places, strict=True):
        follower.follow(float(now), picture(BOX, here))
    assert finished(follower.followed(), "scripted").seen.all()
    assert len(searched) == pytest.approx(2 / 0.23, abs=1)


@pytest.mark.parametrize("foreign", [True, False])
def test_what_looks_foreign_is_searched_for_however_a_search_ended_before(follower, foreign):
    follower._foreign, follower.confirmed_until_s = lambda _: foreign, np.inf
    found = follower._search(0.1, None, Measurement(POSE, np.eye(3)))
    assert (found is None) == foreign


def test_what_the_tracker_does_not_find_is_no_rival(follower):
    here = follower.motion.pose
    rival = compose(here, np.array([0.5 * BOX.reach_m, 0, np.pi]))
    follower.lookalikes.rivals = lambda *_: [rival]
    assert not follower._unmistakable(4.0, EMPTY, here)
    follower.tracker.answer = lambda start: start if np.allclose(start, here) else None
    assert follower._unmistakable(4.0, EMPTY, here)


@pytest.mark.parametrize(("share", "shown"), [(0.07, False), (0.15, True)])
def test_a_match_whose_edges_fit_nowhere_holds_a_tenth_of_the_information(plane, good, monkeypatch, share, shown):
    monkeypatch.setattr(plane_tracker, "information_of_inliers", lambda *_: share)
    monkeypatch.setattr(plane, "_align", lambda *_, wide=False: None if wide else good)
    assert (plane.measure(picture(BOX), POSE) is not None) == shown


@pytest.mark.parametrize(("apart_px", "confirmed"), [(1.5, True), (3.0, False)])
def test_a_search_confirms_a_doubtful_pose_only_at_the_same_place(follower, apart_px, confirmed):
    follower.relocaliser.find = lambda _: POSE
    follower.tracker.answer = lambda start: compose(POSE, np.array([apart_px * PIXEL_M, 0, 0]))
    doubtful = Measurement(POSE, np.eye(3))
    assert (follower._search(0.1, None, doubtful) is not None) == confirmed


@pytest.mark.parametrize(
    ("after_s", "stray", "known"), [(1.0, 0.4, True), (1.0, 0.7, False), (2.5, 0.1, True), (4.0, 0.1, False)]
)
def test_a_body_with_a_twin_is_known_again_near_its_place_and_soon(follower, after_s, stray, known):
    follower.lookalikes.twins = [POSE]
    there = compose(follower.motion.pose, np.array([stray * BOX.reach_m, 0, 0]))
    assert follower._unmistakable(after_s, None, there) == known


@pytest.mark.parametrize(("farther", "known"), [(5.0, True), (3.0, False)])
def test_a_rival_must_be_much_farther_than_the_find(follower, farther, known):
    here = follower.motion.pose
    follower.lookalikes.rivals = lambda *_: [compose(here, np.array([farther * 0.1 * BOX.reach_m, 0, 0]))]
    assert follower._unmistakable(1.0, None, compose(here, np.array([0.1 * BOX.reach_m, 0, 0]))) == known


@pytest.mark.parametrize(("covered", "tracked"), [(0.22, True), (0.4, False)])
def test_two_bodies_are_not_in_one_place(follower, covered, tracked):
    edge = -0.6 + covered * 1.2
    other = transform(follower.motion.pose, np.array([[-2, -2], [edge, -2], [edge, 2], [-2, 2]], dtype=float))
    follower.follow(0.1, None, [SimpleNamespace(place=other)])
    assert (follower.place is not None) == tracked


@pytest.mark.parametrize(("known", "alone"), [(True, True), (False, False)])
def test_where_another_tracked_body_stands_is_neither_a_rival_nor_a_twin_at_large(follower, known, alone):
    here = follower.motion.pose
    beside = compose(here, np.array([3.0 * BOX.reach_m, 0, 0]))
    follower.lookalikes.rivals, follower.lookalikes.twins = (lambda *_: [beside]), [beside]
    place = transform(beside, BOX.body.top_corners_m)
    other = SimpleNamespace(place=place if known else None, first_pose=beside, target=BOX)
    assert follower._unmistakable(1.0, None, compose(here, np.array([0.8 * BOX.reach_m, 0, 0])), [other]) == alone


@pytest.mark.parametrize(("aside", "known"), [(0.2, True), (2.5, False)])
def test_a_rival_over_the_find_is_the_body_itself_turned_and_the_motion_tells(follower, aside, known):
    there = compose(follower.motion.pose, np.array([0.6 * BOX.reach_m, 0, 0]))
    follower.lookalikes.rivals = lambda *_: [compose(there, np.array([0.0, aside * BOX.reach_m, np.pi]))]
    assert follower._unmistakable(1.0, None, there) == known


@pytest.mark.parametrize(
    ("turn", "aside", "after_s", "known"),
    [(2.0, 0.0, 1.0, False), (1.4, 0.0, 1.0, True), (2.0, 1.5, 1.0, True), (2.0, 0.0, 3.5, True)],
)
def test_a_body_does_not_turn_round_where_it_was_while_that_is_remembered(follower, turn, aside, after_s, known):
    there = compose(follower.motion.pose, np.array([0.0, aside * BOX.reach_m, turn]))
    assert follower._unmistakable(after_s, None, there) == known


def test_of_places_that_look_as_good_the_one_at_home_is_found(follower):
    here = follower.motion.pose
    turned = compose(here, np.array([0.0, 0.0, np.pi]))
    follower.tracker.answer = lambda start: None
    follower.follow(0.1, EMPTY)
    follower.tracker.answer = lambda start: None if np.isnan(start).any() else start
    follower.lookalikes.candidates = lambda _: [Candidate(0.9, turned, np.ones(2)), Candidate(0.8, here, np.ones(2))]
    follower.lookalikes.rivals = lambda _, place: [turned if abs(place[2] - here[2]) < 1 else here]
    assert follower._search(1.0, None, None).pose == pytest.approx(here)


def test_a_body_that_was_rarely_seen_is_not_called_plain(follower):
    status = np.full(8, TrackStatus.LOST, dtype=np.uint8)
    status[0] = TrackStatus.TRACKED
    covariance = np.tile((0.1 * PIXEL_M) ** 2 * np.eye(3), (8, 1, 1))
    findings = judge_observations(follower.followed(), np.arange(8.0), covariance, status)
    assert {one.code for one in findings} == {"not_seen"}


@pytest.mark.parametrize(("std_px", "plain"), [(0.1, False), (0.15, True)])
def test_a_plain_target_is_flagged(follower, std_px, plain):
    covariance = np.tile((std_px * PIXEL_M) ** 2 * np.eye(3), (4, 1, 1))
    status = np.full(4, TrackStatus.TRACKED)
    findings = judge_observations(follower.followed(), np.arange(4.0), covariance, status)
    assert ("low_texture" in {finding.code for finding in findings}) == plain


@pytest.mark.parametrize(("blur_px", "told"), [(0.8, False), (1.4, True)])
def test_a_blur_of_a_pixel_is_told_of(follower, blur_px, told):
    body = replace(follower.followed(), widest_blur_px=blur_px)
    covariance, status = np.tile(1e-8 * np.eye(3), (4, 1, 1)), np.full(4, TrackStatus.TRACKED)
    findings = judge_observations(body, np.arange(4.0), covariance, status)
    assert ("focus_changed" in {finding.code for finding in findings}) == told


@pytest.mark.parametrize(("times", "known"), [(2.2, True), (4.5, False)])
def test_what_leaves_three_times_the_usual_misfit_is_foreign(follower, times, known):
    """The body appears elsewhere, where its motion cannot have taken it."""
    for k in range(1, 5):
        follower.record.keep(0.04 * k, POSE, np.eye(3), TrackStatus.TRACKED, 1.0, 5.0)
    there = compose(POSE, np.array([3.0, 0.0, 0.0]))
    follower.relocaliser.find = lambda _: there
    follower.tracker.measure = lambda *_: Measurement(there, 1e-8 * np.eye(3), residual=5.0 * times)
    assert (follower._search(0.2, None, None) is not None) == known


@pytest.mark.parametrize(
    ("whole", "turn", "times"), [(100.0, 100.0, 6.0), (1.0, 1.5, 1.5), (1.0, 100.0, 2.0), (3.0, 3.0, 3.0)]
)
def test_the_scatter_is_that_of_frames_in_which_the_body_moves_and_is_bounded(
    follower, monkeypatch, whole, turn, times
):
    monkeypatch.setattr(finished_track, "scatter_factors", lambda *_given: (whole, turn))
    steps = np.array([0.08, 0.08, 0.15, 0.15]) * PIXEL_M
    pose = np.zeros((5, 3))
    pose[1:, 0] = np.cumsum(steps)
    covariance = np.tile((0.01 * PIXEL_M) ** 2 * np.eye(3), (5, 1, 1))
    tracked = np.ones(5, dtype=bool)
    moving = moves_on(pose, tracked, PIXEL_M)
    assert moving[:4].tolist() == [False, False, True, True]
    honest = honest_covariance(np.arange(5.0), pose, covariance, tracked, moving, PIXEL_M)
    std_px = np.sqrt(np.diag(honest[2])) / PIXEL_M
    assert std_px[0] == pytest.approx(0.01 * min(whole, 6.0), rel=0.3)
    assert std_px[2] == pytest.approx(0.01 * times, rel=0.3)


@pytest.mark.parametrize(("shift_px", "held"), [(0.07, True), (0.15, False)])
def test_a_rest_is_within_a_tenth_of_a_pixel(follower, monkeypatch, shift_px, held):
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: None)
    monkeypatch.setattr(follow, "observe_size", lambda *_: None)
    follower.tracker.std_m = 0.05 * PIXEL_M
    there = follower.motion.pose
    for k in range(1, 21):
        pose = compose(there, np.array([shift_px * PIXEL_M * (k % 2), 0, 0]))
        follower.tracker.answer = lambda start, pose=pose: pose
        follower.follow(0.1 * k, None)
    follower.outline_fits, follower.fitted_in = [], []
    assert (np.ptp(finished(follower.followed(), "scripted").pose[2:, 0]) < 1e-9) == held


# Noise and rest


def test_few_windows_say_nothing_about_noise():
    rng = np.random.default_rng(0)
    for count, known in ((16, False), (32, True)):
        pose = 3e-4 * rng.standard_normal((count, 3))
        covariance = np.tile(1e-8 * np.eye(3), (count, 1, 1))
        factor, _ = scatter_factors(np.arange(count) / 25, pose, covariance, np.ones(count, dtype=bool))
        assert (factor > 1.5) == known


@pytest.mark.parametrize(("growth", "noise"), [(1.8, True), (3.6, False)])
def test_what_grows_with_the_window_as_motion_does_is_no_noise(monkeypatch, growth, noise):
    monkeypatch.setattr(noise_module, "_scatter", lambda *given: np.full(2, 1.5 * (growth if given[-1] == 9 else 1.0)))
    factors = scatter_factors(np.arange(9.0), np.zeros((9, 3)), np.zeros((9, 3, 3)), np.ones(9, dtype=bool))
    assert factors == pytest.approx((1.5 * growth if noise else 1.5,) * 2)


@pytest.mark.parametrize(("deviations", "counts"), [(3.5, False), (5.5, True)])
def test_a_picture_off_by_itself_counts_from_four_deviations_on(deviations, counts):
    """Its distance from the quadratic is half of that, and as unsure as that half says."""
    time_s, std_m = np.arange(60) / 25, 5e-5
    pose = np.column_stack([0.1 * time_s, 0 * time_s, 0 * time_s])
    pose[30, 0] += deviations * std_m
    added = local_scatter(time_s, pose, np.tile(std_m**2 * np.eye(3), (60, 1, 1)))
    assert (added[30, 0, 0] > 4 * std_m**2) == counts


def rests(pose, rate_hz=25.0, std=3e-5):
    pose = np.asarray(pose, dtype=float)
    full = np.column_stack([pose, 0 * pose, 0 * pose])
    covariance = np.tile(std**2 * np.eye(3), (len(pose), 1, 1))
    return hold_rest(np.arange(len(pose)) / rate_hz, full, covariance, np.ones(len(pose), dtype=bool), np.ones(3))[:, 0]


def test_a_rest_is_what_stays_within_four_deviations():
    wobble = 3e-5 * np.tile([1.4, -1.4], 20)
    assert np.ptp(rests(wobble)) < 1e-12
    assert np.ptp(rests(3e-5 * np.tile([0.0, 0.0, 6.0, 0.0, 0.0, -6.0], 8))) > 1e-4
    jump = np.concatenate([np.zeros(20), 18e-5 * np.ones(20)])
    held = rests(jump)
    assert held[-1] - held[0] == pytest.approx(18e-5)


@pytest.mark.parametrize(
    ("count", "rate_hz", "held"), [(15, 50.0, False), (30, 50.0, True), (5, 8.0, False), (9, 8.0, True)]
)
def test_a_rest_lasts_four_tenths_of_a_second_and_six_pictures(count, rate_hz, held):
    assert (np.ptp(rests(1e-5 * np.tile([1.0, -1.0], count)[:count], rate_hz)) < 1e-12) == held


@pytest.mark.parametrize(("t_value", "held"), [(2.6, True), (5.0, False)])
def test_a_body_that_creeps_is_not_held(t_value, held):
    time = np.linspace(-1, 1, 40)
    scatter = 1e-5 * np.tile([1.0, -1.0, -1.0, 1.0], 10)
    slope = t_value * 1e-5 / np.sqrt(time @ time)
    assert (np.ptp(rests(slope * time + scatter)) < 1e-12) == held


# Edges


def test_an_edge_is_cut_into_ten_stretches_away_from_sharp_corners():
    assert 30 <= len(stretches_of(BOX.body, PIXEL_M).middle) <= 44

    def cut_px(sides):
        angle = 2 * np.pi * np.arange(sides) / sides
        body = Body("round", 0.3, np.column_stack([np.cos(angle), np.sin(angle)]))
        side = 2 * np.sin(np.pi / sides)
        return (side - stretches_of(body, PIXEL_M).length.reshape(sides, -1)[0].sum()) / PIXEL_M

    assert cut_px(8) == pytest.approx(4.0, rel=1e-6)
    assert cut_px(16) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("off_px", "found"), [(2.6, True), (5.5, False)])
def test_edges_are_found_within_four_pixels(off_px, found):
    start = compose(POSE, off_px * PIXEL_M * np.array([0.8, 0.6, 0.3]))
    fit = observe_outline(picture(BOX, grey=lambda xy: np.full(len(xy), 200.0)), BOX, start)
    near = fit is not None and np.linalg.norm(compose(start, fit.correction)[:2] - POSE[:2]) < 0.3 * PIXEL_M
    assert near == found


LARGE = target(1.8, 1.5)


def beside(pixels):
    """A bright top on a floor; ``pixels`` [px] of body coordinates is how far beyond the box its ends in x lie."""

    def grey(xy):
        left, right = pixels(xy)
        x, y = xy.T
        return np.where((x > -0.6 + left * PIXEL_M) & (x < 0.6 + right * PIXEL_M) & (np.abs(y) < 0.45), 200.0, 90.0)

    return picture(LARGE, grey=grey)


def test_a_bright_line_five_pixels_beside_a_faint_edge_is_out_of_reach():
    def lined(xy):
        off_px = (np.abs(xy) - np.array([0.6, 0.45])).max(axis=1) / PIXEL_M
        return np.select([off_px < 0, off_px > 5], [94.0, 250.0], 90.0)

    fit = observe_outline(picture(LARGE, grey=lined), BOX, POSE)
    assert np.linalg.norm(fit.correction[:2]) < 0.1 * PIXEL_M


@pytest.mark.parametrize(("longer_px", "seen"), [(0.7, True), (1.4, False)])
def test_an_edge_a_pixel_off_is_the_tops_and_a_farther_one_is_not(longer_px, seen):
    """The opposite edge is in its place, so that a top as long as stated would fit one edge alone."""
    fit = observe_outline(beside(lambda _: (0.0, longer_px)), BOX, POSE)
    assert fit.size[0] / PIXEL_M == pytest.approx(longer_px if seen else 0.0, abs=0.1)


@pytest.mark.parametrize(("longer_px", "counts"), [(0.28, False), (0.5, True)])
def test_half_an_end_counts_like_the_whole_opposite_one_where_a_length_is_a_third_of_a_pixel_off(longer_px, counts):
    """With the length as stated, the end of which more is seen says where the middle is."""
    fit = observe_outline(beside(lambda xy: (0.0, np.where(xy[:, 1] < 0.05, longer_px, 15.0))), BOX, POSE)
    assert fit.correction[0] / (longer_px * PIXEL_M) == pytest.approx(0.5 if counts else 0.0, abs=0.1)


def test_two_edges_are_found_two_pixels_and_a_half_off_where_the_others_are_in_their_places():
    fit = observe_outline(beside(lambda _: (2.5, 2.5)), BOX, POSE, wide=True)
    assert fit.correction[0] / PIXEL_M == pytest.approx(2.5, abs=0.15)


def test_a_wide_search_is_not_taken_along_by_two_fifths_of_two_edges_that_stand_half_a_pixel_off():
    def partly(xy):
        off_px = np.where(xy[:, 1] > 0.09, 0.5, 0.0)
        return off_px, off_px

    fit = observe_outline(beside(partly), BOX, POSE, wide=True)
    assert abs(fit.correction[0]) < 0.05 * PIXEL_M


def test_the_place_of_a_top_of_which_one_end_is_seen_is_known_to_half_a_millimetre():
    """With pixels of a millimetre, by which edges are known to a thirtieth: the length, to a millimetre, decides."""
    stretches = stretches_of(BOX.body, 1e-3)
    slopes = np.tile(20 * np.exp(-((stretches.offsets / 1e-3) ** 2)), (len(stretches.middle), 1))
    slopes[stretches.normal[:, 0] < -0.9] = 0.0
    fit = outline._fit_outline(slopes, stretches, 1e-3, np.full(len(slopes), 9.0), 0.25)
    assert 0.4e-3 < np.sqrt(fit.covariance[0, 0]) < 0.7e-3


def test_the_turn_of_a_disc_is_known_to_three_pixels():
    angle = 2 * np.pi * np.arange(60) / 60
    disc = PlanarTarget(Body("disc", 0.3, 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])), BOX.camera, FLOOR)
    bright = picture(disc, grey=lambda xy: np.where(np.hypot(*xy.T) < 0.5, 200.0, 90.0))
    fit = observe_outline(bright, disc, POSE)
    assert 2.0 < np.sqrt(fit.covariance[2, 2]) * 0.5 / PIXEL_M < 4.0


def test_a_click_is_known_to_seven_tenths_of_a_pixel():
    _, covariance, _ = pose_from_clicks(BOX, OUTLINE)
    assert np.sqrt(covariance[0, 0] * len(OUTLINE)) / PIXEL_M == pytest.approx(0.7, rel=0.2)


def edge_std_px(thin_px=9.0, blank=False, floor=0.0):
    """Deviation along x of a fit to a bright box whose right side has a width, whose left edge may be missing."""
    luma = picture(BOX, grey=lambda xy: np.full(len(xy), 200.0))
    stretches = stretches_of(BOX.body, PIXEL_M)
    slopes = outline._edge_slopes(luma, BOX, stretches, POSE)
    slopes += floor * slopes.max(axis=1, keepdims=True)
    slopes[blank & (stretches.normal[:, 0] < -0.9)] = 0.0
    side_px = np.where(stretches.normal[:, 0] > 0.9, thin_px, 9.0)
    fit = outline._fit_outline(slopes, stretches, PIXEL_M, side_px, 0.0, sized=True)
    return np.sqrt(fit.covariance[0, 0]) / PIXEL_M


def test_the_deviation_of_edges_is_that_measured_on_clear_and_faint_ones():
    # 0.064 px a stretch of 12 px, on twenty stretches of 9.3 px; 0.03 px more where the edge stands out by two thirds.
    assert 0.023 < edge_std_px() < 0.033
    assert 0.033 < edge_std_px(floor=0.6) < 0.047


@pytest.mark.parametrize(
    ("thin_px", "blank", "low", "high"), [(4.5, False, 0.023, 0.033), (2.5, False, 0.06, 0.075), (2.5, True, 0.2, 0.4)]
)
def test_a_thin_strip_of_side_shifts_its_edge_which_counts_little(thin_px, blank, low, high):
    assert low < edge_std_px(thin_px, blank) < high


@pytest.mark.parametrize(("distance", "counts"), [(2.2, True), (5.0, False)])
def test_a_fit_far_from_the_others_does_not_count(distance, counts):
    rng = np.random.default_rng(1)
    fits = [OutlineFit(1e-4 * rng.standard_normal(3), 1e-8 * np.eye(3)) for _ in range(30)]
    lone = OutlineFit(np.array([distance * 1.538e-4, 0, 0]), 1e-8 * np.eye(3))
    without = combine_fits(fits).correction
    expected = (30 * without + lone.correction) / 31
    moved = combine_fits([*fits, lone]).correction
    assert (np.abs(moved - expected).max() < 1e-6) == counts


def test_a_quarter_of_the_variance_never_averages_out():
    rng = np.random.default_rng(2)
    fits = [OutlineFit(1e-4 * rng.standard_normal(3), 1e-8 * np.eye(3)) for _ in range(400)]
    assert 0.4 < np.sqrt(combine_fits(fits).covariance[0, 0]) / 1e-4 < 0.6


# KLT


@pytest.fixture(scope="module")
def klt():
    return KltTracker(BOX, picture(BOX), POSE)


def test_klt_points_keep_off_the_edges_and_are_up_to_120():
    points_m = KltTracker(BOX, picture(BOX), POSE).keyframes[0].points_m
    assert 7.0 < depths(SimpleNamespace(points=points_m), BOX).min() / PIXEL_M < 13.0
    large = target(2.4, 1.8)
    assert 90 < len(KltTracker(large, picture(large, grey=texture(finest_m=0.03)), POSE).keyframes[0].points_m) <= 120


@pytest.mark.parametrize(("turn_deg", "keyframes"), [(7.0, 1), (14.0, 2)])
def test_klt_makes_a_keyframe_each_ten_degrees(turn_deg, keyframes):
    tracker = KltTracker(BOX, picture(BOX), POSE)
    turned = POSE + np.array([0.0, 0.0, np.deg2rad(turn_deg)])
    tracker.measure(picture(BOX, turned), turned).learn()
    assert len(tracker.keyframes) == keyframes


@pytest.mark.parametrize(("count", "enough"), [(6, False), (12, True)])
def test_klt_needs_eight_points(count, enough):
    places = np.array([[-0.36, -0.2], [-0.12, -0.2], [0.12, -0.2], [0.36, -0.2]])
    spots = np.concatenate([places + np.array([0.0, row]) for row in (0.0, 0.2, 0.4)])[:count]

    def dots(xy):
        return 120 + 100 * np.exp(-((xy[:, None] - spots) ** 2).sum(axis=2) / (2 * 0.02**2)).sum(axis=1)

    luma = picture(BOX, grey=dots)
    tracker = KltTracker(BOX, luma, POSE)
    assert (tracker.measure(luma, POSE) is not None) == enough


def test_klt_follows_most_points_over_ten_pixels(klt):
    found = klt.measure(picture(BOX), POSE + np.array([10.0 * PIXEL_M, 0.0, 0.0]))
    assert 0.6 < found.inlier_fraction < 0.9


def test_klt_points_are_six_pixels_apart():
    pixels = KltTracker(BOX, picture(BOX), POSE).keyframes[0].pixels
    apart = np.linalg.norm(pixels[:, None] - pixels, axis=2) + 1e9 * np.eye(len(pixels))
    # The refinement moves points by up to three pixels.
    assert 5.0 < np.median(apart.min(axis=1)) < 9.0


@pytest.mark.parametrize(("contrast", "taken"), [(8.5, 0), (12.0, 6)])
def test_klt_takes_corners_of_a_hundredth_of_the_best_one(contrast, taken):
    spots = np.stack(np.meshgrid([-0.4, -0.24, -0.08, 0.08, 0.24, 0.4], [-0.2, 0.0, 0.2]), axis=-1).reshape(-1, 2)
    height = np.where(spots[:, 1] == 0.2, contrast, 100.0)

    def dots(xy):
        return 120 + (height * np.exp(-((xy[:, None] - spots) ** 2).sum(axis=2) / (2 * 0.02**2))).sum(axis=1)

    points = KltTracker(BOX, picture(BOX, grey=dots), POSE).keyframes[0].points_m
    assert (points[:, 1] > 0.1).sum() == taken


def test_klt_states_no_less_than_a_twentieth_of_a_pixel_a_point(klt):
    found = klt.measure(picture(BOX), POSE)
    points = len(klt.keyframes[0].points_m)
    assert 0.035 < np.sqrt(found.covariance[0, 0] * points) / PIXEL_M < 0.08


@pytest.mark.parametrize(("blob_px", "taken"), [(3.0, 6), (5.0, 0)])
def test_klt_measures_corners_over_five_pixels(blob_px, taken):
    """Beside specks of one pixel fainter blobs of 3 px are corners, and those of 5 px have too little of one."""
    spots = np.stack(np.meshgrid([-0.4, -0.24, -0.08, 0.08, 0.24, 0.4], [-0.2, 0.0, 0.2]), axis=-1).reshape(-1, 2)
    faint = spots[:, 1] == 0.2
    height, width_m = np.where(faint, 30.0, 100.0), np.where(faint, blob_px, 1.0) * PIXEL_M

    def dots(xy):
        return 120 + (height * np.exp(-((xy[:, None] - spots) ** 2).sum(axis=2) / (2 * width_m**2))).sum(axis=1)

    points = KltTracker(BOX, picture(BOX, grey=dots), POSE).keyframes[0].points_m
    assert (points[:, 1] > 0.1).sum() == taken


@pytest.mark.parametrize("length_px", [40, 60, 100])
def test_klt_magnifies_a_body_to_a_hundred_pixels_or_somewhat_more(length_px):
    own = target(0.8 * length_px * PIXEL_M, 0.6 * length_px * PIXEL_M)
    luma = picture(own, grey=texture(finest_m=3 * PIXEL_M))
    tracker = KltTracker(own, luma, POSE)
    corners = tracker._into_crop(own.pixels(own.body.top_corners_m, POSE), np.zeros(2))
    assert 90 < np.linalg.norm(corners[2] - corners[0]) < 160


@pytest.mark.parametrize(("contrast", "left_px"), [(0.5, 0.01), (0.1, 0.06), (0.05, 0.14)])
def test_klt_ends_its_steps_where_a_twentieth_of_a_pixel_is_left_of_a_dot_faded_to_a_tenth(contrast, left_px):
    """A step is as much too short as the dot is too faint: 30 of them are enough down to a twentieth."""
    u, v = np.meshgrid(np.arange(120), np.arange(120))

    def dot(at, height):
        return np.round(20 + height * np.exp(-((u - at) ** 2 + (v - 60) ** 2) / (2 * 3.0**2))).astype(np.uint8)

    start = np.array([[[60.0, 60.0]]], dtype=np.float32)
    found, there = _flow(dot(60, 200), dot(63, 200 * contrast), start, start)
    assert there.all()
    assert np.linalg.norm(found[0, 0] - [63, 60]) < left_px


@pytest.mark.parametrize(("contrast", "all_count"), [(0.57, True), (0.5, False)])
def test_klt_points_lose_their_way_back_from_half_the_contrast(klt, contrast, all_count):
    """There the way back is of steps twice as long as the distance, which do not end within the rounds."""
    faded = picture(BOX, grey=texture(contrast=30 * contrast))
    found = klt.measure(faded, POSE + np.array([3.0 * PIXEL_M, 0.0, 0.0]))
    assert (found.inlier_fraction > 0.88) == all_count


# Relocalisation


@pytest.mark.parametrize(("scale", "found"), [(1.04, True), (1.09, False)])
def test_a_body_keeps_its_size(scale, found):
    grey = texture(finest_m=0.1)
    finder = Relocaliser(BOX, picture(BOX, grey=grey), POSE)
    larger = target(1.2 * scale, 0.9 * scale)
    assert (finder.find(picture(larger, grey=lambda xy: grey(xy / scale))) is not None) == found


def finds(places_m, seen_m):
    """Whether a body is found by features at places of it [m] that a picture shows at others [m]."""
    finder = Relocaliser(BOX, picture(BOX), POSE)
    own = 200 * np.eye(len(places_m), 128, dtype=np.float32)
    finder._keyframe, finder._kept = (places_m, own), (finder.target.floor, np.zeros(2), None)
    finder._features = lambda *_: (seen_m / finder.cell_m, own)
    return finder.find(None) is not None


@pytest.mark.parametrize("others", [0, 12])
@pytest.mark.parametrize(("agreeing", "found"), [(5, False), (8, True)])
def test_a_body_is_found_by_six_features_that_agree(agreeing, others, found):
    rng = np.random.default_rng(0)
    places_m = rng.uniform(-0.5, 0.5, (agreeing + others, 2))
    seen_m = transform([3.0, 2.0, 0.7], places_m)
    seen_m[agreeing:] = rng.uniform(0.0, 6.0, (others, 2))
    assert finds(places_m, seen_m) == found


@pytest.mark.parametrize(("off_cells", "found"), [(2.2, True), (4.2, False)])
def test_a_feature_agrees_within_three_cells(off_cells, found):
    """Of six, five on a ring agree exactly, and the one in the middle is off."""
    around = 2 * np.pi * np.arange(5) / 5
    places_m = np.concatenate([0.4 * np.stack([np.cos(around), np.sin(around)], axis=1), np.zeros((1, 2))])
    seen_m = transform([3.0, 2.0, 0.7], places_m)
    seen_m[5, 0] += off_cells * Relocaliser(BOX, picture(BOX), POSE).cell_m
    assert finds(places_m, seen_m) == found


def features(response, size):
    """Features that a finder takes from a picture of so many cells, and the sizes of the parts that it looks at.

    Each part shows features of the given responses, stronger ones farther right.
    """
    finder, parts = Relocaliser(BOX, picture(BOX), POSE), []
    points = [cv2.KeyPoint(90 * float(each), 50.0, 5.0, 0.0, float(each)) for each in response]

    def look(view, _):
        parts.append(view.size)
        return points, np.zeros((len(points), 128), np.float32)

    finder.detector = SimpleNamespace(detectAndCompute=look, descriptorSize=lambda: 128)
    return finder._features(picture(BOX), np.zeros((size, size, 2), np.float32))[0], parts


@pytest.mark.parametrize(("shown", "all_kept"), [(2000, True), (4500, False)])
def test_the_strongest_three_thousand_features_of_a_picture_are_kept(shown, all_kept):
    places, _ = features(np.random.default_rng(0).permutation(shown) / shown, 100)
    assert (len(places) == shown) == all_kept
    assert places[0, 0] == pytest.approx(90 * (shown - 1) / shown)
    assert (np.diff(places[:, 0]) < 0).all()


def test_tiles_take_less_than_a_hundred_megabytes_and_two_thirds_more_work_than_the_picture():
    _, parts = features([], 1600)
    assert 300 * max(parts) < 100e6
    assert 1600**2 <= sum(parts) < 1.67 * 1600**2


def cells(finder):
    """Cells along x of the whole rectified picture."""
    return finder._rectified[1].shape[1]


def test_the_rectified_picture_has_cells_of_a_fraction_of_the_body_but_not_of_a_pixel():
    camera, floor = ceiling((1280, 960), 1200.0)
    luma = np.zeros((960, 1280), np.uint8)
    large, small = (PlanarTarget(Body("box", 0.3, rectangle(x, 0.8 * x)), camera, floor) for x in (1.2, 0.05))
    assert 120 < 1.2 / Relocaliser(large, luma, POSE).cell_m < 220
    assert 18 < 1.2 / Lookalikes(large, luma, POSE).cell_m < 33
    for finder in (Relocaliser(small, luma, POSE), Lookalikes(small, luma, POSE)):
        assert 0.5 < finder.cell_m / small.metres_per_pixel(POSE) < 1.0
    assert 1200 < cells(Relocaliser(small, luma, POSE)) < 1700
    assert 300 < cells(Lookalikes(small, luma, POSE)) < 550


@pytest.fixture(scope="module")
def lookalikes():
    return Lookalikes(BOX, picture(BOX), POSE)


def candidate(correlation, x, light=(100.0, 20.0)):
    return Candidate(correlation, np.array([x, 0.0, 0.0]), np.array(light))


@pytest.mark.parametrize(
    ("other", "rival"),
    [
        (candidate(0.8, 3.0), False),
        (candidate(0.9, 3.0), True),
        (candidate(0.9, 3.0, (140.0, 20.0)), True),
        (candidate(0.9, 3.0, (100.0, 40.0)), False),
        (candidate(0.9, 0.2), False),
    ],
)
def test_a_rival_correlates_nearly_as_well_in_much_the_same_light(lookalikes, other, rival):
    assert len(lookalikes.rivals([candidate(1.0, 0.0), other], np.zeros(3))) == rival


def test_some_dozen_rivals_are_enough(lookalikes):
    others = [candidate(0.95, 2.0 * k) for k in range(1, 40)]
    assert 8 <= len(lookalikes.rivals([candidate(1.0, 0.0), *others], np.zeros(3))) <= 16


def test_headings_are_tried_finely_enough(lookalikes):
    turned = POSE + np.array([0.3, 0.1, np.deg2rad(37.5)])
    best = lookalikes.candidates(picture(BOX, turned))[0]
    turn = np.rad2deg(best.pose[2] - turned[2] + np.pi) % 360 - 180
    assert abs(turn) < 5
    assert best.correlation > 0.8


@pytest.mark.parametrize(("wave_cells", "alike"), [(3.0, True), (6.0, False)])
def test_what_differs_only_in_waves_of_three_cells_looks_alike(lookalikes, wave_cells, alike):
    def waves(length_m, seed):
        heading, phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, 6))
        vector = 2 * np.pi / length_m * np.stack([np.cos(heading), np.sin(heading)])
        return lambda xy: 9 * np.cos(xy @ vector + phase).sum(axis=-1)

    common, own, others = waves(0.6, 0), *(waves(wave_cells * lookalikes.cell_m, seed) for seed in (1, 2))
    luma = picture(BOX, grey=lambda xy: 120 + common(xy) + own(xy))
    search = Lookalikes(BOX, luma, POSE)
    stranger = picture(BOX, grey=lambda xy: 120 + common(xy) + others(xy))
    best = [search.candidates(each)[0].correlation for each in (stranger, luma)]
    assert (best[0] > 0.85 * best[1]) == alike


def test_headings_go_all_around_in_steps_of_one_or_two_cells_at_the_rim(lookalikes):
    headings = np.array([heading for heading, *_ in lookalikes._templates])
    steps = np.diff([*headings, headings[0] + 2 * np.pi])
    rim_cells = steps * lookalikes.target.reach_m / lookalikes.cell_m
    assert rim_cells.min() > 1.2
    assert rim_cells.max() < 2.4


@pytest.mark.parametrize(("left", "tried"), [(0.3, 60), (0.49, 60), (0.51, 3), (0.8, 3)])
def test_light_is_evened_in_every_picture_only_where_that_helps(monkeypatch, left, tried):
    """Bands of mains light leave a third of the deviation, noise most of it: then it is tried every 25 pictures."""
    camera, floor = ceiling((480, 270), focal_px=390.0)
    luma = np.random.default_rng(0).integers(0, 255, (270, 480)).astype(np.uint8)
    body = Body("rover", 0.4, [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
    motion = CameraMotion(camera, floor, luma, [body], [np.zeros(3)])
    counted = []

    def registered(std_px):
        return Registered(np.zeros(9), 1e-9 * np.eye(9), std_px)

    def even(*_):
        counted.append(None)
        return registered(0.08 * left)

    monkeypatch.setattr(motion, "_average", lambda: None)
    monkeypatch.setattr(motion.watch.as_it_is, "register", lambda *_: registered(0.08))
    motion.watch.in_even_light = SimpleNamespace(template=luma, register=even)
    for time_s in range(61):
        motion.register(float(time_s), luma, [np.zeros(3)])
    assert motion.registered == 60
    assert len(counted) == tried


def test_light_over_an_eighth_of_the_picture_is_evened_and_texture_over_a_thirtieth_stays():
    """Of three waves along a picture, each in parts of what it was, as the finest one."""
    width, cycles = 960, np.array([8, 30, 60])
    along = 2 * np.pi * np.outer(cycles, np.arange(width)) / width
    size = np.array([20.0, 6.0, 6.0])
    seen = evened(np.tile(np.round(128 + size @ np.sin(along)), (240, 1)).astype(np.uint8))[120] - 128.0
    left = np.hypot(np.sin(along) @ seen, np.cos(along) @ seen) / size
    light, texture, fine = left
    assert light < 0.3 * fine
    assert texture > 0.9 * fine


@pytest.mark.parametrize(("shift_px", "codes"), [(0.2, []), (0.4, ["camera_moved"])])
def test_a_motion_of_the_camera_is_reported_from_three_tenths_of_a_pixel_on(shift_px, codes):
    as_it_is = SimpleNamespace(shift_px=lambda motion: motion[0], std_px=lambda covariance: 0.02)
    watching = SimpleNamespace(watched=True, registered=9, watch=SimpleNamespace(as_it_is=as_it_is))
    motion = np.linspace(0.0, shift_px, 10)[:, None]
    found = SimpleNamespace(
        time_s=0.1 * np.arange(10), known=np.ones(10, dtype=bool), scattered_px=0.0, motion=motion, common=np.eye(1)
    )
    assert [each.code for each in CameraMotion.findings(watching, found)] == codes


@pytest.mark.parametrize(("deviations", "by_itself"), [(3.0, False), (5.0, True)])
def test_a_picture_disagrees_by_itself_from_four_deviations_on(deviations, by_itself):
    apart, expected = np.zeros((3, 3)), np.tile(1e-6 * np.eye(3), (3, 1, 1))
    apart[1, 0] = 1e-3 * deviations
    assert two_measurements.alone(apart, expected).any() == by_itself


def test_places_of_an_outline_are_one_where_less_than_five_pixels_apart():
    pixel_m, along_px = 1e-3, np.array([0.0, 4.0, 7.0])
    poses = [np.array([pixel_m * at, 0.0, 0.0]) for at in along_px]
    level = SimpleNamespace(cell_m=1e-4, places=lambda headings: [(1.0 - 100 * pose[0], pose) for pose in poses])
    search = SimpleNamespace(
        levels=[level], order=1, target=SimpleNamespace(reach_m=0.01), pixel_m=pixel_m,
        sharpened=lambda pose, cell_m: (1.0 - 100 * pose[0], pose), apart_m=lambda a, b: abs(a[0] - b[0]),
    )  # fmt: skip
    search._distinct = lambda found, apart_m: OutlineSearch._distinct(search, found, apart_m)
    found = OutlineSearch.found(search, 0.0, 0.1, 9)
    assert [round(pose[0] / pixel_m) for _, pose in found] == [0, 7]


def test_some_twenty_places_of_an_outline_are_followed():
    search = SimpleNamespace(apart_m=lambda a, b: abs(a[0] - b[0]))
    places = [(1.0 - 0.001 * i, np.array([float(i), 0.0, 0.0])) for i in range(60)]
    assert 15 < len(OutlineSearch._distinct(search, places, 0.5)) < 30


@pytest.mark.parametrize(("share", "followed"), [(0.7, True), (0.4, False)])
def test_places_of_an_outline_are_followed_from_six_tenths_of_the_best_score_on(share, followed):
    search = SimpleNamespace(apart_m=lambda a, b: abs(a[0] - b[0]))
    places = [(0.8 * (share if i else 1.0), np.array([float(i), 0.0, 0.0])) for i in range(8)]
    assert (len(OutlineSearch._distinct(search, places, 0.5)) == 8) == followed


@pytest.mark.parametrize(("levels", "low", "high"), [(1, 22, 34), (2, 34, 46), (30, 34, 46)])
def test_evened_texture_has_a_deviation_of_forty_grey_levels_but_rounding_is_not_raised_to_it(levels, low, high):
    """Stripes of four pixels in 28: one grey level of them has a deviation of 0.35, as what rounding leaves."""
    stripes = np.where(np.arange(960) % 28 < 4, 128 + levels, 128)
    assert low < np.std(evened(np.tile(stripes, (240, 1)).astype(np.uint8))) < high


@pytest.fixture
def one_round(monkeypatch):
    """A single round with all points, which goes all the way from where it begins."""
    kernel = alignment._align_kernel

    def once(*given):
        rule = given[6]
        return kernel(*given[:6], (*rule[:3], 1, *rule[4:]), *given[7:])

    monkeypatch.setattr(alignment, "_align_kernel", once)


@pytest.mark.parametrize(("off_px", "converged"), [(0.045, True), (0.09, False)])
def test_an_alignment_has_converged_when_it_moves_by_less_than_a_sixteenth_of_a_pixel(one_round, off_px, converged):
    template = make_template(picture(BOX), BOX, POSE)
    start = compose(POSE, np.array([off_px * template.pixel_m, 0.0, 0.0]))
    found = align(picture(BOX), template, np.ones(len(template.points)), start, BOX, 20.0, wide=True)
    assert found.converged == converged


@pytest.mark.parametrize(("hidden", "near"), [(0.17, True), (0.35, False)])
def test_the_first_quarter_of_the_points_brings_the_pose_near(one_round, hidden, near):
    """They are an even choice of all; where just these are hidden the pose stays where it begins."""
    template = make_template(picture(BOX), BOX, POSE)
    seen = (np.arange(len(template.points)) >= hidden * len(template.points)).astype(float)
    start = compose(POSE, np.array([1.0 * template.pixel_m, 0.0, 0.0]))
    assert align(picture(BOX), template, seen, start, BOX, 20.0).converged == near


@pytest.mark.parametrize(("off_px", "converged"), [(6.0, True), (8.0, False)])
def test_a_wide_alignment_of_a_target_as_faint_as_half_its_noise_converges_from_six_pixels(off_px, converged):
    """After 33 rounds; from eight pixels off it would take 54."""
    assert converges(4.0, 2, off_px, wide=True) == converged
