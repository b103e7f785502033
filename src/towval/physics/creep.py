"""Creep at rest: how far an object slid under a regularised friction law where a real one would have stuck."""

import numpy as np

from towval.model import SimulatedMotion, TowedObject
from towval.model.checks import instance_of


def creep_length(motion: SimulatedMotion, towed: TowedObject, stiction_velocity: float) -> float:
    """Path length of the footprint's fastest corner at speeds below the stiction velocity [m].

    Below v_s a law that rises from zero at rest lets the object slide under any pull, at about ``v_s T / (μ N)``; a
    real one sticks, so the accumulated creep is no motion of the real object. The speed of that corner is taken as the
    sum of the origin's and that of turning about it, which no corner exceeds. Evaluated at the reported times by the
    trapezium rule.

    ``stiction_velocity``: speed at which friction is fully there [m/s].

    Examples
    --------
    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> hinge = TimedPath([0.0, 100.0], [[0.8, 0.0], [0.8, 0.01]])  # slower than the stiction velocity
    >>> motion = feedback(towed, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (0.0, 0.0, 0.0), [0.0, 50.0, 100.0])
    >>> bool(creep_length(motion, towed, 1e-3) > 0)
    True
    """
    instance_of(motion, "motion", SimulatedMotion)
    instance_of(towed, "towed", TowedObject)
    instance_of(stiction_velocity, "stiction velocity", float, int, np.number)
    reach = float(np.linalg.norm(towed.patch.corners, axis=1).max())
    speed = np.linalg.norm(motion.twist[:, :2], axis=1) + reach * np.abs(motion.twist[:, 2])
    slow = np.where(speed < stiction_velocity, speed, 0.0)
    return float(np.sum((slow[1:] + slow[:-1]) / 2 * np.diff(motion.time_s)))
