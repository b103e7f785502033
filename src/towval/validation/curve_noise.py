"""What the noise of frames does to the curve of a decimated track: draws of its poses together with their rates.

Poses and rates of the curve come from one fit, so their errors belong together: a rate is as uncertain as the frames
about it leave it, and neighbours share what lies between them. Beside, the fit takes as few pieces as explain the
frames: that the body moved by one more bend in each piece than a cubic has, the frames do not exclude either. So the
draws are those of a fit with a bump in each piece, which is as uncertain as the frames leave it, too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, solve_banded

from towval.model import Array, DecimatedTrack, Track
from towval.validation.decimate import frame_sigma, hermite_shares, normal_band

_INNER_FRAMES = 2
"""Frames in the inner half of a piece from which on they say how large a bump is: one alone is as well a bend of the
cubic, and none is a gap, of which another finding speaks."""

_BUMP = 16.0  # times s² (1 − s)², whose top is at one then

_WIDTH = 5
"""A pose depends on value, rate and bump at the start of its piece and on value and rate at its end."""


@dataclass(frozen=True)
class CurveNoise:
    """Noise of the curve of a decimated track at n times.

    ``upper`` (5, 3 u): banded factors of the equations of x, y and heading, one after another; ``concerned`` (n, 5):
    the unknowns that a pose depends on, and ``shares`` (2, n, 5) their weights in it and in its rate.
    """

    upper: Array
    concerned: NDArray[np.intp]
    shares: Array

    @classmethod
    def of(cls, track: Track, thin: DecimatedTrack, times: Array) -> "CurveNoise":
        """That of a track and what it was decimated to, at times (n,) [s]."""
        seen = np.flatnonzero(track.seen)
        time, sigma = track.time_s[seen], frame_sigma(track.std[seen], thin.noise)
        own = _own(thin, time)
        index = np.cumsum(own).reshape(-1, 3) - 1
        concerned, (shares, _) = _weights(thin, own, index, time)
        kept, free = np.searchsorted(time, thin.time_s - 1e-9), own[:, 1]
        factors = []
        for c in range(3):
            band = normal_band(concerned, shares / sigma[:, c : c + 1], index.max() + 1)
            # Where a piece has no more frames than unknowns, its rates are those of the slope over three frames.
            band[0, index[free, 1]] += 2 * (np.median(np.diff(time)) / sigma[kept[free], c]) ** 2
            factors.append(cholesky_banded(band, lower=True))
        lower_band = np.concatenate(factors, axis=1)
        upper = np.array([np.roll(lower_band[k], k) for k in range(_WIDTH - 1, -1, -1)])
        return cls(upper, *_weights(thin, own, index, times))

    def drawn(self, rng: np.random.Generator) -> Array:
        """A draw of the noise of poses and rates (n, 6).

        With the equations' matrix L Lᵀ the unknowns have the covariance (L Lᵀ)⁻¹: they are the x of Lᵀ x = z.
        """
        z = rng.standard_normal(self.upper.shape[1])
        unknowns = solve_banded((0, _WIDTH - 1), self.upper, z, check_finite=False).reshape(3, -1)
        return np.concatenate(np.einsum("snk,cnk->snc", self.shares, unknowns[:, self.concerned]), axis=1)


def _own(thin: DecimatedTrack, time: Array) -> NDArray[np.bool_]:
    """Which of value, rate and bump at each kept time (m, 3) are unknowns.

    Both ends of a pause share one value and have no rate; the bump is that of the piece that begins there.
    """
    rests = np.logical_not(thin.rate.any(axis=1))
    paused = rests[:-1] & rests[1:] & (np.diff(thin.pose, axis=0) == 0).all(axis=1)
    begins, length = thin.time_s[:-1], np.diff(thin.time_s)
    inner = np.searchsorted(time, begins + 0.75 * length) - np.searchsorted(time, begins + 0.25 * length)
    before, after = np.append(False, paused), np.append(paused, False)
    bump = np.append(~paused & (inner >= _INNER_FRAMES), False)
    return np.stack([~before, ~(before | after), bump], axis=1)


def _weights(
    thin: DecimatedTrack, own: NDArray[np.bool_], index: NDArray[np.intp], times: Array
) -> tuple[NDArray[np.intp], Array]:
    """The unknowns (n, 5) on which poses at times depend, and their weights (2, n, 5) in poses and rates."""
    cell, value = hermite_shares(thin.time_s, times)
    width = np.diff(thin.time_s)[cell]
    s = (times - thin.time_s[cell]) / width
    rate = [6 * s * (s - 1) / width, (1 - s) * (1 - 3 * s), 6 * s * (1 - s) / width, s * (3 * s - 2)]
    bump = _BUMP * (s * (1 - s)) ** 2, 2 * _BUMP * s * (1 - s) * (1 - 2 * s) / width
    shares = np.stack([
        np.stack([*value.T[:2], bump[0], *value.T[2:]], axis=1), np.stack([*rate[:2], bump[1], *rate[2:]], axis=1)
    ])  # fmt: skip
    has = np.where(np.arange(3) == 0, True, own)
    shares = shares * np.concatenate([has[cell], has[cell + 1, :2]], axis=1)
    return np.concatenate([index[cell], index[cell + 1, :2]], axis=1), shares
