"""Cubic splines of time that compiled code can read: the path of the hinge, or a force."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, TimedPath
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.geometry import hermite_terms

if TYPE_CHECKING:
    # Not at run time: importing scipy.interpolate takes as long as importing the rest of the physics.
    from scipy.interpolate import CubicSpline


_COINCIDING = 1e-6  # of the longest distance of two points: closer ones are one place
_LONGER = 1.5  # times its neighbours: a turning point takes no longer than an interval
# How far a spline may swing out between two points, over the longest distance of these and their neighbours. On curves
# that are sampled well it is some 0.01, at a turning point 1/8. A pause of three intervals swings by more than 0.5.
_SWING_LIMIT = 0.5
_SLOW = 0.1  # of a neighbour's speed: slow enough to be a pause
# Of the longest distance of two points: where a point and its neighbours are closer than this they are noise about one
# place. Measured poses are some 0.1 mm of noise, kept 10 to 100 mm apart on the way.
_NOISE = 0.02


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
    ends are not curved, with two it is straight. Where the path pauses, it is split: each part comes to rest at the
    pause, and between the two ends of the pause nothing swings. A pause is an interval whose ends coincide, or
    one over which a single spline would swing out and which is slow, or short like the noise of measured points.

    Raises `InputError` when the path has fewer than two points, or when the spline would swing out further between two
    points than these and their neighbours are apart.

    Examples
    --------
    A stop of ten seconds, given by its two ends:

    >>> path = TimedPath([0.0, 1.0, 11.0, 12.0], [[0.0, 0.0], [0.05, 0.0], [0.05, 0.0], [0.1, 0.0]])
    >>> spline_values(spline_through(path), np.array([3.5, 6.0]))[0][:, 0]
    array([0.05, 0.05])
    """
    return _laid_out(path.time_s.copy(), _coefficients_through(path))


def _coefficients_through(path: TimedPath) -> Array:
    n = len(path.time_s)
    if n < 2:
        raise InputError("a path of one point cannot be followed", got=f"{n} points", allowed="two points or more")
    length = np.diff(path.time_s)
    slope = np.diff(path.position, axis=0)
    chord = np.hypot(slope[:, 0], slope[:, 1])
    slope /= length[:, None]
    pauses = _coinciding_ends(length, slope, chord)
    room = np.empty((n, 2, 4))
    coefficients: Array = room[:-1]
    while True:
        _split_at(pauses, path.position, length, slope, room)
        swings = _swings(length, chord, coefficients, slope)
        if swings.max() <= _SWING_LIMIT:
            break
        speed, longest = chord / length, np.maximum(chord, _larger_neighbour(chord))
        may_pause = (speed < _SLOW * _larger_neighbour(speed)) | (longest < _NOISE * chord.max())
        more = (swings > _SWING_LIMIT) & may_pause & ~pauses
        if not more.any():
            break
        pauses |= more
    if swings.max() > _SWING_LIMIT:
        worst = int(swings.argmax())
        raise InputError(
            "the path has too few points to be followed between them",
            got=f"a swing of {swings[worst]:.1f} times the distance of the points near {path.time_s[worst]:.6g} s",
            allowed=f"up to {_SWING_LIMIT}",
            remedy="give more points where the speed changes",
        )
    return coefficients


def _coinciding_ends(length: Array, slope: Array, chord: Array) -> NDArray[np.bool_]:
    """Intervals (n,) whose ends coincide, but for the turning point of a path that goes back on itself.

    Two samples on either side of a turning point may coincide by chance. There the path goes back the way it came,
    after an interval as long as its neighbours; after a pause it goes on, or the interval is longer.
    """
    found: NDArray[np.bool_] = chord <= _COINCIDING * chord.max()
    if found.any():
        before, after = np.roll(slope, 1, axis=0), np.roll(slope, -1, axis=0)
        before[0] = after[-1] = 0.0
        found &= (np.sum(before * after, axis=1) >= 0) | (length >= _LONGER * _larger_neighbour(length))
    return found


def _larger_neighbour(values: Array) -> Array:
    """The larger of the two neighbours of each value (n,); zero stands beyond the ends."""
    larger: Array = np.maximum(np.r_[0.0, values[:-1]], np.r_[values[1:], 0.0])
    return larger


def _swings(length: Array, chord: Array, coefficients: Array, slope: Array) -> Array:
    """How far each piece (n,) leaves its chord, over the longest of its own chord and its neighbours'."""
    aside = np.empty(len(length))
    _leave_chords(length, chord, coefficients, slope, aside)
    return aside


@compiled(allocates=False)
def _leave_chords(length: Array, chord: Array, coefficients: Array, slope: Array, aside: Array) -> None:
    n = len(length)
    for i in range(n):
        longest, farthest = max(chord[max(i - 1, 0)], chord[i], chord[min(i + 1, n - 1)]), 0.0
        x, y = coefficients[i, 0], coefficients[i, 1]
        for share in (0.25, 0.5, 0.75):
            s = share * length[i]
            off_x = s * (x[1] + s * (x[2] + s * x[3])) - s * slope[i, 0]
            off_y = s * (y[1] + s * (y[2] + s * y[3])) - s * slope[i, 1]
            farthest = max(farthest, off_x * off_x + off_y * off_y)
        aside[i] = math.sqrt(farthest) / longest if longest > 0 else 0.0


def _split_at(pauses: NDArray[np.bool_], position: Array, length: Array, slope: Array, room: Array) -> None:
    """Fill in the coefficients of splines between the pauses, at rest where these begin and end.

    ``room`` (n + 1, 2, 4): a row for each of the n pieces, and one for what is known at the last point.
    """
    n = len(length)
    edges = np.flatnonzero(np.diff(np.r_[True, pauses, True].astype(np.int8)))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        part, points = slice(first, end), room[first : end + 1]
        points[0, :, 2] = points[-1, :, 2] = 0.0
        at_rest = (bool(first > 0), bool(end < n))
        if end - first > 1 or any(at_rest):
            _solve_curvatures(length[part], slope[part], at_rest, points)
        _lay_out_pieces(position[first : end + 1], length[part], slope[part], points)
    if pauses.any():  # The ends of a pause, where they do not quite coincide, are joined at rest.
        coefficients = room[:-1]
        coefficients[pauses, :, 0], coefficients[pauses, :, 1] = position[:-1][pauses], 0.0
        coefficients[pauses, :, 2] = 3 * slope[pauses] / length[pauses, None]
        coefficients[pauses, :, 3] = -2 * slope[pauses] / length[pauses, None] ** 2


def spline_from(curve: CubicSpline) -> Spline:
    """A scipy spline of third degree with two components, laid out for compiled code."""
    if curve.c.shape[0] != 4 or curve.c.shape[2:] != (2,):
        raise InputError("the spline has the wrong shape", got=curve.c.shape, allowed="cubic, with 2 columns: x and y")
    return _laid_out(np.array(curve.x, dtype=np.float64), np.moveaxis(curve.c[::-1], (0, 1, 2), (2, 0, 1)))


def hermite_spline(time_s: Array, position: Array, velocity: Array) -> Spline:
    """The C1 cubic through positions (n, 2) with velocities (n, 2) at strictly increasing times (n,) [s].

    Examples
    --------
    >>> spline = hermite_spline(np.array([0.0, 2.0]), np.array([[0.0, 0.0], [1.0, 0.0]]), np.zeros((2, 2)))
    >>> spline_values(spline, np.array([1.0]))[0]
    array([[0.5, 0. ]])
    """
    terms = position[:-1], velocity[:-1], *hermite_terms(time_s, position, velocity)
    return _laid_out(time_s, np.stack(terms, axis=-1))


def _laid_out(knots: Array, coefficients: Array) -> Spline:
    coefficients = np.ascontiguousarray(coefficients)
    if not np.isfinite(coefficients).all():
        # Compiled code would go astray with it.
        first = knots[int(np.argmin(np.isfinite(coefficients).all(axis=(1, 2))))]
        raise InputError("a path goes where no number is", got=f"values that are not finite from {first:.6g} s on")
    speed_limits = np.empty(len(coefficients))
    _bound_speeds(knots, coefficients, speed_limits)
    return Spline(knots, coefficients, speed_limits)


@compiled(allocates=False)
def _lay_out_pieces(position: Array, length: Array, slope: Array, points: Array) -> None:
    """Fill the first rows of ``points`` (n + 1, 2, 4), whose quadratic terms are second derivatives at the points."""
    for i in range(len(length)):
        for k in range(2):
            start, end = points[i, k, 2], points[i + 1, k, 2]
            points[i, k, 0] = position[i, k]
            points[i, k, 1] = slope[i, k] - length[i] * (2 * start + end) / 6
            points[i, k, 2] = start / 2
            points[i, k, 3] = (end - start) / (6 * length[i])


@compiled(allocates=False)
def _bound_speeds(knots: Array, coefficients: Array, speed_limits: Array) -> None:
    """Fill ``speed_limits`` (n,): the magnitudes of the derivative's terms at the end of each piece, summed."""
    for i in range(len(coefficients)):
        length, x, y = knots[i + 1] - knots[i], coefficients[i, 0], coefficients[i, 1]
        first = math.sqrt(x[1] * x[1] + y[1] * y[1])
        second = math.sqrt(x[2] * x[2] + y[2] * y[2])
        third = math.sqrt(x[3] * x[3] + y[3] * y[3])
        speed_limits[i] = first + length * (2 * second + length * 3 * third)


@compiled(allocates=False)
def _solve_curvatures(length: Array, slope: Array, at_rest: tuple[bool, bool], points: Array) -> None:
    """Second derivatives, zero at both ends before, as the quadratic terms of ``points`` (n, 2, 4), from n - 1 pieces.

    A tridiagonal system by elimination; it is diagonally dominant. An end ``at_rest`` has no velocity; another lies on
    the line through its two neighbours ("not a knot"), or is not curved where there are no three pieces to tell.
    """
    n, curvature, ratio = len(points), points[:, :, 2], points[:, 0, 3]
    first, last = length[0] / length[min(1, n - 2)], length[n - 2] / length[max(n - 3, 0)]
    knot_free = n > 3 and not at_rest[0], n > 3 and not at_rest[1]
    ratio[0] = 0.0  # of the entry beside the diagonal to that on it, in a row
    if at_rest[0]:
        ratio[0] = 0.5
        curvature[0, 0], curvature[0, 1] = 3 * slope[0, 0] / length[0], 3 * slope[0, 1] / length[0]
    for i in range(1, n - 1):
        left, right = length[i - 1], length[i]
        below, diagonal, above = left, 2 * (left + right), right
        if i == 1 and knot_free[0]:
            diagonal, above, below = diagonal + left + left * first, above - left * first, 0.0
        if i == n - 2 and knot_free[1]:
            diagonal, below, above = diagonal + right + right * last, below - right * last, 0.0
        pivot = diagonal - below * ratio[i - 1]
        ratio[i] = above / pivot
        for k in range(2):
            curvature[i, k] = (6 * (slope[i, k] - slope[i - 1, k]) - below * curvature[i - 1, k]) / pivot
    if at_rest[1]:
        end = length[n - 2]
        pivot = 2 * end - end * ratio[n - 2]
        for k in range(2):
            curvature[n - 1, k] = (-6 * slope[n - 2, k] - end * curvature[n - 2, k]) / pivot
    for i in range(n - 2, -1, -1):
        for k in range(2):
            curvature[i, k] -= ratio[i] * curvature[i + 1, k]
    for k in range(2):
        if knot_free[0]:
            curvature[0, k] = curvature[1, k] + first * (curvature[1, k] - curvature[2, k])
        if knot_free[1]:
            curvature[n - 1, k] = curvature[n - 2, k] + last * (curvature[n - 2, k] - curvature[n - 3, k])


def spline_covering(path: TimedPath | CubicSpline | Spline, times: Array, name: str) -> Spline:
    """The spline of a path, or a spline as it is, after a check that it covers the times.

    Raises `InputError` when a time lies outside.
    """
    if not isinstance(path, (TimedPath, Spline)) and not (hasattr(path, "c") and hasattr(path, "x")):
        raise InputError(f"{name} is of the wrong type", got=type(path).__name__, allowed="TimedPath or CubicSpline")
    if isinstance(path, Spline):
        spline = path
    else:
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


@compiled(allocates=False, forceinline=True)
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
