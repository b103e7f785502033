"""Which inputs, moved by how many of their deviations, would explain the error of a run, and what would remain.

Few inputs are searched over wide ranges first, with the run simulated again for each move, since the effect of an input
far from its value is not linear. From there and from the stated values all inputs are moved together
(:mod:`towval.validation.causes`). Inputs that the run cannot separate are named together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product

import numpy as np

from towval.model import Array
from towval.model.geometry import about_block_means, block_means, rms_length, signature_blocks
from towval.model.inputs import INPUTS
from towval.model.statement import Explanation
from towval.validation.causes import MOST_DEVIATIONS, Causes, Mode, Unknowns, distinct, off_by_name, surprise
from towval.validation.effects import EFFECTS
from towval.validation.statistics import RightModel, place

Moves = Mapping[int, float]
"""Number of deviations by which columns of the draws are moved."""

Left = Callable[[Sequence[Moves]], Array]
"""Simulates the run with k sets of moves: its errors (k, n, 3) along and across the path, NaN where that fails."""

_MOST_INPUTS = 3
_TRIED = (2.0, 4.0, 6.0, 9.0)  # deviations to both sides; oscillations stay in phase over about two
_REFINED = 4  # best inputs after that, whose deviations are then refined
_FIRST_STEP, _LAST_STEP = 2.0, 0.25  # of that search
_WORTH = 0.5  # least reduction of the cost by a step; one deviation of an input costs about 1
_LEAST_SWING = 1e-18  # m²; a block of one instant has no oscillation

_NAMED = 0.9
"""Probability with which at least one of the inputs that are named in place of each other is off."""


@dataclass(frozen=True)
class _Point:
    """Moved inputs, the error (n, 3) of the run simulated with them, and their cost."""

    moves: dict[int, float]
    error: Array
    cost: float


class _Search:
    """The cost of moved inputs, and the search for those with the lowest cost."""

    def __init__(self, off: Array, right: RightModel, names: Sequence[str], assumed: Sequence[str], left: Left):
        self.right, self.names, self.left = right, names, left
        self.known: dict[tuple[tuple[int, float], ...], Array] = {}
        self.assumed = [name in assumed for name in names]
        self.root = np.linalg.cholesky(right.weight).T
        self.samples, self.swing = len(off), max(float(np.mean(_wobble(off))), _LEAST_SWING)
        known = set(right.columns.tolist())
        # A covariance has many columns (the camera's 18): those that the error does not depend on are not tried.
        open_ = [c for c, name in enumerate(names) if c in known or _is_stated(name)]
        self.mirrored = self._mirrored(open_)
        self.groups = [each for group in _groups(names) if (each := [c for c in open_ if names[c] in group])]

    def cost(self, moves: Moves, error: Array) -> float:
        """Twice the negative logarithm of the joint density of the moved inputs and the error (n, 3) that remains.

        Inputs that are not moved are within their deviations. Each moved group is one of many that might have been
        moved, which adds to the cost.
        """
        if not np.isfinite(error).all():
            return np.inf
        moved = [c for c, value in moves.items() if value]
        chosen = sum(any(c in moved for c in group) for group in self.groups)
        choice = 2 * chosen * np.log(max(1, len(self.groups))) + sum(self._surprise(c, moves[c]) for c in moved)
        return self._means(error) + self._swing(error) + float(choice)

    def _means(self, error: Array) -> float:
        """Cost of the 72 block means of an error (n, 3), as of one more draw.

        The draws are normal with a covariance that is known from the k of them, so one more follows Student's t with
        the density ``(1 + q / k)^(−(k + 1) / 2)`` of its square q by that covariance, whatever the number of means.
        """
        square = float(np.sum(self._white(error) ** 2))
        return (self.samples + 1) * float(np.log1p(square / self.samples))

    def _swing(self, error: Array) -> float:
        """Cost of the oscillation of an error (n, 3) about its block means: one amplitude per block, of unknown size.

        An oscillation far below that of the measurement is not rewarded any more.
        """
        return len(signature_blocks(0)) * float(np.log(_wobble(error) + self.swing))

    def _surprise(self, column: int, deviations: float) -> float:
        (kind,) = self.unknowns([column]).freedoms()
        return surprise(deviations, *kind)

    def unknowns(self, columns: Sequence[int]) -> Unknowns:
        """These columns, with what is known of their inputs."""
        names = [self.names[c] for c in columns]
        computed = [not _is_stated(name) for name in names]
        return Unknowns(
            columns, names, [self.assumed[c] for c in columns], computed, [c in self.mirrored for c in columns]
        )

    def modes(self, starts: Sequence[_Point]) -> tuple[list[Mode], list[str]]:
        """Maxima of the probability whose error is not rejected, and the names of the inputs that were free to move.

        Free are the inputs moved at one of the ``starts`` and all stated ones that matter.
        """
        moved, known = {c for point in starts for c, value in point.moves.items() if value}, self.right.columns
        stated = np.array([_is_stated(self.names[c]) for c in known], dtype=bool)
        unknowns = self.unknowns(sorted({*known[stated].tolist(), *moved}))
        if not unknowns.columns:
            return [], []

        def errors(tried: Array) -> Array:
            return np.array(self._errors([dict(zip(unknowns.columns, row, strict=True)) for row in tried.tolist()]))

        causes = Causes(self.right, self.right.effects[stated & ~self.right.one_sided], self.swing, unknowns, errors)
        places = [np.zeros(len(unknowns.columns))]
        places += [np.array([point.moves.get(c, 0.0) for c in unknowns.columns]) for point in starts]
        own = [causes.mode(place, common=False) for place in places]
        found = [mode for mode in own if mode is not None]
        nearest, best = found[:1], sorted(found, key=lambda each: each.cost)[:1]
        common = [causes.mode(each.off, common=True) for each in nearest + best]
        found += [mode for mode in common if mode is not None]
        left = [mode for mode in distinct(found) if not self.right.rejects(mode.error)]
        return left, list(unknowns.names)

    def better(self, point: _Point, columns: Sequence[int]) -> _Point:
        """The best point reached from ``point`` by moving these columns, along their gradients and to both sides."""
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
        """The best of the points with these columns at a few values far apart."""
        if all(c in self.mirrored for c in columns):
            # Without effect to first order, so that two of them (heights of a tow) may show only together.
            near, far = ([row for row in product((0.0, *_TRIED[:n]), repeat=len(columns)) if any(row)] for n in (2, 4))
            best = min(self._at(point, columns, np.array(near)), key=lambda each: each.cost)
            if all(best.moves[c] < _TRIED[1] for c in columns):
                return best
            return min(self._at(point, columns, np.array(far)), key=lambda each: each.cost)
        tried = list[_Point]()
        for direction in np.vstack([np.eye(len(columns)), -np.eye(len(columns))]):
            low, high = self._at(point, columns, np.outer(_TRIED[:2], direction))
            tried += [low, high]
            if high.cost < max(low.cost, point.cost):  # else the cost grows this way, and farther off even more
                tried += self._at(point, columns, np.outer(_TRIED[2:], direction))
        return min(tried, key=lambda each: each.cost)

    def _at(self, point: _Point, columns: Sequence[int], values: Array) -> list[_Point]:
        least = np.array([0.0 if c in self.mirrored else -MOST_DEVIATIONS for c in columns])
        moves = [
            point.moves | dict(zip(columns, row, strict=True))
            for row in np.clip(values, least, MOST_DEVIATIONS).tolist()
        ]
        return [_Point(m, e, self.cost(m, e)) for m, e in zip(moves, self._errors(moves), strict=True)]

    def _errors(self, moves: Sequence[Moves]) -> list[Array]:
        """The error (n, 3) that each of these moves leaves; each is simulated only once."""
        keys = [tuple(sorted((c, value) for c, value in each.items() if value)) for each in moves]
        new = {key: each for key, each in zip(keys, moves, strict=True) if key not in self.known}
        if new:
            self.known |= zip(new, self.left(list(new.values())), strict=True)
        return [self.known[key] for key in keys]

    def _mirrored(self, columns: Sequence[int]) -> frozenset[int]:
        """Columns of which both signs have the same effect, such as a height about zero."""
        moved = self._errors([{}, *({c: sign * _TRIED[1]} for c in columns for sign in (1, -1))])
        sides = zip(columns, moved[1::2], moved[2::2], strict=True)
        return frozenset(c for c, a, b in sides if np.array_equal(a, b) and not np.array_equal(a, moved[0]))

    def _white(self, error: Array) -> Array:
        means = block_means(error)
        return np.asarray(means.reshape(*means.shape[:-2], -1) @ self.root.T)


def explain(
    error: Array, off: Array, right: RightModel, names: Sequence[str], assumed: Sequence[str], left: Left, length: Array
) -> Explanation:
    """The inputs that would explain an error (n, 3) along and across the path, and what they leave unexplained.

    First inputs are moved one by one, the most probable first, until the error that remains may be a right model's, no
    other input makes it more probable, or three are moved. From there all inputs are moved together, each on its own or
    all deviations by one factor, and the most probable result counts.

    Parameters
    ----------
    off : ndarray (k, n, 3)
        Draws of the measurement's error, measured minus true.
    names : sequence of str
        Name of the input of each column of the draws.
    assumed : sequence of str
        Inputs of which neither value nor deviation was stated.
    left : callable
        Simulates the run with moved inputs, see :data:`Left`.
    length : ndarray (n,)
        Length of the path so far [m].
    """
    search = _Search(off, right, names, assumed, left)
    point, moved, others = _few(search, error)
    instead = {name: value for p, columns in others for name, value in _named(p.moves, columns, names).items()}
    factor = 1.0
    if moved or right.rejects(error):
        modes, free = search.modes([point, *(other for other, _ in others)])
        if modes:
            best = min(modes, key=lambda mode: mode.cost)
            moved, instead = _most_probable(modes, best, free, 0.0 if right.rejects(error) else _NAMED)
            point, factor = _Point({}, best.error, best.cost), best.factor
    explained = bool(moved) and not right.rejects(point.error)
    farthest = max(map(abs, moved.values()), default=0.0)
    of_no_use = farthest >= MOST_DEVIATIONS or rms_length(point.error) >= rms_length(error)
    if not moved or (not explained and of_no_use):  # it fits a part of the error with implausible inputs
        point, moved, instead, factor = _Point({}, error, 0.0), {}, {}, 1.0
    begins, ends = place(point.error, right, length)
    return Explanation(
        moved, explained, rms_length(error), rms_length(point.error), begins, ends,
        tuple(name for name in {**moved, **instead} if name in assumed), instead, factor,
    )  # fmt: skip


def _most_probable(
    modes: Sequence[Mode], best: Mode, names: Sequence[str], least: float
) -> tuple[dict[str, float], dict[str, float]]:
    """The inputs that are to blame, and those that may be instead of the first, with their deviations in ``best``.

    To blame are the inputs that are far off with the probability :data:`_NAMED`, or else the most probable one. With
    that probability the first or one of the others is far off; these are as few as that takes, and with the first at
    most :data:`_MOST_INPUTS`. None is to blame where the first is less probable than ``least``.
    """
    off = off_by_name(modes, names)
    ranked = sorted(off, key=lambda name: -off[name].mean())
    if not ranked or off[ranked[0]].mean() < least:
        return {}, {}
    sure = [name for name in ranked if off[name].mean() >= _NAMED] or ranked[:1]
    found, none = [ranked[0]], ~off[ranked[0]]
    while len(found) < min(_MOST_INPUTS, len(off)) and none.mean() > 1 - _NAMED:
        found.append(max((name for name in off if name not in found), key=lambda name: np.mean(none & off[name])))
        none &= ~off[found[-1]]
    farthest = dict[str, float]()
    for name, value in zip(names, best.off.tolist(), strict=True):
        farthest[name] = max(farthest.get(name, 0.0), value, key=abs)
    return {name: farthest[name] for name in sure}, {name: farthest[name] for name in found[1:]}


_Others = list[tuple[_Point, list[int]]]


def _few(search: _Search, error: Array) -> tuple[_Point, dict[str, float], _Others]:
    """The best point with few groups of inputs moved, and their moves by name.

    Where one group is enough, also the points with their columns that are about as probable as the best.
    """
    right, point, chosen = search.right, _Point({}, error, search.cost({}, error)), list[list[int]]()
    others: _Others = []
    while len(chosen) < _MOST_INPUTS and not (chosen and not right.rejects(point.error)):
        groups = [columns for columns in search.groups if columns not in chosen]
        tried = [(search.from_grid(point, columns), columns) for columns in groups]
        tried = sorted(tried, key=lambda each: each[0].cost)[:_REFINED]
        refined = [(search.better(each, [*chain(*chosen), *columns]), columns) for each, columns in tried]
        better = sorted((e for e in refined if e[0].cost < point.cost), key=lambda each: each[0].cost)
        if not better:
            break
        others = [] if chosen else _as_probable(better)
        point = better[0][0]
        chosen.append(better[0][1])
    return point, _named(point.moves, [*chain(*chosen)], search.names), others


def _as_probable(tried: _Others) -> _Others:
    """The points after the first, as many as it takes for one of all to be right with the probability :data:`_NAMED`.

    All are taken as equally probable before the run was seen; the best come first.
    """
    weight = np.exp(-0.5 * np.array([point.cost - tried[0][0].cost for point, _ in tried]))
    return tried[1 : int(np.searchsorted(np.cumsum(weight) / weight.sum(), _NAMED)) + 1]


def _named(moves: Moves, columns: Sequence[int], names: Sequence[str]) -> dict[str, float]:
    """Moved inputs by name, each with the largest move of its columns, the farthest off first."""
    moved: dict[str, float] = {}
    for column in columns:
        if moves.get(column):
            moved[names[column]] = max(moved.get(names[column], 0.0), moves[column], key=abs)
    return dict(sorted(moved.items(), key=lambda item: -abs(item[1])))


def _groups(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Inputs that are moved together: those of one effect; every other input is moved alone."""
    together = [effect.inputs for effect in EFFECTS if sum(name in names for name in effect.inputs) > 1]
    alone = [name for name in dict.fromkeys(names) if not any(name in group for group in together)]
    return [*together, *((name,) for name in alone)]


def _is_stated(name: str) -> bool:
    """Whether the user states the deviation of an input; the others are computed from data, and tested there."""
    return name not in INPUTS or INPUTS[name].stated is not None


def _wobble(error: Array) -> Array:
    """Mean square (...,) of the position about its block means [m²]."""
    return np.asarray(np.mean(np.sum(about_block_means(error[..., :2]) ** 2, axis=-1), axis=-1))
