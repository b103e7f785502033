"""Step size control of the integrators: from the errors of the last two steps, and not beyond a stop.

When friction brings an object to rest, its law reverses within the last few millimetres per second, which the error
estimate of the step before cannot see: on a run with stick-slip more than a quarter of all steps failed there. The
present acceleration predicts the stop.

Where the drive bends, its acceleration jumps, which violates the assumptions of order and error estimate. Steps across
a bend fail, and in three dimensions the object may tip in them, which is expensive to detect. So steps end at bends.
"""

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.rosenbrock import ORDER
from towval.physics.splines import Spline, spline_at

SHRINK, GROW = 0.2, 6.0
"""A step is this many times the last at least and at most."""

_SAFETY = 0.9
_TREND = 0.7  # 0: the next error equals the last, 1: it changes by the same ratio again; measured: fewest failures
_LEAST_ERROR = 1e-4  # below, the trend of errors is that of rounding
# Share of the time to the stop that a step may take. With 0.6 two steps fail where one does with 0.5; 0.4 saves none.
_TO_STOP = 0.5
_HEAD_ON = 0.1  # square of the sine of the angle between velocity and deceleration, below which it is a stop
_ABOVE_RISE = 2.0  # speeds of rise above which friction is steady; below, it is linear and no step too long


_AT_ONCE = 1e-3  # of a step: a bend as near is where the step begins
_VELOCITY_RATE = 10.0  # 1/s; a velocity may be wrong by the position tolerance times this
# If friction rises over a speed, or the tether reaches the friction force over a stretch, below these, tolerances are
# tightened in proportion: otherwise the forces would not be resolved and the result silently wrong.
_FINE_SPEED, _FINE_STRETCH = 1e-3, 1e-2  # m/s, m


def error_scales(rise: float, stretch: float, radius: float) -> Array:
    """Errors of the state (6,) that weigh as much as a metre of position.

    ``rise`` [m/s], over which friction rises; ``stretch`` [m] in which the tether takes up friction, infinite without
    one; ``radius`` of the footprint [m].
    """
    position = min(1.0, stretch / _FINE_STRETCH) * np.array([1.0, 1.0, 1 / radius])
    return np.concatenate([position, position * min(1.0, rise / _FINE_SPEED) * _VELOCITY_RATE])


@compiled(allocates=False)
def safe_time(drive: Spline, t: float, piece: int, gap: float, anchor_speed: float) -> float:
    """Time [s] that the drive, at the speed limits of its spline, and the anchor need to close a gap [m]."""
    knots, limits = drive.knots, drive.speed_limits
    safe: float = 0.0
    now = t
    for k in range(piece, len(limits)):
        duration = knots[k + 1] - now if k < len(limits) - 1 else np.inf
        speed = limits[k] + anchor_speed
        closing = speed * duration
        if closing >= gap:
            safe += gap / speed
            return safe
        gap -= closing
        safe += duration
        now = knots[k + 1]
    return np.inf


@compiled(allocates=False)
def least_step(drive: Spline, t: float, piece: int) -> float:
    """A quarter of the drive's piece [s], in which it can do little; from its last quarter on one of the next as well.

    No farther, since a piece that follows may be far shorter: after a pause all of a motion there and back.
    """
    knots = drive.knots
    quarter: float = (knots[piece + 1] - knots[piece]) / 4
    if piece + 2 < len(knots):
        quarter = min(quarter, max(knots[piece + 1] - t, 0.0) + (knots[piece + 2] - knots[piece + 1]) / 4)
    return quarter


@compiled(allocates=False)
def bend_ahead(drive: Spline, t: float, piece: int, h: float, least: float) -> float:
    """Time [s] of the first knot within a step at which the drive bends so that it is led off by ``least`` [m].

    Infinite where there is none.
    """
    knots, coefficients = drive.knots, drive.coefficients
    for k in range(piece, len(coefficients) - 1):
        knot: float = knots[k + 1]
        left = t + h - knot
        if left <= 0:
            break
        _, _, _, _, x_before, y_before = spline_at(knots, coefficients, knot, k)
        jump_x, jump_y = 2 * coefficients[k + 1, 0, 2] - x_before, 2 * coefficients[k + 1, 1, 2] - y_before
        if left * left * math.sqrt(jump_x * jump_x + jump_y * jump_y) > 2 * least and knot > t + _AT_ONCE * h:
            return knot
    return math.inf


@compiled(allocates=False)
def retried(h: float, error: float) -> float:
    """Step to try after one that failed with an error over what is accepted."""
    shorter: float = h * (max(SHRINK, _SAFETY * error ** (-1 / ORDER)) if math.isfinite(error) else 0.1)
    return shorter


@compiled(allocates=False)
def following(h: float, error: float, growth: float, last_h: float, last_error: float) -> float:
    """Step to try after one that succeeded, ``growth`` times it at most; ``last_h`` is zero where none came before.

    SOURCE: K. Gustafsson, "Control-theoretic techniques for stepsize selection in implicit Runge-Kutta methods", ACM
    Trans. Math. Software 20 (1994): errors that have grown are expected to grow on.
    """
    factor = _SAFETY * max(error, 1e-12) ** (-1 / ORDER)
    if last_h > 0:
        grown = max(last_error, _LEAST_ERROR) / max(error, _LEAST_ERROR)
        factor *= min(1.0, h / last_h * grown ** (_TREND / ORDER))
    longer: float = h * min(growth, max(SHRINK, factor))
    return longer


@compiled(allocates=False)
def step_to_stop(y: Array, rates: Array, radius: float, rise: float) -> float:
    """Longest step [s] towards a stop, infinite where none is ahead.

    ``y`` and ``rates`` (6,) with velocities last; ``radius`` [m] turns rates of turning into speeds; ``rise`` [m/s] is
    the speed over which friction rises.
    """
    r_2 = radius * radius
    speed_2 = y[3] * y[3] + y[4] * y[4] + r_2 * y[5] * y[5]
    along = y[3] * rates[3] + y[4] * rates[4] + r_2 * y[5] * rates[5]
    rate_2 = rates[3] * rates[3] + rates[4] * rates[4] + r_2 * rates[5] * rates[5]
    if along >= 0 or speed_2 < (_ABOVE_RISE * rise) ** 2 or along * along < (1 - _HEAD_ON) * speed_2 * rate_2:
        return math.inf
    step: float = -_TO_STOP * along / rate_2
    return step
