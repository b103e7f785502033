"""Laws and objects the physics tests share."""

import numpy as np
import pytest

from footprints import rectangle
from towval.model import Tether, TimedPath, TowedObject
from towval.physics.friction_laws import Coulomb, Makkar


@pytest.fixture(scope="session")
def square():
    return rectangle(0.4, 0.4)


@pytest.fixture(scope="session")
def makkar():
    return Makkar(0.06, 400, 40, 0.35, 800, 0)


@pytest.fixture(scope="session")
def cube(square):
    return TowedObject(square, 5.0, [0, 0], 0.4 / 3, [0.2, 0])


@pytest.fixture(scope="session")
def lap():
    """The lap of the oracles: law, tether, path of the hinge, start pose of the cube."""
    t = np.linspace(0, 400.0, 4001)
    tau = 2 * np.pi * t / 400.0
    scale = 1 + np.sin(tau) ** 2
    hinge = TimedPath(t, np.column_stack([np.cos(tau), np.sin(tau) * np.cos(tau)]) / scale[:, None])
    return Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (1.0, -0.8, np.pi / 2)
