"""The ladder of models: model no more than a scene needs.

From the bottom: point friction (a tractrix), the limit surface without inertia, the pressed patch without inertia, full
dynamics. The numbers of a scene do not say which rung is enough; it is found by comparing the rungs on the scene,
from the top down and no further than the comparison leaves open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from towval.model import FrictionLaw, Ground, SimulatedMotion, Sliding, Tether, TimedPath, TowedObject
from towval.model.checks import instance_of
from towval.model.errors import InputError
from towval.model.plugins import Registry
from towval.physics.dynamics import LEVEL, STANDARD, Accuracy, Outcome, feedback, resting_patch
from towval.physics.spatial.tow import Sticking
from towval.physics.splines import Spline
from towval.physics.trailing import LIMIT_SURFACE, PATCH, TRACTRIX, trail
from towval.physics.wrench import SlidingPatch

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

DYNAMICS = "dynamics"
"""The reference: no rung stands above it."""

RUNGS: Registry[Callable[..., SimulatedMotion]] = Registry("rung")
"""Functions with the arguments of :func:`towval.physics.dynamics.feedback` but ``start_twist``, simplest first.

Those below the dynamics get a scene in the plane of the floor; see :func:`simulate_rung`.
"""


def _trailing(rung: str, *scene: Any, accuracy: Accuracy) -> SimulatedMotion:
    return trail(rung, *scene)


RUNGS.register(TRACTRIX, partial(_trailing, TRACTRIX))
RUNGS.register(LIMIT_SURFACE, partial(_trailing, LIMIT_SURFACE))
RUNGS.register(PATCH, partial(_trailing, PATCH))
RUNGS.register(DYNAMICS, feedback)


def rung_names() -> tuple[str, ...]:
    """Names of the rungs from the simplest to the fullest; one that a plugin registers stands just below dynamics.

    Examples
    --------
    >>> rung_names()
    ('tractrix', 'limit surface', 'quasi-static patch', 'dynamics')
    """
    return (*(name for name in RUNGS if name != DYNAMICS), DYNAMICS)


@dataclass(frozen=True)
class LadderChoice:
    """The rung that is enough for a scene.

    ``rung`` its name; ``motion`` what it computed; ``to_dynamics_m`` the difference of each rung that was run from the
    top [m]; ``tolerance_m`` what was asked.
    """

    rung: str
    motion: SimulatedMotion
    to_dynamics_m: dict[str, float]
    tolerance_m: float


def simulate_rung(
    rung: str,
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    hinge: TimedPath | CubicSpline | Spline,
    start_pose: ArrayLike,
    times: ArrayLike,
    *,
    accuracy: Accuracy = STANDARD,
    ground: Ground = LEVEL,
    hinge_height: float = 0.0,
    sticking: Sticking | None = None,
) -> SimulatedMotion:
    """Motion of a towed object by the rung of that name; the arguments are those of ``dynamics.feedback``.

    Below the dynamics a rung is a model in the plane of the floor. What leaves the plane is left out here, for all to
    see: heights, sticking, stiffening and mass of the tether, and of the ground all but its gravity. The ladder counts
    what that changes from the dynamics.

    Raises `InputError` when there is no such rung.

    Examples
    --------
    >>> from towval.model import Patch
    >>> from towval.physics.friction_laws import Coulomb
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0, 0), 0.13, (0.2, 0))
    >>> hinge = TimedPath([0.0, 10.0], [[0.8, 0.0], [1.8, 0.0]])
    >>> scene = towed, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (0.0, 0.0, 0.0), [0.0, 10.0]
    >>> simulate_rung("tractrix", *scene).pose[-1].round(4)
    array([0.9828, 0.    , 0.    ])
    """
    function = RUNGS.require(rung, "simulate.rung")
    if rung == DYNAMICS:
        function = partial(function, ground=ground, hinge_height=hinge_height, sticking=sticking)
    else:
        instance_of(tether, "tether", Tether)
        instance_of(ground, "ground", Ground)
        law = resting_patch(towed, law, ground.gravity)
        towed = replace(towed, anchor_height=0.0, centre_of_mass_height=0.0)
        tether = replace(tether, stiffening=0.0, mass_per_length=0.0)
    return function(towed, law, tether, hinge, start_pose, times, accuracy=accuracy)


def choose_rung(
    towed: TowedObject,
    law: Sliding | FrictionLaw | SlidingPatch,
    tether: Tether,
    hinge: TimedPath | CubicSpline | Spline,
    start_pose: ArrayLike,
    times: ArrayLike,
    tolerance_m: float,
    *,
    accuracy: Accuracy = STANDARD,
) -> LadderChoice:
    """The simplest rung that stays within a tolerance of every rung above it, on this very scene.

    Rungs are run from the top down. Once two of them are apart by more than twice the tolerance, none below can be
    within the tolerance of both (triangle inequality), and they are not run.

    Parameters
    ----------
    towed, law, tether, hinge, start_pose, times, accuracy
        As in :func:`towval.physics.dynamics.feedback`.
    tolerance_m : float
        Largest displacement allowed of any corner of the footprint at any of the times [m].

    Examples
    --------
    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> hinge = TimedPath([0.0, 10.0], [[0.8, 0.0], [1.8, 0.0]])
    >>> scene = towed, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (0.0, 0.0, 0.0), [0.0, 10.0]
    >>> choose_rung(*scene, 0.05).rung
    'tractrix'
    """
    scene = (towed, law, tether, hinge, start_pose, times)
    return lowest_rung(towed, tolerance_m, lambda rung: simulate_rung(rung, *scene, accuracy=accuracy))


def lowest_rung(towed: TowedObject, tolerance_m: float, run: Callable[[str], SimulatedMotion]) -> LadderChoice:
    """As :func:`choose_rung`, with a function that simulates the scene by the rung of a name."""
    instance_of(tolerance_m, "the tolerance of the ladder", float, int, np.number)
    if not tolerance_m > 0:
        raise InputError(
            "the tolerance of the ladder is out of range", got=tolerance_m, allowed="above zero, in metres"
        )
    *simpler, top = rung_names()
    motions, to_dynamics, chosen = {top: run(top)}, {}, top
    for rung in reversed(simpler):
        motion = run(rung)
        differences = {name: path_difference(towed, motion, above) for name, above in motions.items()}
        motions[rung], to_dynamics[rung] = motion, differences[top]
        largest = max(differences.values())
        if largest <= tolerance_m:
            chosen = rung
        if largest > 2 * tolerance_m:
            break
    return LadderChoice(chosen, motions[chosen], to_dynamics, tolerance_m)


def path_difference(towed: TowedObject, one: SimulatedMotion, other: SimulatedMotion) -> float:
    """Bound of the distance between the same corner of the footprint in two motions [m], at most over their times.

    Shift and turn count in full, whichever corner is moved less by both. Infinite where one motion ended early.
    """
    instance_of(towed, "towed", TowedObject)
    for motion in (one, other):
        instance_of(motion, "motion", SimulatedMotion)
    ended = {Outcome.CONVERGED, Outcome.SLACK_ALL_ALONG}
    if one.outcome not in ended or other.outcome not in ended:
        return float("inf")
    reach = np.linalg.norm(towed.patch.corners, axis=1).max()
    shift = np.linalg.norm(one.pose[:, :2] - other.pose[:, :2], axis=1)
    turn = 2 * np.abs(np.sin((one.pose[:, 2] - other.pose[:, 2]) / 2)) * reach
    return float((shift + turn).max())
