"""Steps of a body from picture to picture that wheels or a tether cannot make, looked for in its whole track."""

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Finding
from towval.model.findings import finding
from towval.model.geometry import compose, inverse
from towval.tracking.planar_target import PlanarTarget

_DEVIATIONS = 3.0  # Of the poses' own: one stray in some hundreds is beyond by chance.


def strays(time_s: Array, pose: Array, reach_m: float) -> Array:
    """How far the third of three poses in a row is from where the twist between the first two leads (n - 2,) [m].

    A bound for any point within ``reach_m`` of the body's origin; NaN where one of the three poses (n, 3) is.
    """
    length = np.diff(time_s)
    step = compose(inverse(pose[:-2]), pose[1:-1]) * (length[1:] / length[:-1])[:, None]
    off = compose(inverse(compose(pose[1:-1], step)), pose[2:])
    return np.asarray(np.hypot(off[:, 0], off[:, 1]) + reach_m * np.abs(off[:, 2]))


def stray_std(time_s: Array, covariance: Array, reach_m: float) -> Array:
    """Deviation (n - 2,) [m] of :func:`strays` that poses of covariances (n, 3, 3) have by themselves."""
    variance, length = np.einsum("nii->ni", covariance), np.diff(time_s)
    on = (length[1:] / length[:-1])[:, None]
    x, y, heading = (variance[2:] + (1 + on) ** 2 * variance[1:-1] + on**2 * variance[:-2]).T
    return np.asarray(np.sqrt(x + y) + reach_m * np.sqrt(heading))


def jump_findings(target: PlanarTarget, time_s: Array, pose: Array, covariance: Array, most_m: Array) -> list[Finding]:
    """The finding of a body whose poses (n, 3) stray beyond what motion explains (n - 2,) [m], if they do.

    Poses that are known to be unsure, by their ``covariance`` (n, 3, 3), stray without a jump of the body.
    """
    stray_m = strays(time_s, pose, target.reach_m)
    unsure_m = _DEVIATIONS * stray_std(time_s, covariance, target.reach_m)
    beyond: NDArray[np.bool_] = stray_m > most_m + unsure_m
    # The picture after a jump strays as well, from where the jump would have gone on.
    first = np.flatnonzero(beyond & ~np.append(False, beyond[:-1]))
    if not len(first):
        return []
    by_mm = 1e3 * stray_m[first].max()
    return [finding("jumped", name=target.body.name, count=len(first), by_mm=by_mm, time_s=time_s[first[0] + 2])]
