"""Distances between two motions of a body as single numbers: discrete Fréchet distance, area metric, aligned error."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import rigid_fit, rms_length, transform

_AREA_STEPS = 2000
_AREA_REACH = 6.0
_AREA_AT_ONCE = 1000  # times, which bounds the memory that a long run takes


def frechet_distance(path: ArrayLike, other: ArrayLike) -> float:
    """Discrete Fréchet distance of paths (n, 2), (m, 2) [m]: the shortest leash with which both can be walked forwards.

    SOURCE: Eiter and Mannila, Computing discrete Fréchet distance, 1994. Unlike the largest distance at equal times it
    does not count a delay along the same path. `InputError` where a path is empty or a point is missing.
    """
    path, other = np.asarray(path, dtype=np.float64), np.asarray(other, dtype=np.float64)
    if not (len(path) and len(other) and np.isfinite(path).all() and np.isfinite(other).all()):
        raise InputError("the Fréchet distance needs two whole paths", allowed="one finite point or more each")
    n, m = len(path), len(other)
    # No pair farther apart than the leash of a walk at even shares of both matters: of long paths a band is left.
    even = np.linspace(0, 1, max(n, m))[:, None] * [n - 1, m - 1]
    first, second = np.rint(even).astype(int).T
    most = np.hypot(*(path[first] - other[second]).T).max()
    # The shortest leash that reaches each pair of points, by diagonals, whose pairs do not depend on each other; a row
    # is the points of ``path``, after one that cannot be passed.
    rows = np.full((3, n + 1), np.inf)
    rows[1, 0] = -np.inf
    reached = [(0, -1), (-1, -1)]  # first and last point of ``path`` that the last diagonal and that before reach
    written = [slice(0, 1)] * 3
    for diagonal in range(n + m - 1):
        here, before, reach = (rows[(diagonal + shift) % 3] for shift in range(3))
        low = max(0, diagonal - m + 1, min(reached[0][0], reached[1][0] + 1))
        high = min(diagonal, n - 1, max(reached[0][1], reached[1][1]) + 1)
        i, after = slice(low, high + 1), slice(low + 1, high + 2)
        distance = np.hypot(*(path[i] - other[diagonal - high : diagonal - low + 1][::-1]).T)
        leash = np.maximum(np.minimum(np.minimum(reach[i], reach[after]), before[i]), distance)
        leash[leash > most] = np.inf
        here[written[diagonal % 3]] = np.inf
        here[after], written[diagonal % 3] = leash, after
        there = np.flatnonzero(leash < np.inf)
        span = (low + int(there[0]), low + int(there[-1])) if len(there) else (n, -1)
        reached = [span, reached[0]]
    return float(leash[-1])


def area_metric(error: ArrayLike, std: ArrayLike) -> float:
    """Area between the distribution of an error over time and the one that its deviations predict, in the error's unit.

    SOURCE: Ferson, Oberkampf and Ginzburg, Model validation and predictive capability for the thermal challenge
    problem, 2008: ``d = ∫ |F(x) − S(x)| dx``. S is the empirical distribution function of the error (n,), F the mean of
    the normal ones with the deviations (n,) at the same times. Zero for an error that scatters as predicted; ``|b|``
    for a constant error b without uncertainty. It grows where the error is too large and, more slowly, where it is
    smaller than predicted. Missing errors are left out; NaN where all are.
    """
    error, std = np.asarray(error, dtype=np.float64), np.asarray(std, dtype=np.float64)
    known = np.isfinite(error) & np.isfinite(std)
    errors, stds = np.sort(error[known]), std[known]
    if not len(errors):
        return float("nan")
    reach = max(float(np.abs(errors).max()), _AREA_REACH * float(stds.max()))
    if reach == 0:
        return 0.0
    edges = np.linspace(-reach, reach, _AREA_STEPS + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    empirical = np.searchsorted(errors, middle, side="right") / len(errors)
    # A deviation of zero gives a step, which a tiny one represents as well.
    stds = np.maximum(stds, 1e-12 * reach)
    parts = np.array_split(stds, -(-len(stds) // _AREA_AT_ONCE))
    predicted = sum(ndtr(middle[:, None] / part).sum(axis=1) for part in parts) / len(stds)
    return float(np.abs(predicted - empirical).sum() * (edges[1] - edges[0]))


def aligned_rms(simulated: ArrayLike, measured: ArrayLike) -> float:
    """Root mean square distance [m] after the rigid motion of the whole path that minimises it.

    It hides every error that a shift and a turn of the floor frame explain; so it is shown with the unaligned one.

    ``simulated``, ``measured`` (n, 2): positions at the same times [m], all finite. NaN for fewer than two: a single
    one is brought anywhere.
    """
    simulated, measured = np.asarray(simulated, dtype=np.float64), np.asarray(measured, dtype=np.float64)
    if len(simulated) < 2:
        return float("nan")
    return rms_length(transform(rigid_fit(simulated, measured), simulated) - measured)


def error_ratio(error: ArrayLike, covariance: ArrayLike) -> Array:
    """|E| / u_val of the position over time (n,) [1], with u_val = √(σ_x² + σ_y²) at that time.

    ``error`` (n, 3) is simulated minus measured pose, ``covariance`` (n, 3, 3) that of a right model's error. NaN where
    the error is missing, and where u_val is below a hundredth of its root mean square: until the object moves, the
    simulation is set to the measured pose, and a ratio of tiny numbers means nothing.
    """
    error, covariance = np.asarray(error, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
    distance = np.linalg.norm(error[:, :2], axis=1)
    allowed = np.sqrt(np.trace(covariance[:, :2, :2], axis1=1, axis2=2))
    known = allowed > 0.01 * np.sqrt(np.mean(allowed**2))
    ratio: Array = np.divide(distance, allowed, out=np.full(len(distance), np.nan), where=known)
    return ratio
