"""Stated values that may be wrong: size, shape and thickness of the board, zoom and crop of the held pictures.

The board's doubts are fitted beside the camera, with their stated deviations, which thereby enter its covariance. What
the views contradict is fitted without prejudice and reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from towval.calibration.blocks import BOARD_DOUBTS, CAMERA_END, DOUBTS, HELD_DOUBTS, PRINT_DOUBTS, Estimate
from towval.calibration.bundle_adjustment import adjust, whitened
from towval.calibration.lens import LensTrial, active_parameters, choose_lens, try_lenses
from towval.calibration.observations import CalibrationObservations
from towval.calibration.single_marks import FEWEST_TO_TELL
from towval.calibration.view_covariance import view_covariance
from towval.model import Array, Board, Finding, FloorReference
from towval.model.findings import finding

Doubts = NDArray[np.intp]
"""Some of :data:`towval.calibration.blocks.DOUBTS`, as indices of parameters."""

_NONE: Doubts = np.zeros(0, dtype=np.intp)
_SIZE, _THICKNESS = CAMERA_END + DOUBTS.index("size"), CAMERA_END + DOUBTS.index("thickness")


@dataclass(frozen=True)
class DoubtConstants:
    """Tuned constants of the doubts."""

    sound: float = 0.9999  # Share of sound sets that stay below what is taken for other than stated.
    noticeable_bow_m: float = 0.0003  # [m] Below it a bow is corrected without a word: 0.2 mm on the floor.
    named: float = 3.0  # Deviations of a bow that is reported; within which a principal point is a mirrored one.
    loose_std: tuple[float, ...] = (0.05, 0.01, 0.01, 0.01, 0.01, 0.05, 0.05, 0.1, 200.0, 200.0)
    # [1, m, m, m, m, 1, rad, 1, px, px] Of each doubt where only the pictures are to tell: far beyond what occurs.


CONSTANTS = DoubtConstants()


def doubts_std(board: Board, floor: FloorReference) -> Array:
    """Stated deviations (10,) of :data:`towval.calibration.blocks.DOUBTS`."""
    bow = board.bow_std_m
    return np.array([board.size_std, bow, bow, bow, floor.board_thickness_std_m, *CONSTANTS.loose_std[5:]])


@dataclass(frozen=True)
class Settled:
    """A calibration with its doubts settled.

    ``trials`` of all lens models and the ``chosen`` one; ``covariance`` (18, 18) of the camera's parameters;
    ``quality``: size, thickness and bow of the board as fitted against what is stated, with their deviations.
    """

    trials: Sequence[LensTrial]
    chosen: LensTrial
    covariance: Array
    findings: tuple[Finding, ...]
    quality: dict[str, float]


@dataclass(frozen=True)
class _Fit:
    """A fit of ``active`` parameters (k,), doubts among them, with its covariance (k, k)."""

    estimate: Estimate
    active: NDArray[np.intp]
    covariance: Array

    def variance(self, doubts: Doubts) -> Array:
        """Covariance of some of the doubts that were fitted."""
        at = np.isin(self.active, doubts)
        return self.covariance[np.ix_(at, at)]


def _fit(observed: CalibrationObservations, start: Estimate, model: str, doubts: Doubts) -> _Fit:
    active = np.concatenate([active_parameters(model, observed.reference is not None), doubts])
    estimate = adjust(observed.blocks, start, active)
    return _Fit(estimate, active, view_covariance(observed.blocks, estimate, active))


def settle(observed: CalibrationObservations, start: Estimate, models: Sequence[str], folds: int) -> Settled:
    """Choose the lens of ``models`` and fit it with the board's doubts; again where views contradict what is stated.

    ``observed`` are the views that fit, with the deviations of the doubts; ``folds`` those of the cross-validation.
    """
    doubts, stated = _open(observed, BOARD_DOUBTS), observed.doubts_std
    start, held = replace(start, doubts_std=observed.doubts_std), _open(observed, HELD_DOUBTS)
    trials = try_lenses(observed.blocks, start, models, folds, doubts)
    # A lens of too many coefficients hides another zoom: it is looked for with the lens that suffices beside it.
    beside = try_lenses(observed.blocks, start, models, folds, np.union1d(doubts, held)) if len(held) else trials
    wrong, stretch = _contradicted(observed, choose_lens(trials), choose_lens(beside).model)
    if len(wrong):
        doubts = np.union1d(doubts, wrong)
        if stated[_SIZE - CAMERA_END] > 0:
            # Which side of a square was measured is not said: either is off the mean by half of what they differ by.
            stated = np.where(np.arange(len(DOUBTS)) == _SIZE - CAMERA_END, np.hypot(stated, stretch / 2), stated)
        loose = np.isin(CAMERA_END + np.arange(len(DOUBTS)), wrong)
        again = replace(trials[-1].estimate, doubts_std=np.where(loose, CONSTANTS.loose_std, stated))
        trials = try_lenses(observed.blocks, again, models, folds, doubts)
    chosen = choose_lens(trials)
    fit = _fit(observed, chosen.estimate, chosen.model, doubts)
    covariance, camera = np.zeros((CAMERA_END,) * 2), fit.active[fit.active < CAMERA_END]
    covariance[np.ix_(camera, camera)] = fit.covariance[: len(camera), : len(camera)]
    value, std, bow_m = _fitted(fit)
    quality = {
        "board_size_percent": 100 * value[0], "board_size_std_percent": 100 * std[0],
        "board_thickness_mm": 1e3 * value[4], "board_thickness_std_mm": 1e3 * std[4],
        "board_bow_mm": 1e3 * bow_m, "board_bow_std_mm": 1e3 * std[1:4].max(),
    }  # fmt: skip
    return Settled(trials, chosen, covariance, _findings(observed, fit, wrong), quality)


def without_prejudice(observed: CalibrationObservations, estimate: Estimate, model: str) -> Estimate:
    """A fit that leaves everything that can be doubted to the pictures, whatever is stated; views are judged by it."""
    doubts = _open(observed, np.union1d(BOARD_DOUBTS, HELD_DOUBTS))
    active = np.concatenate([active_parameters(model, observed.reference is not None), doubts])
    return adjust(observed.blocks, replace(estimate, doubts_std=np.array(CONSTANTS.loose_std)), active)


def _open(observed: CalibrationObservations, doubts: Doubts) -> Doubts:
    """Those of the doubts that have a deviation, and pictures that could tell.

    Of few surveyed marks alone a wrong one looks like another zoom and crop of the held pictures.
    """
    free = observed.doubts_std[doubts - CAMERA_END] > 0
    neither = observed.reference is None or not observed.boards
    if neither or (not observed.floor_boards and observed.marks < FEWEST_TO_TELL):
        free &= ~np.isin(doubts, HELD_DOUBTS)
    return doubts[free]


def _contradicted(observed: CalibrationObservations, trial: LensTrial, held_model: str) -> tuple[Doubts, float]:
    """Where the views contradict what is stated, and the stretch of squares that are none, zero of others.

    That is the squares' shape; zoom and shift of the held pictures, or zoom; size, or thickness.
    """
    board, held, shape = (_open(observed, doubts) for doubts in (BOARD_DOUBTS, HELD_DOUBTS, PRINT_DOUBTS))
    odd = _contradiction(observed, trial, trial.model, shape)
    shape, stretch = (shape, float(odd.value[0])) if odd.beyond else (_NONE, 0.0)
    groups = [held, held[:1], *(board[board == i] for i in (_SIZE, _THICKNESS))]
    lenses = held_model, held_model, trial.model, trial.model
    said = [_contradiction(observed, trial, lens, group, shape) for lens, group in zip(lenses, groups, strict=True)]
    wrong = [group for group, one in zip(groups[:2], said[:2], strict=True) if one.beyond][:1]
    # Size and thickness explain nearly the same: it is the one that need not be as far from what is stated.
    sizes = [(one.far, i) for i, one in enumerate(said) if one.beyond and i >= 2]
    return np.concatenate([shape, *wrong, *(groups[i] for _, i in sorted(sizes)[:1])]), stretch


class _Said(NamedTuple):
    """Whether the views contradict what is stated of a group, by how many deviations, and the values they say."""

    beyond: bool
    far: float
    value: Array


def _contradiction(
    observed: CalibrationObservations, trial: LensTrial, model: str, group: Doubts, beside: Doubts = _NONE
) -> _Said:
    """What the views say of a group, the rest being as stated, but for what is ``beside`` it: that is fitted freely."""
    if not len(group):
        return _Said(False, 0.0, np.zeros(0))
    board, every = np.union1d(_open(observed, BOARD_DOUBTS), beside), CAMERA_END + np.arange(len(DOUBTS))
    own, free = np.isin(every, group), np.isin(every, np.union1d(group, beside))
    start = replace(trial.estimate, doubts_std=np.where(free, CONSTANTS.loose_std, observed.doubts_std))
    fit = _fit(observed, start, model, np.union1d(group, board))
    # Squares measured as well as the size is stated may be longer one way than the other by as much, unmeasured.
    stated = np.where(np.isin(every, PRINT_DOUBTS), observed.doubts_std[_SIZE - CAMERA_END], observed.doubts_std)[own]
    value, stated = fit.estimate.doubts[own], np.where(np.isin(group, HELD_DOUBTS), 0.0, stated)
    squared = float(value @ np.linalg.solve(fit.variance(group) + np.diag(stated**2), value))
    far, most = float(np.max(np.abs(value) / observed.doubts_std[own])), float(chdtri(len(group), 1 - CONSTANTS.sound))
    if squared <= most or np.isin(group, board).all():
        return _Said(squared > most, far, value)
    # Of the held pictures and the squares' shape nothing is stated: a fit may go far along a curved valley, off the
    # straight one that its covariance describes, and leave the corners as far off as before.
    as_stated = np.where(np.isin(every, beside), CONSTANTS.loose_std, observed.doubts_std)
    without = _fit(observed, replace(trial.estimate, doubts_std=as_stated), model, board)
    gain = _squares(observed, without, fit.estimate.noise_px) - _squares(observed, fit, fit.estimate.noise_px)
    return _Said(gain > most, far, value)


def _squares(observed: CalibrationObservations, fit: _Fit, noise_px: float) -> float:
    """Sum of the squared residuals over their deviations, for corners of this noise [px]."""
    estimate = replace(fit.estimate, noise_px=noise_px)
    return sum(float(r @ r) for r, _, _ in whitened(observed.blocks, estimate, fit.active))


def _fitted(fit: _Fit) -> tuple[Array, Array, float]:
    """The doubts (10,) as fitted, their deviations (10,), zero where not fitted, and the greatest bow [m]."""
    value, std = fit.estimate.doubts, np.zeros(len(DOUBTS))
    fitted = fit.active[fit.active >= CAMERA_END]
    std[fitted - CAMERA_END] = np.sqrt(np.diag(fit.variance(fitted)))
    x, y, twist = value[1:4]
    return value, std, float(np.abs(np.linalg.eigvalsh([[x, twist / 2], [twist / 2, y]])).max())


def _findings(observed: CalibrationObservations, fit: _Fit, wrong: Doubts) -> tuple[Finding, ...]:
    """What was corrected, by its name."""
    value, std, bow_m = _fitted(fit)
    findings = []
    if bow_m > max(CONSTANTS.noticeable_bow_m, CONSTANTS.named * std[1:4].max()):
        findings.append(finding("board-bent", bow_mm=1e3 * bow_m, std_mm=1e3 * std[1:4].max()))
    if _SIZE in wrong:
        findings.append(finding("board-size", percent=100 * value[0], std_percent=100 * std[0]))
    if _THICKNESS in wrong:
        findings.append(finding("board-thickness", thicker_mm=1e3 * value[4], std_mm=1e3 * std[4]))
    if np.isin(PRINT_DOUBTS, wrong).any():
        shape = {"percent": 100 * value[5], "std_percent": 100 * std[5], "skew_deg": np.degrees(value[6])}
        findings.append(finding("board-stretched", **shape))
    if np.isin(HELD_DOUBTS, wrong).any():
        flip = _flip(observed.resolution_px, fit.estimate, std)
        names = "the held pictures"
        zoom, u, v = value[-3:]
        numbers = {"percent": 100 * zoom, "std_percent": 100 * std[-3], "u": u, "v": v}
        by = "their optical centre is on the other side"
        turned = finding("held-flipped", names=names, flip=flip, by=by)
        findings.append(turned if flip else finding("held-differ", names=names, **numbers))
    return tuple(findings)


def _flip(resolution_px: tuple[int, int], estimate: Estimate, std: Array) -> str:
    """How the held pictures are flipped against the others, judging by their principal point; empty if they are not."""
    if not (std[-2:] > 0).all():
        return ""
    over = np.array(resolution_px) - 1 - 2 * estimate.shared[2:4]
    sides = {"mirrored": (1, 0), "upside down and mirrored": (0, 1), "upside down": (1, 1)}
    off = {
        name: float(np.max(np.abs(estimate.doubts[-3:] - [0.0, *(over * side)]) / std[-3:]))
        for name, side in sides.items()
    }
    nearest = min(off, key=lambda name: off[name])
    return nearest if off[nearest] < CONSTANTS.named else ""
