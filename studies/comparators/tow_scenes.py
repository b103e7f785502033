"""Two towed motions on which integrators and engines are compared: the lap of a cube, and stick-slip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from towval.model import Array, FrictionLaw, Patch, Tether, TimedPath, TowedObject
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import Coulomb, Makkar
from towval.physics.wrench import SlidingPatch, sliding_patch


@dataclass(frozen=True)
class TowScene:
    """A motion to be integrated: who is towed, on what, by what, from where, reported when."""

    towed: TowedObject
    patch: SlidingPatch
    tether: Tether
    hinge: TimedPath
    start_pose: tuple[float, float, float]
    times: Array


def lap_scene(duration: float = 400.0) -> TowScene:
    """A cube towed slowly along Bernoulli's lemniscate, 2 m wide, from rest; the tether goes slack for a while."""
    return _cube_scene(Coulomb(0.35, 1e-3), 1000.0, lemniscate(duration), (1.0, -0.8, np.pi / 2), 201)


def lemniscate(duration: float, points: int = 4001) -> TimedPath:
    """Once around Bernoulli's lemniscate, 2 m wide, in a time [s]."""
    t = np.linspace(0, duration, points)
    tau = 2 * np.pi * t / duration
    return TimedPath(t, np.column_stack([np.cos(tau), np.sin(tau) * np.cos(tau)]) / (1 + np.sin(tau) ** 2)[:, None])


def stick_slip_scene(duration: float = 20.0) -> TowScene:
    """A cube that sticks and slips behind a soft tether whose end creeps, under a law that falls by a third."""
    t = np.linspace(0, duration, 201)
    path = np.column_stack([0.8 + 0.01 * t, 0.02 * (1 - np.cos(0.3 * t))])
    return _cube_scene(Makkar(0.15, 800.0, 50.0, 0.3, 1600.0, 0.0), 200.0, TimedPath(t, path), (0.0, 0.0, 0.0), 401)


def _cube_scene(
    law: FrictionLaw, stiffness: float, hinge: TimedPath, start: tuple[float, float, float], reports: int
) -> TowScene:
    square = Patch(np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]))
    cube = TowedObject(square, 5.0, np.zeros(2), 0.4 / 3, np.array([0.2, 0.0]))
    times = np.linspace(hinge.time_s[0], hinge.time_s[-1], reports)
    return TowScene(cube, sliding_patch(resting_pressure(cube), law), Tether(0.6, stiffness), hinge, start, times)


SCENES: dict[str, Callable[[], TowScene]] = {"lap": lap_scene, "stick-slip": stick_slip_scene}
"""By the name that tables show."""
