"""Surveyed marks that are grossly wrong: set aside and named, whatever the lens; sound ones stay."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from studies.worlds.boards import calibration_set
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.marks_alone import calibrate_marks
from towval.calibration.stray_marks import sound_marks, with_sound_marks
from towval.model import Calibration, FloorReference
from towval.model.errors import InputError
from towval.optics.projection import to_plane

RESOLUTION = (1920, 1080)
MODELS = CalibrateSettings().lens_models


def surveyed(seed: int, count: int, k1: float = -0.1, k2: float = 0.02) -> tuple[Calibration, FloorReference]:
    """A pinhole camera over a floor, and marks all over its picture with noise of 0.2 px."""
    scene, rng = calibration_set(9320 + seed), np.random.default_rng(seed)
    camera = replace(scene.camera, distortion=np.array([k1, k2, 0, 0, 0, 0, 0, 0]))
    pixels = rng.uniform([50, 50], [1870, 1030], (count, 2))
    marks_m = to_plane(camera, scene.floor, pixels, 0.0)
    seen = FloorReference(marks_px=pixels + rng.normal(0, 0.2, pixels.shape), marks_m=marks_m, mark_std_px=0.3)
    return Calibration(camera, scene.floor, np.zeros((18, 18)), 0.3), seen


def by_fisheye(seed: int, count: int, tilt_deg: float, bend: float) -> FloorReference:
    """Marks up to 82° from the axis of a fisheye of OpenCV's model, which shares no code with towval's."""
    rng = np.random.default_rng(seed)
    matrix, coefficients = np.array([[620.0, 0, 959.5], [0, 620.0, 539.5], [0, 0, 1]]), np.array([bend, -0.03, 0.01, 0])
    tilt = np.radians(tilt_deg) * np.array([np.cos(seed), np.sin(seed), 0.0])
    rotation = cv2.Rodrigues(tilt)[0] @ np.diag([1.0, -1.0, -1.0])
    marks, pixels = [], []
    while len(marks) < count:
        place = rng.uniform(-12, 12, 2)
        ray = rotation @ [*place, 0.0] + [0.0, 0.0, 2.5]
        if ray[2] <= 0 or np.degrees(np.arctan2(np.hypot(*ray[:2]), ray[2])) > 82:
            continue
        still = np.zeros(3)
        at = cv2.fisheye.projectPoints(ray.reshape(1, 1, 3), still, still, matrix, coefficients)[0].ravel()
        if (at > 20).all() and (at < np.array(RESOLUTION) - 20).all():
            marks.append(place)
            pixels.append(at)
    noisy = np.array(pixels) + rng.normal(0, 0.3, (count, 2))
    return FloorReference(marks_px=noisy, marks_m=np.array(marks), mark_std_px=0.3)


def a_metre_off(reference: FloorReference) -> tuple[FloorReference, set[int]]:
    """A slip of the tape."""
    marks_m = reference.marks_m.copy()
    marks_m[3, 0] += 1.0
    return replace(reference, marks_m=marks_m), {3}


def a_decimetre_off(reference: FloorReference) -> tuple[FloorReference, set[int]]:
    """A digit misread."""
    marks_m = reference.marks_m.copy()
    marks_m[5, 1] -= 0.1
    return replace(reference, marks_m=marks_m), {5}


def two_exchanged(reference: FloorReference) -> tuple[FloorReference, set[int]]:
    """Two rows in each other's place."""
    order = np.arange(len(reference.marks_m))
    order[[2, 7]] = 7, 2
    return replace(reference, marks_m=reference.marks_m[order]), {2, 7}


def pixel_turned(reference: FloorReference) -> tuple[FloorReference, set[int]]:
    """Row and column of a pixel exchanged."""
    marks_px = reference.marks_px.copy()
    marks_px[4] = marks_px[4, ::-1]
    return replace(reference, marks_px=marks_px), {4}


@pytest.mark.parametrize("blunder", [a_metre_off, a_decimetre_off, two_exchanged, pixel_turned])
@pytest.mark.parametrize(("seed", "count"), [(0, 16), (1, 24), (2, 60)])
def test_a_gross_blunder_is_left_out_and_named_and_places_are_right(blunder, seed, count):
    true, sound = surveyed(seed, count)
    reference, wrong = blunder(sound)
    found = calibrate_marks(RESOLUTION, reference, MODELS, heights_m=(0.35,))
    named = [each for each in found.findings if each.code == "mark-left-out"]
    assert {str(reference.marks_m[i].tolist()) for i in wrong} == {each.text.split(" m is")[0][21:] for each in named}
    assert not any(each.code == "mark-misfit" for each in found.findings)
    probes = np.random.default_rng(seed).uniform([200, 200], [1700, 900], (60, 2))
    off = to_plane(found.camera, found.floor, probes, 0.0) - to_plane(true.camera, true.floor, probes, 0.0)
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 1.5e-3


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [9, 16, 40])
def test_sound_marks_are_kept_whatever_the_lens(seed, count):
    for k1, k2 in ((-0.3, 0.09), (0.0, 0.0), (0.1, 0.02)):
        assert sound_marks(surveyed(seed, count, k1, k2)[1], RESOLUTION).all()
    for tilt_deg in (0, 15, 30):
        assert sound_marks(by_fisheye(seed, count, tilt_deg, 0.05), RESOLUTION).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_blunder_is_found_through_a_fisheye(seed):
    reference = by_fisheye(seed, 24, 15, 0.05)
    marks_px = reference.marks_px.copy()
    marks_px[6] += [90, -60]
    assert np.flatnonzero(~sound_marks(replace(reference, marks_px=marks_px), RESOLUTION)).tolist() == [6]


@pytest.mark.parametrize(("wrong", "refused"), [(5, False), (8, True)])
def test_marks_of_which_many_are_wrong_are_refused_with_the_worst_of_them(wrong, refused):
    _, sound = surveyed(3, 24)
    marks_m = sound.marks_m.copy()
    marks_m[:wrong] += np.random.default_rng(0).uniform(-0.8, 0.8, (wrong, 2))
    reference = replace(sound, marks_m=marks_m)
    if refused:
        with pytest.raises(InputError, match="contradict each other") as error:
            sound_marks(reference, RESOLUTION)
        assert error.value.got.startswith(f"{wrong} of 24 are far")
    else:
        assert np.flatnonzero(~sound_marks(reference, RESOLUTION)).tolist() == list(range(wrong))


def test_of_fewer_than_nine_marks_none_is_set_aside():
    _, sound = surveyed(4, 8)
    assert sound_marks(a_metre_off(sound)[0], RESOLUTION).all()


def test_a_mark_that_is_right_after_all_takes_part(monkeypatch):
    _, sound = surveyed(5, 20)
    first = np.arange(20) != 7
    monkeypatch.setattr("towval.calibration.stray_marks.sound_marks", lambda *_: first.copy())
    counts = []

    def calibrated(reference: FloorReference) -> Calibration:
        counts.append(len(reference.marks_px))
        return surveyed(5, 20)[0]

    assert with_sound_marks(sound, RESOLUTION, calibrated).findings == ()
    assert counts == [19, 20]


def test_beside_boards_a_blunder_is_left_out_too():
    scene = calibration_set(9330)
    marks_m = scene.seen.reference.marks_m.copy()
    marks_m[2] += [0.0, 0.4]
    seen = replace(scene.seen, reference=replace(scene.seen.reference, marks_m=marks_m))
    settings = CalibrateSettings(lens_models=("k1", "k1 k2"), folds=2)
    found, right = (calibrate_observations(each, settings, {}) for each in (seen, scene.seen))
    assert [each.code for each in found.findings if each.code.startswith("mark")] == ["mark-left-out"]
    probes = np.random.default_rng(0).uniform([200, 200], [1700, 900], (60, 2))
    off = to_plane(found.camera, found.floor, probes, 0.0) - to_plane(right.camera, right.floor, probes, 0.0)
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 1e-3
