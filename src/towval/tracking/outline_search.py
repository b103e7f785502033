"""Search of a picture for an outline of known size on its known plane, over all places and headings.

The picture is rectified on the tracked plane, where the outline keeps its size. For each heading the picture's slope
across each edge is averaged along that edge, by a correlation for all places at once; a place where all edges stand on
steep lines is a candidate. Candidates are then followed to finer and finer cells. Several pictures among which the
body's motion is known are searched as one: what lies behind an edge differs from picture to picture, the edge stays.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.geometry import compose, polygon_area, rotation, transform, wrapped
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.template import Luma

Floats = NDArray[np.float32]
View = tuple[Luma, Array]
"""A picture (height, width) and the motion (3,) on the floor that led the body there from the first one [m, m, rad]."""


@dataclass(frozen=True)
class OutlineSearchConstants:
    """Tuned constants of the search; a cell is one of the rectified picture."""

    cells_of_body: int = 40  # Along the longer side of the outline: a side 6 % shorter differs by two cells.
    coarse_cells_of_body: int = 16  # The same where the tops are spotted: their spots blur away.
    most_cells: int = 500  # Along the longer side of the rectified picture: bounds time.
    blur_cells: float = 0.7  # So that what lies between two headings or cells still matches.
    steep: float = 2.0  # Of the usual slope of the picture: half the weight of a sharp edge.
    least_edge: float = 0.05  # Weight of an edge that does not show at all: others may hide it.
    most_candidates: int = 20  # Places that are followed to finer cells: the right one was the fourth at worst.
    least_moved: float = 0.15  # Of a top's inside: a plain body that goes a sixth of its length.
    unmoved: float = 0.5  # Weight of a place where nothing moved over what is added where all of it did.
    worst_candidate: float = 0.6  # Of the best score: where tops are spotted, the right place is not the best at first.
    apart_px: float = 5.0  # [px] Places nearer than this are one.
    points_of_edge: int = 24  # At which an edge is read at finer cells.
    beside_px: float = 2.5  # [px] From an edge, where it is asked what goes with the body.


CONSTANTS = OutlineSearchConstants()


def symmetry_of(corners: Array) -> tuple[int, Array]:
    """Into how many equal turns an outline (n, 2) maps onto itself, and the middle (2,) about which it does [m]."""
    middle: Array = corners.mean(axis=0)
    own, count = corners - middle, len(corners)
    close = 1e-3 * float(np.linalg.norm(own, axis=1).max())
    for order in range(count, 1, -1):
        turned = own @ rotation(2 * np.pi / order).T
        steps = (count // order, -(count // order)) if count % order == 0 else ()
        if any(np.abs(turned - np.roll(own, step, axis=0)).max() < close for step in steps):
            return order, middle
    return 1, middle


def alike(corners: Array, pose: Array) -> list[Array]:
    """Poses (3,) at which an outline (n, 2) looks as it does at ``pose``, this one first."""
    order, middle = symmetry_of(corners)
    turns = 2 * np.pi / order * np.arange(order)
    return [compose(pose, np.array([*(middle - rotation(turn) @ middle), turn])) for turn in turns]


@dataclass(frozen=True)
class _Rectified:
    """A picture on a target's plane: cells ``cell_m`` apart from ``low`` (2,) on; ``usual`` the size of its slopes."""

    low: Array
    cell_m: float
    slope_x: Floats
    slope_y: Floats
    usual: float

    @classmethod
    def of(cls, target: PlanarTarget, view: View, low: Array, size: NDArray[np.int64], cell_m: float,
           usual: float | None = None) -> "_Rectified":  # fmt: skip
        luma, step = view
        axes = [lo + cell_m * np.arange(n) for lo, n in zip(low, size, strict=True)]
        pixels = target.picture_of(transform(step, np.stack(np.meshgrid(*axes), axis=-1))).astype(np.float32)
        u, v = np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])
        inside = (u >= 0) & (v >= 0) & (u < luma.shape[1] - 1) & (v < luma.shape[0] - 1)
        if not inside.any():
            return cls(low, cell_m, np.zeros_like(u), np.zeros_like(u), usual or 1.0)
        first = np.floor([u[inside].min(), v[inside].min()]).astype(int)
        last = np.ceil([u[inside].max(), v[inside].max()]).astype(int) + 1
        crop = luma[first[1] : last[1] + 1, first[0] : last[0] + 1].astype(np.float32)
        middle = pixels[pixels.shape[0] // 2, pixels.shape[1] // 2 - 1 : pixels.shape[1] // 2 + 1]
        width_px = max(1.0, float(np.linalg.norm(middle[1] - middle[0])))
        smooth = cv2.GaussianBlur(crop, (0, 0), CONSTANTS.blur_cells * width_px)
        grey = cv2.remap(smooth, u - np.float32(first[0]), v - np.float32(first[1]), cv2.INTER_LINEAR)
        inside = cv2.erode(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        slope_x, slope_y = (cv2.Scharr(grey, cv2.CV_32F, *step, scale=1 / 32) * inside for step in ((1, 0), (0, 1)))
        if usual is None:
            usual = max(float(np.median(np.hypot(slope_x, slope_y)[inside])) if inside.any() else 1.0, 0.25)
        return cls(low, cell_m, np.asarray(slope_x), np.asarray(slope_y), usual)

    def shown(self, x: np.float32, y: np.float32) -> Floats:
        """How far each cell, from 0 to 1, shows an edge along (x, y)."""
        across = np.abs(self.slope_x * y - self.slope_y * x)
        return np.asarray(across / (across + np.float32(CONSTANTS.steep * self.usual)), dtype=np.float32)


class _Level:
    """Places of a body's origin from ``low`` to ``high`` (2,) [m], ``cell_m`` apart, and the picture around them."""

    def __init__(
        self,
        target: PlanarTarget,
        views: Sequence[View],
        low: Array,
        high: Array,
        cell_m: float,
        moved: NDArray[np.bool_] | None,
    ):
        self.target, self.low, self.cell_m = target, low, cell_m
        self.half = int(np.ceil(target.reach_m / cell_m)) + 2
        self.size = np.ceil((high - low) / cell_m).astype(int) + 1
        self.inner = tuple(slice(self.half, self.half + n) for n in self.size[::-1])
        corner, size = low - cell_m * self.half, self.size + 2 * self.half
        self.whole = [_Rectified.of(target, view, corner, size, cell_m) for view in views]
        self.moved = None
        if moved is not None:
            axes = [lo + cell_m * np.arange(n) for lo, n in zip(corner, size, strict=True)]
            pixels = target.picture_of(np.stack(np.meshgrid(*axes), axis=-1)).astype(np.float32)
            grey = cv2.remap(moved.astype(np.float32), pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR)
            self.moved = np.asarray(grey, dtype=np.float32)

    def places(self, headings: Array) -> list[tuple[float, Array]]:
        """The best places of each heading: scores and poses (3,)."""
        found: list[tuple[float, Array]] = []
        for heading in headings:
            scores = self._scores(float(heading))
            rows, columns = np.nonzero((scores >= cv2.dilate(scores, np.ones((5, 5), np.uint8))) & (scores > 0))
            best = np.argsort(-scores[rows, columns])[: CONSTANTS.most_candidates]
            for row, column in zip(rows[best], columns[best], strict=True):
                place = self.low + self.cell_m * np.array([column, row])
                found.append((float(scores[row, column]), np.array([*place, heading])))
        return found

    def _scores(self, heading: float) -> Floats:
        """How far the outline at a heading stands on edges, for each place (rows, columns) of the body's origin."""
        corners = self.target.body.top_corners_m @ rotation(heading).T / self.cell_m
        ends = np.round((corners + self.half) * 16).astype(np.int32)
        lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        total = np.zeros((self.size[1], self.size[0]), np.float32)
        for i, length in enumerate(lengths):
            following = (i + 1) % len(corners)
            kernel = np.zeros((2 * self.half + 1,) * 2, np.float32)
            cv2.line(kernel, ends[i].tolist(), ends[following].tolist(), (1.0,), 1, cv2.LINE_8, 4)
            x, y = ((corners[following] - corners[i]) / length).astype(np.float32)
            shown = np.mean([whole.shown(x, y) for whole in self.whole], axis=0)
            mean = self._mean(shown, kernel)
            total += np.float32(length / lengths.sum()) * np.log(mean + np.float32(CONSTANTS.least_edge))
        scores = np.exp(total)
        if self.moved is not None:
            kernel = np.zeros((2 * self.half + 1,) * 2, np.float32)
            cv2.fillPoly(kernel, [ends], (1.0,), cv2.LINE_8, 4)
            share = self._mean(self.moved, kernel)
            scores *= (share > CONSTANTS.least_moved) * (CONSTANTS.unmoved + share)
        return np.asarray(scores, dtype=np.float32)

    def _mean(self, shown: NDArray[np.floating], kernel: Floats) -> Floats:
        mean = cv2.filter2D(shown, cv2.CV_32F, kernel / kernel.sum(), borderType=cv2.BORDER_CONSTANT)
        return np.asarray(mean[self.inner], dtype=np.float32)


@dataclass(frozen=True)
class Goers:
    """What goes with a body: ``share`` (rows, columns) of cells ``cell_m`` apart from ``low`` (2,) on [m].

    From −1 (stays) to 1 (goes); zero where the pictures do not tell.
    """

    low: Array
    cell_m: float
    share: Floats

    def at(self, points: Array) -> Array:
        """The share at points (..., 2) on the target's plane [m], zero outside."""
        x, y = np.moveaxis((points - self.low) / self.cell_m, -1, 0).astype(np.float32)
        return np.asarray(cv2.remap(self.share, x, y, cv2.INTER_LINEAR), dtype=np.float64)


class OutlineSearch:
    """Pictures searched for a target with its origin from ``low`` to ``high`` (2,) [m] in the first of the ``views``.

    ``moved`` (height, width) says where something moved, ``goers`` what goes with the body, where that is known.
    """

    def __init__(
        self,
        target: PlanarTarget,
        views: Sequence[View],
        low: Array,
        high: Array,
        moved: NDArray[np.bool_] | None = None,
        goers: Goers | None = None,
    ):
        self.target, self.views, self.goers = target, views, goers
        corners = target.body.top_corners_m
        self.order, _ = symmetry_of(corners)
        self.pixel_m = target.metres_per_pixel(np.array([*(low + high) / 2, 0.0]))
        longest, wide = float(np.ptp(corners, axis=0).max()), float((high - low).max())
        self.levels = [
            _Level(target, views, low, high, max(longest / cells, self.pixel_m, wide / CONSTANTS.most_cells), moved)
            for cells in (CONSTANTS.cells_of_body, CONSTANTS.coarse_cells_of_body)
        ]

    def found(
        self, about: float = 0.0, within: float = np.inf, most: int = CONSTANTS.most_candidates
    ) -> list[tuple[float, Array]]:
        """The best places at full resolution, scores and poses (3,), some pixels apart, best first.

        Headings are searched ``within`` an angle ``about`` another [rad]; ``most`` places of each cell size are
        followed to a pixel.
        """
        sharp = []
        reach = min(within, np.pi / self.order)
        for level in self.levels:
            steps = int(np.ceil(reach * self.target.reach_m / level.cell_m))
            headings = about + reach * np.arange(-steps, steps + (reach == within)) / max(steps, 1)
            places = self._distinct(level.places(headings), 2.5 * level.cell_m)
            sharp += [self.sharpened(pose, level.cell_m) for _, pose in places[:most]]
        return self._distinct(sharp, CONSTANTS.apart_px * self.pixel_m)

    def _distinct(self, found: list[tuple[float, Array]], apart_m: float) -> list[tuple[float, Array]]:
        kept: list[tuple[float, Array]] = []
        for score, pose in sorted(found, key=lambda entry: -entry[0]):
            if all(self.apart_m(pose, known) > apart_m for _, known in kept):
                kept.append((score, pose))
            if len(kept) == CONSTANTS.most_candidates or score < CONSTANTS.worst_candidate * kept[0][0]:
                break
        return kept

    def apart_m(self, pose: Array, other: Array) -> float:
        """Distance of the outlines at two poses, whichever way round [m]."""
        turn = abs(wrapped(self.order * (pose[2] - other[2]))) / self.order
        return float(np.linalg.norm(pose[:2] - other[:2]) + self.target.reach_m * turn)

    def sharpened(self, pose: Array, cell_m: float) -> tuple[float, Array]:
        """Score and pose (3,) of the best place within two cells of ``cell_m``, to a pixel."""
        finest = self.levels[0]
        cell, score = cell_m, 0.0
        while True:
            pixel = self.target.metres_per_pixel(pose)
            cell = max(cell / 2, pixel)
            half = int(np.ceil(self.target.reach_m / cell)) + 8
            low, size = pose[:2] - half * cell, np.array([2 * half + 1, 2 * half + 1])
            views = [
                _Rectified.of(self.target, view, low, size, cell, whole.usual * cell / finest.cell_m)
                for view, whole in zip(self.views, finest.whole, strict=True)
            ]
            for reach, step in ((3, 1.0), (2, 0.5)):
                offsets = step * np.arange(-reach, reach + 1) * cell
                x, y, turn = (each.ravel() for each in np.meshgrid(offsets, offsets, offsets / self.target.reach_m))
                trials = pose + np.column_stack([x, y, turn])
                scores = self._read(views, trials)
                best = int(np.argmax(scores))
                pose, score = trials[best], float(scores[best])
            if cell <= pixel:
                return score, pose

    def _read(self, views: Sequence[_Rectified], poses: Array) -> Array:
        """Scores (n,) of poses (n, 3), as :meth:`_Level.places`; the body's limit counts where it is known, too."""
        corners, low, cell_m = self.target.body.top_corners_m, views[0].low, views[0].cell_m
        ends = np.roll(corners, -1, axis=0)
        lengths = np.linalg.norm(ends - corners, axis=1)
        share = (np.arange(CONSTANTS.points_of_edge) + 0.5) / CONSTANTS.points_of_edge
        c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
        total = np.zeros(len(poses))
        for start, end, length in zip(corners, ends, lengths, strict=True):
            own = start + share[:, None] * (end - start)
            points = transform(poses[:, None], own[None])
            x, y = np.moveaxis((points - low) / cell_m, -1, 0).astype(np.float32)
            ux, uy = ((end - start) / length).tolist()
            shown = np.zeros(len(poses))
            for view in views:
                dx, dy = (cv2.remap(slope, x, y, cv2.INTER_LINEAR) for slope in (view.slope_x, view.slope_y))
                across = np.abs(dx * (s * ux + c * uy) - dy * (c * ux - s * uy))
                shown += (across / (across + CONSTANTS.steep * view.usual)).mean(axis=1) / len(views)
            if self.goers is not None:
                limits, known = self._limits(
                    self.goers, points, np.concatenate([s * ux + c * uy, s * uy - c * ux], axis=1)
                )
                shown = np.where(known, (shown + limits) / 2, shown)
            total += length / lengths.sum() * np.log(shown + CONSTANTS.least_edge)
        return np.asarray(np.exp(total))

    def _limits(self, goers: Goers, points: Array, outward: Array) -> tuple[Array, NDArray[np.bool_]]:
        """How far the body ends (n,) at points (n, k, 2) of an edge, and where it shows no side (n,) beyond the edge.

        ``outward`` (n, 2) is the edge's normal. A body's side goes with it: there only the slope shows the edge.
        """
        outward = outward * np.sign(polygon_area(self.target.body.top_corners_m))
        beside = CONSTANTS.beside_px * self.pixel_m * outward[:, None]
        inner, outer = (goers.at(points + sign * beside).mean(axis=1) for sign in (-1.0, 1.0))
        to_camera = self.target.floor.camera_position_m[:2] - points.mean(axis=1)
        return np.clip((inner - outer) / 2, 0.0, 1.0), (outward * to_camera).sum(axis=1) <= 0
