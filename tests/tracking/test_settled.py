"""Places that a search found, settled on the edges of a top."""

import cv2
import numpy as np
import pytest
from painted import POSE, picture
from painted import target as painted_target

from studies.worlds.tows import spread, towed
from towval.model.geometry import compose, inverse
from towval.tracking import outline
from towval.tracking.outline import OutlineFit, _End, combine_fits, observe_outline, settled
from towval.tracking.pose import step_between


def test_a_place_at_the_foot_of_a_side_is_settled_on_the_edge_above_it():
    """The object goes along a side of which one pixel is visible: its foot shows better than its edge in all views."""
    scene, _ = towed(601)
    target, motion, times = scene.target(1), scene.motions[1], np.linspace(0.0, 2.0, 5)
    true = motion(0.0)
    pixel_m = target.metres_per_pixel(true)
    views = [(luma, compose(motion(t), inverse(true))) for luma, t in zip(spread(scene, times), times, strict=True)]
    found = compose(true, np.array([-0.1, 2.1, 0.0]) * pixel_m)
    fits = [observe_outline(luma, target, compose(step, found)) for luma, step in views]
    stays = compose(found, combine_fits([fit for fit in fits if fit is not None]).correction)
    assert target.apart_m(true, stays) > 1.5 * pixel_m
    pose, spread_over = settled(target, views, found)
    assert target.apart_m(true, pose) < 0.4 * pixel_m
    assert not spread_over.any()


def twice(own, apart_px, share):
    """A top that has a ``share`` of the contrast, and another one, some pixels beside it, that has the rest."""
    beside = compose(POSE, np.array([apart_px * own.metres_per_pixel(POSE), 0.0, 0.0]))
    one, other = (
        picture(own, pose, lambda xy, part=part: np.full(len(xy), 60.0 + 100.0 * part), 60.0).astype(float)
        for pose, part in ((POSE, share), (beside, 1 - share))
    )
    soft = cv2.GaussianBlur(one + other - 60.0, (0, 0), 0.6)
    return np.clip(np.round(soft + np.random.default_rng(0).standard_normal(soft.shape)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("apart_px", "share", "from_px", "unsure"),
    [
        (2.0, 0.5, 0.0, True),
        (2.4, 0.5, 0.0, True),
        (2.4, 0.6, 0.0, False),
        (2.4, 0.8, 0.0, False),
        (4.2, 0.5, 1.0, False),
    ],
)
def test_a_place_is_unsure_where_the_outline_fits_as_well_one_to_three_pixels_beside_it(
    apart_px, share, from_px, unsure
):
    own = painted_target()
    pixel_m = own.metres_per_pixel(POSE)
    begun = compose(POSE, np.array([from_px * pixel_m, 0.0, 0.0]))
    pose, spread_over = settled(own, [(twice(own, apart_px, share), np.zeros(3))], begun)
    off_px = step_between(POSE, pose) / pixel_m
    assert min(abs(off_px[0]), abs(off_px[0] - apart_px)) < 0.35
    assert abs(off_px[1]) < 0.1
    std_px = np.sqrt(spread_over[0, 0]) / pixel_m
    assert (0.5 * apart_px < std_px < apart_px) if unsure else std_px == 0


def fits_end_at(monkeypatch, *ends):
    """Fits begun at nine places end so many pixels beside the first, at deviations [px], one by one; or nowhere."""
    pixel_m = painted_target().metres_per_pixel(POSE)
    places = [
        _End(compose(POSE, np.array([off_px * pixel_m, 0.0, 0.0])), std_px * pixel_m, usual_px * pixel_m, seen)
        for off_px, std_px, usual_px, seen in ends
    ]
    left = iter([*places, *[None] * (9 - len(places))])
    monkeypatch.setattr(outline, "_end", lambda *_, **__: next(left))
    pose, spread_over = settled(painted_target(), [], POSE)
    return step_between(POSE, pose)[0] / pixel_m, np.sqrt(spread_over[0, 0]) / pixel_m


@pytest.mark.parametrize(
    ("off_px", "std_px", "usual_px", "unsure"),
    [
        (0.9, 0.1, 0.2, False),
        (1.1, 0.1, 0.2, True),
        (2.9, 0.1, 0.2, True),
        (3.1, 0.1, 0.2, False),
        (2.0, 0.14, 0.2, True),
        (2.0, 0.16, 0.2, False),
        (2.0, 0.1, 0.28, True),
        (2.0, 0.1, 0.32, False),
    ],
)
def test_another_place_is_as_good_where_it_is_as_sure_in_all_pictures_and_in_a_usual_one(
    monkeypatch, off_px, std_px, usual_px, unsure
):
    off, std = fits_end_at(monkeypatch, (0.0, 0.1, 0.2, 5), (off_px, std_px, usual_px, 5))
    assert off == pytest.approx(0.0, abs=1e-9)
    assert std == pytest.approx(off_px / np.sqrt(2) if unsure else 0.0)


@pytest.mark.parametrize(("seen", "taken"), [(2, False), (3, True)])
def test_a_place_counts_where_half_as_many_pictures_show_its_edges(monkeypatch, seen, taken):
    off, _ = fits_end_at(monkeypatch, (0.0, 0.2, 0.2, 5), (2.0, 0.1, 0.1, seen))
    assert off == pytest.approx(2.0 if taken else 0.0, abs=1e-9)


def test_a_few_pictures_that_are_sure_by_chance_do_not_make_a_place_as_good(monkeypatch):
    """In half of the pictures the place beside is as sure as the right one, in the others it is not."""
    own = painted_target()
    pixel_m = own.metres_per_pixel(POSE)

    def fit(luma, _target, pose, *, wide):
        off_px = step_between(POSE, pose)[:2] / pixel_m
        beside = off_px[0] > 1
        std_m = pixel_m * (0.4 if beside and not luma[0, 0] else 0.1)
        return OutlineFit(np.array([*(2.0 * beside, 0.0) - off_px, 0.0]) * pixel_m, np.diag([std_m, std_m, 0.01]) ** 2)

    monkeypatch.setattr(outline, "observe_outline", fit)
    views = [(np.full((1, 1), sure, np.uint8), np.zeros(3)) for sure in (1, 1, 1, 0, 0)]
    pose, spread_over = settled(own, views, POSE)
    assert np.allclose(pose, POSE)
    assert not spread_over.any()


def test_several_fits_that_end_at_the_same_place_are_one_place(monkeypatch):
    ends = (0.0, 0.1, 0.1, 5), (2.0, 0.1, 0.1, 5), (2.2, 0.1, 0.1, 5), (-1.5, 0.1, 0.1, 5)
    _, std = fits_end_at(monkeypatch, *ends)
    assert std == pytest.approx(np.sqrt((2.0**2 + 1.5**2) / 3))


def test_fits_are_narrow_at_the_place_itself_and_wide_at_first_two_pixels_beside_it(monkeypatch):
    """A wide fit also takes the foot of a side for an edge that is on its place already."""
    own, fits = painted_target(), []

    def fit(_luma, _target, pose, *, wide):
        fits.append((*np.round(step_between(POSE, pose)[:2] / own.metres_per_pixel(POSE), 3), wide))
        return OutlineFit(np.zeros(3), np.diag([1e-8, 1e-8, 1e-8]))

    monkeypatch.setattr(outline, "observe_outline", fit)
    settled(own, [(np.zeros((240, 320), np.uint8), np.zeros(3))], POSE)
    assert fits[:2] == [(0.0, 0.0, False)] * 2
    assert [wide for *_, wide in fits[2:]] == [True, False] * 8
    assert {(x, y) for x, y, _ in fits} == {(x, y) for x in (-2.0, 0.0, 2.0) for y in (-2.0, 0.0, 2.0)}


def test_a_place_without_edges_stays_where_it_is():
    own = painted_target()
    pose, spread_over = settled(own, [(np.full((240, 320), 100, np.uint8), np.zeros(3))], POSE)
    assert np.array_equal(pose, POSE)
    assert not spread_over.any()
