"""Corners of calibration boards in pictures: found, refined to a fraction of a pixel, and put in a fixed order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Board
from towval.model.errors import InputError

_CLASSIC = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
SECTOR_FLAGS = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE, cv2.CALIB_CB_EXHAUSTIVE
"""Of the sector-based finder, one way after the other: grey levels spread evenly tell squares in poor light, and hide
those of a board that is darker than the floor behind it."""

_LARGEST_ENLARGED_PX = 3840 * 2160  # Of a picture twice as large, for memory and time.
_SUBPIXEL_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-4)


@dataclass(frozen=True)
class CornerConstants:
    """Tuned constants of the search for corners and of their refinement."""

    small_square_px: float = 16.0  # [px] Of boards found: others, half as large, were missed (from 8 px on).
    small_marked_px: float = 24.0  # [px] Of squares with markers in them, of which some are missed up to 15 px.

    window_share: float = 0.3  # Half-width of the window over the distance to the nearest corner: the diagonal of a
    # window turned against the board must not reach the edges that meet there.
    widest_window: int = 15  # [px] Half-width: beyond it a bent edge is averaged.
    fewest_corners: int = 8  # Of a ChArUco board in view, for a homography with redundancy.
    largest_move: float = 0.3  # Of a square, by which a corner that refinement moves has left its place.


CONSTANTS = CornerConstants()


@dataclass(frozen=True)
class BoardObservation:
    """Corners of one board in one picture: ``corners_px`` (n, 2), and ``board_m`` (n, 2) the same on the board.

    Board coordinates are right-handed on the printed side: from x to y is counter-clockwise for the camera. ``pattern``
    (n, 2) are the corners from the board's middle, over half its longer side, which lies along x; by default those of
    the smallest rectangle about ``board_m``. ``edge_px`` is how wide the edges of the squares are in the picture, from
    10 to 90 % of their contrast, of those along the board or across it, the wider; NaN where it is not known.
    ``another_px`` (n, 2): corners of another board of as many that the picture shows, None where there is none.
    """

    name: str
    corners_px: Array
    board_m: Array
    pattern: Array | None = None
    edge_px: float = np.nan
    another_px: Array | None = None

    @property
    def on_board(self) -> Array:
        """``pattern``, or what stands in for it (n, 2)."""
        return _in_rectangle(self.board_m) if self.pattern is None else self.pattern


def observe_chessboard(name: str, image: NDArray[np.uint8], board: Board, *, thorough: bool) -> BoardObservation | None:
    """Find a chessboard in a grey picture (height, width); None where not all of its corners are found.

    ``thorough`` uses the sector-based finder, which finds more and takes ten to a hundred times as long.
    """
    if thorough:
        corners = _by_sectors(image, board.inner_corners, SECTOR_FLAGS)
    else:
        found, quick = cv2.findChessboardCorners(image, board.inner_corners, flags=_CLASSIC)
        corners = np.asarray(quick, dtype=np.float64) if found else None
    return None if corners is None else _observed(name, image, corners, board)


def observe_small_chessboard(name: str, image: NDArray[np.uint8], board: Board) -> BoardObservation | None:
    """Find a chessboard of small squares, by the thorough finder in a picture twice as large.

    None where not all of its corners are found. For 1080p it takes a second, and half a gigabyte where two run at once.
    """
    twice = _enlarged(image)
    corners = None if twice is None else _by_sectors(twice, board.inner_corners, SECTOR_FLAGS[-1:])
    return None if corners is None else _observed(name, image, _before_enlarging(corners), board)


def smallest_square_px(observation: BoardObservation, board: Board) -> float:
    """The shortest side of a square of a chessboard that was found [px]."""
    columns, rows = board.inner_corners
    return float(_distance_to_neighbour(observation.corners_px.reshape(rows, columns, 2)).min())


def _observed(name: str, image: NDArray[np.uint8], corners: Array, board: Board) -> BoardObservation:
    """A chessboard of which all corners were found, in pixels."""
    columns, rows = board.inner_corners
    grid = corners.reshape(rows, columns, 2)
    spacing = _distance_to_neighbour(grid)
    refined = refine(image, grid.reshape(-1, 2), spacing.ravel())
    row, column = np.mgrid[0:rows, 0:columns]
    on_board = board.square_m * np.column_stack([column.ravel(), row.ravel()])
    points = refined.astype(np.float32).reshape(-1, 1, 2)
    size = columns, rows
    both = [cv2.estimateChessboardSharpness(image, size, points, 0.8, vertical) for vertical in (False, True)]
    edge_px = max(float(np.ravel(found[0])[0]) for found in both)
    edge_px = edge_px if edge_px < spacing.min() else np.nan  # Squares too small to tell: OpenCV returns 9999.
    return BoardObservation(name, refined, facing_camera(on_board, refined), edge_px=edge_px)


def _by_sectors(image: NDArray[np.uint8], size: tuple[int, int], ways: Sequence[int]) -> Array | None:
    """Corners of a chessboard by the sector-based finder, one way after the other; None where none finds all."""
    for flags in ways:
        found, corners = cv2.findChessboardCornersSB(image, size, flags=flags)
        if found:
            return np.asarray(corners, dtype=np.float64)
    return None


def _enlarged(image: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
    """A picture twice as large, for finders that need more pixels than small squares have; None of a large one."""
    if 4 * image.size > _LARGEST_ENLARGED_PX:
        return None
    return np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def _before_enlarging(pixels: ArrayLike) -> Array:
    return (np.asarray(pixels, dtype=np.float64) - 0.5) / 2


def observe_charuco(
    name: str, image: NDArray[np.uint8], board: Board, *, old_layout: bool = False
) -> BoardObservation | None:
    """Find a ChArUco board, whole or in part, in a grey picture; None where too little of it is found.

    ``old_layout``: as :func:`charuco_layouts` says. Raises `InputError` when OpenCV has no marker set of the board's
    name, or that set has fewer markers than the board.
    """
    pattern = _charuco_pattern(board, old_layout)
    places: Array = np.asarray(pattern.getChessboardCorners(), dtype=np.float64)[:, :2]
    found, which = _charuco_corners(image, pattern)
    large = _enough(places[which], board.square_m) and (
        _predicted_spacing(places[which], found, board.square_m).min() >= CONSTANTS.small_marked_px
    )
    if len(which) < len(places) and not large and (twice := _enlarged(image)) is not None:
        again, which_again = _charuco_corners(twice, pattern)
        if len(which_again) > len(which):
            found, which = _before_enlarging(again), which_again
    grid = places[which]
    if not _enough(grid, board.square_m):
        return None
    # The window must end before the markers, which stand inside the white squares.
    inset = 0.5 * (1 - (board.marker_m or 0.0) / board.square_m)
    spacing = _predicted_spacing(grid, found, board.square_m)
    refined = refine(image, found, spacing, min(CONSTANTS.window_share, inset))
    columns, rows = board.inner_corners
    middle, half = (
        0.5 * board.square_m * np.array([columns + 1, rows + 1]),
        0.5 * board.square_m * (max(columns, rows) - 1),
    )
    on_board = (grid - middle) / half
    on_board = on_board if columns >= rows else on_board[:, ::-1] * [1.0, -1.0]
    return BoardObservation(name, refined, facing_camera(grid, refined), facing_camera(on_board, refined))


def _enough(grid: Array, square_m: float) -> bool:
    """Whether corners (n, 2) of a board are enough, and not all on a line, to tell how it lies."""
    if len(grid) < CONSTANTS.fewest_corners:
        return False
    return bool(np.linalg.matrix_rank(grid - grid.mean(axis=0), tol=0.5 * square_m) == 2)


def _charuco_corners(image: NDArray[np.uint8], pattern: cv2.aruco.CharucoBoard) -> tuple[Array, NDArray[np.intp]]:
    """Pixels (n, 2) of the corners of a ChArUco board that a picture shows, and which of the board's they are (n,)."""
    corners, ids, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(image)
    if ids is None:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.intp)
    return np.asarray(corners, dtype=np.float64).reshape(-1, 2), np.asarray(ids, dtype=np.intp).ravel()


def charuco_layouts(board: Board) -> list[tuple[Board, bool]]:
    """The layouts of markers that a ChArUco board as described may have: the board, and whether its layout is the old.

    ``inner_corners`` may be stated along either side first, but the markers are numbered along one of them. Before its
    version 4.6, OpenCV drew a board of evenly many rows with a marker in its first square instead of a black square,
    and other makers of boards still do. A detector finds no corner of a board with another layout than its own.
    """
    ways = dict.fromkeys((board.inner_corners, board.inner_corners[::-1]))
    boards = [replace(board, inner_corners=way) for way in ways]
    return [(one, False) for one in boards] + [(one, True) for one in boards if one.inner_corners[1] % 2]


def markers_seen(image: NDArray[np.uint8], board: Board) -> set[int]:
    """Numbers of the markers of a ChArUco board's set that a grey picture shows, whether they are the board's or not.

    Raises `InputError` as :func:`observe_charuco` does.
    """
    ids = cv2.aruco.ArucoDetector(_charuco_pattern(board, False).getDictionary()).detectMarkers(image)[1]
    return set() if ids is None else {int(number) for number in ids.ravel()}


def _charuco_pattern(board: Board, old_layout: bool) -> cv2.aruco.CharucoBoard:
    number = getattr(cv2.aruco, board.dictionary or "", None)
    if number is None or board.marker_m is None:
        known = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
        raise InputError("board.dictionary is unknown", got=board.dictionary, allowed=", ".join(known))
    squares = (board.inner_corners[0] + 1, board.inner_corners[1] + 1)
    dictionary = cv2.aruco.getPredefinedDictionary(number)
    markers, most = squares[0] * squares[1] // 2, len(dictionary.bytesList)
    if markers > most:
        raise InputError(
            "board.inner_corners describes a ChArUco board of more markers than board.dictionary has",
            got=f"{squares[0]} × {squares[1]} squares with {markers} markers, {board.dictionary} of {most}",
            allowed=f"at most {most} markers",
            remedy="check board.inner_corners, which are one less than the squares, and board.dictionary",
        )
    pattern = cv2.aruco.CharucoBoard(squares, board.square_m, board.marker_m, dictionary)
    pattern.setLegacyPattern(old_layout)
    return pattern


def _predicted_spacing(grid: Array, corners: Array, square_m: float) -> Array:
    """Distance (n,) from each corner to the nearest of its four neighbours, found or not [px]."""
    homography = cv2.findHomography(grid, corners)[0]
    steps = square_m * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=float)
    around = cv2.perspectiveTransform((grid[:, None] + steps).reshape(-1, 1, 2), homography).reshape(-1, 5, 2)
    spacing: Array = np.linalg.norm(around[:, 1:] - around[:, :1], axis=2).min(axis=1)
    return spacing


def facing_camera(board_m: Array, corners_px: Array) -> Array:
    """Board coordinates with y reversed where they would be those of the back of the board."""
    affine = np.linalg.lstsq(np.column_stack([board_m, np.ones(len(board_m))]), corners_px, rcond=None)[0][:2]
    # Image v points down: a board that faces the camera has a negative determinant there.
    return board_m * [1.0, -1.0] if np.linalg.det(affine) > 0 else board_m


def _in_rectangle(points: Array) -> Array:
    """Points (n, 2) from the middle of the smallest rectangle about them, over half its longer side, x along it."""
    middle, size, angle_deg = cv2.minAreaRect(points.astype(np.float32))
    angle = np.radians(angle_deg + (90.0 if size[1] > size[0] else 0.0))
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray((points - middle) @ np.array([[c, -s], [s, c]]) / (0.5 * max(size)))


def _distance_to_neighbour(grid: Array) -> Array:
    """Distance of each corner of a grid (rows, columns, 2) to the nearest of its four neighbours [px]."""
    spacing = np.full(grid.shape[:2], np.inf)
    along, down = np.linalg.norm(np.diff(grid, axis=1), axis=2), np.linalg.norm(np.diff(grid, axis=0), axis=2)
    for part, distance in ((np.s_[:, 1:], along), (np.s_[:, :-1], along), (np.s_[1:], down), (np.s_[:-1], down)):
        spacing[part] = np.minimum(spacing[part], distance)
    return spacing


def refine(image: NDArray[np.uint8], corners: Array, spacing: Array, share: float | None = None) -> Array:
    """Corners (n, 2) refined to a fraction of a pixel, in windows of ``share`` of the spacing (n,) to either side [px].

    A window of fixed size reaches into the neighbouring corners of a small board and pulls them together.
    """
    refined = corners.astype(np.float32).reshape(-1, 1, 2)
    share = CONSTANTS.window_share if share is None else share
    half_widths = np.clip((share * spacing).astype(int), 2, CONSTANTS.widest_window)
    for half_width in np.unique(half_widths):
        chosen = np.flatnonzero(half_widths == half_width)
        part = np.ascontiguousarray(refined[chosen])
        cv2.cornerSubPix(image, part, (int(half_width),) * 2, (-1, -1), _SUBPIXEL_STOP)
        refined[chosen] = part
    moved = refined.reshape(-1, 2).astype(np.float64)
    astray = np.linalg.norm(moved - corners, axis=1) > CONSTANTS.largest_move * spacing
    return np.where(astray[:, None], corners, moved)


def outer_corners(board_m: Array) -> list[int]:
    """Which points (N, 2) of a board are its outermost corners, four of them, going round it.

    Examples
    --------
    >>> import numpy as np
    >>> outer_corners(np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]))
    [0, 2, 5, 3]
    """
    x, y = (board_m - board_m.mean(axis=0)).T
    return [int(np.argmax(sign_x * x + sign_y * y)) for sign_x, sign_y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
