"""Search for a board in many pictures: quickly first, and with a diagnosis where none is found."""

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.calibration.corners import BoardObservation, observe_charuco, observe_chessboard
from towval.model import Board
from towval.model.errors import InputError

NamedImage = tuple[str, NDArray[np.uint8]]

_SAMPLE = 6
"""Pictures that are searched before the number of corners is checked."""


def find_boards(
    images: Sequence[NamedImage], board: Board, threads: int
) -> tuple[list[BoardObservation], dict[str, str]]:
    """Search every picture for a board, ``threads`` of them at the same time.

    Returns the boards found, in the order of the pictures, which are read when they are searched, and the name of each
    other picture with the reason. `InputError` where no picture shows the board, with the number of corners that would
    fit, if any does.
    """
    with ThreadPoolExecutor(threads) as pool:
        sample = _spread(range(len(images)))
        known = dict(zip(sample, pool.map(lambda i: _quick(images[i], board), sample), strict=True))
        if not any(known.values()):
            _check_corner_counts([images[i] for i in sample], board)
        rest = [i for i in range(len(images)) if i not in known]
        known |= zip(rest, pool.map(lambda i: _quick(images[i], board), rest), strict=True)
        if board.kind == "chessboard":
            missing = [i for i in range(len(images)) if known[i] is None]
            # Where the quick finder finds nothing at all, a few pictures tell whether the slow one does.
            first = missing if len(missing) < len(images) else _spread(missing)
            for some in (first, [i for i in missing if i not in first]):
                thorough = pool.map(lambda i: observe_chessboard(*images[i], board, thorough=True), some)
                known |= zip(some, thorough, strict=True)
                if not any(known.values()):
                    break
    found = [known[i] for i in range(len(images))]
    if not any(found):
        raise _no_board(len(images), board, "check that the pictures are those of the board, whole and sharp")
    reason = "no whole board found" if board.kind == "chessboard" else "too little of the board found"
    without_board = {images[i][0]: reason for i, observation in enumerate(found) if observation is None}
    return [observation for observation in found if observation is not None], without_board


def _spread(indices: Sequence[int]) -> list[int]:
    """A few of the indices, spread over the sequence."""
    count = len(indices)
    return [indices[i] for i in np.linspace(0, count - 1, min(count, _SAMPLE)).astype(int)]


def _quick(image: NamedImage, board: Board) -> BoardObservation | None:
    if board.kind == "charuco":
        return observe_charuco(*image, board)
    return observe_chessboard(*image, board, thorough=False)


def _check_corner_counts(sample: Sequence[NamedImage], board: Board) -> None:
    """Raise where the pictures show a chessboard with other numbers of corners."""
    if board.kind != "chessboard":
        return
    fitting = fitting_corner_counts(sample)
    if fitting is not None and fitting != (max(board.inner_corners), min(board.inner_corners)):
        remedy = f"the pictures show a chessboard of {fitting[0]} × {fitting[1]} inner corners"
        raise _no_board(len(sample), board, remedy)


def _no_board(searched: int, board: Board, remedy: str) -> InputError:
    columns, rows = board.inner_corners
    if board.kind == "charuco":
        remedy += "; check board.dictionary, and board.inner_corners, which are one less than the squares"
    else:
        remedy += "; check board.inner_corners: the corners where four squares meet, one less than the squares"
    return InputError(
        f"no picture shows a {board.kind} of {columns} × {rows} inner corners",
        got=f"{searched} pictures searched",
        allowed="pictures of the whole board, sharp and evenly lit, with its white margin",
        remedy=remedy,
    )


def fitting_corner_counts(images: Sequence[NamedImage]) -> tuple[int, int] | None:
    """The numbers of inner corners, larger first, that two or more of the pictures agree on; None where none do."""
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
    votes: Counter[tuple[int, int]] = Counter()
    for _, image in images:
        found, _, grid = cv2.findChessboardCornersSBWithMeta(image, (4, 4), flags)
        if found:
            votes[max(grid.shape), min(grid.shape)] += 1
    if not votes:
        return None
    counts, agreeing = votes.most_common(1)[0]
    return counts if agreeing > 1 else None
