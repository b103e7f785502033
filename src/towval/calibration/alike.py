"""Views that repeat another one: pictures taken while a board was held still, or lay still, count as one.

What displaces their corners (print, light, a lens that is not quite the model) is the same in all of them. Counted one
by one they would state a calibration as more certain than it is, and predict each other in the choice of the lens.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from towval.calibration.corners import BoardObservation
from towval.calibration.observations import CalibrationObservations
from towval.model import Array


@dataclass(frozen=True)
class AlikeConstants:
    """Tuned constants of what repeats another view."""

    apart: float = (
        0.1  # Of a square, RMS: hands that hold still move a board by less, a tilt by 10° its corners by more.
    )
    least_common: float = 0.75  # Of the corners of a board seen in part: one that shows more is another view.


CONSTANTS = AlikeConstants()


def without_repeats(observed: CalibrationObservations) -> tuple[CalibrationObservations, dict[str, str]]:
    """The observations without the boards that repeat another one, and for each of these the reason by its name.

    Of boards that are alike the sharpest is kept; the first one on the floor always is, since it may fix the frame.
    """
    repeats = _repeats((), observed.boards) | _repeats(observed.floor_boards[:1], observed.floor_boards[1:])
    reasons = {name: f"the board is where it is in {other}" for name, other in repeats.items()}
    return observed.without(set(reasons)), reasons


def lies_where(one: BoardObservation, other: BoardObservation) -> bool:
    """Whether a chessboard lies where another picture shows one, whole both."""
    return bool(_apart_px(other.corners_px[None], one.corners_px)[0] < CONSTANTS.apart * square_px(one))


def _repeats(kept: Sequence[BoardObservation], boards: Sequence[BoardObservation]) -> dict[str, str]:
    """Names of the boards that are where another one is, and the names of these."""
    every = [*kept, *sorted(boards, key=lambda each: float(np.nan_to_num(each.edge_px)))]
    if len(every) < 2:
        return {}
    corners, distinct = _on_one_board(every), list(range(max(1, len(kept))))
    repeats: dict[str, str] = {}
    for i in range(len(distinct), len(every)):
        near = _apart_px(corners[distinct], corners[i]) < CONSTANTS.apart * square_px(every[i])
        if near.any():
            repeats[every[i].name] = every[distinct[int(np.argmax(near))]].name
        else:
            distinct.append(i)
    return repeats


def _on_one_board(boards: Sequence[BoardObservation]) -> Array:
    """Corners of all boards in one order (boards, corners, 2) [px]; NaN where a board is seen in part without one."""
    if boards[0].pattern is None and len({len(each.corners_px) for each in boards}) == 1:
        return np.array([each.corners_px for each in boards])
    places = np.concatenate([each.on_board for each in boards])
    known, which = np.unique(np.round(places, 6), axis=0, return_inverse=True)
    corners = np.full((len(boards), len(known), 2), np.nan)
    row = np.repeat(np.arange(len(boards)), [len(each.corners_px) for each in boards])
    corners[row, which.ravel()] = np.concatenate([each.corners_px for each in boards])
    return corners


def _apart_px(others: Array, own: Array) -> Array:
    """RMS distance (k,) of the corners (n, 2) of a board from those of others (k, n, 2) [px]; infinite in few common.

    A chessboard may be found from either end.
    """
    turned = [own] if np.isnan(others).any() or np.isnan(own).any() else [own, own[::-1]]
    squares = np.array([np.sum((others - each) ** 2, axis=-1) for each in turned])
    common = np.isfinite(squares).sum(axis=-1)
    mean = np.nansum(squares, axis=-1) / np.maximum(common, 1)
    enough = common >= CONSTANTS.least_common * np.isfinite(own[:, 0]).sum()
    return np.asarray(np.sqrt(np.where(enough, mean, np.inf)).min(axis=0))


def square_px(board: BoardObservation) -> float:
    """Side of a square in the picture, the root of its area [px]."""
    along = np.linalg.norm(board.board_m - board.board_m[0], axis=1)
    centred = board.board_m - board.board_m.mean(axis=0)
    affine = np.linalg.lstsq(centred, board.corners_px - board.corners_px.mean(axis=0), rcond=None)[0]
    return float(along[along > 0].min() * np.sqrt(abs(np.linalg.det(affine))))
