"""Looking for a board in many pictures: quickly first, and with a word on what is wrong where none is found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.errors import InputError
from towval.types import Board
from towval.vision.corners import Sighting, sight_charuco, sight_chessboard

NamedImage = tuple[str, NDArray[np.uint8]]

_SAMPLE = 6
"""Pictures that are looked at thoroughly before a board is said to be nowhere."""


def look_for_boards(images: Sequence[NamedImage], board: Board, threads: int) -> tuple[list[Sighting], dict[str, str]]:
    """Look for a board in every picture.

    Parameters
    ----------
    images : sequence of (str, ndarray of uint8)
        Names and grey pictures.
    board : Board
        The board.
    threads : int
        How many pictures to look at at the same time.

    Returns
    -------
    sightings : list of Sighting
        The boards found, in the order of the pictures.
    unseen : dict
        Name of each other picture and the reason.

    Raises
    ------
    InputError
        When no picture shows the board, with the number of corners that would fit, if any does.
    """
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(lambda image: _quick(image, board), images))
        if board.kind == "chessboard":
            missing = [i for i, sighting in enumerate(found) if sighting is None]
            if len(missing) == len(images):
                missing = missing[:: max(1, len(missing) // _SAMPLE)]
            thorough = pool.map(lambda i: sight_chessboard(*images[i], board, thorough=True), missing)
            for i, sighting in zip(missing, thorough, strict=True):
                found[i] = sighting
    if not any(found):
        raise _no_board(images, board)
    unseen = {
        name: "no whole board found" if board.kind == "chessboard" else "too little of the board found"
        for (name, _), sighting in zip(images, found, strict=True)
        if sighting is None
    }
    return [sighting for sighting in found if sighting is not None], unseen


def _quick(image: NamedImage, board: Board) -> Sighting | None:
    return sight_charuco(*image, board) if board.kind == "charuco" else sight_chessboard(*image, board, thorough=False)


def _no_board(images: Sequence[NamedImage], board: Board) -> InputError:
    columns, rows = board.inner_corners
    if board.kind == "charuco":
        remedy = "check board.dictionary and the two numbers of inner corners, which are one less than the squares"
    elif fitting := fitting_corner_counts(images):
        remedy = f"the pictures show a chessboard of {fitting[0]} × {fitting[1]} inner corners: set board.inner_corners"
    else:
        remedy = "count the corners where four squares meet, not the squares, along both sides of the board"
    return InputError(
        f"no picture shows a {board.kind} of {columns} × {rows} inner corners",
        got=f"{len(images)} pictures",
        allowed="pictures of the whole board, sharp and evenly lit, with its white margin",
        remedy=remedy,
    )


def fitting_corner_counts(images: Sequence[NamedImage]) -> tuple[int, int] | None:
    """The numbers of inner corners, larger first, that a few of the pictures agree on; None where they do not."""
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
    votes: Counter[tuple[int, int]] = Counter()
    for _, image in images[:: max(1, len(images) // _SAMPLE)][:_SAMPLE]:
        found, _, grid = cv2.findChessboardCornersSBWithMeta(image, (4, 4), flags)
        if found:
            votes[max(grid.shape), min(grid.shape)] += 1
    if not votes:
        return None
    counts, agreeing = votes.most_common(1)[0]
    return counts if agreeing > 1 else None
