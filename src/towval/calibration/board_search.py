"""Search for a board in many pictures: quickly first, and with a diagnosis where none is found."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.calibration.alike import lies_where
from towval.calibration.corners import (
    CONSTANTS,
    SECTOR_FLAGS,
    BoardObservation,
    charuco_layouts,
    markers_seen,
    observe_charuco,
    observe_chessboard,
    observe_small_chessboard,
    smallest_square_px,
)
from towval.model import Array, Board
from towval.model.errors import InputError

NamedImage = tuple[str, NDArray[np.uint8]]
_Finder = Callable[[str, NDArray[np.uint8]], BoardObservation | None]

_SAMPLE = 6
"""Pictures that are searched before the number of corners is checked."""


def find_boards(
    images: Sequence[NamedImage],
    board: Board,
    threads: int,
    marked_px: Mapping[str, Array] | None = None,
    on_floor: int = 0,
) -> tuple[list[BoardObservation], dict[str, str]]:
    """Search every picture for a board, ``threads`` of them at the same time.

    The last ``on_floor`` pictures show the board on the floor, where it is smaller than near the camera. Where small
    boards may have been missed, they are looked for in pictures twice as large, which takes long.

    A picture may show another chessboard of as many corners: ``marked_px`` (2,) is a pixel of the right one, by the
    picture's name. Elsewhere it is the one that does not stay where it is from picture to picture.

    Returns the boards found, in the order of the pictures, which are read when they are searched, and the name of each
    other picture with the reason. `InputError` where no picture shows the board, with the number of corners that would
    fit, if any does.
    """
    shown = None
    with ThreadPoolExecutor(threads) as pool:
        sample = _spread(range(len(images)))
        finders = _finders(board)
        for quick in finders:
            known = _searched(quick, images, sample, pool)
            if any(known.values()):
                break
        else:
            quick = finders[0]
            shown = _corner_counts_shown([images[i] for i in sample], board)
        known |= _searched(quick, images, [i for i in range(len(images)) if i not in known], pool)
        if board.kind == "chessboard":
            slow = partial(observe_chessboard, board=board, thorough=True)
            known |= _searched_again(slow, images, known, pool)
            small = partial(observe_small_chessboard, board=board)
            first_on_floor = len(images) - on_floor
            for group in (range(first_on_floor), range(first_on_floor, len(images))):
                alike = {i: known[i] for i in group}
                sizes_px = [smallest_square_px(one, board) for one in alike.values() if one is not None]
                if min(sizes_px, default=0.0) < CONSTANTS.small_square_px:
                    known |= _searched_again(small, images, alike, pool)
    found = [known[i] for i in range(len(images))]
    if not any(found):
        what = shown or "check that the pictures are those of the board, whole and sharp"
        raise _no_board(len(images), board, what if board.kind == "chessboard" else _of_markers(images, sample, board))
    if board.kind == "chessboard":
        found = _without_others(images, found, board, marked_px or {}, threads)
    reason = "no whole board found" if board.kind == "chessboard" else "too little of the board found"
    without_board = {images[i][0]: reason for i, observation in enumerate(found) if observation is None}
    return [observation for observation in found if observation is not None], without_board


def _without_others(
    images: Sequence[NamedImage],
    found: Sequence[BoardObservation | None],
    board: Board,
    marked_px: Mapping[str, Array],
    threads: int,
) -> list[BoardObservation | None]:
    """Of pictures that show two boards, the one that is marked, or the one that lies where no other picture has one.

    Boards that lie where the other one is in these pictures are left out. All pictures are searched for another board
    where a few of them, or one that is marked, show one: it takes as long as the search for the right one.
    """
    marked = {i for i, one in enumerate(found) if one is not None and one.name in marked_px}
    looked_at = marked.union(_spread([i for i, one in enumerate(found) if one is not None]))

    def others(i: int) -> list[BoardObservation]:
        one = found[i]
        if one is None:
            return []
        name, image = images[i]
        other = observe_chessboard(name, _painted_over(image, one, board), board, thorough=False)
        return [one] if other is None else [one, other]

    with ThreadPoolExecutor(threads) as pool:
        if not any(boards[1:] for boards in pool.map(others, sorted(looked_at))):
            return list(found)
        shown = list(pool.map(others, range(len(images))))

    def strangeness(one: BoardObservation) -> tuple[float, int]:
        mark = marked_px.get(one.name)
        off_px = 0.0 if mark is None else float(np.linalg.norm(one.corners_px - mark, axis=1).min())
        return off_px, sum(lies_where(one, each) for boards in shown for each in boards if each.name != one.name)

    ordered = [sorted(boards, key=strangeness) if boards[1:] else [] for boards in shown]
    strange = [boards[1] for boards in ordered if boards]
    # Where the right one is not whole, the other one alone is found.
    alone = [None if one is None or any(lies_where(one, each) for each in strange) else one for one in found]
    return [
        replace(boards[0], another_px=boards[1].corners_px) if boards else one
        for boards, one in zip(ordered, alone, strict=True)
    ]


def _painted_over(image: NDArray[np.uint8], one: BoardObservation, board: Board) -> NDArray[np.uint8]:
    """A picture without a board that was found in it."""
    fewer = min(board.inner_corners)
    middle = one.corners_px.mean(axis=0)
    # There is another square beyond the outermost corners of either side.
    outline = middle + (fewer + 1) / (fewer - 1) * (one.corners_px - middle)
    painted = image.copy()
    cv2.fillConvexPoly(painted, cv2.convexHull(np.rint(outline).astype(np.int32)), float(image.mean()))
    return painted


def _spread(indices: Sequence[int]) -> list[int]:
    """A few of the indices, spread over the sequence."""
    count = len(indices)
    return [indices[i] for i in np.linspace(0, count - 1, min(count, _SAMPLE)).astype(int)]


def _searched(
    finder: _Finder, images: Sequence[NamedImage], which: Sequence[int], pool: ThreadPoolExecutor
) -> dict[int, BoardObservation | None]:
    """What a finder finds in some of the pictures, each read when it is searched."""
    return dict(zip(which, pool.map(lambda i: finder(*images[i]), which), strict=True))


def _searched_again(
    finder: _Finder,
    images: Sequence[NamedImage],
    known: Mapping[int, BoardObservation | None],
    pool: ThreadPoolExecutor,
) -> dict[int, BoardObservation | None]:
    """What a slow finder finds in those of the pictures in which others found nothing.

    Where they found nothing at all, a few pictures tell whether it does.
    """
    missing = [i for i, one in known.items() if one is None]
    first = missing if len(missing) < len(known) else _spread(missing)
    found = _searched(finder, images, first, pool)
    if len(missing) < len(known) or any(found.values()):
        found |= _searched(finder, images, [i for i in missing if i not in found], pool)
    return found


def _finders(board: Board) -> list[_Finder]:
    """Quick searches for a board in one picture; of those that fit a ChArUco board's description one finds it."""
    if board.kind == "chessboard":
        return [partial(observe_chessboard, board=board, thorough=False)]
    return [partial(observe_charuco, board=one, old_layout=old) for one, old in charuco_layouts(board)]


def _corner_counts_shown(sample: Sequence[NamedImage], board: Board) -> str | None:
    """What to say of the numbers of corners that pictures show, where these may be a part of a chessboard's.

    None where the pictures do not agree on others than the board's. `InputError` where they show more along a side.
    """
    fitting = None if board.kind != "chessboard" else fitting_corner_counts(sample)
    whole = max(board.inner_corners), min(board.inner_corners)
    if fitting is None or fitting == whole:
        return None
    shown = f"the pictures show a chessboard of {fitting[0]} × {fitting[1]} inner corners"
    if fitting[0] > whole[0] or fitting[1] > whole[1]:
        raise _no_board(len(sample), board, shown)
    return f"{shown}, or so much of a larger one: no hand, glare or edge of the picture may hide a part of it"


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
    """The numbers of inner corners, larger first, that two or more of the pictures agree on; None where none do.

    None, too, where others agree on more along one of the sides: all of them show a part of a larger board.
    """
    votes: Counter[tuple[int, int]] = Counter()
    for _, image in images:
        for flags in SECTOR_FLAGS:
            found, _, grid = cv2.findChessboardCornersSBWithMeta(image, (4, 4), flags | cv2.CALIB_CB_LARGER)
            if found:
                votes[max(grid.shape), min(grid.shape)] += 1
                break
    agreed = [counts for counts, agreeing in votes.items() if agreeing > 1]
    whole = max((counts[0] for counts in agreed), default=0), max((counts[1] for counts in agreed), default=0)
    return whole if whole in agreed else None
