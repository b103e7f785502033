"""Corners of rendered boards against the places they were rendered at."""

import cv2
import numpy as np
import pytest

from board_pictures import chessboard_pattern, pattern_to_image, picture, true_corners
from towval.calibration import board_search, corners
from towval.calibration.adequacy import blur_findings
from towval.calibration.board_search import find_boards, fitting_corner_counts
from towval.calibration.calibrate import _beside_another
from towval.calibration.corners import (
    BoardObservation,
    facing_camera,
    observe_charuco,
    observe_chessboard,
    observe_small_chessboard,
    refine,
)
from towval.calibration.observations import CalibrationObservations
from towval.model import Board
from towval.model.errors import InputError

CHESSBOARD = Board("chessboard", (9, 6), 0.04)
CHARUCO = Board("charuco", (8, 5), 0.04, 0.03, "DICT_4X4_50")
SIZE = (640, 480)
TURNED = np.array([[100.0, 60.0], [520.0, 110.0], [480.0, 420.0], [70.0, 350.0]])


def scaled(quad: np.ndarray, scale: float) -> np.ndarray:
    centre = quad.mean(axis=0)
    return centre + scale * (quad - centre)


def sorted_pairs(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Distance of each true corner to the nearest one found."""
    return np.linalg.norm(true[:, None] - found[None], axis=2).min(axis=1)


@pytest.mark.parametrize(
    ("scale", "thorough", "tolerance_px"),
    [(1.0, False, 0.1), (0.5, False, 0.12), (0.33, True, 0.15), (0.2, True, 0.25)],
)
def test_chessboard_corners_are_subpixel_down_to_small_boards(scale, thorough, tolerance_px):
    pattern = chessboard_pattern(9, 6, 40)
    homography = pattern_to_image(pattern, scaled(TURNED, scale))
    observation = observe_chessboard("a", picture(pattern, homography, SIZE), CHESSBOARD, thorough=thorough)
    # The tolerance is for the worst of 54 corners; at the smallest scale a square is 7 px wide and its window 5 px.
    assert sorted_pairs(observation.corners_px, true_corners(9, 6, 40, homography)).max() < tolerance_px


@pytest.mark.parametrize("scale", [0.35, 0.8])
@pytest.mark.parametrize(("floor", "black", "white", "noise"), [(150, 10, 60, 4), (200, 10, 60, 3), (140, 20, 70, 8)])
def test_a_board_darker_than_the_floor_behind_it_is_found(scale, floor, black, white, noise):
    """Held against the light. With grey levels spread evenly, the thorough finder had seen none of them."""
    pattern = chessboard_pattern(9, 6, 40)
    homography = pattern_to_image(pattern, scaled(TURNED, scale))
    board = black + (white - black) * (picture(pattern, homography, SIZE) / 255)
    on = cv2.warpPerspective(np.ones(pattern.shape), homography, SIZE)
    image = on * board + (1 - on) * floor + np.random.default_rng(0).normal(0, noise, on.shape)
    dark = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    observation = observe_chessboard("a", dark, CHESSBOARD, thorough=True)
    off_px = sorted_pairs(observation.corners_px, true_corners(9, 6, 40, homography))
    assert np.sqrt(np.mean(off_px**2)) < 0.45  # The noise is a sixth of the contrast of the noisiest.
    assert fitting_corner_counts([("a", dark), ("b", dark)]) == (9, 6)


def board_of(square_px: float) -> np.ndarray:
    """A picture of a board whose shortest side of a square has so many pixels."""
    pattern = chessboard_pattern(9, 6, 40)
    at_full_size = true_corners(9, 6, 40, pattern_to_image(pattern, TURNED))
    grid = at_full_size.reshape(6, 9, 2)
    side_px = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
    return picture(pattern, pattern_to_image(pattern, scaled(TURNED, square_px / side_px)), SIZE, 3.0)


def test_squares_of_five_pixels_are_found():
    pattern = chessboard_pattern(9, 6, 40)
    homography = pattern_to_image(pattern, scaled(TURNED, 0.13))
    image = picture(pattern, homography, SIZE, 3.0)
    observation = observe_small_chessboard("a", image, CHESSBOARD)
    off_px = sorted_pairs(observation.corners_px, true_corners(9, 6, 40, homography))
    assert np.sqrt(np.mean(off_px**2)) < 0.15


@pytest.mark.parametrize(("held_px", "floor_px", "searched"), [
    (12.0, 20.0, ["held"]),
    (20.0, 12.0, ["floor"]),
    (20.0, 20.0, []),
    (None, 20.0, ["held", "no board"]),
])  # fmt: skip
def test_small_squares_are_looked_for_where_those_found_are_not_large(monkeypatch, held_px, floor_px, searched):
    """In pictures twice as large, which take a second and half a gigabyte: a hand hides a large board as well."""
    looked_at = []
    monkeypatch.setattr(board_search, "observe_small_chessboard", lambda name, *_, **__: looked_at.append(name))
    blank = np.full(SIZE[::-1], 128, np.uint8)
    pictures = [
        ("no board", blank if held_px is None else board_of(held_px)),
        ("held", blank),
        ("on the floor", board_of(floor_px)),
        ("floor", blank),
    ]
    found, unseen = find_boards(pictures, CHESSBOARD, 1, on_floor=2)
    assert sorted(looked_at) == searched
    assert len(found) + len(unseen) == 4


def test_a_window_wider_than_a_square_pulls_corners_away():
    pattern = chessboard_pattern(9, 6, 40)
    homography = pattern_to_image(pattern, scaled(TURNED, 0.33))
    image, true = picture(pattern, homography, SIZE), true_corners(9, 6, 40, homography)
    start = true + 0.4
    fitted = refine(image, start, np.full(len(true), 10.0))
    pulled = refine(image, start, np.full(len(true), 10.0), 1.1)
    assert np.linalg.norm(fitted - true, axis=1).max() < 0.12
    assert np.linalg.norm(pulled - true, axis=1).max() > 0.5


def test_board_coordinates_explain_the_corners():
    pattern = chessboard_pattern(9, 6, 40)
    homography = pattern_to_image(pattern, TURNED)
    observation = observe_chessboard("a", picture(pattern, homography, SIZE), CHESSBOARD, thorough=True)
    fit = cv2.findHomography(observation.board_m, observation.corners_px)[0]
    again = cv2.perspectiveTransform(observation.board_m.reshape(-1, 1, 2), fit).reshape(-1, 2)
    np.testing.assert_allclose(again, observation.corners_px, atol=0.15)


def test_a_board_faces_the_camera_in_whatever_order_it_was_read():
    board = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    upright = 100 * board * [1, -1] + 300
    np.testing.assert_array_equal(facing_camera(board, upright), board)
    np.testing.assert_array_equal(facing_camera(board, 100 * board + 300), board * [1, -1])


def charuco_picture(quad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    drawn = cv2.aruco.CharucoBoard((9, 6), 40, 30, dictionary).generateImage((440, 320), marginSize=40)
    homography = pattern_to_image(drawn, quad)
    column, row = np.meshgrid(np.arange(8), np.arange(5))
    at = 40.0 * (np.stack([column, row], axis=-1).reshape(-1, 1, 2) + 2.0) - 0.5
    return picture(drawn, homography, SIZE), cv2.perspectiveTransform(at, homography).reshape(-1, 2)


def test_charuco_corners_are_subpixel_and_in_place():
    image, true = charuco_picture(TURNED)
    observation = observe_charuco("a", image, CHARUCO)
    assert len(observation.corners_px) == 40
    assert sorted_pairs(observation.corners_px, true).max() < 0.15
    homography = cv2.findHomography(observation.board_m, observation.corners_px)[0]
    again = cv2.perspectiveTransform(observation.board_m.reshape(-1, 1, 2), homography).reshape(-1, 2)
    np.testing.assert_allclose(again, observation.corners_px, atol=0.2)


def test_charuco_squares_of_thirteen_pixels_are_found():
    """As of a board on the floor. No corner of it had been found, and not all at 15 px."""
    image, true = charuco_picture(scaled(TURNED, 0.35))
    observation = observe_charuco("a", image, CHARUCO)
    assert len(observation.corners_px) > 30
    assert sorted_pairs(true, observation.corners_px).max() < 0.3


@pytest.mark.parametrize(("scale", "enlarged"), [(0.5, True), (0.8, False)])
def test_a_part_of_a_charuco_board_is_sought_in_a_larger_picture_where_its_squares_are_small(
    monkeypatch, scale, enlarged
):
    image, _ = charuco_picture(scaled(TURNED, scale))
    image[:, 260:] = 128
    seen = []
    monkeypatch.setattr(corners, "_enlarged", lambda picture: seen.append(picture.shape))
    observation = observe_charuco("a", image, CHARUCO)
    assert 8 <= len(observation.corners_px) < 40
    assert bool(seen) == enlarged


def test_charuco_board_may_leave_the_picture():
    image, _ = charuco_picture(TURNED - [260, 0])
    observation = observe_charuco("a", image, CHARUCO)
    assert 8 <= len(observation.corners_px) < 40


@pytest.mark.parametrize("scale", [0.5, 0.9])
def test_a_charuco_board_of_which_a_few_corners_are_seen_is_none_or_enough_of_one(scale):
    """A line of corners, or two or three of them, do not tell how it lies: one had ended in an error of OpenCV."""
    image, _ = charuco_picture(scaled(TURNED, scale))
    counts = []
    for part in range(120, 460, 12):
        for kept in (np.s_[:, :part], np.s_[:part]):
            shown = np.full_like(image, 128)
            shown[kept] = image[kept]
            observation = observe_charuco("a", shown, CHARUCO)
            counts.append(0 if observation is None else len(observation.corners_px))
    assert min(counts) == 0
    assert min(count for count in counts if count) >= 8


def test_too_little_of_a_charuco_board_is_no_observation():
    image, _ = charuco_picture(TURNED - [430, 0])
    assert observe_charuco("a", image, CHARUCO) is None


def test_an_unknown_marker_set_is_named():
    image, _ = charuco_picture(TURNED)
    with pytest.raises(InputError, match="dictionary is unknown"):
        observe_charuco("a", image, Board("charuco", (8, 5), 0.04, 0.03, "DICT_4X4_5000"))


def layout_pictures(squares: tuple[int, int], *, old: bool, first: int = 0) -> list[tuple[str, np.ndarray]]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    numbers = np.arange(first, first + squares[0] * squares[1] // 2)
    drawn = cv2.aruco.CharucoBoard(squares, 40, 30, dictionary, numbers)
    drawn.setLegacyPattern(old)
    image = drawn.generateImage((40 * squares[0] + 80, 40 * squares[1] + 80), marginSize=40)
    return [("a", picture(image, pattern_to_image(image, TURNED), SIZE))]


@pytest.mark.parametrize("stated", [(6, 5), (5, 6)])
@pytest.mark.parametrize("old", [False, True])
def test_a_charuco_board_is_found_in_either_layout_and_with_its_sides_stated_in_either_order(stated, old):
    board = Board("charuco", stated, 0.04, 0.03, "DICT_4X4_50")
    (found,), _ = find_boards(layout_pictures((7, 6), old=old), board, 1)
    assert len(found.corners_px) == 30
    assert np.ptp(found.board_m, axis=0) == pytest.approx([0.2, 0.16])
    homography = cv2.findHomography(found.board_m, found.corners_px)[0]
    again = cv2.perspectiveTransform(found.board_m.reshape(-1, 1, 2), homography).reshape(-1, 2)
    np.testing.assert_allclose(again, found.corners_px, atol=0.25)


def test_a_charuco_board_that_is_not_found_is_told_by_its_markers():
    with pytest.raises(InputError) as error:
        find_boards(
            layout_pictures((6, 5), old=False, first=35), Board("charuco", (5, 4), 0.04, 0.03, "DICT_4X4_50"), 1
        )
    assert "markers 35 to 49 of DICT_4X4_50 are seen" in error.value.remedy
    assert "has 0 to 14" in error.value.remedy
    with pytest.raises(InputError) as error:
        find_boards(layout_pictures((7, 6), old=False), Board("charuco", (6, 5), 0.04, 0.03, "DICT_5X5_50"), 1)
    assert error.value.remedy.startswith("no marker of DICT_5X5_50 is seen")


def test_a_charuco_board_of_more_markers_than_its_set_has_is_refused():
    with pytest.raises(InputError, match="more markers than") as error:
        find_boards(layout_pictures((7, 6), old=False), Board("charuco", (14, 9), 0.04, 0.03, "DICT_4X4_50"), 1)
    assert error.value.got == "15 × 10 squares with 75 markers, DICT_4X4_50 of 50"


@pytest.fixture(scope="module")
def two_pictures() -> list[tuple[str, np.ndarray]]:
    pattern = chessboard_pattern(9, 6, 40)
    return [
        (name, picture(pattern, pattern_to_image(pattern, scaled(TURNED, scale)), SIZE))
        for name, scale in (("a", 1.0), ("b", 0.8))
    ]


def test_wrong_corner_counts_are_reported_with_the_right_ones(two_pictures):
    assert fitting_corner_counts(two_pictures) == (9, 6)
    with pytest.raises(InputError, match="10 × 7 inner corners") as error:
        find_boards(two_pictures, Board("chessboard", (10, 7), 0.04), 1)
    assert "9 × 6 inner corners" in error.value.remedy


@pytest.fixture(scope="module")
def covered_pictures() -> list[tuple[str, np.ndarray]]:
    """A board of 9 × 6 inner corners, of which glare hides two columns in two pictures, and two rows in others."""
    pattern, pictures = chessboard_pattern(9, 6, 40), []
    for name, hidden in (("a", np.s_[:, :120]), ("b", np.s_[:, -120:]), ("c", np.s_[:120]), ("d", np.s_[-120:])):
        covered = pattern.copy()
        covered[hidden] = 235
        pictures.append((name, picture(covered, pattern_to_image(covered, TURNED), SIZE)))
    return pictures


def test_boards_of_which_a_part_is_hidden_are_not_taken_for_smaller_ones(covered_pictures):
    """Glare had been reported as another number of corners, which ``towval new`` wrote down."""
    assert fitting_corner_counts(covered_pictures) is None
    assert fitting_corner_counts(covered_pictures[:2]) == (7, 6)
    with pytest.raises(InputError, match="4 pictures searched") as error:
        find_boards(covered_pictures, CHESSBOARD, 1)
    assert error.value.remedy.startswith("check that the pictures are those of the board, whole")
    with pytest.raises(InputError) as error:
        find_boards(covered_pictures[:2], CHESSBOARD, 1)
    assert "7 × 6 inner corners, or so much of a larger one: no hand, glare" in error.value.remedy


def test_a_whole_board_is_searched_for_where_a_few_pictures_show_a_part(covered_pictures, two_pictures):
    pictures = [covered_pictures[i % 2] for i in range(8)]
    pictures[3] = two_pictures[0]
    pictures = [(f"{i}", image) for i, (_, image) in enumerate(pictures)]
    found, unseen = find_boards(pictures, CHESSBOARD, 1)
    assert [one.name for one in found] == ["3"]
    assert len(unseen) == 7


def test_of_two_boards_in_a_picture_the_marked_one_counts_or_the_one_that_does_not_stay():
    """A poster was taken for the board on the floor, and the pixel of the origin or the focal length blamed."""
    pattern = chessboard_pattern(9, 6, 40)
    poster = cv2.resize(pattern, None, fx=0.35, fy=0.35, interpolation=cv2.INTER_AREA)
    pictures = []
    for name, shift in (("floor", (300, 250)), ("b", (200, 200)), ("c", (350, 160))):
        place = np.array([[0.5, 0.1, shift[0]], [-0.1, 0.5, shift[1]], [0, 0, 1.0]])
        image = picture(pattern, place, SIZE)
        image[10 : 10 + poster.shape[0], 10 : 10 + poster.shape[1]] = poster
        pictures.append((name, image))
    board = Board("chessboard", (9, 6), 0.04)
    found, _ = find_boards(pictures, board, 2)
    (told,) = _beside_another(found)
    assert told.code == "boards-alike"
    assert told.text.startswith("3 pictures (floor, b, c) show two chessboards")
    assert all(one.corners_px.min() > 100 for one in found)
    covered = pictures[0][1].copy()
    covered[300:] = 128
    assert find_boards([*pictures, ("d", covered)], board, 2)[1] == {"d": "no whole board found"}
    marked, _ = find_boards(pictures[:1], board, 1, {"floor": np.array([30.0, 30.0])})
    assert marked[0].corners_px.max() < 10 + max(poster.shape)


def test_pictures_without_the_board_are_named(two_pictures):
    blank = np.full(SIZE[::-1], 128, np.uint8)
    observations, unseen = find_boards([*two_pictures, ("empty", blank)], CHESSBOARD, 2)
    assert [s.name for s in observations] == ["a", "b"]
    assert unseen == {"empty": "no whole board found"}


@pytest.mark.parametrize(("blur", "flagged"), [(0.8, False), (2.5, True), ("moved", True)])
def test_a_blurred_board_is_flagged(blur, flagged):
    pattern = chessboard_pattern(9, 6, 40)
    quad = np.array([[100.0, 60.0], [520.0, 110.0], [480.0, 420.0], [70.0, 350.0]])
    image = picture(pattern, pattern_to_image(pattern, quad), (640, 480))
    kernel = np.full((1, 9), 1 / 9)
    image = cv2.filter2D(image, -1, kernel) if blur == "moved" else cv2.GaussianBlur(image, (0, 0), blur)
    observation = observe_chessboard("a.png", image, Board("chessboard", (9, 6), 0.04), thorough=False)
    found = blur_findings(CalibrationObservations((640, 480), (observation,)))
    assert [finding.code for finding in found] == (["views-blurred"] if flagged else [])


def test_a_board_that_only_the_thorough_finder_finds_is_searched_in_every_picture(monkeypatch):
    quickly, corners_px = [], 20.0 * np.mgrid[0:9, 0:6].T.reshape(-1, 2)

    def observe(name, image, board, *, thorough):
        if not thorough:
            quickly.append(name)
        return BoardObservation(name, corners_px, corners_px) if thorough else None

    monkeypatch.setattr("towval.calibration.board_search.observe_chessboard", observe)
    named = [(f"{i:02d}", np.full((40, 60), 128, np.uint8)) for i in range(11)]
    found, without = find_boards(named, Board("chessboard", (9, 6), 0.04), 1)
    assert [each.name for each in found] == [name for name, _ in named]
    assert without == {}
    # The six that are looked at before all others are spread over the recording.
    assert quickly[:6] == ["00", "02", "04", "06", "08", "10"]
