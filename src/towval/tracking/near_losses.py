"""Pictures lost so near each other that each hides the other: a cubic through the pictures around one meets both.

One body may slip so by itself, so that all have to show it.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array

SIDE = 4
"""Pictures on each side of a step through which a cubic is laid."""
_LOST = 1.0, 2.0  # Pictures, in a step.


def misfit(time_s: Array, place: Array, extra: ArrayLike) -> Array:
    """Sum of squares (m,) about cubics through places (m, 8, 2), the middle step being longer by so many usual ones."""
    since = time_s - time_s[:, :1]
    since[:, SIDE:] += np.asarray(extra)[..., None] * np.median(np.diff(time_s, axis=1), axis=1)[:, None]
    basis, _ = np.linalg.qr((since / np.abs(since).max(axis=1, keepdims=True))[:, :, None] ** np.arange(4))
    left = place - basis @ (basis.transpose(0, 2, 1) @ place)
    return np.asarray(np.sum(left**2, axis=(1, 2)))


def lost_in_two(
    time_s: Array, bodies: Sequence[tuple[Array, float]], better: float, each_better: float, goes_on: float
) -> NDArray[np.bool_]:
    """Whether pictures were lost in the middle step of eight pictures (m, 8), and in another one of their steps.

    ``bodies``: places (m, 8, 2) and usual misfit of each. All together have to fit ``better`` by so many times with
    both steps that much longer, and each by itself by ``each_better`` times, its usual misfit left aside. Bodies that
    are tied together start and stop together, at once, or held back by a codec, and two longer steps fit that as well:
    so each has to go as far before the middle step as after it, or that share of it at least, and the other way round.
    """

    def misfits(times_s: Array, extra: float) -> Array:
        return np.array([np.nan_to_num(misfit(times_s, place, extra) / usual) for place, usual in bodies])

    as_stamped, found = misfits(time_s, 0), np.zeros(len(time_s), dtype=bool)
    usual_s = np.median(np.diff(time_s, axis=1), axis=1)[:, None]
    for beside, lost, extra in product(np.delete(np.arange(1, 2 * SIDE), SIDE - 1), _LOST, _LOST):
        otherwise = misfits(time_s + lost * usual_s * (np.arange(2 * SIDE) >= beside), extra)
        by_each = (1 + as_stamped > each_better * (1 + otherwise)).all(axis=0)
        found |= by_each & (as_stamped.sum(axis=0) > better * otherwise.sum(axis=0))
    for place, _ in bodies:
        gone = [np.linalg.norm(place[:, last] - place[:, first], axis=1) for first, last in ((0, SIDE - 1), (SIDE, -1))]
        found &= np.minimum(*gone) >= goes_on * np.maximum(*gone)
    return found & (len(bodies) > 1)
