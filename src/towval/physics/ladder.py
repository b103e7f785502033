"""The ladder of models: model no more than a scene needs.

From the bottom: point friction (a tractrix), the limit surface without inertia, the pressed patch without inertia, full
dynamics. Which rung is enough is not known from the scene's numbers; it is found by running the rungs on the scene and
comparing them. All of them together cost milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from towval.model import FrictionLaw, SimulatedMotion, Tether, TimedPath, TowedObject
from towval.model.errors import InputError
from towval.physics.dynamics import STANDARD, Accuracy, Outcome, feedback
from towval.physics.trailing import TRAILING_RUNGS, trail

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

DYNAMICS = "dynamics"
RUNGS = (*TRAILING_RUNGS, DYNAMICS)
"""Names of the rungs from the simplest to the fullest."""


@dataclass(frozen=True)
class LadderChoice:
    """The rung that is enough for a scene, and by how much.

    ``rung`` its name; ``motion`` what it computed; ``margin_m`` the tolerance less the largest difference to any
    rung above [m], zero for the top; ``differences_m`` of each rung to the one above [m], by the lower's name;
    ``to_dynamics_m`` of each rung to the top [m]; ``tolerance_m`` what was asked.
    """

    rung: str
    motion: SimulatedMotion
    margin_m: float
    differences_m: dict[str, float]
    to_dynamics_m: dict[str, float]
    tolerance_m: float


def simulate_rung(
    rung: str,
    towed: TowedObject,
    law: FrictionLaw,
    tether: Tether,
    hinge: TimedPath | CubicSpline,
    start_pose: ArrayLike,
    times: ArrayLike,
    *,
    accuracy: Accuracy = STANDARD,
) -> SimulatedMotion:
    """Motion of a towed object by the rung of that name; the arguments are those of ``dynamics.feedback``.

    Raises
    ------
    InputError
        When there is no such rung.
    """
    if rung == DYNAMICS:
        return feedback(towed, law, tether, hinge, start_pose, times, accuracy=accuracy)
    if rung not in TRAILING_RUNGS:
        raise InputError("there is no such rung", got=rung, allowed=", ".join(RUNGS))
    return trail(rung, towed, law, tether, hinge, start_pose, times)


def choose_rung(
    towed: TowedObject,
    law: FrictionLaw,
    tether: Tether,
    hinge: TimedPath | CubicSpline,
    start_pose: ArrayLike,
    times: ArrayLike,
    tolerance_m: float,
    *,
    accuracy: Accuracy = STANDARD,
) -> LadderChoice:
    """The simplest rung that stays within a tolerance of every rung above it, on this very scene.

    Parameters
    ----------
    towed, law, tether, hinge, start_pose, times, accuracy
        As in :func:`towval.physics.dynamics.feedback`.
    tolerance_m : float
        Largest displacement allowed of any corner of the footprint at any of the times [m].

    Returns
    -------
    LadderChoice
    """
    if not tolerance_m > 0:
        raise InputError(
            "the tolerance of the ladder is out of range", got=tolerance_m, allowed="above zero, in metres"
        )
    scene = (towed, law, tether, hinge, start_pose, times)
    motions = [simulate_rung(rung, *scene, accuracy=accuracy) for rung in RUNGS]
    apart = np.array([[_apart(towed, lower, upper) for upper in motions] for lower in motions])
    largest = [apart[k, k + 1 :].max(initial=0.0) for k in range(len(RUNGS))]
    chosen = next(k for k, distance in enumerate(largest) if distance <= tolerance_m)
    return LadderChoice(
        rung=RUNGS[chosen],
        motion=motions[chosen],
        margin_m=float(tolerance_m - largest[chosen]) if chosen < len(RUNGS) - 1 else 0.0,
        differences_m={RUNGS[k]: float(apart[k, k + 1]) for k in range(len(RUNGS) - 1)},
        to_dynamics_m={RUNGS[k]: float(apart[k, -1]) for k in range(len(RUNGS) - 1)},
        tolerance_m=tolerance_m,
    )


def _apart(towed: TowedObject, one: SimulatedMotion, other: SimulatedMotion) -> float:
    """Largest distance between the same corner of the footprint in two motions [m]; infinite where one ended early."""
    ended = {Outcome.CONVERGED, Outcome.SLACK_ALL_ALONG}
    if one.outcome not in ended or other.outcome not in ended:
        return float("inf")
    reach = np.linalg.norm(towed.patch.outline, axis=1).max()
    shift = np.linalg.norm(one.pose[:, :2] - other.pose[:, :2], axis=1)
    turn = 2 * np.abs(np.sin((one.pose[:, 2] - other.pose[:, 2]) / 2)) * reach
    return float((shift + turn).max())
