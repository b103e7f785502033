"""Noise of a finished track from its scatter in time, and bodies at rest.

Compression moves a whole body by a fraction of a pixel and leaves no trace in the residuals of a picture. It shows in
time: real bodies move smoothly over five pictures, noise does not. A codec that is short of bits leaves a body behind
for some pictures and lets it catch up, here and there: that shows beside the picture, and not in the whole track.
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
    most_alike: float = 0.8  # Correlation of successive pictures, at most: 0.95 grows by 1 % more than 0.8.
    lone_deviations: float = 3.0  # Of a picture that is off by itself: by chance once in 400.


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


def local_scatter(time_s: Array, pose: Array, covariance: Array) -> Array:
    """Covariance (n, 3, 3) by which poses scatter in time around each picture beyond their ``covariance`` (n, 3, 3).

    The noise is that of an autoregressive process: its correlation from picture to picture follows from how the scatter
    about quadratics grows from five to nine pictures, and tells how much of it a quadratic through five takes away.
    What grows more is real motion, and adds nothing. A single picture that is off by itself counts in full.

    ``pose`` (n, 3) is NaN where not observed; pictures between which a body does not move say nothing.
    """
    added = np.zeros_like(covariance)
    moving = np.asarray(np.diff(pose, axis=0, append=np.nan).any(axis=1))
    own, of_nine = (_squares(time_s, pose, window, moving) for window in _WINDOWS)
    # The growth is that of the same pictures; near a gap there are windows of five only.
    both = np.isfinite(of_nine)
    growth = _growth(*(_means_around(np.where(both, one, np.nan)) for one in (own, of_nine, covariance)))
    short, stated = _means_around(own), _means_around(np.where(np.isnan(own), np.nan, covariance))
    is_noise = growth < CONSTANTS.growth_of_noise**2
    rows = np.flatnonzero(is_noise & np.isfinite(short)[:, 0, 0])
    kept = _kept_by_quadratics(growth[rows])[:, None, None]
    added[rows] = beyond(short[rows] / kept, stated[rows], 1 / kept[..., 0])
    alone = np.where(both[:, 0, 0], _growth(own, of_nine, covariance), growth)
    rows = np.flatnonzero((alone < CONSTANTS.growth_of_noise**2) & np.isfinite(own)[:, 0, 0])
    added[rows] += beyond(own[rows], covariance[rows] + added[rows], CONSTANTS.lone_deviations**2)
    return added


def _squares(time_s: Array, pose: Array, window: int, moving: NDArray[np.bool_]) -> Array:
    """Squares (n, 3, 3) of distances from quadratics, as large as those of independent noise; NaN without a window."""
    misfit, rows, gain = about_quadratics(time_s, pose, window, moving, most=len(pose))
    squares = np.full((len(pose), 3, 3), np.nan)
    squares[rows] = misfit[:, :, None] * misfit[:, None, :] / gain[:, None, None]
    return squares


def _means_around(values: Array) -> Array:
    """Means (n, 3, 3) of what is known in the pictures around each; NaN where that is too little."""
    known = np.isfinite(values)
    sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(np.where(known, values, 0.0), axis=0)])
    count = np.concatenate([[0], np.cumsum(known[:, 0, 0])])
    beside, picture = CONSTANTS.neighbours // 2, np.arange(len(values))
    low, high = np.maximum(picture - beside, 0), np.minimum(picture + beside + 1, len(values))
    enough = np.where(count[high] - count[low] > beside // 2, count[high] - count[low], np.nan)
    return np.asarray((sums[high] - sums[low]) / enough[:, None, None])


def _growth(short: Array, long: Array, stated: Array) -> Array:
    """Ratios (n,) of the sizes of second moments (n, 3, 3), in those that are stated; NaN where one is not known."""
    ratio, known = np.full(len(short), np.nan), np.isfinite(short + long + stated)[:, 0, 0]
    of_long, of_short = (
        np.trace(np.linalg.solve(stated[known], seen[known]), axis1=1, axis2=2) for seen in (long, short)
    )
    ratio[known] = of_long / np.maximum(of_short, np.finfo(float).tiny)
    return ratio


def _kept_by_quadratics(growth: Array) -> Array:
    """Share (n,) of the variance of autoregressive noise in the scatter about quadratics through five pictures.

    ``growth`` (n,) of that scatter from five to nine pictures, each over that of independent noise.
    """
    correlation, kept = np.linspace(0, CONSTANTS.most_alike, 41), []
    for window in _WINDOWS:
        row = np.arange(window)
        kernel = _kernel(np.linspace(-0.5, 0.5, window)[None])[0]
        together = correlation[:, None, None] ** np.abs(row[:, None] - row)
        kept.append(np.einsum("i,cij,j->c", kernel, together, kernel) / (kernel @ kernel))
    return np.asarray(np.interp(growth, kept[1] / kept[0], kept[0]))


def beyond(seen: Array, expected: Array, least: Array | float) -> Array:
    """What second moments (n, 3, 3) have beyond the expected ones, in the directions where they are ``least`` times.

    ``least`` is one for all or (n, 1).
    """
    root = np.linalg.cholesky(expected)
    half = np.linalg.solve(root, seen)
    size, axes = np.linalg.eigh(np.linalg.solve(root, half.transpose(0, 2, 1)))
    factor = root @ (axes * np.sqrt(np.where(size > least, size - 1, 0.0))[:, None, :])
    return np.asarray(factor @ factor.transpose(0, 2, 1))


def about_quadratics(
    time_s: Array, pose: Array, window: int, counts: NDArray[np.bool_] | None = None, *, most: int = 5000
) -> tuple[Array, NDArray[np.int64], Array]:
    """Distances (m, 3) of poses (n, 3) from the quadratic through ``window`` pictures around each, and which these are.

    Only pictures that count are taken, whose windows hold no gap (NaN), and of more than ``most`` an even choice. The
    last is the variance (m,) that independent noise of one leaves in them.
    """
    half = window // 2
    rows = np.arange(half, len(time_s) - half)
    if counts is not None:
        rows = rows[counts[rows]]
    rows = rows[:: max(1, len(rows) // most)]
    index = rows[:, None] + np.arange(-half, half + 1)
    known = np.isfinite(pose[index, 0]).all(axis=1)
    rows, index = rows[known], index[known]
    t = (time_s[index] - time_s[rows][:, None]) / (time_s[index[:, -1]] - time_s[index[:, 0]])[:, None]
    kernel = _kernel(t)
    return np.einsum("nk,nkj->nj", kernel, pose[index]), rows, np.sum(kernel**2, axis=1)


def _kernel(t: Array) -> Array:
    """Weights (m, k) of the poses at times (m, k) in the distance of the middle one, at t = 0, from their quadratic."""
    # Row 0 of the pseudo-inverse gives the fitted value there.
    kernel = -np.linalg.pinv(np.stack([np.ones_like(t), t, t * t], axis=-1))[:, 0, :]
    kernel[:, t.shape[1] // 2] += 1
    return np.asarray(kernel)


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
