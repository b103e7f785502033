"""Integration of a :class:`~towval.physics.spatial.problem.TowProblem`: slack, taut, at rest, and the events between.

As :mod:`towval.physics.integrator`, with one more mode: at rest nothing is integrated. The object stays until the load
exceeds the friction limit (``holding``); that moment is found by regula falsi. It comes to rest once its speed is below
that at which the sliding law has risen and friction can hold it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.friction_table import PLATEAU, SLOPE
from towval.physics.integrator import (
    LOOKS,
    LOOKS_SLACK,
    NOT_FINITE,
    REACHED_END,
    SMALLEST_STEP,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    finite,
)
from towval.physics.motion import FORCED, SLACK, TAUT
from towval.physics.rosenbrock import NODES, STAGES, dense_output, end_of_step, solve_stage, stage_matrix, stage_state
from towval.physics.spatial.hanging import reach_under
from towval.physics.spatial.holding import holding_margin, pull_borne
from towval.physics.spatial.pressure import BALANCED, TIPS
from towval.physics.spatial.problem import (
    ANCHOR_X,
    ANCHOR_Y,
    DAMPING,
    HOLD_SPEED,
    KAPPA,
    RISE,
    STIFFENING,
    TETHER_WEIGHT,
    TowProblem,
)
from towval.physics.spatial.rates import (
    acceleration_slopes,
    accelerations,
    natural_mode,
    tautness,
    tether_pull,
    tether_span,
)
from towval.physics.spatial.soles import RADIUS, Work
from towval.physics.splines import piece_at, spline_at
from towval.physics.steps import GROW, bend_ahead, following, least_step, retried, safe_time, step_to_stop

STUCK = 3
"""At rest, held by friction; beside SLACK, TAUT and FORCED."""
TIPPED_OVER, LIFTED_OFF = 4, 5
"""Further outcomes beside those of the planar integrator."""

_LOOKS_AT_REST = 32  # for the hardest pull of a step that may take up more than friction has to spare
_HELD_AGAIN = 1e-4  # margin at which an object comes to rest: below, it would break away again at once
_SAFE_SHARE = 0.7  # of the margin, that a step at rest may use up: heights change the pressure with the pull
_MOMENT_OF_RELEASE = 1e-9  # margin at which an object breaks away


class March(NamedTuple):
    """An integration: what is towed over which times, where it is, and arrays that it writes to.

    ``forced``: by a force in place of a tether; ``weights`` (6,) are the errors of a step that are accepted; ``states``
    (n, 6) and ``modes`` (n,) are those at the ``times`` (n,), as many as the clock says. ``y`` (6,) is the state,
    ``clock`` (9,) the time, the next step, its growth, …; ``counts`` (5,) are steps, rejections, changes between slack
    and taut, break-aways, checks of whether friction holds.
    """

    problem: TowProblem
    work: Work
    forced: bool
    times: Array
    weights: Array
    states: Array
    modes: NDArray[np.int64]
    y: Array
    clock: Array
    counts: NDArray[np.int64]
    y1: Array
    stage_y: Array
    rates0: Array
    rates: Array
    k: Array
    slopes: Array
    matrices: Array
    twist: Array


# Of the clock; the last two are those of the step before, or zero.
_T, _H, _GROWTH, FILLED, _BALANCE, _PIECE, _MARGIN, _LAST_H, _LAST_ERROR = range(9)


def march_from(problem: TowProblem, work: Work, forced: bool, start: Array, times: Array, weights: Array) -> March:
    """An integration from a state (6,) at ``times[0]``."""
    return March(
        problem=problem,
        work=work,
        forced=forced,
        times=times,
        weights=weights,
        states=np.empty((len(times), 6)),
        modes=np.zeros(len(times), dtype=np.int64),
        y=start.copy(),
        clock=np.zeros(9),
        counts=np.zeros(5, dtype=np.int64),
        y1=np.empty(6),
        stage_y=np.empty(6),
        rates0=np.empty(6),
        rates=np.empty(6),
        k=np.empty((STAGES, 6)),
        slopes=np.empty((4, 6)),
        matrices=np.empty((2, 3, 3)),
        twist=np.zeros(3),
    )


@compiled(allocates=False)
def integrate(march: March, step_limit: int) -> int:
    """Integrate and fill states and modes at the times, as far as it goes; returns the outcome."""
    problem, times, y, clock, counts = march.problem, march.times, march.y, march.clock, march.counts
    span = times[-1] - times[0]
    clock[_T], clock[_H], clock[_GROWTH] = times[0], 1e-6 * span, GROW
    mode = _natural(march)
    if y[3] == 0 and y[4] == 0 and y[5] == 0 and _holds(march, 0.0):
        mode = STUCK
    _report(march, mode, times[0], span)
    fresh = len(times) > 0  # Not the literal True, for which _move would be compiled a second time.
    while clock[FILLED] < len(times):
        if counts[0] + counts[1] >= step_limit:
            return STEP_LIMIT
        if mode == STUCK:
            if _rest(march):
                mode, fresh = _natural(march), True
                clock[_H], clock[_GROWTH], clock[_LAST_H] = 1e-7 * span, GROW, 0.0
            continue
        code, changed, fresh = _move(march, mode, fresh)
        if code != REACHED_END:
            return code
        if changed:
            mode = SLACK if mode == TAUT else TAUT
        speed = math.sqrt(y[3] * y[3] + y[4] * y[4]) + abs(y[5]) * problem.soles.numbers[RADIUS]
        slow = fresh and speed < problem.numbers[HOLD_SPEED]
        if slow and _holds(march, _HELD_AGAIN):
            y[3] = y[4] = y[5] = 0.0
            mode = STUCK
    return REACHED_END


@compiled(allocates=False)
def _natural(march: March) -> int:
    problem, time = march.problem, march.clock[_T]
    piece = piece_at(problem.drive.knots, time, int(march.clock[_PIECE]))
    return FORCED if march.forced else natural_mode(problem, time, piece, march.y)


@compiled(allocates=False)
def _holds(march: March, least: float) -> bool:
    if not march.problem.numbers[HOLD_SPEED] > 0:
        return False
    margin = _margin_at(march, march.clock[_T], int(march.clock[_PIECE]))
    march.clock[_MARGIN] = margin
    return margin > least


@compiled(allocates=False)
def _margin_at(march: March, time: float, piece: int) -> float:
    """The margin of friction at a time, which counts as a check."""
    march.counts[4] += 1
    return holding_margin(march.problem, march.forced, time, piece, march.y, march.work, march.twist)


@compiled(allocates=False)
def _report(march: March, mode: int, t1: float, h: float) -> None:
    """Fill states and modes at the times up to ``t1``: the state itself, or dense output while it moves."""
    times, states, filled, t = march.times, march.states, int(march.clock[FILLED]), march.clock[_T]
    while filled < len(times) and times[filled] <= t1:
        theta = (times[filled] - t) / h
        if theta > 0 and mode != STUCK:
            dense_output(theta, march.y, march.y1, march.k, states[filled])
        else:
            for i in range(6):
                states[filled, i] = march.y[i]
        march.modes[filled] = mode
        filled += 1
    march.clock[FILLED] = filled


@compiled(allocates=False)
def _rest(march: March) -> bool:
    """Stay at rest for a step; True if the object breaks away at its end."""
    problem, forced, t, y, counts = march.problem, march.forced, march.clock[_T], march.y, march.counts
    piece = piece_at(problem.drive.knots, t, int(march.clock[_PIECE]))
    march.clock[_PIECE] = piece
    margin = march.clock[_MARGIN]
    spare = _SAFE_SHARE * (margin / (1 + margin) if margin < np.inf else 1.0)
    gap = spare * pull_borne(problem, march.work, march.twist)
    safe, left = _resting_step(problem, forced, t, piece, y, gap), march.times[-1] - t
    h = min(max(safe, least_step(problem.drive, t, piece)), left)
    if h > safe:
        h = _hardest_pull(problem, forced, t, h, piece, y)
    t1 = march.times[-1] if h >= left else t + h
    after = _margin_at(march, t1, piece)
    counts[0] += 1
    let_go = after <= 0
    if let_go:
        low, high, at_low, at_high = t, t1, min(margin, 1.0), max(after, -1.0)
        side = 0
        for _ in range(60):
            if abs(at_high) <= _MOMENT_OF_RELEASE or high - low <= 1e-15 * (1 + abs(t)):
                break
            share = at_low / (at_low - at_high)
            middle = low + (high - low) * min(max(share, 0.01), 0.99)
            value = min(max(_margin_at(march, middle, piece), -1.0), 1.0)
            if value > 0:
                low, at_low = middle, value
                at_high *= 0.5 if side == 1 else 1.0  # Illinois: an end that stays counts for less.
                side = 1
            else:
                high, at_high = middle, value
                at_low *= 0.5 if side == -1 else 1.0
                side = -1
        t1 = high
        counts[3] += 1
    _report(march, STUCK, t1, 1.0)
    march.clock[_T], march.clock[_MARGIN] = t1, after
    return let_go


@compiled(allocates=False)
def _resting_step(problem: TowProblem, forced: bool, t: float, piece: int, y: Array, gap: float) -> float:
    """Longest step [s] in which the pull cannot change by ``gap`` [N]."""
    n = problem.numbers
    if not forced:
        _, stretch, _ = tautness(problem, t, piece, y)
        stiffness, slack = n[KAPPA] * (1 + n[STIFFENING]), max(0.0, -stretch)
        if n[TETHER_WEIGHT] > 0:  # It pulls when slack, too.
            stiffness, slack = _hanging_stiffness(problem, t, piece, y, gap), 0.0
        if n[DAMPING] > 0 and slack == 0:
            return _damped_rest(problem, t, piece, stiffness, gap)
        gap = slack if n[DAMPING] > 0 else gap / stiffness + slack
    return safe_time(problem.drive, t, piece, gap, 0.0)


@compiled(allocates=False)
def _hardest_pull(problem: TowProblem, forced: bool, t: float, h: float, piece: int, y: Array) -> float:
    """Time [s] from ``t`` to the hardest pull on an object at rest within a step, if it pulls less hard after; else h.

    A rover that comes near and goes back again within a piece pulls in the middle of it.
    """
    drive, hardest, hardest_after = problem.drive, -math.inf, h
    for look in range(_LOOKS_AT_REST + 1):
        after = h * look / _LOOKS_AT_REST
        now = piece_at(drive.knots, t + after, piece)
        if forced:
            fx, fy, _, _, _, _ = spline_at(drive.knots, drive.coefficients, t + after, now)
            pull = math.hypot(fx, fy)
        else:
            _, _, pull = tautness(problem, t + after, now, y)
        if pull >= hardest:
            hardest, hardest_after = pull, after
    return hardest_after if hardest_after > 0 else h


@compiled(allocates=False)
def _hanging_stiffness(problem: TowProblem, t: float, piece: int, y: Array, gap: float) -> float:
    """Bound of the stiffness of a tether with mass [N/m], until its pull has grown by ``gap`` [N].

    The pull grows faster and faster with the distance, so it stays below the chord to where it has grown by that much.
    """
    n = problem.numbers
    _, _, _, _, distance, _ = tether_span(problem, t, piece, y, math.cos(y[2]), math.sin(y[2]))
    pull, _ = tether_pull(n, distance, 0.0)
    along = gap * distance / math.sqrt(distance * distance + n[RISE] * n[RISE])
    further, _ = reach_under(n, pull + along)
    stiffest: float = n[KAPPA] * (1 + n[STIFFENING])
    return min(gap / max(further - distance, 1e-9 * distance), stiffest)


@compiled(allocates=False)
def _damped_rest(problem: TowProblem, t: float, piece: int, stiffness: float, gap: float) -> float:
    """Time [s] to the end of the last piece by which stretch and damping have not grown by a force; zero if none.

    Damping follows the hinge's velocity, whose change is at most twice the largest speed.
    """
    n, drive = problem.numbers, problem.drive
    travel = fastest = safe = 0.0
    for k in range(piece, len(drive.speed_limits)):
        lasts = drive.knots[k + 1] - max(t, drive.knots[k])
        fastest = max(fastest, drive.speed_limits[k])
        travel += drive.speed_limits[k] * lasts
        if stiffness * travel + 2 * n[DAMPING] * fastest >= gap:
            break
        safe = drive.knots[k + 1] - t
    return safe


@compiled(allocates=False)
def _move(march: March, mode: int, fresh: bool) -> tuple[int, bool, bool]:
    """Try a step; returns the outcome, whether the tether changed between slack and taut, and whether it advanced."""
    problem, clock, y, counts = march.problem, march.clock, march.y, march.counts
    t, end, span = clock[_T], march.times[-1], march.times[-1] - march.times[0]
    piece = piece_at(problem.drive.knots, t, int(clock[_PIECE]))
    clock[_PIECE] = piece
    if fresh:
        slopes, time_slope = march.slopes[:3], march.slopes[3, :3]
        balance = acceleration_slopes(problem, mode, t, piece, y, march.work, march.rates0, slopes, time_slope)
        if balance != BALANCED:
            return TIPPED_OVER if balance == TIPS else LIFTED_OFF, False, False
        if not finite(march.rates0, slopes):
            return NOT_FINITE, False, False
    rise = problem.sliding[PLATEAU] / problem.sliding[SLOPE]
    h = min(clock[_H], end - t, step_to_stop(y, march.rates0, problem.soles.numbers[RADIUS], rise))
    if mode == SLACK or (mode == TAUT and _hangs_slack(problem, t, piece, y)):
        h = min(h, _slack_step(problem, t, piece, y))
    bend = np.inf if mode == FORCED else bend_ahead(problem.drive, t, piece, h, march.weights[0])
    asked, h = h, min(h, bend - t)
    if h < SMALLEST_STEP * span:
        failed = int(clock[_BALANCE])
        return STEP_TOO_SMALL if failed == BALANCED else TIPPED_OVER if failed == TIPS else LIFTED_OFF, False, False
    error = _step(march, mode, t, h, piece)
    if not error <= 1:
        counts[1] += 1
        clock[_H], clock[_GROWTH] = retried(h, error), 1.0
        return REACHED_END, False, False
    if h < asked:  # The error of a shortened step says little about the next.
        clock[_H], clock[_LAST_H] = asked, 0.0
    else:
        clock[_H] = following(h, error, clock[_GROWTH], clock[_LAST_H], clock[_LAST_ERROR])
        clock[_LAST_H], clock[_LAST_ERROR] = h, error
    theta = _first_crossing(march, mode, t, h, piece)
    if theta < 1:
        h *= theta
        _step(march, mode, t, h, piece)
        counts[2] += 1
        clock[_LAST_H] = 0.0
    t1 = t + h if t + h < end - SMALLEST_STEP * span else end
    t1 = bend if h == bend - t else t1
    _report(march, mode, t1, h)
    for i in range(6):
        y[i] = march.y1[i]
    counts[0] += 1
    clock[_T], clock[_GROWTH] = t1, GROW
    return REACHED_END, theta < 1, True


@compiled(allocates=False)
def _step(march: March, mode: int, t: float, h: float, piece: int) -> float:
    """One step into ``march.y1``; returns the error over the weights (root mean square), infinite where it failed."""
    slopes, time_slope = march.slopes[:3], march.slopes[3, :3]
    if not stage_matrix(h, slopes, march.matrices[0], march.matrices[1]):
        return np.inf
    problem, stage_y, rates, k, y = march.problem, march.stage_y, march.rates, march.k, march.y
    for i in range(6):
        rates[i], stage_y[i] = march.rates0[i], y[i]
    for stage in range(STAGES):
        if stage > 0:
            stage_state(stage, y, k, stage_y)
            stage_time = t + NODES[stage] * h
            piece = piece_at(problem.drive.knots, stage_time, piece)
            balance = accelerations(problem, mode, stage_time, piece, stage_y, march.work, rates)
            march.clock[_BALANCE] = balance
            if balance != BALANCED:
                return np.inf
        solve_stage(stage, h, slopes, march.matrices[0], time_slope, rates, k)
    return end_of_step(stage_y, k, march.weights, march.y1)


@compiled(allocates=False)
def _hangs_slack(problem: TowProblem, t: float, piece: int, y: Array) -> bool:
    """Whether a tether with mass is yet to tighten, which a step must not pass over."""
    if not problem.numbers[TETHER_WEIGHT] > 0:
        return False
    _, stretch, _ = tautness(problem, t, piece, y)
    return bool(stretch < 0)


@compiled(allocates=False)
def _slack_step(problem: TowProblem, t: float, piece: int, y: Array) -> float:
    """Longest step [s] in which hinge and anchor cannot close the gap, at least the least step of the drive."""
    n = problem.numbers
    _, stretch, _ = tautness(problem, t, piece, y)
    anchor = math.hypot(y[3], y[4]) + abs(y[5]) * math.hypot(n[ANCHOR_X], n[ANCHOR_Y])
    safe = safe_time(problem.drive, t, piece, max(0.0, -stretch), anchor)
    return max(least_step(problem.drive, t, piece), safe)


@compiled(allocates=False)
def _first_crossing(march: March, mode: int, t: float, h: float, piece: int) -> float:
    """Fraction of the step at which the tether changes between slack and taut; 1 where it does not."""
    if mode == FORCED or march.problem.numbers[TETHER_WEIGHT] > 0:
        return 1.0
    low, looks = 0.0, LOOKS_SLACK if mode == SLACK else LOOKS
    for look in range(1, looks + 1):
        high = look / looks
        if _stays(march, mode, t, h, high, piece):
            low = high
            continue
        while (high - low) * h > 1e-15 * (1 + abs(t)) and high - low > 1e-15:
            middle = 0.5 * (low + high)
            if _stays(march, mode, t, h, middle, piece):
                low = middle
            else:
                high = middle
        return high
    return 1.0


@compiled(allocates=False)
def _stays(march: March, mode: int, t: float, h: float, theta: float, piece: int) -> bool:
    dense_output(theta, march.y, march.y1, march.k, march.stage_y)
    problem, time = march.problem, t + theta * h
    _, stretch, tension = tautness(problem, time, piece_at(problem.drive.knots, time, piece), march.stage_y)
    return tension >= 0 if mode == TAUT else not (stretch > 0 and tension > 0)
