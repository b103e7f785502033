"""The quasi-static model of a tow in three dimensions: force, heading and hinge that draw a point along a path.

As :mod:`towval.physics.quasistatic`, with the pressure solved together with the friction. Without inertia the tether's
part along the floor is T = −(F + m g_s), g_s gravity along the floor, so the moments about G of
:mod:`towval.physics.spatial.rates` become

    (A + C W) x = (m g_n − T_z, −h m g_sx − T_z q_x, −h m g_sy − T_z q_y),   C with the anchor's height over the floor,

linear in x but for T_z, which follows from |T| by the tether: one unknown, by the secant method, or by bisection where
a trial of it lifts an edge of the footprint: the lift of a rising tether may hold down what its pull along the floor
would tip. Balance about the anchor gives the heading rate, and the heading is integrated with Dormand's and Prince's
rule of order eight.
"""

from __future__ import annotations

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.model.errors import RefusedError
from towval.physics.balanced_rate import ROOT_CHOSEN, ROOT_FOUND, ROOT_LOST
from towval.physics.heading import Plan
from towval.physics.pauses import CREEP, moving_velocity, slowest_tow
from towval.physics.rosenbrock import product_3
from towval.physics.spatial.hanging import reach_under
from towval.physics.spatial.pressure import BALANCED, solve_pressure
from towval.physics.spatial.problem import (
    ABOVE,
    ANCHOR_X,
    ANCHOR_Y,
    GRAVITY_N,
    GRAVITY_X,
    GRAVITY_Y,
    HEIGHT,
    MASS,
    RISE,
    TETHER_WEIGHT,
    TowProblem,
)
from towval.physics.spatial.soles import RADIUS, Work, work_for
from towval.physics.spatial.unit_wrenches import W
from towval.physics.splines import piece_at, spline_at

_LIFT_LIMIT, _LIFT_SETTLED = 40, 1e-13  # of the load
_LIFT_TRIALS, _LIFT_HALVINGS, _LIFT_CLOSE = 64, 60, 1e-9  # from as much load on top to none left; of the load
_RATE_LIMIT, _RATE_SETTLED = 40, 1e-11  # of |v| over the radius of the soles
_SCAN, _BISECTIONS = 60, 60
_TOLERANCE, _MOST_STEP = 1e-10, 2e-3  # rad a step; of the time of the path
_MOST_JUMPS = 500  # of the root in trial steps: where it jumps to and fro steps become shorter and shorter
_TIPPED = 1
# What is known of an instant: heading rate, force along the floor (2), reach of the tether along the floor, moment left
# about the anchor, status of the root; place and heading of G; what the tether lifted last, with which a search begins.
_PLACE, _LIFT, _KNOWN = 6, 9, 10


@compiled(allocates=False)
def _off(
    problem: TowProblem, place: Array, twist: tuple[float, float, float], lift: float, work: Work, out: Array
) -> float:
    """How much more the tether lifts [N] than a trial says, NaN where the pressure does not balance; into ``out``.

    ``place`` (3,): floor position and heading of G. Twist and force in body axes; tether (2), reach, moment left.
    """
    n = problem.numbers
    cos, sin = math.cos(place[2]), math.sin(place[2])
    gx, gy = n[MASS] * (cos * n[GRAVITY_X] + sin * n[GRAVITY_Y]), n[MASS] * (cos * n[GRAVITY_Y] - sin * n[GRAVITY_X])
    frame, weight = (place[0], place[1], cos, sin), n[MASS] * n[GRAVITY_N]
    loads = weight - lift, -n[ABOVE] * gx - lift * n[ANCHOR_X], -n[ABOVE] * gy - lift * n[ANCHOR_Y]
    height = n[HEIGHT] + n[ABOVE]
    if solve_pressure(problem.soles, problem.regions, problem.sliding, frame, twist, height, loads, work) != BALANCED:
        return math.nan
    fx, fy, moment = product_3(work.matrices[W], work.pressure)
    out[1], out[2] = -fx - gx, -fy - gy
    out[3], lifted = reach_under(n, math.sqrt(out[1] * out[1] + out[2] * out[2]))
    out[4] = moment + n[ANCHOR_X] * out[2] - n[ANCHOR_Y] * out[1]
    return lifted - lift


@compiled(allocates=False)
def _towed(problem: TowProblem, place: Array, twist: tuple[float, float, float], work: Work, out: Array) -> float:
    """Moment about the anchor that a twist of G leaves, NaN where nothing balances; ``out`` as of :func:`_off`."""
    n = problem.numbers
    weight = n[MASS] * n[GRAVITY_N]
    lift, before, off_before = out[_LIFT], 0.0, 0.0
    for k in range(_LIFT_LIMIT):
        off = _off(problem, place, twist, lift, work, out)
        if abs(off) <= _LIFT_SETTLED * weight:
            out[_LIFT] = lift
            return float(out[4])
        if math.isnan(off):
            break
        slope = (off - off_before) / (lift - before) if k > 0 else -1.0
        before, off_before = lift, off
        lift -= off / slope
    if n[RISE] == 0 and not n[TETHER_WEIGHT] > 0:
        return math.nan
    return _towed_by_bisection(problem, place, twist, work, out)


@compiled(allocates=False)
def _towed_by_bisection(
    problem: TowProblem, place: Array, twist: tuple[float, float, float], work: Work, out: Array
) -> float:
    """As :func:`_towed`, where the secant method met a lift that no pressure balances.

    The more the tether lifts the less friction it has to overcome: what it lifts less than a trial changes sign once.
    """
    weight = problem.numbers[MASS] * problem.numbers[GRAVITY_N]
    low = high = last = off_last = math.nan
    for k in range(_LIFT_TRIALS):
        lift = weight * (2 * k / _LIFT_TRIALS - 1)
        off = _off(problem, place, twist, lift, work, out)
        if (off_last > 0 and not off > 0) or (math.isnan(off_last) and off <= 0 and k > 0):
            low, high = last, lift
            break
        last, off_last = lift, off
    else:
        return math.nan
    balanced_below = off_last > 0
    for _ in range(_LIFT_HALVINGS):
        lift = 0.5 * (low + high)
        off = _off(problem, place, twist, lift, work, out)
        if off > 0 or (math.isnan(off) and not balanced_below):
            low, balanced_below = lift, balanced_below or off > 0
        else:
            high = lift
    out[_LIFT] = low if balanced_below else high
    off = _off(problem, place, twist, out[_LIFT], work, out)
    return float(out[4]) if abs(off) <= _LIFT_CLOSE * weight else math.nan


@compiled(allocates=False)
def _left(
    problem: TowProblem, place: Array, lever: Array, ux: float, uy: float, rate: float, work: Work, out: Array
) -> float:
    """The same for the velocity of P, ``lever`` (2,) from G, and a heading rate."""
    twist = ux + rate * lever[1], uy - rate * lever[0], rate
    moment = _towed(problem, place, twist, work, out)
    out[0], out[4] = rate, moment
    return moment


@compiled(allocates=False)
def _rate(
    problem: TowProblem, place: Array, lever: Array, ux: float, uy: float, guess: float, work: Work, out: Array
) -> int:
    """Heading rate with no moment about the anchor, and forces, into ``out`` (6,); 1 where the object tips."""
    unit = math.sqrt(ux * ux + uy * uy) / problem.soles.numbers[RADIUS]
    last, now = guess, guess + 1e-4 * unit
    at_last = _left(problem, place, lever, ux, uy, last, work, out)
    if math.isnan(at_last):  # Where the rate of before tips the object it tips, though it might stand while it spins.
        return _TIPPED
    for _ in range(_RATE_LIMIT):
        at_now = _left(problem, place, lever, ux, uy, now, work, out)
        if at_now == 0 or abs(now - last) <= _RATE_SETTLED * unit:
            return 0
        slope = (at_now - at_last) / (now - last)
        step = -at_now / slope
        if not abs(step) < 0.3 * (unit + abs(now)):
            break
        last, at_last, now = now, at_now, now + step
    _searched(problem, place, lever, ux, uy, guess, work, out)
    return 0


@compiled(allocates=False)
def _searched(
    problem: TowProblem, place: Array, lever: Array, ux: float, uy: float, guess: float, work: Work, out: Array
) -> None:
    """The root nearest to a guess, by scanning and bisection; the least moment found where there is none."""
    unit = math.sqrt(ux * ux + uy * uy) / problem.soles.numbers[RADIUS]
    best, least, low, high, distance = guess, np.inf, 0.0, 0.0, np.inf
    last_rate, last, falls = math.nan, math.nan, True
    for j in range(-_SCAN, _SCAN + 1):
        rate = unit * 0.02 * math.sinh(j * 12.0 / _SCAN)
        moment = _left(problem, place, lever, ux, uy, rate, work, out)
        if abs(moment) < least:
            best, least = rate, abs(moment)
        # Not where one is NaN. Where the moment rises the object balances, too: straight behind a raised anchor.
        if last * moment <= 0 and abs(0.5 * (last_rate + rate) - guess) < distance:
            low, high, distance, falls = last_rate, rate, abs(0.5 * (last_rate + rate) - guess), last > moment
        last_rate, last = rate, moment
    for _ in range(_BISECTIONS if distance < np.inf else 0):
        best = 0.5 * (low + high)
        if (_left(problem, place, lever, ux, uy, best, work, out) > 0) == falls:
            low = best
        else:
            high = best
    _left(problem, place, lever, ux, uy, best, work, out)
    near = abs(best - guess) < 0.1 * unit or guess == 0.0
    out[5] = ROOT_LOST if distance == np.inf else ROOT_FOUND if near else ROOT_CHOSEN


@compiled(allocates=False)
def rate_at(
    problem: TowProblem, lever: Array, time: float, heading: float, grown: float, work: Work, out: Array
) -> int:
    """Heading rate and forces at a time and a heading into ``out`` (10,), whose rate is the guess; 1: it tips.

    ``lever`` (2,) from G to P in body axes; the drive of the problem is the path of P, whose velocity and rate count as
    ``grown`` times as large.
    """
    knots, coefficients = problem.drive.knots, problem.drive.coefficients
    piece = piece_at(knots, time, 0)
    at = spline_at(knots, coefficients, time, piece)
    vx, vy = moving_velocity(problem.drive, time, piece)
    vx, vy = grown * vx, grown * vy
    cos, sin, place = math.cos(heading), math.sin(heading), out[_PLACE:]
    place[0] = at[0] - cos * lever[0] + sin * lever[1]
    place[1] = at[1] - sin * lever[0] - cos * lever[1]
    place[2] = heading
    out[5] = ROOT_FOUND
    return _rate(problem, place, lever, cos * vx + sin * vy, cos * vy - sin * vx, out[0], work, out)


@compiled(allocates=False)
def _fill(problem: TowProblem, levers: Array, times: Array, headings: Array, work: Work, out: Array, plan: Plan) -> int:
    """Fill the plan at all times; returns how many, fewer where the object tips. ``levers`` (4,): P and body from G."""
    n, lever, piece = problem.numbers, levers[:2], 0
    for i in range(len(times)):
        piece = piece_at(problem.drive.knots, times[i], piece)
        slowest = slowest_tow(problem.drive, times[i], piece)
        grown = slowest / CREEP if slowest > 0 else 1.0
        if rate_at(problem, lever, times[i], headings[i], grown, work, out) == _TIPPED:
            return i
        at = spline_at(problem.drive.knots, problem.drive.coefficients, times[i], piece)
        cos, sin, rate = math.cos(headings[i]), math.sin(headings[i]), 0.0 if slowest > 0 else out[0]
        pull = math.sqrt(out[1] * out[1] + out[2] * out[2])
        dx, dy = out[1] / pull, out[2] / pull
        to_x, to_y = n[ANCHOR_X] + out[3] * dx, n[ANCHOR_Y] + out[3] * dy
        bx, by = levers[2], levers[3]
        x, y = out[_PLACE] + cos * bx - sin * by, out[_PLACE + 1] + sin * bx + cos * by
        plan.pose[i, 0], plan.pose[i, 1], plan.pose[i, 2] = x, y, headings[i]
        plan.twist[i, 0], plan.twist[i, 1] = at[2] + rate * (at[1] - y), at[3] - rate * (at[0] - x)
        plan.twist[i, 2] = rate
        plan.tether_force[i, 0], plan.tether_force[i, 1] = cos * out[1] - sin * out[2], sin * out[1] + cos * out[2]
        plan.hinge[i, 0] = out[_PLACE] + cos * to_x - sin * to_y
        plan.hinge[i, 1] = out[_PLACE + 1] + sin * to_x + cos * to_y
        plan.direction[i, 0], plan.direction[i, 1], plan.status[i] = dx, dy, out[5]
        plan.moment[i] = out[4] if out[5] == ROOT_LOST else 0.0
    return len(times)


def follow_in_space(problem: TowProblem, levers: Array, times: Array, heading: float, plan: Plan) -> dict[str, float]:
    """Fill the plan of a tow whose drive is the path of P; ``levers`` (4,): P and the body's origin from G, body axes.

    Raises `RefusedError` where the object tips over on its path, or the balance jumps to and fro.
    """
    # Here, because it takes as long to import as all the rest of the physics.
    from scipy.integrate import solve_ivp  # noqa: PLC0415

    work, out = work_for(problem.soles, problem.regions), np.zeros(_KNOWN)
    jumped: list[float] = []

    def rate(time: float, state: Array) -> float:
        if slowest_tow(problem.drive, time, piece_at(problem.drive.knots, time, 0)) > 0:
            return 0.0  # At rest: a creep makes so little friction that the weight on a slope would turn the object.
        if rate_at(problem, levers[:2], time, state[0], 1.0, work, out) == _TIPPED:
            raise _tips(time)
        if out[5] != ROOT_FOUND:
            jumped.append(time)
            if len(jumped) > _MOST_JUMPS:
                raise _jumps_to_and_fro(time)
        return float(out[0])

    span = float(times[-1] - times[0])
    tight = {"rtol": 1e-12, "atol": _TOLERANCE, "max_step": _MOST_STEP * span}
    found = solve_ivp(rate, (times[0], times[-1]), [heading], method="DOP853", dense_output=True, **tight)
    out[0] = 0.0
    filled = _fill(problem, levers, times, found.sol(times)[0], work, out, plan)
    if filled < len(times):
        raise _tips(times[filled])
    # Between two reported times as well, where the root may be another one at both of them and the heading none's.
    after = np.minimum(np.searchsorted(times, jumped), len(times) - 1)
    plan.status[after] = np.maximum(plan.status[after], ROOT_CHOSEN)
    return {"panels": float(len(found.t) - 1), "solves": float(found.nfev + filled)}


def _jumps_to_and_fro(time: float) -> RefusedError:
    return RefusedError(
        "the object cannot be drawn along the path steadily",
        got=f"balances about the anchor come and go with its heading at {time:.2f} s",
        remedy="let a point nearer to the anchor follow the path, or lower the anchor",
    )


def _tips(time: float) -> RefusedError:
    return RefusedError(
        "the object tips over on its way, or is lifted",
        got=f"no pressure under the footprint balances the tow at {time:.2f} s",
        remedy="check the heights of anchor, hinge and centre of mass, the slope and the friction",
    )
