"""The heading rate at which the moment about the anchor vanishes, for a velocity of the tracked point.

One Newton step from a good guess leaves an error of second order; if that does not converge, roots are searched.
"""

import math

import numpy as np

from towval.model.compiling import compiled
from towval.physics.wrench import SlidingPatch, wrench_and_slopes

_SETTLED = 1e-6  # a Newton step this small, over |v| / radius, leaves its square as the error
_NEWTON_LIMIT = 30
_SCAN = 60  # rates looked at on either side of zero when a root has to be searched

Levers = tuple[float, float, float, float]
"""From P and from the anchor to the origin of the patch (x, y each) [m], body frame."""

ROOT_FOUND, ROOT_CHOSEN, ROOT_LOST = 0, 1, 2


@compiled(allocates=False)
def _moment_about_anchor(
    patch: SlidingPatch, geometry: Levers, ux: float, uy: float, omega: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Moment about the anchor, its slope by ω, the force and its slopes, and those of both as the body turns.

    ``ux``, ``uy``: velocity of P in body axes, which turns the other way.
    """
    px, py, ax, ay = geometry
    fx, fy, moment, xx, xy, yy, xw, yw, ww = wrench_and_slopes(patch, ux - omega * py, uy + omega * px, omega)
    fx_rate, fy_rate = -xx * py + xy * px + xw, -xy * py + yy * px + yw
    slope = -xw * py + yw * px + ww + ax * fy_rate - ay * fx_rate
    fx_turn, fy_turn = xx * uy - xy * ux, xy * uy - yy * ux
    turning = xw * uy - yw * ux + ax * fy_turn - ay * fx_turn
    return moment + ax * fy - ay * fx, slope, fx, fy, fx_rate, fy_rate, turning, fx_turn, fy_turn


@compiled(allocates=False)
def balanced_rate(
    patch: SlidingPatch, geometry: Levers, ux: float, uy: float, guess: float, search: bool
) -> tuple[float, float, float, float, float, float, float, int]:
    """Heading rate with no moment about the anchor, and the force (2) there.

    Returns the rate, its slope by heading, the force, its slopes by heading, the moment left and the status.
    """
    unit = math.sqrt(ux * ux + uy * uy) / patch.radius
    omega = guess
    tries = 0
    while not search and tries < _NEWTON_LIMIT:
        tries += 1
        moment, slope, fx, fy, fx_rate, fy_rate, turning, fx_turn, fy_turn = _moment_about_anchor(
            patch, geometry, ux, uy, omega
        )
        change = -moment / slope if slope < 0 else np.inf
        if not abs(change) < 0.3 * (unit + abs(omega)):
            break
        if abs(change) < _SETTLED * unit:
            # The force follows to first order; both are left with errors of the order of the change squared.
            turn = -turning / slope
            fx_turn, fy_turn = fx_turn + turn * fx_rate, fy_turn + turn * fy_rate
            return omega + change, turn, fx + change * fx_rate, fy + change * fy_rate, fx_turn, fy_turn, 0.0, ROOT_FOUND
        omega += change
    omega, found = _searched_rate(patch, geometry, ux, uy, guess, unit)
    moment, slope, fx, fy, fx_rate, fy_rate, turning, fx_turn, fy_turn = _moment_about_anchor(
        patch, geometry, ux, uy, omega
    )
    status = ROOT_LOST
    if found:
        status = ROOT_FOUND if search or abs(omega - guess) < 0.1 * unit else ROOT_CHOSEN
    turn = -turning / slope if slope < 0 else 0.0
    return omega, turn, fx, fy, fx_turn + turn * fx_rate, fy_turn + turn * fy_rate, moment, status


@compiled(allocates=False)
def _searched_rate(
    patch: SlidingPatch, geometry: Levers, ux: float, uy: float, guess: float, unit: float
) -> tuple[float, bool]:
    """Root nearest to a guess by scanning and bisection; without one, the rate with the least moment, and False."""
    best, best_distance, found = guess, np.inf, False
    least, least_moment = guess, np.inf
    last_rate = last_moment = 0.0
    for j in range(-_SCAN, _SCAN + 1):
        rate = unit * 0.02 * math.sinh(j * 12.0 / _SCAN)
        moment, _, _, _, _, _, _, _, _ = _moment_about_anchor(patch, geometry, ux, uy, rate)
        if abs(moment) < least_moment:
            least, least_moment = rate, abs(moment)
        if j > -_SCAN and (last_moment > 0) != (moment > 0):
            root = _bisected(patch, geometry, ux, uy, last_rate, rate, last_moment > 0)
            if abs(root - guess) < best_distance:
                best, best_distance, found = root, abs(root - guess), True
        last_rate, last_moment = rate, moment
    return (best, True) if found else (least, False)


@compiled(allocates=False)
def _bisected(
    patch: SlidingPatch, geometry: Levers, ux: float, uy: float, low: float, high: float, positive_low: bool
) -> float:
    for _ in range(80):
        middle = 0.5 * (low + high)
        moment, _, _, _, _, _, _, _, _ = _moment_about_anchor(patch, geometry, ux, uy, middle)
        if (moment > 0) == positive_low:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
