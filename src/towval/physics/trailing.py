"""The object follows the hinge without inertia: the rungs of the ladder below full dynamics.

The hinge's path is given, as in feedback dynamics, and the tether pulls with what friction takes. Three models of
friction: a point at the centre of pressure (the path is a tractrix), the ellipsoidal limit surface, the pressed
patch itself.

While the tether is taut, the anchor moves along it just so fast that its length stays what the pull asks for,
``l0 + T/κ``. With the direction of the pull known, balance gives the twist: from the normal of the ellipsoid in closed
form; for the patch from two equations, no force across the tether and no moment about the anchor, by Newton's method.
ASSUME: the twist's direction is that at the hinge's own speed along the tether.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionLaw, SimulatedMotion, Tether, TimedPath, TowedObject, locked
from towval.model.checks import instance_of
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import rotation, transform, velocity_at
from towval.physics.dynamics import ADVICE, Outcome, checked_times, resting_patch
from towval.physics.friction_table import coefficient_over_speed
from towval.physics.limit_surface import limit_surface
from towval.physics.splines import Spline, piece_at, spline_at, spline_covering, spline_values
from towval.physics.tether import refuse_beyond_plane
from towval.physics.wrench import SlidingPatch, wrench_and_slopes

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

TRACTRIX, LIMIT_SURFACE, PATCH = "tractrix", "limit surface", "quasi-static patch"
TRAILING_RUNGS = (TRACTRIX, LIMIT_SURFACE, PATCH)
_POINT, _ELLIPSOID, _WHOLE = range(3)  # the same for compiled code: what stands for the patch

_SHARES, _PLACES = (1 / 6, 1 / 3, 1 / 3, 1 / 6), (0.0, 0.5, 0.5, 1.0)  # of the stages of Runge-Kutta's step

_STRIDE = 0.05  # of the patch's radius: the hinge moves no further in a Runge-Kutta step
_LENGTH_STEPS = 3.0  # steps in which a wrong length dies out
_SLOWEST = 0.05  # of the hinge's mean speed: friction is not looked at below
_CREEP = 1e-9  # m/s, of a hinge that rests all along
_NEWTON_LIMIT = 40


class _Trail(NamedTuple):
    """What stays the same.

    ``drive``: the hinge's path; ``anchor`` (2,) from the centre of pressure [m]; ``stiffness`` [N/m] and
    ``rest_length`` [m] of the tether; ``normal_force`` [N] and ``radius_squared`` [m²] of the limit surface;
    ``slowest`` speed at which friction is looked at [m/s]; ``stride`` of the hinge in a step [m].
    """

    patch: SlidingPatch
    drive: Spline
    anchor: Array
    stiffness: float
    rest_length: float
    normal_force: float
    radius_squared: float
    slowest: float
    stride: float


def trail(
    rung: str,
    towed: TowedObject,
    law: FrictionLaw | SlidingPatch,
    tether: Tether,
    hinge: TimedPath | CubicSpline | Spline,
    start_pose: ArrayLike,
    times: ArrayLike,
) -> SimulatedMotion:
    """Motion of a towed object without inertia.

    Parameters
    ----------
    rung : str
        "tractrix", "limit surface" or "quasi-static patch".
    towed, law, tether, hinge, start_pose, times
        As in :func:`towval.physics.dynamics.feedback`. Mass enters by its weight alone, damping not at all.

    Returns
    -------
    SimulatedMotion
        Outcome "converged", or "slack all along".

    Raises
    ------
    InputError
        When the tow leaves the plane of the floor, or there is no such rung.

    Examples
    --------
    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> hinge = TimedPath([0.0, 10.0], [[0.8, 0.0], [1.8, 0.0]])
    >>> scene = towed, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (0.0, 0.0, 0.0), [0.0, 10.0]
    >>> trail("quasi-static patch", *scene).pose[-1].round(4) + 0.0
    array([0.9828, 0.    , 0.    ])
    """
    instance_of(rung, "rung", str)
    if rung not in TRAILING_RUNGS:
        raise InputError("unknown rung without inertia", got=rung, allowed=", ".join(TRAILING_RUNGS))
    instance_of(towed, "towed", TowedObject)
    instance_of(tether, "tether", Tether)
    refuse_beyond_plane(rung, towed, tether)
    times = checked_times(times)
    drive = spline_covering(hinge, times, "the path of the hinge")
    patch = resting_patch(towed, law)
    surface = limit_surface(patch)
    model = _Trail(
        patch=patch,
        drive=drive,
        anchor=towed.anchor - patch.origin,
        stiffness=float(tether.stiffness),
        rest_length=float(tether.rest_length),
        normal_force=float(surface.normal_force),
        radius_squared=float(surface.radius**2),
        slowest=_SLOWEST * max(_CREEP, _mean_speed(drive)),
        stride=float(patch.radius * _STRIDE),
    )
    pose = locked(start_pose, "start pose", (3,))
    state = np.array([*transform(pose, patch.origin), pose[2]])
    out = np.empty((len(times), 9))
    unbalanced, moved = _integrate(TRAILING_RUNGS.index(rung), model, times, state, out)
    return _motion(rung, times, out, patch.origin, moved, unbalanced)


def _mean_speed(drive: Spline) -> float:
    """Length of the path, by chords over a third of a piece, over its duration [m/s]."""
    parts = np.linspace(0, 1, 3, endpoint=False) * np.diff(drive.knots)[:, None]
    place, _ = spline_values(drive, np.append(drive.knots[:-1, None] + parts, drive.knots[-1]))
    return float(np.linalg.norm(np.diff(place, axis=0), axis=1).sum() / np.ptp(drive.knots))


def _motion(rung: str, times: Array, out: Array, centre: Array, moved: bool, unbalanced: int) -> SimulatedMotion:
    offset = rotation(out[:, 2]) @ -centre
    outcome = Outcome.CONVERGED if moved else Outcome.SLACK_ALL_ALONG
    findings = [finding("not_balanced", count=unbalanced, rung=rung)] if unbalanced else []
    if not moved:
        findings.append(finding("slack_all_along", outcome=outcome, time_s=times[-1], advice=ADVICE[outcome]))
    return SimulatedMotion(
        time_s=times,
        pose=np.column_stack([out[:, :2] + offset, out[:, 2]]),
        twist=np.column_stack([velocity_at(out[:, 3:6], offset), out[:, 5]]),
        tether_force=out[:, 6:8],
        tether_length=out[:, 8],
        outcome=str(outcome),
        advice=ADVICE[outcome],
        rung=rung,
        findings=tuple(findings),
    )


@compiled()
def _integrate(rung: int, model: _Trail, times: Array, state: Array, out: Array) -> tuple[int, bool]:
    """Runge-Kutta of order four between the times, finer where the hinge moves far; fills ``out`` (n, 9)."""
    knots, limits = model.drive.knots, model.drive.speed_limits
    rates, guess, room = np.zeros(3), np.zeros(3), np.empty((2, 3))
    piece, unbalanced, moved = 0, 0, False
    # Reported rates close a wrong length over the mean of the intervals: over one that happens to be short, rounding
    # would become speed, and over one in which the hinge goes far, a slack tether would pull.
    reported_lag = min((times[-1] - times[0]) / (len(times) - 1), _LENGTH_STEPS * model.stride / limits.max())
    for i in range(len(times)):
        piece = piece_at(knots, times[i], piece)
        if i > 0:
            fastest = limits[piece_at(knots, times[i - 1], piece) : piece + 1].max()
            travel = fastest * (times[i] - times[i - 1])
            parts = max(1, math.ceil(travel / model.stride))
            h = (times[i] - times[i - 1]) / parts
            for part in range(parts):
                x, y = state[0], state[1]
                unbalanced += _step(rung, model, times[i - 1] + part * h, h, piece, state, guess, rates, room)
                moved = moved or state[0] != x or state[1] != y
        _, fx, fy, length = _rates(rung, model, times[i], piece, state, reported_lag, guess, rates)
        out[i, :3], out[i, 3:6] = state, rates
        out[i, 6], out[i, 7], out[i, 8] = fx, fy, length
    return unbalanced, moved


@compiled(allocates=False)
def _step(
    rung: int, model: _Trail, time: float, h: float, piece: int, state: Array, guess: Array, rates: Array, room: Array
) -> int:
    """Take the state (3,) a step on; returns in how many of its stages no balance was found."""
    trial, total, unbalanced = room[0], room[1], 0
    for j in range(3):
        rates[j], total[j] = 0.0, state[j]
    for stage in range(4):
        for j in range(3):
            trial[j] = state[j] + _PLACES[stage] * h * rates[j]
        now = time + _PLACES[stage] * h
        at = piece_at(model.drive.knots, now, piece)
        balanced, _, _, _ = _rates(rung, model, now, at, trial, _LENGTH_STEPS * h, guess, rates)
        unbalanced += 0 if balanced else 1
        if stage == 0:  # The tractrix has turned the body into the tether's line.
            total[2] += trial[2] - state[2]
            state[2] = trial[2]
        for j in range(3):
            total[j] += _SHARES[stage] * h * rates[j]
    for j in range(3):
        state[j] = total[j]
    return unbalanced


@compiled(allocates=False)
def _rates(
    rung: int, model: _Trail, time: float, piece: int, state: Array, lag: float, guess: Array, rates: Array
) -> tuple[bool, float, float, float]:
    """Twist of the centre of pressure into ``rates``; whether balance was found, the tether's force and length."""
    cos, sin = math.cos(state[2]), math.sin(state[2])
    bx, by = model.anchor
    qx, qy = cos * bx - sin * by, sin * bx + cos * by
    px, py, px_dot, py_dot, _, _ = spline_at(model.drive.knots, model.drive.coefficients, time, piece)
    rod = math.hypot(bx, by) if rung == _POINT else 0.0
    if rung == _POINT:
        qx = qy = 0.0
    lx, ly = px - state[0] - qx, py - state[1] - qy
    length = math.hypot(lx, ly)
    nx, ny = (lx / length, ly / length) if length > 0 else (1.0, 0.0)
    along = nx * px_dot + ny * py_dot
    speed = max(along, model.slowest)
    lever = qx * ny - qy * nx
    balanced = True
    if rung == _WHOLE:
        balanced, vx, vy, omega, pull = _balance(model.patch, cos, sin, bx, by, nx, ny, speed, guess)
    else:
        stretch = 1 + lever * lever / model.radius_squared
        vx, vy, omega = speed * nx / stretch, speed * ny / stretch, speed * lever / model.radius_squared / stretch
        sliding = speed / math.sqrt(stretch)
        ratio = coefficient_over_speed(model.patch.table, sliding)
        pull = model.normal_force * ratio * sliding / math.sqrt(stretch)
    closing = along + (length - rod - model.rest_length - pull / model.stiffness) / lag
    share = max(0.0, closing) / speed
    rates[0], rates[1], rates[2] = share * vx, share * vy, share * omega
    if rung == _POINT and share > 0:
        # The body lies in the tether's line; its heading is no state of its own.
        heading = math.atan2(ny, nx) - math.atan2(by, bx)
        state[2] += (heading - state[2] + math.pi) % (2 * math.pi) - math.pi
        rates[2] = (nx * (py_dot - rates[1]) - ny * (px_dot - rates[0])) / length
    if share == 0:
        pull = min(pull, max(0.0, model.stiffness * (length - rod - model.rest_length)))
    return balanced, pull * nx, pull * ny, length - rod


@compiled(allocates=False)
def _balance(
    patch: SlidingPatch, cos: float, sin: float, bx: float, by: float, nx: float, ny: float, speed: float, guess: Array
) -> tuple[bool, float, float, float, float]:
    """Twist (floor axes) of the patch whose anchor is drawn along n at a speed, and the pull.

    Unknown are the anchor's speed across the tether and the heading rate. ``guess`` holds both over the speed, from
    call to call.
    """
    nx, ny = cos * nx + sin * ny, cos * ny - sin * nx
    across, omega = guess[0] * speed, guess[1] * speed
    found, fx, fy, vx, vy = False, 0.0, 0.0, 0.0, 0.0
    unit = speed / patch.radius
    for _ in range(_NEWTON_LIMIT):
        vx, vy = speed * nx - across * ny + omega * by, speed * ny + across * nx - omega * bx
        fx, fy, moment, xx, xy, yy, xw, yw, ww = wrench_and_slopes(patch, vx, vy, omega)
        force = fy * nx - fx * ny
        torque = moment - (bx * fy - by * fx)
        # Both are slopes of the same dissipation, so their Jacobian is symmetric and negative while μ does not fall.
        ax, ay = xx * -ny + xy * nx, xy * -ny + yy * nx
        cx, cy = xx * by - xy * bx + xw, xy * by - yy * bx + yw
        a11, a12 = ay * nx - ax * ny, cy * nx - cx * ny
        a22 = ww + 2 * (xw * by - yw * bx) + xx * by * by - 2 * xy * bx * by + yy * bx * bx
        determinant = a11 * a22 - a12 * a12
        d_across = -(a22 * force - a12 * torque) / determinant
        d_omega = -(a11 * torque - a12 * force) / determinant
        size = max(abs(d_across) / speed, abs(d_omega) / unit)
        if not np.isfinite(size):
            break
        shrink = min(1.0, 0.5 / size) if size > 0 else 1.0
        across += shrink * d_across
        omega += shrink * d_omega
        if size < 1e-7:
            found = True
            break
    if found:
        guess[0], guess[1] = across / speed, omega / speed
    else:
        across, omega = guess[0] * speed, guess[1] * speed
    vx, vy = speed * nx - across * ny + omega * by, speed * ny + across * nx - omega * bx
    return found, cos * vx - sin * vy, sin * vx + cos * vy, omega, -(fx * nx + fy * ny)
