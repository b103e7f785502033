"""The stage: accuracy against known cameras, predicted against actual error, bad views, bad input, real pictures."""

import weakref
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from board_pictures import chessboard_pattern, pattern_to_image, picture
from studies.worlds import boards
from studies.worlds.boards import CornerScene, axis_rotation, calibration_set
from towval.calibration.board_search import find_boards
from towval.calibration.calibrate import CalibrateSettings, _listed, calibrate, calibrate_observations
from towval.calibration.doubts import doubts_std
from towval.calibration.observations import CalibrationObservations
from towval.calibration.sound_views import _sound
from towval.model import Board, Calibration, Camera, Floor, FloorReference, Severity
from towval.model.errors import InputError, RefusedError
from towval.model.geometry import transform
from towval.optics.plane_uncertainty import pixel_grid, uncertainty_map
from towval.optics.projection import project, to_plane

QUICK = CalibrateSettings(lens_models=("k1", "k1 k2"), folds=3)
BOARD = Board("chessboard", (9, 6), 0.04)


def position_error_m(calibration: Calibration, scene: CornerScene, height_m: float) -> float:
    pixels = pixel_grid(scene.camera.resolution_px, 24)
    estimated = to_plane(calibration.camera, calibration.floor, pixels, height_m)
    return float(np.sqrt(np.mean(np.sum((estimated - to_plane(scene.camera, scene.floor, pixels, height_m)) ** 2, -1))))


def calibrated(scene: CornerScene, settings: CalibrateSettings = QUICK) -> Calibration:
    return calibrate_observations(scene.seen, settings, {}, heights_m=(0.35,))


@pytest.mark.parametrize("seed", [27, 48])
def test_the_fit_to_a_wide_lens_ends_at_its_focal_length(monkeypatch, seed):
    ceiling, held = boards.ceiling_camera, boards.held_board

    def wide(rng: np.random.Generator) -> tuple[Camera, Floor]:
        camera, floor = ceiling(rng)
        matrix = camera.matrix.copy()
        matrix[:2, :2] *= 800 / matrix[0, 0]
        return replace(camera, matrix=matrix, distortion=np.array([-0.25, 0.065, 0, 0, 0, 0, 0, 0])), floor

    monkeypatch.setattr(boards, "ceiling_camera", wide)
    monkeypatch.setattr(boards, "held_board", partial(held, distance_m=(0.4, 1.0)))
    calibration = calibrated(boards.calibration_set(seed, views=6, floor="boards"))
    assert calibration.camera.matrix[0, 0] == pytest.approx(800, rel=0.01)


@pytest.mark.parametrize("floor", ["marks", "boards"])
def test_positions_are_right_and_their_predicted_deviations_honest(floor):
    errors, predicted = [], []
    for seed in range(70, 76):
        scene = calibration_set(seed, floor=floor)
        calibration = calibrated(scene)
        errors.append([position_error_m(calibration, scene, height) for height in (0.0, 0.35)])
        predicted.append([uncertainty_map(calibration, height, columns=24).rms_m for height in (0.0, 0.35)])
    ratio = np.sqrt(np.mean(np.square(predicted), axis=0) / np.mean(np.square(errors), axis=0))
    assert (ratio > 0.5).all()
    assert (ratio < 2.0).all()
    if floor == "marks":
        # 12 tilted views, corner noise 0.15 px: what a calibration has to reach.
        assert (np.median(errors, axis=0) < [0.6e-3, 0.8e-3]).all()


def test_camera_height_is_reported_with_its_deviation():
    scene = calibration_set(81, floor="boards")
    quality = calibrated(scene).quality
    apart = quality["camera_height_m"] - scene.floor.camera_position_m[2]
    assert abs(apart) < 3.5 * quality["camera_height_std_m"]


def test_marks_and_boards_together_are_better_than_marks_alone():
    marks, boards = calibration_set(82), calibration_set(82, floor="boards")
    both = replace(marks.seen, floor_boards=boards.seen.floor_boards)
    both = replace(both, reference=replace(marks.seen.reference, board_thickness_m=0.003, mark_std_px=0.15))
    alone, together = calibrated(marks), calibrated(replace(marks, seen=both))
    assert position_error_m(together, marks, 0.0) < 1e-3
    assert together.quality["position_std_mm at 0.000 m"] < alone.quality["position_std_mm at 0.000 m"]


def test_a_view_that_does_not_fit_is_dropped_with_the_reason():
    scene = calibration_set(83)
    boards = list(scene.seen.boards)
    rng = np.random.default_rng(0)
    boards[4] = replace(boards[4], corners_px=boards[4].corners_px + rng.normal(0, 3.0, (54, 2)))
    calibration = calibrated(replace(scene, seen=replace(scene.seen, boards=tuple(boards))))
    dropped = [view for view in calibration.views if view.dropped]
    assert [view.name for view in dropped] == ["board 4"]
    assert "does not fit" in dropped[0].dropped
    assert np.isnan(dropped[0].residuals_px).all()
    assert any(f.code == "view-dropped" and f.severity is Severity.WARNING for f in calibration.findings)


def test_a_floor_board_that_does_not_fit_is_refused_as_origin():
    scene = calibration_set(84, floor="boards")
    flat = list(scene.seen.floor_boards)
    flat[0] = replace(flat[0], corners_px=flat[0].corners_px + np.random.default_rng(0).normal(0, 3.0, (54, 2)))
    with pytest.raises(RefusedError, match="fixes the floor frame"):
        calibrated(replace(scene, seen=replace(scene.seen, floor_boards=tuple(flat))))


@pytest.mark.parametrize(("kind", "kept"), [("noise", True), ("misfit", False)])
def test_small_squares_may_be_noisier_but_fit_no_worse(kind, kept):
    """Sound sets of a small camera had been refused, since boards on the floor are noisier than those held near."""
    scene, rng = calibration_set(88, noise_px=0.03, floor="boards"), np.random.default_rng(88)
    flat = list(scene.seen.floor_boards)
    for i in range(7) if kind == "noise" else [3]:
        x, y = 6 * (flat[i].board_m - flat[i].board_m.mean(axis=0)).T
        off = rng.standard_normal((54, 2)) if kind == "noise" else np.column_stack([x * y, x**2 - y**2])
        off *= 0.2 / np.sqrt(np.mean(off**2))
        flat[i] = replace(flat[i], corners_px=flat[i].corners_px + off)
    sound = _sound(replace(scene.seen, floor_boards=tuple(flat)), 4.0, fisheye=False)
    assert list(sound.dropped) == ([] if kept else ["floor 3"])


def test_two_views_are_refused():
    with pytest.raises(RefusedError, match="too few views"):
        calibrated(calibration_set(85, views=2))


def test_covariance_is_symmetric_positive_and_zero_for_unused_coefficients():
    calibration = calibrated(calibration_set(86), CalibrateSettings(lens_models=("k1",), folds=3))
    np.testing.assert_allclose(calibration.covariance, calibration.covariance.T, rtol=1e-9)
    assert np.linalg.eigvalsh(calibration.covariance).min() > -1e-12
    assert not calibration.covariance[5:12].any()
    assert not calibration.camera.distortion[1:].any()


def blank(name: str) -> tuple[str, np.ndarray]:
    return name, np.full((480, 640), 128, np.uint8)


@pytest.fixture(scope="module")
def board_picture() -> np.ndarray:
    pattern = chessboard_pattern(9, 6, 40)
    quad = np.array([[100.0, 60.0], [520.0, 110.0], [480.0, 420.0], [70.0, 350.0]])
    return picture(pattern, pattern_to_image(pattern, quad), (640, 480))


def test_a_floor_picture_without_the_board_is_named(board_picture):
    reference = FloorReference(np.zeros(2), np.ones(2))
    with pytest.raises(InputError, match=r"first floor picture[\s\S]*floor.jpg"):
        calibrate([("a", board_picture)], [blank("floor.jpg")], BOARD, reference, QUICK)


def test_pictures_of_different_size_are_named(board_picture):
    small = cv2.resize(board_picture, (320, 240))
    with pytest.raises(InputError, match=r"not of one size[\s\S]*b: 320 × 240"):
        calibrate([("a", board_picture), ("b", small)], [], BOARD, FloorReference(np.zeros(2), np.ones(2)), QUICK)


def test_a_floor_picture_among_the_held_ones_counts_once(board_picture, monkeypatch):
    looked_at = []
    monkeypatch.setattr(
        "towval.calibration.calibrate.find_boards", lambda images, *_: (looked_at.extend(images), ([], {}))[1]
    )
    floor = [("floor.jpg", board_picture)]
    with pytest.raises(InputError, match="first floor picture"):
        calibrate([("a", board_picture), *floor], floor, BOARD, FloorReference(np.zeros(2), np.ones(2)), QUICK)
    assert [name for name, _ in looked_at] == ["a", "floor.jpg"]
    with pytest.raises(InputError, match="of the same name"):
        calibrate([("floor.jpg", board_picture[::-1])], floor, BOARD, FloorReference(np.zeros(2), np.ones(2)), QUICK)


class Counted(Sequence):
    """Blank pictures made when they are asked for; ``most`` is how many of them were alive at a time."""

    def __init__(self, count):
        self.count, self.alive, self.most = count, 0, 0

    def __len__(self):
        return self.count

    def __getitem__(self, index):
        if not 0 <= index < self.count:
            raise IndexError(index)
        image = np.full((60, 80), 128, np.uint8)
        self.alive += 1
        self.most = max(self.most, self.alive)
        weakref.finalize(image, self._gone)
        return f"{index:02d}.png", image

    def _gone(self):
        self.alive -= 1


def test_pictures_are_not_held_in_memory():
    images = Counted(40)
    with pytest.raises(InputError, match="no picture shows a chessboard"):
        calibrate(images, [], BOARD, FloorReference(np.zeros(2), np.ones(2)), QUICK)
    # Six of them are looked at together for any other board; each thread holds one, and one is on its way.
    assert images.most <= 6 + QUICK.threads + 1
    assert images.alive == 0


def test_an_unknown_lens_model_is_refused():
    with pytest.raises(InputError, match="lens_models"):
        CalibrateSettings(lens_models=("k1", "panoramic"))


def test_a_degenerate_set_is_refused_unless_accepted(monkeypatch):
    scene = calibration_set(87, tilt_deg=(2.0, 3.0), floor="boards")
    flat = {s.name for s in scene.seen.floor_boards}
    named = [(s.name, np.zeros((1080, 1920), np.uint8)) for s in scene.seen.observations]
    monkeypatch.setattr("towval.calibration.calibrate.find_boards", lambda *_: ([*scene.seen.observations], {}))
    held, floor = [i for i in named if i[0] not in flat], [i for i in named if i[0] in flat]
    with pytest.raises(RefusedError, match="hardly tilted"):
        calibrate(held, floor, BOARD, scene.seen.reference, QUICK)
    accepted = calibrate(held, floor, BOARD, scene.seen.reference, replace(QUICK, accept_refused=True))
    assert any(f.severity is Severity.REFUSAL for f in accepted.findings)


def test_a_refusal_names_the_mark_that_is_off_before_what_it_leaves_uncertain(monkeypatch):
    scene = calibration_set(87, tilt_deg=(2.0, 3.0))
    marks_m = scene.seen.reference.marks_m.copy()
    marks_m[3] += [0.0, 0.3]
    reference = replace(scene.seen.reference, marks_m=marks_m)
    named = [(s.name, np.zeros((1080, 1920), np.uint8)) for s in scene.seen.observations]
    monkeypatch.setattr("towval.calibration.calibrate.find_boards", lambda *_: ([*scene.seen.observations], {}))
    with pytest.raises(RefusedError) as error:
        calibrate(named, [], BOARD, reference, QUICK)
    assert error.value.got.startswith(f"The surveyed mark at {marks_m[3].tolist()} m is")


def test_a_refusal_says_that_no_board_is_held_where_the_floor_s_pattern_finds_all_pictures(monkeypatch):
    scene = calibration_set(87, tilt_deg=(2.0, 3.0), floor="boards")
    named = [(s.name, np.zeros((1080, 1920), np.uint8)) for s in scene.seen.floor_boards]
    monkeypatch.setattr("towval.calibration.calibrate.find_boards", lambda *_: ([*scene.seen.floor_boards], {}))
    with pytest.raises(RefusedError) as error:
        calibrate(named, named, BOARD, scene.seen.reference, QUICK)
    assert "narrow floor.more_images" in error.value.remedy


def test_a_wrong_mark_of_four_is_not_taken_for_another_zoom_of_the_held_pictures():
    """The held pictures had been corrected for it, by hundreds of pixels."""
    scene = calibration_set(89, noise_px=0.05)
    marks = scene.seen.reference
    off = marks.marks_m[[0, 2, 6, 8]] + [[0.0, 0.0], [0.05, 0.0], [0.0, 0.0], [0.0, 0.0]]
    reference = replace(marks, marks_px=marks.marks_px[[0, 2, 6, 8]], marks_m=off, mark_std_px=0.5)
    seen = replace(scene.seen, reference=reference, doubts_std=doubts_std(BOARD, reference))
    codes = {one.code for one in calibrate_observations(seen, QUICK, {}).findings}
    assert "mark-misfit" in codes
    assert "held-differ" not in codes


def test_a_fit_that_ends_nowhere_is_refused(monkeypatch):
    """One slip of the decimal point among six marks had ended in a traceback."""

    def astray(*_):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("towval.calibration.calibrate._calibrated", astray)
    with pytest.raises(RefusedError, match="no camera fits") as error:
        calibrate_observations(calibration_set(90).seen, QUICK, {})
    assert "floor.surveyed_marks" in error.value.remedy
    with pytest.raises(RefusedError) as error:
        calibrate_observations(calibration_set(90, floor="boards").seen, QUICK, {})
    assert "floor.surveyed_marks" not in error.value.remedy


def test_a_refusal_names_the_held_pictures_that_show_no_whole_board(monkeypatch):
    """With glare on all of them, more tilt had been asked for."""
    scene = calibration_set(87, views=4, tilt_deg=(2.0, 3.0), floor="boards")
    named = [(s.name, np.zeros((1080, 1920), np.uint8)) for s in scene.seen.observations]
    found = [s for s in scene.seen.observations if s.name in ("board 3", *(s.name for s in scene.seen.floor_boards))]
    glare = {f"board {i}": "no whole board found" for i in range(3)}
    monkeypatch.setattr("towval.calibration.calibrate.find_boards", lambda *_: (found, glare))
    with pytest.raises(RefusedError) as error:
        calibrate(named[:4], named[4:], BOARD, scene.seen.reference, QUICK)
    assert error.value.got.startswith("3 of 4 held pictures: no whole board found. The ")
    assert error.value.remedy.startswith("look at board 0, board 1, board 2: the board must be sharp, and no hand")


def charuco_pictures(count: int) -> tuple[list[tuple[str, np.ndarray]], np.ndarray]:
    """A ChArUco board of 9 × 6 squares of 50 mm, rendered in tilted poses by a camera without lens, and its matrix."""
    size, square_px = (960, 540), 40
    matrix = np.array([[800.0, 0, 470.0], [0, 800.0, 280.0], [0, 0, 1]])
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    drawn = cv2.aruco.CharucoBoard((9, 6), square_px, 30, dictionary).generateImage((440, 320), marginSize=40)
    to_metres = np.array([[0.05 / square_px, 0, -0.275], [0, 0.05 / square_px, -0.2], [0, 0, 1]])
    named = []
    for i in range(count):
        about = 2 * np.pi * i / count
        rotation = axis_rotation(0.55, about) @ cv2.Rodrigues(np.array([0, 0, 2.0 * i]))[0]
        shift = np.array([0.25 * np.cos(2.4 * i), 0.12 * np.sin(2.4 * i), 0.8 + 0.05 * (i % 3)])
        homography = matrix @ np.column_stack([rotation[:, :2], shift]) @ to_metres
        named.append((f"board {i}", picture(drawn, homography, size)))
    return named, matrix


def test_charuco_from_pictures_to_camera_and_floor():
    named, matrix = charuco_pictures(10)
    T = np.array([[1.0, 0, 0, 0.1], [0, -1, 0, 0.05], [0, 0, -1, 3.0], [0, 0, 0, 1]])
    truth = Camera((960, 540), matrix, np.zeros(8), "none"), Floor(T)
    marks_m = np.array([(x, y) for x in (-1.3, 0.0, 1.1) for y in (-0.7, 0.8)])
    marks_px = project(*truth, np.column_stack([marks_m, np.zeros(6)]))
    reference = FloorReference(marks_px=marks_px, marks_m=marks_m, mark_std_px=0.05)
    board = Board("charuco", (8, 5), 0.05, 0.0375, "DICT_4X4_50")
    calibration = calibrate(named, [], board, reference, CalibrateSettings(folds=3))
    assert np.abs(calibration.camera.distortion).max() < 2e-3
    deviation = np.sqrt(np.diag(calibration.covariance))[:4]
    apart = calibration.camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] - matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert (np.abs(apart) < 4 * deviation + 0.2).all()
    assert calibration.corner_noise_px < 0.1


@pytest.mark.shared
def test_the_lab_campaign(shared_dir):
    """Against what its makers say: the camera's pictures are ray-traced, its lens is not one of OpenCV's."""
    folder = shared_dir / "footage" / "lab_a"
    document = yaml.safe_load((folder / "campaign.yaml").read_text())
    held = pictures(folder, "calibration/board_*.jpg")
    flat = pictures(folder, "calibration/floor.jpg") + pictures(folder, "calibration/floor_*.jpg")
    reference = FloorReference(
        document["floor"]["origin_corner_px"],
        document["floor"]["x_axis_end_corner_px"],
        document["floor"]["board_thickness_m"],
    )
    reference = replace(reference, board_thickness_std_m=0.0)
    exact = replace(BOARD, size_std=0.0)
    calibration = calibrate(held, flat, exact, reference, CalibrateSettings(), heights_m=(0.25, 0.42))
    assert {view.name for view in calibration.views if view.dropped} == {"board_08.jpg", "board_16.jpg"}
    assert not [f.text for f in calibration.findings if f.severity is not Severity.NOTE]
    assert calibration.corner_noise_px < 0.05
    for height in (0.0, 0.25, 0.42):
        assert calibration.quality[f"position_std_mm at {height:.3f} m"] < 0.4
        assert calibration.quality[f"halves_difference_mm at {height:.3f} m"] < 0.8
    # The mean of 16 clicks scatters by 0.44 mm in x and in y; beyond 1.3 mm (three times that) it is the calibration.
    assert clicks_off_m(calibration, document, folder) < 1.3e-3


def clicks_off_m(calibration: Calibration, document: dict, folder: Path) -> float:
    """Mean distance of the clicks of runs a and b, which err by 0.7 px each, from the true corners of the tops [m].

    The mean is over all 16 clicks, vector by vector.
    """
    apart = []
    for run in "ab":
        first = np.genfromtxt(folder / f"{run}_truth.csv", delimiter=",", names=True)[0]
        for body in ("rover", "object"):
            pose = [first[f"{body}_x_m"], first[f"{body}_y_m"], first[f"{body}_heading_rad"]]
            true = transform(pose, document[body]["top_corners_m"])
            clicks = document["runs"][run]["first_frame_clicks_px"][body]
            height = document[body]["tracked_plane_height_m"]
            apart.append(to_plane(calibration.camera, calibration.floor, clicks, height) - true)
    return float(np.linalg.norm(np.concatenate(apart).mean(axis=0)))


def pictures(folder: Path, pattern: str) -> list[tuple[str, np.ndarray]]:
    return [(path.name, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for path in sorted(folder.glob(pattern))]


def camera_alone(folder: Path, pattern: str, board: Board) -> Calibration:
    """Calibrate a published set that has no floor."""
    named = pictures(folder, pattern)
    height, width = named[0][1].shape
    observations, unseen = find_boards(named, board, 2)
    return calibrate_observations(
        CalibrationObservations((width, height), tuple(observations)), CalibrateSettings(), unseen
    )


@pytest.mark.shared
def test_wide_gopro_agrees_with_its_published_calibration(shared_dir):
    folder = shared_dir / "real" / "gopro_wide_calib"
    calibration = camera_alone(folder, "GOPR*.jpg", Board("chessboard", (8, 6), 1.0))
    assert [view.name for view in calibration.views if view.dropped] == ["GOPR0055.jpg"]
    # OpenCV's own fit: 0.562 px with plain corners, 0.523 px with refined ones, the least any such model can have.
    assert calibration.quality["reprojection_rms_px"] < 0.53
    published = np.array([[560.331, 0, 651.263], [0, 561.377, 499.065], [0, 0, 1]])
    lens = np.array([-0.232949, 0.061724, -1.8e-5, 3.4e-5, -0.007550])
    pixels = pixel_grid((1280, 960), 40).reshape(-1, 1, 2)
    theirs = cv2.undistortPoints(pixels, published, lens, P=published)
    ours = cv2.undistortPoints(
        pixels, calibration.camera.matrix, calibration.camera.distortion, P=calibration.camera.matrix
    )
    assert np.median(np.linalg.norm(ours - theirs, axis=-1)) < 0.1


@pytest.mark.shared
def test_opencv_sample_set_is_better_than_its_published_calibration(shared_dir):
    folder = shared_dir / "real" / "opencv_left"
    calibration = camera_alone(folder, "left*.jpg", Board("chessboard", (9, 6), 0.025))
    assert calibration.camera.matrix[0, 0] == pytest.approx(532.8, abs=1.0)
    assert calibration.quality["reprojection_rms_px"] < 0.21
    # The published calibration leaves 1.2 px in this view.
    view = next(view for view in calibration.views if view.name == "left02.jpg")
    assert view.dropped or np.sqrt(np.mean(np.sum(view.residuals_px**2, axis=1))) < 0.3


@pytest.mark.parametrize("on_floor", [False, True])
def test_pictures_of_one_name_in_two_folders_are_refused(on_floor):
    """Views are told apart by these names."""
    picture = np.zeros((40, 60), np.uint8)
    twice, once = [("img_01.jpg", picture), ("img_01.jpg", picture + 1)], [("other.jpg", picture)]
    with pytest.raises(InputError, match=r"two calibration pictures have the same name(.|\n)*img_01\.jpg"):
        _listed(*((once, twice) if on_floor else (twice, once)))
