"""Cubic splines of time that compiled code can read: the way of the hinge, or a force."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from towval.model import Array, TimedPath
from towval.model.compiling import compiled
from towval.model.errors import InputError

if TYPE_CHECKING:
    # Not at run time: scipy.interpolate takes as long to import as all the rest of the physics.
    from scipy.interpolate import CubicSpline


class Spline(NamedTuple):
    """Piecewise cubic of time in the plane.

    ``knots`` (n + 1,) strictly increasing [s]; ``coefficients`` (n, 2, 4) of ascending powers of the time since the
    piece's start; ``speed_limits`` (n,) a bound of the derivative's magnitude on each piece. Before the first and
    after the last knot the outer pieces go on.
    """

    knots: Array
    coefficients: Array
    speed_limits: Array


def spline_through(path: TimedPath) -> Spline:
    """The smooth cubic spline through the points of a path.

    Its third derivative is continuous at the second and the last but one point ("not a knot"); with three points the
    ends are not curved, with two it is straight.

    Raises
    ------
    InputError
        When the path has fewer than two points.
    """
    n = len(path.time_s)
    if n < 2:
        raise InputError("a path of one point cannot be followed", got=f"{n} points", allowed="two points or more")
    length = np.diff(path.time_s)
    slope = np.diff(path.position, axis=0) / length[:, None]
    curvature = np.zeros((n, 2))
    if n > 2:
        _solve_curvatures(length, slope, curvature)
    coefficients = np.empty((n - 1, 2, 4))
    _lay_out_pieces(path.position, length, slope, curvature, coefficients)
    return _laid_out(path.time_s.copy(), coefficients)


def spline_from(curve: CubicSpline) -> Spline:
    """A scipy spline of third degree with two components, laid out for compiled code."""
    if curve.c.shape[0] != 4 or curve.c.shape[2:] != (2,):
        raise InputError("the spline has the wrong shape", got=curve.c.shape, allowed="cubic, with 2 columns: x and y")
    return _laid_out(np.array(curve.x, dtype=np.float64), np.moveaxis(curve.c[::-1], (0, 1, 2), (2, 0, 1)))


def _laid_out(knots: Array, coefficients: Array) -> Spline:
    coefficients = np.ascontiguousarray(coefficients)
    speed_limits = np.empty(len(coefficients))
    _bound_speeds(knots, coefficients, speed_limits)
    return Spline(knots, coefficients, speed_limits)


@compiled(allocates=False)
def _lay_out_pieces(position: Array, length: Array, slope: Array, curvature: Array, coefficients: Array) -> None:
    """Fill ``coefficients`` (n, 2, 4) from points, lengths and slopes of the pieces, and second derivatives."""
    for i in range(len(length)):
        for k in range(2):
            start, end = curvature[i, k], curvature[i + 1, k]
            coefficients[i, k, 0] = position[i, k]
            coefficients[i, k, 1] = slope[i, k] - length[i] * (2 * start + end) / 6
            coefficients[i, k, 2] = start / 2
            coefficients[i, k, 3] = (end - start) / (6 * length[i])


@compiled(allocates=False)
def _bound_speeds(knots: Array, coefficients: Array, speed_limits: Array) -> None:
    """Fill ``speed_limits`` (n,): the magnitudes of the derivative's terms at the end of each piece, summed."""
    for i in range(len(coefficients)):
        length, x, y = knots[i + 1] - knots[i], coefficients[i, 0], coefficients[i, 1]
        first = math.sqrt(x[1] * x[1] + y[1] * y[1])
        second = math.sqrt(x[2] * x[2] + y[2] * y[2])
        third = math.sqrt(x[3] * x[3] + y[3] * y[3])
        speed_limits[i] = first + length * (2 * second + length * 3 * third)


@compiled()
def _solve_curvatures(length: Array, slope: Array, curvature: Array) -> None:
    """Second derivatives at the points (n, 2), from the lengths and slopes of the pieces; n is three or more.

    A tridiagonal system for the inner points, by elimination; it is diagonally dominant.
    """
    n = len(curvature)
    diagonal, above = np.empty(n), np.empty(n)
    for i in range(1, n - 1):
        left, right = length[i - 1], length[i]
        below, diagonal[i], above[i] = left, 2 * (left + right), right
        # Not a knot: the end's value lies on the line through its two neighbours.
        if i == 1 and n > 3:
            diagonal[i] += left + left * left / right
            above[i] -= left * left / right
        if i == n - 2 and n > 3:
            diagonal[i] += right + right * right / left
            below -= right * right / left
        factor = below / diagonal[i - 1] if i > 1 else 0.0
        diagonal[i] -= factor * above[i - 1] if i > 1 else 0.0
        for k in range(2):
            curvature[i, k] = 6 * (slope[i, k] - slope[i - 1, k]) - factor * curvature[i - 1, k]
    curvature[n - 1] = 0.0
    for i in range(n - 2, 0, -1):
        for k in range(2):
            following = above[i] * curvature[i + 1, k] if i < n - 2 else 0.0
            curvature[i, k] = (curvature[i, k] - following) / diagonal[i]
    for k in range(2):
        if n > 3:
            first, last = length[0] / length[1], length[n - 2] / length[n - 3]
            curvature[0, k] = curvature[1, k] + first * (curvature[1, k] - curvature[2, k])
            curvature[n - 1, k] = curvature[n - 2, k] + last * (curvature[n - 2, k] - curvature[n - 3, k])


def spline_covering(path: TimedPath | CubicSpline, times: Array, name: str) -> Spline:
    """The spline of a path, or a spline as it is, after a check that it covers the times.

    Raises
    ------
    InputError
        When a time lies outside.
    """
    if not isinstance(path, TimedPath) and not (hasattr(path, "c") and hasattr(path, "x")):
        raise InputError(f"{name} is of the wrong type", got=type(path).__name__, allowed="TimedPath or CubicSpline")
    spline = spline_through(path) if isinstance(path, TimedPath) else spline_from(path)
    first, last = spline.knots[0], spline.knots[-1]
    slip = 1e-9 * (last - first)
    if times[0] < first - slip or times[-1] > last + slip:
        raise InputError(
            f"{name} does not cover the times to report",
            got=f"times {times[0]} to {times[-1]} s, {name} {first} to {last} s",
            allowed="times within",
        )
    return spline


def spline_values(spline: Spline, times: Array) -> tuple[Array, Array]:
    """Values and derivatives (n, 2) of a spline at times (n,)."""
    piece = np.clip(np.searchsorted(spline.knots, times, side="right") - 1, 0, len(spline.coefficients) - 1)
    s = (times - spline.knots[piece])[:, None]
    c0, c1, c2, c3 = np.moveaxis(spline.coefficients[piece], -1, 0)
    return c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2 * c2 + s * 3 * c3)


@compiled(allocates=False)
def piece_at(knots: Array, time: float, hint: int) -> int:
    """Number of the piece that holds a time, searched from a hint."""
    last = len(knots) - 2
    k = min(max(hint, 0), last)
    while k < last and time >= knots[k + 1]:
        k += 1
    while k > 0 and time < knots[k]:
        k -= 1
    return k


@compiled(allocates=False)
def spline_at(
    knots: Array, coefficients: Array, time: float, k: int
) -> tuple[float, float, float, float, float, float]:
    """Value, first and second derivative (x, y each) of piece ``k`` at a time."""
    s = time - knots[k]
    c = coefficients[k]
    return (
        c[0, 0] + s * (c[0, 1] + s * (c[0, 2] + s * c[0, 3])),
        c[1, 0] + s * (c[1, 1] + s * (c[1, 2] + s * c[1, 3])),
        c[0, 1] + s * (2 * c[0, 2] + s * 3 * c[0, 3]),
        c[1, 1] + s * (2 * c[1, 2] + s * 3 * c[1, 3]),
        2 * c[0, 2] + 6 * s * c[0, 3],
        2 * c[1, 2] + 6 * s * c[1, 3],
    )
