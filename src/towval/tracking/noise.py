"""Noise of a finished track from its scatter in time, and bodies at rest.

Compression moves a whole body by a fraction of a pixel and leaves no trace in the residuals of a picture. It shows in
time: real bodies move smoothly over five pictures, noise does not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.model import Array

_WINDOWS = (5, 9)
MEDIAN_CHI_SQUARED_3 = 2.366
_MEDIAN_CHI_SQUARED_1 = 0.4549


@dataclass(frozen=True)
class NoiseConstants:
    """Tuned constants of a track's noise and rests."""

    least_windows: int = 20  # For a median of squares to be known to a third.
    growth_of_noise: float = 2.5  # From 5 to 9 pictures; the scatter of real motion grows by (9/5)³ = 5.8 and more.
    rest_deviations: float = 4.0  # A pose at rest strays farther once in 16,000 pictures.
    shortest_rest_s: float = 0.4  # [s] Shorter stops add no path worth removing.
    least_rest_pictures: int = 6  # For a trend to show.
    trend_deviations: float = 3.5  # Of a slope, beyond which a body creeps: by chance once in 2,000 rests.
    neighbours: int = 25  # Pictures in which noise is alike: one knows its own to a quarter, with few edges to a half.


CONSTANTS = NoiseConstants()


def steadied(covariance: Array) -> Array:
    """Covariances (n, 3, 3) of pictures in a row, none smaller than is usual around it.

    A picture's residuals tell its noise from few tiles. On filmed runs poses scatter as much where they happen to agree
    well as beside that; a picture that is worse than its neighbours is.
    """
    size = np.cbrt(np.linalg.det(covariance))
    beside = CONSTANTS.neighbours // 2
    around = np.arange(len(size))[:, None] + np.arange(-beside, beside + 1)
    usual = np.median(size[np.clip(around, 0, len(size) - 1)], axis=1)
    raised: Array = covariance * np.maximum(1, usual / np.maximum(size, np.finfo(float).tiny))[:, None, None]
    return raised


def scatter_factors(time_s: Array, pose: Array, covariance: Array, moving: NDArray[np.bool_]) -> tuple[float, float]:
    """Ratios of the scatter of a track in time to its predicted standard deviations, at least 1: of poses, of headings.

    A few marks on a plain top fix its heading worse than its tiles say, and its place no worse.

    A quadratic is fitted to each five, and each nine, consecutive pictures; the distance of the middle one from it is
    compared with what the covariance predicts. The median over the track is robust against jerks. The longer window
    also responds to noise that is correlated over several pictures; it counts unless it responds to real motion.

    ``pose`` (n, 3) is NaN where not observed; ``moving`` (n,) are the pictures that count: a body at rest in compressed
    video repeats its error and hides it.
    """
    short, long = (_scatter(time_s, pose, covariance, moving, window) for window in _WINDOWS)
    counts = long < CONSTANTS.growth_of_noise * np.maximum(short, 1.0)
    whole, turn = np.maximum(np.maximum(1.0, short), np.where(counts, long, 0.0))
    return float(whole), float(max(whole, turn))


def _scatter(time_s: Array, pose: Array, covariance: Array, moving: NDArray[np.bool_], window: int) -> Array:
    """Ratios (2,) of poses and headings for a window; zero where there are too few."""
    misfit, rows, gain = about_quadratics(time_s, pose, window, moving)
    if len(rows) < CONSTANTS.least_windows:
        return np.zeros(2)
    expected = covariance[rows] * gain[:, None, None]
    square = np.einsum("nj,nj->n", misfit, np.linalg.solve(expected, misfit[..., None])[..., 0])
    of_turn = misfit[:, 2] ** 2 / expected[:, 2, 2]
    return np.sqrt([np.median(square) / MEDIAN_CHI_SQUARED_3, np.median(of_turn) / _MEDIAN_CHI_SQUARED_1])


def about_quadratics(
    time_s: Array, pose: Array, window: int, counts: NDArray[np.bool_] | None = None
) -> tuple[Array, NDArray[np.int64], Array]:
    """Distances (m, 3) of poses (n, 3) from the quadratic through ``window`` pictures around each, and which these are.

    Only pictures that count are taken, whose windows hold no gap (NaN), and of many an even choice. The last is the
    variance (m,) that independent noise of one leaves in them.
    """
    half = window // 2
    rows = np.arange(half, len(time_s) - half)
    if counts is not None:
        rows = rows[counts[rows]]
    rows = rows[:: max(1, len(rows) // 5000)]
    index = rows[:, None] + np.arange(-half, half + 1)
    known = np.isfinite(pose[index, 0]).all(axis=1)
    rows, index = rows[known], index[known]
    t = (time_s[index] - time_s[rows][:, None]) / (time_s[index[:, -1]] - time_s[index[:, 0]])[:, None]
    basis = np.stack([np.ones_like(t), t, t * t], axis=-1)
    # Row 0 of the pseudo-inverse gives the fitted value at the middle, where t = 0.
    kernel = -np.linalg.pinv(basis)[:, 0, :]
    kernel[:, half] += 1
    return np.einsum("nk,nkj->nj", kernel, pose[index]), rows, np.sum(kernel**2, axis=1)


def as_when_moving(covariance: Array, moving: NDArray[np.bool_], resting: NDArray[np.bool_]) -> Array:
    """Covariances (n, 3, 3) of which those of pictures at rest are no smaller than the usual one of a motion.

    Compressed video repeats a resting body with the error that it had when it stopped: its pictures agree with each
    other, and with the template that was made of one of them, better than with where the body is.
    """
    if moving.sum() < CONSTANTS.least_windows or not resting.any():
        return covariance
    own = np.diagonal(covariance, axis1=1, axis2=2)
    less = np.mean(np.median(own[moving], axis=0) / own[resting], axis=1)
    covariance = covariance.copy()
    covariance[resting] *= np.maximum(less, 1.0)[:, None, None]
    return covariance


def hold_rest(time_s: Array, pose: Array, covariance: Array, tracked: NDArray[np.bool_], most: Array) -> Array:
    """Poses (n, 3) with each rest of a body reduced to its mean, so that noise adds no path.

    A rest lasts as long as each pose stays within four deviations, and within ``most`` (3,) [m, m, rad], of the mean
    before it. It is held only where it shows no trend: a body that creeps goes on creeping.
    """
    held = pose.copy()
    deviation = np.minimum(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), most / CONSTANTS.rest_deviations)
    limit, start = CONSTANTS.rest_deviations * deviation, 0
    while start < len(time_s):
        if not tracked[start]:
            start += 1
            continue
        mean, count = pose[start].copy(), 1
        end = start + 1
        while end < len(time_s) and tracked[end] and (np.abs(pose[end] - mean) <= limit[end]).all():
            count += 1
            mean += (pose[end] - mean) / count
            end += 1
        if count >= CONSTANTS.least_rest_pictures and time_s[end - 1] - time_s[start] >= CONSTANTS.shortest_rest_s:
            part = slice(start, end)
            if not _has_trend(time_s[part], pose[part], deviation[part].mean(axis=0)):
                held[part] = mean
            start = end
        else:
            start += 1
    return held


def _has_trend(time_s: Array, pose: Array, deviation: Array) -> bool:
    """Whether a straight line through poses rises by more than chance allows."""
    t = time_s - time_s.mean()
    slope = t @ (pose - pose.mean(axis=0)) / (t @ t)
    scatter = np.maximum((pose - pose.mean(axis=0) - np.outer(t, slope)).std(axis=0), 0.3 * deviation)
    return bool((np.abs(slope) * np.sqrt(t @ t) > CONSTANTS.trend_deviations * scatter).any())
