"""What the shape of the friction law at rest costs a solver: smooth, with a kink, or with a jump.

The equation of motion is written out here once more, over the cells of a mesh, and solved by SciPy's solvers: the
package's integrator takes no law that jumps.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from studies.frame import Row
from studies.paper.finite_volumes import MeshPressure, mesh_pressure
from studies.paper.scene import PaperScene
from towval.model import Array
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.physics.friction_laws import fitted_law

ELEMENT_SIZE = 0.1
"""Longest side of a cell of the footprint [m]."""

SECONDS = 0.2
"""Simulated time: the tether tightens, the object breaks away and slides."""

MOST_EVALUATIONS = 10_000
"""Evaluations of the equation of motion after which a solver is stopped: several times what a continuous law takes."""

SOLVERS = ("RK45", "LSODA", "Radau")
"""One explicit, one that changes between both kinds, one implicit."""

Coefficient = Callable[[Array], Array]


class _Stopped(Exception):
    """A solver has had all the evaluations that it is allowed."""


def laws(scene: PaperScene) -> dict[str, Coefficient]:
    """Friction coefficient over speed [m/s] by the shape of the law at rest; all have the same plateau."""
    smooth, plateau = fitted_law(scene.friction).law.coefficient, scene.friction.kinetic
    slope = float(smooth(np.array([1e-9]))[0] / 1e-9)
    return {"smooth": smooth, "kink": kinked(slope, plateau), "jump": jumping(plateau)}


def kinked(slope: float, plateau: float) -> Coefficient:
    """Continuous, not differentiable: rises as the smooth law does at rest, and stays at the plateau."""
    return lambda speed: np.minimum(slope * speed, plateau)


def jumping(plateau: float) -> Coefficient:
    """Not continuous: the plateau at any speed above zero, nothing at rest."""
    return lambda speed: np.where(speed > 0, plateau, 0.0)


def cube_pressure(scene: PaperScene) -> MeshPressure:
    """The cube's pressure on the cells."""
    towed = scene.towed
    return mesh_pressure(towed.patch, [(towed.mass * GRAVITY_M_PER_S2, towed.centre_of_mass)], ELEMENT_SIZE)


def law_shape_rows(scene: PaperScene, speed: float) -> list[Row]:
    """Evaluations that each solver takes, and how far it gets, where the cube is towed from rest at a speed [m/s]."""
    return [
        {"law": name, "solver": solver} | _solved(scene, law, speed, solver)
        for name, law in laws(scene).items()
        for solver in SOLVERS
    ]


def _solved(scene: PaperScene, law: Coefficient, speed: float, solver: str) -> Row:
    count, reached = 0, 0.0
    motion = equation_of_motion(scene, law, speed)

    def counted(time: float, state: Array) -> Array:
        nonlocal count, reached
        if count == MOST_EVALUATIONS:
            raise _Stopped
        count, reached = count + 1, time
        return motion(time, state)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a solver that fails says so in its result, too
        try:
            found: Any = solve_ivp(counted, (0.0, SECONDS), np.zeros(6), method=solver, rtol=1e-6, atol=1e-9)
            reached = float(found.t[-1])
        except _Stopped:
            pass
    return {"evaluations": count, "reached_s": reached, "ended": float(reached == SECONDS)}


def equation_of_motion(scene: PaperScene, law: Coefficient, speed: float) -> Callable[[float, Array], Array]:
    """Rates of position, heading and their rates, about the centre of mass; the hinge leaves along the tether."""
    towed, tether = scene.towed, scene.tether
    pressure = cube_pressure(scene)
    cells = pressure.mesh.centroids - towed.centre_of_mass
    anchor = towed.anchor - towed.centre_of_mass

    def rates(time: float, state: Array) -> Array:
        cos, sin = np.cos(state[2]), np.sin(state[2])
        turn = np.array([[cos, -sin], [sin, cos]])
        arms, lever = cells @ turn.T, turn @ anchor
        sliding = state[3:5] + state[5] * np.column_stack([-arms[:, 1], arms[:, 0]])
        fast = np.hypot(*sliding.T)
        direction = sliding / np.where(fast > 0, fast, 1.0)[:, None]
        friction = -(pressure.force * law(fast))[:, None] * direction
        hinge = anchor + np.array([tether.rest_length + speed * time, 0.0])
        span = hinge - state[:2] - lever
        length = np.hypot(*span)
        pull = tether.stiffness * max(0.0, length - tether.rest_length) * span / length
        moment = np.sum(arms[:, 0] * friction[:, 1] - arms[:, 1] * friction[:, 0])
        moment += lever[0] * pull[1] - lever[1] * pull[0]
        return np.array([*state[3:], *(friction.sum(axis=0) + pull) / towed.mass, moment / towed.inertia])

    return rates
