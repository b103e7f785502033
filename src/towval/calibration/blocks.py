"""What a bundle adjustment fits, and how its points are projected: those of all pictures at once.

All pictures share the parameters of :data:`towval.model.CALIBRATION_PARAMETERS` and, as far as they are fitted, those
of :data:`DOUBTS`; each board adds its own place.
"""

import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import CALIBRATION_PARAMETERS, Array
from towval.model.camera import lens_array
from towval.optics.projection import project_with_derivatives

DOUBTS = ("size", "bow_x", "bow_y", "bow_xy", "thickness", "stretch", "skew", "held_zoom", "held_u", "held_v")
"""Parameters that are taken as known unless they are fitted as well, each with its stated deviation.

The board's size over the stated one, less 1; the rise of its surface between middle and ends [m], along its longer
side, across, and twisted; its thickness less the stated one [m]; how much longer its squares are along its longer side
than across, over their size, and by how much less than a right angle their sides enclose [rad]; the magnification of
the held pictures over that of the others, less 1, and their shift [px]."""

LENS_START, FLOOR_START, CAMERA_END = 4, 12, len(CALIBRATION_PARAMETERS)
BOARD_DOUBTS, PRINT_DOUBTS, HELD_DOUBTS = (CAMERA_END + np.arange(*ends) for ends in ((0, 5), (5, 7), (7, 10)))
"""Where they are among the parameters, after those of the camera: what is stated of the board, the shape of its
squares, and the held pictures."""

_OF_BOARD = len(BOARD_DOUBTS) + len(PRINT_DOUBTS)

_MOST_UNKNOWNS = 6
"""Of a place."""


class Placement(enum.Enum):
    """What is known about the place of a set of points; the value is the number of unknowns."""

    FREE = _MOST_UNKNOWNS
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

    @property
    def by_board(self) -> Array:
        """Derivatives (n, 3, 7) of the points by the board's :data:`DOUBTS`."""
        derivative = np.zeros((len(self.points_m), 3, _OF_BOARD))
        if self.on_board is not None:
            x, y = self.on_board.T
            shapes = np.stack([x * x, y * y, x * y], axis=1)
            derivative[:, :2, 0] = self.points_m[:, :2]
            derivative[:, 2, 1:4] = shapes - shapes.mean(axis=0)
            derivative[:, 2, 4] = self.placement is not Placement.FREE
            derivative[:, :2, 5:] = self._by_print()
        return derivative

    def _by_print(self) -> Array:
        """Derivatives (n, 2, 2) of the points by the shape of the squares. The origin and the x axis stay."""
        points = self.points_m[:, :2]
        # The frame of the points may be turned against the board, as that of the floor's first board is.
        apart, on_board = points - points.mean(axis=0), np.asarray(self.on_board)
        axes = np.linalg.lstsq(on_board - on_board.mean(axis=0), apart, rcond=None)[0].T
        moved = []
        for shape in (np.diag([0.5, -0.5]), np.array([[0.0, 0.5], [0.5, 0.0]])):
            M = axes @ shape @ np.linalg.inv(axes)
            moved.append(points @ (M - M[1, 0] * np.array([[0.0, -1.0], [1.0, 0.0]])).T)
        return np.stack(moved, axis=2)


@dataclass(frozen=True)
class Estimate:
    """Shared parameters (18,), the place of each block, and the noise of a corner coordinate [px].

    ``doubts`` (10,) are the values of :data:`DOUBTS`, ``doubts_std`` (10,) their deviations stated before. Of a
    ``fisheye`` the coefficients of the lens act on the angle of a ray.
    """

    shared: Array
    places: tuple[Array, ...]
    noise_px: float = np.nan
    doubts: Array = field(default_factory=lambda: np.zeros(len(DOUBTS)))
    doubts_std: Array = field(default_factory=lambda: np.zeros(len(DOUBTS)))
    fisheye: bool = False

    def of(self, blocks: Iterable[int]) -> "Estimate":
        """The estimate of some of the blocks, by their numbers."""
        return replace(self, places=tuple(self.places[i] for i in blocks))

    @property
    def matrix(self) -> Array:
        """Camera matrix (3, 3) [px]."""
        fx, fy, cx, cy = self.shared[:LENS_START]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> Array:
        """Lens coefficients (8,)."""
        return self.shared[LENS_START:FLOOR_START]

    @property
    def lens(self) -> Array:
        """The coefficients as the kernels take them; see :func:`towval.model.camera.lens_array`."""
        return lens_array(self.distortion, self.fisheye)

    @property
    def T_camera_floor(self) -> Array:
        """Pose (4, 4) of the floor frame in the camera frame."""
        T = np.eye(4)
        T[:3, :3] = cv2.Rodrigues(self.shared[FLOOR_START : FLOOR_START + 3])[0]
        T[:3, 3] = self.shared[FLOOR_START + 3 :]
        return T


class _Projection(NamedTuple):
    """Points of V blocks, padded to n of them each, with what their derivatives are made of.

    ``residual`` (V, n, 2): observed minus predicted [px]. ``in_frame`` (V, n, 3): points in the frame of the board
    where its place is free, else in that of the floor, where ``turn`` (V, 3, 3) and ``origin`` (V, 3) place them. From
    there ``rotation`` (V, 3, 3) and a shift lead into the camera's frame; ``by_vector`` (V, 3, 3, 3) are the rotation's
    derivatives by its vector. ``derivatives`` (V, n, 2, 18): OpenCV's, for points in the camera's frame.
    """

    residual: Array
    in_frame: Array
    turn: Array
    origin: Array
    rotation: Array
    by_vector: Array
    derivatives: Array


class Linear(NamedTuple):
    """Residuals (V, n, 2) of V blocks, observed minus predicted [px], and the derivatives of the prediction.

    ``by_shared`` (V, n, 2, 28): by the shared parameters and the doubts. ``by_place`` (V, n, 2, 6): by the place, zero
    beyond its unknowns. Points that pad a block to n are in them, too.
    """

    residual: Array
    by_shared: Array
    by_place: Array


class Stack:
    """Blocks as arrays, each padded to n points with its first one: what a call costs is paid once for all pictures.

    ``there`` (V, n) tells points from padding; ``counts`` and ``unknowns`` (V,) are each block's numbers of points and
    of unknowns of its place, ``std_px`` (V,) its deviation, NaN where it is ``estimated`` (V,).
    """

    def __init__(self, blocks: Sequence[Block]):
        self.counts = np.array([len(block.points_m) for block in blocks])
        columns = np.arange(self.counts.max())
        self.there = columns < self.counts[:, None]
        rows = np.where(self.there, columns, 0)
        self.std_px = np.array([block.std_px for block in blocks])
        self.estimated = np.isnan(self.std_px)
        self.unknowns = np.array([block.placement.value for block in blocks])
        self._points, self._pixels, self._by_board = (
            np.stack([each[row] for each, row in zip(arrays, rows, strict=True)])
            for arrays in (
                [block.points_m for block in blocks],
                [block.pixels for block in blocks],
                [block.by_board for block in blocks],
            )
        )
        self._free = self.unknowns == Placement.FREE.value
        self._lying = self.unknowns == Placement.ON_FLOOR.value

    def lengths(self, residual: Array) -> Array:
        """Lengths (V, n) of residuals (V, n, 2), zero for the padding."""
        return np.asarray(np.sqrt(residual[..., 0] ** 2 + residual[..., 1] ** 2) * self.there)

    def medians(self, lengths: Array) -> Array:
        """Median length (V,) of each block."""
        ordered, blocks = np.sort(np.where(self.there, lengths, np.inf), axis=1), range(len(lengths))
        return np.asarray((ordered[blocks, (self.counts - 1) // 2] + ordered[blocks, self.counts // 2]) / 2)

    def residual(self, estimate: Estimate) -> Array:
        """Residuals (V, n, 2): observed minus predicted pixels."""
        return self._projected(estimate).residual

    def linearise(self, estimate: Estimate, *, doubted: bool = True) -> Linear:
        """Residuals and derivatives; those by the doubts are zero where these are not ``doubted``."""
        seen, free, lying = self._projected(estimate), self._free, self._lying
        shape = seen.residual.shape
        by_camera_point = seen.derivatives[..., 3:6]
        turned = np.einsum("vkij,vnj->vnik", seen.by_vector, seen.in_frame)
        by_pose = np.concatenate([np.einsum("vnij,vnjk->vnik", by_camera_point, turned), by_camera_point], axis=3)
        by_point = np.einsum("vnij,vjk->vnik", by_camera_point, seen.rotation)
        by_shared = np.zeros((*shape, CAMERA_END + len(DOUBTS)))
        by_shared[..., :FLOOR_START] = seen.derivatives[..., 6:]
        by_shared[~free, ..., FLOOR_START:CAMERA_END] = by_pose[~free]
        if doubted:
            by_turned = np.einsum("vnij,vjk->vnik", by_point, seen.turn)
            by_shared[..., CAMERA_END : HELD_DOUBTS[0]] = np.einsum("vnij,vnjk->vnik", by_turned, self._by_board)
            zoomed = seen.derivatives[free, ..., 6:8] @ estimate.shared[:2] / (1 + estimate.doubts[-3])
            by_shared[free, ..., HELD_DOUBTS[0]] = zoomed
            by_shared[free, ..., HELD_DOUBTS[1] :] = np.eye(2)
        by_place = np.zeros((*shape, _MOST_UNKNOWNS))
        by_place[free] = by_pose[free]
        x, y, _ = np.moveaxis(seen.in_frame[lying] - seen.origin[lying, None], -1, 0)
        by_place[lying, ..., :2] = by_point[lying, ..., :2]
        by_place[lying, ..., 2] = by_point[lying, ..., 1] * x[..., None] - by_point[lying, ..., 0] * y[..., None]
        return Linear(seen.residual, by_shared, by_place)

    def _padded(self, estimate: Estimate) -> Array:
        """Places (V, 6) of the blocks, zero beyond their unknowns."""
        places = np.zeros((len(self.counts), _MOST_UNKNOWNS))
        for row, place in zip(places, estimate.places, strict=True):
            row[: len(place)] = place
        return places

    def _projected(self, estimate: Estimate) -> _Projection:
        places, shared, doubts, free = self._padded(estimate), estimate.shared, estimate.doubts, self._free
        points = self._points + self._by_board @ doubts[:_OF_BOARD] if doubts.any() else self._points
        poses = np.where(free[:, None], places, shared[FLOOR_START:CAMERA_END])
        rotation, by_vector = _rotations(poses[:, :3], free)
        turn, origin = _turns(np.where(self._lying, places[:, 2], 0.0)), np.zeros((len(places), 3))
        origin[self._lying, :2] = places[self._lying, :2]
        in_frame = points @ turn.transpose(0, 2, 1) + origin[:, None]
        in_camera = in_frame @ rotation.transpose(0, 2, 1) + poses[:, None, 3:]
        nowhere, flat = np.zeros(3), in_camera.reshape(-1, 3)
        pixels, derivatives = project_with_derivatives(flat, nowhere, nowhere, estimate.matrix, estimate.lens)
        pixels, derivatives = pixels.reshape(self._pixels.shape), derivatives.reshape(*self._pixels.shape, -1)
        if doubts[-3:].any():
            zoom, middle = 1 + doubts[-3], shared[2:4]
            pixels[free] = middle + doubts[-2:] + zoom * (pixels[free] - middle)
            unchanged = derivatives[free, ..., 8:10].copy()  # By the principal point, which is shifted and not zoomed.
            derivatives[free] *= zoom
            derivatives[free, ..., 8:10] = unchanged
        return _Projection(self._pixels - pixels, in_frame, turn, origin, rotation, by_vector, derivatives)


def _rotations(vectors: Array, apart: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Rotations (V, 3, 3) of rotation vectors (V, 3) and their derivatives (V, 3, 3, 3) by them.

    Those that are not ``apart`` (V,) have all the same.
    """
    rotations, derivatives = np.empty((len(vectors), 3, 3)), np.empty((len(vectors), 3, 3, 3))
    groups = [np.array([i]) for i in np.flatnonzero(apart)] + [np.flatnonzero(~apart)]
    for group in groups:
        if len(group):
            rotation, derivative = cv2.Rodrigues(vectors[group[0]])
            rotations[group], derivatives[group] = rotation, np.reshape(derivative, (3, 3, 3))
    return rotations, derivatives


def _turns(headings: Array) -> Array:
    """Rotations (V, 3, 3) about z by headings (V,) [rad]."""
    turns = np.tile(np.eye(3), (len(headings), 1, 1))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(headings)
    turns[:, 1, 0] = np.sin(headings)
    turns[:, 0, 1] = -turns[:, 1, 0]
    return turns


def residuals(blocks: Sequence[Block], estimate: Estimate) -> list[Array]:
    """Observed minus predicted pixels (n, 2) of each block."""
    if not blocks:
        return []
    stack = Stack(blocks)
    return [each[:n] for n, each in zip(stack.counts, stack.residual(estimate), strict=True)]
