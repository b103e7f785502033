import re
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
from painted import FLOOR, POSE, out_of_focus, picture, target, texture

from studies.worlds.scenes import CeilingCamera, small_camera, standard_scene
from towval.model import Body
from towval.tracking import focus as focus_module
from towval.tracking.blur import SharpTarget
from towval.tracking.finished_track import finished
from towval.tracking.focus import Focus, width_px
from towval.tracking.follow import Follower
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.template import CONSTANTS as TEMPLATE
from towval.tracking.template import clearance_m, make_template

BOX = target()


def moving(time_s):
    return np.array([-0.8 + 0.3 * time_s, 0.2 + 0.1 * time_s, 0.2 * time_s])


def filmed(seed, radii_px, rng):
    """A tracker of a moving rover, and its errors (n, 3) and stated variances in pictures out of focus by discs."""
    scene = standard_scene(seed, **(small_camera() | {"grain_m": 0.012, "noise": 0.0}))
    film = CeilingCamera(replace(scene, motions=(moving, scene.motions[1])))
    tracker = PlaneTracker(scene.target(0), out_of_focus(film.picture(0.0), 0.0, rng), moving(0.0))
    errors, variances = [], []
    for time_s, radius_px in zip(0.1 * np.arange(1, len(radii_px) + 1), radii_px, strict=True):
        found = tracker.measure(out_of_focus(film.picture(time_s), radius_px, rng), moving(time_s), np.zeros(3))
        found.learn()
        errors.append(found.pose - moving(time_s))
        variances.append(np.diag(found.covariance))
    return tracker, np.array(errors), np.array(variances)


HUNTING_PX = 6 * np.sin(np.pi * np.arange(1, 17) / 16)


def test_a_body_is_found_in_pictures_out_of_focus_as_well_as_is_said():
    """Monte-Carlo over prints and noise. Against the sharp template errors are twice as large, and not stated."""
    errors, variances = [], []
    for seed in range(5):
        tracker, error, variance = filmed(seed, HUNTING_PX, np.random.default_rng(seed))
        assert 2.0 < tracker.widest_blur_px < 5.0
        errors.append(error[4:12])
        variances.append(variance[4:12])
    share = np.sqrt(np.mean(variances, axis=(0, 1)) / np.mean(np.square(errors), axis=(0, 1)))
    assert (share > 0.5).all()
    assert (share < 2.0).all()


def test_the_width_follows_the_focus_out_and_back():
    scene = standard_scene(3, **(small_camera() | {"grain_m": 0.012, "noise": 0.0}))
    film, rng, widths = CeilingCamera(replace(scene, motions=(moving, scene.motions[1]))), np.random.default_rng(3), []
    tracker = PlaneTracker(scene.target(0), out_of_focus(film.picture(0.0), 0.0, rng), moving(0.0))
    for i, radius_px in enumerate(HUNTING_PX, 1):
        tracker.measure(out_of_focus(film.picture(0.1 * i), radius_px, rng), moving(0.1 * i), np.zeros(3)).learn()
        widths.append(width_px(tracker.focus.level))
    # A disc of radius r has a variance of r² / 4 along each axis; widths are a half apart, and a disc is no Gaussian.
    assert widths[3:13] == pytest.approx(list(HUNTING_PX[3:13] / 2), rel=0.45)
    assert widths[-1] <= width_px(1)


def test_sharp_pictures_stay_sharp():
    tracker, _, _ = filmed(1, np.zeros(30), np.random.default_rng(1))
    assert tracker.widest_blur_px == 0.0


def test_a_picture_that_is_only_looked_at_does_not_change_the_focus():
    tracker = PlaneTracker(BOX, picture(BOX), POSE)
    soft = cv2.GaussianBlur(picture(BOX), (0, 0), 3.0)
    found = tracker.measure(soft, POSE, np.zeros(3))
    assert tracker.focus.level == 0
    found.learn()
    assert width_px(tracker.focus.level) == pytest.approx(3.0, rel=0.25)


@pytest.mark.parametrize(("floor_px", "level"), [(0.0, 0), (1.2, 3), (np.inf, 4)])
def test_a_body_is_no_less_sharp_than_the_floor_around_it(floor_px, level):
    """By one width more at most; where no floor is watched the body alone decides."""
    own = target()
    tracker = PlaneTracker(own, picture(own), POSE)
    own.blur_px = lambda: floor_px
    for width_px_ in (2.0, 3.0, 3.0):
        found = tracker.measure(cv2.GaussianBlur(picture(own), (0, 0), width_px_), POSE, np.zeros(3))
        found.learn()
    assert tracker.focus.level == level


@pytest.mark.parametrize(("width_px_", "told"), [(0.0, []), (0.8, []), (1.2, ["1.2 px"]), (2.0, ["1.8 px"])])
def test_a_change_of_focus_is_told_of(width_px_, told):
    follower = Follower(BOX, 0.0, picture(BOX), BOX.pixels(BOX.body.top_corners_m, POSE), PlaneTracker, 0.1)
    for i in range(1, 15):
        soft = i > 2 and width_px_
        follower.follow(i / 25, cv2.GaussianBlur(picture(BOX), (0, 0), width_px_) if soft else picture(BOX), ())
    texts = [each.text for each in finished(follower.followed(), "plane").findings if each.code == "focus_changed"]
    assert [re.search(r"[\d.]+ px", text)[0] for text in texts] == told


# Limits, each from both sides


def cut(body):
    luma, pose = picture(body), POSE
    return SharpTarget.cut(luma, body, pose, make_template(luma, body, pose))


def test_widths_reach_from_one_pixel_to_six_in_steps_of_a_half():
    widths = [width_px(level) for level in range(focus_module.CONSTANTS.widths + 1)]
    assert widths[0] == 0.0
    assert 0.6 <= widths[1] <= 1.0
    assert 5.0 <= widths[-1] <= 8.0
    assert all(1.3 <= wide / narrow <= 1.7 for narrow, wide in pairwise(widths[1:]))


def test_points_keep_a_width_and_a_half_from_the_outline():
    focus = Focus(cut(BOX))
    width_m, clear_m = width_px(5) * BOX.metres_per_pixel(POSE), clearance_m(BOX.body, BOX.metres_per_pixel(POSE))
    points, kept = focus.at(0).template.points, focus.at(5).template.number
    widths = ((np.ptp(BOX.body.top_corners_m, axis=0) / 2 - np.abs(points)).min(axis=1) - clear_m) / width_m
    assert widths[kept].min() > 1.2
    assert np.delete(widths, kept).max() < 1.8


def test_a_top_with_texture_counts_as_such_through_any_blur():
    """A part that stands on it outlasts its texture: held by that alone, the pose goes along with its parallax."""
    grey = texture(contrast=8.0, mean=150.0, finest_m=0.04)

    def with_block(xy):
        return np.where((np.abs(xy - [0.3, 0.15]) < [0.15, 0.12]).all(axis=1), 20.0, grey(xy))

    luma = picture(BOX, POSE, with_block)
    focus = Focus(SharpTarget.cut(luma, BOX, POSE, make_template(luma, BOX, POSE)))
    templates = [focus.at(level).template for level in range(focus.last + 1)]
    assert min(1 / np.sum(each.tile_share**2) / each.tiles for each in templates) < TEMPLATE.concentrated
    assert not any(each.is_concentrated for each in templates)


def square(size_px):
    """A square body of so many pixels."""
    corners = size_px * BOX.metres_per_pixel(POSE) / 2 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return PlanarTarget(Body("box", BOX.body.tracked_plane_height_m, corners), BOX.camera, FLOOR)


@pytest.mark.parametrize(("size_px", "widest_px"), [(20, 0.0), (30, 1.8), (60, 4.05), (200, 6.1)])
def test_the_widest_blur_is_a_twelfth_of_a_body(size_px, widest_px):
    assert width_px(Focus(cut(square(size_px))).last) == pytest.approx(widest_px, abs=0.05)


@pytest.mark.parametrize(("size_px", "all_kept"), [(24, False), (17, True)])
def test_a_small_body_keeps_all_of_its_points(size_px, all_kept):
    focus = Focus(cut(square(size_px)))
    kept = len(focus.at(3).template.points) / len(focus.at(0).template.points)
    assert (kept > 0.95) == all_kept


@pytest.mark.parametrize(("left", "level"), [(0.4, 4), (0.5, 0)])
def test_a_blur_has_to_leave_clearly_less_than_none(left, level):
    assert Focus(cut(BOX)).best({0: 100.0, 4: 100.0 * left}) == level


def test_noise_alone_makes_no_blur_better():
    # The sharp target's noise and the picture's, against what a blur leaves of the target's.
    focus, noise = Focus(cut(BOX)), 9.0
    assert focus.best({0: noise + noise, 3: noise * 1.1}) == 0


@pytest.mark.parametrize(("over", "due"), [(1.3, False), (1.7, True)])
def test_a_blur_is_tried_where_half_as_much_again_as_usual_is_left(over, due):
    focus = Focus(cut(BOX))
    focus.settle({})
    assert focus.is_due(np.sqrt(over * focus.usual)) == due


def test_other_widths_are_tried_now_and_then():
    focus, due = Focus(cut(BOX)), 0
    for _ in range(100):
        due += focus.is_due(0.0)
        focus.settle({})
    assert 8 <= due <= 13


def test_what_is_usual_is_learned_within_twenty_pictures():
    focus = Focus(cut(BOX))
    assert 0.3 < focus.usual < 0.8
    for _ in range(20):
        focus.settle({0: 10.0})
    assert 5.0 < focus.usual < 7.5


def test_some_hundred_points_tell_the_width(monkeypatch):
    counts = []
    monkeypatch.setattr(focus_module, "light_misfit", lambda values, *_: counts.append(len(values)) or 1.0)
    PlaneTracker(BOX, picture(BOX), POSE).measure(picture(BOX), POSE, np.zeros(3))
    assert 250 < max(counts) <= 500
