"""Curves on the floor by arc length, and trajectories along them.

The four curves of the paper (section 3.1) and their arc lengths have closed forms; any other curve interpolates points.
"""

import math
import numbers
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.special import ellipk, ellipkinc

from towval.model import Array, TimedPath, locked
from towval.model.errors import InputError

STILL = 1e-6
"""Of the largest step of a sampled path: a shorter one is rounding, or the creep of a pause, and has no direction."""

STANDSTILL = 1e-6
"""Speed of a spline over its chord length, about 1, below which it stands: at a turning point, up to rounding."""

SPLINE_NODES_PER_SPAN = 12
"""Gauss nodes for the length of one span of a spline: the speed is the root of a quartic, smooth unless zero."""


@dataclass(frozen=True)
class Curve:
    """A plane curve by arc length.

    ``length`` [m]; ``position_at`` maps arc lengths (n,) [m] in [0, length] to positions (n, 2) [m].
    """

    name: str
    length: float
    position_at: Callable[[Array], Array]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.length) and self.length > 0):
            raise InputError(f"the curve {self.name} has no length", got=self.length, allowed="a length above zero [m]")


def line(length: float, direction: float = np.pi / 4) -> Curve:
    """Straight line of a length [m] from the origin along ``direction`` [rad]; in the paper 1.4 m, diagonal."""
    _require_positive(length, "line length")
    direction = float(locked(direction, "direction of the line", ()))
    unit = np.array([np.cos(direction), np.sin(direction)])
    return Curve("line", float(length), lambda s: s[:, None] * unit)


def circle(radius: float) -> Curve:
    """Circle about the origin, counter-clockwise from (radius, 0) [m]; in the paper of 1 m."""
    _require_positive(radius, "circle radius")

    def position_at(s: Array) -> Array:
        return radius * np.stack([np.cos(s / radius), np.sin(s / radius)], axis=-1)

    return Curve("circle", 2 * np.pi * radius, position_at)


def lemniscate(width: float) -> Curve:
    """Bernoulli's lemniscate of a width [m], from its right tip upwards; in the paper 2 m wide.

    With half width a, ``x = a cos τ/(1 + sin²τ)``, ``y = x sin τ``. Its arc length is an elliptic integral,
    ``s = a F(τ | −1)``, inverted here by Newton's method.
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

    return Curve("lemniscate", 4 * half * quarter, position_at)


def rounded_square(side: float, corner_radius: float) -> Curve:
    """Square about the origin with rounded corners, counter-clockwise from the middle of its lower side.

    ``side`` [m] before rounding, 4 m in the paper; ``corner_radius`` of the quarter circles [m], at most half of it.
    """
    _require_positive(side, "square side")
    _require_positive(corner_radius, "corner radius of the square")
    if corner_radius > side / 2:
        raise InputError(
            "the corner radius does not fit the square",
            got=corner_radius,
            allowed=f"at most {side / 2} m, half the side",
        )
    straight, arc = side - 2 * corner_radius, np.pi / 2 * corner_radius
    quarter = straight + arc

    def position_at(s: Array) -> Array:
        # The quarters differ by rotation: half a side, a corner, half a side.
        index = np.minimum(np.floor(s / quarter), 3)
        local = s - index * quarter
        angle = np.clip((local - straight / 2) / corner_radius, 0.0, np.pi / 2)
        after = np.maximum(local - straight / 2 - arc, 0.0)
        x = np.minimum(local, straight / 2) + corner_radius * np.sin(angle)
        y = -side / 2 + corner_radius * (1 - np.cos(angle)) + after
        turn = index * np.pi / 2
        return np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)], axis=-1)

    return Curve("rounded_square", 4 * quarter, position_at)


def through_points(points: ArrayLike, *, name: str = "points") -> Curve:
    """Curve through points (n, 2) in order [m]: a cubic spline over the chord length, a line through two.

    It is closed, with a smooth seam, if the last point equals the first. Raises `InputError` when there are fewer than
    two points, neighbours coincide, or the curve turns back on itself in a point.
    """
    points = locked(points, f"points of the curve {name}", (None, 2))
    if len(points) < 2:
        raise InputError(f"the curve {name} has too few points", got=len(points), allowed="2 or more")
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if (chords == 0).any():
        where = int(np.argmin(chords))
        raise InputError(f"points {where} and {where + 1} of the curve {name} coincide", remedy="remove one of them")
    knots = np.concatenate([[0.0], np.cumsum(chords)])
    closed = bool(np.array_equal(points[0], points[-1]))
    return _spline_curve(name, CubicSpline(knots, points, bc_type="periodic" if closed else "natural"))


def _spline_curve(name: str, spline: CubicSpline) -> Curve:
    velocity = spline.derivative()
    turns = np.concatenate([spline.x, *velocity.roots(extrapolate=False)])
    turns = turns[np.isfinite(turns)]
    speed = np.linalg.norm(velocity(turns), axis=-1)
    if speed.min() < STANDSTILL:
        x, y = spline(turns[np.argmin(speed)])
        raise InputError(
            f"the curve {name} turns back on itself, where it has no direction",
            got=f"a turning point at ({x:.3g}, {y:.3g}) m",
            remedy="draw the turn as a bend",
        )
    nodes, weights = np.polynomial.legendre.leggauss(SPLINE_NODES_PER_SPAN)

    def length_between(start: Array, end: Array) -> Array:
        half = (end - start) / 2
        at = (start + half)[:, None] + half[:, None] * nodes
        length: Array = half * (np.linalg.norm(velocity(at), axis=-1) @ weights)
        return length

    lengths = np.concatenate([[0.0], np.cumsum(length_between(spline.x[:-1], spline.x[1:]))])

    def position_at(s: Array) -> Array:
        span = np.clip(np.searchsorted(lengths, s, side="right") - 1, 0, len(lengths) - 2)
        start = spline.x[span]
        parameter = np.interp(s, lengths, spline.x)
        for _ in range(8):
            excess = lengths[span] + length_between(start, parameter) - s
            parameter = parameter - excess / np.linalg.norm(velocity(parameter), axis=-1)
        position: Array = spline(parameter)
        return position

    return Curve(name, float(lengths[-1]), position_at)


def timed(
    curve: Curve, time_step: float, *, mean_speed: float | None = None, duration: float | None = None
) -> TimedPath:
    """Trajectory along a curve at constant speed, from time zero, both ends included.

    Given is either the speed [m/s] or the duration [s], which is rounded to full time steps [s].
    """
    if mean_speed is not None and duration is None:
        _require_positive(mean_speed, "mean speed of the path")
        duration = curve.length / mean_speed
    elif mean_speed is not None or duration is None:
        raise InputError("a timed path needs its mean speed or its duration", allowed="one of the two")
    _require_positive(duration, "duration of the path")
    _require_positive(time_step, "time step of the path")
    steps = max(round(duration / time_step), 1)
    arc_length = np.linspace(0.0, curve.length, steps + 1)
    return TimedPath(time_step * np.arange(steps + 1.0), curve.position_at(arc_length))


def path_heading(position: ArrayLike) -> Array:
    """Heading (n,) [rad] of a polyline (n, 2) [m] at its points, unwrapped, by central differences; n ≥ 2.

    Where the path pauses, the heading is that before, or after a pause at the start.
    """
    tangent = np.gradient(_polyline(position, "path", 2), axis=0)
    size = np.linalg.norm(tangent, axis=1)
    moves = size > STILL * size.max()
    latest = np.maximum.accumulate(np.where(moves, np.arange(len(size)), np.argmax(moves)))
    tangent = tangent[latest]
    return np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))


def moving_average(values: ArrayLike, half_window: int) -> Array:
    """Moving average (n,) of values (n,) over a symmetric window of 2 × ``half_window`` steps; zero keeps the values.

    SOURCE: eq. (21). ASSUME: the window shrinks symmetrically toward both ends, so that the first and last values are
    kept; the paper does not say.
    """
    values = locked(values, "values of the moving average", (None,))
    n = len(values)
    if not isinstance(half_window, int | np.integer) or half_window < 0:
        allowed = "a whole number of steps, zero or more"
        raise InputError("the look-ahead of the orientation is out of range", got=half_window, allowed=allowed)
    if not n:
        return values
    index = np.arange(n)
    half = np.minimum(half_window, np.minimum(index, n - 1 - index))
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])
    average: Array = values[0] + (total[index + half + 1] - total[index - half]) / (2 * half + 1)
    return average


def distance_to_polyline(points: ArrayLike, polyline: ArrayLike) -> Array:
    """Distances (n,) [m] of points (n, 2) from a polyline (m, 2).

    From the two segments that meet at the nearest vertex: exact if the segments are short compared to the radii of
    the bends, as on a sampled path.
    """
    points, polyline = _polyline(points, "points", 0), _polyline(polyline, "polyline", 1)
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
    """Root mean square distance [m] between two paths (n, 2) and (m, 2) as curves, regardless of timing.

    ASSUME: a rover at constant speed that cuts corners is ahead of schedule, so positions are not compared at equal
    times. The larger of two root mean squares: of the actual path from the nominal one (excursions) and of the nominal
    path from the actual one (omissions).
    """
    actual, nominal = _polyline(actual, "actual path", 1), _polyline(nominal, "nominal path", 1)
    there = np.sqrt(np.mean(distance_to_polyline(actual, nominal) ** 2))
    back = np.sqrt(np.mean(distance_to_polyline(nominal, actual) ** 2))
    return float(max(there, back))


def _polyline(points: ArrayLike, name: str, least: int) -> Array:
    """Points (n, 2) [m] that can be used, at least so many."""
    points = locked(points, name, (None, 2))
    if len(points) < least:
        raise InputError(f"the {name} has too few points", got=len(points), allowed=f"{least} or more")
    return points


def _require_positive(value: float, name: str) -> None:
    if not isinstance(value, numbers.Real) or not (math.isfinite(value) and value > 0):
        raise InputError(f"the {name} is out of range", got=value, allowed="a finite number above zero")
