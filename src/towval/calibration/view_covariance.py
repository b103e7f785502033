"""Covariance of a calibration from the scatter of its views, since the errors of one picture's corners go together.

Print, blur, light and a lens model that is not quite the lens move neighbouring corners alike: residuals taken one by
one state deviations two to four times too small (measured on two sets of photographs). So each view counts as one draw.
To first order the fit without view g differs from that with it by ``-(H - S)⁻¹ s``, with H the information of all
pictures, S that of the view and s its score, both less what the view's own place takes up. The scatter of these is the
jackknife over views in one pass: CR3 of Bell and McCaffrey (2002), Survey Methodology 28.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.calibration.blocks import Block, Estimate, Placement
from towval.calibration.bundle_adjustment import stated_before, whitened
from towval.model import Array


@dataclass(frozen=True)
class ViewCovarianceConstants:
    """Tuned constants of the covariance from views."""

    prior_views: int = 8  # That many views' weight has the covariance of independent corners, inflated as a whole:
    # the scatter of a dozen views alone leaves single directions 2 deviations short (0 to 12 views tried).


CONSTANTS = ViewCovarianceConstants()

_UNDETERMINED = 1e-9  # Share of the largest information, below which nothing but rounding is left of a direction's.


def view_covariance(blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]) -> Array:
    """Covariance (k, k) of the ``active`` shared parameters (k,) of an :func:`adjust`, clustered by view.

    Blocks whose deviation is stated (surveyed marks) enter with it. The board that fixes the floor frame says of x, y
    and heading what no other view repeats, and a single board on the floor of its height and slope, too: these parts
    enter with the deviation of independent corners, inflated as all others' is found to be.
    """
    sums = _Sums(blocks, estimate, active)
    unit = 1 / np.sqrt(np.maximum(np.diag(sums.information), 1e-300))
    H = _scaled(sums.information, unit)
    inverse = _loose_inverse(H)
    frame, stated = (inverse @ _scaled(part, unit) @ inverse for part in (sums.frame, sums.stated))
    views = [_scaled(view, unit) for view in sums.views]
    scores = [unit * score for score in sums.scores]
    # What is expected of the scores of independent corners, against what is found.
    expected = sum(np.trace(inverse @ S) - np.trace(inverse @ S @ inverse @ S) for S in views)
    found = sum(score @ inverse @ score for score in scores)
    inflation = max(1.0, float(found / expected)) if views else 1.0
    # Without such a view the fits say nothing of these directions: they scatter by nothing.
    alone = sum((_only_by(S, H) for S in views), np.zeros_like(H))
    covariance = inflation * (inverse - frame - stated - alone)
    if views:
        moves = np.array([_inverse(H - S) @ score for S, score in zip(views, scores, strict=True)])
        scatter, prior = (len(views) - 1) * moves.T @ moves, CONSTANTS.prior_views
        covariance = (scatter + prior * covariance) / (len(views) + prior)
    return _scaled(covariance + inflation * (frame + alone) + stated, unit)


def _only_by(view: Array, H: Array) -> Array:
    """The part of the inverse of the information ``H`` in directions that a single view with its own determines."""
    values, vectors = np.linalg.eigh(H - view)
    V = vectors[:, values <= _UNDETERMINED * values[-1]]
    information = V.T @ H @ V
    # Directions that no view determines stay what they are.
    own, turn = np.linalg.eigh(information)
    known = own > _UNDETERMINED * values[-1]
    W = V @ turn[:, known]
    return np.asarray((W / own[known]) @ W.T)


def _scaled(matrix: Array, unit: Array) -> Array:
    return np.asarray(unit[:, None] * matrix * unit)


def _loose_inverse(matrix: Array) -> Array:
    """Inverse of an information scaled to unit diagonal, very large in the directions that are not determined."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.maximum(values, _UNDETERMINED * values[-1])) @ vectors.T)


def _inverse(matrix: Array) -> Array:
    """Inverse of an information scaled to unit diagonal, without the directions that are not determined."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > _UNDETERMINED * values[-1]
    return np.asarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T)


class _Sums:
    """Whitened sums over the pictures, less what each one's own place takes up.

    ``information`` (k, k) of all; ``stated`` of those with a stated deviation; ``views`` and ``scores`` (k,) of the
    others one by one; ``frame`` what fixes the floor frame by itself.
    """

    def __init__(self, blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]):
        k = len(active)
        self.stated, self.frame = np.diag(stated_before(estimate, active)), np.zeros((k, k))
        self.information = self.stated.copy()
        self.views: list[Array] = []
        self.scores: list[Array] = []
        for block, (r, A, B) in zip(blocks, whitened(blocks, estimate, active), strict=True):
            by_place = np.linalg.solve(B.T @ B, B.T) if B.shape[1] else B.T
            taken = A.T @ B @ by_place
            S = A.T @ A - taken @ A
            self.information += S
            if np.isfinite(block.std_px):
                self.stated += S
                continue
            self.views.append(S)
            self.scores.append(A.T @ r - taken @ r)
            if block.placement is Placement.FIXED:
                self.frame += taken @ A
        self.information += self.frame
