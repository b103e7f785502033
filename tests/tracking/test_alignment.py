from dataclasses import replace
from functools import partial

import numpy as np
import painted
import pytest

from studies.worlds.scenes import CeilingCamera, small_camera, standard_scene
from towval.model import Body
from towval.model.geometry import compose, inverse, wrapped
from towval.tracking.alignment import align
from towval.tracking.planar_target import usable_points
from towval.tracking.plane_tracker import PlaneTracker, information_of_inliers
from towval.tracking.template import make_template, without_light


@pytest.fixture(scope="module")
def filmed():
    """A scene, its camera and a template of the rover from the first picture."""
    scene = standard_scene(4, **small_camera())
    film = CeilingCamera(scene)
    pose = scene.motions[0](0.0)
    template = make_template(film.picture(0.0), scene.target(0), pose)
    return scene, film, template


def aligned(filmed, luma, start):
    scene, _, template = filmed
    return align(luma, template, np.ones(len(template.points)), start, scene.target(0), 20.0)


def off(found, true):
    error = compose(inverse(true), found)
    return np.linalg.norm(error[:2]), abs(wrapped(error[2]))


def test_the_template_stays_clear_of_edges_and_obstructions():
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    body = Body("box", 0.2, square, obstructions=(0.3 * square,))
    points = np.array([[0.0, 0.0], [0.35, 0.0], [0.5, 0.0], [0.95, 0.0], [0.89, 0.5]])
    assert usable_points(body, points, 0.1).tolist() == [False, False, True, False, True]


def test_the_slopes_are_the_derivative_of_the_picture(filmed):
    """Moving the body by ε changes the picture at a fixed place by −J ε."""
    scene, film, template = filmed
    pose = scene.motions[0](0.0)
    luma = film.picture(0.0)
    for axis, step in enumerate((2e-4, 2e-4, 1e-3)):
        shift = np.zeros(3)
        shift[axis] = step
        ahead = scene.target(0).grey_values(luma, template.points, compose(pose, shift))
        back = scene.target(0).grey_values(luma, template.points, compose(pose, -shift))
        slope = (ahead - back) / (2 * step)
        assert np.corrcoef(slope, template.slopes[:, axis])[0, 1] > 0.97
        assert slope @ template.slopes[:, axis] / (slope @ slope) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("start", [(0.003, 0.0, 0.0), (0.0, -0.003, 0.0), (0.0, 0.0, 0.01), (0.002, 0.002, -0.006)])
def test_it_comes_back_from_a_pixel_or_more(filmed, start):
    scene, film, _ = filmed
    true = scene.motions[0](2.0)
    found = aligned(filmed, film.picture(2.0), compose(true, np.array(start)))
    distance, turn = off(found.pose, true)
    assert found.converged
    assert distance < 0.2e-3
    assert turn < np.deg2rad(0.04)


def test_light_and_its_slope_do_not_move_it(filmed):
    scene, film, _ = filmed
    true = scene.motions[0](1.0)
    picture = film.picture(1.0).astype(float)
    slope = np.linspace(0.5, 0.9, picture.shape[1])
    found = aligned(filmed, np.round(picture * slope + 10).astype(np.uint8), true)
    assert off(found.pose, true)[0] < 0.2e-3


def test_half_of_it_hidden_does_not_move_it(filmed):
    scene, film, _ = filmed
    true = scene.motions[0](1.0)
    picture = film.picture(1.0)
    middle = scene.target(0).pixels(np.zeros((1, 2)), true)[0]
    picture[:, int(middle[0]) + 10 :] = 60
    found = aligned(filmed, picture, compose(true, np.array([0.001, 0, 0])))
    assert off(found.pose, true)[0] < 0.3e-3
    assert 0.3 < found.inlier_fraction < 0.6


def test_where_the_body_is_not_the_correlation_says_so(filmed):
    _, film, _ = filmed
    found = aligned(filmed, film.picture(1.0), np.array([0.9, -0.9, 0.2]))
    assert found is None or found.correlation < 0.35


def test_predicted_deviation_is_that_of_the_scatter(filmed):
    scene, film, _ = filmed
    true = scene.motions[0](1.5)
    poses, predicted = [], []
    for _ in range(30):
        found = aligned(filmed, film.picture(1.5), true)
        poses.append(found.pose)
        predicted.append(np.sqrt(np.diag(found.covariance)))
    # 30 draws know a deviation to 13 %; what is asked of the tracker is a factor of two.
    ratio = np.mean(predicted, axis=0) / np.std(poses, axis=0)
    assert (ratio > 0.6).all()
    assert (ratio < 1.7).all()


def step(distance_m, width_m=0.004):
    """A smooth step of one: from 0 outside to 1 where a distance is negative."""
    return 1 / (1 + np.exp(np.clip(distance_m / width_m, -50, 50)))


def cardboard(xy):
    """A plain top: shades of a third of a grey level, a stripe along it, and a small label."""
    label = step(np.max(np.abs(xy - [-0.35, 0.2]) - [0.06, 0.05], axis=1))
    stripe = step(np.abs(xy[:, 1] + 0.05) - 0.08)
    return painted.texture(contrast=0.3, mean=110.0, finest_m=0.2)(xy) + 12 * stripe + 90 * label


def with_disc(xy, at=(0.1, -0.1)):
    """A top with little texture, and a bright disc ``at`` a place of it."""
    return painted.texture(contrast=1.0, mean=110.0)(xy) + 70 * step(np.hypot(*(xy - at).T) - 0.13, 0.008)


def painted_twice(grey, later=None):
    """A target, its pictures by ``grey`` and ``later``, each with noise of its own, and the template of the first."""
    own = painted.target()
    first = painted.picture(own, grey=grey, noise=0.5, seed=1)
    second = painted.picture(own, grey=later or grey, noise=0.5, seed=2)
    return own, first, second, make_template(first, own, painted.POSE)


@pytest.mark.parametrize("shift_px", [1.2, 2.5])
def test_few_edges_on_a_plain_top_are_found_from_pixels_off(shift_px):
    """All else fits there, too: beside it the edges look hidden. The shift is along the stripe."""
    own, first, second, template = painted_twice(cardboard)
    start = compose(painted.POSE, np.array([shift_px * template.pixel_m, 0, 0]))
    narrow, wide = (align(second, template, np.ones(len(template.points)), start, own, 8.0, wide=w) for w in (0, 1))
    off_px = [own.apart_m(one.pose, painted.POSE) / template.pixel_m for one in (narrow, wide)]
    assert off_px[0] > 0.15
    assert off_px[1] < 0.05
    assert information_of_inliers(narrow, template) < 0.5 < information_of_inliers(wide, template)
    measured = PlaneTracker(own, first, painted.POSE).measure(second, start)
    assert own.apart_m(measured.pose, painted.POSE) < 0.25 * template.pixel_m


def test_a_part_above_the_top_does_not_take_it_along():
    """A part that stands up is displaced against the top as the body crosses the picture; it holds much information."""
    own, first, second, template = painted_twice(with_disc, partial(with_disc, at=(0.13, -0.1)))
    found = align(second, template, np.ones(len(template.points)), painted.POSE, own, 8.0, wide=True)
    assert own.apart_m(found.pose, painted.POSE) > 0.45 * template.pixel_m
    measured = PlaneTracker(own, first, painted.POSE).measure(second, painted.POSE)
    assert own.apart_m(measured.pose, painted.POSE) < 0.15 * template.pixel_m


def test_the_leverage_of_points_adds_up_to_one_for_each_direction():
    template = painted_twice(cardboard)[-1]
    np.testing.assert_allclose(template.leverage.sum(axis=0), 1.0)
    flat = replace(template, slopes=np.zeros_like(template.slopes))
    np.testing.assert_allclose(flat.leverage, 1 / len(template.points))


def marked(xy, *marks, size=1.5):
    """A plain top with bright labels, each with a dark line, that are centred on ``marks``."""
    grey = np.full(len(xy), 150.0)
    for at in marks:
        grey += 70 * step(np.max(np.abs(xy - at) - size * np.array([0.10, 0.07]), axis=1), 0.006)
        grey -= 150 * step(np.max(np.abs(xy - at + [-0.02, 0.01]) - size * np.array([0.05, 0.015]), axis=1), 0.006)
    return grey


def with_label(xy):
    return marked(xy, (0.3, -0.2))


def with_small_label(xy):
    """The label lies in one tile of the top."""
    return marked(xy, (0.24, -0.11), size=0.7)


def test_tiles_share_the_information_and_one_without_texture_has_none():
    *_, template = painted_twice(with_label)
    assert template.tile_share.sum() == pytest.approx(1.0)
    far = np.hypot(*(template.points - [0.3, -0.2]).T) > 0.4
    plain = np.setdiff1d(template.tile[far], template.tile[~far])
    assert len(plain) > template.tiles / 2
    assert template.tile_share[plain].sum() < 0.06


@pytest.mark.parametrize(("marks", "concentrated"), [(1, True), (4, False)])
def test_few_tiles_hold_the_information_of_a_single_mark(marks, concentrated):
    places = [(0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, 0.2)][:marks]
    *_, template = painted_twice(lambda xy: marked(xy, *places))
    assert template.is_concentrated == concentrated


@pytest.mark.parametrize("grey", [with_label, with_small_label])
def test_a_single_mark_on_a_plain_top_is_known_as_well_as_its_poses_scatter(grey):
    """The scores of a single tile solve the equations and are zero: alone they would promise any precision."""
    own, *_, template = painted_twice(grey)
    poses, predicted = [], []
    for k in range(30):
        luma = painted.picture(own, grey=grey, noise=1.5, seed=100 + k)
        found = align(luma, template, np.ones(len(template.points)), painted.POSE, own, 8.0)
        poses.append(found.pose)
        predicted.append(np.sqrt(np.diag(found.covariance)))
    # One factor holds for all directions, so those of which the mark tells most are known better than stated.
    ratio = np.mean(predicted, axis=0) / np.std(poses, axis=0)
    assert (ratio > 0.8).all()
    assert (ratio < 3.5).all()


def test_a_single_mark_leads_a_plain_top_through_noise():
    """Most of the top is noise, which correlates with nothing; the mark shows where it is."""
    own, rng = painted.target(), np.random.default_rng(3)
    tracker = PlaneTracker(own, painted.picture(own, grey=with_label, noise=1.5, seed=1000), painted.POSE)
    for k in range(12):
        true = compose(painted.POSE, np.array([0.3 * tracker.pixel_m * k, 0.0, 0.002 * k]))
        start = compose(true, np.array([*(0.8 * tracker.pixel_m * rng.standard_normal(2)), 0.0]))
        found = tracker.measure(painted.picture(own, true, with_label, noise=1.5, seed=k), start)
        assert own.apart_m(found.pose, true) < 0.35 * tracker.pixel_m
        found.learn()


def test_a_plain_top_is_nowhere_where_its_mark_does_not_fit():
    """All else fits anywhere. From four pixels off edges of the mark find others of its edges."""
    own = painted.target()
    tracker = PlaneTracker(own, painted.picture(own, grey=with_small_label, noise=1.5, seed=1000), painted.POSE)
    rng, off = np.random.default_rng(3), []
    for k in range(40):
        start = compose(painted.POSE, np.array([*(2.5 * tracker.pixel_m * rng.standard_normal(2)), 0.0]))
        found = tracker.measure(painted.picture(own, grey=with_small_label, noise=1.5, seed=k), start)
        if found is not None:
            off.append(own.apart_m(found.pose, painted.POSE) / tracker.pixel_m)
    assert len(off) > 10
    assert max(off) < 1.5


def with_border(xy):
    """A plain top with a dark line along its edges, as wide as tape."""
    inside = np.max(np.abs(xy) - [0.55, 0.40], axis=1)
    return 150 - 110 * step(inside, 0.008) + 110 * step(inside + 0.05, 0.008)


@pytest.mark.parametrize("shift_px", [3.0, 4.0])
def test_a_border_of_tape_is_not_passed_over_for_the_plain_middle(shift_px):
    """The middle fits wherever it is laid."""
    own = painted.target()
    tracker = PlaneTracker(own, painted.picture(own, grey=with_border, noise=0.7, seed=1000), painted.POSE)
    for k, turn in enumerate((0.0, 0.8, 1.6, 2.4)):
        by = shift_px * tracker.pixel_m * np.array([np.cos(turn), np.sin(turn)])
        start = compose(painted.POSE, np.array([*by, 0.0]))
        found = tracker.measure(painted.picture(own, grey=with_border, noise=0.7, seed=k), start)
        assert found is None or own.apart_m(found.pose, painted.POSE) < 0.5 * tracker.pixel_m


def test_slopes_without_light_hold_nothing_that_a_gain_or_a_bias_of_a_tile_explains():
    """As by least squares; in a plain tile a gain changes what a bias changes."""
    rng = np.random.default_rng(0)
    _, _, _, template = painted_twice(with_disc)
    values = np.where(template.tile == 3, 110.0, template.values)
    template = replace(template, values=values)
    slopes = rng.normal(0, 1e3, (len(values), 4))
    expected = slopes.copy()
    for row in range(template.tiles):
        own = template.tile == row
        light = np.column_stack([np.ones(own.sum()), values[own]])
        expected[own] -= light @ np.linalg.lstsq(light, slopes[own], rcond=None)[0]
    np.testing.assert_allclose(without_light(slopes, template), expected, atol=1e-6)
