"""Which inputs, moved by how many of their deviations, would explain the error of a run, and what would remain.

A choice among models of what is off, by their probabilities: few inputs, moved in the scene with the run simulated
again, since an input far off its value does not act as one within its deviation does; or none in particular, but all
stated deviations too small by one factor (Birge 1932), where the draws tell which inputs are off most probably. What
the run cannot separate is named together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from scipy.special import gammaln

from towval.model import Array
from towval.model.geometry import block_means, rms_length, signature_blocks
from towval.model.inputs import INPUTS
from towval.model.statement import Explanation
from towval.validation.consequences import WIDER
from towval.validation.effects import EFFECTS
from towval.validation.statistics import RightModel, place

Moves = Mapping[int, float]
"""By how many deviations columns of the draws are moved."""

Left = Callable[[Sequence[Moves]], Array]
"""Errors (k, n, 3) of the run, along and across its path, that k moves leave; NaN where one cannot be simulated."""

_MOST_INPUTS = 3
_MOST_DEVIATIONS = 20.0
"""An input farther off than that is no explanation."""

_TRIED = (2.0, 4.0, 6.0, 9.0)  # deviations to both sides; an oscillation keeps step with another over about two
_REFINED = 4  # inputs that look best after that, whose deviations are then sought
_FIRST_STEP, _LAST_STEP = 2.0, 0.25  # of that search
_WORTH = 0.5  # of the cost: what a step has to gain; a fifth of what one deviation of an input makes

_STATED, _ASSUMED = (2, 1.0), (1, WIDER)
"""Degrees of freedom and scale of Student's t that true values follow, in deviations: of an input that was measured,
and of one whose value and deviation were assumed. Stated deviations of 3,200 measured quantities are exceeded like
that, t of two degrees down to Cauchy's (Bailey 2017, Not normal: the uncertainties of scientific measurements)."""

_FACTORS = np.geomspace(1.0, 4.4, 23)
"""Of all stated deviations together: the scale of t of two degrees, 95 % of which lies below."""

_BEYOND = 2.0
"""Deviations from which on an input counts as off."""

_NAMED = 0.9
"""Probability with which the first input is among those that are named for it."""

_SAMPLES = 4000


@dataclass(frozen=True)
class _Point:
    """Moved inputs, the error (n, 3) that they leave, and what speaks against them."""

    moves: dict[int, float]
    error: Array
    cost: float


class _Search:
    """What speaks against moved inputs, and the search for those against which least does."""

    def __init__(self, off: Array, right: RightModel, names: Sequence[str], assumed: Sequence[str], left: Left):
        self.right, self.names, self.left = right, names, left
        self.known: dict[tuple[tuple[int, float], ...], Array] = {}
        self.assumed = [name in assumed for name in names]
        self.root = np.linalg.cholesky(right.weight).T
        self.samples, self.swing = len(off), float(np.mean(_wobble(off)))
        stated = [_is_stated(names[c]) and not one for c, one in zip(right.columns, right.one_sided, strict=True)]
        self.columns = right.columns[stated]
        effects = right.effects[stated] @ self.root.T
        shares, self.axes = np.linalg.eigh(effects.T @ effects)
        self.effects, self.spread = effects @ self.axes, 1 + np.outer(_FACTORS**2 - 1, np.maximum(shares, 0))
        known = set(right.columns.tolist())
        # A covariance has many columns (the camera's 18): those that the error does not depend on are not tried.
        open_ = [c for c, name in enumerate(names) if c in known or _is_stated(name)]
        self.mirrored = self._mirrored(open_)
        self.groups = [each for group in _groups(names) if (each := [c for c in open_ if names[c] in group])]

    def cost(self, moves: Moves, error: Array) -> float:
        """Twice the negative logarithm of the probability density of what remains (n, 3), times what is known of the
        moved inputs, the others being within their deviations; lower is more probable.

        Each moved input is one of many that might have been.
        """
        if not np.isfinite(error).all():
            return np.inf
        moved = [c for c, value in moves.items() if value]
        chosen = sum(any(c in moved for c in group) for group in self.groups)
        choice = 2 * chosen * np.log(len(self.groups)) + sum(self._surprise(c, moves[c]) for c in moved)
        return float(self._by_factor(error)[0]) + self._swing(error) + float(choice)

    def all_off(self, error: Array) -> tuple[float, float]:
        """The same where all stated deviations are too small by one factor, and that factor, the most probable."""
        costs = self._by_factor(error) + 6 * np.log(_FACTORS) + 2 / _FACTORS**2 - 2
        return float(costs.min() + self._swing(error)), float(_FACTORS[np.argmin(costs)])

    def _by_factor(self, error: Array) -> Array:
        """What speaks against each factor by the 72 block means of an error.

        Predictive density of one more draw: Student's t, with the degrees of freedom that the draws leave.
        """
        square = np.sum((self._white(error) @ self.axes) ** 2 / self.spread, axis=-1)
        size = self.samples * np.log1p(square / max(self.samples - len(self.axes) + 1, 1))
        return np.asarray(np.log(self.spread).sum(axis=-1) + size)

    def _swing(self, error: Array) -> float:
        """What speaks against an error about its block means: one value a block (an oscillation has one amplitude
        there), of unknown size, with nothing gained below what the measurement does. A block of one instant has none.
        """
        return 24 * float(np.log(np.maximum(_wobble(error) + self.swing, np.finfo(float).tiny)))

    def _surprise(self, column: int, deviations: float) -> float:
        if not _is_stated(self.names[column]):
            return deviations**2
        return _surprise(deviations, self.assumed[column])

    def off_most_probably(self, error: Array, factor: float) -> tuple[dict[int, float], list[str]]:
        """By how much each input is off if all are by a common factor, and of which inputs one at least is far off.

        Posterior of the linear model of the draws' regression: its mean, and the fewest inputs that are beyond two
        deviations, to the side of the mean, with the probability :data:`_NAMED`; the best :data:`_MOST_INPUTS` where
        none are.
        """
        square, gain = factor**2, self.effects / self.spread[np.searchsorted(_FACTORS, factor)]
        mean = -square * gain @ (self._white(error) @ self.axes)
        values, vectors = np.linalg.eigh(square * np.eye(len(mean)) - square**2 * gain @ self.effects.T)
        noise = np.random.default_rng(1).standard_normal((_SAMPLES, len(mean)))
        drawn = mean + noise * np.sqrt(np.maximum(values, 0)) @ vectors.T
        beyond = np.sign(mean) * drawn > _BEYOND
        names = [self.names[c] for c in self.columns]
        off = {name: beyond[:, [other == name for other in names]].any(axis=1) for name in names}
        found, none = list[str](), np.ones(_SAMPLES, dtype=bool)
        while len(found) < min(_MOST_INPUTS, len(off)) and none.mean() > 1 - _NAMED:
            found.append(max((name for name in off if name not in found), key=lambda each: np.mean(none & off[each])))
            none &= ~off[found[-1]]
        return dict(zip(self.columns.tolist(), mean.tolist(), strict=True)), found

    def better(self, point: _Point, columns: Sequence[int]) -> _Point:
        """The best point found from ``point`` on by moving these columns: by their gradients, and to both sides."""
        step = _FIRST_STEP
        while step >= _LAST_STEP:
            at = np.array([point.moves.get(c, 0.0) for c in columns])
            sides = at + step * np.array([sign * row for row in np.eye(len(at)) for sign in (1, -1)])
            tried = self._at(point, columns, sides)
            there = np.array([self._white(each.error) for each in tried])
            apart = [a.moves[c] - b.moves[c] for c, a, b in zip(columns, tried[0::2], tried[1::2], strict=True)]
            gradient = (there[0::2] - there[1::2]).T / apart
            if np.isfinite(gradient).all():
                least = np.linalg.lstsq(gradient, -self._white(point.error), rcond=1e-3)[0]
                tried += self._at(point, columns, at + np.outer([1.0, 0.5], least))
            best = min(tried, key=lambda each: each.cost)
            if best.cost < point.cost - _WORTH:
                point = best
            else:
                step /= 2
        return point

    def from_grid(self, point: _Point, columns: Sequence[int]) -> _Point:
        """The best point with these columns at one of few values each."""
        if all(c in self.mirrored for c in columns):
            # Without effect to first order, so that two of them (heights of a tow) show together only.
            near, far = ([row for row in product((0.0, *_TRIED[:n]), repeat=len(columns)) if any(row)] for n in (2, 4))
            best = min(self._at(point, columns, np.array(near)), key=lambda each: each.cost)
            if all(best.moves[c] < _TRIED[1] for c in columns):
                return best
            return min(self._at(point, columns, np.array(far)), key=lambda each: each.cost)
        tried = list[_Point]()
        for way in np.vstack([np.eye(len(columns)), -np.eye(len(columns))]):
            low, high = self._at(point, columns, np.outer(_TRIED[:2], way))
            tried += [low, high]
            if high.cost < max(low.cost, point.cost):  # else it leads away, and farther off even more so
                tried += self._at(point, columns, np.outer(_TRIED[2:], way))
        return min(tried, key=lambda each: each.cost)

    def _at(self, point: _Point, columns: Sequence[int], values: Array) -> list[_Point]:
        least = np.array([0.0 if c in self.mirrored else -_MOST_DEVIATIONS for c in columns])
        moves = [
            point.moves | dict(zip(columns, row, strict=True))
            for row in np.clip(values, least, _MOST_DEVIATIONS).tolist()
        ]
        return [_Point(m, e, self.cost(m, e)) for m, e in zip(moves, self._errors(moves), strict=True)]

    def _errors(self, moves: Sequence[Moves]) -> list[Array]:
        """What each of these leaves (n, 3), simulated once however often it is asked for."""
        keys = [tuple(sorted((c, value) for c, value in each.items() if value)) for each in moves]
        new = {key: each for key, each in zip(keys, moves, strict=True) if key not in self.known}
        if new:
            self.known |= zip(new, self.left(list(new.values())), strict=True)
        return [self.known[key] for key in keys]

    def _mirrored(self, columns: Sequence[int]) -> frozenset[int]:
        """Columns that act by their size: heights and the like, about zero."""
        moved = self._errors([{}, *({c: sign * _TRIED[1]} for c in columns for sign in (1, -1))])
        sides = zip(columns, moved[1::2], moved[2::2], strict=True)
        return frozenset(c for c, a, b in sides if np.array_equal(a, b) and not np.array_equal(a, moved[0]))

    def _white(self, error: Array) -> Array:
        means = block_means(error)
        return np.asarray(means.reshape(*means.shape[:-2], -1) @ self.root.T)


def explain(
    error: Array, off: Array, right: RightModel, names: Sequence[str], assumed: Sequence[str], left: Left, length: Array
) -> Explanation:
    """What would explain an error (n, 3), along and across the path.

    One input after the other is moved, the most probable first, until the remainder is what a right model leaves, no
    other is probable, or three are moved; unless it is more probable that all are off by a common factor.

    Parameters
    ----------
    off : ndarray (k, n, 3)
        Draws of what the measurement is off.
    names : sequence of str
        Name of the input of each column of the draws.
    assumed : sequence of str
        Inputs of which neither value nor deviation was stated.
    left : callable
    length : ndarray (n,)
        Of the path [m], at the same times.
    """
    search = _Search(off, right, names, assumed, left)
    (point, moved, instead), factor = _few(search, error), 1.0
    all_off, likely = search.all_off(error)
    if likely > 1 and all_off < point.cost:
        means, first = search.off_most_probably(error, likely)
        (remaining,) = left([means])
        if np.isfinite(remaining).all() and not right.rejects(remaining):
            named = _named(means, list(means), names)
            point, moved = _Point(means, remaining, all_off), {name: named[name] for name in first[:1]}
            instead, factor = {name: named[name] for name in first[1:]}, likely
    explained = bool(moved) and not right.rejects(point.error)
    farthest = max(map(abs, moved.values()), default=0.0)
    if not explained and (farthest >= _MOST_DEVIATIONS or rms_length(point.error) >= rms_length(error)):
        point, moved, instead = _Point({}, error, 0.0), {}, {}  # it fits a part of the error by what cannot be
    begins, ends = place(point.error, right, length)
    return Explanation(
        moved, explained, rms_length(error), rms_length(point.error), begins, ends,
        tuple(name for name in {**moved, **instead} if name in assumed), instead, factor,
    )  # fmt: skip


def _few(search: _Search, error: Array) -> tuple[_Point, dict[str, float], dict[str, float]]:
    """The best point with few inputs moved, their moves by name, and what may be off in place of the only one."""
    right, point, chosen = search.right, _Point({}, error, search.cost({}, error)), list[list[int]]()
    instead: dict[str, float] = {}
    while len(chosen) < _MOST_INPUTS and not (chosen and not right.rejects(point.error)):
        groups = [columns for columns in search.groups if columns not in chosen]
        tried = [(search.from_grid(point, columns), columns) for columns in groups]
        tried = sorted(tried, key=lambda each: each[0].cost)[:_REFINED]
        refined = [(search.better(each, [*chain(*chosen), *columns]), columns) for each, columns in tried]
        better = sorted((e for e in refined if e[0].cost < point.cost), key=lambda each: each[0].cost)
        if not better:
            break
        instead = {} if chosen else _as_probable(better, search.names)
        point = better[0][0]
        chosen.append(better[0][1])
    return point, _named(point.moves, [*chain(*chosen)], search.names), instead


def _as_probable(tried: Sequence[tuple[_Point, list[int]]], names: Sequence[str]) -> dict[str, float]:
    """What may be off in place of the first of what was tried: the fewest that together with it hold the truth with the
    probability :data:`_NAMED`, all being alike before."""
    weight = np.exp(-0.5 * np.array([point.cost - tried[0][0].cost for point, _ in tried]))
    count = int(np.searchsorted(np.cumsum(weight) / weight.sum(), _NAMED)) + 1
    others: dict[str, float] = {}
    for point, columns in tried[1:count]:
        others |= _named(point.moves, columns, names)
    return others


def _named(moves: Moves, columns: Sequence[int], names: Sequence[str]) -> dict[str, float]:
    """Moved inputs, the farthest off first, by the largest move of their columns."""
    moved: dict[str, float] = {}
    for column in columns:
        if moves.get(column):
            moved[names[column]] = max(moved.get(names[column], 0.0), moves[column], key=abs)
    return dict(sorted(moved.items(), key=lambda item: -abs(item[1])))


def _groups(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Inputs that are moved together: those of one effect, and each other by itself."""
    together = [effect.inputs for effect in EFFECTS if sum(name in names for name in effect.inputs) > 1]
    alone = [name for name in dict.fromkeys(names) if not any(name in group for group in together)]
    return [*together, *((name,) for name in alone)]


def _is_stated(name: str) -> bool:
    """Whether somebody stated or should have stated its deviation; else it was computed from data, and tested there."""
    return name not in INPUTS or INPUTS[name].stated is not None


def _surprise(deviations: float, assumed: bool) -> float:
    """Twice the negative logarithm of how probable it is that an input is so many deviations off, about there.

    A density times √(2π), the width over which a normal one is spread.
    """
    freedom, scale = _ASSUMED if assumed else _STATED
    peak = gammaln((freedom + 1) / 2) - gammaln(freedom / 2) - 0.5 * np.log(freedom * np.pi) - np.log(scale)
    tail = (freedom + 1) / 2 * np.log1p((deviations / scale) ** 2 / freedom)
    return float(-2 * (peak - tail + 0.5 * np.log(2 * np.pi)))


def _wobble(error: Array) -> Array:
    """Mean square (...,) of the position about its block means [m²]."""
    position = error[..., :2]
    means = np.repeat(block_means(position), [len(rows) for rows in signature_blocks(error.shape[-2])], axis=-2)
    return np.asarray(np.mean(np.sum((position - means) ** 2, axis=-1), axis=-1))
