"""Cubic splines of time that compiled code can read: the way of the hinge, or a force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from towval.errors import InputError
from towval.physics.compiling import compiled
from towval.types import Array, Path


class Spline(NamedTuple):
    """Piecewise cubic of time in the plane.

    ``knots`` (n + 1,) strictly increasing [s]; ``coefficients`` (n, 2, 4) of ascending powers of the time since the
    piece's start; ``speed_limits`` (n,) a bound of the derivative's magnitude on each piece. Before the first and
    after the last knot the outer pieces go on.
    """

    knots: Array
    coefficients: Array
    speed_limits: Array


def spline_through(path: Path) -> Spline:
    """The smooth cubic spline through the points of a path (not-a-knot; straight between two points).

    Raises
    ------
    InputError
        When the path has fewer than two points.
    """
    n = len(path.time_s)
    if n < 2:
        raise InputError("a path of one point cannot be followed", got=f"{n} points", allowed="two points or more")
    return spline_from(CubicSpline(path.time_s, path.position, bc_type="not-a-knot" if n > 3 else "natural"))


def spline_from(curve: CubicSpline) -> Spline:
    """A scipy spline with two components, laid out for compiled code."""
    coefficients = np.ascontiguousarray(np.moveaxis(curve.c[::-1], (0, 1, 2), (2, 0, 1)))
    length = np.diff(curve.x)[:, None]
    magnitude = np.linalg.norm(coefficients, axis=1)
    limits = (magnitude[:, 1:] * np.array([1.0, 2.0, 3.0]) * length ** np.arange(3)).sum(axis=1)
    return Spline(curve.x.copy(), coefficients, limits)


def spline_covering(way: Path | CubicSpline, times: Array, name: str) -> Spline:
    """The spline of a path, or a spline as it is, after a check that it covers the times.

    Raises
    ------
    InputError
        When a time lies outside.
    """
    spline = spline_through(way) if isinstance(way, Path) else spline_from(way)
    first, last = spline.knots[0], spline.knots[-1]
    slip = 1e-9 * (last - first)
    if times[0] < first - slip or times[-1] > last + slip:
        raise InputError(
            f"{name} does not cover the times to report",
            got=f"times {times[0]} to {times[-1]} s, {name} {first} to {last} s",
            allowed="times within",
        )
    return spline


@compiled()
def piece_at(knots: Array, time: float, hint: int) -> int:
    """Number of the piece that holds a time, searched from a hint."""
    last = len(knots) - 2
    k = min(max(hint, 0), last)
    while k < last and time >= knots[k + 1]:
        k += 1
    while k > 0 and time < knots[k]:
        k -= 1
    return k


@compiled()
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
