"""Integration of a :class:`~towval.physics.motion.Scene` over time: step control, events, outputs, compiled.

Slack to taut and back are events: within a step the rates are those of one mode and smooth; a step at whose end, or
inside which, the other mode should have taken over is cut at that moment and taken again. While slack a step never
covers more than the hinge and the anchor need to close the gap (or a quarter of a piece of the hinge's spline,
inside which the margin is looked at five times), so that the moment of tightening cannot be stepped over.
"""

from __future__ import annotations

import math

import numpy as np

from towval.physics.compiling import compiled
from towval.physics.motion import SLACK, TAUT, Scene, acceleration_slopes, accelerations, margin
from towval.physics.rosenbrock import NODES, ORDER, STAGES, A, dense_output, solve_stage, stage_matrix
from towval.physics.splines import piece_at
from towval.types import Array

REACHED_END, STEP_LIMIT, STEP_TOO_SMALL, NOT_FINITE = 0, 1, 2, 3

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 6.0
_SMALLEST_STEP = 1e-14  # of the time span
_LOOKS = 4  # a step's margin is looked at this often


@compiled()
def integrate(
    scene: Scene, mode: int, y: Array, times: Array, weights: Array, step_limit: int, states: Array, modes: Array
) -> tuple[int, int, Array]:
    """Integrate from ``times[0]`` and fill ``states`` (n, 6) and ``modes`` (n,) at the times.

    ``weights`` (6,) are the errors of a step that are accepted. Returns the outcome, the number of times filled, and
    counts: steps, rejections, changes between slack and taut.
    """
    y, y1, stage_y, rates = y.copy(), np.empty(6), np.empty(6), np.empty(6)
    k, jacobian, inverse, scratch, time_slope = (
        np.empty((STAGES, 6)),
        np.empty((3, 6)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
    )
    knots = scene.drive.knots
    t, end, filled, piece = times[0], times[-1], 1, 0
    span = end - t
    states[0], modes[0] = y, mode
    counts = np.zeros(3, dtype=np.int64)
    h, growth, fresh = 1e-6 * span, _GROW, True
    rates0 = np.empty(6)
    while filled < len(times):
        if counts[0] + counts[1] >= step_limit:
            return STEP_LIMIT, filled, counts
        piece = piece_at(knots, t, piece)
        if fresh:
            acceleration_slopes(scene, mode, t, piece, y, rates0, jacobian, time_slope)
            if not (np.isfinite(rates0).all() and np.isfinite(jacobian).all()):
                return NOT_FINITE, filled, counts
        last_step = t + h >= end
        if last_step:
            h = end - t
        if mode == SLACK:
            limit = _slack_step(scene, t, piece, y)
            if limit < h:
                h, last_step = limit, False
        if h < _SMALLEST_STEP * span:
            return STEP_TOO_SMALL, filled, counts
        error = _step(
            scene, mode, t, h, piece, y, y1, stage_y, rates0, rates, k, jacobian, inverse, scratch, time_slope, weights
        )
        if not error <= 1:
            counts[1] += 1
            h *= max(_SHRINK, _SAFETY * error ** (-1 / ORDER)) if np.isfinite(error) else 0.1
            growth, fresh = 1.0, False
            continue
        theta = _first_crossing(scene, mode, t, h, piece, y, y1, k, stage_y)
        uncut = h
        if theta < 1:
            h *= theta
            _step(
                scene,
                mode,
                t,
                h,
                piece,
                y,
                y1,
                stage_y,
                rates0,
                rates,
                k,
                jacobian,
                inverse,
                scratch,
                time_slope,
                weights,
            )
            last_step = False
        t1 = end if last_step else t + h
        while filled < len(times) and times[filled] <= t1:
            dense_output((times[filled] - t) / h, y, y1, k, states[filled])
            modes[filled] = mode
            filled += 1
        counts[0] += 1
        t = t1
        y[:] = y1
        fresh = True
        if theta < 1:
            mode = SLACK if mode == TAUT else TAUT
            counts[2] += 1
        h = uncut * min(growth, max(_SHRINK, _SAFETY * max(error, 1e-12) ** (-1 / ORDER)))
        growth = _GROW
    return REACHED_END, filled, counts


@compiled()
def _step(
    scene: Scene,
    mode: int,
    t: float,
    h: float,
    piece: int,
    y: Array,
    y1: Array,
    stage_y: Array,
    rates0: Array,
    rates: Array,
    k: Array,
    jacobian: Array,
    inverse: Array,
    scratch: Array,
    time_slope: Array,
    weights: Array,
) -> float:
    """One step into ``y1`` with increments ``k``; returns the error over the weights, infinite where it failed."""
    if not stage_matrix(h, jacobian, inverse, scratch):
        return np.inf
    knots = scene.drive.knots
    rates[:] = rates0
    solve_stage(0, h, jacobian, inverse, time_slope, rates, k)
    for stage in range(1, STAGES):
        if stage < 6:
            for i in range(6):
                total = y[i]
                for j in range(stage):
                    total += A[stage, j] * k[j, i]
                stage_y[i] = total
        else:
            for i in range(6):
                stage_y[i] += k[stage - 1, i]
        stage_time = t + NODES[stage] * h
        piece = piece_at(knots, stage_time, piece)
        accelerations(scene, mode, stage_time, piece, stage_y, rates)
        solve_stage(stage, h, jacobian, inverse, time_slope, rates, k)
    error = 0.0
    for i in range(6):
        y1[i] = stage_y[i] + k[STAGES - 1, i]
        ratio = k[STAGES - 1, i] / weights[i]
        error += ratio * ratio
    return math.sqrt(error / 6)


@compiled()
def _slack_step(scene: Scene, t: float, piece: int, y: Array) -> float:
    """Longest step [s] in which hinge and anchor cannot close the gap, at least a quarter of the spline's piece."""
    knots, limits = scene.drive.knots, scene.drive.speed_limits
    gap = margin(scene, SLACK, t, piece, y)
    anchor = math.hypot(y[3], y[4]) + abs(y[5]) * math.hypot(scene.body[4], scene.body[5])
    floor = (knots[piece + 1] - knots[piece]) / 4
    safe, now = 0.0, t
    for k in range(piece, len(limits)):
        duration = knots[k + 1] - now if k < len(limits) - 1 else np.inf
        closing = (limits[k] + anchor) * duration
        if closing >= gap:
            return max(floor, safe + gap / (limits[k] + anchor))
        gap -= closing
        safe += duration
        now = knots[k + 1]
    return np.inf


@compiled()
def _first_crossing(
    scene: Scene, mode: int, t: float, h: float, piece: int, y: Array, y1: Array, k: Array, state: Array
) -> float:
    """Fraction of the step at which the other mode takes over; 1 where it does not.

    A margin that starts at zero (the step before ended on an event) counts once it has become clearly positive.
    """
    knots = scene.drive.knots
    low = 0.0
    for look in range(1, _LOOKS + 1):
        high = look / _LOOKS
        if _margin_at(scene, mode, t, h, high, knots, piece, y, y1, k, state) >= 0:
            low = high
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            if _margin_at(scene, mode, t, h, middle, knots, piece, y, y1, k, state) >= 0:
                low = middle
            else:
                high = middle
            if (high - low) * h < 1e-15 * (1 + abs(t)):
                break
        return high
    return 1.0


@compiled()
def _margin_at(
    scene: Scene,
    mode: int,
    t: float,
    h: float,
    theta: float,
    knots: Array,
    piece: int,
    y: Array,
    y1: Array,
    k: Array,
    state: Array,
) -> float:
    if theta < 1:
        dense_output(theta, y, y1, k, state)
    else:
        state[:] = y1
    time = t + theta * h
    return margin(scene, mode, time, piece_at(knots, time, piece), state)
