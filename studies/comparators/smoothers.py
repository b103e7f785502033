"""Published ways to smooth and thin a track: smoothing spline, Rauch-Tung-Striebel smoother, Douglas and Peucker."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.interpolate import CubicHermiteSpline, make_smoothing_spline

from towval.model import Array


def smoothing_spline(time_s: Array, values: Array, moments: Array) -> Array:
    """Cubic smoothing splines of the columns of values (n, k) at moments (m,), by generalised cross-validation."""
    return np.column_stack([make_smoothing_spline(time_s, column)(moments) for column in values.T])


def rts_smoother(time_s: Array, values: Array, stds: Array, density: float, moments: Array) -> Array:
    """Columns of values (n, k) under white jerk, smoothed forward and back, at moments (m,).

    SOURCE: Rauch, Tung and Striebel (1965); state of place, velocity and acceleration.

    Parameters
    ----------
    time_s, values, stds : ndarray (n,), (n, k), (k,)
        Times [s], measured values and the deviation of each column.
    density : float
        Spectral density of the jerk, in squared units of a column over s⁵.
    moments : ndarray (m,)
        Times of the result [s].
    """
    smoothed = [_smoothed(time_s, column, std, density) for column, std in zip(values.T, stds, strict=True)]
    return np.column_stack([CubicHermiteSpline(time_s, state[:, 0], state[:, 1])(moments) for state in smoothed])


def _smoothed(time_s: Array, column: Array, std: float, density: float) -> Array:
    """States (n, 3) of one column."""
    count = len(time_s)
    ahead, behind = np.zeros((count, 3)), np.zeros((count, 3))
    known, expected = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    moves = np.zeros((count, 3, 3))
    state, spread = np.array([column[0], 0.0, 0.0]), np.diag([std**2, 1.0, 1.0])
    for k in range(count):
        h = time_s[k] - time_s[k - 1] if k else 0.0
        moves[k] = np.array([1, h, h**2 / 2, 0, 1, h, 0, 0, 1]).reshape(3, 3)
        noise = [[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]]
        behind[k] = moves[k] @ state
        expected[k] = moves[k] @ spread @ moves[k].T + density * np.array(noise)
        gain = expected[k, :, 0] / (expected[k, 0, 0] + std**2)
        state = behind[k] + gain * (column[k] - behind[k, 0])
        spread = expected[k] - np.outer(gain, expected[k, 0])
        ahead[k], known[k] = state, spread
    for k in range(count - 2, -1, -1):
        gain = np.linalg.solve(expected[k + 1], moves[k + 1] @ known[k]).T
        ahead[k] += gain @ (ahead[k + 1] - behind[k + 1])
    return ahead


def douglas_peucker(places: Array, tolerance_m: float) -> Array:
    """Rows of places (n, 2) that Douglas and Peucker keep, whose polygon is nowhere farther than a tolerance [m]."""
    kept = shapely.get_coordinates(shapely.simplify(shapely.LineString(places), tolerance_m, preserve_topology=False))
    rows, at = [], 0
    for place in kept:
        at += int(np.argmax((places[at:] == place).all(axis=1)))
        rows.append(at)
    return np.array(rows)
