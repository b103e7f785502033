"""Curves over the floor by arc length, and the timed paths made of them.

The four curves of the paper (section 3.1) have closed forms and so has their arc length; any other curve goes through
given points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.special import ellipk, ellipkinc

from towval.model import Array, TimedPath, locked
from towval.model.errors import InputError

SPLINE_NODES_PER_SPAN = 12
"""Gauss nodes for the length of one span of a spline: its speed is the root of a quartic, smooth where it moves."""


@dataclass(frozen=True)
class Curve:
    """A curve in the plane, parametrised by its arc length.

    ``length`` [m]; ``closed`` True when it ends where it begins; ``position_at`` maps arc lengths (n,) [m] in
    [0, length] to positions (n, 2) [m]; ``tightest_radius`` [m] the smallest radius of curvature, infinite for a line
    and zero where there is a kink.
    """

    name: str
    length: float
    closed: bool
    position_at: Callable[[Array], Array]
    tightest_radius: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.length) and self.length > 0):
            raise InputError(f"the curve {self.name} has no length", got=self.length, allowed="a length above zero [m]")


def line(length: float, direction: float = np.pi / 4) -> Curve:
    """Straight line of a length [m] from the origin, along ``direction`` [rad]; the paper's is 1.4 m, diagonal."""
    _require_positive(length, "line length")
    unit = np.array([np.cos(direction), np.sin(direction)])
    return Curve("line", float(length), False, lambda s: s[:, None] * unit, np.inf)


def circle(radius: float) -> Curve:
    """Circle about the origin, counter-clockwise from (radius, 0) [m]; the paper's has 1 m."""
    _require_positive(radius, "circle radius")

    def position_at(s: Array) -> Array:
        return radius * np.stack([np.cos(s / radius), np.sin(s / radius)], axis=-1)

    return Curve("circle", 2 * np.pi * radius, True, position_at, float(radius))


def lemniscate(width: float) -> Curve:
    """Bernoulli's lemniscate of a width [m], from its right tip upwards; the paper's is 2 m wide.

    With half width a, ``x = a cos τ/(1 + sin²τ)``, ``y = x sin τ``. Its arc length is an elliptic integral,
    ``s = a F(τ | −1)``, inverted here by Newton's method; the tightest radius, a/3, is at the tips.
    """
    _require_positive(width, "lemniscate width")
    half = width / 2
    quarter = float(ellipk(-1.0))

    def position_at(s: Array) -> Array:
        lemniscatic = s / half
        angle = lemniscatic * (np.pi / 2 / quarter)
        for _ in range(8):  # quadratic convergence from within 0.05 rad: five steps reach rounding
            angle = angle - (ellipkinc(angle, -1.0) - lemniscatic) * np.sqrt(1 + np.sin(angle) ** 2)
        scale = half * np.cos(angle) / (1 + np.sin(angle) ** 2)
        return np.stack([scale, scale * np.sin(angle)], axis=-1)

    return Curve("lemniscate", 4 * half * quarter, True, position_at, half / 3)


def rounded_square(side: float, corner_radius: float) -> Curve:
    """Square about the origin with rounded corners, counter-clockwise from the middle of its lower side.

    Parameters
    ----------
    side : float
        Side of the square before rounding [m]; 4 m in the paper.
    corner_radius : float
        Radius of the quarter circles at the corners [m], at most half the side.
    """
    _require_positive(side, "square side")
    if not 0 < corner_radius <= side / 2:
        raise InputError(
            "the corner radius does not fit the square",
            got=corner_radius,
            allowed=f"above zero and at most {side / 2} m, half the side",
        )
    straight, arc = side - 2 * corner_radius, np.pi / 2 * corner_radius
    quarter = straight + arc

    def position_at(s: Array) -> Array:
        # Each quarter is the same piece, turned: half a side, a corner, half a side.
        index = np.minimum(np.floor(s / quarter), 3)
        local = s - index * quarter
        angle = np.clip((local - straight / 2) / corner_radius, 0.0, np.pi / 2)
        after = np.maximum(local - straight / 2 - arc, 0.0)
        x = np.minimum(local, straight / 2) + corner_radius * np.sin(angle)
        y = -side / 2 + corner_radius * (1 - np.cos(angle)) + after
        turn = index * np.pi / 2
        return np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)], axis=-1)

    return Curve("rounded_square", 4 * quarter, True, position_at, float(corner_radius))


def through_points(points: ArrayLike, *, smooth: bool = True, name: str = "points") -> Curve:
    """Curve through given points: a cubic spline over the chord length, or a polyline with its kinks.

    Parameters
    ----------
    points : array_like (n, 2)
        Points in their order [m], neighbours apart from each other. The curve is closed, with a smooth seam, when the
        last point is the first.
    smooth : bool, optional
        Whether to lay a spline; three points at least. Without, straight lines join the points.
    name : str, optional
        What to call the curve.

    Raises
    ------
    InputError
        When there are too few points or neighbours coincide.
    """
    points = locked(points, f"points of the curve {name}", (None, 2))
    least = 3 if smooth else 2
    if len(points) < least:
        raise InputError(f"the curve {name} has too few points", got=len(points), allowed=f"{least} or more")
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if (chords == 0).any():
        where = int(np.argmin(chords))
        raise InputError(
            f"points {where} and {where + 1} of the curve {name} coincide", remedy="drop one of each pair of equals"
        )
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    closed = bool(np.array_equal(points[0], points[-1]))
    if not smooth:
        return Curve(name, float(knots[-1]), closed, lambda s: _along_polyline(s, knots, points), 0.0)
    return _spline_curve(name, CubicSpline(knots, points, bc_type="periodic" if closed else "natural"), closed)


def _along_polyline(s: Array, knots: Array, points: Array) -> Array:
    return np.stack([np.interp(s, knots, points[:, axis]) for axis in range(2)], axis=-1)


def _spline_curve(name: str, spline: CubicSpline, closed: bool) -> Curve:
    velocity, acceleration = spline.derivative(), spline.derivative(2)
    nodes, weights = np.polynomial.legendre.leggauss(SPLINE_NODES_PER_SPAN)

    def length_between(start: Array, end: Array) -> Array:
        half = (end - start) / 2
        at = (start + half)[:, None] + half[:, None] * nodes
        return half * (np.linalg.norm(velocity(at), axis=-1) @ weights)

    lengths = np.concatenate([[0.0], np.cumsum(length_between(spline.x[:-1], spline.x[1:]))])

    def position_at(s: Array) -> Array:
        span = np.clip(np.searchsorted(lengths, s, side="right") - 1, 0, len(lengths) - 2)
        start = spline.x[span]
        parameter = np.interp(s, lengths, spline.x)
        for _ in range(8):
            excess = lengths[span] + length_between(start, parameter) - s
            parameter = parameter - excess / np.linalg.norm(velocity(parameter), axis=-1)
        return spline(parameter)

    dense = np.linspace(spline.x[0], spline.x[-1], 32 * len(spline.x))
    (vx, vy), (ax, ay) = velocity(dense).T, acceleration(dense).T
    bend = np.abs(vx * ay - vy * ax)
    radius = np.hypot(vx, vy)[bend > 0] ** 3 / bend[bend > 0]
    return Curve(name, float(lengths[-1]), closed, position_at, float(radius.min(initial=np.inf)))


def timed(
    curve: Curve, time_step: float, *, mean_speed: float | None = None, duration: float | None = None
) -> TimedPath:
    """A point's way along a curve at constant speed.

    Parameters
    ----------
    curve : Curve
        Where it goes.
    time_step : float
        Step of the path [s]; the last step is the same as the others, so the duration is rounded to full steps.
    mean_speed, duration : float, optional
        Speed [m/s] or time from end to end [s]: one of the two.

    Returns
    -------
    TimedPath
        From time zero, both ends included.
    """
    if (mean_speed is None) == (duration is None):
        raise InputError("a timed path needs its mean speed or its duration", allowed="one of the two")
    if duration is None:
        _require_positive(mean_speed, "mean speed of the path")
        duration = curve.length / mean_speed
    _require_positive(duration, "duration of the path")
    _require_positive(time_step, "time step of the path")
    steps = max(round(duration / time_step), 1)
    arc_length = np.linspace(0.0, curve.length, steps + 1)
    return TimedPath(np.arange(steps + 1) * time_step, curve.position_at(arc_length))


def path_heading(position: ArrayLike) -> Array:
    """Heading of a polyline at its points (n,) [rad], unwrapped, from its central differences.

    ``position`` (n, 2) [m]; two points at least.
    """
    tangent = np.gradient(np.asarray(position, dtype=np.float64), axis=0)
    return np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))


def moving_average(values: ArrayLike, half_window: int) -> Array:
    """Moving average over a symmetric window of 2 × ``half_window`` steps.

    SOURCE: eq. (21). ASSUME: toward both ends the window shrinks on both sides alike, so that it stays symmetric and
    the first and the last value are kept; the paper does not say what it does there.

    Parameters
    ----------
    values : array_like (n,)
        What to average.
    half_window : int
        ϑ_lh in steps, zero or more; zero leaves the values as they are.

    Returns
    -------
    ndarray (n,)
        The averages.
    """
    values = np.asarray(values, dtype=np.float64)
    n = len(values)
    if half_window < 0:
        raise InputError("the look-ahead of the orientation is negative", got=half_window, allowed="zero or more steps")
    index = np.arange(n)
    half = np.minimum(half_window, np.minimum(index, n - 1 - index))
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])
    return values[0] + (total[index + half + 1] - total[index - half]) / (2 * half + 1)


def distance_to_polyline(points: ArrayLike, polyline: ArrayLike) -> Array:
    """Distances (n,) [m] of points (n, 2) from a polyline (m, 2).

    The nearest corner is looked up and the two segments that meet there are measured: exact as long as the segments
    are short beside the bends of the polyline, as those of a sampled path are.
    """
    points, polyline = np.asarray(points, dtype=np.float64), np.asarray(polyline, dtype=np.float64)
    _, corner = cKDTree(polyline).query(points)
    nearest = np.full(len(points), np.inf)
    for neighbour in (corner - 1, corner + 1):
        start, end = polyline[corner], polyline[np.clip(neighbour, 0, len(polyline) - 1)]
        along = end - start
        squared = np.sum(along**2, axis=1)
        share = np.sum((points - start) * along, axis=1) / np.where(squared > 0, squared, 1.0)
        foot = start + np.clip(share, 0.0, 1.0)[:, None] * along
        nearest = np.minimum(nearest, np.linalg.norm(points - foot, axis=1))
    return nearest


def deviation_rms(actual: ArrayLike, nominal: ArrayLike) -> float:
    """Root mean square distance between two paths (n, 2) and (m, 2) as curves, whatever their timing [m].

    ASSUME: a rover at constant speed that cuts corners is ahead of its schedule, so positions are not compared at
    equal times. Taken is the larger of two root mean squares: of the actual path from the nominal one (excursions)
    and of the nominal path from the actual one (what was left out).
    """
    there = np.sqrt(np.mean(distance_to_polyline(actual, nominal) ** 2))
    back = np.sqrt(np.mean(distance_to_polyline(nominal, actual) ** 2))
    return float(max(there, back))


def _require_positive(value: float, name: str) -> None:
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"the {name} is out of range", got=value, allowed="a finite number above zero")
