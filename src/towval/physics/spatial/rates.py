"""Rates of the motion in three dimensions and their slopes, in closed form.

State ``y = (x_G, y_G, ϑ, ẋ_G, ẏ_G, ω)`` in floor axes, as in :mod:`towval.physics.motion`. The body stays flat on the
floor, so heights enter by the pressure alone. In body axes about G, with the tether's force (T_x, T_y, T_z) at q, the
loads without friction are ``b = (m g_n − T_z, −T_z q_x + h T_x, −T_z q_y + h T_y)``, h the anchor's height over G.

Slopes: a change du of the twist moves the friction by ``g = J du`` at a fixed pressure; the pressure moves by
``dx = S (db − C g)``, so friction moves by ``g + W dx``. The edge of the contact adds nothing, for p = 0 there. A
region of the floor whose edge passes under the soles adds to g as the body moves and turns.
"""

from __future__ import annotations

import math

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.motion import FORCED, SLACK, TAUT
from towval.physics.rosenbrock import product_3
from towval.physics.spatial.hanging import damped, following_forces, hanging_forces, hanging_pull
from towval.physics.spatial.pressure import BALANCED, solve_pressure
from towval.physics.spatial.problem import (
    ABOVE,
    ANCHOR_X,
    ANCHOR_Y,
    DAMPING,
    FULL_STRETCH,
    GRAVITY_N,
    GRAVITY_X,
    GRAVITY_Y,
    HEIGHT,
    INERTIA,
    KAPPA,
    MASS,
    REST,
    RISE,
    STIFFENING,
    TETHER_WEIGHT,
    TowProblem,
)
from towval.physics.spatial.region_edges import region_slopes
from towval.physics.spatial.soles import ACTIVE, Work
from towval.physics.spatial.unit_wrenches import MOVED, J, S, W, wrench_slopes
from towval.physics.splines import piece_at, spline_at

_NO_EDGE = 3  # in place of x, y and heading
_LEAST_DISTANCE = 1e-9  # m; below it a hinge is straight above the anchor, and pulls in no direction along the floor

Span = tuple[float, float, float, float, float, float]
"""From anchor to hinge along the floor, its rate, both as vectors in body axes; their length and the rate of that."""

Pull = tuple[float, float, float, float, float, float]
"""Horizontal and vertical force [N]; slopes of both by the horizontal distance, then by its rate."""


@compiled(allocates=False)
def tether_span(problem: TowProblem, time: float, piece: int, y: Array, cos: float, sin: float) -> Span:
    """Horizontal vector from anchor to hinge, its rate, its length and the rate of that [m, m/s], body axes."""
    n = problem.numbers
    px, py, px_dot, py_dot, _, _ = spline_at(problem.drive.knots, problem.drive.coefficients, time, piece)
    dx, dy = px - y[0], py - y[1]
    lx, ly = cos * dx + sin * dy - n[ANCHOR_X], cos * dy - sin * dx - n[ANCHOR_Y]
    dx, dy = px_dot - y[3], py_dot - y[4]
    rx, ry = cos * dx + sin * dy + y[5] * n[ANCHOR_Y], cos * dy - sin * dx - y[5] * n[ANCHOR_X]
    distance = max(math.sqrt(lx * lx + ly * ly), _LEAST_DISTANCE)
    return lx, ly, rx, ry, distance, (lx * rx + ly * ry) / distance


@compiled(allocates=False)
def stretch_and_tension(n: Array, distance: float, rate: float) -> tuple[float, float, float, float]:
    """Length, stretch [m], tension [N] if the tether could also push, and its slope by the stretch [N/m]."""
    length = math.sqrt(distance * distance + n[RISE] * n[RISE])
    stretch, kappa, share = length - n[REST], n[KAPPA], n[STIFFENING]
    steeper = share * max(0.0, stretch) / n[FULL_STRETCH]
    tension = kappa * stretch * (1 - share + steeper) + n[DAMPING] * distance * rate / length
    return length, stretch, tension, kappa * (1 - share + 2 * steeper)


@compiled(allocates=False)
def taut_pull(n: Array, distance: float, rate: float) -> Pull:
    """Force of a straight taut tether at the anchor: horizontal towards the hinge, vertical upward, and slopes."""
    length, _, tension, stiffness = stretch_and_tension(n, distance, rate)
    rise, cosine = n[RISE], distance / length
    sine, damping = rise / length, n[DAMPING]
    by_distance = stiffness * cosine + damping * rate * sine * sine / length
    by_rate = damping * cosine
    return (
        tension * cosine,
        tension * sine,
        by_distance * cosine + tension * sine * sine / length,
        by_distance * sine - tension * sine * cosine / length,
        by_rate * cosine,
        by_rate * sine,
    )


@compiled(allocates=False)
def tether_pull(n: Array, distance: float, rate: float) -> tuple[float, float]:
    """Horizontal and vertical force at the anchor [N]; zero where a tether without mass is slack."""
    if n[TETHER_WEIGHT] > 0:
        return damped(n, hanging_forces(n, distance), rate)
    _, stretch, tension, _ = stretch_and_tension(n, distance, rate)
    if stretch < 0 or tension < 0:
        return 0.0, 0.0
    pull, lift, _, _, _, _ = taut_pull(n, distance, rate)
    return pull, lift


@compiled(allocates=False, forceinline=True)
def accelerations(problem: TowProblem, mode: int, time: float, piece: int, y: Array, work: Work, rates: Array) -> int:
    """Time derivative of the state into ``rates`` (6,); pressure, W and S into ``work``. Returns its balance."""
    n = problem.numbers
    cos, sin, omega = math.cos(y[2]), math.sin(y[2]), y[5]
    tx = ty = tz = 0.0
    if mode == TAUT:
        lx, ly, _, _, distance, rate = tether_span(problem, time, piece, y, cos, sin)
        if n[TETHER_WEIGHT] > 0:
            pull, tz = damped(n, following_forces(n, distance, work.hanging), rate)
        else:
            pull, tz, _, _, _, _ = taut_pull(n, distance, rate)
        tx, ty = pull * lx / distance, pull * ly / distance
    elif mode == FORCED:
        px, py, _, _, _, _ = spline_at(problem.drive.knots, problem.drive.coefficients, time, piece)
        tx, ty = cos * px + sin * py, cos * py - sin * px
    loads = n[MASS] * n[GRAVITY_N] - tz, n[ABOVE] * tx - tz * n[ANCHOR_X], n[ABOVE] * ty - tz * n[ANCHOR_Y]
    twist = cos * y[3] + sin * y[4], cos * y[4] - sin * y[3], omega
    frame = y[0], y[1], cos, sin
    balance = solve_pressure(problem.soles, problem.regions, problem.sliding, frame, twist, n[HEIGHT], loads, work)
    fx, fy, moment = product_3(work.matrices[W], work.pressure)
    fx, fy, moment = fx + tx, fy + ty, moment + n[ANCHOR_X] * ty - n[ANCHOR_Y] * tx
    rates[0], rates[1], rates[2] = y[3], y[4], omega
    rates[3] = (cos * fx - sin * fy) / n[MASS] + n[GRAVITY_X]
    rates[4] = (sin * fx + cos * fy) / n[MASS] + n[GRAVITY_Y]
    rates[5] = moment / n[INERTIA]
    return balance


@compiled(allocates=False)
def acceleration_slopes(
    problem: TowProblem,
    mode: int,
    time: float,
    piece: int,
    y: Array,
    work: Work,
    rates: Array,
    jacobian: Array,
    time_slope: Array,
) -> int:
    """Rates (6,), slopes of the accelerations by the state (3, 6) and by time (3,). Returns the balance."""
    balance = accelerations(problem, mode, time, piece, y, work, rates)
    if balance != BALANCED:
        return balance
    n, turned = problem.numbers, (math.cos(y[2]), math.sin(y[2]))
    cos, sin = turned
    ux, uy = cos * y[3] + sin * y[4], cos * y[4] - sin * y[3]
    wrench_slopes(problem.soles, problem.sliding, ux, uy, y[5], work)
    on_edge = work.counts[ACTIVE] > problem.soles.parts.shape[0]
    if on_edge:
        frame, twist = (y[0], y[1], cos, sin), (ux, uy, y[5])
        region_slopes(problem.soles, problem.regions, problem.sliding, frame, twist, work)
    mass, inertia = n[MASS], n[INERTIA]
    span, pull = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if mode == TAUT:
        span = tether_span(problem, time, piece, y, cos, sin)
        hangs = n[TETHER_WEIGHT] > 0
        pull = hanging_pull(n, span[4], span[5], work.hanging) if hangs else taut_pull(n, span[4], span[5])
    for j in range(7):
        dtx, dty, dtz = 0.0, 0.0, 0.0
        if mode == TAUT:
            dtx, dty, dtz = _tether_column(problem, time, piece, y[5], turned, span, pull, j)
        elif mode == FORCED:
            dtx, dty = _force_column(problem, time, piece, turned, j)
        dux = uy if j == 2 else (cos if j == 3 else (sin if j == 4 else 0.0))
        duy = -ux if j == 2 else (-sin if j == 3 else (cos if j == 4 else 0.0))
        a, b, c = _column(n, work, (dux, duy, 1.0 if j == 5 else 0.0), (dtx, dty, dtz), j if on_edge else _NO_EDGE)
        along, across = (cos * a - sin * b) / mass, (sin * a + cos * b) / mass
        if j == 2:  # The force turns with the body.
            along -= rates[4] - n[GRAVITY_Y]
            across += rates[3] - n[GRAVITY_X]
        if j < 6:
            jacobian[0, j], jacobian[1, j], jacobian[2, j] = along, across, c / inertia
        else:
            time_slope[0], time_slope[1], time_slope[2] = along, across, c / inertia
    return balance


@compiled(allocates=False)
def _column(
    n: Array, work: Work, du: tuple[float, float, float], dt: tuple[float, float, float], moved: int
) -> tuple[float, float, float]:
    """Change of force (body axes) and moment with the twist and the tether's force.

    ``moved``: which of place and heading changes over the edge of a region, :data:`_NO_EDGE` where none does.
    """
    wrench = work.matrices[W]
    g0, g1, g2 = product_3(work.matrices[J], du)
    if moved < _NO_EDGE:
        over = work.matrices[MOVED]
        g0, g1, g2 = g0 + over[0, moved], g1 + over[1, moved], g2 + over[2, moved]
    r0 = -dt[2]
    r1 = n[ABOVE] * dt[0] - n[ANCHOR_X] * dt[2] - n[HEIGHT] * g0
    r2 = n[ABOVE] * dt[1] - n[ANCHOR_Y] * dt[2] - n[HEIGHT] * g1
    x0, x1, x2 = product_3(work.matrices[S], (r0, r1, r2))
    return (
        g0 + wrench[0, 0] * x0 + wrench[0, 1] * x1 + wrench[0, 2] * x2 + dt[0],
        g1 + wrench[1, 0] * x0 + wrench[1, 1] * x1 + wrench[1, 2] * x2 + dt[1],
        g2 + wrench[2, 0] * x0 + wrench[2, 1] * x1 + wrench[2, 2] * x2 + n[ANCHOR_X] * dt[1] - n[ANCHOR_Y] * dt[0],
    )


@compiled(allocates=False)
def _force_column(
    problem: TowProblem, time: float, piece: int, turned: tuple[float, float], j: int
) -> tuple[float, float]:
    """Change of a given force, in body axes, with the heading (2) and time (6)."""
    px, py, px_dot, py_dot, _, _ = spline_at(problem.drive.knots, problem.drive.coefficients, time, piece)
    cos, sin = turned
    if j == 2:
        return cos * py - sin * px, -cos * px - sin * py
    if j == 6:
        return cos * px_dot + sin * py_dot, cos * py_dot - sin * px_dot
    return 0.0, 0.0


@compiled(allocates=False)
def _tether_column(
    problem: TowProblem,
    time: float,
    piece: int,
    omega: float,
    turned: tuple[float, float],
    span: Span,
    force: Pull,
    j: int,
) -> tuple[float, float, float]:
    """Change of the tether's force, in body axes, with the state (0 to 5) or time (6)."""
    n, (cos, sin) = problem.numbers, turned
    qx, qy = n[ANCHOR_X], n[ANCHOR_Y]
    lx, ly, rx, ry, distance, rate = span
    pull, _, h_d, v_d, h_r, v_r = force
    dlx = dly = drx = dry = 0.0
    if j == 0:
        dlx, dly = -cos, sin
    elif j == 1:
        dlx, dly = -sin, -cos
    elif j == 2:
        dlx, dly = ly + qy, -(lx + qx)
        drx, dry = ry + omega * qx, -(rx - omega * qy)
    elif j == 3:
        drx, dry = -cos, sin
    elif j == 4:
        drx, dry = -sin, -cos
    elif j == 5:
        drx, dry = qy, -qx
    else:
        _, _, px_dot, py_dot, px_ddot, py_ddot = spline_at(problem.drive.knots, problem.drive.coefficients, time, piece)
        dlx, dly = cos * px_dot + sin * py_dot, cos * py_dot - sin * px_dot
        drx, dry = cos * px_ddot + sin * py_ddot, cos * py_ddot - sin * px_ddot
    nx, ny = lx / distance, ly / distance
    closer = nx * dlx + ny * dly
    faster = (dlx * rx + dly * ry + lx * drx + ly * dry) / distance - rate * closer / distance
    d_pull = h_d * closer + h_r * faster
    return (
        d_pull * nx + pull * (dlx - nx * closer) / distance,
        d_pull * ny + pull * (dly - ny * closer) / distance,
        v_d * closer + v_r * faster,
    )


@compiled(allocates=False)
def tautness(problem: TowProblem, time: float, piece: int, y: Array) -> tuple[float, float, float]:
    """Length [m], stretch [m] and tension [N], negative where the tether would have to push."""
    _, _, _, _, distance, rate = tether_span(problem, time, piece, y, math.cos(y[2]), math.sin(y[2]))
    length, stretch, tension, _ = stretch_and_tension(problem.numbers, distance, rate)
    return length, stretch, tension


@compiled(allocates=False)
def natural_mode(problem: TowProblem, time: float, piece: int, y: Array) -> int:
    """TAUT where the tether is stretched and would pull, and always where it has mass, else SLACK."""
    if problem.numbers[TETHER_WEIGHT] > 0:
        return TAUT
    _, stretch, tension = tautness(problem, time, piece, y)
    return TAUT if stretch >= 0 and tension >= 0 else SLACK


@compiled(allocates=False)
def tensions(problem: TowProblem, times: Array, states: Array, out: Array) -> None:
    """Length of the tether [m] and its horizontal force on the object (2) [N], floor axes, into ``out`` (n, 3)."""
    piece = 0
    for i in range(len(states)):
        y = states[i]
        piece = piece_at(problem.drive.knots, times[i], piece)
        cos, sin = math.cos(y[2]), math.sin(y[2])
        lx, ly, _, _, distance, rate = tether_span(problem, times[i], piece, y, cos, sin)
        length, _, _, _ = stretch_and_tension(problem.numbers, distance, rate)
        pull, _ = tether_pull(problem.numbers, distance, rate)
        share = pull / distance if distance > 0 else 0.0
        out[i, 0], out[i, 1], out[i, 2] = length, share * (cos * lx - sin * ly), share * (sin * lx + cos * ly)
