"""Places that a search found, settled on the edges of a top."""

import cv2
import numpy as np
import pytest
from painted import POSE, picture
from painted import target as painted_target

from studies.worlds.tows import spread, towed
from towval.model.geometry import compose, inverse
from towval.tracking.outline import combine_fits, observe_outline, settled
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


def test_a_place_without_edges_stays_where_it_is():
    own = painted_target()
    pose, spread_over = settled(own, [(np.full((240, 320), 100, np.uint8), np.zeros(3))], POSE)
    assert np.array_equal(pose, POSE)
    assert not spread_over.any()
