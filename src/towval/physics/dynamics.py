"""Dynamics of the towed object: feedback (FBD, a tether from a moving hinge), feedforward (FFD, a given force).

SOURCE: section 2.3, eqs. (9) to (12). Rigid body flat on the floor, friction of its pressed patch. With the tow force
in the ground plane on a level floor the pressure does not change; else ``towval.physics.spatial`` takes over.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import (
    Array,
    Finding,
    FrictionLaw,
    Ground,
    SimulatedMotion,
    Sliding,
    Tether,
    TimedPath,
    TowedObject,
    locked,
)
from towval.model.checks import increasing, instance_of, positive
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import transform, velocity_at
from towval.physics.contact import resting_pressure
from towval.physics.footprint import refuse_tipping
from towval.physics.friction_laws import Coulomb
from towval.physics.friction_table import SLOPE
from towval.physics.integrator import NOT_FINITE, REACHED_END, STEP_LIMIT, STEP_TOO_SMALL, integrate, march_from
from towval.physics.motion import FORCED, TAUT, MotionProblem, natural_mode, tensions
from towval.physics.spatial.integrator import LIFTED_OFF, TIPPED_OVER
from towval.physics.spatial.problem import as_sliding, tow_problem
from towval.physics.spatial.tow import Sticking, is_planar, run_tow
from towval.physics.splines import Spline, spline_covering, spline_values
from towval.physics.steps import error_scales
from towval.physics.wrench import SlidingPatch, sliding_patch

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

DEFAULT_TOLERANCE_M = 1e-7
"""Error of a single step that is accepted [m]; docs/physics.md shows what path error it buys."""

LEVEL = Ground()
_NO_TETHER, _ANY_SLIDING = Tether(1.0, 1.0), Sliding(Coulomb(1.0, 1.0))

_FORCE_ERROR, _FORCE_SHIFT_M = 1e-3, 0.01
"""An error of the force that cannot be excluded, and the shift of the object above which a finding states it."""

_STEP_LIMIT = 2_000_000


class Outcome(enum.StrEnum):
    """How an integration ended."""

    CONVERGED = "converged"
    """It reached the last time within the tolerance."""
    SLACK_ALL_ALONG = "slack all along"
    """It reached the last time, but the tether never pulled."""
    STEP_LIMIT = "step limit"
    """The allowed number of steps was used up; the motion ends early."""
    STEP_TOO_SMALL = "step too small"
    """No step, however small, met the tolerance; the motion ends early."""
    NOT_FINITE = "not finite"
    """The state left the range of numbers; the motion ends early."""
    TIPS = "tips over"
    """No pressure under the footprint balances the loads; the motion ends early."""
    LIFTED = "lifted"
    """The tether lifts the object off the floor; the motion ends early."""


ADVICE = {
    Outcome.CONVERGED: "Nothing to do.",
    Outcome.SLACK_ALL_ALONG: "Check hinge, anchor, rest length and start pose: the object was never towed.",
    Outcome.STEP_LIMIT: "Raise the tolerance or the step limit; the hinge's path may be noisy between its points.",
    Outcome.STEP_TOO_SMALL: "Check the drive for jumps, and stiffness, masses and friction law for extreme values.",
    Outcome.NOT_FINITE: "Check the drive and the initial state for extreme values.",
    Outcome.TIPS: "Check the heights of anchor, hinge and centre of mass, the slope, the friction coefficients, and "
    "the tether's stiffness: a stiff one pulls with a jerk.",
    Outcome.LIFTED: "Check the height of the hinge over the anchor, the rest length of the tether and the mass.",
}
"""What each outcome means for its user."""

_OUTCOMES = {
    REACHED_END: Outcome.CONVERGED,
    STEP_LIMIT: Outcome.STEP_LIMIT,
    STEP_TOO_SMALL: Outcome.STEP_TOO_SMALL,
    NOT_FINITE: Outcome.NOT_FINITE,
    TIPPED_OVER: Outcome.TIPS,
    LIFTED_OFF: Outcome.LIFTED,
}


@dataclass(frozen=True)
class Accuracy:
    """What the integrator may do: ``tolerance`` [m] per step, ``step_limit`` steps in all."""

    tolerance: float = DEFAULT_TOLERANCE_M
    step_limit: int = _STEP_LIMIT

    def __post_init__(self) -> None:
        positive(self, "tolerance", "step_limit")
        if not (1e-14 <= self.tolerance <= 1.0 and self.step_limit >= 1):
            raise InputError(
                "Accuracy is out of range",
                got=f"tolerance {self.tolerance} m, step limit {self.step_limit}",
                allowed="tolerance from 1e-14 to 1 m, one step or more",
            )


STANDARD = Accuracy()


def feedback(
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    hinge: TimedPath | CubicSpline | Spline,
    start_pose: ArrayLike,
    times: ArrayLike,
    *,
    start_twist: ArrayLike = (0.0, 0.0, 0.0),
    accuracy: Accuracy = STANDARD,
    ground: Ground = LEVEL,
    hinge_height: float = 0.0,
    sticking: Sticking | None = None,
) -> SimulatedMotion:
    """Motion of an object towed by a tether whose hinge follows a given path (FBD).

    SOURCE: eqs. (9) to (12).

    Parameters
    ----------
    law : Sliding, FrictionLaw or SlidingPatch
        Friction of the whole footprint, or a patch prepared with its own pressure, friction and method, which serves
        the planar model alone.
    hinge : TimedPath, CubicSpline or Spline
        Path of the tether's end on the rover [m]; its points are splined. It must cover ``times``.
    start_pose : array_like (3,)
        Pose of the body frame at ``times[0]`` [m, m, rad].
    times : array_like (n,)
        When to report [s], strictly increasing, two or more.
    start_twist : array_like (3,), optional
        Velocity of the body frame's origin and heading rate at the start, floor axes [m/s, m/s, rad/s]; at rest if
        not given.
    ground : Ground, optional
        Gravity, slope and regions of the floor; level and uniform if not given.
    hinge_height : float, optional
        Of the tether's end on the rover above the floor [m].
    sticking : Sticking, optional
        Friction at rest as a set. If not given, the law alone counts, and below the limit the object creeps.

    Returns
    -------
    SimulatedMotion
        With ``outcome`` one of :class:`Outcome`. Where that is neither "converged" nor "slack all along", the motion
        stops at the last time reached.

    Raises
    ------
    InputError
        When the times are not covered by the hinge's path, or are no times, or the hinge is below the floor.

    Examples
    --------
    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> hinge = TimedPath([0.0, 10.0], [[0.8, 0.0], [1.8, 0.0]])  # 0.1 m/s along x
    >>> motion = feedback(towed, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (0.0, 0.0, 0.0), [0.0, 10.0])
    >>> motion.outcome, motion.pose[-1].round(2) + 0.0  # it lags behind 1 m by the stretch under μ N = 17.2 N
    ('converged', array([0.98, 0.  , 0.  ]))
    """
    instance_of(accuracy, "accuracy", Accuracy)
    times = checked_times(times)
    drive = _since(times[0], spline_covering(hinge, times, "the path of the hinge"))
    in_space = leaves_plane(towed, law, tether, ground, hinge_height, sticking)
    y = centre_state(towed, start_pose, start_twist)
    if in_space:
        return _spatial_motion(towed, (law, tether, ground, hinge_height, sticking), drive, False, y, times, accuracy)
    scene, elapsed = motion_scene(towed, law, tether, drive, ground.gravity), times - times[0]
    outcome, states, modes, statistics = _run(scene, natural_mode(scene, 0.0, y), y, elapsed, accuracy)
    if outcome == Outcome.CONVERGED and not (modes == TAUT).any() and not statistics["mode_changes"]:
        outcome = Outcome.SLACK_ALL_ALONG
    tension = np.empty((len(states), 3))
    tensions(scene, elapsed, states, tension)
    return _motion(towed, times, states, tension[:, 1:], tension[:, 0], outcome, statistics)


def feedforward(
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    force: TimedPath | CubicSpline,
    start_pose: ArrayLike,
    times: ArrayLike,
    *,
    start_twist: ArrayLike = (0.0, 0.0, 0.0),
    accuracy: Accuracy = STANDARD,
    ground: Ground = LEVEL,
    sticking: Sticking | None = None,
) -> SimulatedMotion:
    """Motion of an object on whose anchor a force given over time acts (FFD).

    SOURCE: eqs. (9) to (11). The force [N], floor axes, comes as a "path" of its two components; the rest is as in
    :func:`feedback`. ``tether_length`` of the result is zero: there is no tether.

    A force does not determine a path: where friction no longer rises with speed, any error in force accumulates. So the
    motion is computed again with 0.1 % more force, and the finding "open_loop" states how far it departs.

    Examples
    --------
    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> force = TimedPath([0.0, 1.0], [[20.0, 0.0], [20.0, 0.0]])
    >>> motion = feedforward(towed, Coulomb(0.35, 1e-3), force, (0.0, 0.0, 0.0), [0.0, 1.0])
    >>> motion.twist[-1].round(2) + 0.0  # (20 N − μ N) / m · 1 s
    array([0.57, 0.  , 0.  ])
    """
    instance_of(accuracy, "accuracy", Accuracy)
    times = checked_times(times)
    drive = _since(times[0], spline_covering(force, times, "the force"))
    instance_of(towed, "towed", TowedObject)
    in_space = leaves_plane(towed, law, _NO_TETHER, ground, towed.anchor_height, sticking)
    start = centre_state(towed, start_pose, start_twist)
    stronger = drive._replace(coefficients=(1 + _FORCE_ERROR) * drive.coefficients)
    if in_space:
        given = law, _NO_TETHER, ground, towed.anchor_height, sticking
        motion, moved = (_spatial_motion(towed, given, d, True, start, times, accuracy) for d in (drive, stronger))
        return _with_open_loop_finding(motion, moved)
    scene, elapsed = motion_scene(towed, law, _NO_TETHER, drive, ground.gravity), times - times[0]
    outcome, states, _, statistics = _run(scene, FORCED, start.copy(), elapsed, accuracy)
    forces, _ = spline_values(drive, elapsed[: len(states)])
    motion = _motion(towed, times, states, forces, np.zeros(len(states)), outcome, statistics)
    _, shifted, _, _ = _run(scene._replace(drive=stronger), FORCED, start.copy(), elapsed, accuracy)
    unknown = np.zeros((len(shifted), 2))
    return _with_open_loop_finding(motion, _motion(towed, times, shifted, unknown, unknown[:, 0], outcome, {}))


def _since(start: float, drive: Spline) -> Spline:
    """A drive over the time since the start: the seconds of a Unix clock leave no digits for the steps between."""
    return drive._replace(knots=drive.knots - start)


def _with_open_loop_finding(motion: SimulatedMotion, moved: SimulatedMotion) -> SimulatedMotion:
    """A motion, with a finding if slightly more force leads far away."""
    both = min(len(motion.time_s), len(moved.time_s))
    apart_m = float(np.linalg.norm(motion.pose[:both, :2] - moved.pose[:both, :2], axis=1).max())
    if apart_m <= _FORCE_SHIFT_M:
        return motion
    found = finding("open_loop", percent=100 * _FORCE_ERROR, apart_mm=1000 * apart_m)
    return replace(motion, findings=(*motion.findings, found))


def leaves_plane(
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    ground: Ground,
    hinge_height: float,
    sticking: Sticking | None,
) -> bool:
    """Whether the tow takes the model in three dimensions; raises where the friction is prepared for the planar one."""
    instance_of(towed, "towed", TowedObject)
    instance_of(tether, "tether", Tether)
    instance_of(ground, "ground", Ground)
    instance_of(sticking, "sticking", Sticking, type(None))
    instance_of(hinge_height, "hinge height", float, int, np.number)
    if locked(hinge_height, "hinge height", ()) < 0:
        raise InputError("the tether's hinge is below the floor", got=f"{hinge_height} m", allowed="zero or above")
    prepared = isinstance(law, SlidingPatch)
    if not prepared and not isinstance(law, Sliding):
        instance_of(law, "law", FrictionLaw)
    sliding = _ANY_SLIDING if isinstance(law, SlidingPatch) else as_sliding(law)
    planar = is_planar(towed, sliding, tether, ground, hinge_height, sticking)
    if prepared and not planar:
        raise InputError(
            "friction prepared for a fixed pressure cannot serve a tow with heights, slope, regions or sticking",
            got="a SlidingPatch",
            allowed="a friction law or Sliding",
        )
    return not planar


def _spatial_motion(
    towed: TowedObject,
    given: tuple[Any, Tether, Ground, float, Sticking | None],
    drive: Spline,
    forced: bool,
    start: Array,
    times: Array,
    accuracy: Accuracy,
) -> SimulatedMotion:
    law, tether, ground, hinge_height, sticking = given
    hold = (sticking.static, sticking.speed) if sticking else (0.0, 0.0)
    refuse_tipping(towed.patch, towed.centre_of_mass)
    problem = tow_problem(towed, as_sliding(law), tether, ground, hinge_height, drive, hold)
    run = run_tow(problem, forced, start, times - times[0], accuracy.tolerance, accuracy.step_limit)
    outcome = _OUTCOMES[run.code]
    if outcome == Outcome.CONVERGED and not run.towed:
        outcome = Outcome.SLACK_ALL_ALONG
    return _motion(towed, times, run.states, run.tension[:, 1:], run.tension[:, 0], outcome, run.statistics)


def checked_times(times: ArrayLike) -> Array:
    """Times to report as an array; :class:`InputError` where there are fewer than two or they do not increase."""
    times = locked(times, "times", (None,)).copy()
    increasing(times, "the times to report", 2)
    return times


def resting_patch(
    towed: TowedObject, law: Sliding | FrictionLaw | SlidingPatch, gravity: float = GRAVITY_M_PER_S2
) -> SlidingPatch:
    """The footprint under an object's weight with its friction; a patch that is prepared already, as it is."""
    if isinstance(law, SlidingPatch):
        return law
    return sliding_patch(resting_pressure(towed, gravity), as_sliding(law).law)


def motion_scene(
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    drive: Spline,
    gravity: float = GRAVITY_M_PER_S2,
) -> MotionProblem:
    """A towed object, what it slides on and what draws it, laid out for the compiled right-hand side."""
    instance_of(towed, "towed", TowedObject)
    instance_of(tether, "tether", Tether)
    patch = resting_patch(towed, law, gravity)
    body = [towed.mass, towed.inertia, *(patch.origin - towed.centre_of_mass), *(towed.anchor - towed.centre_of_mass)]
    return MotionProblem(patch, np.array(body), np.array([tether.stiffness, tether.rest_length, tether.damping]), drive)


def centre_state(towed: TowedObject, pose: ArrayLike, twist: ArrayLike) -> Array:
    """State of the centre of mass from pose and twist of the body frame."""
    pose, twist = locked(pose, "start pose", (3,)), locked(twist, "start twist", (3,))
    centre = transform(pose, towed.centre_of_mass)
    return np.array([*centre, pose[2], *velocity_at(twist, centre - pose[:2]), twist[2]])


def _run(
    scene: MotionProblem, mode: int, y: Array, times: Array, accuracy: Accuracy
) -> tuple[Outcome, Array, NDArray[np.int64], dict[str, float]]:
    stretch = np.inf if mode == FORCED else 1 / (scene.patch.per_force * scene.tether[0])
    weights = accuracy.tolerance * error_scales(1 / scene.patch.table[SLOPE], stretch, scene.patch.radius)
    march = march_from(scene, y, times, weights)
    code, filled = integrate(march, mode, accuracy.step_limit)
    statistics = dict(zip(("steps", "rejections", "mode_changes"), map(float, march.counts), strict=True))
    return _OUTCOMES[code], march.states[:filled], march.modes[:filled], statistics


def _motion(
    towed: TowedObject,
    times: Array,
    states: Array,
    forces: Array,
    lengths: Array,
    outcome: Outcome,
    statistics: dict[str, float],
) -> SimulatedMotion:
    """Pose and twist of the body frame from those of the centre of mass."""
    headings = states[:, 2]
    offset = transform(np.column_stack([np.zeros((len(states), 2)), headings]), -towed.centre_of_mass)
    poses = np.column_stack([states[:, :2] + offset, headings])
    twists = np.column_stack([velocity_at(states[:, 3:], offset), states[:, 5]])
    findings: tuple[Finding, ...] = ()
    if outcome != Outcome.CONVERGED:
        code, end_s = str(outcome).replace(" ", "_"), times[len(states) - 1]
        findings = (finding(code, outcome=outcome, time_s=end_s, advice=ADVICE[outcome]),)
    return SimulatedMotion(
        time_s=times[: len(states)],
        pose=poses,
        twist=twists,
        tether_force=forces,
        tether_length=lengths,
        outcome=str(outcome),
        advice=ADVICE[outcome],
        rung="dynamics",
        findings=findings,
        statistics=statistics,
    )
