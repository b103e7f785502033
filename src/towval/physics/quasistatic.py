"""The quasi-static model (QSM): what force, heading and hinge path draw a point of the object along a path.

SOURCE: section 2.2. The velocity of the tracked point P is given, the heading rate ω is not: balance of moments
about the anchor Q_T, ``M_k(v_P, ω) = 0``, is one scalar equation for it. Balance of forces gives the tow force ``T
= −F_k``, and the hinge stands where the stretched tether ends, ``s_r = Q_T + (l0 + |T|/κ) T/|T|``.

With P = Q_T the equation is the derivative of a convex dissipation: monotonic, one root. With P elsewhere it can have
several roots or none; the root is then followed from the time before, and its loss is reported. How the heading follows
from its rate: :mod:`towval.physics.heading`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Finding, FrictionLaw, Ground, Sliding, Tether, TimedPath, TowedObject, locked
from towval.model.checks import lock, short_repr
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import inside_polygon
from towval.physics.balanced_rate import ROOT_CHOSEN, ROOT_LOST
from towval.physics.dynamics import LEVEL, checked_times, leaves_plane, resting_patch
from towval.physics.footprint import convex_hull, footprint_size, refuse_tipping
from towval.physics.heading import follow, room_for_plan
from towval.physics.spatial.problem import as_sliding, tow_problem
from towval.physics.spatial.steady import follow_in_space
from towval.physics.splines import Spline, spline_covering, spline_values
from towval.physics.wrench import SlidingPatch

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


@dataclass(frozen=True)
class QuasistaticMotion:
    """What the quasi-static model plans, on given times.

    ``time_s`` (n,); ``pose`` (n, 3) of the body frame [m, m, rad]; ``twist`` (n, 3) of the body frame's origin, floor
    axes [m/s, m/s, rad/s]; ``tether_force`` (n, 2) on the object, floor axes [N]; ``hinge`` the nominal path of the
    tether's end on the rover; ``findings`` what a user has to know.
    """

    time_s: Array
    pose: Array
    twist: Array
    tether_force: Array
    hinge: TimedPath
    findings: tuple[Finding, ...] = ()
    statistics: dict[str, float] = field(default_factory=dict)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lock(self, time_s=(n,), pose=(n, 3), twist=(n, 3), tether_force=(n, 2))


def quasistatic_plan(
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    path: TimedPath | CubicSpline,
    tether: Tether,
    *,
    point: ArrayLike = (0.0, 0.0),
    start_heading: float | None = None,
    times: ArrayLike | None = None,
    ground: Ground = LEVEL,
    hinge_height: float = 0.0,
) -> QuasistaticMotion:
    """Plan the tow that moves a point of the object along a path, without inertia.

    SOURCE: section 2.2, eqs. (4), (5).

    Parameters
    ----------
    law : Sliding, FrictionLaw or SlidingPatch
        Friction of the whole footprint, or a patch prepared with its own pressure, friction and method, which serves
        the plane alone.
    path : TimedPath or CubicSpline
        Path of the tracked point P over the floor in time [m]; its points are splined.
    point : array_like (2,), optional
        P in the body frame [m]; its origin if not given.
    start_heading : float, optional
        Heading at the start [rad]. If not given, the object points along the path with its anchor ahead of P, or of
        its centre of mass where P is the anchor, so that it starts about as it will settle.
    times : array_like (n,), optional
        When to report [s]; those of the path if not given.
    ground, hinge_height
        As in :func:`towval.physics.dynamics.feedback`.

    Raises
    ------
    InputError
        When the path does not cover the times, or never moves and no start heading is given.
    RefusedError
        When the object tips over on its path.

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
    in_space = leaves_plane(towed, law, tether, ground, hinge_height, None)
    times = _times_of(path, times)
    spline = spline_covering(path, times, "the path")
    # From zero: beside seconds since 1970 the shortest panels would not advance.
    spline, since_start = spline._replace(knots=spline.knots - times[0]), times - times[0]
    point = locked(point, "point", (2,))
    if start_heading is None:
        lever = towed.anchor - point
        if not lever.any():
            lever = towed.anchor - towed.centre_of_mass
        start_heading = _settled_heading(spline, lever)
    start_heading = float(locked(start_heading, "start heading", ()))
    plan = room_for_plan(len(times))
    if isinstance(law, SlidingPatch) or not in_space:
        patch = resting_patch(towed, law, ground.gravity)
        levers = np.concatenate([point, towed.anchor, [tether.rest_length, tether.stiffness]])
        panels, solves, error = follow(patch, levers, spline, since_start, start_heading, plan)
        statistics = {"panels": float(panels), "solves": float(solves), "heading_error_rad": error}
    else:
        refuse_tipping(towed.patch, towed.centre_of_mass)
        problem = tow_problem(towed, as_sliding(law), tether, ground, hinge_height, spline)
        levers = np.concatenate([point, np.zeros(2)]) - np.tile(towed.centre_of_mass, 2)
        statistics = follow_in_space(problem, levers, since_start, start_heading, plan)
    findings = (*_root_findings(times, plan.status, plan.moment), *_cable_findings(towed, times, plan.direction))
    for array in (times, plan.pose.base, *plan):
        cast(Array, array).setflags(write=False)  # So the motion need not copy it.
    return QuasistaticMotion(
        time_s=times,
        pose=plan.pose,
        twist=plan.twist,
        tether_force=plan.tether_force,
        hinge=TimedPath(times, plan.hinge),
        findings=findings,
        statistics=statistics,
    )


def _times_of(path: TimedPath | CubicSpline, times: ArrayLike | None) -> Array:
    if times is None and not hasattr(path, "time_s") and not hasattr(path, "x"):
        raise InputError("the path is of the wrong type", got=type(path).__name__, allowed="TimedPath or CubicSpline")
    given = (path.time_s if isinstance(path, TimedPath) else path.x) if times is None else times
    return checked_times(given)


def _settled_heading(spline: Spline, lever: Array) -> float:
    """Heading with a lever in the body frame (2,) ahead along the path's first direction from time zero on [rad]."""
    samples = np.linspace(0.0, spline.knots[-1], 1001)
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
        around = np.array(convex_hull(towed.patch).exterior.coords)[:-1]
    ring = 1e-3 * size * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    if inside_polygon(around, towed.anchor + ring).all():
        return ()  # The anchor sits within the outline, above the object: every direction crosses it.
    count, first = _count_inside(around, towed.anchor, 0.05 * size, direction)
    if count == 0:
        return ()
    return (finding("cable_would_push", count=count, total=len(times), time_s=times[first]),)


@compiled(allocates=False)
def _count_inside(polygon: Array, origin: Array, reach: float, direction: Array) -> tuple[int, int]:
    """How many of the points in directions (n, 2) from an origin lie inside a polygon, and the first that does.

    As :func:`towval.model.geometry.inside_polygon`, at a tenth of its cost: it takes no share of a plan's time.
    """
    count = first = 0
    for i in range(len(direction)):
        x, y = origin[0] + reach * direction[i, 0], origin[1] + reach * direction[i, 1]
        inside, x0, y0 = False, polygon[-1, 0], polygon[-1, 1]
        for k in range(len(polygon)):
            x1, y1 = polygon[k, 0], polygon[k, 1]
            if (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0:
                inside = not inside
            x0, y0 = x1, y1
        if inside:
            first = i if count == 0 else first
            count += 1
    return count, first
