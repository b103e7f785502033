"""Boards and held pictures that are not what the calibration is told: corrected, and reported by name."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from studies.worlds.boards import BoardFaults, CornerScene, calibration_set
from towval.calibration import doubts
from towval.calibration.blocks import BOARD_DOUBTS, DOUBTS, HELD_DOUBTS, Estimate
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.corners import BoardObservation
from towval.calibration.doubts import doubts_std
from towval.calibration.observations import CalibrationObservations, first_guess
from towval.model import Board, Calibration, FloorReference
from towval.optics.plane_uncertainty import pixel_grid, uncertainty_map
from towval.optics.projection import to_plane

BOARD = Board("chessboard", (9, 6), 0.04)
QUICK = CalibrateSettings(lens_models=("k1", "k1 k2"), folds=3)


def film(seed: int, faults: BoardFaults, floor: str = "boards") -> CornerScene:
    """A sharp set with the deviations of a board that nobody stated."""
    scene = calibration_set(seed, floor=floor, faults=faults, noise_px=0.04, views=14)
    reference = scene.seen.reference
    if floor == "both":
        reference = replace(reference, mark_std_px=0.1)
    seen = replace(scene.seen, reference=reference, doubts_std=doubts_std(BOARD, reference))
    return replace(scene, seen=seen)


def calibrated(scene: CornerScene) -> Calibration:
    return calibrate_observations(scene.seen, QUICK, {}, heights_m=(0.35,))


def position_error_mm(calibration: Calibration, scene: CornerScene, height_m: float) -> float:
    pixels = pixel_grid(scene.camera.resolution_px, 12)
    apart = to_plane(calibration.camera, calibration.floor, pixels, height_m)
    apart = apart - to_plane(scene.camera, scene.floor, pixels, height_m)
    return 1e3 * float(np.sqrt(np.mean(np.sum(apart**2, axis=-1))))


def codes(calibration: Calibration) -> list[str]:
    return [finding.code for finding in calibration.findings]


def test_fits_to_boards_that_hardly_tell_the_focal_length_end_in_one_place():
    seen = film(8104, BoardFaults()).seen
    start = first_guess(seen)
    longer = replace(start, shared=start.shared * np.where(np.arange(18) < 2, 1.05, 1.0))
    one, other = (doubts.without_prejudice(seen, each, "k1") for each in (start, longer))
    # Its own deviation is 30 px.
    assert one.matrix[0, 0] == pytest.approx(other.matrix[0, 0], abs=0.3)
    assert one.noise_px == pytest.approx(other.noise_px, rel=1e-6)


@pytest.mark.parametrize("bow_m", [0.001, -0.002])
def test_a_bent_board_is_corrected(bow_m):
    scene = film(8100, BoardFaults(bow_m=bow_m))
    stiff = replace(scene, seen=replace(scene.seen, doubts_std=np.zeros(len(DOUBTS))))
    corrected, believed = calibrated(scene), calibrated(stiff)
    assert position_error_mm(corrected, scene, 0.35) < 1.0
    assert position_error_mm(believed, scene, 0.35) > 2.0
    assert codes(corrected) == ["board-bent"]
    assert corrected.quality["board_bow_mm"] == pytest.approx(abs(1e3 * bow_m), abs=0.3)
    assert f"{abs(1e3 * bow_m):.1f} ±" in corrected.findings[0].text


@pytest.mark.parametrize(("stretch", "floor"), [(0.003, "both"), (-0.01, "both"), (0.006, "boards")])
def test_a_print_that_is_stretched_along_one_side_is_corrected(stretch, floor):
    """A printer's feed: positions were off by as much as the squares, and nothing said why."""
    scene = film(8105, BoardFaults(stretch=stretch), floor)
    believed = np.where(np.isin(DOUBTS, ["stretch", "skew"]), 0.0, scene.seen.doubts_std)
    corrected = calibrated(scene)
    named = next(finding for finding in corrected.findings if finding.code == "board-stretched")
    assert f"{100 * stretch:+.2f} ±" in named.text or f"{100 * stretch:+.1f}" in named.text
    before, after = (
        position_error_mm(each, scene, 0.0)
        for each in (calibrated(replace(scene, seen=replace(scene.seen, doubts_std=believed))), corrected)
    )
    assert after < 0.75 * before
    # Of the size nothing but marks tells; without any it is as uncertain as the sides differ.
    assert after < (1.0 if floor == "both" else 2 * uncertainty_map(corrected, 0.0).rms_m * 1e3)


def test_a_stretch_no_larger_than_the_size_is_uncertain_is_not_reported():
    """Rendered boards whose pixels are whole are off by 0.04 %, and so are good prints."""
    scene = film(8105, BoardFaults(stretch=0.0004))
    assert codes(calibrated(scene)) == []
    exact = replace(scene.seen, doubts_std=np.where(np.isin(DOUBTS, ["size"]), 0.0, scene.seen.doubts_std))
    assert codes(calibrated(replace(scene, seen=exact))) == ["board-stretched"]


def test_a_size_known_exactly_stays_known_beside_a_stretch():
    scene = film(8105, BoardFaults(stretch=0.006))
    exact = replace(scene.seen, doubts_std=np.where(np.isin(DOUBTS, ["size"]), 0.0, scene.seen.doubts_std))
    calibration = calibrated(replace(scene, seen=exact))
    assert codes(calibration) == ["board-stretched"]
    assert calibration.quality["board_size_percent"] == 0.0


@pytest.mark.parametrize("floor", ["marks", "boards", "both"])
def test_a_sound_board_is_not_reported(floor):
    scene = film(8101, BoardFaults(), floor)
    calibration = calibrated(scene)
    assert codes(calibration) == []
    assert position_error_mm(calibration, scene, 0.0) < 1.0


@pytest.mark.parametrize("size", [0.99, 0.997])
def test_marks_correct_a_board_of_another_size(size):
    scene = film(8102, BoardFaults(size=size), "both")
    calibration = calibrated(scene)
    assert position_error_mm(calibration, scene, 0.35) < 1.0
    assert codes(calibration) == ["board-size"]
    assert f"{100 * (size - 1):+.1f}" in calibration.findings[0].text


def test_marks_correct_a_thicker_board():
    scene = film(8103, BoardFaults(thicker_m=0.02), "both")
    reference = replace(scene.seen.reference, board_thickness_std_m=0.0005)
    exact = replace(BOARD, size_std=1e-5)
    scene = replace(scene, seen=replace(scene.seen, doubts_std=doubts_std(exact, reference)))
    calibration = calibrated(scene)
    assert position_error_mm(calibration, scene, 0.35) < 1.0
    assert codes(calibration) == ["board-thickness"]
    assert "+20." in calibration.findings[0].text or "+19." in calibration.findings[0].text


def test_the_size_of_the_board_is_as_uncertain_as_stated_on_the_floor():
    scene = film(8104, BoardFaults())
    std_m = []
    for size_std in (0.0, 0.002):
        stds = doubts_std(replace(BOARD, size_std=size_std), scene.seen.reference)
        calibration = calibrated(replace(scene, seen=replace(scene.seen, doubts_std=stds)))
        std_m.append(uncertainty_map(calibration, 0.0, columns=12).std_m)
    pixels = uncertainty_map(calibration, 0.0, columns=12).pixels
    positions = to_plane(calibration.camera, calibration.floor, pixels, 0.0)
    distance = np.linalg.norm(positions, axis=-1)
    np.testing.assert_allclose(np.sqrt(std_m[1] ** 2 - std_m[0] ** 2), 0.002 * distance, rtol=0.1, atol=2e-4)


@pytest.mark.parametrize("zoom", [0.95, 1.03])
def test_held_pictures_of_another_zoom_are_corrected_and_reported(zoom):
    scene = film(8101, BoardFaults(zoom=zoom))
    calibration = calibrated(scene)
    assert position_error_mm(calibration, scene, 0.35) < 1.0
    assert codes(calibration) == ["held-differ"]
    percent, std = re.search(r"magnified by ([+-][\d.]+) ± ([\d.]+) %", calibration.findings[0].text).groups()
    assert abs(float(percent) - 100 * (zoom - 1)) < 3 * float(std)


def flipped(scene: CornerScene, sides: tuple[int, int]) -> CornerScene:
    """The held pictures turned over left to right, top to bottom, or both, as a camera's own software does."""
    size = np.array(scene.camera.resolution_px) - 1.0
    turn = np.array(sides, dtype=bool)
    mirrored = 1 if sides[0] == sides[1] else -1
    boards = tuple(
        replace(
            board,
            corners_px=np.where(turn, size - board.corners_px, board.corners_px),
            board_m=board.board_m * [1.0, mirrored],
        )
        for board in scene.seen.boards
    )
    return replace(scene, seen=replace(scene.seen, boards=boards))


@pytest.mark.parametrize(("sides", "name"), [((1, 0), "mirrored"), ((1, 1), "upside down")])
def test_mirrored_held_pictures_are_refused_by_name(sides, name):
    scene = flipped(film(8105, BoardFaults()), sides)
    middle = (np.array(scene.camera.resolution_px) - 1) / 2
    assert np.abs(scene.camera.matrix[:2, 2] - middle).max() > 5.0
    findings = calibrated(scene).findings
    assert [finding.code for finding in findings] == ["held-flipped"]
    assert f"are {name} against" in findings[0].text
    assert findings[0].severity == "refusal"


def test_a_camera_without_a_floor_has_no_doubt_of_its_held_pictures():
    scene = film(8106, BoardFaults())
    alone = replace(scene.seen, floor_boards=(), reference=None)
    calibration = calibrate_observations(alone, QUICK, {})
    assert calibration.covariance[0, 0] > 0
    assert BOARD_DOUBTS[0] == len(calibration.covariance)


def fitted(fitted_doubts, std, **values: float):
    """A fit of some doubts with deviations that are all the same."""
    found = np.array([values.get(name, 0.0) for name in DOUBTS])
    variance = np.diag(np.broadcast_to(np.square(std), len(fitted_doubts)))
    return doubts._Fit(Estimate(np.zeros(18), (), doubts=found), fitted_doubts, variance)


@pytest.mark.parametrize(
    ("bow_m", "std_m", "named"),
    [(0.0002, 1e-5, False), (0.0004, 1e-5, True), (0.002, 0.0009, False), (0.002, 0.0005, True)],
)
def test_a_bow_is_named_from_three_tenths_of_a_millimetre_and_three_deviations_on(bow_m, std_m, named):
    fit = fitted(BOARD_DOUBTS, std_m, bow_y=bow_m)
    assert [each.code for each in doubts._findings(SimpleNamespace(), fit, BOARD_DOUBTS[:0])] == ["board-bent"] * named


@pytest.mark.parametrize(("deviations", "flip"), [(2.0, "mirrored"), (4.5, "")])
def test_a_principal_point_within_three_deviations_of_the_mirrored_one_is_mirrored(deviations, flip):
    """That of the floor's pictures is 10 px left of the middle, so 20 px to the right where they are mirrored."""
    fit = fitted(HELD_DOUBTS, 0.5, held_u=20.0 + 0.5 * deviations)
    fit.estimate.shared[2:4] = 949.5, 539.5
    assert doubts._flip((1920, 1080), fit.estimate, np.full(8, 0.5)) == flip


@pytest.mark.parametrize(("deviations", "contradicted"), [(2.0, False), (3.5, False), (4.3, True), (8.0, True)])
def test_one_of_ten_thousand_sound_boards_is_taken_for_one_of_another_size(monkeypatch, deviations, contradicted):
    """A normal deviate is beyond 3.9 deviations once in ten thousand; here those of the fit and of the statement."""
    fit = fitted(BOARD_DOUBTS, 0.0006, size=0.001 * deviations)
    monkeypatch.setattr(doubts, "_fit", lambda *_: fit)
    stated = np.array([0.0008, *[0.001] * 4, *[0.0] * 5])
    seen = SimpleNamespace(doubts_std=stated, reference=None, boards=())
    trial = SimpleNamespace(estimate=fit.estimate)
    assert doubts._contradiction(seen, trial, "k1", BOARD_DOUBTS[:1])[0] == contradicted


def test_sound_pictures_are_not_told_to_be_mirrored_since_a_valley_bends():
    """Corners of 14 held boards and 5 on the floor that MuJoCo rendered (data/rendered_boards.npz): one camera.

    The fit that leaves zoom and crop of the held pictures open ends 8 % off, though hardly better, and was believed.
    """
    seen = np.load(Path(__file__).with_name("data") / "rendered_boards.npz")
    held, flat = (
        tuple(BoardObservation(f"{kind}_{i}", px, m) for i, (px, m) in enumerate(zip(*both, strict=True)))
        for kind, both in (
            ("held", (seen["held_px"].astype(float), seen["held_m"].astype(float))),
            ("floor", (seen["floor_px"].astype(float), seen["floor_m"].astype(float))),
        )
    )
    reference = FloorReference(*seen["ends_px"], board_thickness_m=0.003)
    observed = CalibrationObservations((1280, 720), held, flat, reference, doubts_std(BOARD, reference))
    calibration = calibrate_observations(observed, QUICK, {}, heights_m=(0.35,))
    assert "held-flipped" not in codes(calibration)
    assert calibration.camera.matrix[0, 0] == pytest.approx(932.04, abs=3)
