"""Degenerate sets are flagged in words, good ones are not; the halves see what the residuals do not."""

import re
from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.boards import CornerScene, calibration_set, ceiling_camera
from towval.calibration.adequacy import covered_share, squeeze_findings, view_findings, view_statistics
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.observations import first_guess
from towval.model import Calibration, Camera, Floor, FloorReference, Severity
from towval.model.errors import InputError

QUICK = CalibrateSettings(lens_models=("k1", "k1 k2"), folds=3)


def calibrated(scene: CornerScene, settings: CalibrateSettings = QUICK, heights_m=(0.35,)) -> Calibration:
    return calibrate_observations(scene.seen, settings, {}, heights_m=heights_m)


def flags(calibration: Calibration) -> dict[str, str]:
    return {f.code: f.text for f in calibration.findings if f.severity is not Severity.NOTE}


@pytest.mark.parametrize("seed", [51, 52])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (4.0, 4.0)])
def test_a_set_without_tilt_is_flagged(seed, tilt):
    found = flags(calibrated(calibration_set(seed, tilt_deg=tilt)))
    text = found.get("no-tilt") or found["focal-length-uncertain"]
    assert "tilted by 20° to 40°" in text
    assert "focal length is uncertain by" in text


def level_camera(rng: np.random.Generator) -> tuple[Camera, Floor]:
    """A ceiling camera that looks straight down."""
    camera, floor = ceiling_camera(rng)
    T = floor.T_camera_floor.copy()
    T[:3, :3] = np.diag([1.0, -1.0, -1.0])
    return camera, Floor(T)


@pytest.mark.parametrize("held", [True, False])
def test_a_set_without_any_tilt_against_the_picture_is_refused(held, monkeypatch):
    """Focal length and distance cannot be told apart: nothing may state the focal length as known."""
    if held:
        monkeypatch.setattr("studies.worlds.boards.ceiling_camera", level_camera)
    scene = calibration_set(52, floor="boards", tilt_deg=(0.0, 0.3), views=6)
    if not held:
        scene = replace(scene, seen=replace(scene.seen, boards=()))
    calibration = calibrated(scene, CalibrateSettings(lens_models=("k1",), folds=2))
    found = {f.code: f.severity for f in calibration.findings}
    assert found["no-tilt" if held else "focal-length-uncertain"] is Severity.REFUSAL


def test_a_focal_length_that_no_camera_has_is_refused():
    """However certain it is: boards behind a camera of negative focal length look alike."""
    scene = calibration_set(54, views=6)
    guess = first_guess(scene.seen)
    shared = guess.shared.copy()
    shared[:2] *= -1
    tilted = replace(guess, shared=shared), np.diag([1e-6, *np.zeros(17)])
    found = {f.code: f.severity for f in view_findings(view_statistics(scene.seen, *tilted))}
    assert found["focal-length-uncertain"] is Severity.REFUSAL


@pytest.mark.parametrize("floor", ["marks", "boards"])
def test_boards_in_the_middle_are_flagged(floor):
    found = flags(calibrated(calibration_set(53, share=0.3, floor=floor)))
    assert "only in a part of the picture" in found["centre-only"]
    assert "all over the picture" in found["centre-only"]


def test_three_views_are_flagged():
    found = flags(calibrated(calibration_set(54, views=3)))
    assert "Too few views: 3 held boards" in found["few-views"]


@pytest.mark.parametrize("seed", [55, 56])
@pytest.mark.parametrize("floor", ["marks", "boards"])
def test_a_good_set_is_not_flagged(seed, floor):
    assert flags(calibrated(calibration_set(seed, floor=floor))) == {}


def test_halves_of_a_sound_set_differ_by_what_noise_explains():
    quality = calibrated(calibration_set(57, floor="boards")).quality
    ratio = quality["halves_difference_mm at 0.350 m"] / quality["halves_expected_mm at 0.350 m"]
    assert 0.2 < ratio < 2.5


def bent(scene: CornerScene, sag_m: float) -> CornerScene:
    """The same corners, attributed to a board whose measured squares vary: stretched towards one side."""
    boards = tuple(
        replace(s, board_m=s.board_m + sag_m * np.column_stack([s.board_m[:, 0] ** 2 / 0.16**2, np.zeros(54)]) * sign)
        for s, sign in zip(scene.seen.boards, [1.0, -1.0] * len(scene.seen.boards), strict=False)
    )
    return replace(scene, seen=replace(scene.seen, boards=boards))


def test_halves_that_disagree_are_flagged_in_millimetres():
    found = flags(calibrated(bent(calibration_set(58, noise_px=0.05), 0.004)))
    assert "where the corner noise explains" in found["halves-disagree"]


def test_a_floor_from_one_small_board_is_called_extrapolated():
    scene = calibration_set(59, floor="boards", noise_px=0.1)
    one = replace(scene, seen=replace(scene.seen, floor_boards=scene.seen.floor_boards[:1]))
    all_of_them, alone = calibrated(scene), calibrated(one)
    assert "floor-extrapolated" not in flags(all_of_them)
    text = flags(alone)["floor-extrapolated"]
    assert "extrapolated" in text
    assert "mm over the picture" in text
    assert alone.quality["position_std_mm at 0.000 m"] > 3 * all_of_them.quality["position_std_mm at 0.000 m"]


def test_a_mistyped_mark_is_found():
    scene = calibration_set(60)
    reference = scene.seen.reference
    marks_m = reference.marks_m.copy()
    marks_m[4] += [0.05, 0.0]
    spoilt = FloorReference(marks_px=reference.marks_px, marks_m=marks_m, mark_std_px=reference.mark_std_px)
    calibration = calibrated(replace(scene, seen=replace(scene.seen, reference=spoilt)))
    (text,) = [f.text for f in calibration.findings if f.code == "mark-left-out"]
    assert f"{marks_m[4].tolist()}" in text


def test_coverage_is_the_hull_of_all_corners():
    corner = np.array([[0.0, 0.0], [100.0, 0.0]])
    assert covered_share([corner, corner + np.array([0.0, 50.0])], (200, 100)) == pytest.approx(0.25)
    assert covered_share([], (200, 100)) == 0.0


def test_marks_worse_than_stated_are_believed_less():
    scene = calibration_set(61)
    rng = np.random.default_rng(0)
    honest = scene.seen.reference
    noisy = replace(honest, marks_px=honest.marks_px + rng.normal(0, 1.5, honest.marks_px.shape))
    sound, spoilt = (
        calibrated(replace(scene, seen=replace(scene.seen, reference=reference))) for reference in (honest, noisy)
    )
    assert "marks-noisy" not in flags(sound)
    assert "the larger figure is used" in flags(spoilt)["marks-noisy"]
    assert spoilt.quality["marks_rms_px"] > 0.7
    assert spoilt.quality["position_std_mm at 0.000 m"] > 3 * sound.quality["position_std_mm at 0.000 m"]
    marks = next(view for view in spoilt.views if view.name == "surveyed marks")
    np.testing.assert_array_equal(marks.board_m, honest.marks_m)


def test_marks_on_a_line_are_refused():
    scene = calibration_set(62)
    line = np.array([0, 1, 2])
    reference = scene.seen.reference
    few = FloorReference(
        marks_px=np.repeat(reference.marks_px[line], 2, axis=0), marks_m=np.repeat(reference.marks_m[line], 2, axis=0)
    )
    with pytest.raises(InputError, match="all on one line"):
        calibrated(replace(scene, seen=replace(scene.seen, reference=few)))


def test_two_marks_at_one_pixel_are_refused():
    scene = calibration_set(62)
    pixels = scene.seen.reference.marks_px.copy()
    pixels[5] = pixels[1]
    with pytest.raises(InputError, match="two surveyed marks have the same pixel"):
        calibrated(replace(scene, seen=replace(scene.seen, reference=replace(scene.seen.reference, marks_px=pixels))))


def stretched(scene: CornerScene, by: float) -> CornerScene:
    """The same boards in pictures that were saved that much wider, about their middle."""
    middle = np.array([0.5 * scene.seen.resolution_px[0], 0.0])

    def wider(boards):
        return tuple(replace(one, corners_px=middle + (one.corners_px - middle) * [by, 1.0]) for one in boards)

    seen = replace(scene.seen, boards=wider(scene.seen.boards), floor_boards=wider(scene.seen.floor_boards))
    return replace(scene, seen=seen)


def test_pictures_saved_at_another_aspect_ratio_are_named():
    text = flags(calibrated(stretched(calibration_set(41), 1.02)))["pictures-squeezed"]
    assert re.search(r"by \+(1\.[89]|2\.)", text)  # The scene's own camera has pixels 0.1 % off square.


@pytest.mark.parametrize(
    ("squeeze", "named"), [(1.0, False), (1.004, False), (1.006, True), (0.996, False), (0.994, True)]
)
def test_pixels_are_square_to_half_a_percent(squeeze, named):
    calibration = calibrated(calibration_set(41))
    matrix = calibration.camera.matrix.copy()
    matrix[0, 0] = squeeze * matrix[1, 1]
    camera = replace(calibration.camera, matrix=matrix)
    exact = replace(calibration, camera=camera, covariance=1e-12 * np.eye(18))
    assert bool(squeeze_findings(exact, 0.005)) == named
