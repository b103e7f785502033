"""Integration of a :class:`~towval.physics.motion.MotionProblem` over time: step control, events, outputs, compiled.

Slack to taut and back are events: within a step the rates are those of one mode and smooth; a step at whose end, or
inside which, the other mode should have taken over is cut at that moment and taken again. While slack a step never
covers more than the hinge and the anchor need to close the gap (or a quarter of a piece of the hinge's spline,
inside which the margin is looked at sixteen times), so that the moment of tightening cannot be stepped over.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.friction_table import PLATEAU, SLOPE
from towval.physics.motion import SLACK, TAUT, MotionProblem, acceleration_slopes, accelerations, margin, tautness
from towval.physics.rosenbrock import NODES, STAGES, dense_output, end_of_step, solve_stage, stage_matrix, stage_state
from towval.physics.splines import piece_at
from towval.physics.steps import GROW, following, least_step, retried, safe_time, step_to_stop

REACHED_END, STEP_LIMIT, STEP_TOO_SMALL, NOT_FINITE = 0, 1, 2, 3

SMALLEST_STEP = 1e-14
"""Of the time span."""

LOOKS, LOOKS_SLACK = 4, 16
"""How often a step is looked at for a change between slack and taut: what is slack may tighten for a moment only."""


class March(NamedTuple):
    """An integration: its motion over which times, where it is, and arrays that it writes to.

    ``weights`` (6,) are the errors of a step that are accepted; ``states`` (n, 6) and ``modes`` (n,) are those at the
    ``times`` (n,); ``y`` (6,) is the state; ``counts`` (3,) are steps, rejections, changes between slack and taut. A
    step writes to the rest: the state after it, stage state and rates, increments, slopes, their inverse.
    """

    scene: MotionProblem
    times: Array
    weights: Array
    states: Array
    modes: NDArray[np.int64]
    y: Array
    counts: NDArray[np.int64]
    y1: Array
    stage_y: Array
    rates0: Array
    rates: Array
    k: Array
    jacobian: Array
    time_slope: Array
    inverse: Array
    scratch: Array


def march_from(scene: MotionProblem, start: Array, times: Array, weights: Array) -> March:
    """An integration from a state (6,) at ``times[0]``."""
    return March(
        scene=scene,
        times=times,
        weights=weights,
        states=np.empty((len(times), 6)),
        modes=np.zeros(len(times), dtype=np.int64),
        y=start.copy(),
        counts=np.zeros(3, dtype=np.int64),
        y1=np.empty(6),
        stage_y=np.empty(6),
        rates0=np.empty(6),
        rates=np.empty(6),
        k=np.empty((STAGES, 6)),
        jacobian=np.empty((3, 6)),
        time_slope=np.empty(3),
        inverse=np.empty((3, 3)),
        scratch=np.empty((3, 3)),
    )


@compiled(allocates=False)
def integrate(march: March, mode: int, step_limit: int) -> tuple[int, int]:
    """Integrate and fill states and modes at the times; returns the outcome and the number of times filled."""
    scene, times, y, counts = march.scene, march.times, march.y, march.counts
    t, end, piece = times[0], times[-1], 0
    span = end - t
    filled = _report(march, mode, t, t, span, 0)
    rise = scene.patch.table[PLATEAU] / scene.patch.table[SLOPE]
    h, growth, fresh, last_h, last_error = 1e-6 * span, GROW, True, 0.0, 0.0
    while filled < len(times):
        if counts[0] + counts[1] >= step_limit:
            return STEP_LIMIT, filled
        piece = piece_at(scene.drive.knots, t, piece)
        if fresh:
            acceleration_slopes(scene, mode, t, piece, y, march.rates0, march.jacobian, march.time_slope)
            if not finite(march.rates0, march.jacobian):
                return NOT_FINITE, filled
        h = min(h, step_to_stop(y, march.rates0, scene.patch.radius, rise))
        h = min(h, end - t, _slack_step(scene, t, piece, y) if mode == SLACK else np.inf)
        if h < SMALLEST_STEP * span:
            return STEP_TOO_SMALL, filled
        error = _step(march, mode, t, h, piece)
        if not error <= 1:
            counts[1] += 1
            h, growth, fresh = retried(h, error), 1.0, False
            continue
        next_h = following(h, error, growth, last_h, last_error)
        last_h, last_error = h, error
        theta = _first_crossing(march, mode, t, h, piece)
        if theta < 1:
            h *= theta
            _step(march, mode, t, h, piece)
        t1 = t + h if t + h < end - SMALLEST_STEP * span else end
        filled = _report(march, mode, t, t1, h, filled)
        if theta < 1:
            mode = SLACK if mode == TAUT else TAUT
            counts[2] += 1
            last_h = 0.0
        for i in range(6):
            y[i] = march.y1[i]
        counts[0] += 1
        t, h, growth, fresh = t1, next_h, GROW, True
    return REACHED_END, filled


@compiled(allocates=False)
def _report(march: March, mode: int, t: float, t1: float, h: float, filled: int) -> int:
    """Fill states and modes at the times up to ``t1`` by dense output; at ``t`` itself with the state there."""
    times, states, y = march.times, march.states, march.y
    while filled < len(times) and times[filled] <= t1:
        theta = (times[filled] - t) / h
        if theta > 0:
            dense_output(theta, y, march.y1, march.k, states[filled])
        else:
            for i in range(6):
                states[filled, i] = y[i]
        march.modes[filled] = mode
        filled += 1
    return filled


@compiled(allocates=False)
def _step(march: March, mode: int, t: float, h: float, piece: int) -> float:
    """One step into ``march.y1``; returns the error over the weights (root mean square), infinite where it failed."""
    if not stage_matrix(h, march.jacobian, march.inverse, march.scratch):
        return np.inf
    scene, y, stage_y, rates, k = march.scene, march.y, march.stage_y, march.rates, march.k
    for i in range(6):
        rates[i], stage_y[i] = march.rates0[i], y[i]
    for stage in range(STAGES):
        if stage > 0:
            stage_state(stage, y, k, stage_y)
            stage_time = t + NODES[stage] * h
            piece = piece_at(scene.drive.knots, stage_time, piece)
            accelerations(scene, mode, stage_time, piece, stage_y, rates)
        solve_stage(stage, h, march.jacobian, march.inverse, march.time_slope, rates, k)
    return end_of_step(stage_y, k, march.weights, march.y1)


@compiled(allocates=False)
def finite(rates: Array, jacobian: Array) -> bool:
    """Whether all rates (6,) and slopes (3, 6) are finite."""
    total = 0.0
    for i in range(6):
        total += rates[i]
        for j in range(3):
            total += jacobian[j, i]
    return math.isfinite(total)


@compiled(allocates=False)
def _slack_step(scene: MotionProblem, t: float, piece: int, y: Array) -> float:
    """Longest step [s] in which hinge and anchor cannot close the gap, at least the least step of the drive."""
    # A distance: the margin of the mode is a pull over κ where the tether is damped, and may be far more.
    _, stretch, _ = tautness(scene, t, piece, y)
    gap = max(0.0, -stretch)
    anchor = math.hypot(y[3], y[4]) + abs(y[5]) * math.hypot(scene.body[4], scene.body[5])
    return max(least_step(scene.drive, t, piece), safe_time(scene.drive, t, piece, gap, anchor))


@compiled(allocates=False)
def _first_crossing(march: March, mode: int, t: float, h: float, piece: int) -> float:
    """Fraction of the step at which the other mode takes over; 1 where it does not."""
    low, looks = 0.0, LOOKS_SLACK if mode == SLACK else LOOKS
    for look in range(1, looks + 1):
        high = look / looks
        if _margin_at(march, mode, t, h, high, piece) >= 0:
            low = high
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            if _margin_at(march, mode, t, h, middle, piece) >= 0:
                low = middle
            else:
                high = middle
            if (high - low) * h < 1e-15 * (1 + abs(t)):
                break
        return high
    return 1.0


@compiled(allocates=False)
def _margin_at(march: March, mode: int, t: float, h: float, theta: float, piece: int) -> float:
    dense_output(theta, march.y, march.y1, march.k, march.stage_y)
    scene, time = march.scene, t + theta * h
    return margin(scene, mode, time, piece_at(scene.drive.knots, time, piece), march.stage_y)
