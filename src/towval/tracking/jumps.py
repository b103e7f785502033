"""Jumps in a finished track: steps between pictures that show a body, which neither wheels nor a tether can cause."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Finding
from towval.model.findings import finding
from towval.model.geometry import compose, inverse
from towval.tracking.planar_target import PlanarTarget

_DEVIATIONS = 3.0  # Of the poses' own noise, which one step in some hundreds exceeds by chance.


def strays(time_s: Array, pose: Array, reach_m: float) -> Array:
    """Distance of each pose from where the motion between the two poses before it leads (n - 2,) [m].

    An upper bound for any point within ``reach_m`` of the body's origin.
    """
    length = np.diff(time_s)
    step = compose(inverse(pose[:-2]), pose[1:-1]) * (length[1:] / length[:-1])[:, None]
    off = compose(inverse(compose(pose[1:-1], step)), pose[2:])
    return np.asarray(np.hypot(off[:, 0], off[:, 1]) + reach_m * np.abs(off[:, 2]))


def stray_std(time_s: Array, covariance: Array, reach_m: float) -> Array:
    """Standard deviation (n - 2,) [m] of :func:`strays` due to the noise of the poses, of covariances (n, 3, 3)."""
    variance, length = np.einsum("nii->ni", covariance), np.diff(time_s)
    on = (length[1:] / length[:-1])[:, None]
    x, y, heading = (variance[2:] + (1 + on) ** 2 * variance[1:-1] + on**2 * variance[:-2]).T
    return np.asarray(np.sqrt(x + y) + reach_m * np.sqrt(heading))


def jump_findings(
    target: PlanarTarget, time_s: Array, pose: Array, covariance: Array, explained_m: Callable[[Array], Array]
) -> list[Finding]:
    """A finding where poses (n, 3) stray by more than accelerations and their noise explain.

    The poses are those of pictures that show the body, whether or not it was hidden between two of them; ``covariance``
    (n, 3, 3) is theirs. ``explained_m`` tells how far accelerations lead in equal steps of some length [s].
    """
    if len(time_s) < 3:
        return []
    stray_m = strays(time_s, pose, target.reach_m)
    unsure_m = _DEVIATIONS * stray_std(time_s, covariance, target.reach_m)
    before, after = np.diff(time_s)[:-1], np.diff(time_s)[1:]
    # The velocity of a step is that of its middle, from where the next pose is half a step and a whole one away.
    most_m = explained_m(np.sqrt(after * (before + after) / 2))
    beyond: NDArray[np.bool_] = stray_m > most_m + unsure_m
    # The picture after a jump strays as well, from where the jump would have gone on.
    first = np.flatnonzero(beyond & ~np.append(False, beyond[:-1]))
    if not len(first):
        return []
    by_mm = 1e3 * stray_m[first].max()
    return [finding("jumped", name=target.body.name, count=len(first), by_mm=by_mm, time_s=time_s[first[0] + 2])]
