"""Statistics of an error over a run against draws of what it may be: sizes, limits of a right model, bounds.

Errors are along and across the measured path and of the heading, (..., n, 3) [m, m, rad], without missing times. Draws
(k, n, 3) are realisations of the same error, of any origin.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq

from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import error_signature, normalised_signature, signature_blocks, signature_entries

SIZES = ("position_rms", "position_max", "along_max", "across_max", "heading_rms", "heading_max")
"""Sizes returned by :func:`error_sizes`, in this order."""

_MADE_OF = (((0, 1), "mean"), ((0, 1), "max"), ((0,), "max"), ((1,), "max"), ((2,), "mean"), ((2,), "max"))
"""Components of each size, and whether it is their mean square or their largest."""

STATISTICS = ("size", "shape", "input")
"""Statistics returned by :meth:`RightModel.statistics`, in this order."""

_TESTED = (0, 1, 4, 5)
"""Sizes that the test uses: of position and heading."""

_TAIL_FROM = 0.9
"""Quantile above which the tail of a statistic counts as exponential."""

_RESOLVED = 1.5
"""Least number of draws beyond a bound for it to be their quantile: at 99.9 % that of 256 is the largest draw, which
one more draw exceeds in 0.4 %."""

_LEAST_LEVEL = 0.5
"""Least level of a bound: below the median of what the error may have been, nothing is an upper bound of it."""

_HALVINGS = 18
"""Halvings of the interval in which a bound is searched: five digits."""

_TIMES = 200
"""About as many times of a run are used to find the level of a bound."""

_FOLDS = 8
"""Parts of the draws, each tested against the others, as a draw would be hidden by its own part of the covariance."""

_FLOOR = 0.1
"""Least deviation of a block's mean, as a share of the root mean square over the run: with 512 draws the smallest of 72
principal directions is uncertain by this."""

_LEAST_EFFECT = 0.02
"""Effect of one deviation of an input, as a share of the error's root mean square, below which it is left out."""


def error_sizes(error: NDArray[np.floating]) -> Array:
    """Sizes (..., 6) of errors (..., n, 3) over a run, :data:`SIZES` [m and rad]."""
    square = [error[..., i] ** 2 for i in range(3)]
    parts = []
    for components, whole in _MADE_OF:
        total = sum(square[i] for i in components)
        parts.append(np.mean(total, axis=-1) if whole == "mean" else np.max(total, axis=-1))
    return np.asarray(np.sqrt(np.stack(parts, axis=-1)))


def upper_limit(values: Array, confidence: float) -> float:
    """The value that a statistic exceeds with the probability 1 − ``confidence``, from draws (k,) of it.

    Above the quantile of nine tenths the tail counts as exponential, so that a quantile of 99 % rests on a tenth of the
    draws instead of on the largest few. Its mean e is estimated from m of them only: the limit is that of one more
    draw, which exceeds an excess x with the probability (1 + x / m e)⁻ᵐ.

    Examples
    --------
    >>> draws = np.random.default_rng(0).exponential(size=100_000)
    >>> bool(abs(upper_limit(draws, 0.99) - np.log(100)) < 0.1)
    True
    """
    start = float(np.quantile(values, min(_TAIL_FROM, confidence)))
    excess = values[values > start] - start
    if confidence <= _TAIL_FROM or not len(excess):
        return start
    beyond = np.log((1 - _TAIL_FROM) / (1 - confidence))
    return start + float(excess.sum() * np.expm1(beyond / len(excess)))


@dataclass(frozen=True)
class RightModel:
    """Limits of a right model's error in its size, its shape and the effects of single inputs, at one joint confidence.

    ``size_scale`` (4,) root mean squares over the draws of RMS and largest error of position and heading;
    ``covariance`` (m, 3, 3) of the error's signature; ``effects`` (j, 72) of one deviation of an input each on the
    error's block means, and ``columns`` (j,) which inputs these are; ``one_sided`` (j,) where an input cannot be below
    zero; ``weight`` (72, 72) the inverse covariance of the block means; ``limits`` (3,) of :data:`STATISTICS`, which
    are all kept together with ``confidence``; ``drawn`` (k, 3) the statistics of the draws, and ``entries`` (k, m)
    those entries of the signature whose largest is the shape.
    """

    size_scale: Array
    covariance: Array
    effects: Array
    columns: NDArray[np.intp]
    one_sided: NDArray[np.bool_]
    weight: Array
    limits: Array
    confidence: float
    drawn: Array
    entries: Array

    @classmethod
    def of(cls, draws: Array, inputs: Array, confidence: float) -> "RightModel":
        """From draws (k, n, 3) of the error and the standard normal inputs (k, d) that they come from.

        `InputError` where there are fewer than 32 draws or 24 times.
        """
        if len(draws) < 32 or draws.shape[1] < 24:
            raise InputError(
                "too few draws or times for a limit", got=draws.shape[:2], allowed="32 or more, 24 or more"
            )
        # Stretches of a Sobol sequence are spread over all inputs; every eighth of it is an eighth of the first one.
        features, folds = _features(draws), np.arange(len(draws)) * _FOLDS // len(draws)
        # The effect of an input takes two coefficients: it is fitted in each part of the draws, or in none.
        inputs = inputs if np.count_nonzero(folds) > 2 * inputs.shape[1] + 1 else inputs[:, :0]
        found = cls._fitted(features, inputs, confidence)
        drawn, entries = np.empty((len(draws), len(STATISTICS))), np.empty(features[1].shape[:2])
        for fold in range(_FOLDS):
            held = folds == fold
            part = cls._fitted(tuple(each[~held] for each in features), inputs[~held], confidence)
            drawn[held] = part._statistics(tuple(each[held] for each in features))
            entries[held] = part._entries(features[1][held])
        limits = np.array([max(upper_limit(column, confidence), 1e-9) for column in drawn.T])
        limits *= upper_limit((drawn / limits).max(axis=1), confidence)
        return replace(found, limits=limits, drawn=drawn, entries=entries)

    @classmethod
    def _fitted(cls, features: Sequence[Array], inputs: Array, confidence: float) -> "RightModel":
        """The model without limits, from :func:`_features` of draws."""
        sizes, signature, means = features
        covariance = np.einsum("kmi,kmj->mij", signature, signature) / len(signature)
        scale = np.sqrt(np.mean(sizes**2, axis=0))
        rms = np.sqrt(np.mean(means.reshape(len(means), -1, 3) ** 2, axis=(0, 1)))
        rms[:2] = np.hypot(*rms[:2]) / np.sqrt(2)
        floor = np.tile(np.maximum(_FLOOR * rms, 1e-12), means.shape[1] // 3)
        weight = np.asarray(np.linalg.inv(means.T @ means / len(means) + np.diag(floor**2)))
        effects, columns, one_sided = _effects(means, inputs)
        # An infinite scale leaves out what does not vary at all.
        scale = np.where(scale > 0, scale, np.inf)
        ones, none = np.ones(len(STATISTICS)), np.empty((0, len(STATISTICS)))
        return cls(scale, covariance, effects, columns, one_sided, weight, ones, confidence, none, none)

    def signature(self, error: Array) -> Array:
        """Entries (..., m) of the signature of errors (..., n, 3) in deviations, the larger of position and heading."""
        return self._entries(error_signature(error))

    def _entries(self, signature: Array) -> Array:
        return np.asarray(normalised_signature(signature, self.covariance).max(axis=-1))

    def input_scores(self, means: Array) -> Array:
        """By how many deviations each input stands out (..., j) in block means (..., 72), with all others as drawn.

        Generalised least squares: ``s' V⁻¹ E / √(s' V⁻¹ s)`` with the effect s of the input and V of all that is drawn.
        """
        weighted = self.effects @ self.weight
        norm = np.sqrt(np.einsum("jb,jb->j", weighted, self.effects))
        return np.asarray(means @ weighted.T / norm)

    def statistics(self, error: Array) -> Array:
        """Size, shape and inputs (..., 3) of errors (..., n, 3); :data:`STATISTICS`."""
        return self._statistics(_features(error))

    def _statistics(self, features: Sequence[Array]) -> Array:
        sizes, signature, means = features
        size = (sizes / self.size_scale).max(axis=-1)
        shape = self._entries(signature).max(axis=-1)
        scores = np.abs(self.input_scores(means))
        single = scores.max(axis=-1) if len(self.columns) else np.zeros_like(size)
        return np.stack([size, shape, single], axis=-1)

    def rejects(self, error: Array) -> Array:
        """Whether the test rejects each of some errors (..., n, 3) as no right model's (...,)."""
        return np.asarray((self.statistics(error) > self.limits).any(axis=-1))

    def thresholds(self, shift: Array, error: Array) -> Array:
        """The smallest multiples (k,) of shifts ((k,) n, 3) that, added to errors (k, n, 3), make the test reject them.

        Zero where the errors alone are rejected.
        """
        parts, shifts = (error, error_signature(error)), (shift, error_signature(shift))
        own, added = self._squares(*parts), self._squares(*shifts)
        more, less = (self._squares(*(p + sign * s for p, s in zip(parts, shifts, strict=True))) for sign in (1, -1))
        cross = (more - less) / 4
        left = np.maximum(1 - own, 0)
        root = np.sqrt(cross**2 + added * left)
        with np.errstate(divide="ignore", invalid="ignore"):  # what does not grow never exceeds a limit
            found = np.where(cross > 0, left / (cross + root), (root - cross) / added)
        return np.asarray(np.fmin.reduce(np.where(left > 0, found, 0.0), axis=-1, initial=np.inf))

    def _squares(self, error: Array, signature: Array) -> Array:
        """Squares (..., m) of all terms over their limits; the errors are rejected where the largest exceeds one."""
        position, turn = np.sum(error[..., :2] ** 2, axis=-1), error[..., 2] ** 2
        parts = [
            np.mean(position, axis=-1, keepdims=True) / self.size_scale[0] ** 2,
            position / self.size_scale[1] ** 2,
            np.mean(turn, axis=-1, keepdims=True) / self.size_scale[2] ** 2,
            turn / self.size_scale[3] ** 2,
            *np.moveaxis(normalised_signature(signature, self.covariance) ** 2, -1, 0),
            self.input_scores(_block_means_of(signature)) ** 2,
        ]
        limits = np.repeat(self.limits, [4, 2, 1])
        return np.concatenate([part / limit**2 for part, limit in zip(parts, limits, strict=True)], axis=-1)


def _features(error: Array) -> tuple[Array, Array, Array]:
    """Tested sizes (..., 4), signature (..., m, 3) and block means (..., 72) of errors (..., n, 3)."""
    signature = error_signature(error)
    return error_sizes(error)[..., _TESTED], signature, _block_means_of(signature)


def _block_means_of(signature: Array) -> Array:
    """The means (..., 72) that a signature begins with."""
    means = signature[..., : len(signature_blocks(0)), :]
    return means.reshape(*means.shape[:-2], -1)


def _effects(means: Array, inputs: Array) -> tuple[Array, NDArray[np.intp], NDArray[np.bool_]]:
    """Effects (j, b) of one deviation of the inputs that matter, their columns (j,), and which are one-sided (j,).

    Block means (k, b) are regressed on the inputs (k, d); one that cannot be below zero acts by its absolute value.
    """
    k, d = inputs.shape
    if d == 0 or k <= 2 * d + 1:
        return np.empty((0, means.shape[1])), np.empty(0, dtype=np.intp), np.empty(0, dtype=bool)
    basis = np.concatenate([np.ones((k, 1)), inputs, np.abs(inputs) - np.sqrt(2 / np.pi)], axis=1)
    slopes, *_ = lstsq(basis, means, lapack_driver="gelsy")
    both, size = slopes[1 : d + 1], slopes[d + 1 :]
    one_sided = (1 - 2 / np.pi) * np.sum(size**2, axis=1) > np.sum(both**2, axis=1)
    effects = np.where(one_sided[:, None], size, both)
    # With half as many coefficients as draws, noise moves one by several times what it would alone.
    spread = np.diag(np.linalg.inv(basis.T @ basis))[1:]
    residual = np.sum((means - basis @ slopes) ** 2) / (k - basis.shape[1])
    noise = residual * np.where(one_sided, spread[d:], spread[:d])
    power = np.sum(effects**2, axis=1)
    matters = power > np.maximum(_LEAST_EFFECT**2 * np.mean(np.sum(means**2, axis=1)), 4 * noise)
    return effects[matters], np.flatnonzero(matters), one_sided[matters]


def holding_levels(drawn: Array, draws: Array, confidence: float) -> Array:
    """Levels (6,) of the quantiles in :func:`bounds` with which they hold in a share ``confidence`` of such runs.

    SOURCE: R. Beran, "Prepivoting to reduce level error of confidence sets", Biometrika 74 (1987) 457. Each draw serves
    as the run: the observed error is ``drawn[i]``, (k, n, 3), the truth ``drawn[i] + draws[i]``, which is larger than a
    share of the others' ``drawn[i] + draws[j]``, by each of :data:`SIZES`. The level is a quantile of these shares.

    So a right model's bounds hold. Where the draws are noise for the most part, that asks for next to no level, with
    which a wrong model that the test does not see would exceed them in a quarter of runs: a half is the least.

    Examples
    --------
    >>> noise = 1e-3 * np.random.default_rng(1).normal(size=(512, 24, 3))
    >>> bool(holding_levels(-noise, noise, 0.95).max() == 0.5)  # a truth of nought, of which only noise is seen
    True
    """
    times = slice(None, None, max(1, drawn.shape[1] // _TIMES))
    # Only ranks matter, so single precision suffices; component by component in memory it takes a third of the time.
    errors, others = (np.array(each[:, times], dtype=np.float32, order="F") for each in (drawn, draws))
    sizes = (error_sizes(error + others) for error in errors)
    below = [np.sum(each < each[i], axis=0) for i, each in enumerate(sizes)]
    levels = np.quantile(below, confidence, axis=0, method="weibull") / (len(others) - 1)
    return np.asarray(np.maximum(levels, _LEAST_LEVEL))


def bounds(error: Array, draws: Array, confidence: float, levels: Array | None = None) -> Array:
    """Lower and upper bounds (2, 6) of the sizes of what is behind an observed error; each holds with ``confidence``.

    The observed error is ``truth − draw``. *Upper*: the quantile of the size of ``error + draw`` over the draws, at
    ``confidence`` or the ``levels`` (6,) of :func:`holding_levels`. At the former it is exact for what the observed
    error does not contain (a camera that moves the measured rover, and with it the simulation, as it moves the measured
    object) and for a truth that is far larger; else it is wide, because what the observed error contains is counted
    twice. *Lower*: the smallest multiple c of the observed error for which ``c error − draw`` is as large as what was
    observed in a share 1 − ``confidence`` of the draws; zero where noise alone is. Where the draws are too few for a
    quantile of the ``confidence``, both are from :func:`upper_limit`, and ``levels`` do not count.

    Parameters
    ----------
    error : ndarray (n, 3)
        Observed.
    draws : ndarray (k, n, 3)
        Of what stands between the truth and what is observed.

    Examples
    --------
    >>> shift = np.tile([0.01, 0.0, 0.0], (50, 1))
    >>> noise = np.random.default_rng(1).normal(size=(4000, 1, 3)) * [1e-3, 0.0, 0.0]
    >>> (1e3 * bounds(shift, np.tile(noise, (1, 50, 1)), 0.95)[:, 1]).round(1).tolist()  # 10 ∓ 1.64
    [8.4, 11.6]
    """
    found, level_of = np.empty((2, len(SIZES))), levels if _resolved(draws, confidence) else None
    for i, (components, whole) in enumerate(_MADE_OF):
        part, noise = error[:, components], draws[..., components]
        square, mixed, own = np.sum(part**2, axis=-1), np.sum(part * noise, axis=-1), np.sum(noise**2, axis=-1)
        if whole == "mean":
            square, mixed, own = (value.mean(axis=-1, keepdims=True) for value in (square, mixed, own))
        sizes = np.sqrt(np.maximum((square + 2 * mixed + own).max(axis=-1), 0.0))
        upper = _quantile(sizes, confidence) if level_of is None else float(np.quantile(sizes, level_of[i]))
        found[:, i] = _lower(square, mixed, own, confidence), upper
    return found


def _quantile(sizes: Array, confidence: float) -> float:
    """The quantile of sizes (k,), by the form of their tail where too few lie beyond it."""
    return float(np.quantile(sizes, confidence)) if _resolved(sizes, confidence) else upper_limit(sizes, confidence)


def _resolved(draws: Array, level: float) -> bool:
    """Whether enough of the draws (k, ...) lie beyond a quantile of theirs."""
    return (1 - level) * len(draws) >= _RESOLVED


def upper_error(error: Array, draws: Array, confidence: float) -> float:
    """Relative standard error [1] of the upper bound of the largest position error due to the number of draws.

    The rank of a quantile is binomial: half the distance of the values one standard deviation of it above and below.
    """
    sizes = np.sort(error_sizes(error + draws)[:, SIZES.index("position_max")])
    ranks = confidence + np.array([-1, 1]) * np.sqrt(confidence * (1 - confidence) / len(sizes))
    low, high = np.quantile(sizes, np.clip(ranks, 0, 1))
    return float(0.5 * (high - low) / np.quantile(sizes, confidence))


def _lower(square: Array, mixed: Array, own: Array, confidence: float) -> float:
    """Lower bound of one size, the largest over n, from ``|error|²`` (n,), ``error · draw`` and ``|draw|²`` (k, n)."""
    observed = float(square.max())

    def too_small(c: float) -> bool:
        squares = (c * c * square - 2 * c * mixed + own).max(axis=-1)
        if not _resolved(squares, confidence):
            return upper_limit(np.sqrt(np.maximum(squares, 0.0)), confidence) ** 2 < observed
        return bool(np.mean(squares >= observed) < 1 - confidence)

    return _edge(too_small, 1.0) * float(np.sqrt(observed)) if too_small(0.0) else 0.0


def _edge(inside: Callable[[float], bool], high: float) -> float:
    """Where ``inside`` ceases to hold between zero and ``high``, by halving the interval."""
    low = 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if inside(middle) else (low, middle)
    return high


def place(error: Array, right: RightModel, length: Array) -> tuple[float, float]:
    """Lengths of the path [m] between which an error (n, 3) begins; NaN where its shape keeps the limit.

    The first to end of the signature's entries above the limit shows when the error has begun at the latest; if it is a
    change, also when at the earliest: at the last time before its first block, whose mean already contains the error.
    The search is repeated among the changes within that time, with the lower limit for these few.
    """
    normalised, entries = right.signature(error), signature_entries()
    asked, limit = np.ones(len(entries), dtype=bool), right.limits[1]
    begins, ends, blocks = float("nan"), float("nan"), signature_blocks(len(length))
    while (exceeding := asked & (normalised > limit)).any():
        # Of those that end together, the latest change; a mean does not show when the error began.
        first = min(
            (entries[i] for i in np.flatnonzero(exceeding)), key=lambda e: (e.last, e.first == e.last, -e.first)
        )
        since = first.first if first.first < first.last else 0
        begins, ends = float(length[max(0, blocks[since][0] - 1)]), float(length[blocks[first.last][-1]])
        asked &= [since <= e.first < e.last <= first.last and e != first for e in entries]
        if asked.any():
            limit = upper_limit(right.entries[:, asked].max(axis=1), right.confidence)
    return begins, ends
