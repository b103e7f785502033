"""Planar pose by inverse-compositional Lucas-Kanade on a body's whole top against a metric template.

The template holds grey values T at points p of the top, in the body frame. At the true pose the picture shows
``I(p) = g T(p) + b`` with a gain g and a bias b that change with the light. At a pose that is off by a small motion ε
of the body frame, ``I(p) = g (T(p) + J(p) ε) + b`` with ``J = ∇T · [[1, 0, −y], [0, 1, x]]``: J belongs to the template
and never changes. Each round reads the picture at the points through the exact camera model, solves for ε with robust
weights and takes it off the pose.

Gain and bias are those of small tiles of the top, eliminated from the equations: the edge of a shadow then costs only
the tiles it crosses. What hides the top is told from it by its misfit (Tukey's biweight).

SOURCE: S. Baker, I. Matthews, *Lucas-Kanade 20 Years On*, IJCV 56 (2004), for the inverse-compositional scheme.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from towval.geometry import inside_polygon
from towval.types import Array, Body, Camera, Floor
from towval.vision.sampling import RELAXED, metres_per_pixel, plane_pixel, plane_to_camera, sample_plane, spline_value

Luma = NDArray[np.uint8]

_TUKEY = 4.685
_LEAST_SCALE = 0.5  # Grey levels: rounding alone gives 0.3.
_GAIN_SPREAD = 0.5  # ASSUME: the light on a tile changes by half, give or take.
_LEAST_GAIN, _MOST_GAIN = 0.2, 5.0
_ROUNDS = 15
_QUANTILE, _QUANTILE_OF_GAUSSIAN = 0.35, 0.45376  # The share of |r| below that many deviations.
_MARGIN_PX = 3.0  # Kept from the outline, where the smoothed picture mixes in what lies behind.
_TILES_ACROSS = 5
_TOLERANCE_PX = 0.01
_WORST_CONDITION = 1e8
_INLIER_WEIGHT = 0.3
_OUTSIDE = 1e12  # Residual of a point outside the picture: finite, so that compiled sums stay finite.


@dataclass(frozen=True)
class Template:
    """What the top of a body looks like.

    ``points`` (n, 2) in the body frame [m]; ``values`` (n,) grey levels; ``slopes`` (n, 3) change of the grey value
    with a motion (x, y, heading) of the body frame [1/m, 1/m, 1/rad]; ``tile`` (n,) number of the tile a point
    belongs to, ``tiles`` how many there are.
    """

    points: Array
    values: Array
    slopes: Array
    tile: NDArray[np.int64]
    tiles: int


@dataclass(frozen=True)
class Alignment:
    """Outcome of an alignment.

    ``pose`` (3,); ``covariance`` (3, 3); ``residual`` (n,) of each point [grey levels, of the template], NaN outside
    the picture; ``weight`` (n,) in [0, 1]; ``scale`` deviation of the inliers' residuals; ``correlation`` of picture
    and template over the inliers; ``inlier_fraction`` of all points; ``converged`` whether the last step was small.
    """

    pose: Array
    covariance: Array
    residual: Array
    weight: Array
    scale: float
    correlation: float
    inlier_fraction: float
    converged: bool


def usable_points(body: Body, points: Array, margin_m: float) -> NDArray[np.bool_]:
    """Which of points (n, 2) [m] lie on the top, ``margin_m`` away from its outline and from what stands on it."""
    ring = margin_m * np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4])
    around = points[:, None] + np.concatenate([np.zeros((1, 2)), ring])
    usable = inside_polygon(body.top_corners_m, around).all(axis=1)
    for obstruction in body.obstructions:
        usable &= ~inside_polygon(obstruction, around).any(axis=1)
    return usable


def make_template(
    luma: Luma, body: Body, pose: Array, camera: Camera, floor: Floor, samples: int = 1024
) -> Template | None:
    """Template of a body's top from one picture.

    The top is divided into ``samples`` square cells; from each the point with the steepest grey value is taken, since
    that is where a displacement shows. None where fewer than a tenth of the cells can be used.
    """
    low, high = body.top_corners_m.min(axis=0), body.top_corners_m.max(axis=0)
    pixel = metres_per_pixel(pose, body.tracked_plane_height_m, camera, floor)
    cell = max(np.sqrt(np.prod(high - low) / samples), pixel)
    per_cell = int(np.clip(cell / pixel / 1.5, 1, 6))
    counts = np.maximum(1, np.floor((high - low) / cell)).astype(int) * per_cell
    axes = [lo + (hi - lo) * (np.arange(n) + 0.5) / n for lo, hi, n in zip(low, high, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = np.add.outer(np.arange(counts[0]) // per_cell * counts[1], np.arange(counts[1]) // per_cell).ravel()
    usable = usable_points(body, points, _MARGIN_PX * pixel)
    points, cells = points[usable], cells[usable]

    def read(shift: tuple[float, float]) -> Array:
        return sample_plane(luma, points + shift, pose, body.tracked_plane_height_m, camera, floor)

    step = 0.5 * pixel
    slope = np.stack(
        [(read((step, 0)) - read((-step, 0))) / (2 * step), (read((0, step)) - read((0, -step))) / (2 * step)], axis=1
    )
    values = read((0.0, 0.0))
    chosen = _steepest(cells, np.where(np.isfinite(values), np.hypot(*slope.T), -1.0))
    chosen = chosen[np.isfinite(slope[chosen]).all(axis=1) & np.isfinite(values[chosen])]
    if len(chosen) < max(16, samples // 10):
        return None
    points, slope = points[chosen], slope[chosen]
    slopes = np.column_stack([slope, points[:, 0] * slope[:, 1] - points[:, 1] * slope[:, 0]])
    tile, tiles = _tiles(points, low, high)
    return Template(points, values[chosen], slopes, tile, tiles)


def _steepest(cells: NDArray[np.int64], steepness: Array) -> NDArray[np.int64]:
    """Index of the steepest point of each cell."""
    order = np.lexsort((steepness, cells))
    last = np.append(np.diff(cells[order]) != 0, True)
    return order[last]


def _tiles(points: Array, low: Array, high: Array) -> tuple[NDArray[np.int64], int]:
    """Tiles about square, :data:`_TILES_ACROSS` along the longer side."""
    size = (high - low).max() / _TILES_ACROSS
    counts = np.maximum(1, np.round((high - low) / size)).astype(int)
    place = np.minimum(((points - low) / (high - low) * counts).astype(int), counts - 1)
    _, tile = np.unique(place[:, 0] * counts[1] + place[:, 1], return_inverse=True)
    return tile.astype(np.int64), int(tile.max()) + 1


@njit(cache=True, fastmath=RELAXED)
def _read(luma, points, pose, height, T, matrix, k, values):  # type: ignore[no-untyped-def]
    """Grey values at the points, −1 outside the picture; returns how many are inside."""
    columns = plane_to_camera(pose, height, T)
    inside = 0
    for i in range(points.shape[0]):
        u, v = plane_pixel(points[i, 0], points[i, 1], columns, matrix, k)
        values[i] = spline_value(luma, u, v)
        if values[i] >= 0:
            inside += 1
    return inside


@njit(cache=True, fastmath=RELAXED)
def _fit_light(values, template, tile, tiles, weight, ridge):  # type: ignore[no-untyped-def]
    """Gain, mean of the template, mean of the picture, weight and weighted variance of each tile: (tiles, 5)."""
    sums = np.zeros((tiles, 5))
    light = np.empty((tiles, 5))
    for i in range(values.shape[0]):
        w, a, t, row = weight[i], values[i], template[i], tile[i]
        sums[row, 0] += w
        sums[row, 1] += w * t
        sums[row, 2] += w * a
        sums[row, 3] += w * t * t
        sums[row, 4] += w * t * a
    for row in range(tiles):
        total = max(sums[row, 0], 1e-9)
        mean_t, mean_a = sums[row, 1] / total, sums[row, 2] / total
        variance = max(sums[row, 3] - total * mean_t * mean_t, 0.0)
        # The ridge is a prior: gain 1, give or take _GAIN_SPREAD, against residuals of the present scale.
        gain = (sums[row, 4] - total * mean_t * mean_a + ridge) / (variance + ridge)
        light[row, 0] = min(max(gain, _LEAST_GAIN), _MOST_GAIN)
        light[row, 1], light[row, 2], light[row, 3], light[row, 4] = mean_t, mean_a, total, variance
    return light


@njit(cache=True, fastmath=RELAXED)
def _misfits(values, template, tile, light, residual):  # type: ignore[no-untyped-def]
    """Residuals in grey levels of the template; returns the deviation of their better part."""
    known = np.empty(values.shape[0])
    count = 0
    for i in range(values.shape[0]):
        if values[i] < 0:
            residual[i] = _OUTSIDE
            continue
        row = tile[i]
        residual[i] = (values[i] - light[row, 2]) / light[row, 0] - (template[i] - light[row, 1])
        known[count] = abs(residual[i])
        count += 1
    if count == 0:
        return 0.0
    at = int(_QUANTILE * count)
    return np.partition(known[:count], at)[at] / _QUANTILE_OF_GAUSSIAN


@njit(cache=True, fastmath=RELAXED)
def _reweigh(residual, precision, scale, weight):  # type: ignore[no-untyped-def]
    """Tukey's weights of the residuals times the known precision of each point."""
    for i in range(residual.shape[0]):
        q = residual[i] * np.sqrt(precision[i]) / (_TUKEY * scale)
        weight[i] = precision[i] * (1 - q * q) ** 2 if abs(q) < 1 else 0.0


@njit(cache=True, fastmath=RELAXED)
def _normal_equations(template, slopes, tile, tiles, light, weight, residual, ridge):  # type: ignore[no-untyped-def]
    """Information (3, 3), right-hand side (3,) and the scores of the tiles (tiles, 3), light eliminated."""
    mean = np.zeros((tiles, 3))
    cross = np.zeros((tiles, 3))
    for i in range(template.shape[0]):
        w, row = weight[i], tile[i]
        if w > 0:
            t = template[i] - light[row, 1]
            for j in range(3):
                mean[row, j] += w * slopes[i, j]
                cross[row, j] += w * t * slopes[i, j]
    for row in range(tiles):
        for j in range(3):
            mean[row, j] /= light[row, 3]
            cross[row, j] /= light[row, 4] + ridge
    information = np.zeros((3, 3))
    scores = np.zeros((tiles, 3))
    free = np.empty(3)
    for i in range(template.shape[0]):
        w, row = weight[i], tile[i]
        if w > 0:
            # Residuals are in grey levels of the template: noise in the picture counts 1/gain there.
            w *= light[row, 0] * light[row, 0]
            t = template[i] - light[row, 1]
            for j in range(3):
                free[j] = slopes[i, j] - mean[row, j] - cross[row, j] * t
            for j in range(3):
                scores[row, j] += w * free[j] * residual[i]
                for m in range(3):
                    information[j, m] += w * free[j] * free[m]
    return information, scores


@njit(cache=True, fastmath=RELAXED)
def _align_kernel(  # type: ignore[no-untyped-def]
    luma, points, template, slopes, tile, tiles, precision, pose, height, T, matrix, k, most_scale, tolerance_m
):
    """Rounds of the alignment: pose, information, scores, residuals, weights, scale, whether it converged."""
    n = points.shape[0]
    values, residual, weight = np.empty(n), np.empty(n), precision.copy()
    information, scores = np.zeros((3, 3)), np.zeros((tiles, 3))
    reach = np.sqrt((points[:, 0] ** 2 + points[:, 1] ** 2).max())
    pose, scale, converged = pose.copy(), most_scale, False
    for round_ in range(_ROUNDS):
        if _read(luma, points, pose, height, T, matrix, k, values) < 16:
            break
        if round_ == 0:
            for i in range(n):
                weight[i] = precision[i] if values[i] >= 0 else 0.0
        for _ in range(2):
            ridge = (scale / _GAIN_SPREAD) ** 2
            light = _fit_light(values, template, tile, tiles, weight, ridge)
            scale = min(max(_misfits(values, template, tile, light, residual), _LEAST_SCALE), most_scale)
            _reweigh(residual, precision, scale, weight)
        light = _fit_light(values, template, tile, tiles, weight, ridge)
        _misfits(values, template, tile, light, residual)
        information, scores = _normal_equations(template, slopes, tile, tiles, light, weight, residual, ridge)
        if converged:
            break
        step = _solve3(information, scores)
        # pose <- pose * inverse(step)
        heading = pose[2] - step[2]
        c, s = np.cos(heading), np.sin(heading)
        pose[0] -= c * step[0] - s * step[1]
        pose[1] -= s * step[0] + c * step[1]
        pose[2] = heading
        converged = abs(step[0]) + abs(step[1]) + reach * abs(step[2]) < tolerance_m
    return pose, information, scores, residual, weight, scale, converged, values


@njit(cache=True)
def _solve3(information, scores):  # type: ignore[no-untyped-def]
    """Solve the 3 × 3 equations, slightly damped so that a direction without texture stays where it is."""
    damped = information.copy()
    for j in range(3):
        damped[j, j] = damped[j, j] * (1 + 1e-6) + 1e-9
    right = np.zeros(3)
    for row in range(scores.shape[0]):
        right += scores[row]
    return np.linalg.solve(damped, right)


def align(
    luma: Luma,
    template: Template,
    precision: Array,
    pose: Array,
    height: float,
    camera: Camera,
    floor: Floor,
    most_scale: float,
) -> Alignment | None:
    """Align a template with a picture.

    Parameters
    ----------
    luma : ndarray (height, width) uint8
        The picture, C-contiguous.
    template : Template
        What to find.
    precision : ndarray (n,)
        Weight of each point known beforehand, in [0, 1].
    pose : ndarray (3,)
        Where to start [m, m, rad].
    height : float
        Height of the plane over the floor [m].
    camera, floor : Camera, Floor
        The calibrated camera.
    most_scale : float
        Largest deviation of the residuals that an inlier may have [grey levels].

    Returns
    -------
    Alignment or None
        None where too little of the template is in the picture or it leaves a direction open.
    """
    pixel = metres_per_pixel(pose, height, camera, floor)
    pose, information, scores, residual, weight, scale, converged, values = _align_kernel(
        luma,
        template.points,
        template.values,
        template.slopes,
        template.tile,
        template.tiles,
        precision,
        np.asarray(pose, dtype=np.float64),
        height,
        floor.T_camera_floor,
        camera.matrix,
        camera.distortion,
        most_scale,
        _TOLERANCE_PX * pixel,
    )
    if not np.isfinite(pose).all() or np.linalg.cond(information) > _WORST_CONDITION:
        return None
    inverse = np.linalg.inv(information)
    # Residuals of neighbouring points go together (compression, blur): the tiles' scores hold that.
    meat = scores.T @ scores * template.tiles / max(1, template.tiles - 3)
    inside = values >= 0
    return Alignment(
        pose=pose,
        covariance=inverse * np.trace(inverse @ meat) / 3,
        residual=np.where(inside, residual, np.nan),
        weight=weight,
        scale=float(scale),
        correlation=_correlation(values, template, weight),
        inlier_fraction=float((weight > _INLIER_WEIGHT * precision).mean()),
        converged=bool(converged),
    )


def _correlation(values: Array, template: Template, weight: Array) -> float:
    """Weighted correlation of picture and template about the means of the tiles."""
    total = np.maximum(np.bincount(template.tile, weight, template.tiles), 1e-12)

    def centred(grey: Array) -> Array:
        return grey - (np.bincount(template.tile, weight * grey, template.tiles) / total)[template.tile]

    picture, pattern = centred(values), centred(template.values)
    power = np.sum(weight * picture**2) * np.sum(weight * pattern**2)
    return float(np.sum(weight * picture * pattern) / np.sqrt(power)) if power > 0 else 0.0
