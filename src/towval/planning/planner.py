"""The planner: how a rover with limited steering drives along a path.

At each step the rover aims at the first point of the path beyond a threshold d_t, with the heading planned for that
point; rotation about one centre Ω would bring it there. Where Ω is not feasible, a feasible centre replaces it. The
equivalent bicycle's steering follows under PD control, and the rover moves at constant speed about the centre that
results from its steering. SOURCE: sections 2.4.3 to 2.4.5, Fig. 3(c) and (d).
"""

import enum
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Finding, TimedPath, locked
from towval.model.checks import lock, lock_whole, positive
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import inverse_transform, path_length, transform
from towval.planning.feasible_region import Flanks, flanks, nearest_centre, nearest_in_polygon
from towval.planning.kinematics import Rover, steering_of_twist, wheel_rates
from towval.planning.paths import STILL, deviation_rms, moving_average, path_heading

Point: TypeAlias = tuple[float, float]

FOLLOWED = 2.5
"""A plan whose hinge deviates from the path by an RMS of more than this many arrival distances does not follow it."""

_APART = 0.1
"""Of the largest step of a path: what lies closer together says nothing of its bends."""

_MOST_ROWS = 50_000_000
"""Of a plan that gets nowhere: so many take a minute and gigabytes."""

LEAST_TURN = 1e-9
"""Smallest turn [rad]; the centre is then some 10⁹ path steps away, in effect at infinity."""


class PlanOutcome(enum.StrEnum):
    """How a plan ends."""

    ARRIVED = "arrived"
    """The hinge reached the end of the path."""
    STRAYED = "strayed"
    """The hinge moved farther from its target point than the settings allow."""
    STUCK = "stuck"
    """The rover kept moving without getting nearer to the end."""


class PlanCase(enum.IntEnum):
    """How the centre of rotation of a step was obtained."""

    A = 0
    """The desired centre is feasible and used."""
    B = 1
    """It is infeasible but close: the nearest feasible centre is used."""
    C = 2
    """It is infeasible and far: the tip of the nearest flank is used, the tightest turn to that side."""


@dataclass(frozen=True)
class PlannerSettings:
    """Parameters of the planner.

    ``threshold`` d_t [m]; ``look_ahead_steps`` ϑ_lh, half the window of the moving average of the path's heading;
    ``proportional_gain`` [1/s] and ``derivative_gain`` [1] of the steering; ``close_distance`` [m] from the feasible
    region up to which a centre is case B; ``arrival_distance`` [m] from the end at which the hinge has arrived;
    ``stray_distance`` [m] beyond the threshold at which the plan is abandoned.
    """

    threshold: float
    look_ahead_steps: int
    proportional_gain: float
    derivative_gain: float
    close_distance: float
    arrival_distance: float
    stray_distance: float

    def __post_init__(self) -> None:
        positive(self, "threshold", "look_ahead_steps", "derivative_gain", "close_distance", zero=True)
        positive(self, "proportional_gain", "arrival_distance", "stray_distance")


@dataclass(frozen=True)
class RoverPlan:
    """Planned motion of the rover; row k holds from ``time_s[k]`` on.

    ``time_s`` (n,); ``pose`` (n, 3) of the rover frame [m, m, rad]; ``hinge`` (n, 2) [m]; ``twist`` (n, 3) in the rover
    frame [m/s, m/s, rad/s]; ``steering`` (n, 4) [rad] and ``wheel_rates`` (n, 4) [rad/s] of the wheels, in the order of
    ``WHEEL_NAMES``; ``case`` (n,) of :class:`PlanCase`; ``target`` (n,) index of the
    target point on the path; ``rms`` [m] of the hinge from the path; ``advice`` explains the ``outcome``.
    """

    time_s: Array
    pose: Array
    hinge: Array
    twist: Array
    steering: Array
    wheel_rates: Array
    case: NDArray[np.int64]
    target: NDArray[np.int64]
    rms: float
    outcome: PlanOutcome
    advice: str
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lock(self, time_s=(n,), pose=(n, 3), hinge=(n, 2), twist=(n, 3))
        lock(self, steering=(n, 4), wheel_rates=(n, 4))
        lock_whole(self, np.int64, case=(n,), target=(n,))

    def share_of(self, case: PlanCase) -> float:
        """Fraction of the steps in a case."""
        return float(np.mean(self.case == case))


def plan_rover(
    path: TimedPath, rover: Rover, settings: PlannerSettings, *, start: ArrayLike | None = None
) -> RoverPlan:
    """Drive a rover so that its hinge follows a path; a plan that fails ends where it failed.

    The path is in equal time steps; the rover moves at its mean speed, with its time step. ``start`` (3,) is the first
    pose of the rover frame [m, m, rad]; by default the hinge is on the first point, with the heading planned there.
    ASSUME: the wheels are already steered for the first step.

    Raises `InputError` when the path has fewer than three points or no length, or is far too short for its points.
    """
    length = path_length(path.position)
    if len(path.time_s) < 3 or length == 0:
        raise InputError(
            "the rover's path cannot be planned",
            got=f"{len(path.time_s)} points over {length} m",
            allowed="three points or more, not all in one place",
        )
    heading = _planned_heading(path.position, rover.hinge[0], int(settings.look_ahead_steps))
    region = flanks(rover)
    if start is None:
        turned_hinge = transform([0.0, 0.0, heading[0]], rover.hinge)
        start = np.array([*(path.position[0] - turned_hinge), heading[0]])
    start = locked(start, "the rover's first pose", (3,))
    speed = length / (path.time_s[-1] - path.time_s[0])
    step = (path.time_s[-1] - path.time_s[0]) / (len(path.time_s) - 1)
    circling = 2 * (2 * np.pi * region.tightest_radius) + settings.threshold
    if 2 * length + circling > _MOST_ROWS * speed * step:
        raise InputError(
            "the rover's path is too short to be planned in so many steps",
            got=f"{len(path.time_s)} points over {length:.3g} m",
            allowed=f"up to {_MOST_ROWS} such steps over twice the path and two circles of the rover",
            remedy="state the path in metres; or take a longer time step",
        )
    count, code, pose, twist, case, target = _drive(
        (path.position, heading),
        start,
        (rover.hinge, rover.axles[:, 0].copy(), region),
        (settings.threshold, settings.close_distance, settings.arrival_distance, settings.stray_distance, circling),
        (settings.proportional_gain, settings.derivative_gain, speed, step, 2 * length + circling),
    )
    rows = slice(0, count)
    hinge, steering = transform(pose[rows], rover.hinge), steering_of_twist(rover.wheel_positions, twist[rows])
    plan = RoverPlan(
        time_s=path.time_s[0] + step * np.arange(count),
        pose=pose[rows],
        hinge=hinge,
        twist=twist[rows],
        steering=steering,
        wheel_rates=wheel_rates(rover, steering, twist[rows]),
        case=case[rows],
        target=target[rows],
        rms=deviation_rms(hinge, path.position),
        outcome=tuple(PlanOutcome)[code],
        advice="",
    )
    findings = (*_settings_findings(path, settings, length, region), *_deviation_findings(plan, settings))
    return replace(plan, advice=_advice(plan, path, region), findings=findings)


def _planned_heading(position: Array, ahead: float, look_ahead_steps: int) -> Array:
    """Heading (n,) [rad] planned for each point of a path: the average over the steps on which the path moves.

    The rover does not stop where the path pauses. The points of a pause would fill the average, and hold back the
    heading for as long as the pause lasts.
    """
    size = np.linalg.norm(np.diff(position, axis=0), axis=1)
    moved = np.concatenate([[True], size > STILL * size.max()])
    heading = moving_average(heading_over_hinge(position[moved], ahead), look_ahead_steps)
    planned: Array = heading[np.cumsum(moved) - 1]
    return planned


def _deviation_findings(plan: RoverPlan, settings: PlannerSettings) -> list[Finding]:
    """A plan can arrive although it cut every corner."""
    if plan.outcome is not PlanOutcome.ARRIVED or plan.rms <= FOLLOWED * settings.arrival_distance:
        return []
    rms_mm, arrival_mm = 1000 * plan.rms, 1000 * settings.arrival_distance
    return [finding("path_not_followed", rms_mm=rms_mm, factor=FOLLOWED, arrival_mm=arrival_mm)]


def _settings_findings(path: TimedPath, settings: PlannerSettings, length: float, region: Flanks) -> list[Finding]:
    """Settings that have no useful effect on this path."""
    findings = []
    steps, tightest = len(path.time_s) - 1, tightest_radius(path.position)
    if settings.threshold >= length:
        findings.append(finding("threshold_exceeds_path", threshold_m=settings.threshold, length_m=length))
    if settings.look_ahead_steps >= steps:
        findings.append(finding("look_ahead_exceeds_path", look_ahead=settings.look_ahead_steps, steps=steps))
    if tightest < region.tightest_radius:
        findings.append(finding("path_too_tight", radius_m=tightest, tightest_m=region.tightest_radius))
    return findings


def _advice(plan: RoverPlan, path: TimedPath, region: Flanks) -> str:
    """The numbers that explain the outcome."""
    shares = ", ".join(f"{case.name} {100 * plan.share_of(case):.1f} %" for case in PlanCase)
    target = int(plan.target[-1])
    aim = path.position[target]
    gap = float(np.linalg.norm(aim - plan.hinge[-1]))
    if plan.outcome is PlanOutcome.ARRIVED:
        return f"The hinge reached the end of the path within {gap:.3g} m (cases: {shares})."
    place = "ahead of" if inverse_transform(plan.pose[-1], aim)[0] > 0 else "behind"
    why = (
        f"Its target was point {target} of {len(path.position) - 1}, {gap:.3g} m away and {place} the rover; "
        f"the path's tightest radius is {tightest_radius(path.position):.3g} m, the rover's "
        f"{region.tightest_radius:.3g} m (cases: {shares})."
    )
    when = f"after {plan.time_s[-1] - plan.time_s[0]:.4g} s and {path_length(plan.hinge):.3g} m"
    if plan.outcome is PlanOutcome.STRAYED:
        return f"The rover strayed from the path {when}. {why} A smaller threshold or a longer look-ahead may help."
    return f"The rover got stuck {when}: it moved without getting nearer to the end. {why} A larger threshold may help."


def heading_over_hinge(position: ArrayLike, ahead: float) -> Array:
    """Heading that the rover should have while its hinge is at each point of a path, (n,) [rad], unwrapped.

    A hinge at the rover's centre moves where the rover heads. One ahead or behind also moves sideways when the rover
    turns; for rotation about centres abeam of the rover's centre, where the steering reaches farthest,
    dϑ/ds = sin(φ − ϑ)/ξ with the path's heading φ and the hinge at ξ. With the hinge ahead, the rover trails like a
    cart; with it behind, the same holds backwards from the end of the path, and the rover swings out before a bend.
    ``position`` (n, 2) are points of the hinge's path, ``ahead`` is ξ [m], negative behind the rover's centre.
    """
    position = locked(position, "path", (None, 2))
    heading, ahead = path_heading(position), float(locked(ahead, "place of the hinge", ()))
    if ahead == 0:
        return heading
    size = np.linalg.norm(np.diff(position, axis=0), axis=1)
    if ahead > 0:
        return _trailing_heading(heading, size, ahead)
    return _trailing_heading(heading[::-1].copy(), size[::-1].copy(), -ahead)[::-1]


@compiled()
def _trailing_heading(heading: Array, size: Array, distance: float) -> Array:
    """Heading of a cart of a given length towed along a path; exact for each straight step."""
    trailing = heading.copy()
    for k in range(1, len(heading)):
        swing = np.tan(0.5 * (trailing[k - 1] - heading[k])) * np.exp(-size[k - 1] / distance)
        trailing[k] = heading[k] + 2.0 * np.arctan(swing)
    return trailing


def tightest_radius(position: ArrayLike) -> float:
    """Smallest radius of curvature of a sampled path (n, 2) [m], infinite when it is straight.

    Between points that are :data:`_APART` at least: where the object comes to rest, the hinge gives way by less.
    """
    position = locked(position, "path", (None, 2))
    least = _APART * np.linalg.norm(np.diff(position, axis=0), axis=1).max(initial=0.0)
    chord = np.diff(_apart(position, float(least)), axis=0)
    size = np.linalg.norm(chord, axis=1)
    cross = chord[:-1, 0] * chord[1:, 1] - chord[:-1, 1] * chord[1:, 0]
    turn = np.abs(np.arctan2(cross, np.sum(chord[:-1] * chord[1:], axis=1)))
    bends = turn > 1e-9  # a straight line, up to rounding
    return float((0.5 * (size[:-1] + size[1:])[bends] / turn[bends]).min(initial=np.inf))


@compiled()
def _apart(position: Array, least: float) -> Array:
    """The points (k, 2) of a path that are farther than ``least`` from the one kept before, the first included."""
    kept = np.zeros(len(position), np.bool_)
    last = 0
    for k in range(len(position)):
        gap = np.hypot(position[k, 0] - position[last, 0], position[k, 1] - position[last, 1])
        if k == 0 or gap > least:
            kept[k], last = True, k
    return position[kept]


@compiled()
def _desired_centre(pose: Array, hinge: Array, aim_x: float, aim_y: float, aim_heading: float) -> Point:
    """Centre of the rotation that brings the hinge to the target and its heading; eqs. (19), (20), rover frame."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    dx = aim_x - (pose[0] + cosine * hinge[0] - sine * hinge[1])
    dy = aim_y - (pose[1] + sine * hinge[0] + cosine * hinge[1])
    dx, dy = cosine * dx + sine * dy, -sine * dx + cosine * dy
    turn = aim_heading - pose[2]
    turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
    if abs(turn) < LEAST_TURN:
        turn = np.copysign(LEAST_TURN, turn)
    across = 0.5 / np.tan(turn / 2)
    return hinge[0] + dx / 2 - across * dy, hinge[1] + dy / 2 + across * dx


@compiled()
def _feasible_centre(region: Flanks, close: float, x: float, y: float) -> tuple[float, float, int]:
    """The centre used for a desired one, and the index of its :class:`PlanCase`."""
    left = nearest_centre(region.normals[0], region.offsets[0], region.corners[0], x, y)
    right = nearest_centre(region.normals[1], region.offsets[1], region.corners[1], x, y)
    side = 0 if left[2] <= right[2] else 1
    near_x, near_y, distance = left if side == 0 else right
    if distance == 0.0:
        return x, y, 0
    if distance <= close:
        return near_x, near_y, 1
    return region.tips[side, 0], region.tips[side, 1], 2


@compiled()
def _steered(
    region: Flanks, gains: tuple[float, float, float, float, float], delta: Array, desired: Array, error: Array
) -> Point:
    """Tangents of both steering angles after one feasible PD step; updates ``delta`` and ``error`` in place.

    ASSUME: the controller sets the steering rate, ``δ̇ = K_p e + K_d ė``.
    """
    proportional, derivative, _, step, _ = gains
    for wheel in range(2):
        new_error = desired[wheel] - delta[wheel]
        delta[wheel] += step * proportional * new_error + derivative * (new_error - error[wheel])
        error[wheel] = new_error
    bound = np.arctan(1e6)
    tangents = (np.tan(min(max(delta[0], -bound), bound)), np.tan(min(max(delta[1], -bound), bound)))
    front, rear = nearest_in_polygon(region.steering_corners, tangents[0], tangents[1])
    delta[0], delta[1] = np.arctan(front), np.arctan(rear)
    return front, rear


@compiled()
def _moved(pose: Array, twist: Array, step: float) -> tuple[float, float, float]:
    """Pose after a step [s] with a constant twist of the rover frame: an arc, exactly."""
    turn = twist[2] * step
    half = turn / 2
    chord = step * (np.sin(half) / half if abs(half) > 1e-8 else 1.0)
    cosine, sine = np.cos(pose[2] + half), np.sin(pose[2] + half)
    x = pose[0] + chord * (cosine * twist[0] - sine * twist[1])
    y = pose[1] + chord * (sine * twist[0] + cosine * twist[1])
    return x, y, pose[2] + turn


@compiled()
def _twist_of_tangents(tangents: Point, axles: Array, hinge: Array, speed: float) -> tuple[float, float, float]:
    """Twist of the bicycle with given tangents of its steering angles and a given speed of the hinge."""
    rate = (tangents[0] - tangents[1]) / (axles[0] - axles[1])
    sideways = tangents[0] - rate * axles[0]
    scale = speed / np.hypot(1.0 - rate * hinge[1], sideways + rate * hinge[0])
    return scale, scale * sideways, scale * rate


@compiled()
def _drive(
    path: tuple[Array, Array],
    start: Array,
    rover: tuple[Array, Array, Flanks],
    limits: tuple[float, float, float, float, float],
    gains: tuple[float, float, float, float, float],
) -> tuple[int, int, Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """The planner's loop. Returns the rows used, the index of the outcome, poses, twists, cases, targets."""
    (position, heading), (hinge, axles, region) = path, rover
    threshold, close, arrival, stray, circling = limits
    _, _, speed, step, most_travel = gains
    last, most_steps = len(position) - 1, int(np.ceil(most_travel / (speed * step)))
    pose, twist = np.zeros((2, most_steps, 3))
    case, target = np.zeros(most_steps, np.int64), np.zeros(most_steps, np.int64)
    delta, error, desired = np.zeros(2), np.zeros(2), np.zeros(2)
    pose[0] = start
    aim, progressed, code, k = 0, 0, 2, 0
    for k in range(most_steps):
        if k > 0:
            pose[k] = _moved(pose[k - 1], twist[k - 1], step)
        x = pose[k, 0] + np.cos(pose[k, 2]) * hinge[0] - np.sin(pose[k, 2]) * hinge[1]
        y = pose[k, 1] + np.sin(pose[k, 2]) * hinge[0] + np.cos(pose[k, 2]) * hinge[1]
        gap = np.hypot(position[aim, 0] - x, position[aim, 1] - y)
        while aim < last and gap <= threshold:
            aim, progressed = aim + 1, k
            gap = np.hypot(position[aim, 0] - x, position[aim, 1] - y)
        target[k] = aim
        centre_x, centre_y = _desired_centre(pose[k], hinge, position[aim, 0], position[aim, 1], heading[aim])
        centre_x, centre_y, case[k] = _feasible_centre(region, close, centre_x, centre_y)
        for wheel in range(2):
            desired[wheel] = np.arctan((axles[wheel] - centre_x) / centre_y)
        if k == 0:
            delta[:] = desired
        tangents = _steered(region, gains, delta, desired, error)
        twist[k] = _twist_of_tangents(tangents, axles, hinge, speed)
        arrived, strayed = aim == last and gap <= arrival, gap > threshold + stray
        if arrived or strayed or speed * step * (k - progressed) > circling:
            code = 0 if arrived else 1 if strayed else 2
            break
    return k + 1, code, pose, twist, case, target
