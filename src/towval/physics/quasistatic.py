"""The quasi-static model (QSM): what force, heading and hinge path draw a point of the object along a path.

SOURCE: section 2.2. The velocity of the tracked point P is given, the heading rate ω is not: balance of moments
about the anchor Q_T, ``M_k(v_P, ω) = 0``, is one scalar equation for it. Balance of forces gives the tow force ``T
= −F_k``, and the hinge stands where the stretched tether ends, ``s_r = Q_T + (l0 + |T|/κ) T/|T|``.

With P = Q_T the equation is the derivative of a convex dissipation: monotonic, one root. With P elsewhere it can have
several roots or none; the root is then followed from the time before, and its loss is reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from towval.model import Array, Finding, FrictionLaw, Tether, TimedPath, TowedObject, locked
from towval.model.checks import instance_of, short_repr
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import inside_polygon
from towval.physics.contact import footprint_size, resting_pressure
from towval.physics.splines import Spline, piece_at, spline_at, spline_covering, spline_values
from towval.physics.tether import refuse_beyond_plane
from towval.physics.wrench import SlidingPatch, sliding_patch, wrench_and_slopes

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

_STRIDE = 0.01  # of the patch's radius: the object moves no further in an inner step
_CREEP = 1e-9  # m/s; where the path rests, directions are those of a creep this slow
_SETTLED = 1e-6  # a Newton step this small, over |v| / radius, leaves its square as the error
_NEWTON_LIMIT = 30
_SCAN = 60  # rates looked at on either side of zero when a root has to be searched

# From P and from the anchor to the origin of the patch (x, y each) [m], body frame.
Levers = tuple[float, float, float, float]

ROOT_FOUND, ROOT_CHOSEN, ROOT_LOST = 0, 1, 2


@dataclass(frozen=True)
class QuasistaticMotion:
    """What the quasi-static model plans, on given times.

    ``time_s`` (n,); ``pose`` (n, 3) of the body frame [m, m, rad]; ``twist`` (n, 3) of the body frame's origin, floor
    axes [m/s, m/s, rad/s]; ``heading_rate`` (n,) [rad/s]; ``tether_force`` (n, 2) on the object, floor axes [N];
    ``hinge`` the nominal way of the tether's end on the rover; ``residual_moment`` (n,) about the anchor [N m], zero
    but where the root was lost; ``findings`` what a user has to know.
    """

    time_s: Array
    pose: Array
    twist: Array
    heading_rate: Array
    tether_force: Array
    hinge: TimedPath
    residual_moment: Array
    findings: tuple[Finding, ...] = ()
    statistics: dict[str, float] = field(default_factory=dict)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.time_s)
        for name, shape in (
            ("time_s", (n,)),
            ("pose", (n, 3)),
            ("twist", (n, 3)),
            ("heading_rate", (n,)),
            ("tether_force", (n, 2)),
            ("residual_moment", (n,)),
        ):
            object.__setattr__(self, name, locked(getattr(self, name), f"QuasistaticMotion.{name}", shape))


def quasistatic_plan(
    towed: TowedObject,
    law: FrictionLaw | SlidingPatch,
    path: TimedPath | CubicSpline,
    tether: Tether,
    *,
    point: ArrayLike = (0.0, 0.0),
    start_heading: float | None = None,
    times: ArrayLike | None = None,
) -> QuasistaticMotion:
    """Plan the tow that moves a point of the object along a path, without inertia.

    SOURCE: section 2.2, eqs. (4), (5).

    Parameters
    ----------
    law : FrictionLaw or SlidingPatch
        Friction of the whole footprint, or a patch prepared with its own pressure, friction and method.
    path : TimedPath or CubicSpline
        Way of the tracked point P over the floor in time [m]; a path is splined.
    point : array_like (2,), optional
        P in the body frame [m]; its origin if not given.
    start_heading : float, optional
        Heading at the start [rad]. If not given, the object points along the path with its anchor ahead of P, so that
        it starts as it will settle.
    times : array_like (n,), optional
        When to report [s]; those of the path if not given.

    Raises
    ------
    InputError
        When the path never moves or does not cover the times, or the tow leaves the plane of the floor.

    Examples
    --------
    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> path = TimedPath([0.0, 10.0], [[0.0, 0.0], [1.0, 0.0]])
    >>> plan = quasistatic_plan(towed, Coulomb(0.35, 1e-3), path, Tether(0.6, 1000.0))
    >>> plan.hinge.position.round(4) + 0.0
    array([[0.8172, 0.    ],
           [1.8172, 0.    ]])
    """
    instance_of(towed, "towed", TowedObject)
    instance_of(tether, "tether", Tether)
    refuse_beyond_plane("the quasi-static model", towed, tether)
    times = _times_of(path, times)
    spline = spline_covering(path, times, "the path")
    patch = law if isinstance(law, SlidingPatch) else sliding_patch(resting_pressure(towed), law)
    point = locked(point, "point", (2,))
    if start_heading is None:
        start_heading = _settled_heading(spline, times[0], towed.anchor - point)
    levers = np.concatenate([point, towed.anchor, [tether.rest_length, tether.stiffness]])
    plan = _Plan(*(np.zeros((len(times), width)) for width in (3, 3, 2, 2, 2)), *np.zeros((2, len(times))))
    solves, newton_steps = _follow(patch, levers, spline, times, float(start_heading), plan)
    findings = (*_root_findings(times, plan.status, plan.moment), *_cable_findings(towed, times, plan.direction))
    for array in plan:
        array.setflags(write=False)  # So the motion need not copy it.
    return QuasistaticMotion(
        time_s=times,
        pose=plan.pose,
        twist=plan.twist,
        heading_rate=plan.twist[:, 2],
        tether_force=plan.tether_force,
        hinge=TimedPath(times, plan.hinge),
        residual_moment=np.where(plan.status == ROOT_LOST, plan.moment, 0.0),
        findings=findings,
        statistics={"solves": float(solves), "newton_steps": float(newton_steps)},
    )


class _Plan(NamedTuple):
    """What compiled code fills in at each time.

    As in :class:`QuasistaticMotion`: ``pose``, ``twist``, ``tether_force``, ``hinge`` (n, 2). Beside: ``direction`` (n,
    2) of the tow in body axes, ``moment`` (n,) left about the anchor [N m], ``status`` (n,) of the root. Zero before.
    """

    pose: Array
    twist: Array
    tether_force: Array
    hinge: Array
    direction: Array
    moment: Array
    status: Array


def _times_of(path: TimedPath | CubicSpline, times: ArrayLike | None) -> Array:
    if times is None and not hasattr(path, "time_s") and not hasattr(path, "x"):
        raise InputError("the path is of the wrong type", got=type(path).__name__, allowed="TimedPath or CubicSpline")
    given = (path.time_s if isinstance(path, TimedPath) else path.x) if times is None else times
    given = locked(given, "times", (None,)).copy()
    if len(given) < 2 or not (np.diff(given) > 0).all():
        raise InputError(
            "the times of the plan cannot be used", got=f"{len(given)} times", allowed="two or more, increasing"
        )
    return given


def _settled_heading(spline: Spline, start: float, lever: Array) -> float:
    """Heading with the anchor ahead of P along the path's first direction [rad]."""
    samples = np.linspace(start, spline.knots[-1], 1001)
    _, velocity = spline_values(spline, samples)
    speed = np.linalg.norm(velocity, axis=1)
    moving = np.flatnonzero(speed > 1e-6 * speed.max())
    if speed.max() == 0 or len(moving) == 0:
        raise InputError("the path never moves", got="zero speed all along", allowed="a path that moves")
    along = velocity[moving[0]]
    own = math.atan2(lever[1], lever[0]) if np.hypot(*lever) > 0 else 0.0
    return math.atan2(along[1], along[0]) - own


def _root_findings(times: Array, status: Array, moment: Array) -> tuple[Finding, ...]:
    findings = []
    lost = status == ROOT_LOST
    if lost.any():
        findings.append(
            finding(
                "root_lost",
                count=int(lost.sum()),
                total=len(times),
                time_s=times[lost][0],
                moment_Nm=np.abs(moment[lost]).max(),
            )
        )
    chosen = status == ROOT_CHOSEN
    if chosen.any():
        findings.append(finding("root_jumped", count=int(chosen.sum()), time_s=times[chosen][0]))
    return tuple(findings)


def _cable_findings(towed: TowedObject, times: Array, direction: Array) -> tuple[Finding, ...]:
    """Where the force at the anchor points into the object: a strut would push, a cable lies across the object."""
    size, around = footprint_size(towed.patch), towed.patch.outline
    if towed.patch.further:  # What stands on feet reaches at least from one to the other.
        around = np.array(shapely.MultiPoint(towed.patch.corners).convex_hull.exterior.coords)[:-1]
    ring = 1e-3 * size * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    if inside_polygon(around, towed.anchor + ring).all():
        return ()  # The anchor sits within the outline, above the object: every direction crosses it.
    across = inside_polygon(around, towed.anchor + 0.05 * size * direction)
    if not across.any():
        return ()
    return (finding("cable_would_push", count=int(across.sum()), total=len(times), time_s=times[across][0]),)


@compiled(allocates=False)
def _follow(
    patch: SlidingPatch, levers: Array, spline: Spline, times: Array, heading: float, plan: _Plan
) -> tuple[int, int]:
    """Fill the plan; ``levers`` (6,): P and the anchor in the body frame, rest length and stiffness of the tether.

    The heading is integrated by the quadratic through its last three rates (Adams-Bashforth), one solve a step.
    """
    knots, coefficients = spline.knots, spline.coefficients
    ox, oy, radius, last_piece = patch.origin[0], patch.origin[1], patch.radius, len(coefficients) - 1
    geometry = (ox - levers[0], oy - levers[1], ox - levers[2], oy - levers[3])
    solves = newton = 0
    piece, theta = 0, heading
    rate0 = rate1 = rate2 = step1 = step2 = 0.0
    known = 0
    for i in range(len(times)):
        parts = 1
        if i > 0:
            travel = spline.speed_limits[piece_at(knots, times[i - 1], piece)] * (times[i] - times[i - 1])
            parts = max(1, math.ceil(travel / (_STRIDE * radius)))
        for part in range(parts):
            step = 0.0
            time = times[i]
            if i > 0:
                step = (times[i] - times[i - 1]) / parts
                time = times[i - 1] + (part + 1) * step
                theta += step * _mean_rate(known, step, step1, step2, rate0, rate1, rate2)
            piece = piece_at(knots, time, piece)
            place = spline_at(knots, coefficients, time, piece)
            vx, vy = _moving_velocity(place, piece < last_piece or time < knots[-1])
            cos, sin = math.cos(theta), math.sin(theta)
            ux, uy = cos * vx + sin * vy, cos * vy - sin * vx
            guess = rate0 if known < 2 else rate0 + (rate0 - rate1) * (step / step1)
            omega, fx, fy, moment, status, tries = _balanced_rate(patch, geometry, ux, uy, guess, radius, known == 0)
            solves += 1
            newton += tries
            if known == 1 and part == 0:
                # The first step was Euler's; with the rate at its end known, take it again by the trapezium.
                theta += 0.5 * step * (omega - rate0)
                cos, sin = math.cos(theta), math.sin(theta)
            rate2, rate1, rate0 = rate1, rate0, omega
            step2, step1 = step1, step
            known += 1
        plan.pose[i, 2], plan.twist[i, 2], plan.moment[i], plan.status[i] = theta, omega, moment, status
        _assemble(plan, i, levers, place, (cos, sin), (fx, fy))
    return solves, newton


@compiled(allocates=False)
def _assemble(
    plan: _Plan,
    i: int,
    levers: Array,
    place: tuple[float, float, float, float, float, float],
    turned: tuple[float, float],
    friction: tuple[float, float],
) -> None:
    """Places, velocities and forces of a time, floor axes, in the plan, which has heading and rate.

    ``place``: the path's position and derivatives; ``turned``: cosine and sine of the heading; ``friction`` force, body
    axes. A tow without force keeps the direction of the time before.
    """
    px, py, ax, ay, rest_length, stiffness = levers
    (cos, sin), (fx, fy), omega = turned, friction, plan.twist[i, 2]
    pull = math.sqrt(fx * fx + fy * fy)
    if pull > 0:
        plan.direction[i, 0], plan.direction[i, 1] = -fx / pull, -fy / pull
    else:
        plan.direction[i, 0], plan.direction[i, 1] = plan.direction[max(i - 1, 0), 0], plan.direction[max(i - 1, 0), 1]
    reach = rest_length + pull / stiffness
    along_x, along_y = ax + reach * plan.direction[i, 0], ay + reach * plan.direction[i, 1]
    lever_x, lever_y = cos * px - sin * py, sin * px + cos * py
    x, y = place[0] - lever_x, place[1] - lever_y
    plan.pose[i, 0], plan.pose[i, 1] = x, y
    plan.twist[i, 0], plan.twist[i, 1] = place[2] + omega * lever_y, place[3] - omega * lever_x
    plan.tether_force[i, 0], plan.tether_force[i, 1] = sin * fy - cos * fx, -sin * fx - cos * fy
    plan.hinge[i, 0], plan.hinge[i, 1] = x + cos * along_x - sin * along_y, y + sin * along_x + cos * along_y


@compiled(allocates=False)
def _mean_rate(known: int, step: float, step1: float, step2: float, rate0: float, rate1: float, rate2: float) -> float:
    """Mean over the coming step of the polynomial through the last rates.

    By reciprocals of the steps, which are known while the last rate is still being solved for.
    """
    if known < 2:
        return rate0
    first = (rate0 - rate1) * (1 / step1)
    mean = rate0 + first * step / 2
    if known > 2:
        second = (first - (rate1 - rate2) * (1 / step2)) * (1 / (step1 + step2))
        mean += second * (step * step / 3 + step1 * step / 2)
    return mean


@compiled(allocates=False)
def _moving_velocity(place: tuple[float, float, float, float, float, float], goes_on: bool) -> tuple[float, float]:
    """Velocity of the path; where it rests, a creep in the direction in which it will move (or has moved)."""
    _, _, vx, vy, ax, ay = place
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > _CREEP:
        return vx, vy
    push = math.hypot(ax, ay)
    if push > 0:
        sign = 1.0 if goes_on else -1.0
        return sign * _CREEP * ax / push, sign * _CREEP * ay / push
    if speed > 0:
        return _CREEP * vx / speed, _CREEP * vy / speed
    return _CREEP, 0.0


@compiled(allocates=False)
def _moment_about_anchor(
    patch: SlidingPatch, geometry: Levers, ux: float, uy: float, omega: float
) -> tuple[float, float, float, float, float, float]:
    """Moment about the anchor, its slope by ω, the force and its slopes, for the velocity of P in body axes."""
    px, py, ax, ay = geometry
    fx, fy, moment, xx, xy, yy, xw, yw, ww = wrench_and_slopes(patch, ux - omega * py, uy + omega * px, omega)
    fx_rate, fy_rate = -xx * py + xy * px + xw, -xy * py + yy * px + yw
    slope = -xw * py + yw * px + ww + ax * fy_rate - ay * fx_rate
    return moment + ax * fy - ay * fx, slope, fx, fy, fx_rate, fy_rate


@compiled(allocates=False)
def _balanced_rate(
    patch: SlidingPatch, geometry: Levers, ux: float, uy: float, guess: float, radius: float, search: bool
) -> tuple[float, float, float, float, int, int]:
    """Heading rate with no moment about the anchor: rate, force (2), moment left, status, Newton steps."""
    unit = math.sqrt(ux * ux + uy * uy) / radius
    omega = guess
    tries = 0
    while not search and tries < _NEWTON_LIMIT:
        tries += 1
        moment, slope, fx, fy, fx_rate, fy_rate = _moment_about_anchor(patch, geometry, ux, uy, omega)
        change = -moment / slope if slope < 0 else np.inf
        if not abs(change) < 0.3 * (unit + abs(omega)):
            break
        if abs(change) < _SETTLED * unit:
            # The force follows to first order; both are left with errors of the order of the change squared.
            return omega + change, fx + change * fx_rate, fy + change * fy_rate, 0.0, ROOT_FOUND, tries
        omega += change
    omega, found = _searched_rate(patch, geometry, ux, uy, guess, unit)
    moment, _, fx, fy, _, _ = _moment_about_anchor(patch, geometry, ux, uy, omega)
    status = ROOT_LOST
    if found:
        status = ROOT_FOUND if search or abs(omega - guess) < 0.1 * unit else ROOT_CHOSEN
    return omega, fx, fy, moment, status, tries


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
        moment, _, _, _, _, _ = _moment_about_anchor(patch, geometry, ux, uy, rate)
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
        moment, _, _, _, _, _ = _moment_about_anchor(patch, geometry, ux, uy, middle)
        if (moment > 0) == positive_low:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
