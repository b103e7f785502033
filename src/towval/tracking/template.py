"""The metric template of a planar target: grey values and slopes at its points, in the body frame."""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body
from towval.model.compiling import compiled
from towval.tracking.planar_target import PlanarTarget, usable_points

Luma = NDArray[np.uint8]
Floats = NDArray[np.float32]


def shrunk(luma: Luma, factor: int) -> Luma:
    """A picture (height, width) a whole number of times smaller; rows and columns left over are cut off."""
    size = luma.shape[1] // factor, luma.shape[0] // factor
    whole = luma[: size[1] * factor, : size[0] * factor]
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@dataclass(frozen=True)
class TemplateConstants:
    """Tuned constants of templates; lengths in pixels are measured on the planar target."""

    margin_px: float = 3.0  # [px] Kept from the outline, where the smoothed picture mixes in what lies behind.
    most_margin: float = 0.12  # Of the smaller side: a body of a few pixels keeps some of its points.
    least_points: int = 40  # Fewer do not fill the tiles that light and covariance are estimated from.
    tiles_across: int = 5  # Along the longer side: a shadow's edge then costs a fifth of the target.
    concentrated: float = 0.33  # Of the tiles hold the information: single marks 0.1 to 0.26, textures 0.47 and more.
    least_tile_px: float = 12.0  # [px] Smaller tiles hold too few independent pixels: they correlate with anything.


CONSTANTS = TemplateConstants()

_PLAIN = 1e-12  # Variance of the grey values in a tile that differ by rounding alone.


@dataclass(frozen=True)
class Template:
    """Appearance of a planar target.

    ``points`` (n, 2) in the body frame [m], shuffled, so that the first of them are an even choice; ``values`` (n,)
    grey levels; ``slopes`` (n, 3) change of the grey value with a motion (x, y, heading) of the body frame [1/m, 1/m,
    1/rad]; ``tile`` (n,) the tile of each point, of ``tiles``; ``pixel_m`` the width of a pixel on the target [m];
    ``number`` (n,) that of each point in the template that this one is a part of; ``is_concentrated``: few tiles hold
    the information about motion, as on a plain top with one mark, which holds through any blur.
    """

    points: Array
    values: Array
    slopes: Array
    tile: NDArray[np.int64]
    tiles: int
    pixel_m: float
    number: NDArray[np.int64]
    is_concentrated: bool = False

    def of(self, kept: NDArray[np.bool_]) -> "Template":
        """The template of some of its points (n,)."""
        arrays = {name: getattr(self, name)[kept] for name in ("points", "values", "slopes", "tile", "number")}
        return replace(self, **arrays)

    @cached_property
    def leverage(self) -> Array:
        """Share (n, 3) that each point has in the information about three independent directions of motion."""
        size = np.sqrt(np.sum(self.slopes**2, axis=0))
        unit = self.slopes / np.where(size > 0, size, 1.0)
        by_direction = (unit @ np.linalg.eigh(unit.T @ unit)[1]) ** 2
        total = by_direction.sum(axis=0)
        # About a direction without texture no point knows more than another.
        return np.asarray(np.where(total > 0, by_direction / np.where(total > 0, total, 1.0), 1 / len(unit)))

    @cached_property
    def tile_share(self) -> Array:
        """Share (tiles,) that each tile has in the information about motion."""
        return np.asarray(np.bincount(self.tile, self.leverage.mean(axis=1), self.tiles), dtype=np.float64)


def clearance_m(body: Body, pixel_m: float) -> float:
    """Distance of a template's points from the outline of a body [m], in pictures whose pixels are ``pixel_m`` wide."""
    return min(CONSTANTS.margin_px * pixel_m, CONSTANTS.most_margin * float(np.ptp(body.top_corners_m, axis=0).min()))


def make_template(luma: Luma, target: PlanarTarget, pose: Array, samples: int = 1024) -> Template | None:
    """Template of a planar target, observed at ``pose`` (3,) in one picture.

    The target is divided into ``samples`` square cells; from each the point with the steepest grey value is taken,
    since that is where a displacement shows. None where fewer than ``least_points`` are left.
    """
    low, high = target.body.top_corners_m.min(axis=0), target.body.top_corners_m.max(axis=0)
    pixel = target.metres_per_pixel(pose)
    cell = max(np.sqrt(np.prod(high - low) / samples), pixel)
    per_cell = int(np.clip(cell / pixel / 1.5, 1, 6))
    counts = np.maximum(1, np.floor((high - low) / cell)).astype(int) * per_cell
    axes = [lo + (hi - lo) * (np.arange(n) + 0.5) / n for lo, hi, n in zip(low, high, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = np.add.outer(np.arange(counts[0]) // per_cell * counts[1], np.arange(counts[1]) // per_cell).ravel()
    usable = usable_points(target.body, points, clearance_m(target.body, pixel))
    points, cells = points[usable], cells[usable]

    slope = slopes_at(luma, target, pose, points, pixel)
    values = target.grey_values(luma, points, pose)
    chosen = _steepest(cells, np.where(np.isfinite(values), np.hypot(*slope.T), -1.0))
    chosen = chosen[np.isfinite(slope[chosen]).all(axis=1) & np.isfinite(values[chosen])]
    if len(chosen) < CONSTANTS.least_points:
        return None
    chosen = np.random.default_rng(0).permutation(chosen)
    points, slope = points[chosen], slope[chosen]
    tile, tiles = _tiles(points, low, high, CONSTANTS.least_tile_px * pixel)
    made = Template(points, values[chosen], by_motion(points, slope), tile, tiles, pixel, np.arange(len(points)))
    holding = 1 / np.sum(made.tile_share**2)
    return replace(made, is_concentrated=bool(holding < CONSTANTS.concentrated * tiles))


def slopes_at(luma: Luma, target: PlanarTarget, pose: Array, points: Array, pixel_m: float) -> Array:
    """Change (n, 2) of the grey value along x and y [1/m] at points (n, 2) of a body at ``pose`` (3,), over a pixel."""
    shifts = 0.5 * pixel_m * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    ends = [target.grey_values(luma, points + shift, pose) for shift in shifts]
    return np.column_stack([ends[0] - ends[1], ends[2] - ends[3]]) / pixel_m


def by_motion(points: Array, slope: Array) -> Array:
    """Change (n, 3) of the grey value at points (n, 2) with a motion of the body frame, from its slopes (n, 2)."""
    return np.column_stack([slope, points[:, 0] * slope[:, 1] - points[:, 1] * slope[:, 0]])


def without_light(slopes: Array, template: Template) -> Array:
    """Slopes (n, k) at the points of a template, less what gain and bias of its tiles can explain."""
    return _without_light_kernel(np.ascontiguousarray(slopes), template.values, template.tile, template.tiles)


@compiled()
def _without_light_kernel(slopes: Array, values: Array, tile: NDArray[np.int64], tiles: int) -> Array:
    n, k = slopes.shape
    count, mean, power = np.zeros(tiles), np.zeros(tiles), np.zeros(tiles)
    means, shared = np.zeros((tiles, k)), np.zeros((tiles, k))
    for i in range(n):
        count[tile[i]] += 1
        mean[tile[i]] += values[i]
        for j in range(k):
            means[tile[i], j] += slopes[i, j]
    for row in range(tiles):
        mean[row] /= max(count[row], 1.0)
        for j in range(k):
            means[row, j] /= max(count[row], 1.0)
    for i in range(n):
        light = values[i] - mean[tile[i]]
        power[tile[i]] += light * light
        for j in range(k):
            shared[tile[i], j] += light * (slopes[i, j] - means[tile[i], j])
    free = np.empty((n, k))
    for i in range(n):
        row = tile[i]
        # In a plain tile a gain changes what a bias changes.
        gain = (values[i] - mean[row]) / power[row] if power[row] > _PLAIN * count[row] else 0.0
        for j in range(k):
            free[i, j] = slopes[i, j] - means[row, j] - gain * shared[row, j]
    return free


def _steepest(cells: NDArray[np.int64], steepness: Array) -> NDArray[np.int64]:
    """Index of the steepest point of each cell that has any, in the order of the cells."""
    best = np.full(int(cells.max(initial=-1)) + 1, -1)
    _keep_steepest(cells, steepness, best)
    return best[best >= 0]


@compiled()
def _keep_steepest(cells: NDArray[np.int64], steepness: Array, best: NDArray[np.int64]) -> None:
    for i in range(cells.shape[0]):
        if best[cells[i]] < 0 or steepness[i] > steepness[best[cells[i]]]:
            best[cells[i]] = i


def _tiles(points: Array, low: Array, high: Array, least: float) -> tuple[NDArray[np.int64], int]:
    """Tiles about square, ``tiles_across`` along the longer side but not smaller than ``least`` [m]."""
    size = max((high - low).max() / CONSTANTS.tiles_across, least)
    counts = np.maximum(1, np.round((high - low) / size)).astype(int)
    place = np.minimum(((points - low) / (high - low) * counts).astype(int), counts - 1)
    _, tile = np.unique(place[:, 0] * counts[1] + place[:, 1], return_inverse=True)
    return tile.astype(np.int64), int(tile.max()) + 1
