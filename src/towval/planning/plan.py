"""Stage plan: the rover motion that makes the object follow a path, and the resulting deviation.

The quasi-static model turns the desired path of the object into a nominal path of the hinge; the planner turns that
into a feasible motion of the rover; feedback dynamics give the motion of the object behind that rover.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionLaw, Ground, SimulatedMotion, Sliding, Tether, TimedPath, TowedObject
from towval.model.checks import locked
from towval.model.errors import InputError
from towval.model.geometry import transform
from towval.physics.dynamics import LEVEL, feedback
from towval.physics.quasistatic import QuasistaticMotion
from towval.physics.wrench import SlidingPatch
from towval.planning.kinematics import Rover
from towval.planning.paths import deviation_rms
from towval.planning.planner import PlannerSettings, RoverPlan, plan_rover


@dataclass(frozen=True)
class ClosedLoop:
    """Planned motion of the rover and simulated motion of the object behind it.

    ``object_rms`` [m] is the deviation of the object from its nominal path as a curve (see
    :func:`towval.planning.paths.deviation_rms`); that of the hinge is ``rover.rms``.
    """

    rover: RoverPlan
    towed: SimulatedMotion
    object_rms: float


def close_loop(
    nominal: QuasistaticMotion,
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    rover: Rover,
    settings: PlannerSettings,
    *,
    report_stride: int = 1,
    ground: Ground = LEVEL,
    hinge_height: float = 0.0,
) -> ClosedLoop:
    """Plan the rover along the nominal path of the hinge and tow the object behind it.

    SOURCE: sections 2.3 (case 2) and 2.4. The object starts with the nominal pose and velocity.

    The planner adopts the equal time steps of ``nominal``; every ``report_stride`` rows of the plan are knots of the
    hinge's trajectory, and reported. The rest is as in :func:`tow` and :func:`towval.planning.planner.plan_rover`.

    Raises `InputError` when the plan ends before the rover has moved.
    """
    plan = plan_rover(nominal.hinge, rover, settings)
    motion = tow(
        plan.time_s,
        plan.hinge,
        towed,
        law,
        tether,
        start_pose=nominal.pose[0],
        start_twist=nominal.twist[0],
        stride=report_stride,
        ground=ground,
        hinge_height=hinge_height,
    )
    return ClosedLoop(plan, motion, deviation_rms(motion.pose[:, :2], nominal.pose[:, :2]))


def tow(
    times: ArrayLike,
    hinge: ArrayLike,
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    *,
    start_pose: ArrayLike,
    start_twist: ArrayLike = (0.0, 0.0, 0.0),
    stride: int = 1,
    ground: Ground = LEVEL,
    hinge_height: float = 0.0,
) -> SimulatedMotion:
    """Tow an object behind a hinge that passes through given points: of a plan, a track or any recording of poses.

    Times (n,) [s] and points (n, 2) [m], of which every ``stride`` and the last are used and reported; the rest is as
    in :func:`towval.physics.dynamics.feedback`. Raises `InputError` when there are fewer than two points.
    """
    if isinstance(stride, bool) or not isinstance(stride, int | np.integer) or stride < 1:
        raise InputError("the stride of a tow is out of range", got=stride, allowed="a whole number, 1 or more")
    whole = TimedPath(locked(times, "times of the tow", (None,)), locked(hinge, "hinge of the tow", (None, 2)))
    count = len(whole.time_s)
    if count < 2:
        poses = f"{count} pose{'s' * (count != 1)}"
        raise InputError("the rover cannot tow without moving", got=poses, allowed="two poses or more")
    rows = np.unique(np.r_[0:count:stride, count - 1])
    path = TimedPath(whole.time_s[rows], whole.position[rows])
    return feedback(
        towed, law, tether, path, start_pose, path.time_s, start_twist=start_twist, ground=ground,
        hinge_height=hinge_height,
    )  # fmt: skip


def hinge_of_poses(pose: ArrayLike, rover: Rover) -> Array:
    """Positions of the hinge (n, 2) [m] of a rover at poses (n, 3)."""
    return transform(locked(pose, "poses of the rover", (None, 3)), rover.hinge)
