"""Which inputs, moved by how many of their deviations, would explain the error of a run, and what would remain."""

from collections.abc import Sequence

import numpy as np

from towval.model import Array
from towval.model.geometry import block_means, signature_blocks, signature_entries
from towval.model.statement import Explanation
from towval.validation.statistics import RightModel

_MOST_INPUTS = 3
_MOST_DEVIATIONS = 10.0
"""An input farther off than that is no explanation."""

_WORTH = 9.0
"""Drop of the weighted square that an input must bring: three of its deviations."""


def explain(error: Array, right: RightModel, names: Sequence[str], length: Array) -> Explanation:
    """What would explain an error (n, 3), by the effects of the inputs on the draws.

    One input after the other is freed of its stated deviation, the one first that takes off most; the others stay as
    uncertain as stated (generalised least squares with the covariance V of all that is drawn). That ends where the
    remainder is what a right model leaves, where the next input brings next to nothing, and with three inputs.

    Parameters
    ----------
    names : sequence of str
        Name of the input of each column of the draws.
    length : ndarray (n,)
        Of the path [m], at the same times.
    """
    means = block_means(error)
    rest, chosen, moved = means.ravel(), list[int](), np.empty(0)
    # How many deviations an input would have to be off for a score of one, were it the only one.
    norm = np.sqrt(np.einsum("jb,bc,jc->j", right.effects, right.weight, right.effects))
    open_ = np.ones(len(norm), dtype=bool)
    while len(chosen) < _MOST_INPUTS and not (chosen and _kept(rest, right)):
        scores = -right.input_scores(rest)
        scores = np.where(right.one_sided, np.maximum(scores, 0.0), scores)
        scores = np.where(open_ & (np.abs(scores) <= _MOST_DEVIATIONS * norm), scores, 0.0)
        if not np.max(scores**2, initial=0.0) > _WORTH:
            break
        best = int(np.argmax(scores**2))
        open_[best] = False
        effects = right.effects[[*chosen, best]]
        weighted = effects @ right.weight
        freed = np.asarray(-np.linalg.solve(weighted @ effects.T, weighted @ means.ravel()))
        less = means.ravel() + freed @ effects
        # What takes off weighted square alone, and leaves a larger error, explains nothing.
        if _rms(less.reshape(-1, 3)) < _rms(rest.reshape(-1, 3)) and np.abs(freed).max() <= _MOST_DEVIATIONS:
            rest, moved = less, freed
            chosen.append(best)
    found: dict[str, float] = {}
    for index, deviations in zip(chosen, moved, strict=True):
        name = names[int(right.columns[index])]
        found[name] = float(np.copysign(np.hypot(found.get(name, 0.0), deviations), deviations))
    begins, ends = place(rest.reshape(-1, 3), right, length)
    return Explanation(found, bool(chosen) and _kept(rest, right), _rms(means), _rms(rest.reshape(-1, 3)), begins, ends)


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


def _kept(rest: Array, right: RightModel) -> bool:
    """Whether block means (72,) are what a right model leaves, in shape and inputs."""
    shape = right.signature(rest.reshape(-1, 3)).max()
    return bool(shape <= right.limits[1] and np.abs(right.input_scores(rest)).max(initial=0.0) <= right.limits[2])


def _rms(means: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(means[:, :2] ** 2, axis=1))))
