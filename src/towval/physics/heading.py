"""The heading of an object drawn along a path without inertia: its rate follows from balance, θ̇ = ω(t, θ).

Collocation in panels: within a panel rate and forces are the polynomials of degree eight through their values at
Chebyshev's nodes, and the heading is the rate's integral. Newton's method on all headings of a panel, with the slopes
of rate and force by the heading in closed form, settles them in two rounds from the polynomials of the panel before.
The coefficients of the two highest degrees bound what the polynomials miss; and since a path may jerk between the
nodes, so does the distance of the path's own velocity, at every time of the plan, from its polynomial. A panel that
misses more is halved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.balanced_rate import ROOT_CHOSEN, ROOT_FOUND, ROOT_LOST, Levers, balanced_rate
from towval.physics.pauses import CREEP, moving_velocity, next_rest, slowest_tow
from towval.physics.splines import Spline, piece_at, spline_at
from towval.physics.wrench import SlidingPatch

_DEGREE = 8
_TOLERANCE = 1e-10  # of the heading over a panel [rad], and of force over itself
_JERK = 1e-8  # of the largest velocity in a panel, that the velocity may differ from its polynomial between the nodes
_ROUNDS = 12
_FEW = 2 * (_DEGREE + 1)  # times in a panel that are solved for themselves: two rounds take as many balances
_SETTLED_HEADING = 1e-6  # rad, of a Newton step, which leaves its square as the error
_TRUSTED = 0.3  # of the rate and |v| over the patch's radius: how far the polynomial before may lead the first guess
_BLOCK = 64  # times whose polynomials are evaluated together
# Of the patch's radius: how far the path goes in the first panel, and in one that is halved no further.
_FIRST, _LEAST = 0.1, 1e-3
_SHORTEST = 1e-9  # of the time of the path, for where it rests
_GROW, _SHRINK = 2.0, 0.5
_LEAST_GROWTH = 0.1  # after a panel whose error is beyond all bounds
_LEAST_ERROR = 1e-6  # over the tolerance: what a panel grows by follows from no less

_NODES = -np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)
_TO_CHEBYSHEV = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE))
_INTEGRALS = np.stack([chebyshev.chebval(_NODES, chebyshev.chebint(c, lbnd=-1)) for c in _TO_CHEBYSHEV.T], axis=1)
_TO_POWERS = np.stack([np.pad(p := chebyshev.cheb2poly(c), (0, _DEGREE + 1 - len(p))) for c in _TO_CHEBYSHEV.T], axis=1)
_HIGHEST = _TO_CHEBYSHEV[-2:].copy()

Place = tuple[float, float, float, float, float, float]
"""A point of the path and its two derivatives, x and y each."""

# Rows of a panel: heading, rate, force (2) in body axes, velocity (2), slopes of rate and force by the heading.
_THETA, _OMEGA, _FX, _FY, _VX, _VY, _TURN, _FX_TURN, _FY_TURN = range(9)


class Plan(NamedTuple):
    """What compiled code fills in at each time.

    As in :class:`QuasistaticMotion`: ``pose``, ``twist``, ``tether_force``, ``hinge`` (n, 2). Beside: ``direction`` (n,
    2) of the tow in body axes, ``moment`` (n,) left about the anchor where the root is lost [N m], ``status`` (n,) of
    the root, in the plane the worst since the time before.
    """

    pose: Array
    twist: Array
    tether_force: Array
    hinge: Array
    direction: Array
    moment: Array
    status: Array


def room_for_plan(n: int) -> Plan:
    """A plan of n times to be filled in, in one block: the system hands out a large one more cheaply than seven."""
    pose, twist, force, hinge, direction, alone = np.split(np.empty(14 * n), n * np.array([3, 6, 8, 10, 12]))
    pairs = (part.reshape(n, 2) for part in (force, hinge, direction))
    return Plan(pose.reshape(n, 3), twist.reshape(n, 3), *pairs, *alone.reshape(2, n))


@compiled()
def follow(
    patch: SlidingPatch, levers: Array, spline: Spline, times: Array, heading: float, plan: Plan
) -> tuple[int, int, float]:
    """Fill the plan; ``levers`` (6,): P and the anchor in the body frame, rest length and stiffness of the tether.

    Returns the numbers of panels and of solutions of the balance, and a bound of the heading's error [rad]: what all
    panels may have missed.
    """
    geometry = (
        patch.origin[0] - levers[0], patch.origin[1] - levers[1], patch.origin[0] - levers[2],
        patch.origin[1] - levers[3],
    )  # fmt: skip
    nodes, powers = np.zeros((9, _DEGREE + 1)), np.zeros((6, _DEGREE + 2))
    system, block = np.empty((_DEGREE, _DEGREE + 1)), np.empty((7, _BLOCK))
    t, span = times[0], times[-1] - times[0]
    nodes[_THETA, 0] = heading
    piece = piece_at(spline.knots, t, 0)
    h = min(span, _FIRST * patch.radius / max(spline.speed_limits[piece], _FIRST * patch.radius / span))
    filled = panels = solves = 0
    bound, known = 0.0, (t, 0.0)
    worst, most = ROOT_FOUND, 0.0  # of the panels since the last time that was filled
    while filled < len(times):
        left = min(times[-1], next_rest(spline, piece)) - t
        h = left if 1.01 * h >= left else h
        travel = h * _lay_velocities(spline, t, h, piece, nodes)
        last = travel <= _LEAST * patch.radius or h <= _SHORTEST * span
        _guess_rates(t, h, known, powers, patch.radius, nodes)
        status, moment, count = _collocate(patch, geometry, h, panels == 0, nodes, system)
        solves += count
        error = _missed(h, nodes)
        smooth = status == ROOT_FOUND and error <= 1
        to, jerk = filled, np.inf
        if smooth or last:
            _lay_powers(h, nodes, powers)
            known = (t, h)
            to, jerk = _fill(plan, levers, spline, times, filled, (t, h, piece), powers, (status, moment), block)
        if not (last or (smooth and jerk <= _JERK)):
            h *= _SHRINK
            continue
        if to - filled < _FEW and status == ROOT_FOUND:
            solves += to - filled
            _solve_reported(patch, geometry, levers, spline, times, (filled, to, piece), plan)
        worst = max(worst, status)
        most = max(most, moment if status == ROOT_LOST else 0.0)
        if to > filled:
            plan.status[filled] = max(worst, plan.status[filled])
            plan.moment[filled] = max(most, plan.moment[filled])
            worst, most = ROOT_FOUND, 0.0
        filled, panels = to, panels + 1
        bound += _TOLERANCE * error + jerk * travel / patch.radius
        t = min(t + h, times[-1])
        piece = piece_at(spline.knots, t, piece)
        nodes[_THETA, 0], nodes[_OMEGA, 0] = nodes[_THETA, _DEGREE], nodes[_OMEGA, _DEGREE]
        grown = min(_GROW, max(_LEAST_GROWTH, 0.9 * max(error, _LEAST_ERROR) ** (-1 / _DEGREE)))
        h = max(grown * h, _SHORTEST * span)  # in shorter panels the error is rounding, and none grows
    solves += _hold(patch, geometry, levers, spline, times, plan)
    return panels, solves, bound


@compiled(allocates=False)
def _hold(patch: SlidingPatch, geometry: Levers, levers: Array, spline: Spline, times: Array, plan: Plan) -> int:
    """Where the path rests, let the tether pull as it did; returns how many balances were solved."""
    piece, rate, solves, search = 0, 0.0, 0, True
    for i in range(len(times)):
        piece = piece_at(spline.knots, times[i], piece)
        place = spline_at(spline.knots, spline.coefficients, times[i], piece)
        slowest, speed = slowest_tow(spline, times[i], piece), math.hypot(place[2], place[3])
        if slowest == 0:
            rate, search = plan.twist[i, 2] / speed, False
            continue
        vx, vy = moving_velocity(spline, times[i], piece)
        cos, sin = math.cos(plan.pose[i, 2]), math.sin(plan.pose[i, 2])
        grown = slowest / CREEP
        ux, uy = grown * (cos * vx + sin * vy), grown * (cos * vy - sin * vx)
        found, _, fx, fy, _, _, _, _ = balanced_rate(patch, geometry, ux, uy, slowest * rate, search)
        rate, search, solves = found / slowest, False, solves + 1
        plan.twist[i, 2] = 0.0
        _assemble(plan, i, levers, place, (cos, sin), (fx, fy))
    return solves


@compiled(allocates=False)
def _lay_velocities(spline: Spline, t: float, h: float, piece: int, nodes: Array) -> float:
    """Velocities of P at the nodes of a panel, floor axes; returns the largest speed."""
    fastest = 0.0
    for j in range(_DEGREE + 1):
        time = t + 0.5 * h * (1 + _NODES[j])
        piece = piece_at(spline.knots, time, piece)
        vx, vy = moving_velocity(spline, time, piece)
        nodes[_VX, j], nodes[_VY, j] = vx, vy
        fastest = max(fastest, vx * vx + vy * vy)
    return math.sqrt(fastest)


@compiled(allocates=False)
def _guess_rates(t: float, h: float, known: tuple[float, float], powers: Array, radius: float, nodes: Array) -> None:
    """Guess the rates at the nodes of a panel, from that at its start.

    They come from the polynomial of the panel before (``known``: its start and length). Where there is none, or it
    leads far off, the object is taken to turn by as much per metre as at the start.
    """
    omega = nodes[_OMEGA]
    before = math.sqrt(nodes[_VX, 0] ** 2 + nodes[_VY, 0] ** 2)
    for j in range(1, _DEGREE + 1):
        speed = math.sqrt(nodes[_VX, j] ** 2 + nodes[_VY, j] ** 2)
        omega[j] = omega[0] * speed / before
        if known[1] > 0:
            x, led = 2 * (t + 0.5 * h * (1 + _NODES[j]) - known[0]) / known[1] - 1, 0.0
            for k in range(_DEGREE, -1, -1):
                led = led * x + powers[_OMEGA, k]
            if abs(led - omega[j]) < _TRUSTED * (speed / radius + abs(omega[j])):
                omega[j] = led


@compiled(allocates=False)
def _collocate(
    patch: SlidingPatch, geometry: Levers, h: float, search: bool, nodes: Array, system: Array
) -> tuple[int, float, int]:
    """Headings, rates and forces at the nodes of a panel from the heading at its start, velocities and guessed rates.

    Returns the worst status of the roots, the largest moment left, and how many balances were solved.
    """
    theta, omega, count = nodes[_THETA], nodes[_OMEGA], 0
    status, moment = ROOT_FOUND, 0.0
    for j in range(1, _DEGREE + 1):
        theta[j] = theta[0]
        for k in range(_DEGREE + 1):
            theta[j] += 0.5 * h * _INTEGRALS[j, k] * omega[k]
    for rounds in range(_ROUNDS):
        status, moment = ROOT_FOUND, 0.0
        for j in range(_DEGREE + 1):
            cos, sin = math.cos(theta[j]), math.sin(theta[j])
            ux, uy = cos * nodes[_VX, j] + sin * nodes[_VY, j], cos * nodes[_VY, j] - sin * nodes[_VX, j]
            guess = 0.0 if j == 0 and rounds == 0 and search else omega[j]
            (
                omega[j],
                nodes[_TURN, j],
                nodes[_FX, j],
                nodes[_FY, j],
                nodes[_FX_TURN, j],
                nodes[_FY_TURN, j],
                left,
                found,
            ) = balanced_rate(patch, geometry, ux, uy, guess, search and rounds == 0)
            count += 1
            status, moment = max(status, found), max(moment, abs(left))
        if status != ROOT_FOUND and rounds == 0 and not search:
            return status, moment, count
        if _settle(h, nodes, system) < _SETTLED_HEADING:
            return status, moment, count
    return max(status, ROOT_CHOSEN), moment, count


@compiled(allocates=False)
def _settle(h: float, nodes: Array, system: Array) -> float:
    """One step of Newton's method on the headings, which rates and forces follow; returns the largest change [rad]."""
    theta, omega, turn = nodes[_THETA], nodes[_OMEGA], nodes[_TURN]
    for i in range(_DEGREE):
        left = theta[0] - theta[i + 1]
        for k in range(_DEGREE + 1):
            left += 0.5 * h * _INTEGRALS[i + 1, k] * omega[k]
            if k > 0:
                system[i, k - 1] = (1.0 if k == i + 1 else 0.0) - 0.5 * h * _INTEGRALS[i + 1, k] * turn[k]
        system[i, _DEGREE] = left
    for i in range(_DEGREE):  # Gauss without pivots: the matrix is near the unit matrix, or the panel too long.
        for row in range(i + 1, _DEGREE):
            factor = system[row, i] / system[i, i]
            for k in range(i + 1, _DEGREE + 1):
                system[row, k] -= factor * system[i, k]
    largest = 0.0
    for i in range(_DEGREE - 1, -1, -1):
        change = system[i, _DEGREE]
        for k in range(i + 1, _DEGREE):
            change -= system[i, k] * system[k, _DEGREE]
        change /= system[i, i]
        system[i, _DEGREE] = change
        theta[i + 1] += change
        omega[i + 1] += change * turn[i + 1]
        nodes[_FX, i + 1] += change * nodes[_FX_TURN, i + 1]
        nodes[_FY, i + 1] += change * nodes[_FY_TURN, i + 1]
        largest = max(largest, abs(change))
    return largest if math.isfinite(largest) else np.inf


@compiled(allocates=False)
def _missed(h: float, nodes: Array) -> float:
    """Coefficients of the two highest degrees over what is tolerated, of the heading and of the force."""
    turned = missed = force = 0.0
    for row in range(_OMEGA, _FY + 1):
        for high in range(2):
            coefficient = 0.0
            for j in range(_DEGREE + 1):
                coefficient += _HIGHEST[high, j] * nodes[row, j]
            if row == _OMEGA:
                turned += 0.5 * h * abs(coefficient)
            else:
                missed += abs(coefficient)
    for j in range(_DEGREE + 1):
        force = max(force, abs(nodes[_FX, j]), abs(nodes[_FY, j]))
    worst = max(turned, missed / force) / _TOLERANCE
    return worst if math.isfinite(worst) else np.inf


@compiled(allocates=False)
def _lay_powers(h: float, nodes: Array, powers: Array) -> None:
    """Coefficients by powers of the place in the panel, −1 to 1, lowest first, of all that is interpolated."""
    for row in range(_OMEGA, _VY + 1):
        for k in range(_DEGREE + 1):
            total = 0.0
            for j in range(_DEGREE + 1):
                total += _TO_POWERS[k, j] * nodes[row, j]
            powers[row, k] = total
    heading, start, sign = powers[_THETA], 0.0, 1.0
    for k in range(_DEGREE + 1):
        heading[k + 1] = 0.5 * h * powers[_OMEGA, k] / (k + 1)
        sign = -sign
        start += sign * heading[k + 1]
    heading[0] = nodes[_THETA, 0] - start


@compiled(allocates=False)
def _fill(
    plan: Plan,
    levers: Array,
    spline: Spline,
    times: Array,
    filled: int,
    panel: tuple[float, float, int],
    powers: Array,
    root: tuple[int, float],
    block: Array,
) -> tuple[int, float]:
    """Fill the plan at the times within a panel (start, length, piece of the path at its start).

    ``block`` is room for what is evaluated at some times. Returns the number of times filled in all, and
    how far the path's velocity is from its polynomial at most, over the largest.
    """
    t, h, piece = panel
    knots, off, fastest = spline.knots, 0.0, 0.0
    whole = t + h >= times[-1]
    while filled < len(times) and (times[filled] <= t + h or whole):
        count = 0
        while count < _BLOCK and filled + count < len(times) and (times[filled + count] <= t + h or whole):
            block[6, count] = 2 * (times[filled + count] - t) / h - 1
            count += 1
        _evaluate(powers, block, count)
        for i in range(count):
            theta, fx, fy, vx, vy = block[_THETA, i], block[_FX, i], block[_FY, i], block[_VX, i], block[_VY, i]
            piece = piece_at(knots, times[filled], piece)
            place = spline_at(knots, spline.coefficients, times[filled], piece)
            if place[2] * place[2] + place[3] * place[3] > CREEP * CREEP:
                off = max(off, abs(vx - place[2]), abs(vy - place[3]))
            fastest = max(fastest, abs(vx), abs(vy))
            plan.pose[filled, 2], plan.twist[filled, 2] = theta, block[_OMEGA, i]
            plan.status[filled], plan.moment[filled] = root[0], root[1] if root[0] == ROOT_LOST else 0.0
            _assemble(plan, filled, levers, place, (math.cos(theta), math.sin(theta)), (fx, fy))
            filled += 1
    return filled, off / fastest if fastest > 0 else 0.0


@compiled(allocates=False)
def _evaluate(powers: Array, block: Array, count: int) -> None:
    """The polynomials at places in a panel: the first ``count`` of the last row, into the rows before."""
    place = block[6]
    for row in range(6):
        values = block[row]
        for i in range(count):
            values[i] = powers[row, _DEGREE + 1]
        for k in range(_DEGREE, -1, -1):
            power = powers[row, k]
            for i in range(count):
                values[i] = values[i] * place[i] + power


@compiled(allocates=False)
def _solve_reported(
    patch: SlidingPatch,
    geometry: Levers,
    levers: Array,
    spline: Spline,
    times: Array,
    rows: tuple[int, int, int],
    plan: Plan,
) -> None:
    """Solve the balance at the times from the first to before the second row, of which the plan has the headings."""
    first, end, piece = rows
    for i in range(first, end):
        piece = piece_at(spline.knots, times[i], piece)
        place = spline_at(spline.knots, spline.coefficients, times[i], piece)
        vx, vy = moving_velocity(spline, times[i], piece)
        cos, sin = math.cos(plan.pose[i, 2]), math.sin(plan.pose[i, 2])
        guess, ux, uy = plan.twist[i, 2], cos * vx + sin * vy, cos * vy - sin * vx
        plan.twist[i, 2], _, fx, fy, _, _, _, _ = balanced_rate(patch, geometry, ux, uy, guess, False)
        _assemble(plan, i, levers, place, (cos, sin), (fx, fy))


@compiled(allocates=False)
def _assemble(
    plan: Plan, i: int, levers: Array, place: Place, turned: tuple[float, float], friction: tuple[float, float]
) -> None:
    """Places, velocities and forces of a time, floor axes, in the plan, which has heading and rate.

    ``place``: the path's position and derivatives; ``turned``: cosine and sine of the heading; ``friction`` force, body
    axes. A tow without force keeps the direction of the time before.
    """
    px, py, ax, ay, rest_length, stiffness = levers
    (cos, sin), (fx, fy), omega = turned, friction, plan.twist[i, 2]
    pull = math.sqrt(fx * fx + fy * fy)
    dx = -fx / pull if pull > 0 else plan.direction[i - 1, 0] if i > 0 else 0.0
    dy = -fy / pull if pull > 0 else plan.direction[i - 1, 1] if i > 0 else 0.0
    plan.direction[i, 0], plan.direction[i, 1] = dx, dy
    reach = rest_length + pull / stiffness
    along_x, along_y = ax + reach * dx, ay + reach * dy
    lever_x, lever_y = cos * px - sin * py, sin * px + cos * py
    x, y = place[0] - lever_x, place[1] - lever_y
    plan.pose[i, 0], plan.pose[i, 1] = x, y
    plan.twist[i, 0], plan.twist[i, 1] = place[2] + omega * lever_y, place[3] - omega * lever_x
    plan.tether_force[i, 0], plan.tether_force[i, 1] = sin * fy - cos * fx, -sin * fx - cos * fy
    plan.hinge[i, 0], plan.hinge[i, 1] = x + cos * along_x - sin * along_y, y + sin * along_x + cos * along_y
