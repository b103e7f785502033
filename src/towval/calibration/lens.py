"""Selection of the lens model: the smallest that predicts held-out views as well as the best.

There are two nested families, of a pinhole camera and of a fisheye. Both describe an ordinary lens; a fisheye's is
tried where the lens bends the picture far.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from towval.calibration.blocks import CAMERA_END, FLOOR_START, LENS_START, Block, Estimate, Placement, residuals
from towval.calibration.bundle_adjustment import adjust, marginal_covariance
from towval.model import Array
from towval.model.camera import is_fisheye
from towval.model.plugins import Registry
from towval.optics.projection import undistorted_kernel

LENS_MODELS: Registry[tuple[int, ...]] = Registry("lens model")
"""Lens models by name: the coefficients that each fits besides fx, fy, cx, cy, as indices of
:data:`towval.model.CALIBRATION_PARAMETERS` (4 to 11: k1, k2, p1, p2, k3, k4, k5, k6); the others are zero. Those of a
model whose name begins with ``fisheye`` act on the angle of a ray, those of the others on its tangent."""

LENS_MODELS.register("none", ())
LENS_MODELS.register("k1", (4,))
LENS_MODELS.register("k1 k2", (4, 5))
LENS_MODELS.register("k1 k2 p1 p2", (4, 5, 6, 7))
LENS_MODELS.register("k1 k2 p1 p2 k3", (4, 5, 6, 7, 8))
LENS_MODELS.register("rational", (4, 5, 6, 7, 8, 9, 10, 11))
LENS_MODELS.register("fisheye", ())
LENS_MODELS.register("fisheye k1", (4,))
LENS_MODELS.register("fisheye k1 k2", (4, 5))
LENS_MODELS.register("fisheye k1 k2 k3", (4, 5, 8))

NESTED = tuple(LENS_MODELS)
"""Nested models of both families to choose from by default, smallest first."""


NO_DOUBTS: NDArray[np.intp] = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True)
class LensConstants:
    """Tuned constants of model selection."""

    largest_condition: float = 1e8
    # Beyond it coefficients cancel: the fit is good at the corners, and arbitrary between and beyond them.
    wide: float = 0.2
    # Share by which the lens draws a corner of the picture inwards, beyond which it may be a fisheye's: that of equal
    # angles at a half angle of 44°. Distorted webcams have 0.15.


CONSTANTS = LensConstants()


@dataclass(frozen=True)
class LensTrial:
    """Result of one lens model.

    ``held_out_rms_px`` (views,) of every view as predicted by the others; ``estimate`` from all views; ``condition``
    the scaled condition number of its parameters.
    """

    model: str
    held_out_rms_px: Array
    estimate: Estimate
    condition: float

    @property
    def score_px2(self) -> float:
        """Mean square held-out residual of a coordinate [px²]."""
        return float(np.mean(self.held_out_rms_px**2))

    @property
    def determined(self) -> bool:
        """Whether the views determine the coefficients, or leave some that cancel."""
        return self.condition < CONSTANTS.largest_condition


def active_parameters(model: str, with_floor: bool) -> NDArray[np.intp]:
    """Indices of the shared parameters that a lens model fits, those of the floor among them where there is one."""
    floor = range(FLOOR_START, CAMERA_END) if with_floor else ()
    return np.array([*range(LENS_START), *LENS_MODELS[model], *floor])


def try_lens(
    blocks: Sequence[Block], start: Estimate, model: str, folds: int, doubts: NDArray[np.intp] = NO_DOUBTS
) -> LensTrial:
    """Fit a lens model to all views and, leaving out a fold at a time, predict each view from the others.

    For a view that is left out only its place is fitted. Points given in floor coordinates stay in every fit: they fix
    the frame. ``doubts`` are indices of what is fitted besides the lens.
    """
    with_floor = any(block.placement is not Placement.FREE for block in blocks)
    active = np.concatenate([active_parameters(model, with_floor), doubts])
    estimate = adjust(blocks, _as_model(start, model), active)
    movable = [i for i, block in enumerate(blocks) if block.placement is not Placement.FIXED]
    scores = np.full(len(blocks), np.nan)
    for fold in range(min(folds, len(movable))):
        left_out = movable[fold::folds]
        kept = [i for i in range(len(blocks)) if i not in left_out]
        fitted = adjust([blocks[i] for i in kept], estimate.of(kept), active)
        test = replace(fitted, places=estimate.of(left_out).places)
        test_blocks = [blocks[i] for i in left_out]
        placed = adjust(test_blocks, test, np.array([], dtype=np.intp))
        for i, residual in zip(left_out, residuals(test_blocks, placed), strict=True):
            scores[i] = np.sqrt(np.mean(residual**2))
    condition = marginal_covariance(blocks, estimate, active)[1]
    return LensTrial(model, scores[movable], estimate, condition)


def try_lenses(
    blocks: Sequence[Block], start: Estimate, models: Sequence[str], folds: int, doubts: NDArray[np.intp] = NO_DOUBTS
) -> list[LensTrial]:
    """Try nested models, smallest first, until two in a row predict no better.

    Each begins where the one before ended, or at ``start`` where this leaves less: a model that is too small for the
    lens may end with a focal length of a pixel, from which no larger one comes back.
    """
    trials: list[LensTrial] = []
    worse_in_a_row = 0
    for model in models:
        begin = min([start, *(trial.estimate for trial in trials[-1:])], key=lambda one: _left_over(blocks, one, model))
        trials.append(try_lens(blocks, begin, model, folds, doubts))
        best_before = min((trial.score_px2 for trial in trials[:-1]), default=np.inf)
        worse_in_a_row = 0 if trials[-1].score_px2 < best_before else worse_in_a_row + 1
        if worse_in_a_row == 2:
            break
    return trials


def _as_model(estimate: Estimate, model: str) -> Estimate:
    """An estimate without the coefficients that a lens model does not have."""
    shared = estimate.shared.copy()
    shared[[i for i in range(LENS_START, FLOOR_START) if i not in LENS_MODELS[model]]] = 0.0
    return replace(estimate, shared=shared)


def _left_over(blocks: Sequence[Block], estimate: Estimate, model: str) -> float:
    """Sum of the squared residuals of an estimate whose lens is one of a model [px²]."""
    return sum(float(np.sum(each**2)) for each in residuals(blocks, _as_model(estimate, model)))


def choose_lens(trials: Sequence[LensTrial]) -> LensTrial:
    """The smallest model whose held-out error is within one standard error of the best one's.

    The standard error is that of the paired difference: the same views, predicted by both models. Models with
    undetermined coefficients are excluded unless all are such. Of models of one size the first of ``trials`` is taken.
    """
    trials = [trial for trial in trials if trial.determined] or trials
    trials = sorted(trials, key=lambda trial: len(LENS_MODELS[trial.model]))
    best = min(trials, key=lambda trial: trial.score_px2)
    for trial in trials:
        difference = trial.held_out_rms_px**2 - best.held_out_rms_px**2
        if difference.mean() <= difference.std(ddof=1) / np.sqrt(len(difference)):
            return trial
    return best


def families(models: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The models of a pinhole camera and those of a fisheye, each in their order."""
    fisheyes = tuple(model for model in models if is_fisheye(model))
    return tuple(model for model in models if model not in fisheyes), fisheyes


def may_be_fisheye(estimate: Estimate, resolution_px: tuple[int, int]) -> bool:
    """Whether a lens draws a corner of the picture so far inwards that a fisheye's models may describe it better.

    So it is, too, where it does not say what it shows there.
    """
    across, down = np.array(resolution_px) - 1.0
    corners = np.array([[0.0, 0.0], [across, 0.0], [0.0, down], [across, down]])
    middle, focal = estimate.shared[2:4], estimate.shared[:2]
    shown = np.linalg.norm((corners - middle) / focal, axis=1)
    ray = np.linalg.norm(undistorted_kernel(corners, estimate.matrix, estimate.lens), axis=1)
    return not bool(np.all(1 - shown / ray < CONSTANTS.wide))
