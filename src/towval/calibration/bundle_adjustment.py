"""Bundle adjustment of one camera, its lens, the floor and all boards, and the covariance of the result.

All pictures share the parameters of :data:`towval.model.CALIBRATION_PARAMETERS` and, as far as they are fitted, those
of :data:`DOUBTS`; each board adds its own place. The normal equations are reduced to the shared parameters with the
Schur complement, both to solve them and to get their marginal covariance, which includes the uncertainty of all places.
"""

import enum
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import CALIBRATION_PARAMETERS, Array

DOUBTS = ("size", "bow_x", "bow_y", "bow_xy", "thickness", "held_zoom", "held_u", "held_v")
"""Parameters that are taken as known unless they are fitted as well, each with its stated deviation.

The board's size over the stated one, less 1; the rise of its surface between middle and ends [m], along its longer
side, across, and twisted; its thickness less the stated one [m]; the magnification of the held pictures over that of
the others, less 1, and their shift [px]."""

_LENS_START, _FLOOR_START, _CAMERA_END = 4, 12, len(CALIBRATION_PARAMETERS)
BOARD_DOUBTS, HELD_DOUBTS = np.arange(_CAMERA_END, _CAMERA_END + 5), np.arange(_CAMERA_END + 5, _CAMERA_END + 8)
"""Where they are among the parameters, after those of the camera."""

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

_RAYLEIGH_MEDIAN = np.sqrt(2 * np.log(2))
"""Median length of a two-dimensional Gaussian vector, in standard deviations of one coordinate."""


class Placement(enum.Enum):
    """What is known about the place of a set of points; the value is the number of unknowns."""

    FREE = 6
    """Held anywhere: rotation vector and shift into the camera frame."""
    ON_FLOOR = 3
    """Lying flat on the floor: x, y and heading in the floor frame."""
    FIXED = 0
    """Given in floor coordinates."""


@dataclass(frozen=True)
class Block:
    """Points of one picture: ``points_m`` (n, 3) in the frame its placement moves, and their ``pixels`` (n, 2).

    ``std_px`` is the standard deviation of one pixel coordinate, NaN where the adjustment is to estimate it.
    ``on_board`` (n, 2) are the points of a board from its middle, over half its longer side; None for marks.
    """

    points_m: Array
    pixels: Array
    placement: Placement
    std_px: float = np.nan
    on_board: Array | None = None

    @cached_property
    def by_board(self) -> Array:
        """Derivatives (n, 3, 5) of the points by the board's :data:`DOUBTS`."""
        derivative = np.zeros((len(self.points_m), 3, len(BOARD_DOUBTS)))
        if self.on_board is not None:
            x, y = self.on_board.T
            shapes = np.stack([x * x, y * y, x * y], axis=1)
            derivative[:, :2, 0] = self.points_m[:, :2]
            derivative[:, 2, 1:4] = shapes - shapes.mean(axis=0)
            derivative[:, 2, 4] = self.placement is not Placement.FREE
        return derivative


@dataclass(frozen=True)
class Estimate:
    """Shared parameters (18,), the place of each block, and the noise of a corner coordinate [px].

    ``doubts`` (8,) are the values of :data:`DOUBTS`, ``doubts_std`` (8,) their deviations stated before.
    """

    shared: Array
    places: tuple[Array, ...]
    noise_px: float = np.nan
    doubts: Array = field(default_factory=lambda: np.zeros(len(DOUBTS)))
    doubts_std: Array = field(default_factory=lambda: np.zeros(len(DOUBTS)))

    def of(self, blocks: Iterable[int]) -> "Estimate":
        """The estimate of some of the blocks, by their numbers."""
        return replace(self, places=tuple(self.places[i] for i in blocks))

    @property
    def matrix(self) -> Array:
        """Camera matrix (3, 3) [px]."""
        return _camera_matrix(self.shared)

    @property
    def distortion(self) -> Array:
        """Lens coefficients (8,)."""
        return self.shared[_LENS_START:_FLOOR_START]

    @property
    def T_camera_floor(self) -> Array:
        """Pose (4, 4) of the floor frame in the camera frame."""
        T = np.eye(4)
        T[:3, :3] = cv2.Rodrigues(self.shared[_FLOOR_START : _FLOOR_START + 3])[0]
        T[:3, 3] = self.shared[_FLOOR_START + 3 :]
        return T


def _camera_matrix(shared: Array) -> Array:
    """Camera matrix (3, 3) [px] of shared parameters (18,)."""
    fx, fy, cx, cy = shared[:4]
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def linearise(
    block: Block, shared: Array, place: Array, doubts: Array, *, doubted: bool = True
) -> tuple[Array, Array, Array]:
    """Residuals (2n,) of a block, observed minus predicted [px], u and v alternating, and the prediction's derivatives.

    The derivatives are those by the ``shared`` parameters and the ``doubts`` (2n, 26), zero where these are not
    ``doubted``, and by the ``place`` of the block, which has as many elements as its placement has unknowns: (2n, 6),
    (2n, 3) or (2n, 0).
    """
    free = block.placement is Placement.FREE
    residual, jacobian, turn, moved_by_place = _projected(block, shared, place, doubts)
    rotation = cv2.Rodrigues((place if free else shared[_FLOOR_START:])[:3])[0]
    by_point: Array = (jacobian[:, 3:6] @ rotation).reshape(-1, 2, 3)
    J_shared = np.zeros((len(jacobian), _CAMERA_END + len(DOUBTS)))
    J_shared[:, :_FLOOR_START] = jacobian[:, 6:18]
    if doubted:
        J_shared[:, BOARD_DOUBTS] = (by_point @ (turn @ block.by_board)).reshape(len(jacobian), -1)
    if not free:
        J_shared[:, _FLOOR_START:_CAMERA_END] = jacobian[:, :6]
        return residual, J_shared, (by_point @ moved_by_place).reshape(len(jacobian), -1)
    if doubted:
        J_shared[:, HELD_DOUBTS] = np.column_stack([jacobian[:, 6:8] @ shared[:2], jacobian[:, 8:10]])
    J_shared[:, :2] *= 1 + doubts[-3]
    return residual, J_shared, jacobian[:, :6]


def _projected(block: Block, shared: Array, place: Array, doubts: Array) -> tuple[Array, Array, Array, Array]:
    """Residuals (2n,), OpenCV's derivatives (2n, 18), the turn of the points into their frame, their slopes by place.

    The frame is the floor's, unless the place is free.
    """
    points, intrinsics = block.points_m, shared[:_LENS_START].copy()
    if doubts.any():
        points = points + block.by_board @ doubts[: len(BOARD_DOUBTS)]
    turn, moved_by_place, pose = np.eye(3), np.zeros((len(points), 3, 0)), shared[_FLOOR_START:]
    if block.placement is Placement.FREE:
        pose = place
        intrinsics[:2] *= 1 + doubts[-3]
        intrinsics[2:] += doubts[-2:]
    elif block.placement is Placement.ON_FLOOR:
        points, turn, moved_by_place = _on_floor(points, place)
    found = cv2.projectPoints(points, pose[:3], pose[3:], _camera_matrix(intrinsics), shared[_LENS_START:_FLOOR_START])
    pixels, jacobian = (np.asarray(each, dtype=np.float64) for each in found)
    return (block.pixels - pixels.reshape(-1, 2)).ravel(), jacobian, turn, moved_by_place


def _on_floor(points: Array, place: Array) -> tuple[Array, Array, Array]:
    """Points in the floor frame (n, 3), the turn (3, 3) into it, and derivatives by the place (n, 3, 3)."""
    c, s = np.cos(place[2]), np.sin(place[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned = points @ turn.T
    derivative = np.zeros((len(points), 3, 3))
    derivative[:, 0, 0] = derivative[:, 1, 1] = 1.0
    derivative[:, 0, 2], derivative[:, 1, 2] = -turned[:, 1], turned[:, 0]
    return turned + np.array([*place[:2], 0.0]), turn, derivative


_Step = tuple[Array, Sequence[Array]]
"""By how much the active shared parameters (k,) and the place of each block move."""


@dataclass(frozen=True)
class _Normal:
    """Whitened normal equations, block by block: A by the shared parameters, B by the place, r the residual.

    ``linear`` are what they are made of, for each block: the roots of the weights (2n,), r, A and B.
    """

    cost: float
    linear: tuple[tuple[Array, Array, Array, Array], ...]
    AA: Array
    Ar: Array
    AB: tuple[Array, ...]
    BB: tuple[Array, ...]
    Br: tuple[Array, ...]

    def reduced(self, damping: float, sides: _Step | None = None) -> tuple[Array, Array, list[Array]]:
        """Schur complement, its right-hand side and the gains that give the places; Marquardt's relative damping."""
        Ar, of_places = sides or (self.Ar, self.Br)
        schur, right = _damped(self.AA, damping), Ar.copy()
        gains: list[Array] = [np.zeros((0, 1))] * len(of_places)
        for size in {len(Br) for Br in of_places} - {0}:  # Alike ones in one call, for a call costs more than they do.
            alike = [i for i, Br in enumerate(of_places) if len(Br) == size]
            AB, BB = np.array([self.AB[i] for i in alike]), np.array([self.BB[i] for i in alike])
            BB[:, range(size), range(size)] *= 1 + damping
            sides_of = np.array([of_places[i] for i in alike])[..., None]
            gain = np.asarray(np.linalg.solve(BB, np.concatenate([AB.transpose(0, 2, 1), sides_of], axis=2)))
            taken = np.sum(AB @ gain, axis=0)
            schur, right = schur - taken[:, :-1], right - taken[:, -1]
            for i, each in zip(alike, gain, strict=True):
                gains[i] = each
        return schur, right, gains

    def step(self, damping: float, sides: _Step | None = None) -> _Step:
        """The step that solves the damped equations, on request with other right-hand ``sides`` than the residuals'."""
        schur, right, gains = self.reduced(damping, sides)
        shared = _solve_scaled(schur, right)
        return shared, [gain[:, -1] - gain[:, :-1] @ shared if len(gain) else np.zeros(0) for gain in gains]

    def length(self, step: _Step) -> float:
        """Length of a step, each parameter over the deviation that it has where all others are known."""
        squares = np.diag(self.AA) @ step[0] ** 2
        return float(np.sqrt(squares + sum(np.diag(BB) @ move**2 for BB, move in zip(self.BB, step[1], strict=True))))


def _damped(matrix: Array, damping: float) -> Array:
    matrix = matrix.copy()
    matrix.flat[:: len(matrix) + 1] *= 1 + damping
    return matrix


def _std(block: Block, estimate: Estimate) -> float:
    return estimate.noise_px if np.isnan(block.std_px) else block.std_px


def _huber_weight(length: Array, spread_px: float) -> Array:
    return np.minimum(1.0, CONSTANTS.robust_width * spread_px / np.maximum(length, 1e-12))


def _spread(blocks: Sequence[Block], estimate: Estimate) -> list[float]:
    """Robust standard deviation of the residuals of each block [px], at least that of its corners."""
    lengths = [np.linalg.norm(r, axis=1) for r in residuals(blocks, estimate)]
    return [
        max(float(np.median(length)) / _RAYLEIGH_MEDIAN, _std(block, estimate))
        for block, length in zip(blocks, lengths, strict=True)
    ]


def _normal(
    blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp], spread_px: Sequence[float]
) -> _Normal:
    known = stated_before(estimate, active)
    off = np.concatenate([np.zeros(_CAMERA_END), estimate.doubts])[active]
    AA, Ar, cost = np.diag(known), -known * off, float(known @ off**2)
    AB, BB, Br, linears = [], [], [], []
    doubted = bool((active >= _CAMERA_END).any())
    for block, place, spread in zip(blocks, estimate.places, spread_px, strict=True):
        linear = linearise(block, estimate.shared, place, estimate.doubts, doubted=doubted)
        length = np.sqrt(linear[0][::2] ** 2 + linear[0][1::2] ** 2)
        weight, std = _huber_weight(length, spread), _std(block, estimate)
        # Huber: length² below the width, 2 width · length − width² beyond; with w = width / length both are one form.
        cost += float(np.sum(weight * (2 - weight) * length**2)) / std**2
        root = np.sqrt(weight) / std
        r, A, B = _whitened(linear, root, active)
        linears.append((np.repeat(root, 2), r, A, B))
        AA += A.T @ A
        Ar += A.T @ r
        AB.append(A.T @ B)
        BB.append(B.T @ B)
        Br.append(B.T @ r)
    return _Normal(cost, tuple(linears), AA, Ar, tuple(AB), tuple(BB), tuple(Br))


def stated_before(estimate: Estimate, active: NDArray[np.intp]) -> Array:
    """Information (k,) on each of the ``active`` parameters that does not come from the pictures."""
    std = np.concatenate([np.full(_CAMERA_END, np.inf), estimate.doubts_std])[active]
    return np.asarray(std**-2.0)


def _whitened(linear: tuple[Array, Array, Array], root: Array, active: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    residual, J_shared, J_place = linear
    root = np.repeat(root, 2)
    return root * residual, root[:, None] * J_shared[:, active], root[:, None] * J_place


def whitened(
    blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]
) -> Iterator[tuple[Array, Array, Array]]:
    """Residual and derivatives of each block as in :func:`linearise`, over its deviation and robustly weighted.

    Of the shared parameters only the ``active`` ones. A fixed board has derivatives by a place (2n, 3), too, as if it
    lay free on the floor where it is.
    """
    for block, place, spread in zip(blocks, estimate.places, _spread(blocks, estimate), strict=True):
        gauge = block.placement is Placement.FIXED and np.isnan(block.std_px)
        as_placed = replace(block, placement=Placement.ON_FLOOR) if gauge else block
        linear = linearise(as_placed, estimate.shared, np.zeros(3) if gauge else place, estimate.doubts)
        length = np.sqrt(linear[0][::2] ** 2 + linear[0][1::2] ** 2)
        yield _whitened(linear, np.sqrt(_huber_weight(length, spread)) / _std(block, estimate), active)


def adjust(blocks: Sequence[Block], start: Estimate, active: NDArray[np.intp]) -> Estimate:
    """Fit shared parameters and places to all blocks at once, robustly.

    Levenberg-Marquardt on Huber's cost; the corner noise is re-estimated from the median residual until it converges,
    and that of the result follows from the weighted residuals and the degrees of freedom. ``start`` may have a
    ``noise_px`` of NaN; ``active`` are the indices of the shared parameters and :data:`DOUBTS` to fit. If empty, only
    the places move. The floor's rotation vector of the result is no longer than π, as its rotation gives it back.
    """
    estimate = start if np.isfinite(start.noise_px) else replace(start, noise_px=_median_noise(blocks, start))
    for _ in range(_NOISE_ROUNDS):
        estimate = _levenberg_marquardt(blocks, estimate, active)
        noise = _median_noise(blocks, estimate)
        settled = abs(noise - estimate.noise_px) < 0.02 * estimate.noise_px
        estimate = replace(estimate, noise_px=noise)
        if settled:
            break
    estimate = replace(estimate, shared=_within_half_turn(estimate.shared))
    return replace(estimate, noise_px=_noise(blocks, estimate, len(active)))


def _within_half_turn(shared: Array) -> Array:
    """Shared parameters (18,) with the floor's rotation vector no longer than π.

    That of a ceiling camera is about π long, and a fit may pass it. The covariance must be that of the vector which its
    users take from the rotation again.
    """
    turn = shared[_FLOOR_START : _FLOOR_START + 3]
    angle = np.linalg.norm(turn)
    if angle <= np.pi:
        return shared
    return np.concatenate([shared[:_FLOOR_START], turn * (1 - 2 * np.pi / angle), shared[_FLOOR_START + 3 :]])


def _levenberg_marquardt(blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]) -> Estimate:
    damping, spread, curved = 1e-9, _spread(blocks, estimate), False
    normal = _normal(blocks, estimate, active, spread)
    for _ in range(_MAX_STEPS):
        step = normal.step(damping)
        promised = normal.Ar @ step[0] + sum(Br @ move for Br, move in zip(normal.Br, step[1], strict=True))
        if curved:
            step = _bent(blocks, estimate, active, normal, damping, step)
        trial = _moved(estimate, active, step)
        trial_normal = _normal(blocks, trial, active, spread)
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
    places = tuple(place + move for place, move in zip(estimate.places, step[1], strict=True))
    return replace(estimate, shared=values[:_CAMERA_END], doubts=values[_CAMERA_END:], places=places)


def _bent(
    blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp], normal: _Normal, damping: float, step: _Step
) -> _Step:
    """A step that follows the bend of the valley in which it leads: geodesic acceleration.

    Boards that are hardly tilted tell little of the focal length but how it goes with their distance. Straight steps
    leave that narrow valley after a short way, and hundreds of them end far from its bottom. Source: Transtrum and
    Sethna 2012 (arXiv:1201.5885). Where the bend is nearly as large as the step, the step is taken as it is.
    """
    shared, moves = step
    probe = _moved(estimate, active, (_PROBE * shared, [_PROBE * move for move in moves]))
    Ar, Br = np.zeros_like(normal.Ar), []
    for block, place, move, (root, r, A, B) in zip(blocks, probe.places, moves, normal.linear, strict=True):
        there = root * _projected(block, probe.shared, place, probe.doubts)[0]
        curvature = 2 / _PROBE**2 * (there - r + _PROBE * (A @ shared + B @ move))
        Ar += A.T @ curvature
        Br.append(B.T @ curvature)
    bend = normal.step(damping, (Ar, Br))
    if normal.length(bend) > _MOST_BEND * normal.length(step):
        return step
    return shared + bend[0] / 2, [move + more / 2 for move, more in zip(moves, bend[1], strict=True)]


def _solve_scaled(matrix: Array, right: Array) -> Array:
    if not len(right):
        return np.zeros(0)
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return scale * np.linalg.lstsq(scale[:, None] * matrix * scale, scale * right, rcond=1e-15)[0]


def residuals(blocks: Sequence[Block], estimate: Estimate) -> list[Array]:
    """Observed minus predicted pixels (n, 2) of each block."""
    return [
        _projected(block, estimate.shared, place, estimate.doubts)[0].reshape(-1, 2)
        for block, place in zip(blocks, estimate.places, strict=True)
    ]


def _median_noise(blocks: Sequence[Block], estimate: Estimate) -> float:
    found = [r for b, r in zip(blocks, residuals(blocks, estimate), strict=True) if np.isnan(b.std_px)]
    if not found:
        return 1.0
    median = np.median(np.linalg.norm(np.concatenate(found), axis=1))
    return float(max(median / _RAYLEIGH_MEDIAN, 1e-4))


def _noise(blocks: Sequence[Block], estimate: Estimate, shared_unknowns: int) -> float:
    """Standard deviation of a corner coordinate: weighted residuals over their degrees of freedom."""
    total, count, unknowns = 0.0, 0.0, float(shared_unknowns)
    for block, residual, spread in zip(blocks, residuals(blocks, estimate), _spread(blocks, estimate), strict=True):
        if not np.isnan(block.std_px):
            continue
        length = np.linalg.norm(residual, axis=1)
        weight = _huber_weight(length, spread)
        total += float(np.sum(weight * length**2))
        count += 2 * float(np.sum(weight))
        unknowns += block.placement.value
    return float(np.sqrt(total / (count - unknowns))) if count > unknowns else estimate.noise_px


def marginal_covariance(blocks: Sequence[Block], estimate: Estimate, active: NDArray[np.intp]) -> tuple[Array, float]:
    """Covariance (18, 18) of the shared parameters of an :func:`adjust`, marginal over all places.

    Rows and columns of parameters that were not fitted are zero. With it comes the condition number of the information
    matrix scaled to a unit diagonal, which depends neither on units nor on the noise: 1 is independent parameters,
    beyond 1e8 a direction is practically unobserved.
    """
    information = _normal(blocks, estimate, active, _spread(blocks, estimate)).reduced(0.0)[0]
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(scale[:, None] * information * scale)
    smallest = max(values[-1] * 1e-14, 1e-300)
    inverse = (vectors / np.maximum(values, smallest)) @ vectors.T
    covariance = np.zeros((_CAMERA_END + len(DOUBTS),) * 2)
    covariance[np.ix_(active, active)] = scale[:, None] * inverse * scale
    return covariance[:_CAMERA_END, :_CAMERA_END], float(values[-1] / max(values[0], smallest))
