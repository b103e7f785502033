"""Compiled parts of the registration of the floor: which points show it, the rounds of the fit, sums over clusters."""

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.tracking.alignment import correlation_of_tiles, residual_scale, reweigh
from towval.tracking.equations import root_of, solved
from towval.tracking.interpolation import RELAXED, sample_plane_kernel
from towval.tracking.light import Tiles, fit_light, misfits
from towval.tracking.template import Luma

Clusters = NDArray[np.int64]


@compiled()
def _turned(motion: Array, T: Array) -> Array:
    """The floor's transform (4, 4) after the turn and shift of a ``motion`` (9,)."""
    angle = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
    x, y, z = motion[0], motion[1], motion[2]
    # Rodrigues' formula, by its series where the angle is small.
    a = np.sin(angle) / angle if angle > 1e-6 else 1.0
    b = (1 - np.cos(angle)) / (angle * angle) if angle > 1e-6 else 0.5
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    R[1, 0], R[1, 1], R[1, 2] = b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x
    R[2, 0], R[2, 1], R[2, 2] = b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)
    out = T.copy()
    for i in range(3):
        for j in range(4):
            out[i, j] = R[i, 0] * T[0, j] + R[i, 1] * T[1, j] + R[i, 2] * T[2, j]
        out[i, 3] += motion[3 + i]
    return out


@compiled()
def outside(points: Array, discs: Array) -> Array:
    """One for each of points (n, 2) outside all discs (m, 3) of places and radii [m], else zero: (n,)."""
    outside = np.ones(len(points))
    for i in range(len(points)):
        for j in range(len(discs)):
            x, y = points[i, 0] - discs[j, 0], points[i, 1] - discs[j, 1]
            if x * x + y * y < discs[j, 2] ** 2:
                outside[i] = 0.0
    return outside


@compiled()
def shares(values: Array, precision: Array, weight: Array) -> tuple[float, float]:
    """Share of the points in view, neither hidden nor outside the picture, and of the inliers among these."""
    positive = np.sort(weight[weight > 0])
    seen = inliers = 0
    for i in range(len(values)):
        if precision[i] > 0 and values[i] >= 0:
            seen += 1
            inliers += weight[i] > 0.3 * positive[len(positive) // 2] if len(positive) else 0
    return seen / len(values), inliers / max(seen, 1)


@compiled()
def sums_of_clusters(cluster: Clusters, count: int, slopes: Array, residual: Array) -> tuple[Array, Array]:
    """Information (count, k, k) and right side (count, k) of the least squares of each cluster by itself."""
    size = slopes.shape[1]
    information, right = np.zeros((count, size, size)), np.zeros((count, size))
    for i in range(len(cluster)):
        row = cluster[i]
        for j in range(size):
            right[row, j] += slopes[i, j] * residual[i]
            for k in range(size):
                information[row, j, k] += slopes[i, j] * slopes[i, k]
    return information, right


@compiled(fastmath=RELAXED)
def _information(slopes: Array, weight: Array, residual: Array) -> tuple[Array, Array]:
    """Information (9, 9) and right side (9,) of the least squares."""
    size = slopes.shape[1]
    information, right = np.zeros((size, size)), np.zeros(size)
    for i in range(slopes.shape[0]):
        if weight[i] > 0:
            for j in range(size):
                ws = weight[i] * slopes[i, j]
                right[j] += ws * residual[i]
                for k in range(j + 1):
                    information[j, k] += ws * slopes[i, k]
    for j in range(size):
        for k in range(j):
            information[k, j] = information[j, k]
    return information, right


@compiled()
def register_kernel(
    luma: Luma,
    shape: tuple[Array, Array, Array, Tiles, int, Array],
    precision: Array,
    motion: Array,
    view: tuple[Array, Array, Array],
    prior: tuple[Array, Array],
    limits: tuple[float, float, float, int],
    variance_factor: float,
    gains: tuple[float, float, float],
) -> tuple[Array, Array, Array, Array, Array, Array, float, float, bool]:
    """Rounds of the fit: motion, information, readings, gains, weights, residuals, scale, correlation, converged."""
    points, template, slopes, tile, tiles, trust = shape
    T, matrix, k = view
    deviations, in_pixels = prior
    least_scale, most_scale, tolerance_px, most_rounds = limits
    spread, least_gain, most_gain = gains
    n, size = points.shape[0], slopes.shape[1]
    motion, flat, residual, weight = motion.copy(), np.zeros(3), np.empty(n), np.empty(n)
    information, values, gain = np.zeros((size, size)), np.empty(n), np.empty(n)
    scale, converged = most_scale, False
    for round_ in range(most_rounds):
        moved = matrix.copy()
        for j in range(2):
            moved[j, j] *= np.exp(motion[6])
            moved[j, 2] += motion[7 + j]
        values = sample_plane_kernel(luma, points, flat, 0.0, _turned(motion, T), moved, k)
        if round_ == 0:
            for i in range(n):
                weight[i] = precision[i] if values[i] >= 0 else 0.0
            ridge = (scale / spread) ** 2
            light = fit_light(values, template, tile, tiles, weight, ridge, least_gain, most_gain)
            misfits(values, template, tile, light, residual)
        # The light follows by one round: by the last one it stands still.
        scale = min(max(residual_scale(residual), least_scale), most_scale)
        reweigh(residual, precision, scale, weight)
        for i in range(n):
            weight[i] *= trust[i]
        light = fit_light(values, template, tile, tiles, weight, (scale / spread) ** 2, least_gain, most_gain)
        misfits(values, template, tile, light, residual)
        # Residuals are in the template's light, noise is in the picture's: where light is less, residuals scatter more.
        total = brightness = 1e-9
        for i in range(n):
            gain[i] = light[tile[i], 0]
            total += weight[i]
            brightness += weight[i] * gain[i] ** 2
        for i in range(n):
            weight[i] *= gain[i] ** 2 * total / brightness
        information, right = _information(slopes, weight, residual)
        # In units of the priors their information is the unit matrix, against residuals of this scale, as many times as
        # such residuals of neighbours go together.
        variance = scale * scale * variance_factor
        known = information.copy()
        for j in range(size):
            right[j] += variance * motion[j] / deviations[j]
            known[j, j] += variance
        step, far = solved(root_of(known), right), 0.0
        for j in range(size):
            motion[j] -= step[j] * deviations[j]
            for i in range(size):
                far += step[i] * in_pixels[i, j] * step[j]
        converged = far < tolerance_px * tolerance_px
        if converged:
            break
    correlation = correlation_of_tiles(values, template, tile, np.ones(tiles), 8, 0.5)
    return motion, information, values, gain, weight, residual, scale, correlation, converged
