from dataclasses import replace

import numpy as np
import pytest
from painted import CAMERA, FLOOR, POSE, picture
from painted import target as painted_target

from studies.worlds.scenes import CeilingCamera, ceiling, rectangle, small_camera, standard_scene
from towval.model import Body
from towval.model.errors import InputError
from towval.model.geometry import compose, inverse, transform
from towval.optics.projection import project
from towval.tracking import outline
from towval.tracking.outline import OutlineFit, as_begun, combine_fits, observe_outline, pose_from_clicks
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import step_between

L_SHAPE = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.05], [0.05, 0.05], [0.05, 0.2], [-0.3, 0.2]])


def clicks_on(target, pose):
    corners = transform(pose, target.body.top_corners_m)
    return project(target.camera, target.floor, np.column_stack([corners, np.full(len(corners), target.height)]))


def test_exact_clicks_give_the_exact_pose():
    target, pose = PlanarTarget(Body("rover", 0.42, L_SHAPE), *ceiling()), np.array([0.3, -0.4, 2.5])
    found, _, misfit_px = pose_from_clicks(target, clicks_on(target, pose))
    assert np.allclose(found, pose, atol=1e-9)
    assert misfit_px < 1e-6


def test_the_deviation_of_clicks_is_that_of_their_scatter():
    target, pose = PlanarTarget(Body("rover", 0.42, rectangle(0.75, 0.5)), *ceiling()), np.array([0.1, 0.2, 0.4])
    clicks, rng = clicks_on(target, pose), np.random.default_rng(3)
    errors = []
    for _ in range(400):
        found, covariance, _ = pose_from_clicks(target, clicks + 0.7 * rng.standard_normal(clicks.shape))
        errors.append(compose(inverse(pose), found))
    # 400 draws know a deviation to 3.5 %; perspective makes pixels up to 5 % wider than at the middle.
    assert np.std(errors, axis=0) == pytest.approx(np.sqrt(np.diag(covariance)), rel=0.15)


def test_clicks_of_another_number_are_refused():
    with pytest.raises(InputError, match="do not match its corners"):
        pose_from_clicks(PlanarTarget(Body("rover", 0.42, L_SHAPE), *ceiling()), np.zeros((4, 2)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_edges_bring_clicks_to_a_tenth_of_a_pixel(seed):
    scene = standard_scene(seed, **small_camera(), brightness=(170.0, 190.0), contrast=15.0)
    luma = CeilingCamera(scene).picture(0.0)
    for body, motion in zip(scene.bodies, scene.motions, strict=True):
        true = motion(0.0)
        start = compose(true, np.array([0.003, -0.002, 0.004]))
        fit = observe_outline(luma, PlanarTarget(body, scene.camera, scene.floor), start)
        error = compose(inverse(true), compose(start, fit.correction))
        assert np.linalg.norm(error[:2]) < 0.5e-3
        assert abs(error[2]) < np.deg2rad(0.1)


def test_errors_of_the_registration_are_what_it_says_also_where_a_thin_strip_of_the_side_is_visible():
    rng, shares, offsets = np.random.default_rng(11), [], []
    for seed in range(16):
        places = [[rng.uniform(-1.3, 1.3), side * rng.uniform(0.4, 0.7), rng.uniform(-3, 3)] for side in (1, -1)]
        motions = tuple(lambda _, place=place: np.array(place) for place in places)
        scene = standard_scene(seed, **small_camera(), motions=motions, contrast=20.0)
        luma, clicks = CeilingCamera(scene).picture(0.0), scene.clicks(np.random.default_rng(seed))
        for body, place in zip(scene.bodies, map(np.array, places), strict=True):
            # From clicks, as in use: a fit that starts at the true place finds the true edges too easily.
            start, _, _ = pose_from_clicks(PlanarTarget(body, scene.camera, scene.floor), clicks[body.name])
            fit = observe_outline(luma, PlanarTarget(body, scene.camera, scene.floor), start)
            error = compose(inverse(place), compose(start, fit.correction))
            offsets.append(error[:2])
            shares.append(error / np.sqrt(np.diag(fit.covariance)))
    share = np.median(np.abs(shares), axis=0) / 0.674  # the median of a normal deviate
    assert (share > 0.5).all()
    assert (share < 2).all()
    assert np.quantile(np.abs(shares), 0.95) < 3
    assert np.median(np.linalg.norm(offsets, axis=1)) < 0.3e-3  # 0.06 px


def test_a_top_measured_too_wide_is_registered_by_its_middle():
    for seed in (1, 2, 4):  # Seed 3 shows thin strips of side along both, which leave the middle open.
        scene = standard_scene(seed, brightness=(170.0, 190.0), contrast=15.0)
        luma, body, true = CeilingCamera(scene).picture(0.0), scene.bodies[0], scene.motions[0](0.0)
        length, width = np.ptp(body.top_corners_m, axis=0)
        stated = replace(body, top_corners_m=rectangle(length, width + 0.0015))
        for side in (0.001, -0.001):
            start = compose(true, np.array([0.0, side, 0.0]))
            fit = observe_outline(luma, PlanarTarget(stated, scene.camera, scene.floor), start)
            assert np.linalg.norm(compose(inverse(true), compose(start, fit.correction))[:2]) < 0.25e-3


def test_a_picture_without_edges_gives_none():
    flat = np.full((1080, 1920), 128, np.uint8)
    assert observe_outline(flat, PlanarTarget(Body("rover", 0.42, L_SHAPE), *ceiling()), np.zeros(3)) is None


@pytest.mark.parametrize(("longer_m", "found"), [(0.0, True), (1.2, False)])
def test_a_fit_tells_whether_something_was_found_of_each_side(longer_m, found):
    """The front of a top that fades into the floor is not."""
    middle = np.array([longer_m / 2, 0, 0])
    luma = picture(painted_target(1.2 + longer_m), compose(POSE, middle), lambda xy: np.full(len(xy), 170.0))
    assert observe_outline(luma, painted_target(), POSE).all_sides == found


@pytest.mark.parametrize(("gap_rad", "found"), [(0.0, True), (0.6, True), (2.0, False)])
def test_of_a_round_outline_what_faces_nearly_the_same_way_is_one_side(gap_rad, found):
    turns = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    disc = PlanarTarget(Body("disc", 0.3, 0.5 * np.column_stack([np.cos(turns), np.sin(turns)])), CAMERA, FLOOR)

    def grey(xy):
        in_gap = np.abs(np.arctan2(*xy.T[::-1])) < gap_rad / 2
        return np.where(in_gap | (np.hypot(*xy.T) > 0.5), 90.0, 170.0)

    assert observe_outline(picture(disc, grey=grey), disc, POSE).all_sides == found


def test_a_body_too_small_for_its_edges_is_refused():
    small = PlanarTarget(Body("rover", 0.1, rectangle(0.01, 0.01)), *ceiling())
    with pytest.raises(InputError, match="too small in the picture"):
        observe_outline(np.zeros((1080, 1920), np.uint8), small, np.zeros(3))


def test_one_wrong_fit_among_many_does_not_count():
    rng = np.random.default_rng(0)
    corrections = 2e-5 * rng.standard_normal((12, 3))
    corrections[5] = (2e-3, -1e-3, 5e-3)
    fits = [OutlineFit(correction, 1e-9 * np.eye(3)) for correction in corrections]
    combined = combine_fits(fits)
    assert np.allclose(combined.correction, np.delete(corrections, 5, axis=0).mean(axis=0), atol=1e-5)
    # What a single picture has wrong may be wrong in all of them, but for what differs: 0.4 of it here.
    assert np.sqrt(np.diag(combined.covariance)) == pytest.approx(np.full(3, np.sqrt(0.6e-9 + 0.4e-9 / 11)), rel=0.25)


def test_fits_that_are_wrong_together_are_no_surer_than_one():
    fits = [OutlineFit(np.array([1e-4, 0, 0]), np.diag([1e-8, 4e-8, 1e-6]))] * 9
    assert combine_fits(fits).covariance == pytest.approx(fits[0].covariance, rel=1e-9)


def test_each_picture_counts_where_it_is_sure():
    """Motion blurs the edges across it; those along it tell as much as ever."""
    along, across = np.array([1.0, 1.0, 0.0]) / np.sqrt(2), np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    spin = np.diag([0.0, 0.0, 1e-8])
    sharp = OutlineFit(2e-4 * across, 1e-8 * (np.outer(along, along) + np.outer(across, across)) + spin)
    blurred_covariance = 1e-4 * np.outer(along, along) + 1e-8 * np.outer(across, across) + spin
    blurred = [OutlineFit(5e-3 * along - 1e-5 * across, blurred_covariance) for _ in range(7)]
    combined = combine_fits([sharp, *blurred])
    assert combined.correction @ along == pytest.approx(0.0, abs=1e-5)
    assert combined.correction @ across == pytest.approx((2e-4 - 7e-5) / 8, abs=1e-6)
    # Along the motion one picture tells it all; across it all eight may be wrong together.
    assert along @ combined.covariance @ along == pytest.approx(1e-8, rel=0.3)
    assert across @ combined.covariance @ across == pytest.approx(1e-8, rel=0.3)


def test_blurred_pictures_do_not_move_the_registration():
    rng = np.random.default_rng(3)
    sharp = [OutlineFit(c, 1e-9 * np.eye(3)) for c in rng.normal(0, 3e-5, (3, 3))]
    blurred = [OutlineFit(c, 1e-6 * np.eye(3)) for c in rng.normal(1e-3, 3e-4, (9, 3))]
    combined = combine_fits([*blurred[:4], *sharp, *blurred[4:]])
    assert np.linalg.norm(combined.correction[:2]) < 1e-4
    assert np.sqrt(np.diag(combined.covariance)[:2]).max() < 1e-4


OWN, BEGUN = painted_target(), np.diag([5e-3, 4e-3, 6e-3]) ** 2
PIXEL_M = OWN.metres_per_pixel(POSE)


def stated(monkeypatch, end, std_px=0.1, usual_px=0.1):
    """Deviations (3,) of a fit that is ``std_px`` sure, by fits that lead from a step (3,) to its ``end``."""

    def fit(_luma, _target, pose):
        step = step_between(POSE, pose)
        correction = step_between(step, np.array(end(step)))
        return OutlineFit(correction, np.diag([usual_px * PIXEL_M, usual_px * PIXEL_M, 1e-3]) ** 2)

    monkeypatch.setattr(outline, "observe_outline", fit)
    own = OutlineFit(np.zeros(3), np.diag([std_px * PIXEL_M, std_px * PIXEL_M, 1e-3]) ** 2)
    return np.sqrt(np.diag(as_begun(None, OWN, POSE, own, BEGUN).covariance))


def test_a_fit_to_which_all_lead_is_as_sure_as_it_is(monkeypatch):
    assert stated(monkeypatch, np.zeros_like) == pytest.approx([0.1 * PIXEL_M, 0.1 * PIXEL_M, 1e-3])


def test_a_fit_that_stays_where_it_begins_is_no_surer_than_that(monkeypatch):
    assert stated(monkeypatch, lambda step: step) == pytest.approx([5e-3, 4e-3, 6e-3])


def test_a_fit_is_surer_in_the_directions_in_which_all_lead_to_it(monkeypatch):
    assert stated(monkeypatch, lambda step: step * [0, 1, 0]) == pytest.approx([0.1 * PIXEL_M, 4e-3, 1e-3])


@pytest.mark.parametrize(("usual_px", "counts"), [(0.14, True), (0.16, False)])
def test_fits_that_are_far_less_sure_say_nothing(monkeypatch, usual_px, counts):
    assert (stated(monkeypatch, lambda step: step, usual_px=usual_px)[0] > 0.2 * PIXEL_M) == counts


@pytest.mark.parametrize(("std_px", "asked"), [(0.04, False), (0.06, True)])
def test_a_fit_that_has_found_clear_edges_all_around_is_not_asked(monkeypatch, std_px, asked):
    assert (stated(monkeypatch, lambda step: step, std_px, std_px)[0] > 0.2 * PIXEL_M) == asked
