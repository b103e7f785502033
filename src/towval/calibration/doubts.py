"""Stated values that may be wrong: size, bow and thickness of the board, zoom and crop of the held pictures.

The board's doubts are fitted beside the camera, with their stated deviations, which thereby enter its covariance. What
the views contradict is fitted without prejudice and reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from towval.calibration.blocks import BOARD_DOUBTS, CAMERA_END, DOUBTS, HELD_DOUBTS, Estimate
from towval.calibration.bundle_adjustment import adjust, whitened
from towval.calibration.lens import LensTrial, active_parameters, choose_lens, try_lenses
from towval.calibration.observations import CalibrationObservations
from towval.calibration.view_covariance import view_covariance
from towval.model import Array, Board, Finding, FloorReference
from towval.model.findings import finding

Doubts = NDArray[np.intp]
"""Some of :data:`towval.calibration.blocks.DOUBTS`, as indices of parameters."""

_SIZE, _THICKNESS = CAMERA_END + DOUBTS.index("size"), CAMERA_END + DOUBTS.index("thickness")


@dataclass(frozen=True)
class DoubtConstants:
    """Tuned constants of the doubts."""

    sound: float = 0.9999  # Share of sound sets that stay below what is taken for other than stated.
    noticeable_bow_m: float = 0.0003  # [m] Below it a bow is corrected without a word: 0.2 mm on the floor.
    named: float = 3.0  # Deviations of a bow that is reported; within which a principal point is a mirrored one.
    loose_std: tuple[float, ...] = (0.05, 0.01, 0.01, 0.01, 0.01, 0.1, 200.0, 200.0)
    # [1, m, m, m, m, 1, px, px] Of each doubt where only the pictures are to tell: far beyond what occurs.


CONSTANTS = DoubtConstants()


def doubts_std(board: Board, floor: FloorReference) -> Array:
    """Stated deviations (8,) of :data:`towval.calibration.blocks.DOUBTS`."""
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
    doubts = _open(observed, BOARD_DOUBTS)
    start, held = replace(start, doubts_std=observed.doubts_std), _open(observed, HELD_DOUBTS)
    trials = try_lenses(observed.blocks, start, models, folds, doubts)
    # A lens of too many coefficients hides another zoom: it is looked for with the lens that suffices beside it.
    beside = try_lenses(observed.blocks, start, models, folds, np.union1d(doubts, held)) if len(held) else trials
    wrong = _contradicted(observed, choose_lens(trials), choose_lens(beside).model)
    if len(wrong):
        doubts = np.union1d(doubts, wrong)
        loose = np.isin(CAMERA_END + np.arange(len(DOUBTS)), wrong)
        again = replace(trials[-1].estimate, doubts_std=np.where(loose, CONSTANTS.loose_std, observed.doubts_std))
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
    """Those of the doubts that have a deviation, and pictures that could tell."""
    free = observed.doubts_std[doubts - CAMERA_END] > 0
    if observed.reference is None or not observed.boards:
        free &= ~np.isin(doubts, HELD_DOUBTS)
    return doubts[free]


def _contradicted(observed: CalibrationObservations, trial: LensTrial, held_model: str) -> Doubts:
    """Where the views contradict what is stated: zoom and shift of the held pictures, or zoom; size, or thickness."""
    board, held = _open(observed, BOARD_DOUBTS), _open(observed, HELD_DOUBTS)
    groups = [held, held[:1], *(board[board == i] for i in (_SIZE, _THICKNESS))]
    lenses = held_model, held_model, trial.model, trial.model
    said = [_contradiction(observed, trial, lens, group) for lens, group in zip(lenses, groups, strict=True)]
    wrong = [group for group, (beyond, _) in zip(groups[:2], said[:2], strict=True) if beyond][:1]
    # Size and thickness explain nearly the same: it is the one that need not be as far from what is stated.
    sizes = [(far, i) for i, (beyond, far) in enumerate(said) if beyond and i >= 2]
    return np.concatenate([held[:0], *wrong, *(groups[i] for _, i in sorted(sizes)[:1])])


def _contradiction(
    observed: CalibrationObservations, trial: LensTrial, model: str, group: Doubts
) -> tuple[bool, float]:
    """Whether the views contradict what is stated of a group, the rest being as stated, and by how many deviations."""
    if not len(group):
        return False, 0.0
    board, own = _open(observed, BOARD_DOUBTS), np.isin(CAMERA_END + np.arange(len(DOUBTS)), group)
    start = replace(trial.estimate, doubts_std=np.where(own, CONSTANTS.loose_std, observed.doubts_std))
    fit = _fit(observed, start, model, np.union1d(group, board))
    value, stated = fit.estimate.doubts[own], np.where(np.isin(group, board), observed.doubts_std[own], 0.0)
    squared = float(value @ np.linalg.solve(fit.variance(group) + np.diag(stated**2), value))
    far, most = float(np.max(np.abs(value) / observed.doubts_std[own])), float(chdtri(len(group), 1 - CONSTANTS.sound))
    if squared <= most or np.isin(group, board).all():
        return squared > most, far
    # Of the held pictures nothing is stated: a fit may go far along a curved valley, off the straight one that its
    # covariance describes, and leave the corners as far off as before.
    as_stated = _fit(observed, replace(trial.estimate, doubts_std=observed.doubts_std), model, board)
    gain = _squares(observed, as_stated, fit.estimate.noise_px) - _squares(observed, fit, fit.estimate.noise_px)
    return gain > most, far


def _squares(observed: CalibrationObservations, fit: _Fit, noise_px: float) -> float:
    """Sum of the squared residuals over their deviations, for corners of this noise [px]."""
    estimate = replace(fit.estimate, noise_px=noise_px)
    return sum(float(r @ r) for r, _, _ in whitened(observed.blocks, estimate, fit.active))


def _fitted(fit: _Fit) -> tuple[Array, Array, float]:
    """The doubts (8,) as fitted, their deviations (8,), zero where not fitted, and the bow over all directions [m]."""
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
    if np.isin(HELD_DOUBTS, wrong).any():
        flip = _flip(observed.resolution_px, fit.estimate, std)
        names = "the held pictures"
        numbers = {"percent": 100 * value[5], "std_percent": 100 * std[5], "u": value[6], "v": value[7]}
        by = "their optical centre is on the other side"
        turned = finding("held-flipped", names=names, flip=flip, by=by)
        findings.append(turned if flip else finding("held-differ", names=names, **numbers))
    return tuple(findings)


def _flip(resolution_px: tuple[int, int], estimate: Estimate, std: Array) -> str:
    """How the held pictures are flipped against the others, judging by their principal point; empty if they are not."""
    if not (std[6:] > 0).all():
        return ""
    over = np.array(resolution_px) - 1 - 2 * estimate.shared[2:4]
    sides = {"mirrored": (1, 0), "upside down and mirrored": (0, 1), "upside down": (1, 1)}
    off = {
        name: float(np.max(np.abs(estimate.doubts[5:] - [0.0, *(over * side)]) / std[5:]))
        for name, side in sides.items()
    }
    nearest = min(off, key=lambda name: off[name])
    return nearest if off[nearest] < CONSTANTS.named else ""
