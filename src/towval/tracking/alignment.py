"""Planar pose by inverse-compositional Lucas-Kanade on a whole planar target against a metric template.

The template holds grey values T at points p of the target, in the body frame. At the true pose the picture shows
``I(p) = g T(p) + b`` with a gain g and a bias b that change with the light. At a pose that is off by a small motion ε
of the body frame, ``I(p) = g (T(p) + J(p) ε) + b`` with ``J = ∇T · [[1, 0, −y], [0, 1, x]]``: J belongs to the template
and never changes. Each round reads the picture at the points through the exact camera model, solves for ε with robust
weights and removes it from the pose.

Gain and bias are those of small tiles of the target, eliminated from the equations: the edge of a shadow then costs
only the tiles it crosses. What hides the target is distinguished by its misfit (Tukey's biweight), and how large a
misfit is usual by the better part of the points. Most of a plain top fits wherever it is laid: beside that fit, the few
edges on it look hidden as soon as they are displaced by a fraction of a pixel. A *wide* alignment judges by the points
that hold the information instead, for each direction of motion.

SOURCE: S. Baker, I. Matthews, *Lucas-Kanade 20 Years On*, IJCV 56 (2004), for the inverse-compositional scheme.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.tracking.equations import inverse_of, root_of
from towval.tracking.interpolation import RELAXED, sample_plane_kernel
from towval.tracking.light import CONSTANTS as LIGHT
from towval.tracking.light import OUTSIDE, Tiles, fit_light, misfits
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import TUKEY
from towval.tracking.template import Luma, Template


@dataclass(frozen=True)
class AlignmentConstants:
    """Tuned constants of the alignment; lengths in pixels are measured on the planar target."""

    least_scale: float = 0.5  # [grey levels] Smallest scale of the residuals: rounding alone gives 0.3.
    rounds: int = 12  # Most rounds with all points; one that needs more has not converged,
    wide_rounds: int = 40  # nor a wide one that needs so many: it begins farther off, and noise shortens its steps.
    first_part: int = 4  # One point in so many brings the pose near at a quarter of the cost,
    first_rounds: int = 6  # in at most so many rounds.
    tolerance_px: float = 0.06  # [px] Steps shrink to a tenth from round to round: what is left is a tenth of this.
    least_determinant: float = 1e-4  # Of the normalised information: below it, a direction is open.
    inlier_weight: float = 0.3  # Tukey's weight of an inlier: residuals up to 3.2 times the scale.
    least_of_tile: int = 8  # Points of a tile, for its correlation to mean something.
    visible_tiles: float = 0.7  # Quantile of the tiles' correlations: up to 70 % of them may be hidden or shaded.


CONSTANTS = AlignmentConstants()

_QUANTILE, _QUANTILE_OF_GAUSSIAN = 0.35, 0.45376  # That share of Gaussian |r| is below so many deviations.
_BIN, _BINS = 0.02, 5000  # [grey levels] Resolution of the scale; larger residuals share the last bin.
_DAMPING = 1 + 1e-6  # Numerical: keeps the equations solvable.
_ROUNDING = 1 / 12  # Variance of a grey value that is a whole number: a picture repeated by the encoder fits no better.


@dataclass(frozen=True)
class Alignment:
    """Outcome of an alignment.

    ``pose`` (3,); ``covariance`` (3, 3); ``residual`` (n,) of each point [grey levels of the template], large outside
    the picture; ``weight`` (n,) in [0, 1]; ``scale`` standard deviation of the inliers' residuals; ``correlation`` of
    picture and template in the better tiles; ``inlier_fraction`` of all points; ``converged``: the last step was small.
    """

    pose: Array
    covariance: Array
    residual: Array
    weight: Array
    scale: float
    correlation: float
    inlier_fraction: float
    converged: bool


@compiled()
def residual_scale(residual: Array) -> float:
    """Deviation of the better part of the residuals, from a histogram; zero where all are outside."""
    bins = np.zeros(_BINS, dtype=np.int64)
    inside = 0
    for i in range(residual.shape[0]):
        size = abs(residual[i])
        if size < OUTSIDE:
            bins[min(int(size / _BIN), _BINS - 1)] += 1
            inside += 1
    wanted, below = _QUANTILE * inside, 0
    for i in range(_BINS):
        if below + bins[i] > wanted:
            return float(_BIN * (i + (wanted - below) / bins[i]) / _QUANTILE_OF_GAUSSIAN)
        below += bins[i]
    return 0.0


@compiled()
def scale_by_leverage(residual: Array, leverage: Array) -> float:
    """Deviation of the better part of the residuals, in the direction of motion in which it is largest.

    ``leverage`` (n, 3) of each point on three directions of motion: :attr:`Template.leverage`.
    """
    bins = np.zeros((_BINS, 3))
    inside = np.zeros(3)
    for i in range(residual.shape[0]):
        size = abs(residual[i])
        if size < OUTSIDE:
            row = min(int(size / _BIN), _BINS - 1)
            for j in range(3):
                bins[row, j] += leverage[i, j]
                inside[j] += leverage[i, j]
    largest = 0.0
    for j in range(3):
        wanted, below = _QUANTILE * inside[j], 0.0
        for i in range(_BINS):
            if below + bins[i, j] > wanted:
                largest = max(largest, _BIN * (i + (wanted - below) / bins[i, j]) / _QUANTILE_OF_GAUSSIAN)
                break
            below += bins[i, j]
    return largest


@compiled(fastmath=RELAXED)
def reweigh(residual: Array, precision: Array, scale: float, weight: Array) -> None:
    """Tukey's weights of the residuals times the known precision of each point."""
    for i in range(residual.shape[0]):
        q2 = residual[i] * residual[i] * precision[i] / (TUKEY * scale) ** 2
        weight[i] = precision[i] * (1 - q2) ** 2 if q2 < 1 else 0.0


@compiled(fastmath=RELAXED)
def _normal_equations(
    template: Array, slopes: Array, tile: Tiles, light: Array, weight: Array, residual: Array, ridge: float
) -> tuple[Array, Array]:
    """Information (3, 3) and the scores of the tiles (tiles, 3), light eliminated."""
    tiles = len(light)
    mean, cross = np.zeros((tiles, 3)), np.zeros((tiles, 3))
    for i in range(template.shape[0]):
        w, row = weight[i], tile[i]
        t = w * (template[i] - light[row, 1])
        for j in range(3):
            mean[row, j] += w * slopes[i, j]
            cross[row, j] += t * slopes[i, j]
    for row in range(tiles):
        for j in range(3):
            mean[row, j] /= light[row, 3]
            cross[row, j] /= light[row, 4] + ridge
    information, scores = np.zeros((3, 3)), np.zeros((tiles, 3))
    xx = xy = xh = yy = yh = hh = 0.0
    for i in range(template.shape[0]):
        row = tile[i]
        # Residuals are in grey levels of the template: noise in the picture counts 1/gain there.
        w = weight[i] * light[row, 0] * light[row, 0]
        t = template[i] - light[row, 1]
        x = slopes[i, 0] - mean[row, 0] - cross[row, 0] * t
        y = slopes[i, 1] - mean[row, 1] - cross[row, 1] * t
        h = slopes[i, 2] - mean[row, 2] - cross[row, 2] * t
        r = w * residual[i] if w > 0 else 0.0
        scores[row, 0] += x * r
        scores[row, 1] += y * r
        scores[row, 2] += h * r
        xx += w * x * x
        xy += w * x * y
        xh += w * x * h
        yy += w * y * y
        yh += w * y * h
        hh += w * h * h
    information[0, 0], information[1, 1], information[2, 2] = xx, yy, hh
    information[0, 1] = information[1, 0] = xy
    information[0, 2] = information[2, 0] = xh
    information[1, 2] = information[2, 1] = yh
    return information, scores


@compiled()
def _solve(information: Array, scores: Array) -> tuple[float, float, float]:
    """Solve the 3 × 3 equations, slightly damped so that a direction without texture stays where it is.

    Cramer's rule: written out it compiles in a tenth of the time of a call to LAPACK.
    """
    x = y = h = 0.0
    for row in range(scores.shape[0]):
        x, y, h = x + scores[row, 0], y + scores[row, 1], h + scores[row, 2]
    a, b, c = information[0, 0] * _DAMPING + 1e-9, information[0, 1], information[0, 2]
    d, e, f = information[1, 1] * _DAMPING + 1e-9, information[1, 2], information[2, 2] * _DAMPING + 1e-9
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    dd, de, ff = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * aa + b * ab + c * ac
    return (aa * x + ab * y + ac * h) / det, (ab * x + dd * y + de * h) / det, (ac * x + de * y + ff * h) / det


@compiled()
def correlation_of_tiles(
    values: Array, template: Array, tile: Tiles, share: Array, least_of_tile: int, visible_tiles: float
) -> float:
    """Correlation of picture and template: a quantile over the tiles, so that the hidden ones do not count.

    Each tile counts with its ``share`` (tiles,).
    """
    # No weights of the points: weights choose those that agree, and a few agree anywhere.
    tiles = len(share)
    sums = np.zeros((tiles, 6))
    for i in range(values.shape[0]):
        a, t, row = values[i], template[i], tile[i]
        if a >= 0:
            sums[row, 0] += 1
            sums[row, 1] += a
            sums[row, 2] += t
            sums[row, 3] += a * a
            sums[row, 4] += t * t
            sums[row, 5] += a * t
    known, counted = np.empty(tiles), np.zeros(tiles)
    count = 0
    for row in range(tiles):
        n = sums[row, 0]
        if n >= least_of_tile:
            power = (sums[row, 3] - sums[row, 1] ** 2 / n) * (sums[row, 4] - sums[row, 2] ** 2 / n)
            known[count] = (sums[row, 5] - sums[row, 1] * sums[row, 2] / n) / np.sqrt(power) if power > 0 else 0.0
            counted[count] = share[row]
            count += 1
    below, total = 0.0, np.sum(counted)
    for k in np.argsort(known[:count]):
        below += counted[k]
        if below > visible_tiles * total:
            return float(known[k])
    return 0.0


@compiled()
def _align_kernel(
    luma: Luma,
    shape: tuple[Array, Array, Array, Array, Tiles, Array],
    precision: Array,
    pose: Array,
    view: tuple[float, Array, Array, Array],
    limits: tuple[float, float],
    rule: tuple[float, int, int, int, int, float],
    gains: tuple[float, float, float],
    wide: bool,
) -> tuple[Array, Array, Array, Array, Array, float, Array, float, bool]:
    """Rounds of the alignment: pose, information, scores, residuals, weights, scale, light, correlation, converged."""
    points, template, slopes, leverage, tile, share = shape
    tiles = len(share)
    height, T, matrix, k = view
    most_scale, tolerance_m = limits
    least_scale, first_part, first_rounds, most_rounds, least_of_tile, visible_tiles = rule
    gain_spread, least_gain, most_gain = gains
    reach = 0.0
    for i in range(len(points)):
        reach = max(reach, np.hypot(points[i, 0], points[i, 1]))
    pose, scale = pose.copy(), most_scale
    light = np.empty((tiles, 5))
    information, scores = np.zeros((3, 3)), np.zeros((tiles, 3))
    # The first part of the points, an even choice of them, brings the pose near; then all of them settle it.
    for n, rounds, tolerance in (
        (len(points) // first_part, first_rounds, 3 * tolerance_m),
        (len(points), most_rounds, tolerance_m),
    ):
        if wide and n < len(points):
            continue
        residual, weight, converged = np.empty(n), precision[:n].copy(), False
        t, own_tile = template[:n], tile[:n]
        for round_ in range(rounds):
            values = sample_plane_kernel(luma, points[:n], pose, height, T, matrix, k)
            if (wide or n < len(points)) and round_ == 0:
                for i in range(n):
                    weight[i] = precision[i] if values[i] >= 0 else 0.0
                light = fit_light(values, t, own_tile, tiles, weight, (scale / gain_spread) ** 2, least_gain, most_gain)
            misfits(values, t, own_tile, light, residual)
            usual = scale_by_leverage(residual, leverage[:n]) if wide else residual_scale(residual)
            scale = min(max(usual, least_scale), most_scale)
            reweigh(residual, precision[:n], scale, weight)
            ridge = (scale / gain_spread) ** 2
            light = fit_light(values, t, own_tile, tiles, weight, ridge, least_gain, most_gain)
            misfits(values, t, own_tile, light, residual)
            information, scores = _normal_equations(t, slopes[:n], own_tile, light, weight, residual, ridge)
            step = _solve(information, scores)
            # pose ∘ step⁻¹
            pose[2] -= step[2]
            c, s = np.cos(pose[2]), np.sin(pose[2])
            pose[0] -= c * step[0] - s * step[1]
            pose[1] -= s * step[0] + c * step[1]
            converged = abs(step[0]) + abs(step[1]) + reach * abs(step[2]) < tolerance
            if converged:
                break
    correlation = correlation_of_tiles(values, t, own_tile, share, least_of_tile, visible_tiles)
    return pose, information, scores, residual, weight, scale, light, correlation, converged


@compiled()
def _covariance_kernel(
    pose: Array, information: Array, scores: Array, least_determinant: float, least_variance: float
) -> tuple[bool, Array]:
    """Whether an alignment leaves no direction open, and its covariance (3, 3), from the scores of the tiles.

    It is at least that of independent residuals of the ``least_variance``.
    """
    root, tiles = root_of(information), len(scores)
    determinant = 1.0  # Of the information in units in which its diagonal is one.
    for i in range(3):
        determinant *= root[i, i] ** 2 / information[i, i]
    if not (np.isfinite(pose[0] + pose[1] + pose[2]) and determinant >= least_determinant):
        return False, information
    inverse, meat, factor = inverse_of(root), np.zeros((3, 3)), 0.0
    # Residuals of neighbouring points go together (compression, blur): the tiles' scores hold that.
    for row in range(tiles):
        for i in range(3):
            for j in range(3):
                meat[i, j] += scores[row, i] * scores[row, j]
    for i in range(3):
        for j in range(3):
            factor += inverse[i, j] * meat[i, j]
    factor = max(factor * (tiles / max(1, tiles - 3)) / 3, least_variance)
    for i in range(3):
        for j in range(3):
            inverse[i, j] *= factor
    return True, inverse


@compiled()
def _inliers_kernel(
    weight: Array, precision: Array, tile: NDArray[np.int64], light: Array, inlier_weight: float, least_gain: float
) -> float:
    """Share of the points that show the template."""
    count = 0
    for i in range(len(weight)):
        # A tile that follows the template at the least gain does not show it: something plain hides it.
        count += light[tile[i], 0] > least_gain and weight[i] > inlier_weight * precision[i]
    return float(count / len(weight))


def align(
    luma: Luma,
    template: Template,
    precision: Array,
    pose: Array,
    target: PlanarTarget,
    most_scale: float,
    *,
    wide: bool = False,
) -> Alignment | None:
    """Align a template with a picture (height, width), C-contiguous, from a pose (3,) on.

    ``precision`` (n,) is the weight of each point known beforehand, in [0, 1]; ``most_scale`` the largest standard
    deviation of the inliers' residuals [grey levels]; ``wide`` judges what is usual by the points that hold
    the information, so that few edges on a plain top are found from some pixels off; a template that is concentrated
    is always aligned so. None where too little of the template is in the picture or it leaves a direction open.
    """
    c, wide = CONSTANTS, wide or template.is_concentrated
    most_rounds = c.wide_rounds if wide else c.rounds
    # A plain tile correlates with nothing, wherever it lies. Where most hold texture they count alike: the few with the
    # steepest edges find others at wrong places.
    share = template.tile_share if template.is_concentrated else np.ones(template.tiles)
    pose, information, scores, residual, weight, scale, light, correlation, converged = _align_kernel(
        luma,
        (template.points, template.values, template.slopes, template.leverage, template.tile, share),
        precision,
        np.asarray(pose, dtype=np.float64),
        (target.height, target.floor.T_camera_floor, target.camera.matrix, target.camera.lens),
        (most_scale, CONSTANTS.tolerance_px * template.pixel_m),
        (c.least_scale, c.first_part, c.first_rounds, most_rounds, c.least_of_tile, c.visible_tiles),
        (LIGHT.gain_spread, LIGHT.least_gain, LIGHT.most_gain),
        wide,
    )
    # The scores of few tiles cannot tell how residuals go together; they solve the equations, and may all be zero. Few
    # points, too, leave less than the noise that the others show.
    least_variance = max(scale, residual_scale(residual)) ** 2 if template.is_concentrated else _ROUNDING
    known, covariance = _covariance_kernel(pose, information, scores, c.least_determinant, least_variance)
    if not known:
        return None
    inliers = _inliers_kernel(weight, precision, template.tile, light, c.inlier_weight, LIGHT.least_gain)
    return Alignment(pose, covariance, residual, weight, scale, correlation, inliers, converged)
