"""Bundle adjustment of one camera, its lens, the floor and all boards, and the covariance of the result.

The normal equations are reduced to the shared parameters with the Schur complement, both to solve them and to get their
marginal covariance, which includes the uncertainty of the places of all boards.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from towval.calibration.blocks import CAMERA_END, DOUBTS, FLOOR_START, Block, Estimate, Placement, Stack
from towval.model import Array

_MAX_STEPS = 400  # A fit that converges stops by itself.
_NOISE_ROUNDS = 5
_NEGLIGIBLE_DECREASE = 1e-4
"""In units of the whitened cost, where 1 is one standard deviation of one parameter combination."""
_PROBE, _MOST_BEND = 0.1, 0.75
"""Part of a step at which its bend is measured, and bend over step that is taken: Transtrum and Sethna's values."""


@dataclass(frozen=True)
class AdjustmentConstants:
    """Tuned constant of the adjustment."""

    robust_width: float = 5.0  # Residuals beyond so many times the spread of their own picture count linearly (Huber).
    # Of their own picture, not of all: a corner is an outlier among its neighbours, whereas a whole picture that fits
    # badly may be the only one that reaches the edge of the image and must keep its weight.


CONSTANTS = AdjustmentConstants()

RAYLEIGH_MEDIAN = np.sqrt(2 * np.log(2))
"""Median length of a two-dimensional Gaussian vector, in standard deviations of one coordinate."""

_Step = tuple[Array, Array]
"""By how much the active shared parameters (k,) and the places (V, 6) of the blocks move."""


@dataclass(frozen=True)
class _Normal:
    """Whitened normal equations of V blocks: A by the shared parameters, B by the place, r the residual.

    ``root`` (V, 2n, 1) are the roots of the weights that whiten; ``r`` (V, 2n), ``A`` (V, 2n, k) and ``B`` (V, 2n, 6)
    what the sums over all blocks, ``AA`` and ``Ar``, and those over each, ``AB``, ``BB`` and ``Br``, are made of.
    """

    cost: float
    root: Array
    r: Array
    A: Array
    B: Array
    AA: Array
    Ar: Array
    AB: Array
    BB: Array
    Br: Array

    def reduced(self, damping: float, sides: _Step | None = None) -> tuple[Array, Array, Array]:
        """Schur complement, its right-hand side and the gains that give the places; Marquardt's relative damping."""
        Ar, Br = sides or (self.Ar, self.Br)
        BB = self.BB.copy()
        BB[:, range(BB.shape[1]), range(BB.shape[1])] *= 1 + damping
        gains = np.asarray(np.linalg.solve(BB, np.concatenate([self.AB.transpose(0, 2, 1), Br[..., None]], axis=2)))
        taken = np.sum(self.AB @ gains, axis=0)
        return _damped(self.AA, damping) - taken[:, :-1], Ar - taken[:, -1], gains

    def step(self, damping: float, sides: _Step | None = None) -> _Step:
        """The step that solves the damped equations, on request with other right-hand ``sides`` than the residuals'."""
        schur, right, gains = self.reduced(damping, sides)
        shared = _solve_scaled(schur, right)
        return shared, gains[..., -1] - gains[..., :-1] @ shared

    def length(self, step: _Step) -> float:
        """Length of a step, each parameter over the deviation that it has where all others are known."""
        places = np.diagonal(self.BB, axis1=1, axis2=2)
        return float(np.sqrt(np.diag(self.AA) @ step[0] ** 2 + np.sum(places * step[1] ** 2)))


def _damped(matrix: Array, damping: float) -> Array:
    matrix = matrix.copy()
    matrix.flat[:: len(matrix) + 1] *= 1 + damping
    return matrix


def _std(stack: Stack, estimate: Estimate) -> Array:
    return np.where(np.isnan(stack.std_px), estimate.noise_px, stack.std_px)


def _huber_weight(lengths: Array, spread_px: Array) -> Array:
    return np.asarray(np.minimum(1.0, CONSTANTS.robust_width * spread_px[:, None] / np.maximum(lengths, 1e-12)))


def _spread(stack: Stack, estimate: Estimate) -> Array:
    """Robust standard deviation (V,) of the residuals of each block [px], at least that of its corners."""
    medians = stack.medians(stack.lengths(stack.residual(estimate)))
    return np.asarray(np.maximum(medians / RAYLEIGH_MEDIAN, _std(stack, estimate)))


def _normal(stack: Stack, estimate: Estimate, active: NDArray[np.intp], spread_px: Array) -> _Normal:
    blocks, k = len(stack.counts), len(active)
    residual, by_shared, by_place = stack.linearise(estimate, doubted=bool((active >= CAMERA_END).any()))
    lengths, std = stack.lengths(residual), _std(stack, estimate)[:, None]
    weight = _huber_weight(lengths, spread_px) * stack.there
    root = np.repeat(np.sqrt(weight) / std, 2, axis=1)[..., None]
    r = root[..., 0] * residual.reshape(blocks, -1)
    A, B = root * by_shared[..., active].reshape(*r.shape, k), root * by_place.reshape(*r.shape, -1)
    flat = A.reshape(r.size, k)
    known = stated_before(estimate, active)
    off = np.concatenate([np.zeros(CAMERA_END), estimate.doubts])[active]
    # Huber: length² below the width, 2 width · length − width² beyond; with w = width / length both are one form.
    cost = float(known @ off**2 + np.sum(weight * (2 - weight) * (lengths / std) ** 2))
    by_view = B.transpose(0, 2, 1)
    BB = by_view @ B
    absent = np.arange(BB.shape[1]) >= stack.unknowns[:, None]
    BB[:, range(BB.shape[1]), range(BB.shape[1])] += absent  # What a place does not have stays where it is.
    AA, Ar = np.diag(known) + flat.T @ flat, flat.T @ r.ravel() - known * off
    return _Normal(cost, root, r, A, B, AA, Ar, A.transpose(0, 2, 1) @ B, BB, (by_view @ r[..., None])[..., 0])


def stated_before(estimate: Estimate, active: NDArray[np.intp]) -> Array:
    """Information (k,) on each of the ``active`` parameters that does not come from the pictures."""
    std = np.concatenate([np.full(CAMERA_END, np.inf), estimate.doubts_std])[active]
    return np.asarray(std**-2.0)


def whitened(
    blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]
) -> Iterator[tuple[Array, Array, Array]]:
    """Residual and derivatives of each block as in :func:`linearise`, over its deviation and robustly weighted.

    Of the shared parameters only the ``active`` ones. A fixed board has derivatives by a place (2n, 3), too, as if it
    lay free on the floor where it is.
    """
    gauges = [block.placement is Placement.FIXED and np.isnan(block.std_px) for block in blocks]
    as_placed = [replace(b, placement=Placement.ON_FLOOR) if g else b for b, g in zip(blocks, gauges, strict=True)]
    places = tuple(np.zeros(3) if g else place for place, g in zip(estimate.places, gauges, strict=True))
    stack, there = Stack(as_placed), replace(estimate, places=places)
    normal = _normal(stack, there, active, _spread(stack, there))
    for n, unknowns, r, A, B in zip(stack.counts, stack.unknowns, normal.r, normal.A, normal.B, strict=True):
        yield r[: 2 * n], A[: 2 * n], B[: 2 * n, :unknowns]


def adjust(blocks: Sequence[Block], start: Estimate, active: NDArray[np.intp]) -> Estimate:
    """Fit shared parameters and places to all blocks at once, robustly.

    Levenberg-Marquardt on Huber's cost; the corner noise is re-estimated from the median residual until it converges,
    and that of the result follows from the weighted residuals and the degrees of freedom. ``start`` may have a
    ``noise_px`` of NaN; ``active`` are the indices of the shared parameters and :data:`DOUBTS` to fit. If empty, only
    the places move. The floor's rotation vector of the result is no longer than π, as its rotation gives it back.
    """
    stack = Stack(blocks)
    estimate = start if np.isfinite(start.noise_px) else replace(start, noise_px=_median_noise(stack, start))
    for _ in range(_NOISE_ROUNDS):
        estimate = _levenberg_marquardt(stack, estimate, active)
        noise = _median_noise(stack, estimate)
        settled = abs(noise - estimate.noise_px) < 0.02 * estimate.noise_px
        estimate = replace(estimate, noise_px=noise)
        if settled:
            break
    estimate = replace(estimate, shared=_within_half_turn(estimate.shared))
    return replace(estimate, noise_px=_noise(stack, estimate, len(active)))


def _within_half_turn(shared: Array) -> Array:
    """Shared parameters (18,) with the floor's rotation vector no longer than π.

    That of a ceiling camera is about π long, and a fit may pass it. The covariance must be that of the vector which its
    users take from the rotation again.
    """
    turn = shared[FLOOR_START : FLOOR_START + 3]
    angle = np.linalg.norm(turn)
    if angle <= np.pi:
        return shared
    return np.concatenate([shared[:FLOOR_START], turn * (1 - 2 * np.pi / angle), shared[FLOOR_START + 3 :]])


def _levenberg_marquardt(stack: Stack, estimate: Estimate, active: NDArray[np.intp]) -> Estimate:
    damping, spread, curved = 1e-9, _spread(stack, estimate), False
    normal = _normal(stack, estimate, active, spread)
    for _ in range(_MAX_STEPS):
        step = normal.step(damping)
        promised = normal.Ar @ step[0] + np.sum(normal.Br * step[1])
        if curved:
            step = _bent(stack, estimate, active, normal, damping, step)
        trial = _moved(estimate, active, step)
        trial_normal = _normal(stack, trial, active, spread)
        if trial_normal.cost <= normal.cost:
            estimate, normal, damping = trial, trial_normal, max(damping / 10, 1e-12)
        elif damping > 1e6:
            break
        else:
            damping, curved = 10 * damping, True
        if promised < _NEGLIGIBLE_DECREASE:
            break
    return estimate


def _moved(estimate: Estimate, active: NDArray[np.intp], step: _Step) -> Estimate:
    values = np.concatenate([estimate.shared, estimate.doubts])
    values[active] += step[0]
    places = tuple(place + move[: len(place)] for place, move in zip(estimate.places, step[1], strict=True))
    return replace(estimate, shared=values[:CAMERA_END], doubts=values[CAMERA_END:], places=places)


def _bent(
    stack: Stack, estimate: Estimate, active: NDArray[np.intp], normal: _Normal, damping: float, step: _Step
) -> _Step:
    """A step that follows the bend of the valley in which it leads: geodesic acceleration.

    Boards that are hardly tilted tell little of the focal length but how it goes with their distance. Straight steps
    leave that narrow valley after a short way, and hundreds of them end far from its bottom. Source: Transtrum and
    Sethna 2012 (arXiv:1201.5885). Where the bend is nearly as large as the step, the step is taken as it is.
    """
    shared, moves = step
    probe = _moved(estimate, active, (_PROBE * shared, _PROBE * moves))
    there = normal.root[..., 0] * stack.residual(probe).reshape(normal.r.shape)
    along = normal.A @ shared + (normal.B @ moves[..., None])[..., 0]
    curvature = (2 / _PROBE**2 * (there - normal.r + _PROBE * along))[..., None]
    Ar, Br = (np.asarray((by.transpose(0, 2, 1) @ curvature)[..., 0]) for by in (normal.A, normal.B))
    bend = normal.step(damping, (Ar.sum(axis=0), Br))
    if normal.length(bend) > _MOST_BEND * normal.length(step):
        return step
    return shared + bend[0] / 2, moves + bend[1] / 2


def _solve_scaled(matrix: Array, right: Array) -> Array:
    if not len(right):
        return np.zeros(0)
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return scale * np.linalg.lstsq(scale[:, None] * matrix * scale, scale * right, rcond=1e-15)[0]


def _median_noise(stack: Stack, estimate: Estimate) -> float:
    lengths = stack.lengths(stack.residual(estimate))[stack.estimated]
    if not lengths.size:
        return 1.0
    return float(max(np.median(lengths[stack.there[stack.estimated]]) / RAYLEIGH_MEDIAN, 1e-4))


def _noise(stack: Stack, estimate: Estimate, shared_unknowns: int) -> float:
    """Standard deviation of a corner coordinate: weighted residuals over their degrees of freedom."""
    lengths = stack.lengths(stack.residual(estimate))
    weight = (_huber_weight(lengths, _spread(stack, estimate)) * stack.there)[stack.estimated]
    spare = 2 * np.sum(weight) - shared_unknowns - np.sum(stack.unknowns[stack.estimated])
    return float(np.sqrt(np.sum(weight * lengths[stack.estimated] ** 2) / spare)) if spare > 0 else estimate.noise_px


def marginal_covariance(blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]) -> tuple[Array, float]:
    """Covariance (18, 18) of the shared parameters of an :func:`adjust`, marginal over all places.

    Rows and columns of parameters that were not fitted are zero. With it comes the condition number of the information
    matrix scaled to a unit diagonal, which depends neither on units nor on the noise: 1 is independent parameters,
    beyond 1e8 a direction is practically unobserved.
    """
    stack = Stack(blocks)
    information = _normal(stack, estimate, active, _spread(stack, estimate)).reduced(0.0)[0]
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(scale[:, None] * information * scale)
    smallest = max(values[-1] * 1e-14, 1e-300)
    inverse = (vectors / np.maximum(values, smallest)) @ vectors.T
    covariance = np.zeros((CAMERA_END + len(DOUBTS),) * 2)
    covariance[np.ix_(active, active)] = scale[:, None] * inverse * scale
    return covariance[:CAMERA_END, :CAMERA_END], float(values[-1] / max(values[0], smallest))
