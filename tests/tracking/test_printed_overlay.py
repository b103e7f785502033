"""What stands still over a body in the first picture is left out of its template."""

import cv2
import numpy as np
import pytest
from painted import POSE, picture, texture
from painted import target as painted_target

from studies.worlds.scenes import CeilingCamera, drive, small_camera, standard_scene
from towval.model.geometry import inside_polygon, inverse_transform
from towval.tracking.clicks import check_clicks
from towval.tracking.outline import pose_from_clicks
from towval.tracking.overlay import standing_still
from towval.tracking.start import Tow

MOTIONS = (drive((-0.3, 0.4, 0.1), 0.3), drive((-0.9, -0.5, 0.2), 0.3))


@pytest.fixture(scope="module")
def scene():
    return standard_scene(31, **small_camera(), motions=MOTIONS)


def with_banner(luma, at, digits):
    marked = luma.copy()
    u, v = np.round(at).astype(int)
    cv2.rectangle(marked, (u - 20, v - 8), (u + 20, v + 8), 30, -1)
    cv2.putText(marked, digits, (u - 18, v + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.4, 250, 1)
    return marked


@pytest.mark.parametrize("index", [0, 1])
def test_a_banner_is_found_and_what_moves_is_not(scene, index):
    film, target, pose = CeilingCamera(scene), scene.target(index), MOTIONS[index](0.0)
    first, last = film.picture(0.0), film.picture(4.0)
    assert standing_still(first, last, target, pose) == []
    middle = target.pixels(np.zeros((1, 2)), pose)[0]
    (found,) = standing_still(with_banner(first, middle, "12:31"), with_banner(last, middle, "12:35"), target, pose)
    signs = np.array([[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]])
    banner = inverse_transform(pose, target.floor_xy(middle + signs * [20, 8]))
    assert inside_polygon(found, banner).all()
    assert not inside_polygon(found, 0.9 * target.body.top_corners_m).any()


def test_a_body_that_stays_is_no_overlay(scene):
    film, target = CeilingCamera(scene), scene.target(1)
    # It drives after ten seconds only; the noise is another in each picture.
    first, again = film.picture(0.0), film.picture(0.0)
    assert standing_still(first, again, target, MOTIONS[1](0.0)) == []


def test_clicks_are_not_moved_to_the_border_of_a_banner(scene):
    """It hides an edge of the top, and its own border beside it stands out more."""
    film, target, pose = CeilingCamera(scene), scene.target(0), MOTIONS[0](0.0)
    clicks = target.pixels(target.body.top_corners_m, pose)
    beyond = 10 * target.metres_per_pixel(pose)
    corners = target.body.top_corners_m
    left, (right, high) = corners[:, 0].min(), corners.max(axis=0)
    box = np.array([[left - beyond, 0.4 * high], [right + beyond, 0.4 * high]])
    box = np.concatenate([box, [[right + beyond, high + beyond], [left - beyond, high + beyond]]])
    place = np.round(target.pixels(box, pose)).astype(np.int32)

    def covered(luma, digits):
        luma = cv2.fillPoly(luma.copy(), [place], 0)
        at = place.mean(axis=0).astype(int) - [35, -6]
        return cv2.putText(luma, digits, at.tolist(), cv2.FONT_HERSHEY_SIMPLEX, 0.7, 255, 2)

    pictures = [covered(film.picture(0.0), "12:31"), covered(film.picture(4.0), "12:35")]
    tow = Tow(np.zeros(2), np.zeros(2), 9.0)
    found = check_clicks(pictures, scene.calibration, scene.bodies, {target.body.name: clicks}, tow)
    one = found[target.body.name]
    assert np.abs(one.corners_px - clicks).max() < 2.0
    assert "clicks_corrected" not in {each.code for each in one.findings}


@pytest.mark.parametrize("shift_px", [[0, 16], [12, 12]])
def test_clicks_that_are_off_are_corrected_though_the_floor_within_them_stands_still(scene, shift_px):
    film, target = CeilingCamera(scene), scene.target(1)
    corners_px = target.pixels(target.body.top_corners_m, MOTIONS[1](0.0))
    given, pictures = {target.body.name: corners_px + shift_px}, [film.picture(0.0), film.picture(4.0)]
    assert standing_still(*pictures, target, pose_from_clicks(target, corners_px + shift_px)[0])
    one = check_clicks(pictures, scene.calibration, scene.bodies, given, Tow(np.zeros(2), np.zeros(2), 9.0))["object"]
    assert np.abs(one.corners_px - corners_px).max() < 0.5
    assert [each.code for each in one.findings] == ["clicks_corrected"]


@pytest.mark.parametrize("place", [(3.0, 0.0), (-3.0, 0.0), (0.0, 2.5), (0.0, -2.5)])
def test_over_a_body_outside_the_picture_nothing_stands(scene, place):
    """Its clicks may lie there: the tracker says that too little of it is in view."""
    rng = np.random.default_rng(0)
    first, last = (rng.integers(0, 255, (540, 960), dtype=np.uint8) for _ in range(2))
    assert standing_still(first, last, scene.target(1), np.array([*place, 0.3])) == []


@pytest.mark.parametrize(("apart_px", "outlines"), [(12, 1), (24, 2)])
def test_letters_within_fifteen_pixels_are_one_banner(apart_px, outlines):
    """Two squares with a check pattern, on a top whose own texture is another in the last picture."""
    own, rng = painted_target(), np.random.default_rng(3)
    corners = np.round(own.pixels(own.body.top_corners_m, POSE)).astype(int)
    first, last = (rng.integers(60, 180, (240, 320)).astype(np.uint8) for _ in range(2))
    v, u = corners.mean(axis=0).astype(int)[::-1]
    letter = np.kron(np.indices((7, 7)).sum(axis=0) % 2, np.full((2, 2), 255)).astype(np.uint8)
    for luma in (first, last):
        for left in (u - apart_px // 2 - 14, u + apart_px // 2):
            luma[v - 7 : v + 7, left : left + 14] = letter
    assert len(standing_still(first, last, own, POSE)) == outlines


@pytest.mark.parametrize(("changed", "told"), [(0.19, False), (0.3, True)])
def test_a_fifth_of_a_top_must_change_for_the_rest_to_stand_still(changed, told):
    own, rng = painted_target(), np.random.default_rng(3)
    first = rng.integers(60, 180, (240, 320)).astype(np.uint8)
    last, corners = first.copy(), own.pixels(own.body.top_corners_m, POSE)
    left, right = corners[:, 0].min(), corners[:, 0].max()
    part = slice(round(left), round(left + changed * (right - left)))
    last[:, part] = rng.integers(60, 180, last[:, part].shape)
    assert bool(standing_still(first, last, own, POSE)) == told


def drawn_over(height, width, patch, again=None, rest=None):
    """Two pictures of the painted body, in its middle a patch (``again`` in the last), beside it other textures."""
    own, rng = painted_target(), np.random.default_rng(3)
    first, last = (rng.normal(128, 40, (240, 320)) for _ in range(2))
    if rest is not None:
        last = 128 + rest * (first - 128) + np.sqrt(1 - rest**2) * (last - 128)
    u, v = own.pixels(np.zeros((1, 2)), POSE)[0].astype(int)
    place = slice(v - height // 2, v - height // 2 + height), slice(u - width // 2, u - width // 2 + width)
    first[place], last[place] = patch, patch if again is None else again
    first, last = (np.clip(np.round(luma), 0, 255).astype(np.uint8) for luma in (first, last))
    return standing_still(first, last, own, POSE)


@pytest.mark.parametrize(("correlated", "told"), [(0.7, False), (0.97, True)])
def test_what_correlates_to_nine_tenths_stands_still(correlated, told):
    one, other = np.random.default_rng(4).normal(0, 40, (2, 30, 30))
    again = correlated * one + np.sqrt(1 - correlated**2) * other
    assert bool(drawn_over(30, 30, 128 + one, 128 + again)) == told


@pytest.mark.parametrize(("correlated", "told"), [(0.4, True), (0.65, False)])
def test_a_top_has_changed_where_it_correlates_to_less_than_a_half(correlated, told):
    patch = np.random.default_rng(4).normal(128, 40, (30, 30))
    assert bool(drawn_over(30, 30, patch, rest=correlated)) == told


@pytest.mark.parametrize(("side_px", "told"), [(11, False), (16, True)])
def test_an_overlay_covers_a_fiftieth_of_a_top(side_px, told):
    """On a top of 7,500 pixels."""
    patch = 255.0 * (np.indices((side_px, side_px)).sum(axis=0) % 2)
    assert bool(drawn_over(side_px, side_px, patch)) == told


@pytest.mark.parametrize(("deviation", "told"), [(4.5, False), (8.5, True)])
def test_an_overlay_shows_something_from_a_deviation_of_six_grey_levels_on(deviation, told):
    patch = 128 + deviation * (2.0 * (np.indices((30, 50)).sum(axis=0) % 2) - 1)
    assert bool(drawn_over(30, 50, patch)) == told


@pytest.mark.parametrize("seed", range(3))
def test_other_waves_of_six_pixels_and_longer_do_not_look_alike_by_chance(seed):
    own = painted_target()
    first, last = (picture(own, grey=texture(each, finest_m=0.08)) for each in (2 * seed, 2 * seed + 1))
    assert standing_still(first, last, own, POSE) == []


@pytest.mark.parametrize("seed", [3, 11])  # In one picture of the second, 38 % of what is alike is so in grey as well.
def test_a_smooth_top_that_moves_is_no_overlay(seed):
    """Its windows are ramps, and many a ramp of one place rises the way that of another does."""
    own, rng = painted_target(0.5, 0.35), np.random.default_rng(seed)
    spots = cv2.GaussianBlur(rng.normal(0, 1, (300, 400)), (0, 0), 12.0)
    spots = np.clip(128 + 45 * spots / spots.std(), 0, 255).round().astype(np.uint8)
    shifted = [spots[30 : 30 + 240, u : u + 320] for u in range(0, 80, 8)]
    first, others = np.ascontiguousarray(shifted[0]), [np.ascontiguousarray(each) for each in shifted[3:]]
    assert [len(standing_still(first, last, own, POSE)) for last in others] == [0] * len(others)
