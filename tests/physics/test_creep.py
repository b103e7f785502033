"""Creep at rest against the speed that the law itself gives."""

import numpy as np
import pytest

from towval.model import Tether, TimedPath
from towval.physics.creep import creep_length
from towval.physics.dynamics import feedback
from towval.physics.friction_laws import Coulomb

PULL = 0.5


def test_creep_is_what_the_law_lets_through(cube):
    """Under half of what friction bears, μ tanh(v/v_s) = μ/2 gives v = v_s atanh(1/2)."""
    stiction, duration, tether = 1e-3, 40.0, Tether(0.6, 1000.0)
    speed = stiction * np.arctanh(PULL)
    taut = 0.8 + PULL * 0.35 * 5.0 * 9.81 / 1000
    hinge = TimedPath([0.0, duration], [[taut, 0.0], [taut + speed * duration, 0.0]])
    times = np.linspace(0, duration, 201)
    motion = feedback(cube, Coulomb(0.35, stiction), tether, hinge, (0, 0, 0), times)
    crept = creep_length(motion, cube, stiction)
    assert crept == pytest.approx(speed * duration, rel=0.01)
    assert crept == pytest.approx(motion.pose[-1, 0], rel=0.01)


def test_sliding_is_not_creep(cube):
    tether = Tether(0.6, 1000.0)
    hinge = TimedPath([0.0, 10.0], [[0.82, 0.0], [2.82, 0.0]])
    times = np.linspace(0, 10, 1001)
    motion = feedback(cube, Coulomb(0.35, 1e-3), tether, hinge, (0, 0, 0), times)
    assert motion.pose[-1, 0] > 1.9
    assert creep_length(motion, cube, 1e-3) < 1e-5
