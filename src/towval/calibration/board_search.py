"""Search for a board in many pictures: quickly first, and with a diagnosis where none is found."""

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.calibration.corners import (
    BoardObservation,
    charuco_layouts,
    markers_seen,
    observe_charuco,
    observe_chessboard,
)
from towval.model import Board
from towval.model.errors import InputError

NamedImage = tuple[str, NDArray[np.uint8]]
_Finder = Callable[[str, NDArray[np.uint8]], BoardObservation | None]

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
        finders = _finders(board)
        for quick in finders:
            known = _searched(quick, images, sample, pool)
            if any(known.values()):
                break
        else:
            quick = finders[0]
            _check_corner_counts([images[i] for i in sample], board)
        known |= _searched(quick, images, [i for i in range(len(images)) if i not in known], pool)
        if board.kind == "chessboard":
            missing = [i for i in range(len(images)) if known[i] is None]
            # Where the quick finder finds nothing at all, a few pictures tell whether the slow one does.
            first = missing if len(missing) < len(images) else _spread(missing)
            for some in (first, [i for i in missing if i not in first]):
                known |= _searched(partial(observe_chessboard, board=board, thorough=True), images, some, pool)
                if not any(known.values()):
                    break
    found = [known[i] for i in range(len(images))]
    if not any(found):
        what = "check that the pictures are those of the board, whole and sharp"
        raise _no_board(len(images), board, what if board.kind == "chessboard" else _of_markers(images, sample, board))
    reason = "no whole board found" if board.kind == "chessboard" else "too little of the board found"
    without_board = {images[i][0]: reason for i, observation in enumerate(found) if observation is None}
    return [observation for observation in found if observation is not None], without_board


def _spread(indices: Sequence[int]) -> list[int]:
    """A few of the indices, spread over the sequence."""
    count = len(indices)
    return [indices[i] for i in np.linspace(0, count - 1, min(count, _SAMPLE)).astype(int)]


def _searched(
    finder: _Finder, images: Sequence[NamedImage], which: Sequence[int], pool: ThreadPoolExecutor
) -> dict[int, BoardObservation | None]:
    """What a finder finds in some of the pictures, each read when it is searched."""
    return dict(zip(which, pool.map(lambda i: finder(*images[i]), which), strict=True))


def _finders(board: Board) -> list[_Finder]:
    """Quick searches for a board in one picture; of those that fit a ChArUco board's description one finds it."""
    if board.kind == "chessboard":
        return [partial(observe_chessboard, board=board, thorough=False)]
    return [partial(observe_charuco, board=one, old_layout=old) for one, old in charuco_layouts(board)]


def _check_corner_counts(sample: Sequence[NamedImage], board: Board) -> None:
    """Raise where the pictures show a chessboard with other numbers of corners."""
    if board.kind != "chessboard":
        return
    fitting = fitting_corner_counts(sample)
    if fitting is not None and fitting != (max(board.inner_corners), min(board.inner_corners)):
        remedy = f"the pictures show a chessboard of {fitting[0]} × {fitting[1]} inner corners"
        raise _no_board(len(sample), board, remedy)


def _of_markers(images: Sequence[NamedImage], sample: Sequence[int], board: Board) -> str:
    """What the markers in some of the pictures say of a ChArUco board that none of them shows."""
    columns, rows = board.inner_corners
    last = (columns + 1) * (rows + 1) // 2 - 1
    seen = sorted(set[int]().union(*(markers_seen(images[i][1], board) for i in sample)))
    if not seen:
        return f"no marker of {board.dictionary} is seen: check board.dictionary, and that the pictures show the board"
    return (
        f"markers {seen[0]} to {seen[-1]} of {board.dictionary} are seen, where a board of {columns + 1} × {rows + 1} "
        f"squares has 0 to {last}: check board.dictionary, and that the pictures are sharp"
    )


def _no_board(searched: int, board: Board, remedy: str) -> InputError:
    columns, rows = board.inner_corners
    if board.kind == "charuco":
        remedy += "; check board.inner_corners, which are one less than the squares"
    else:
        remedy += "; check board.inner_corners: the corners where four squares meet, one less than the squares"
    whole = "the whole board, sharp and evenly lit, with its white margin"
    return InputError(
        f"no picture shows a {board.kind} of {columns} × {rows} inner corners",
        got=f"{searched} pictures searched",
        allowed=f"pictures of {whole if board.kind == 'chessboard' else 'the board, sharp and evenly lit'}",
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
