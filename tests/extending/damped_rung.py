"""A rung of the ladder from outside the package: the dynamics with a tether that does not oscillate."""

from dataclasses import replace

from towval.physics.dynamics import feedback
from towval.physics.ladder import RUNGS


def without_oscillation(towed, law, tether, *motion, accuracy):
    """Motion of the object with the damping of the tether raised to a tenth of its stiffness [s]."""
    return replace(
        feedback(towed, law, replace(tether, damping=0.1 * tether.stiffness), *motion, accuracy=accuracy), rung="damped"
    )


RUNGS.register("damped", without_oscillation)
