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
from towval.model.geometry import compose, rotation, wrapped
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.rectified import MovingAlong, Rectified, View, edges_limit, edges_shown
from towval.tracking.template import Floats


@dataclass(frozen=True)
class OutlineSearchConstants:
    """Tuned constants of the search; a cell is one of the rectified picture."""

    cells_of_body: int = 40  # Along the longer side of the outline: a side 6 % shorter differs by two cells.
    coarse_cells_of_body: int = 16  # The same where the tops are spotted: their spots blur away.
    most_cells: int = 500  # Along the longer side of the rectified picture: bounds time.
    least_edge: float = 0.05  # Weight of an edge that does not show at all: others may hide it.
    most_candidates: int = 20  # Places that are followed to finer cells: the right one was the fourth at worst.
    least_moved: float = 0.15  # Of a top's inside: a plain body that goes a sixth of its length.
    unmoved: float = 0.5  # Weight of a place where nothing moved over what is added where all of it did.
    worst_candidate: float = 0.6  # Of the best score: where tops are spotted, the right place is not the best at first.
    margin_cells: int = 8  # Around a pose to be followed to finer cells: twice three cells, and what slopes need.
    apart_px: float = 5.0  # [px] Places nearer than this are one.


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
        self.whole = [Rectified.of(target, view, corner, size, cell_m) for view in views]
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


class OutlineSearch:
    """Pictures searched for a target with its origin from ``low`` to ``high`` (2,) [m] in the first of the ``views``.

    ``moved`` (height, width) says where something moved, ``moving_along`` what moves with the body; None where unknown.
    """

    def __init__(
        self,
        target: PlanarTarget,
        views: Sequence[View],
        low: Array,
        high: Array,
        moved: NDArray[np.bool_] | None = None,
        moving_along: MovingAlong | None = None,
    ):
        self.target, self.views, self.moving_along = target, views, moving_along
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
        cell, score = cell_m, 0.0
        while True:
            pixel = self.target.metres_per_pixel(pose)
            cell = max(cell / 2, pixel)
            views = self._rectified(pose, cell)
            for reach, step in ((3, 1.0), (2, 0.5)):
                offsets = step * np.arange(-reach, reach + 1) * cell
                x, y, turn = (each.ravel() for each in np.meshgrid(offsets, offsets, offsets / self.target.reach_m))
                trials = pose + np.column_stack([x, y, turn])
                scores = self._scores(views, trials)
                best = int(np.argmax(scores))
                pose, score = trials[best], float(scores[best])
            if cell <= pixel:
                return score, pose

    def _rectified(self, pose: Array, cell_m: float) -> list[Rectified]:
        """The pictures around a pose, which is in the middle of a cell: so no place is read blurrier than another."""
        half = int(np.ceil(self.target.reach_m / cell_m)) + CONSTANTS.margin_cells
        low, size = pose[:2] - half * cell_m, np.array([2 * half + 1, 2 * half + 1])
        finest = self.levels[0]
        return [
            Rectified.of(self.target, view, low, size, cell_m, whole.usual * cell_m / finest.cell_m)
            for view, whole in zip(self.views, finest.whole, strict=True)
        ]

    def _scores(self, views: Sequence[Rectified], poses: Array) -> Array:
        """Scores (n,) of poses (n, 3), as :meth:`_Level.places`; the body's limit counts where it is known, too."""
        corners = self.target.body.top_corners_m
        lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        shown = edges_shown(self.target, views, poses)
        if self.moving_along is not None:
            limits, known = edges_limit(self.target, self.moving_along, poses, self.pixel_m)
            shown = np.where(known, (shown + limits) / 2, shown)
        return np.asarray(np.exp(np.log(shown + CONSTANTS.least_edge) @ (lengths / lengths.sum())))
