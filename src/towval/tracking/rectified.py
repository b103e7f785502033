"""Pictures on the plane of a planar target, in square cells, and how well the edges of an outline show in them."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.model.geometry import polygon_area
from towval.tracking.interpolation import RELAXED
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.template import Floats, Luma

View = tuple[Luma, Array]
"""A picture (height, width) and the motion (3,) on the floor that led the body there from the first one [m, m, rad]."""


@dataclass(frozen=True)
class RectifiedConstants:
    """Tuned constants of rectified pictures; a cell is one of such a picture."""

    blur_cells: float = 0.7  # So that what lies between two headings or cells still matches.
    steep: float = 2.0  # Of the usual slope of the picture: half the weight of a sharp edge.
    points_of_edge: int = 24  # At which an edge is read.
    beside_px: float = 2.5  # [px] From an edge, on both sides of which is read what moves along with the body.


CONSTANTS = RectifiedConstants()


@dataclass(frozen=True)
class Rectified:
    """A picture on a target's plane: cells ``cell_m`` apart from ``low`` (2,) on [m].

    ``slopes`` (rows, columns, 2) along the plane's axes, zero outside the picture; ``usual`` their size.
    """

    low: Array
    cell_m: float
    slopes: Floats
    usual: float

    @classmethod
    def of(cls, target: PlanarTarget, view: View, low: Array, size: NDArray[np.int64], cell_m: float,
           usual: float | None = None) -> "Rectified":  # fmt: skip
        """A picture with ``size`` (2,) cells along x and y."""
        luma, step = view
        along, across = (lo + cell_m * np.arange(n) for lo, n in zip(low, size, strict=True))
        places = np.empty((len(across), len(along), 2))
        places[..., 0], places[..., 1] = along, across[:, None]
        pixels: Floats = target.pixels(places.reshape(-1, 2), step).astype(np.float32).reshape(places.shape)
        u, v = np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])
        inside = (u >= 0) & (v >= 0) & (u < luma.shape[1] - 1) & (v < luma.shape[0] - 1)
        if not inside.any():
            return cls(low, cell_m, np.zeros_like(pixels), usual or 1.0)
        limits = np.array([cv2.minMaxLoc(each, inside.view(np.uint8))[:2] for each in (u, v)])
        first, last = np.floor(limits[:, 0]).astype(int), np.ceil(limits[:, 1]).astype(int) + 1
        crop = luma[first[1] : last[1] + 1, first[0] : last[0] + 1].astype(np.float32)
        middle = pixels[pixels.shape[0] // 2, pixels.shape[1] // 2 - 1 : pixels.shape[1] // 2 + 1]
        width_px = max(1.0, float(np.linalg.norm(middle[1] - middle[0])))
        smooth = cv2.GaussianBlur(crop, (0, 0), CONSTANTS.blur_cells * width_px)
        grey = cv2.remap(smooth, u - np.float32(first[0]), v - np.float32(first[1]), cv2.INTER_LINEAR)
        inside = cv2.erode(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        slopes = [cv2.Scharr(grey, cv2.CV_32F, *axis, scale=1 / 32) * inside for axis in ((1, 0), (0, 1))]
        if usual is None:
            usual = max(float(np.median(np.hypot(*slopes)[inside])) if inside.any() else 1.0, 0.25)
        return cls(low, cell_m, np.asarray(cv2.merge(slopes), dtype=np.float32), usual)

    def shown(self, x: np.float32, y: np.float32) -> Floats:
        """How far each cell, from 0 to 1, shows an edge along (x, y)."""
        across = np.abs(self.slopes[..., 0] * y - self.slopes[..., 1] * x)
        return np.asarray(across / (across + np.float32(CONSTANTS.steep * self.usual)), dtype=np.float32)


@dataclass(frozen=True)
class MovingAlong:
    """What moves along with a body: ``share`` (rows, columns) of cells ``cell_m`` apart from ``low`` (2,) on [m].

    From −1 (stays) to 1 (moves along); zero where the pictures do not tell.
    """

    low: Array
    cell_m: float
    share: Floats


def edges_shown(target: PlanarTarget, views: Sequence[Rectified], poses: Array) -> Array:
    """How far the edges of a target's outline show (n, edges), from 0 to 1, at poses (n, 3): mean of the views."""
    slopes = np.stack([view.slopes for view in views])
    usual = CONSTANTS.steep * np.array([view.usual for view in views])
    corners = np.ascontiguousarray(target.body.top_corners_m)
    shown: Array = _shown_kernel(slopes, usual, views[0].low, views[0].cell_m, corners, poses, CONSTANTS.points_of_edge)
    return shown


def edges_limit(
    target: PlanarTarget, moving_along: MovingAlong, poses: Array, pixel_m: float
) -> tuple[Array, NDArray[np.bool_]]:
    """How far what moves along ends at a body's edges (n, edges), from 0 to 1, at poses (n, 3), and where that counts.

    The side of a body moves along as well, so it does not count at edges beyond which the side is visible.
    """
    corners = np.ascontiguousarray(target.body.top_corners_m)
    beside_m = CONSTANTS.beside_px * pixel_m * float(np.sign(polygon_area(corners)))
    limits: Array
    limits, facing = _limits_kernel(
        moving_along.share, moving_along.low, moving_along.cell_m, corners, poses, beside_m,
        target.floor.camera_position_m[:2], CONSTANTS.points_of_edge,
    )  # fmt: skip
    return limits, facing <= 0


@compiled(allocates=False, fastmath=RELAXED)
def _bilinear(image: Floats, x: float, y: float) -> float:
    """Value of an image (rows, columns) between its cells, zero outside."""
    if not (x >= 0.0 and y >= 0.0 and x < image.shape[1] - 1 and y < image.shape[0] - 1):
        return 0.0
    i, j = np.uintp(x), np.uintp(y)
    a, b = x - i, y - j
    i1, j1 = np.uintp(i + 1), np.uintp(j + 1)
    upper, lower = (1 - a) * image[j, i] + a * image[j, i1], (1 - a) * image[j1, i] + a * image[j1, i1]
    value: float = (1 - b) * upper + b * lower
    return value


@compiled(fastmath=RELAXED)
def _shown_kernel(
    slopes: Floats, steep: Array, low: Array, cell_m: float, corners: Array, poses: Array, count: int
) -> Array:
    """How far edges show (n, edges) in slopes (views, rows, columns, 2) on one grid, as :meth:`Rectified.shown`."""
    rows, columns = slopes.shape[1], slopes.shape[2]
    shown = np.zeros((len(poses), len(corners)))
    for n in range(len(poses)):
        c, s = np.cos(poses[n, 2]), np.sin(poses[n, 2])
        for e in range(len(corners)):
            f = (e + 1) % len(corners)
            ex, ey = corners[f, 0] - corners[e, 0], corners[f, 1] - corners[e, 1]
            length = np.hypot(ex, ey)
            ux, uy = (c * ex - s * ey) / length, (s * ex + c * ey) / length
            for k in range(count):
                share = (k + 0.5) / count
                px, py = corners[e, 0] + share * ex, corners[e, 1] + share * ey
                x = (poses[n, 0] + c * px - s * py - low[0]) / cell_m
                y = (poses[n, 1] + s * px + c * py - low[1]) / cell_m
                if not (x >= 0.0 and y >= 0.0 and x < columns - 1 and y < rows - 1):
                    continue
                i, j = np.uintp(x), np.uintp(y)
                a, b = x - i, y - j
                i1, j1 = np.uintp(i + 1), np.uintp(j + 1)
                w00, w01, w10, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
                # Across the edge: dx · uy − dy · ux.
                for v in range(slopes.shape[0]):
                    view = slopes[v]
                    dx = w00 * view[j, i, 0] + w01 * view[j, i1, 0] + w10 * view[j1, i, 0] + w11 * view[j1, i1, 0]
                    dy = w00 * view[j, i, 1] + w01 * view[j, i1, 1] + w10 * view[j1, i, 1] + w11 * view[j1, i1, 1]
                    across = abs(dx * uy - dy * ux)
                    shown[n, e] += across / (across + steep[v])
    shown /= count * slopes.shape[0]
    return shown


@compiled(fastmath=RELAXED)
def _limits_kernel(
    share: Floats, low: Array, cell_m: float, corners: Array, poses: Array, beside_m: float, camera: Array, count: int
) -> tuple[Array, Array]:
    """Half of what moves along inside minus outside of edges (n, edges), 0 to 1, and how far they face the camera."""
    limits, facing = np.zeros((len(poses), len(corners))), np.zeros((len(poses), len(corners)))
    for n in range(len(poses)):
        c, s = np.cos(poses[n, 2]), np.sin(poses[n, 2])
        for e in range(len(corners)):
            f = (e + 1) % len(corners)
            ex, ey = corners[f, 0] - corners[e, 0], corners[f, 1] - corners[e, 1]
            length = np.hypot(ex, ey)
            outx, outy = beside_m * (s * ex + c * ey) / length, -beside_m * (c * ex - s * ey) / length
            inner, outer = 0.0, 0.0
            for k in range(count):
                along = (k + 0.5) / count
                px, py = corners[e, 0] + along * ex, corners[e, 1] + along * ey
                x, y = poses[n, 0] + c * px - s * py, poses[n, 1] + s * px + c * py
                inner += _bilinear(share, (x - outx - low[0]) / cell_m, (y - outy - low[1]) / cell_m)
                outer += _bilinear(share, (x + outx - low[0]) / cell_m, (y + outy - low[1]) / cell_m)
            limits[n, e] = min(max((inner - outer) / (2 * count), 0.0), 1.0)
            mx, my = (corners[e, 0] + corners[f, 0]) / 2, (corners[e, 1] + corners[f, 1]) / 2
            x, y = poses[n, 0] + c * mx - s * my, poses[n, 1] + s * mx + c * my
            facing[n, e] = outx * (camera[0] - x) + outy * (camera[1] - y)
    return limits, facing
