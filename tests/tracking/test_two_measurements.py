"""Texture and outline: two measurements of one pose."""

from types import SimpleNamespace

import numpy as np
import pytest
from painted import POSE, picture, target, texture

from towval.model.geometry import compose, inverse, turned_covariance
from towval.tracking import two_measurements
from towval.tracking.finished_track import finished, with_outline
from towval.tracking.follow import Follower
from towval.tracking.outline import OutlineFit
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.pose import Measurement, Tracker, step_between
from towval.tracking.two_measurements import (
    Compared,
    EdgeWatch,
    Looks,
    alone,
    compared,
    jumps,
    outline_noise,
    steps_to_outline,
    steps_to_smoother,
    texture_excess,
)

BOX = target()
PIXEL_M = BOX.metres_per_pixel(POSE)
GREY = texture(mean=200.0, contrast=10.0)
SHARP = np.diag([1e-4, 1e-4, 1e-4]) ** 2


def looks(picture_numbers, correction, std=1e-4, size=0.0):
    n = len(picture_numbers)
    return Looks(
        np.asarray(picture_numbers),
        np.asarray(correction, dtype=float),
        np.tile(std**2 * np.eye(3), (n, 1, 1)),
        np.zeros((n, 2)) + size,
    )


def test_a_covariance_turns_with_the_frame():
    turned = turned_covariance(np.diag([4.0, 1.0, 9.0]), np.array([0.0, np.pi / 2]))
    assert turned[0] == pytest.approx(np.diag([4.0, 1.0, 9.0]))
    assert turned[1] == pytest.approx(np.diag([1.0, 4.0, 9.0]))


def test_what_two_measurements_disagree_by_is_the_deviation_of_one_around_that_time():
    time_s, expected = np.arange(200) / 25, np.tile(1e-8 * np.eye(3), (200, 1, 1))
    apart = np.random.default_rng(1).normal(0, 1e-4, (200, 3))
    apart[50:100, 0] += 2e-3
    excess = texture_excess(time_s, apart, expected, looks(np.arange(200), apart))
    assert np.sqrt(excess[75, 0, 0]) == pytest.approx(2e-3, rel=0.1)
    assert excess[75, 1, 1] < 0.01 * excess[75, 0, 0]
    assert not excess[:30].any()
    assert not excess[120:].any()


def test_a_disagreement_counts_for_half_a_second_around_it():
    time_s, expected, apart = np.arange(200) / 25, np.tile(1e-8 * np.eye(3), (200, 1, 1)), np.zeros((200, 3))
    apart[100:125, 0] = 5e-3
    counted = texture_excess(time_s, apart, expected, looks(np.arange(200), apart))[:, 0, 0] > 0
    assert np.flatnonzero(counted)[[0, -1]] == pytest.approx([100 - 12, 124 + 12], abs=1)


@pytest.mark.parametrize(("deviations", "counts"), [(2.5, False), (4.0, True)])
def test_many_looks_at_the_same_edges_are_no_more_than_one(deviations, counts):
    apart = np.tile([deviations * 1e-4, 0, 0], (100, 1))
    expected = np.tile(1e-8 * np.eye(3), (100, 1, 1))
    excess = texture_excess(np.arange(100) / 25, apart, expected, looks(np.arange(100), apart))
    assert excess.any() == counts


def test_a_single_picture_that_disagrees_counts_by_itself():
    apart = np.array([[0, 1e-3, 0], [0, 3e-4, 0]])
    excess = alone(apart, np.tile(1e-8 * np.eye(3), (2, 1, 1)))
    assert np.sqrt(excess[0, 1, 1]) == pytest.approx(1e-3, rel=0.01)
    assert not excess[1].any()


def test_what_the_outline_adds_is_in_the_frame_of_the_body():
    pose, own = np.array([[1.0, 2.0, np.pi / 2], [0.0, 0.0, 0.0]]), np.diag([1e-6, 1e-6, 1e-6])
    excess, lone = np.zeros((2, 3, 3)), np.zeros((2, 3, 3))
    excess[0, 0, 0], lone[1, 0, 0] = 4e-6, 9e-6
    widened = Compared(excess, lone, np.zeros((2, 3)), np.zeros((2, 3, 3)), SHARP, excess).widened(
        pose, np.array([own, own])
    )
    assert np.diagonal(widened, axis1=1, axis2=2) == pytest.approx(np.array([[1, 5, 1], [10, 1, 1]]) * 1e-6)


@pytest.mark.parametrize("jerk_m", [0.0, 2e-3])
def test_noise_of_the_outline_is_found_through_any_motion(jerk_m):
    rng, n = np.random.default_rng(2), 400
    time_s = np.arange(n) / 25
    pose = np.zeros((n, 3))
    pose[:, 0] = 0.1 * time_s + jerk_m * rng.standard_normal(n)
    noisy = 3e-4 * rng.standard_normal((n, 3))
    for seen, factor in ((looks(np.arange(n), noisy), 9), (looks(np.arange(0, n, 5), noisy[::5]), 1)):
        assert outline_noise(pose, seen, *jumps(time_s, pose, seen)) == pytest.approx(factor, rel=0.3)


class Lying(Tracker):
    """Finds the texture where it is, or beside that by ``lie``."""

    def __init__(self):
        self.at, self.lie = POSE, np.zeros(3)

    def measure(self, luma, predicted, velocity=None):
        return Measurement(compose(self.at, self.lie), SHARP)


def test_the_outline_is_looked_at_in_each_fifth_picture_and_in_all_while_it_disagrees(monkeypatch):
    watch, tracker, looked = EdgeWatch(BOX), Lying(), []
    off = np.zeros(3)
    monkeypatch.setattr(
        two_measurements,
        "observe_outline",
        lambda luma, own, pose, wide=False: looked.append(now) or OutlineFit(off, SHARP),
    )

    def see(i):
        nonlocal now
        now = i
        return watch.look(i, i / 25, None, Measurement(POSE, SHARP), POSE, tracker, False)

    now = 0
    for i in range(50):
        _, _, apart = see(i)
        assert not apart
    assert np.diff(looked).tolist() == [5] * 9
    off, looked[:] = np.array([3 * PIXEL_M, 0, 0]), []
    for i in range(50, 60):
        see(i)
    assert sorted(set(looked)) == list(range(54, 60))


@pytest.mark.parametrize("turns", [0, 1])
@pytest.mark.parametrize(("without", "is_found"), [(0.9, True), (4.4, True), (6, False)])
def test_an_outline_is_looked_for_where_the_last_ones_lead(monkeypatch, without, is_found, turns):
    """A texture that went astray takes the prediction with it, beyond the reach of the outline's search.

    The heading of the last pose may be told by a full turn more.
    """
    watch, tracker, true = EdgeWatch(BOX), Lying(), POSE

    def near(_luma, own, pose, wide=False):
        return OutlineFit(step_between(pose, true), SHARP) if own.apart_m(pose, true) < 4 * PIXEL_M else None

    monkeypatch.setattr(two_measurements, "observe_outline", near)
    for i in [*range(10), 9 + without]:
        true = compose(POSE, np.array([PIXEL_M * i, 0, 0])) + np.array([0, 0, 2 * np.pi * turns * (i > 8)])
        tracker.at = compose(true, np.array([6 * PIXEL_M * (i > 9), 0, 0]))
        found, fit, apart = watch.look(i, i / 25, None, Measurement(tracker.at, SHARP), tracker.at, tracker, True)
    assert apart == is_found
    if is_found:
        assert compose(found.pose, fit.correction) == pytest.approx(true, abs=1e-9)
    else:
        assert fit is None


@pytest.mark.parametrize(("left_over", "taken"), [(1.9, True), (2.1, False)])
def test_a_texture_that_fits_far_worse_at_the_outline_stays_where_it_was(monkeypatch, left_over, taken):
    watch, tracker = EdgeWatch(BOX), Lying()
    elsewhere = compose(POSE, np.array([3 * PIXEL_M, 0, 0]))
    monkeypatch.setattr(
        two_measurements, "observe_outline",
        lambda _luma, _own, pose, wide=False: OutlineFit(step_between(pose, elsewhere), SHARP),
    )  # fmt: skip
    monkeypatch.setattr(tracker, "measure", lambda *_: Measurement(elsewhere, SHARP, residual=left_over))
    found, _, apart = watch.look(0, 0.0, None, Measurement(POSE, SHARP, residual=1.0), POSE, tracker, True)
    assert found.pose == pytest.approx(elsewhere if taken else POSE)
    assert apart != taken


def test_an_outline_that_hops_between_two_edges_does_not_take_the_texture_along(monkeypatch):
    class NearSighted(Lying):
        """Finds the body within three pixels; elsewhere something that fits badly."""

        def measure(self, luma, predicted, velocity=None):
            near = BOX.apart_m(predicted, self.at) < 3 * PIXEL_M
            return Measurement(self.at if near else predicted, SHARP, residual=1.0 if near else 10.0)

    tracker, luma = NearSighted(), picture(BOX, grey=GREY)
    follower = Follower(BOX, 0.0, luma, BOX.pixels(BOX.body.top_corners_m, POSE), lambda *_: tracker, 0.2)
    hopped = OutlineFit(np.array([8 * PIXEL_M, 0, 0]), SHARP)

    def look(_watch, number, _time_s, _luma, found, *_):
        return (found, hopped, True) if number == 20 else (found, None, False)

    monkeypatch.setattr(EdgeWatch, "look", look)
    for i in range(1, 30):
        tracker.at = compose(POSE, np.array([1e-3 * i, 0, 0]))
        follower.follow(i / 25, luma)
    track = finished(follower.followed(), "scripted")
    true = np.array([compose(POSE, np.array([1e-3 * i, 0, 0])) for i in range(30)])
    assert track.seen.all()
    assert np.linalg.norm((track.pose - true)[:, :2], axis=1).max() < 0.2 * PIXEL_M


def followed(lies):
    """A box on its way whose texture lies in some pictures: how far it is off [px], the deviations, the findings."""
    tracker, luma = Lying(), picture(BOX, grey=GREY)
    corners = BOX.pixels(BOX.body.top_corners_m, POSE)
    follower = Follower(BOX, 0.0, luma, corners, lambda *_: tracker, 0.2)
    follower.relocaliser = SimpleNamespace(find=lambda _: None)
    follower.lookalikes = SimpleNamespace(candidates=lambda _: [], rivals=lambda *_: [], twins=[])
    for i in range(1, 130):
        moved = compose(POSE, np.array([1e-3 * i, 0, 0]))
        tracker.at = moved
        tracker.lie = np.array([1.5 * PIXEL_M * (i in lies), 0, 0])
        follower.follow(i / 25, picture(BOX, moved, GREY))
    track = finished(follower.followed(), "scripted")
    true = np.array([compose(POSE, np.array([1e-3 * i, 0, 0])) for i in range(130)])
    off_px = np.linalg.norm((track.pose - true)[:, :2], axis=1) / PIXEL_M
    std_px = np.sqrt(np.trace(track.covariance[:, :2, :2], axis1=1, axis2=2)) / PIXEL_M
    return off_px, std_px, {found.code for found in track.findings}


def test_a_texture_that_lies_is_as_uncertain_as_the_edges_say_and_reported():
    off_px, std_px, codes = followed(range(60, 100))
    assert std_px[70:90].min() > 1
    assert off_px.max() < 0.3
    assert std_px[:40].max() < 0.3
    assert "texture_unsure" in codes


def test_a_texture_that_jumps_in_one_picture_is_uncertain_there():
    off_px, std_px, codes = followed([80])
    assert off_px[80] < 0.3
    assert std_px[80] > 0.5
    assert np.delete(std_px, 80).max() < 0.3
    assert "texture_unsure" not in codes


@pytest.mark.parametrize(("says", "wide"), [(True, 0.0), (True, 0.0015), (False, 0.0)])
def test_an_outline_that_is_too_wide_is_off_itself(says, wide):
    """One of two edges is taken for something 4 mm beside it, for a second: the middle moves by half, the width by all.

    A top that is ``wide`` in all pictures was measured wrong, and says nothing.
    """
    rng = np.random.default_rng(4)
    n, time_s = 200, np.arange(200) / 25
    pose = np.column_stack([0.1 * time_s, 0 * time_s, 0 * time_s])
    correction, size = rng.normal(0, 1e-4, (n, 3)), rng.normal(wide, 2e-4, (n, 2))
    other = slice(80, 105)
    correction[other, 1] += 2e-3
    if says:
        size[other, 1] += 4e-3
    seen = compared(time_s, pose, np.tile(SHARP, (n, 1, 1)), looks(np.arange(n), correction, size=size), SHARP)
    worst = np.sqrt((seen.excess + seen.lone)[:, 1, 1].max())
    assert (worst < 1e-4) == says
    assert says or worst == pytest.approx(2e-3, rel=0.2)


def motions(off_of, seed=6):
    """Looks at a body that brakes and turns; texture or outline is off by a wave of 2 mm for two of eight seconds."""
    rng, time_s = np.random.default_rng(seed), np.arange(200) / 25
    truth = np.column_stack([0.3 * time_s - 0.02 * time_s**2, 0.1 * np.sin(time_s), 0.4 * time_s])
    texture, outline = (compose(truth, rng.normal(0, std, (200, 3))) for std in (2e-5, 1e-4))
    wave = np.zeros((200, 3))
    wave[80:130, 1] = 2e-3 * np.sin(np.arange(50) / 1.5)
    texture, outline = (
        compose(each, wave) if name == off_of else each for name, each in (("texture", texture), ("outline", outline))
    )
    correction = compose(inverse(texture), outline)
    seen = compared(
        time_s, texture, np.tile(2e-5**2 * np.eye(3), (200, 1, 1)), looks(np.arange(200), correction), SHARP
    )
    return truth, texture, compose(texture, seen.steps), seen


def test_a_texture_that_wanders_gives_way_to_a_smooth_outline():
    truth, texture, pose, seen = motions("texture")
    before, after = (np.sqrt(np.mean((each - truth)[85:125, :2] ** 2)) for each in (texture, pose))
    assert after < 0.2 * before
    assert np.array_equal(pose[:60], texture[:60])
    assert seen.excess[100, 1, 1] > 1e-3**2
    assert np.sqrt(seen.of_steps[100, 1, 1]) == pytest.approx(np.hypot(1e-4, 1e-4), rel=0.2)


@pytest.mark.parametrize("off_of", ["outline", "neither"])
def test_an_outline_that_wanders_moves_no_pose(off_of):
    _, texture, pose, _ = motions(off_of)
    assert np.array_equal(pose, texture)


@pytest.mark.parametrize(
    ("off_of", "strayed_m"), [("outline", 2e-3 * np.sqrt(50 / 200 / 2)), ("texture", 0), ("neither", 0)]
)
def test_an_outline_that_strayed_for_a_while_may_have_done_so_in_the_first_picture(off_of, strayed_m):
    *_, seen = motions(off_of)
    assert np.sqrt(np.diag(seen.strayed)) == pytest.approx([0, strayed_m, 0], rel=0.2, abs=1e-4)


@pytest.mark.parametrize("slips_m", [0.0, 16e-3])
def test_an_outline_that_hops_from_picture_to_picture_is_off_itself_and_hides_no_texture_that_slips(slips_m):
    """Of two edges 5 mm apart now this and now that is found; the texture of a still body slips away for a second."""
    rng, n = np.random.default_rng(7), 200
    time_s, pose = np.arange(n) / 25, np.zeros((n, 3))
    hops = np.zeros((n, 3))
    hops[60:140, 1] = 5e-3 * (np.arange(80) // 3 % 4 == 0)
    pose[90:115, 1] = slips_m * np.sin(np.pi * np.arange(25) / 25)
    correction = compose(inverse(pose), compose(hops, rng.normal(0, 5e-4, (n, 3))))
    seen = compared(time_s, pose, np.tile(SHARP, (n, 1, 1)), looks(np.arange(n), correction, std=5e-4), SHARP)
    worst_m = np.sqrt(seen.excess[:, 1, 1].max())
    assert worst_m == 0 if slips_m == 0 else worst_m > slips_m / 2
    assert np.sqrt(seen.hops[100, 1, 1]) > 5e-4
    assert np.sqrt(seen.strayed[1, 1]) > 1e-3


@pytest.mark.parametrize(("hop_px", "codes"), [(0.0, set()), (2.0, {"edges_unsure", "texture_unsure"})])
def test_a_registration_is_as_uncertain_as_its_outlines_stray(hop_px, codes):
    """From the middle on, other edges are taken for those of the top: nobody knows which were right in the first."""
    pose = np.column_stack([0.03 * np.arange(120) / 25, np.zeros((120, 2))])
    correction = np.zeros((120, 3))
    correction[60:, 0] = hop_px * PIXEL_M
    corners = BOX.pixels(BOX.body.top_corners_m, POSE)
    follower = Follower(BOX, 0.0, picture(BOX, grey=GREY), corners, lambda *_: Lying(), 0.2)
    follower.edge_watch.looks = lambda: looks(np.arange(120), correction)
    _, _, fit, findings = with_outline(follower.followed(), np.arange(120) / 25, pose, np.tile(SHARP, (120, 1, 1)))
    assert {found.code for found in findings} == codes
    assert np.sqrt(fit.covariance[0, 0]) / PIXEL_M == pytest.approx(hop_px / 2, abs=0.1)


def test_too_few_looks_tell_nothing_of_smoothness():
    time_s, few = np.arange(9) / 25, np.tile([2e-3, 0, 0], (9, 1)) * (-1.0) ** np.arange(9)[:, None]
    pose = np.column_stack([0.1 * time_s, 0 * time_s, 0 * time_s])
    covariance = np.tile(SHARP, (9, 1, 1))
    steps, spread = steps_to_smoother(time_s, pose, looks(np.arange(9), few), few, covariance, np.full(9, 20.0))
    assert not steps.any()
    assert not spread.any()


def test_a_heading_that_edges_leave_open_stays():
    apart = np.tile([1e-3, 0.0, 0.5], (40, 1))
    steps, spread = steps_to_outline(apart, np.tile(np.diag([1e-8, 1e-8, 1e4]), (40, 1, 1)))
    assert steps[:, 0] == pytest.approx(1e-3, rel=0.02)
    assert np.abs(steps[:, 2]).max() < 1e-3
    assert np.sqrt(spread[:, 0, 0]) == pytest.approx(1e-4, rel=0.02)
    assert np.sqrt(spread[:, 2, 2]).max() < 1e-2


def rough(texture_std, far):
    """Steps of a body at rest whose texture and outline scatter, the outline by 0.1 mm."""
    rng, n = np.random.default_rng(8), 600
    texture, outline = rng.normal(0, texture_std, (n, 3)), rng.normal(0, 1e-4, (n, 3))
    apart = compose(inverse(texture), outline)
    seen = looks(np.arange(n), apart)
    return steps_to_smoother(np.arange(n) / 25, texture, seen, apart, np.tile(SHARP, (n, 1, 1)), np.full(n, far))[0]


@pytest.mark.parametrize(("ratio", "followed"), [(1.4, False), (2.8, True)])
def test_an_outline_is_followed_that_is_smoother_by_half(ratio, followed):
    assert rough(np.sqrt(ratio) * 1e-4, 5.0).any() == followed


@pytest.mark.parametrize(("far", "followed"), [(1.2, False), (2.0, True)])
def test_two_have_parted_from_one_and_a_half_deviations_on(far, followed):
    assert rough(1e-3, far).any() == followed


@pytest.mark.parametrize(("std_px", "sure"), [(0.1, True), (0.22, False)])
def test_an_outline_known_to_a_seventh_of_a_pixel_is_sought_no_farther(monkeypatch, std_px, sure):
    """Where the body was predicted, two pixels aside, are edges that are even surer."""
    aside = compose(POSE, np.array([2 * PIXEL_M, 0, 0]))

    def nearest(_luma, own, pose, wide=False):
        near = own.apart_m(pose, POSE) < PIXEL_M
        return OutlineFit(np.zeros(3), ((std_px if near else 0.02) * PIXEL_M) ** 2 * np.eye(3))

    monkeypatch.setattr(two_measurements, "observe_outline", nearest)
    _, fit, _ = EdgeWatch(BOX).look(0, 0.0, None, Measurement(POSE, np.eye(3)), aside, Lying(), True)
    assert fit.correction[0] / PIXEL_M == pytest.approx(0 if sure else 2, abs=1e-6)


@pytest.mark.parametrize(("moved_px", "looked"), [(0.35, [5]), (0.7, [2, 3, 4, 5, 6])])
def test_a_body_that_left_its_rest_by_half_a_pixel_is_looked_at_closely(monkeypatch, moved_px, looked):
    """At rest, each fifth picture is enough."""
    watch, seen = EdgeWatch(BOX), []
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: OutlineFit(np.zeros(3), SHARP))
    for i in range(1, 7):
        pose = compose(POSE, np.array([moved_px * PIXEL_M * (i > 1), 0, 0]))
        if watch.look(i, i / 25, None, Measurement(pose, SHARP), pose, Lying(), False)[1]:
            seen.append(i)
    assert seen == looked


@pytest.mark.parametrize(("pictures", "told"), [(15, True), (40, False)])
def test_a_texture_that_sways_within_fifteen_pictures_is_told_from_a_motion(pictures, told):
    """By 7 mm: curves through as many pictures follow a slower one as they follow the body."""
    rng, n = np.random.default_rng(8), 600
    texture, outline = np.zeros((n, 3)), rng.normal(0, 2e-4, (n, 3))
    texture[:, 1] = 7e-3 * np.sin(2 * np.pi * np.arange(n) / pictures)
    apart = compose(inverse(texture), outline)
    seen = looks(np.arange(n), apart)
    steps, _ = steps_to_smoother(np.arange(n) / 25, texture, seen, apart, np.tile(SHARP, (n, 1, 1)), np.full(n, 5.0))
    assert steps.any() == told


@pytest.mark.parametrize(("later_s", "looked"), [(3.5, True), (7.0, False)])
def test_an_outline_that_disagreed_is_looked_at_in_each_picture_for_five_seconds(monkeypatch, later_s, looked):
    watch, apart = EdgeWatch(BOX), np.array([3 * PIXEL_M, 0, 0])
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: OutlineFit(apart, SHARP))
    assert watch.look(0, 0.0, None, Measurement(POSE, SHARP), POSE, Lying(), True)[2]
    _, fit, _ = watch.look(1, later_s, None, Measurement(POSE, SHARP), POSE, Lying(), False)
    assert (fit is not None) == looked


@pytest.mark.parametrize(("off_px", "apart"), [(0.18, False), (0.37, True)])
def test_edges_that_stand_a_quarter_of_a_pixel_off_the_texture_agree_with_it(monkeypatch, off_px, apart):
    """Both are known to a thousandth of a pixel, as far as they know."""
    known, off = (1e-3 * PIXEL_M) ** 2 * np.eye(3), np.array([off_px * PIXEL_M, 0, 0])
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: OutlineFit(off, known))
    assert EdgeWatch(BOX).look(0, 0.0, None, Measurement(POSE, known), POSE, Lying(), True)[2] == apart


@pytest.mark.parametrize(("count", "told"), [(4, False), (8, True)])
def test_six_looks_tell_of_a_disagreement_and_fewer_do_not(count, told):
    apart = np.tile([2e-3, 0, 0], (count, 1))
    expected = np.tile(1e-8 * np.eye(3), (count, 1, 1))
    excess = texture_excess(np.arange(count) / 25, apart, expected, looks(np.arange(count), apart))
    assert excess.any() == told


def test_an_outline_that_agrees_is_looked_at_in_each_fifth_picture(monkeypatch):
    watch = EdgeWatch(BOX)
    monkeypatch.setattr(two_measurements, "observe_outline", lambda *_, **__: OutlineFit(np.zeros(3), SHARP))
    seen = [watch.look(i, i / 25, None, Measurement(POSE, SHARP), POSE, Lying(), False)[1] for i in range(1, 21)]
    assert [i for i, fit in enumerate(seen, 1) if fit is not None] == [5, 10, 15, 20]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_pattern_of_the_sensor_does_not_hold_a_body_where_it_stood(seed):
    """Of a plain top with a printed label, whose few edges look hidden where the pattern fits all else."""
    pattern = 8 * np.random.default_rng(seed).standard_normal((240, 320))
    plain, label = texture(contrast=3.0), texture(seed=3, contrast=20.0)
    left_px = np.array([0.1, 0.5, 1.2, 2.0, 2.9, 3.4, 3.7, 3.75, 3.8, 4.1, 4.8, 5.8, 6.8, 7.7, 8.2, 8.5, 8.6])
    true = np.array([compose(POSE, np.array([px * PIXEL_M, 0, 0])) for px in [*np.zeros(20), *left_px]])

    def filmed(i):
        luma = picture(BOX, true[i], lambda xy: np.where(np.abs(xy).max(axis=-1) < 0.25, label(xy), plain(xy)))
        noise = 0.5 * np.random.default_rng(100 + i).standard_normal(luma.shape)
        return np.clip(np.rint(luma + pattern + noise), 0, 255).astype(np.uint8)

    follower = Follower(BOX, 0.0, filmed(0), BOX.pixels(BOX.body.top_corners_m, POSE), PlaneTracker, 0.2)
    for i in range(1, len(true)):
        follower.follow(i / 25, filmed(i))
    track = finished(follower.followed(), "plane")
    assert track.seen.all()
    assert np.linalg.norm((track.pose - true)[:, :2], axis=1).max() < 0.9 * PIXEL_M
