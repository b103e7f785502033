"""Whether friction holds an object at rest: the set of wrenches that its soles can bear, by its support function.

At rest the law is set-valued: any wrench within the limit surface of Coulomb friction with the static coefficient, at
the pressure that the loads at rest ask for. The dissipation ``D(ξ) = −W(ξ) x · ξ`` is that set's support function, so a
wrench w is borne if and only if ``D(ξ) ≥ w·ξ`` for all twists ξ. With D convex and homogeneous, the least D where
``w·ξ = 1`` is found by Newton's method; its excess over one is the margin.

SOURCE: the limit surface as a set of maximal dissipation: Goyal, Ruina, Papadopoulos, "Planar sliding with dry
friction", Wear 143 (1991) 307.
"""

from __future__ import annotations

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.rosenbrock import inverse_3, product_3
from towval.physics.spatial.contact_parts import Frame, contact_parts
from towval.physics.spatial.pressure import BALANCED, Loads, solve_pressure
from towval.physics.spatial.problem import (
    ABOVE,
    ANCHOR_X,
    ANCHOR_Y,
    GRAVITY_N,
    GRAVITY_X,
    GRAVITY_Y,
    HEIGHT,
    MASS,
    TowProblem,
)
from towval.physics.spatial.rates import tether_pull, tether_span
from towval.physics.spatial.soles import RADIUS, Work
from towval.physics.spatial.unit_wrenches import SCRATCH, J, S, W, unit_wrenches, wrench_slopes
from towval.physics.splines import piece_at, spline_at

_NEWTON_LIMIT, _SETTLED = 60, 1e-12
_NO_WRENCH = 1e-10  # of the load: less needs no holding

Vector = tuple[float, float, float]


@compiled(allocates=False)
def holding_margin(
    problem: TowProblem, forced: bool, time: float, piece: int, y: Array, work: Work, twist: Array
) -> float:
    """How far a resting object is from sliding: above zero it stays; −1 where nothing balances it.

    The excess of what the soles can bear over what the tether (or a given force) and gravity ask for, over the latter.
    ``piece`` of the drive is where to look first; ``twist`` (3,) keeps, from call to call, the direction in which the
    object would slide.
    """
    n, drive = problem.numbers, problem.drive
    cos, sin = math.cos(y[2]), math.sin(y[2])
    piece = piece_at(drive.knots, time, piece)
    tx = ty = tz = 0.0
    if forced:
        px, py, _, _, _, _ = spline_at(drive.knots, drive.coefficients, time, piece)
        tx, ty = cos * px + sin * py, cos * py - sin * px
    else:
        lx, ly, _, _, distance, rate = tether_span(problem, time, piece, y, cos, sin)
        pull, tz = tether_pull(n, distance, rate)
        tx, ty = pull * lx / distance, pull * ly / distance
    wx = tx + n[MASS] * (cos * n[GRAVITY_X] + sin * n[GRAVITY_Y])
    wy = ty + n[MASS] * (cos * n[GRAVITY_Y] - sin * n[GRAVITY_X])
    # At rest friction is −w, so its moment at the height of the centre of mass is known.
    load = n[MASS] * n[GRAVITY_N] - tz
    about_y = n[ABOVE] * tx - tz * n[ANCHOR_X] + n[HEIGHT] * wx
    about_x = n[ABOVE] * ty - tz * n[ANCHOR_Y] + n[HEIGHT] * wy
    frame = y[0], y[1], cos, sin
    if not _resting_pressure(problem, frame, (load, about_y, about_x), work):
        return -1.0
    return _excess(problem, (wx, wy, n[ANCHOR_X] * ty - n[ANCHOR_Y] * tx), load, work, twist)


@compiled(allocates=False)
def pull_borne(problem: TowProblem, work: Work, twist: Array) -> float:
    """Pull at the anchor [N] that the soles bear in any direction, beside nothing else and at the pressure in ``work``.

    That is from the last :func:`holding_margin`, whose ``twist`` stays. What is borne is convex and symmetric, so a
    pull (x, y) is where |x|/p + |y|/q ≤ 1, p and q the pulls borne along the axes of the body.
    """
    n = problem.numbers
    load = n[MASS] * n[GRAVITY_N]
    t0, t1, t2 = twist[0], twist[1], twist[2]
    twist[0] = twist[1] = twist[2] = 0.0
    p = load * (1 + _excess(problem, (load, 0.0, -n[ANCHOR_Y] * load), load, work, twist))
    twist[0] = twist[1] = twist[2] = 0.0
    q = load * (1 + _excess(problem, (0.0, load, n[ANCHOR_X] * load), load, work, twist))
    twist[0], twist[1], twist[2] = t0, t1, t2
    return p * q / math.hypot(p, q) if p > 0 and q > 0 else 0.0


@compiled(allocates=False)
def _resting_pressure(problem: TowProblem, frame: Frame, b: Loads, work: Work) -> bool:
    """The pressure of known loads; False where there is none. No height, for friction's moment is in the loads."""
    balance = solve_pressure(problem.soles, problem.regions, problem.holding, frame, (1.0, 0.0, 0.0), 0.0, b, work)
    contact_parts(problem.soles, problem.regions, frame, work)
    return balance == BALANCED


@compiled(allocates=False)
def _gradient(problem: TowProblem, work: Work, xi: Vector) -> Vector:
    """Slopes of D by (v_x, v_y, ω r), r the radius of the soles: minus the friction's wrench."""
    radius = problem.soles.numbers[RADIUS]
    unit_wrenches(problem.soles, problem.holding, xi[0], xi[1], xi[2] / radius, work)
    fx, fy, moment = product_3(work.matrices[W], work.pressure)
    return -fx, -fy, -moment / radius


@compiled(allocates=False)
def _excess(problem: TowProblem, wrench: Vector, load: float, work: Work, twist: Array) -> float:
    """The least D where w·ξ = 1, less one; lengths of the turning part by the radius of the soles."""
    radius = problem.soles.numbers[RADIUS]
    w0, w1, w2 = wrench[0], wrench[1], wrench[2] / radius
    size = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    if size < _NO_WRENCH * load:
        return np.inf
    along = twist[0] * w0 + twist[1] * w1 + twist[2] * w2
    length = math.sqrt(twist[0] * twist[0] + twist[1] * twist[1] + twist[2] * twist[2])
    if not along > 1e-3 * size * length:
        twist[0], twist[1], twist[2], along = w0, w1, w2, size * size
    a, b, c = twist[0] / along, twist[1] / along, twist[2] / along
    step, best = (0.0, 0.0, 0.0), np.inf
    for _ in range(_NEWTON_LIMIT):
        g0, g1, g2 = _gradient(problem, work, (a, b, c))
        value = g0 * a + g1 * b + g2 * c
        if value > best * (1 + 1e-15):  # Too far: go back half of the step.
            step = 0.5 * step[0], 0.5 * step[1], 0.5 * step[2]
            a, b, c = twist[0] + step[0], twist[1] + step[1], twist[2] + step[2]
            if abs(step[0]) + abs(step[1]) + abs(step[2]) < 1e-13 * (abs(a) + abs(b) + abs(c)):
                break
            continue
        settled = best - value < _SETTLED * value
        best = value
        twist[0], twist[1], twist[2] = a, b, c
        if settled or not _newton_step(problem, work, (a, b, c), (g0, g1, g2), (w0, w1, w2), radius):
            break
        # The step stands in the first row of the scratch matrix.
        step = work.matrices[SCRATCH, 0, 0], work.matrices[SCRATCH, 0, 1], work.matrices[SCRATCH, 0, 2]
        a, b, c = a + step[0], b + step[1], c + step[2]
    return best - 1.0


@compiled(allocates=False)
def _newton_step(problem: TowProblem, work: Work, xi: Vector, g: Vector, w: Vector, radius: float) -> bool:
    """Newton's step of D along w·ξ = const into the first row of the scratch matrix.

    D is homogeneous, so its Hessian is singular along ξ; a multiple of ξ ξᵀ fills that in and does not move the step.
    """
    wrench_slopes(problem.soles, problem.holding, xi[0], xi[1], xi[2] / radius, work)
    slopes, m, s = work.matrices[J], work.matrices[SCRATCH], work.matrices[S]
    norm = xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]
    fill = (abs(slopes[0, 0]) + abs(slopes[1, 1]) + abs(slopes[2, 2]) / (radius * radius)) / norm
    for i in range(3):
        for j in range(3):
            share = (1 / radius if i == 2 else 1.0) * (1 / radius if j == 2 else 1.0)
            m[i, j] = fill * xi[i] * xi[j] - slopes[i, j] * share
    if not inverse_3(m, s):
        return False
    u0, u1, u2 = product_3(s, g)
    v0, v1, v2 = product_3(s, w)
    multiplier = (u0 * w[0] + u1 * w[1] + u2 * w[2]) / (v0 * w[0] + v1 * w[1] + v2 * w[2])
    m[0, 0], m[0, 1], m[0, 2] = multiplier * v0 - u0, multiplier * v1 - u1, multiplier * v2 - u2
    return bool(np.isfinite(multiplier))
