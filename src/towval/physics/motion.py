"""The planar body on its patch, pulled by a tether or a given force: rates, slopes and events, compiled.

SOURCE: eqs. (9) to (12), with the centre of mass G as the point Π. State ``y = (x_G, y_G, ϑ, ẋ_G, ẏ_G, ω)`` in the
floor frame.
"""

import math
from typing import NamedTuple

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.splines import Spline, piece_at, spline_at
from towval.physics.tether import stretch_and_pull
from towval.physics.wrench import SlidingPatch, wrench_and_slopes, wrench_at_origin

SLACK, TAUT, FORCED = 0, 1, 2
"""What acts on the anchor: nothing, the tether, a force given over time."""


class MotionProblem(NamedTuple):
    """What stays the same during a motion, laid out for compiled code.

    ``body`` (6,): mass [kg], inertia [kg m²], place of ``patch.origin`` and of the anchor relative to G in body axes
    [m]; ``tether`` (3,): κ [N/m], l0 [m], c [N s/m]; ``drive`` the hinge's path [m] or the force on the anchor [N].
    """

    patch: SlidingPatch
    body: Array
    tether: Array
    drive: Spline


@compiled(allocates=False, forceinline=True)
def accelerations(scene: MotionProblem, mode: int, time: float, piece: int, y: Array, rates: Array) -> None:
    """Time derivative of the state into ``rates`` (6,)."""
    mass, inertia, ox, oy, bx, by = scene.body
    cos, sin = math.cos(y[2]), math.sin(y[2])
    vx, vy, omega = y[3], y[4], y[5]
    fx, fy, moment = wrench_at_origin(
        scene.patch, cos * vx + sin * vy - omega * oy, cos * vy - sin * vx + omega * ox, omega
    )
    moment += ox * fy - oy * fx
    force_x, force_y = cos * fx - sin * fy, sin * fx + cos * fy
    if mode != SLACK:
        qx, qy = cos * bx - sin * by, sin * bx + cos * by
        px, py, px_dot, py_dot, _, _ = spline_at(scene.drive.knots, scene.drive.coefficients, time, piece)
        if mode == TAUT:
            lx, ly = px - y[0] - qx, py - y[1] - qy
            length, _, pull = stretch_and_pull(lx, ly, px_dot - vx + omega * qy, py_dot - vy - omega * qx, scene.tether)
            px, py = pull * lx / length, pull * ly / length
        force_x += px
        force_y += py
        moment += qx * py - qy * px
    rates[0], rates[1], rates[2] = vx, vy, omega
    rates[3], rates[4], rates[5] = force_x / mass, force_y / mass, moment / inertia


@compiled(allocates=False)
def acceleration_slopes(
    scene: MotionProblem, mode: int, time: float, piece: int, y: Array, rates: Array, jacobian: Array, time_slope: Array
) -> None:
    """Rates (6,), slopes of the accelerations by the state (3, 6) and by time (3,)."""
    mass, inertia, ox, oy, bx, by = scene.body
    cos, sin = math.cos(y[2]), math.sin(y[2])
    vx, vy, omega = y[3], y[4], y[5]
    ux, uy = cos * vx + sin * vy, cos * vy - sin * vx
    fx, fy, moment, xx, xy, yy, xw, yw, ww = wrench_and_slopes(scene.patch, ux - omega * oy, uy + omega * ox, omega)
    moment += ox * fy - oy * fx
    # From patch.origin to G: the twist there is B (v_G, ω), so the slopes are Bᵀ J B.
    ww += 2 * (ox * yw - oy * xw) + oy * oy * xx - 2 * ox * oy * xy + ox * ox * yy
    xw, yw = xw - oy * xx + ox * xy, yw - oy * xy + ox * yy
    force_x, force_y = cos * fx - sin * fy, sin * fx + cos * fy
    # To floor axes.
    cc, ss, cs = cos * cos, sin * sin, cos * sin
    xx, xy, yy = cc * xx - 2 * cs * xy + ss * yy, cs * (xx - yy) + (cc - ss) * xy, ss * xx + 2 * cs * xy + cc * yy
    xw, yw = cos * xw - sin * yw, sin * xw + cos * yw
    for j in range(3):
        time_slope[j] = 0.0
        for i in range(3):
            jacobian[j, i] = 0.0
    jacobian[0, 3], jacobian[0, 4], jacobian[0, 5] = xx, xy, xw
    jacobian[1, 3], jacobian[1, 4], jacobian[1, 5] = xy, yy, yw
    jacobian[2, 3], jacobian[2, 4], jacobian[2, 5] = xw, yw, ww
    # Turning the body by dϑ turns the force and shows the body a velocity turned by −dϑ.
    jacobian[0, 2] = -force_y + xx * vy - xy * vx
    jacobian[1, 2] = force_x + xy * vy - yy * vx
    jacobian[2, 2] = xw * vy - yw * vx
    if mode != SLACK:
        qx, qy = cos * bx - sin * by, sin * bx + cos * by
        if mode == TAUT:
            tx, ty = _tether_slopes(scene, time, piece, y, qx, qy, jacobian, time_slope)
        else:
            tx, ty, tx_dot, ty_dot, _, _ = spline_at(scene.drive.knots, scene.drive.coefficients, time, piece)
            time_slope[0], time_slope[1], time_slope[2] = tx_dot, ty_dot, qx * ty_dot - qy * tx_dot
            jacobian[2, 2] -= qx * tx + qy * ty
        force_x += tx
        force_y += ty
        moment += qx * ty - qy * tx
    for j in range(6):
        jacobian[0, j] /= mass
        jacobian[1, j] /= mass
        jacobian[2, j] /= inertia
    time_slope[0] /= mass
    time_slope[1] /= mass
    time_slope[2] /= inertia
    rates[0], rates[1], rates[2] = vx, vy, omega
    rates[3], rates[4], rates[5] = force_x / mass, force_y / mass, moment / inertia


@compiled(allocates=False)
def _tether_slopes(
    scene: MotionProblem, time: float, piece: int, y: Array, qx: float, qy: float, jacobian: Array, time_slope: Array
) -> tuple[float, float]:
    """Tether force; adds its slopes, and those of its moment, to ``jacobian`` and ``time_slope``."""
    px, py, px_dot, py_dot, px_ddot, py_ddot = spline_at(scene.drive.knots, scene.drive.coefficients, time, piece)
    kappa, _, damping = scene.tether
    omega = y[5]
    lx, ly = px - y[0] - qx, py - y[1] - qy
    rx, ry = px_dot - y[3] + omega * qy, py_dot - y[4] - omega * qx
    length, _, pull = stretch_and_pull(lx, ly, rx, ry, scene.tether)
    nx, ny = lx / length, ly / length
    tx, ty = pull * nx, pull * ny
    # dT/dl = (T/|l|)(I − n nᵀ) + n (κ n + c (I − n nᵀ) l̇/|l|)ᵀ.
    across = ry * nx - rx * ny
    ax, ay = kappa * nx - damping * across / length * ny, kappa * ny + damping * across / length * nx
    stiff = pull / length
    lxx, lxy = stiff * ny * ny + nx * ax, -stiff * nx * ny + nx * ay
    lyx, lyy = -stiff * nx * ny + ny * ax, stiff * nx * nx + ny * ay
    # By x, y: −dT/dl; by ϑ: −dT/dl S q, and c n (n · ω q) since l̇ holds −ω S q.
    turn = damping * omega * (nx * qx + ny * qy)
    tx_turn = lxx * qy - lxy * qx + turn * nx
    ty_turn = lyx * qy - lyy * qx + turn * ny
    lever = damping * (ny * qx - nx * qy)
    columns = (
        (0, -lxx, -lyx),
        (1, -lxy, -lyy),
        (2, tx_turn, ty_turn),
        (3, -damping * nx * nx, -damping * nx * ny),
        (4, -damping * nx * ny, -damping * ny * ny),
        (5, -lever * nx, -lever * ny),
    )
    for j, dx, dy in columns:
        jacobian[0, j] += dx
        jacobian[1, j] += dy
        jacobian[2, j] += qx * dy - qy * dx
    jacobian[2, 2] -= qx * tx + qy * ty
    stretching = damping * (nx * px_ddot + ny * py_ddot)
    tx_dot = lxx * px_dot + lxy * py_dot + stretching * nx
    ty_dot = lyx * px_dot + lyy * py_dot + stretching * ny
    time_slope[0] += tx_dot
    time_slope[1] += ty_dot
    time_slope[2] += qx * ty_dot - qy * tx_dot
    return tx, ty


@compiled(allocates=False)
def tautness(scene: MotionProblem, time: float, piece: int, y: Array) -> tuple[float, float, float]:
    """Length [m], stretch [m] and pull [N] of the tether, the pull negative where it would have to push."""
    cos, sin = math.cos(y[2]), math.sin(y[2])
    bx, by = scene.body[4], scene.body[5]
    qx, qy = cos * bx - sin * by, sin * bx + cos * by
    px, py, px_dot, py_dot, _, _ = spline_at(scene.drive.knots, scene.drive.coefficients, time, piece)
    return stretch_and_pull(
        px - y[0] - qx, py - y[1] - qy, px_dot - y[3] + y[5] * qy, py_dot - y[4] - y[5] * qx, scene.tether
    )


@compiled(allocates=False)
def natural_mode(scene: MotionProblem, time: float, y: Array) -> int:
    """TAUT where the tether is stretched and would pull, else SLACK."""
    _, stretch, pull = tautness(scene, time, piece_at(scene.drive.knots, time, 0), y)
    return TAUT if stretch >= 0 and pull >= 0 else SLACK


@compiled(allocates=False)
def tensions(scene: MotionProblem, times: Array, states: Array, out: Array) -> None:
    """Length of the tether [m] and its force on the object (2) [N], floor axes, at times and states into ``out``."""
    piece = 0
    for i in range(len(states)):
        y = states[i]
        piece = piece_at(scene.drive.knots, times[i], piece)
        length, stretch, pull = tautness(scene, times[i], piece, y)
        px, py, _, _, _, _ = spline_at(scene.drive.knots, scene.drive.coefficients, times[i], piece)
        cos, sin = math.cos(y[2]), math.sin(y[2])
        bx, by = scene.body[4], scene.body[5]
        share = max(0.0, pull) / length if stretch >= 0 else 0.0
        out[i, 0] = length
        out[i, 1] = share * (px - y[0] - cos * bx + sin * by)
        out[i, 2] = share * (py - y[1] - sin * bx - cos * by)


@compiled(allocates=False)
def margin(scene: MotionProblem, mode: int, time: float, piece: int, y: Array) -> float:
    """How far the tether is from changing between slack and taut [m]; negative once it should have changed."""
    if mode == FORCED:
        return np.inf
    _, stretch, pull = tautness(scene, time, piece, y)
    stretched_by: float = pull / scene.tether[0]
    if mode == TAUT:
        return stretched_by
    return -min(stretch, stretched_by)
