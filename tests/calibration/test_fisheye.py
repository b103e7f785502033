"""Fisheye lenses: truth by OpenCV's own fisheye model, which shares no code with ours and has a coefficient more."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from studies.real.jackknife import photographs
from studies.worlds.boards import calibration_set
from studies.worlds.fisheyes import BOARD, NOISE_PX, SIZE, fisheye_lab
from towval.calibration import sound_views
from towval.calibration.blocks import Estimate
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.lens import LENS_MODELS, families, may_be_fisheye
from towval.calibration.marks_alone import calibrate_marks
from towval.calibration.sound_views import adjust_sound_views
from towval.model import Camera, Floor, FloorReference
from towval.model.camera import is_fisheye, lens_array
from towval.model.errors import InputError, RefusedError
from towval.optics.plane_uncertainty import position_covariance, position_sensitivity, shared_parameters
from towval.optics.projection import project, project_with_derivatives, to_plane
from towval.selection.lens import with_lens_choice

PINHOLES, FISHEYES = families(tuple(LENS_MODELS))
STRONG = (0.03, -0.02, 0.01, -0.002)


def rms_m(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@pytest.mark.parametrize("bend", [(0.0, 0.0, 0.0), (0.03, -0.02, 0.01)])
def test_points_are_projected_as_by_opencv(bend):
    there = fisheye_lab(0, 400.0, (*bend, 0.0))
    camera = Camera(SIZE, there.matrix, np.array([*bend[:2], 0, 0, bend[2], 0, 0, 0]), "fisheye k1 k2 k3")
    places = np.random.default_rng(1).uniform(-3, 3, (500, 2))
    pixels = project(camera, there.floor, np.column_stack([places, np.zeros(500)]))
    np.testing.assert_allclose(pixels, there.on_floor(places), atol=1e-8)
    np.testing.assert_allclose(to_plane(camera, there.floor, pixels, 0.0), places, atol=1e-9)


def test_on_the_axis_nothing_is_divided_by_zero():
    camera = Camera(SIZE, np.diag([400.0, 400.0, 1.0]), np.zeros(8), "fisheye")
    down = Floor(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]]))
    near = np.array([[0.0, 0.0], [1e-9, 0.0], [1e-4, 1e-4], [3e-4, 0.0]])
    pixels = project(camera, down, np.column_stack([near, np.zeros(4)]))
    np.testing.assert_allclose(to_plane(camera, down, pixels, 0.0), near, atol=1e-15)


def test_a_ray_at_a_right_angle_meets_no_floor():
    camera = Camera(SIZE, np.diag([400.0, 400.0, 1.0]), np.zeros(8), "fisheye")
    down = Floor(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]]))
    found = to_plane(camera, down, 400 * np.array([[1.5, 0], [np.pi / 2 + 1e-6, 0], [2.0, 0]]), 0.0)
    np.testing.assert_array_equal(np.isfinite(found).all(axis=1), [True, False, False])
    assert found[0, 0] == pytest.approx(2 * np.tan(1.5))


def test_derivatives_are_those_of_the_projection():
    rng = np.random.default_rng(2)
    points = np.concatenate([rng.uniform(-1, 1, (20, 3)), [[0.0, 0.0, 0.0]]])
    at = np.array([0.1, -0.2, 0.05, 0.0, 0.0, 0.9, 400, 401, 640, 480, 0.03, -0.02, 0, 0, 0.01, 0, 0, 0])

    def pixels(values: np.ndarray) -> np.ndarray:
        fx, fy, cx, cy = values[6:10]
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        # The point that the shift puts on the axis must be there for both calls.
        return project_with_derivatives(points, values[:3], values[3:6], matrix, lens_array(values[10:], True))

    points = points[(points @ cv2.Rodrigues(at[:3])[0].T + at[3:6])[:, 2] > 0.1]
    found = pixels(at)[1]
    for k in range(18):
        step = np.zeros(18)
        step[k] = 1e-6
        change = (pixels(at + step)[0] - pixels(at - step)[0]) / 2e-6
        np.testing.assert_allclose(found[..., k], change, rtol=1e-5, atol=2e-3 if k >= 10 else 1e-4)


def test_sensitivity_is_the_derivative_of_the_position():
    there = fisheye_lab(3, 420.0)
    camera = Camera(SIZE, there.matrix, np.array([0.02, -0.01, 0, 0, 0.003, 0, 0, 0]), "fisheye k1 k2 k3")
    pixels = np.array([[100.0, 80.0], [640.0, 480.0], [1200.0, 900.0]])
    by_parameters, _ = position_sensitivity(camera, there.floor, pixels, 0.2)
    shared = shared_parameters(camera, there.floor)
    for k in (0, 2, 4, 5, 8, 12, 14, 15, 17):
        step = np.zeros(18)
        step[k] = 1e-6 * max(1.0, abs(shared[k]))
        ahead, behind = (
            to_plane(
                Camera(SIZE, np.array([[s[0], 0, s[2]], [0, s[1], s[3]], [0, 0, 1]]), s[4:12], "fisheye k1 k2 k3"),
                Floor(Estimate(s, ()).T_camera_floor), pixels, 0.2,
            )
            for s in (shared + step, shared - step)
        )  # fmt: skip
        np.testing.assert_allclose(by_parameters[..., k], (ahead - behind) / (2 * step[k]), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("focal_px", "bend"), [(560, (-0.02, 0.005, 0, 0)), (330, STRONG)])
def test_a_fisheye_is_found_and_right_to_a_few_millimetres(focal_px, bend):
    """Its corners are 82° off the axis and more; pinhole models are wrong by centimetres."""
    there = fisheye_lab(11, focal_px, bend)
    views = there.views()
    found = calibrate_observations(views, CalibrateSettings(folds=3), {})
    assert is_fisheye(found.camera.lens_model)
    assert found.quality["held_out_rms_px"] < 1.15 * NOISE_PX
    off = rms_m(there.error_m(found.camera, found.floor, 0.2))
    assert off < 0.003
    assert not {"halves-disagree", "lens-fisheye"} & {each.code for each in found.findings}
    settings = CalibrateSettings(lens_models=("k1 k2", "k1 k2 p1 p2 k3"), folds=2, accept_refused=True)
    pinhole = calibrate_observations(views, settings, {})
    # NaN where they show nothing at all.
    assert not rms_m(there.error_m(pinhole.camera, pinhole.floor, 0.2)) < 5 * off


def test_a_pinhole_camera_that_fits_a_fisheye_is_kept_without_a_floor_alone_and_with_a_warning():
    """At 59° off the axis k1 k2 p1 p2 k3 leaves as little at the boards, and is wrong beyond them."""
    there = fisheye_lab(11, 780.0)
    views = there.views()
    settings = CalibrateSettings(lens_models=("k1 k2", "k1 k2 p1 p2 k3", *FISHEYES), folds=3)
    found = calibrate_observations(views, settings, {})
    assert is_fisheye(found.camera.lens_model)
    assert rms_m(there.error_m(found.camera, found.floor, 0.2)) < 1e-3
    assert "lens-fisheye" not in [each.code for each in found.findings]
    alone = replace(views, floor_boards=(), boards=(*views.boards, *views.floor_boards), reference=None)
    kept = calibrate_observations(alone, settings, {})
    assert kept.camera.lens_model == "k1 k2 p1 p2 k3"
    (told,) = (each for each in kept.findings if each.code == "lens-fisheye")
    assert "{lens_models: [fisheye, fisheye k1, fisheye k1 k2, fisheye k1 k2 k3]}" in told.text


def test_errors_on_a_plane_are_as_stated():
    normalised = []
    for seed in range(100, 124):
        there = fisheye_lab(seed, 560.0)
        views = replace(there.views(), doubts_std=np.zeros(10))  # Of boards as stated.
        found = calibrate_observations(views, CalibrateSettings(lens_models=("fisheye k1",), folds=2), {})
        pixels = np.array([[300.0, 250.0], [980.0, 250.0], [640.0, 480.0], [300.0, 700.0], [980.0, 700.0]])
        truth = Camera(SIZE, there.matrix, np.zeros(8), "fisheye")
        error = to_plane(found.camera, found.floor, pixels, 0.2) - to_plane(truth, there.floor, pixels, 0.2)
        covariance = position_covariance(found, pixels, 0.2)
        normalised.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error) / 2)
    assert 0.64 < np.mean(normalised) < 1.69


def test_a_view_that_does_not_fit_the_fisheye_does_not_speak_for_the_pinhole():
    """It fits a wrong camera as badly as all others do, so that this drops none."""
    there = fisheye_lab(12, 560.0)
    views = there.views()
    held = views.boards[4]
    wrong = held.corners_px + 8 * NOISE_PX * np.random.default_rng(0).normal(size=held.corners_px.shape)
    boards = (*views.boards[:4], replace(held, corners_px=wrong), *views.boards[5:])
    adjusted = adjust_sound_views(replace(views, boards=boards), tuple(LENS_MODELS), 3, 4.0)
    assert is_fisheye(adjusted.settled.chosen.model)
    assert list(adjusted.dropped) == [held.name]


def test_surveyed_marks_alone_tell_a_fisheye():
    there = fisheye_lab(13, 420.0)
    places = there.rng.uniform(-2.5, 2.5, (60, 2))
    pixels = there.on_floor(places)
    shown = ((pixels > 10) & (pixels < np.array(SIZE) - 11)).all(axis=1)
    seen = pixels[shown] + there.rng.normal(0, 0.3, (shown.sum(), 2))
    reference = FloorReference(marks_px=seen, marks_m=places[shown], mark_std_px=0.3)
    found = calibrate_marks(SIZE, reference, tuple(LENS_MODELS))
    assert is_fisheye(found.camera.lens_model)
    assert rms_m(there.error_m(found.camera, found.floor, 0.0)) < 0.003


def noted(monkeypatch, name: str) -> list[dict[str, object]]:
    """The keywords with which a function of the module is called."""
    original, calls = getattr(sound_views, name), []

    def call(*arguments, **keywords):
        calls.append(keywords)
        return original(*arguments, **keywords)

    monkeypatch.setattr(sound_views, name, call)
    return calls


@pytest.mark.parametrize(("noise_px", "begun"), [(0.35, [False]), (0.8, [False, True])])
def test_an_ordinary_lens_is_no_fisheye_and_tried_as_one_only_where_it_fits_badly(monkeypatch, noise_px, begun):
    scene, guesses = calibration_set(21, views=8, noise_px=noise_px), noted(monkeypatch, "first_guess")
    models = ("k1", "k1 k2", *FISHEYES)
    found = calibrate_observations(scene.seen, CalibrateSettings(lens_models=models, folds=3, accept_refused=True), {})
    assert not is_fisheye(found.camera.lens_model)
    assert [each["fisheye"] for each in guesses] == begun


def test_where_a_fisheye_leaves_clearly_less_no_pinhole_model_is_chosen_first(monkeypatch):
    settled = noted(monkeypatch, "settle")
    adjusted = adjust_sound_views(
        fisheye_lab(11, 600.0, noise_px=0.3).views(), ("k1 k2", "fisheye", "fisheye k1"), 2, 4.0
    )
    assert is_fisheye(adjusted.settled.chosen.model)
    assert len(settled) == 1


@pytest.mark.parametrize(
    ("lens", "may_be"),
    [((0.0, 0.0), False), ((0.1, 0.0), False), ((-0.06, 0.0), False), ((-0.15, 0.02), True), ((-0.13, 0.0), True)],
)
def test_a_lens_that_bends_far_may_be_a_fisheye(lens, may_be):
    """At the corners, inwards by 15 %, by 28 %, and by more than the model can tell."""
    shared = np.array([600.0, 600.0, 639.5, 479.5, *lens, *[0.0] * 12])
    assert may_be_fisheye(Estimate(shared, ()), SIZE) is may_be


def test_the_next_larger_model_is_one_of_the_same_family():
    there = fisheye_lab(14, 560.0)
    settings = CalibrateSettings(lens_models=("fisheye",), folds=2)
    views = there.views()
    found = calibrate_observations(views, settings, {})
    (choice,) = with_lens_choice(found, BOARD, views.floor_reference, settings, 0.2).choices
    assert (choice.chosen, choice.next) == ("fisheye", "fisheye k1")
    assert choice.change_m < 0.005


def test_pinhole_models_alone_refuse_it_or_say_so():
    views = fisheye_lab(11, 560.0).views()
    try:
        found = calibrate_observations(views, CalibrateSettings(lens_models=PINHOLES, folds=2), {})
    except RefusedError:
        return
    assert {"focal-length-uncertain", "halves-disagree"} & {each.code for each in found.findings}


@pytest.mark.shared
def test_photographs_of_a_wide_camera_are_those_of_a_fisheye(shared_dir):
    """One coefficient predicts what five of a pinhole camera do not."""
    adjusted = adjust_sound_views(photographs(shared_dir / "real" / "gopro_wide_calib"), tuple(LENS_MODELS), 6, 4.0)
    assert adjusted.settled.chosen.model == "k1 k2 p1 p2 k3"
    assert np.sqrt(adjusted.settled.chosen.score_px2) > 0.8
    assert adjusted.fisheye.model == "fisheye k1"
    assert np.sqrt(adjusted.fisheye.score_px2) < 0.31


def test_a_fisheye_has_no_other_coefficients():
    with pytest.raises(InputError, match="a fisheye does not have"):
        Camera(SIZE, np.eye(3), np.array([0, 0, 1e-3, 0, 0, 0, 0, 0]), "fisheye k1 k2")
