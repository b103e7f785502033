"""The lens of a video against that of the pictures of the floor, bent by a formula that is no lens model."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.tracking.painted_floor import CAMERA, FIRST, FLOOR, floor_picture, warped
from towval.model import Calibration
from towval.optics.plane_uncertainty import position_sensitivity
from towval.optics.projection import to_plane
from towval.optics.view_motion import moved_view
from towval.tracking import lens_of_video as module
from towval.tracking.floor_registration import FloorRegistration
from towval.tracking.lens_of_video import lens_of_video
from towval.tracking.light import evened
from towval.tracking.view_at_start import calibration_at_start

CALIBRATION = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
WIDTH, HEIGHT = CAMERA.resolution_px
CORNER_PX = np.hypot(WIDTH, HEIGHT) / 2
FLOORS = [(f"floor_{i}.jpg", floor_picture(seed=20 + i)) for i in range(3)]
EVEN = [evened(picture) for _, picture in FLOORS]


def in_pictures(pixels, percent):
    """Pixels (..., 2) of the straight picture that one bent by so much at its corners shows at ``pixels``."""
    middle = np.array([WIDTH, HEIGHT]) / 2
    inwards = 1 - percent / 100 * np.sum((pixels - middle) ** 2, axis=-1, keepdims=True) / CORNER_PX**2
    return middle + (pixels - middle) * inwards


def bent(luma, percent):
    at = in_pictures(np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1), percent).astype(np.float32)
    return cv2.remap(luma, at[..., 0], at[..., 1], cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT)


def looked_at(luma, pictures=EVEN):
    seen = FloorRegistration(CAMERA, FLOOR, evened(luma), (), worst_std_px=np.inf)
    return lens_of_video(seen, luma, pictures)


def errors_m(found, percent, height):
    """Of positions all over the picture (n,), and their stated deviations (n,)."""
    pixels = np.stack(np.meshgrid(np.linspace(40, 440, 6), np.linspace(30, 330, 5)), axis=-1).reshape(-1, 2)
    off = to_plane(found.camera, found.floor, pixels, height) - to_plane(
        CAMERA, FLOOR, in_pictures(pixels, percent), height
    )
    by_parameters = position_sensitivity(found.camera, found.floor, pixels, height)[0]
    covariance = by_parameters @ found.covariance @ by_parameters.transpose(0, 2, 1)
    return np.linalg.norm(off, axis=1), np.sqrt(np.trace(covariance, axis1=1, axis2=2))


@pytest.mark.parametrize("percent", [-3.0, -1.0, 1.0, 3.0])
def test_a_video_that_is_straightened_and_its_pictures_not_is_corrected(percent):
    found, findings = calibration_at_start(CALIBRATION, bent(floor_picture(seed=7), percent), FLOORS)
    assert [one.code for one in findings if one.code != "camera_moved_before"] == ["other_lens"]
    corner_px, std_px = map(
        float, re.search(r"floor (\S+) px farther out \(deviation (\S+) px", findings[-1].text).groups()
    )
    assert 0.7 < corner_px / (percent / 100 * CORNER_PX) < 1.3
    assert 0.1 < std_px < 0.5
    plain = errors_m(CALIBRATION, percent, 0.0)[0].max()
    for height in (0.0, 0.4):
        off, std = errors_m(found, percent, height)
        assert off.max() < 0.2 * plain
        assert (off < 0.0005 + 3 * std).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "how", ["still", "shifted", "turned and zoomed", "enlarged", "leaning", "hidden", "noisy", "out of focus"]
)
def test_the_lens_is_the_same_however_the_camera_moved(how, seed):
    luma = floor_picture(seed=seed)
    if how == "shifted":
        luma = warped(luma, shift=(30.3, -20.4))
    elif how == "turned and zoomed":
        luma = warped(luma, turn_deg=8.0, zoom=1.03)
    elif how == "enlarged":
        luma = warped(luma, zoom=1.08)
    elif how == "leaning":
        luma = floor_picture(*moved_view(CAMERA, FLOOR, np.array([0.02, -0.03, 0, 0.01, 0, 0, 0, 0, 0])), seed=seed)
    elif how == "hidden":
        luma = floor_picture(seed=seed, hidden=0.3)
    elif how == "noisy":
        luma = floor_picture(seed=seed, noise=12.0)
    elif how == "out of focus":
        luma = cv2.GaussianBlur(luma, (0, 0), 3.0)
    assert looked_at(luma) is None


@pytest.mark.parametrize("coefficient", [0.02, 0.1])
def test_coefficients_are_off_by_what_is_stated(coefficient):
    """Between bias and scatter: blocks are placed to a twentieth of a pixel, which neighbours share."""
    off = []
    for seed in range(6):
        distortion = CAMERA.distortion + np.array([coefficient, 0, 0, 0, 0, 0, 0, 0])
        luma = floor_picture(replace(CAMERA, distortion=distortion), noise=4.0, seed=seed)
        found = looked_at(luma, [evened(floor_picture(seed=100 + 10 * seed + i)) for i in range(3)])
        off.append(np.linalg.solve(np.linalg.cholesky(found.covariance), found.coefficients - [coefficient, 0.0]))
    assert 0.3 < np.sqrt(np.mean(np.square(off))) < 1.5


@pytest.mark.parametrize("wider", [1.01, 1.03])
def test_a_stretch_is_not_taken_for_a_lens(wider):
    M = np.array([[wider, 0, 239.5 * (1 - wider)], [0, 1.0, 0]])
    luma = cv2.warpAffine(floor_picture(seed=7), M, (WIDTH, HEIGHT), flags=cv2.INTER_LANCZOS4, borderMode=4)
    assert looked_at(luma) is None


def test_too_few_blocks_tell_of_no_lens():
    luma = bent(FIRST, 2.0)
    assert looked_at(luma) is not None
    seen = FloorRegistration(CAMERA, FLOOR, evened(luma), (), worst_std_px=np.inf)
    seen.blocks, seen.block_places = seen.blocks[:8], seen.block_places[:8]
    assert module._step(seen, EVEN) is None


@pytest.mark.parametrize("seed", [9, 19, 23])
def test_blocks_found_at_wrong_places_tell_of_no_lens(seed):
    """Of a floor that a codec replaced; fits to such blocks end at lenses that fold the picture."""
    seen = FloorRegistration(CAMERA, FLOOR, evened(floor_picture(seed=7)), (), worst_std_px=np.inf)
    rng, shown = np.random.default_rng(seed), seen.pixels(seen.block_places, np.zeros(len(seen.prior)))
    found = rng.choice(len(shown), rng.integers(12, 40), replace=False)
    places = np.full_like(shown, np.nan)
    places[found] = shown[found] + rng.normal(0, 30, (len(found), 2))
    seen.blocks_in = lambda *_: places
    assert module._step(seen, EVEN[:1]) is None


def test_a_picture_is_shown_as_by_the_lens_of_the_others():
    luma = bent(FIRST, 2.0)
    found = looked_at(luma)
    straight = found.as_in_pictures(luma, FLOOR)
    inner = np.s_[30:-30, 30:-30]
    before, after = (np.abs(one[inner].astype(float) - FIRST[inner]).mean() for one in (luma, straight))
    assert after < 0.2 * before


@pytest.mark.parametrize("lens_model", ["none", "k1", "rational"])
def test_the_lens_model_holds_the_coefficients(lens_model):
    other = module.OtherLens(CAMERA, np.array([0.1, 0.02]), np.eye(2), np.zeros(9), np.zeros((9, 2)))
    corrected = other.of(replace(CAMERA, lens_model=lens_model))
    assert corrected.lens_model == ("rational" if lens_model == "rational" else "k1 k2")
    assert corrected.distortion[:2] == pytest.approx(CAMERA.distortion[:2] + other.coefficients)


def told(monkeypatch, *given):
    """What steps of so many deviations, with so many pixels of motion [px], lead to; and how many were asked for."""
    asked = []

    def step(*_):
        deviations, shift_px = given[len(asked)]
        asked.append(deviations)
        motion = np.append(np.zeros(7), [shift_px, 0.0])
        return module.OtherLens(CAMERA, np.array([1e-3 * deviations, 0.0]), 1e-6 * np.eye(2), motion, np.zeros((9, 2)))

    monkeypatch.setattr(module, "_step", step)
    return looked_at(FIRST), len(asked)


@pytest.mark.parametrize(("deviations", "other"), [(2.7, False), (3.3, True)])
def test_another_lens_differs_by_three_deviations(deviations, other, monkeypatch):
    assert (told(monkeypatch, (deviations, 0), (0, 0))[0] is not None) == other


@pytest.mark.parametrize(("second", "rounds"), [(1.8, 2), (2.5, 3)])
def test_a_lens_has_settled_where_the_last_step_is_within_two_deviations(second, rounds, monkeypatch):
    found, asked = told(monkeypatch, (10, 0), (second, 0), (0, 0))
    assert asked == rounds
    assert found.coefficients[0] == pytest.approx(1e-3 * (10 + second))


@pytest.mark.parametrize(("shift_px", "counts"), [(1.7, True), (2.3, False)])
def test_a_view_that_moved_by_two_pixels_is_taken_back_first(shift_px, counts, monkeypatch):
    found, _ = told(monkeypatch, (20, shift_px), (10, 0), (0, 0))
    assert found.coefficients[0] == pytest.approx(0.01 + 0.02 * counts)
    assert found.motion[7] == shift_px


def test_a_lens_that_does_not_settle_in_six_rounds_is_not_known(monkeypatch):
    assert told(monkeypatch, *[(10, 0)] * 10) == (None, 6)
