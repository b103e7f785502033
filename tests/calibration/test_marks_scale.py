"""Surveyed marks in another unit than metres, or in pixels of a reduced picture, beside boards that are not."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.boards import calibration_set
from studies.worlds.fisheyes import fisheye_lab
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.marks_scale import check_scale
from towval.calibration.observations import CalibrationObservations
from towval.model.errors import InputError


def with_marks(
    seed: int, *, by: float = 1.0, pixels_by: float = 1.0, kept: tuple[int, ...] = (0, 1, 2, 3)
) -> CalibrationObservations:
    """Boards and up to four marks, whose coordinates and pixels are multiplied."""
    seen = calibration_set(seed, floor="both").seen
    reference, kept = seen.reference, list(kept)
    marks_m, marks_px = by * reference.marks_m[kept], pixels_by * reference.marks_px[kept]
    return replace(seen, reference=replace(reference, marks_m=marks_m, marks_px=marks_px))


@pytest.mark.parametrize(
    ("by", "kept", "said"),
    [
        (1000.0, (0, 1, 2, 3), "millimetres"),
        (100.0, (0, 3), "centimetres"),
        (1 / 0.0254, (0, 1, 2, 3), "inches"),
        (1 / 0.3048, (1, 2), "feet"),
        (2.0, (0, 1, 2, 3), "check units"),
        (0.5, (0, 1, 2, 3), "check units"),
    ],
)
def test_marks_of_another_unit_are_refused_with_its_name(by, kept, said):
    """All boards on the floor had been left out as misfits, and the floor was hundreds of metres below the camera."""
    with pytest.raises(InputError, match="not of one scale") as error:
        calibrate_observations(with_marks(71, by=by, kept=kept), CalibrateSettings(), {})
    assert said in error.value.remedy
    factor = float(error.value.got.split()[1])
    assert factor == pytest.approx(by, rel=0.1)


def test_pixels_of_a_picture_of_half_the_size_are_refused():
    with pytest.raises(InputError, match="not of one scale") as error:
        check_scale(with_marks(72, pixels_by=0.5))
    assert float(error.value.got.split()[1]) == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("by", [1.0, 1.25, 0.8])
@pytest.mark.parametrize("seed", [73, 74, 75])
def test_sound_marks_and_those_that_a_fit_can_tell_pass(seed, by):
    check_scale(with_marks(seed, by=by))


def test_a_slip_of_one_mark_is_not_taken_for_another_scale():
    seen = with_marks(76)
    marks_m = seen.reference.marks_m.copy()
    marks_m[3] *= 10
    check_scale(replace(seen, reference=replace(seen.reference, marks_m=marks_m)))


def test_a_mark_given_twice_does_not_hide_another_unit():
    with pytest.raises(InputError, match="not of one scale"):
        check_scale(with_marks(77, by=100.0, kept=(0, 0, 3)))


def test_a_mark_clicked_twice_at_two_pixels_does_not_hide_another_unit():
    twice = with_marks(77, by=1000.0, kept=(0, 0, 1, 2, 3))
    pixels = twice.floor_reference.marks_px + np.array([[0.4, -0.3], *np.zeros((4, 2))])
    with pytest.raises(InputError, match="millimetres"):
        check_scale(replace(twice, reference=replace(twice.floor_reference, marks_px=pixels)))


@pytest.mark.parametrize("focal_px", [380.0, 700.0])
@pytest.mark.parametrize("seed", [78, 79, 80, 81])
def test_two_sound_marks_at_the_edge_of_a_fisheye_pass(seed, focal_px):
    """A camera without distortion, as is taken at first, sees them up to half as far again apart."""
    lab = fisheye_lab(seed, focal_px)
    seen, rng = lab.views(), np.random.default_rng(seed)
    places = rng.uniform(-2.0, 2.0, (400, 2))
    pixels = lab.on_floor(places)
    within = ((pixels > 5) & (pixels < (1275, 955))).all(axis=1)
    outermost = np.argsort(-np.linalg.norm(pixels[within] - (640, 480), axis=1))[:2]
    marks = replace(seen.reference, marks_px=pixels[within][outermost], marks_m=places[within][outermost])
    check_scale(replace(seen, reference=marks))
