"""By how many deviations all inputs of a run are most probably off together, found by simulating the run again.

The probability of deviations x is the product of three: that of the block means of the error that remains, that of its
oscillation about them, and that of x itself. Either each input is off on its own, rarely and then far (Student's t), or
all stated deviations are too small by one factor (normal, Birge 1932). The maxima are found by the Gauss-Newton method;
its derivatives are taken anew at each step by simulations, since the effect of an input far from its value is not
linear. About each maximum the probability is taken as normal (Laplace).

SOURCE: Bishop, Pattern Recognition and Machine Learning (Springer 2006), 4.4, Laplace's approximation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

from towval.model import Array
from towval.model.geometry import about_block_means, block_means, signature_blocks
from towval.validation.consequences import WIDER
from towval.validation.statistics import RightModel

MOST_DEVIATIONS = 20.0
"""The search moves an input by at most this many deviations."""

_BEYOND = 2.0
"""An input counts as off from this many deviations."""

_STATED, _ASSUMED, _COMPUTED = (2.0, 1.0), (1.0, WIDER), (np.inf, 1.0)
"""Degrees of freedom and scale of Student's t for true values, in deviations: of an input that was measured, of one
whose value and deviation were assumed, and of one that was computed from data and tested there. Stated deviations of
3,200 measured quantities are exceeded as in t of two degrees down to Cauchy's (Bailey 2017, Not normal: the
uncertainties of scientific measurements)."""

_FACTORS = np.geomspace(1.0, 4.4, 23)
"""Factors tried on all stated deviations: Student's t of two degrees mixes normals of such scales (95 % below 4.4)."""

_LEAST_NOISE = 0.02  # error of the derivatives, as a share of the variance of the draws
_DIFFERENCE, _ENOUGH, _STEPS = 0.5, 0.5, 8  # half-width of difference quotients; least gain of a step; most steps
_DAMPINGS, _SHARES = (0.0, 0.3, 1.0, 3.0, 10.0), (1.0, 0.5)  # Levenberg's dampings, shares of each step: all tried
_SAMPLES = 4000


@dataclass(frozen=True)
class Unknowns:
    """Inputs that may be off: their columns in the draws, their names, and how each is known.

    ``assumed``: nobody stated it; ``computed``: from data; ``mirrored``: both of its signs have the same effect.
    """

    columns: Sequence[int]
    names: Sequence[str]
    assumed: Sequence[bool]
    computed: Sequence[bool]
    mirrored: Sequence[bool]

    def freedoms(self) -> Array:
        """Degrees of freedom and scale (d, 2) of Student's t for each input."""
        kinds = zip(self.assumed, self.computed, strict=True)
        return np.array([_COMPUTED if computed else _ASSUMED if assumed else _STATED for assumed, computed in kinds])

    def allowed(self, off: Array) -> Array:
        """Values (..., d) clipped to the searched range."""
        return np.clip(off, np.where(self.mirrored, 0.0, -MOST_DEVIATIONS), MOST_DEVIATIONS)


@dataclass(frozen=True)
class Mode:
    """A maximum of the probability.

    ``off`` (d,): by how many deviations each input is off, with its ``covariance`` (d, d); ``error`` (n, 3) that
    remains; ``cost``: twice the negative logarithm of the probability in the whole neighbourhood; ``factor`` on all
    stated deviations, 1 where each input is off on its own.
    """

    off: Array
    covariance: Array
    error: Array
    cost: float
    factor: float


class Causes:
    """The search for maxima of the probability.

    ``effects`` (j, 72) of the stated inputs as in ``right``; ``swing``: mean square of the measurement about its block
    means [m²]; ``errors`` returns what moved inputs (k, d) leave (k, n, 3), NaN where that cannot be simulated.
    """

    def __init__(
        self, right: RightModel, effects: Array, swing: float, unknowns: Unknowns, errors: Callable[[Array], Array]
    ):
        self.right, self.unknowns, self.errors, self.swing = right, unknowns, errors, swing
        root = np.linalg.cholesky(right.weight).T
        shares, axes = np.linalg.eigh((effects @ root.T).T @ (effects @ root.T))
        noise = np.maximum(1 - shares, _LEAST_NOISE)
        self.whiten = (root.T @ axes / np.sqrt(noise)).T
        self.level = float(np.log(noise).sum())
        self.freedoms = unknowns.freedoms()
        self.stated = ~(np.array(unknowns.assumed, dtype=bool) | np.array(unknowns.computed, dtype=bool))

    def mode(self, start: Array, *, common: bool) -> Mode | None:
        """The maximum that the Gauss-Newton method reaches from ``start``; None where a simulation on the way fails.

        ``common``: whether all stated deviations are too small by one factor, or each input is off on its own.
        """
        off, factor = self.unknowns.allowed(start), 2.0 if common else 1.0
        error, cost = self._best(off[None], factor, common)[1:]
        for left in range(_STEPS, -1, -1):
            slopes = self._slopes(off, error)
            if slopes is None:
                return None
            curvature, gradient = slopes
            if common:
                factor = self._factor(off, curvature, gradient)
                cost = self._cost(off, error, factor, common)
            pull = self._pull(off, factor, common)
            normal, down = curvature + np.diag(pull), gradient + pull * off
            if not left:  # The curvature that counts is that of the last step's end.
                break
            steps = [np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -down) for damping in _DAMPINGS]
            tried = self.unknowns.allowed(off + np.array([share * step for step in steps for share in _SHARES]))
            best, remains, least = self._best(tried, factor, common)
            if not least < cost - _ENOUGH:
                break
            off, error, cost = best, remains, least
        _, determinant = np.linalg.slogdet(normal)
        return Mode(off, np.asarray(np.linalg.inv(normal), np.float64), error, cost + float(determinant), factor)

    def _best(self, tried: Array, factor: float, common: bool) -> tuple[Array, Array, float]:
        left = self.errors(tried)
        costs = [self._cost(off, error, factor, common) for off, error in zip(tried, left, strict=True)]
        least = int(np.argmin(costs))
        return tried[least], left[least], costs[least]

    def _cost(self, off: Array, error: Array, factor: float, common: bool) -> float:
        if not np.isfinite(error).all():
            return np.inf
        means, about = self._parts(error)
        blocks = len(signature_blocks(0))
        fit = self.level + float(means @ means) + blocks * float(np.log(np.mean(about**2) * 2 + self.swing))
        own = sum(surprise(value, *kind) for value, kind in zip(off, self._kinds(factor, common), strict=True))
        return fit + own + _rarity(factor)

    def _kinds(self, factor: float, common: bool) -> Array:
        """As :meth:`Unknowns.freedoms`; where the factor is common, stated inputs are normal with it as their scale."""
        kinds = self.freedoms.copy()
        if common:
            kinds[self.stated] = np.inf, factor
        return kinds

    def _parts(self, error: Array) -> tuple[Array, Array]:
        """Block means (..., 72) in deviations of what no stated input causes; positions about them (..., 2 n) [m]."""
        means, about = block_means(error), about_block_means(error[..., :2])
        flat, swings = (part.reshape(*error.shape[:-2], -1) for part in (means, about))
        return flat @ self.whiten.T, swings

    def _slopes(self, off: Array, error: Array) -> tuple[Array, Array] | None:
        """Gauss-Newton matrix (d, d) and half the gradient (d,) of an error's cost; None if a simulation failed."""
        if not np.isfinite(error).all():
            return None
        sides = _DIFFERENCE * np.repeat(np.eye(len(off)), 2, axis=0)
        sides[1::2] *= -1
        tried = self.unknowns.allowed(off + sides)
        left = self.errors(tried)
        if not np.isfinite(left).all():
            return None
        apart = np.sum(tried[0::2] - tried[1::2], axis=1)[:, None]
        means, about = (((part[0::2] - part[1::2]) / apart) for part in self._parts(left))
        here, swings = self._parts(error)
        # An oscillation has one amplitude per block, of unknown size.
        weight = len(signature_blocks(0)) / (len(swings) / 2 * (2 * np.mean(swings**2) + self.swing))
        return means @ means.T + weight * about @ about.T, means @ here + weight * about @ swings

    def _pull(self, off: Array, factor: float, common: bool) -> Array:
        """Half the gradient of each input's own cost over its value (d,): the curvature that replaces Student's t."""
        freedom, scale = self._kinds(factor, common).T
        return np.asarray(1 / (scale**2 + (off**2 - scale**2) / (freedom + 1)))

    def _factor(self, off: Array, curvature: Array, gradient: Array) -> float:
        """The most probable of :data:`_FACTORS`, for the problem linearised at ``off``."""
        costs = []
        for factor in _FACTORS:
            pull = self._pull(off, float(factor), common=True)
            normal, down = curvature + np.diag(pull), gradient + pull * off
            gain = float(down @ np.linalg.solve(normal, down))
            _, determinant = np.linalg.slogdet(normal)
            spread = 2 * np.log(factor) * np.count_nonzero(self.stated)
            costs.append(np.sum(pull * off**2) + spread - gain + determinant + _rarity(factor))
        return float(_FACTORS[np.argmin(costs)])


def distinct(modes: Sequence[Mode]) -> list[Mode]:
    """Modes without repetition: of those within one deviation of each other, the most probable one."""
    found: list[Mode] = []
    for mode in sorted(modes, key=lambda each: each.cost):
        same = [each for each in found if (each.factor == 1) == (mode.factor == 1)]
        apart = [mode.off - each.off for each in same]
        if all(away @ np.linalg.solve(each.covariance, away) > 1 for each, away in zip(same, apart, strict=True)):
            found.append(mode)
    return found


def off_by_name(modes: Sequence[Mode], names: Sequence[str]) -> dict[str, NDArray[np.bool_]]:
    """For each input, in which of k random values from all modes it is far off, to the side of the best mode."""
    costs = np.array([mode.cost for mode in modes])
    weights = np.exp(-0.5 * costs - logsumexp(-0.5 * costs))
    best, rng = modes[int(np.argmin(costs))], np.random.default_rng(1)
    drawn = []
    for mode, weight in zip(modes, weights, strict=True):
        values, vectors = np.linalg.eigh(mode.covariance)
        noise = rng.standard_normal((round(_SAMPLES * weight), len(mode.off)))
        drawn.append(mode.off + noise * np.sqrt(np.maximum(values, 0)) @ vectors.T)
    beyond = np.sign(best.off) * np.concatenate(drawn) > _BEYOND
    return {name: beyond[:, [other == name for other in names]].any(axis=1) for name in dict.fromkeys(names)}


def surprise(deviations: float, freedom: float, scale: float) -> float:
    """Twice the negative logarithm of Student's density of an input being so many deviations off.

    The density is multiplied by √(2π), so that the standard normal gives the square of the deviations.
    """
    if np.isinf(freedom):
        return float((deviations / scale) ** 2 + 2 * np.log(scale))
    peak = gammaln((freedom + 1) / 2) - gammaln(freedom / 2) - 0.5 * np.log(freedom * np.pi) - np.log(scale)
    tail = (freedom + 1) / 2 * np.log1p((deviations / scale) ** 2 / freedom)
    return float(-2 * (peak - tail + 0.5 * np.log(2 * np.pi)))


def _rarity(factor: float) -> float:
    """Twice the negative logarithm of the density of a factor, over that of 1.

    It is the density of the scales whose normals together are Student's t of two degrees of freedom.
    """
    return float(6 * np.log(factor) + 2 / factor**2 - 2)
