"""Which inputs, moved by how many of their deviations, would explain the error of a run, and what would remain.

A search among few inputs: one after the other is moved in the scene, and the run is simulated again, since an input far
off its value does not act as one within its deviation does. Of all that is tried the most probable is named: it leaves
an error of the kind that the others make, and is not far off for what was stated of it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from scipy.special import gammaln

from towval.model import Array
from towval.model.geometry import block_means, signature_blocks, signature_entries
from towval.model.inputs import INPUTS
from towval.model.statement import Explanation
from towval.validation.consequences import WIDER
from towval.validation.effects import EFFECTS
from towval.validation.statistics import RightModel

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
        self.assumed = [name in assumed for name in names]
        self.root = np.linalg.cholesky(right.weight).T
        self.measured = float(np.mean(self._drift(off))), float(np.mean(_wobble(off)))
        known = set(right.columns.tolist())
        # A covariance has many columns (the camera's 18): those that the error does not depend on are not tried.
        open_ = [c for c, name in enumerate(names) if c in known or (name in INPUTS and INPUTS[name].stated)]
        self.mirrored = self._mirrored(open_)
        self.groups = [[c for c in open_ if names[c] in group] for group in _groups(names)]

    def cost(self, moves: Moves, error: Array) -> float:
        """Twice the negative logarithm of a probability density; lower is more probable.

        Of errors of unknown size: what remains is drawn from the draws' covariance times an unknown factor, on the
        block means (72 values) and about them (one value a block: an oscillation has one amplitude there). Nothing is
        gained below what the measurement does.
        """
        if not np.isfinite(error).all():
            return np.inf
        drift, wobble = float(self._drift(error)), float(_wobble(error))
        size = 72 * np.log(drift + self.measured[0]) + 24 * np.log(wobble + self.measured[1])
        return float(size) + sum(_surprise(value, self.assumed[c]) for c, value in moves.items() if value)

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
            grid = [values for values in product((0.0, *_TRIED), repeat=len(columns)) if any(values)]
        else:
            grid = [tuple(row) for row in np.kron(np.r_[_TRIED, np.negative(_TRIED)][:, None], np.eye(len(columns)))]
        return min(self._at(point, columns, np.array(grid)), key=lambda each: each.cost)

    def _at(self, point: _Point, columns: Sequence[int], values: Array) -> list[_Point]:
        least = np.array([0.0 if c in self.mirrored else -_MOST_DEVIATIONS for c in columns])
        moves = [
            point.moves | dict(zip(columns, row, strict=True))
            for row in np.clip(values, least, _MOST_DEVIATIONS).tolist()
        ]
        return [_Point(m, e, self.cost(m, e)) for m, e in zip(moves, self.left(moves), strict=True)]

    def _mirrored(self, columns: Sequence[int]) -> frozenset[int]:
        """Columns that act by their size: heights and the like, about zero."""
        moved = self.left([{}, *({c: sign * 3.0} for c in columns for sign in (1, -1))])
        sides = zip(columns, moved[1::2], moved[2::2], strict=True)
        return frozenset(c for c, a, b in sides if np.array_equal(a, b) and not np.array_equal(a, moved[0]))

    def _white(self, error: Array) -> Array:
        means = block_means(error)
        return np.asarray(means.reshape(*means.shape[:-2], -1) @ self.root.T)

    def _drift(self, error: Array) -> Array:
        """Weighted square of the block means."""
        return np.asarray(np.sum(self._white(error) ** 2, axis=-1))


def explain(
    error: Array, off: Array, right: RightModel, names: Sequence[str], assumed: Sequence[str], left: Left, length: Array
) -> Explanation:
    """What would explain an error (n, 3), along and across the path.

    One input after the other is moved, the most probable first, until the remainder is what a right model leaves, no
    other is probable, or three are moved.

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
    point, chosen = _Point({}, error, search.cost({}, error)), list[list[int]]()
    while len(chosen) < _MOST_INPUTS and not (chosen and not right.rejects(point.error)):
        groups = [columns for columns in search.groups if columns and columns not in chosen]
        tried = [(search.from_grid(point, columns), columns) for columns in groups]
        tried = sorted(tried, key=lambda each: each[0].cost)[:_REFINED]
        tried = [(search.better(each, [*chain(*chosen), *columns]), columns) for each, columns in tried]
        best, columns = min(tried, key=lambda each: each[0].cost, default=(point, []))
        if not best.cost < point.cost:
            break
        point = best
        chosen.append(columns)
    moved: dict[str, float] = {}
    for column in chain(*chosen):
        name = names[column]
        moved[name] = max(moved.get(name, 0.0), point.moves[column], key=abs)
    moved = dict(sorted(moved.items(), key=lambda item: -abs(item[1])))
    begins, ends = place(point.error, right, length)
    return Explanation(
        moved, bool(chosen) and not right.rejects(point.error), _rms(error), _rms(point.error), begins, ends,
        tuple(name for name in moved if name in assumed),
    )  # fmt: skip


def place(error: Array, right: RightModel, length: Array) -> tuple[float, float]:
    """Between which lengths of the path [m] an error (n, 3) begins that is none of a right model; NaN where it is one.

    The entry of the signature that exceeds its limit and ends first says when the error shows; a change also says since
    when it has grown.
    """
    normalised = right.signature(error).max(axis=1)
    exceeding = [e for e, value in zip(signature_entries(), normalised, strict=True) if value > right.limits[1]]
    if not exceeding:
        return float("nan"), float("nan")
    first = min(exceeding, key=lambda entry: (entry.last, -entry.first))
    blocks = signature_blocks(len(length))
    return float(length[blocks[first.first][-1]]), float(length[blocks[first.last][-1]])


def _groups(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Inputs that are moved together: those of one effect, and each other by itself."""
    together = [effect.inputs for effect in EFFECTS if sum(name in names for name in effect.inputs) > 1]
    alone = [name for name in dict.fromkeys(names) if not any(name in group for group in together)]
    return [*together, *((name,) for name in alone)]


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
    blocks = (error[..., rows, :2] for rows in signature_blocks(error.shape[-2]))
    return np.asarray(sum(np.var(block, axis=-2).sum(axis=-1) * block.shape[-2] for block in blocks) / error.shape[-2])


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(error[:, :2] ** 2, axis=1))))
