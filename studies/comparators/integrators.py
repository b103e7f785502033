"""Other integrators of the towed object, for comparison: SciPy's methods, and two explicit ones of fixed step.

They share the forces with :mod:`towval.physics` and nothing of its integrator: no separate modes of the tether, no
events, no limit on a step while it is slack.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from towval.model import Array, FrictionLaw, Tether, TimedPath, TowedObject
from towval.model.compiling import compiled
from towval.model.geometry import transform
from towval.physics.dynamics import centre_state, motion_scene
from towval.physics.motion import MotionProblem, acceleration_slopes, accelerations, natural_mode
from towval.physics.splines import piece_at, spline_covering
from towval.physics.wrench import SlidingPatch

SEMI_IMPLICIT_EULER, RUNGE_KUTTA_4 = 1, 4
"""Schemes of :func:`fixed_steps`, named by their order."""

_BLOWN_UP = 1e3  # m


def tethered_scene(
    towed: TowedObject, friction: FrictionLaw | SlidingPatch, tether: Tether, hinge: TimedPath
) -> MotionProblem:
    """The compiled scene of an object behind a hinge."""
    return motion_scene(towed, friction, tether, spline_covering(hinge, hinge.time_s, "the path of the hinge"))


def state_at_rest(towed: TowedObject, pose: ArrayLike) -> Array:
    """State (6,) of the centre of mass of an object at rest."""
    return centre_state(towed, pose, (0.0, 0.0, 0.0))


def poses_of(towed: TowedObject, states: Array) -> Array:
    """Poses (n, 3) of the body frame for states (n, 6)."""
    offset = transform(np.column_stack([np.zeros((len(states), 2)), states[:, 2]]), -towed.centre_of_mass)
    return np.column_stack([states[:, :2] + offset, states[:, 2]])


def scipy_steps(method: str, scene: MotionProblem, start: Array, times: Array, tolerance: float) -> tuple[bool, Array]:
    """Whether SciPy's ``solve_ivp`` calls it a success, and the states (m, 6) at the times that it reached."""

    def rate(t: float, state: Array) -> Array:
        rates = np.empty(6)
        natural_rates(scene, t, state, rates)
        return rates

    solution = solve_ivp(rate, (times[0], times[-1]), start, method, times, rtol=tolerance, atol=tolerance * 0.1)
    return bool(solution.success), solution.y.T


def fixed_steps(scheme: int, scene: MotionProblem, start: Array, times: Array, step_s: float) -> tuple[bool, Array]:
    """Whether the states stayed finite, and the states (n, 6) at the times, NaN from where they did not."""
    states = np.full((len(times), 6), np.nan)
    reached = _march(scheme, scene, start, np.asarray(times, dtype=np.float64), step_s, states)
    return reached == len(times), states


@compiled(allocates=False)
def natural_rates(scene: MotionProblem, time: float, y: Array, out: Array) -> None:
    """Time derivative of the state (6,), slack or taut as the state says."""
    accelerations(scene, natural_mode(scene, time, y), time, piece_at(scene.drive.knots, time, 0), y, out)


@compiled()
def natural_jacobian(scene: MotionProblem, time: float, y: Array, out: Array) -> None:
    """Derivative of the rates by the state (6, 6)."""
    rates, slopes, time_slope = np.empty(6), np.empty((3, 6)), np.empty(3)
    piece = piece_at(scene.drive.knots, time, 0)
    acceleration_slopes(scene, natural_mode(scene, time, y), time, piece, y, rates, slopes, time_slope)
    out[:] = 0.0
    for i in range(3):
        out[i, 3 + i] = 1.0
        for j in range(6):
            out[3 + i, j] = slopes[i, j]


@compiled()
def _march(scheme: int, scene: MotionProblem, start: Array, times: Array, step_s: float, states: Array) -> int:
    y, rates = start.copy(), np.empty((4, 6))
    states[0] = y
    for i in range(1, len(times)):
        count = max(1, int(np.ceil((times[i] - times[i - 1]) / step_s - 1e-9)))
        h = (times[i] - times[i - 1]) / count
        for k in range(count):
            t = times[i - 1] + k * h
            natural_rates(scene, t, y, rates[0])
            if scheme == SEMI_IMPLICIT_EULER:
                y[3:] += h * rates[0, 3:]
                y[:3] += h * y[3:]
            else:
                natural_rates(scene, t + h / 2, y + h / 2 * rates[0], rates[1])
                natural_rates(scene, t + h / 2, y + h / 2 * rates[1], rates[2])
                natural_rates(scene, t + h, y + h * rates[2], rates[3])
                y += h / 6 * (rates[0] + 2 * rates[1] + 2 * rates[2] + rates[3])
            if not np.abs(y).max() < _BLOWN_UP:
                return i
        states[i] = y
    return len(times)
