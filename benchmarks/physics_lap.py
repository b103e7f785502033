"""The lap of tests/oracles.py: a cube towed by a tether along Bernoulli's lemniscate, feedback dynamics."""

from __future__ import annotations

import numpy as np

from towval.physics.dynamics import Accuracy, feedback
from towval.physics.friction_law import coulomb_law
from towval.types import Array, Patch, Path, Tether, TowedObject

SIDE, MASS, MU, STIFFNESS, LENGTH = 0.4, 5.0, 0.35, 1000.0, 0.6
START = (1.0, -0.8, np.pi / 2)


PERIOD = 400.0


def lemniscate(period: float, points: int = 4001) -> Path:
    t = np.linspace(0, period, points)
    tau = 2 * np.pi * t / period
    return Path(t, np.column_stack([np.cos(tau), np.sin(tau) * np.cos(tau)]) / (1 + np.sin(tau) ** 2)[:, None])


def simulate(period: float, times: Array, tolerance: float) -> Array:
    x = SIDE / 2
    cube = TowedObject(Patch([[-x, -x], [x, -x], [x, x], [-x, x]]), MASS, [0, 0], 0.4 / 3, [x, 0])
    accuracy = Accuracy(tolerance)
    law, tether = coulomb_law(MU, 1e-3), Tether(LENGTH, STIFFNESS)
    return feedback(cube, law, tether, lemniscate(period), START, times, accuracy=accuracy).pose[:, :2]
