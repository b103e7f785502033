"""The motion of a towed object on elasto-plastic bristles, with heights and slope: the reference for sticking.

Each cell of the footprint stands on a bristle that bends until its force reaches μ(v) p and then slides along: an
object below the limit of friction bends its bristles by some micrometres and stays. Pressure, tether and inertia are
those of a rigid body in three dimensions that does not tilt; a cell can only push. Time is stepped by semi-implicit
Euler, without events, tables, boundaries of patches or modes: what this and :mod:`towval.physics` have in common is the
model on paper.

SOURCE of the bristles: Dahl 1976; Hayward and Armstrong 2000 (elasto-plastic, without drift); Canudas de Wit et al.
1995 (LuGre, with an exponential Stribeck curve).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array
from towval.model.compiling import compiled
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import RefusedError

HingeMotion = Callable[[Array], tuple[Array, Array]]
"""Places and velocities (n, 2), (n, 2) [m, m/s] of the hinge over the floor at times (n,) [s]."""

_DAMPING_S_PER_M = 20.0  # of a bristle that sticks, over its limit force; it dies out the ringing of 100 Hz
_TIPPED, _TRIALS = 1e-6, 30
_FALLEN, _HUNDREDTH = (
    float(np.arctanh(0.99)),
    float(np.log(100)),
)  # at the friction velocity so much of the peak remains


@dataclass(frozen=True)
class TetherAtHeight:
    """A tether that pulls κ (e ((1 − σ) + σ κ e / full_load)) + c ė along itself, e ≥ 0 its stretch.

    ``rest_length`` [m], ``stiffness`` κ [N/m], ``damping`` c [N s/m], ``stiffening`` σ [1] with ``full_load`` [N],
    ``hinge_height`` and ``anchor_height`` over the floor [m].
    """

    rest_length: float
    stiffness: float
    damping: float = 0.0
    stiffening: float = 0.0
    full_load: float = 1.0
    hinge_height: float = 0.0
    anchor_height: float = 0.0


@dataclass(frozen=True)
class BristledObject:
    """A rigid object on cells, in its body frame.

    ``places`` (n, 2) [m] and ``areas`` (n,) [m²] of the cells; ``mass`` [kg]; ``centre`` (2,) of mass [m] and its
    ``centre_height`` [m]; ``inertia`` about the vertical through it [kg m²]; ``anchor`` (2,) [m]; friction falls from
    ``static`` to ``kinetic`` [1], to a hundredth of the difference at ``friction_velocity`` [m/s], and holds along x,
    ``across_over_along`` times that along y; ``deflection`` of a bristle at the static limit [m]. ``lugre``: bristles
    and Stribeck curve as LuGre's. ``stripe`` (x, y, direction x, direction y, length [m], factor): floor of another
    friction from a point on.
    """

    places: Array
    areas: Array
    mass: float
    centre: tuple[float, float]
    centre_height: float
    inertia: float
    anchor: tuple[float, float]
    static: float
    kinetic: float
    friction_velocity: float
    across_over_along: float = 1.0
    deflection: float = 1e-5
    lugre: bool = False
    stripe: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0)


def cells_of(rectangles: Sequence[ArrayLike], count: int) -> tuple[Array, Array]:
    """Places (n, 2) [m] and areas (n,) [m²] of ``count`` × ``count`` cells in each rectangle along the axes."""
    places, areas = [], []
    middle = (np.arange(count) + 0.5) / count
    for ring in rectangles:
        corners = np.asarray(ring, dtype=np.float64)
        low, size = corners.min(axis=0), np.ptp(corners, axis=0)
        x, y = np.meshgrid(low[0] + size[0] * middle, low[1] + size[1] * middle)
        places.append(np.column_stack([x.ravel(), y.ravel()]))
        areas.append(np.full(count * count, size.prod() / count**2))
    return np.concatenate(places), np.concatenate(areas)


def bristle_tow(
    towed: BristledObject,
    tether: TetherAtHeight,
    hinge: HingeMotion,
    start_pose: ArrayLike,
    duration: float,
    *,
    slope: tuple[float, float] = (0.0, 0.0),
    report_s: float = 0.05,
    step_s: float = 1e-4,
) -> tuple[Array, Array, Array]:
    """Times (n,) [s], poses (n, 3) of the body frame [m, m, rad] and pull of the tether (n,) [N], from rest.

    Parameters
    ----------
    towed, tether
        What is towed, and by what.
    hinge : callable
    start_pose : array_like (3,)
    duration : float
        Of the tow [s].
    slope : (float, float), optional
        Rise of the floor along its x and y [1].
    report_s, step_s : float, optional
        Time between reports, and of a step [s]: a hundredth of a bristle's period or less.

    Raises
    ------
    RefusedError
        Where the object tips: where what still presses is less than a millionth of the footprint's moments, or
        where no pressure balances the loads.
    """
    every = round(report_s / step_s)
    reports = round(duration / report_s) + 1
    places, velocities = hinge(np.arange((reports - 1) * every + 1, dtype=np.float64) * step_s)
    arms = towed.places - np.array(towed.centre)
    x, y, heading = np.asarray(start_pose, dtype=np.float64)
    lever = np.array(towed.anchor) - np.array(towed.centre)
    start = np.array([*(np.array([x, y]) + _turned(heading, np.array(towed.centre))), heading, 0.0, 0.0, 0.0])
    gravity = GRAVITY_M_PER_S2 * np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + np.dot(slope, slope))
    body = np.array([towed.mass, towed.inertia, towed.centre_height, tether.anchor_height, *lever, *gravity])
    friction = np.array(
        [
            towed.static, towed.kinetic, towed.friction_velocity, towed.across_over_along, towed.deflection,
            float(towed.lugre), *towed.stripe,
        ]
    )  # fmt: skip
    drop = tether.hinge_height - tether.anchor_height
    rope = np.array([tether.rest_length, tether.stiffness, tether.damping, tether.stiffening, tether.full_load, drop])
    states = np.full((reports, 7), np.nan)
    cells = np.column_stack([arms, towed.areas])
    tipped = _advance(cells, body, friction, rope, places, velocities, start, step_s, states)
    if tipped:
        raise RefusedError("the object tips", got=f"after {tipped * step_s:.3g} s")
    turned = np.array([_turned(row[2], np.array(towed.centre)) for row in states])
    poses = np.column_stack([states[:, :2] - turned, states[:, 2]])
    return np.arange(reports, dtype=np.float64) * report_s, poses, states[:, 6]


def _turned(heading: float, point: Array) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


@compiled()
def _advance(cells, body, friction, rope, places, velocities, state, step, states):
    """Steps in all; the number of the step in which the object tips, or 0."""
    bent, pressing, plane = np.zeros((len(cells), 2)), np.zeros((3, 3)), np.array([1.0, 0.0, 0.0])
    pull, drag = np.zeros(3), np.zeros(3)
    _press(cells, plane, pressing)
    whole = _determinant(pressing)
    count = len(places) - 1
    every = count // (len(states) - 1)
    for k in range(count + 1):
        c, s = np.cos(state[2]), np.sin(state[2])
        _pull(body, rope, places[k], velocities[k], state, c, s, pull)
        if k % every == 0:
            states[k // every, :6] = state
            states[k // every, 6] = np.sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2)
        if not _balance(cells, body, pull, drag, whole, plane, pressing):
            return max(k, 1)
        _drag(cells, plane, friction, state, c, s, step, bent, drag)
        mass, inertia, lever_x, lever_y = body[0], body[1], body[4], body[5]
        along, across = (pull[0] + drag[0]) / mass, (pull[1] + drag[1]) / mass
        state[3] += step * (c * along - s * across + body[6])
        state[4] += step * (s * along + c * across + body[7])
        state[5] += step * (drag[2] + lever_x * pull[1] - lever_y * pull[0]) / inertia
        for i in range(3):
            state[i] += step * state[3 + i]
    return 0


@compiled(allocates=False)
def _pull(body, rope, place, velocity, state, c, s, pull):
    """Force of the tether (3,) [N] in body axes, up positive."""
    dx, dy = place[0] - state[0], place[1] - state[1]
    lever_x, lever_y = body[4], body[5]
    x, y = c * dx + s * dy - lever_x, -s * dx + c * dy - lever_y
    vx, vy = velocity[0] - state[3], velocity[1] - state[4]
    closing_x, closing_y = c * vx + s * vy + state[5] * lever_y, -s * vx + c * vy - state[5] * lever_x
    length = np.sqrt(x * x + y * y + rope[5] * rope[5])
    stretch, force = length - rope[0], 0.0
    if stretch >= 0:
        stiffness = rope[1] * ((1 - rope[3]) + rope[3] * rope[1] * stretch / rope[4])
        force = max(0.0, stiffness * stretch + rope[2] * (x * closing_x + y * closing_y) / length)
    pull[0], pull[1], pull[2] = force * x / length, force * y / length, force * rope[5] / length


@compiled(allocates=False)
def _balance(cells, body, pull, drag, whole, plane, pressing):
    """Pressure (3,) of the pull and of the friction one step ago, and moments of what it presses. False: it tips.

    A plane on the cells that press, anew until these stay the same; half-way back where next to none would be left.
    """
    lift = body[0] * body[8] - pull[2]
    over = body[3] - body[2]  # anchor over centre of mass
    tip_x = over * pull[0] - pull[2] * body[4] - body[2] * drag[0]
    tip_y = over * pull[1] - pull[2] * body[5] - body[2] * drag[1]
    count = -1
    for _ in range(_TRIALS):
        p0, px, py = _plane(pressing, lift, tip_x, tip_y)
        change_0, change_x, change_y = p0 - plane[0], px - plane[1], py - plane[2]
        plane[0], plane[1], plane[2] = p0, px, py
        pressed = _press(cells, plane, pressing)
        for _ in range(_TRIALS):
            if _determinant(pressing) > _TIPPED * whole:
                break
            change_0, change_x, change_y = change_0 / 2, change_x / 2, change_y / 2
            plane[0] -= change_0
            plane[1] -= change_x
            plane[2] -= change_y
            pressed = _press(cells, plane, pressing)
        if not _determinant(pressing) > _TIPPED * whole:
            return False
        if pressed == count:
            return True
        count = pressed
    return False


@compiled(allocates=False)
def _press(cells, plane, pressing):
    """Number of the cells that a plane presses, and the moments (3, 3) of their area, upper half."""
    pressing[:] = 0.0
    count = 0
    for i in range(len(cells)):
        x, y, area = cells[i, 0], cells[i, 1], cells[i, 2]
        if plane[0] + plane[1] * x + plane[2] * y > 0:
            count += 1
            pressing[0, 0] += area
            pressing[0, 1] += area * x
            pressing[0, 2] += area * y
            pressing[1, 1] += area * x * x
            pressing[1, 2] += area * x * y
            pressing[2, 2] += area * y * y
    return count


@compiled(allocates=False)
def _drag(cells, plane, friction, state, c, s, step, bent, drag):
    """Friction on all cells, force and moment (3,) in body axes; bends the bristles, and lets go of lifted ones."""
    static, kinetic, fall, stretched, deflection, lugre = friction[:6]
    ux, uy, spin = c * state[3] + s * state[4], -s * state[3] + c * state[4], state[5]
    drag[:] = 0.0
    for i in range(len(cells)):
        x, y = cells[i, 0], cells[i, 1]
        load = (plane[0] + plane[1] * x + plane[2] * y) * cells[i, 2]
        if load <= 0:
            bent[i, 0] = bent[i, 1] = 0.0
            continue
        vx, vy = ux - spin * y, stretched * (uy + spin * x)
        speed = np.sqrt(vx * vx + vy * vy)
        into = (state[0] + c * x - s * y - friction[6]) * friction[8] + (
            state[1] + s * x + c * y - friction[7]
        ) * friction[9]
        if 0 <= into < friction[10]:
            load *= friction[11]
        damping = load * static * _DAMPING_S_PER_M
        bx, by = bent[i, 0] + vx * step, bent[i, 1] + vy * step
        if lugre > 0:
            limit = deflection * (1 - (1 - kinetic / static) * (1 - np.exp(-_HUNDREDTH * (speed / fall) ** 2)))
            # Linear in the bristle: implicit in it, so that no step is too long for its rate.
            bx, by = bx / (1 + step * speed / limit), by / (1 + step * speed / limit)
            vx, vy = (bx - bent[i, 0]) / step, (by - bent[i, 1]) / step
        else:
            size, limit = (
                np.sqrt(bx * bx + by * by),
                deflection * (1 - (1 - kinetic / static) * np.tanh(_FALLEN * speed / fall)),
            )
            if size > limit:
                bx, by, damping = bx * limit / size, by * limit / size, 0.0
        bent[i, 0], bent[i, 1] = bx, by
        fx = -load * static / deflection * bx - damping * vx
        fy = -(load * static / deflection * by + damping * vy) * stretched
        drag[0] += fx
        drag[1] += fy
        drag[2] += x * fy - y * fx


@compiled(allocates=False)
def _determinant(m):
    """Of the symmetric matrix whose upper half is given."""
    minor = m[0, 1] * m[2, 2] - m[1, 2] * m[0, 2]
    return (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] ** 2)
        - m[0, 1] * minor
        + m[0, 2] * (m[0, 1] * m[1, 2] - m[1, 1] * m[0, 2])
    )


@compiled(allocates=False)
def _plane(m, lift, tip_x, tip_y):
    """Pressure 1, x, y [Pa, Pa/m, Pa/m] with a resultant, by the adjugate."""
    a00, a01 = m[1, 1] * m[2, 2] - m[1, 2] ** 2, m[0, 2] * m[1, 2] - m[0, 1] * m[2, 2]
    a02, a12 = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1], m[0, 1] * m[0, 2] - m[0, 0] * m[1, 2]
    a11, a22 = m[0, 0] * m[2, 2] - m[0, 2] ** 2, m[0, 0] * m[1, 1] - m[0, 1] ** 2
    whole = m[0, 0] * a00 + m[0, 1] * a01 + m[0, 2] * a02
    return (
        (a00 * lift + a01 * tip_x + a02 * tip_y) / whole,
        (a01 * lift + a11 * tip_x + a12 * tip_y) / whole,
        (a02 * lift + a12 * tip_x + a22 * tip_y) / whole,
    )
