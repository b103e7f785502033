"""The motion of a towed box, computed without the package's physics: the reference for its methods.

Friction is summed over Gauss-Legendre nodes of the box's base, time is stepped by SciPy's Radau. Nothing is compiled,
tabulated or split into modes, so what this and :mod:`towval.physics` have in common is the model on paper alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from towval.model import Array
from towval.model.conventions import GRAVITY_M_PER_S2
from towval.model.errors import RefusedError

PointMotion = Callable[[float], Array]
"""Place (2,) of a point on the floor [m] at a time [s]."""

_LEAST_SPEED = 1e-12


@dataclass(frozen=True)
class Box:
    """A box on the floor, pressed all over: ``size_m`` (length, width) about the origin of its frame.

    ``mass`` [kg]; ``centre`` (2,) of mass and ``anchor`` (2,) of the tether in its frame [m]; ``inertia`` about the
    centre of mass [kg m²]; friction ``μ tanh(v / stiction_velocity)`` with ``friction`` μ [1] and the velocity [m/s].
    """

    size_m: tuple[float, float]
    mass: float
    centre: tuple[float, float]
    inertia: float
    anchor: tuple[float, float]
    friction: float
    stiction_velocity: float

    def nodes(self, panels: tuple[int, int], order: int) -> tuple[Array, Array]:
        """Places (k, 2) [m] and normal forces (k,) [N] of ``order`` Gauss nodes a panel and axis.

        Raises
        ------
        RefusedError
            When a part of the base carries no load: there the pressure is no plane any more.
        """
        axes = [_panelled(side, count, order) for side, count in zip(self.size_m, panels, strict=True)]
        x, y = (grid.ravel() for grid in np.meshgrid(axes[0][0], axes[1][0]))
        area = np.outer(axes[1][1], axes[0][1]).ravel()
        # Moments of a rectangle about its centre are diagonal: force, ∫x²dS and ∫y²dS.
        length, width = self.size_m
        load = self.mass * GRAVITY_M_PER_S2
        plane = load / (length * width) * np.array([1, *(12 * np.array(self.centre) / np.square(self.size_m))])
        if plane[0] - np.abs(plane[1:]) @ np.array(self.size_m) / 2 <= 0:
            raise RefusedError("the base of the reference box is not pressed all over", got=f"centre {self.centre} m")
        return np.column_stack([x, y]), area * (plane[0] + plane[1] * x + plane[2] * y)


def _panelled(side: float, panels: int, order: int) -> tuple[Array, Array]:
    """Nodes and weights on a side about zero, cut into panels of Gauss-Legendre nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    edges = np.linspace(-side / 2, side / 2, panels + 1)
    half = side / panels / 2
    return ((edges[:-1] + edges[1:])[:, None] / 2 + half * nodes).ravel(), np.tile(half * weights, panels)


def towed_box(
    box: Box,
    hinge: PointMotion,
    tether: tuple[float, float],
    start_pose: ArrayLike,
    times: ArrayLike,
    *,
    panels: tuple[int, int] = (4, 4),
    order: int = 6,
    tolerance: float = 1e-9,
    longest_step_s: float = 0.02,
) -> Array:
    """Poses (n, 3) of a box's frame behind a tether whose hinge moves along a known path [m, m, rad].

    Parameters
    ----------
    box : Box
    hinge : callable
        Place of the tether's other end [m] at a time [s].
    tether : (float, float)
        Rest length [m] and stiffness [N/m].
    start_pose : array_like (3,)
        The box's pose at ``times[0]``, at rest.
    times : array_like (n,)
        When to report [s].
    panels, order
        Panels along length and width, and Gauss nodes in each.
    tolerance : float, optional
        Of Radau, relative; absolute it is a hundredth of that [m].
    longest_step_s : float, optional
        No step is longer, so that the moment at which the tether tightens is not stepped over.

    Raises
    ------
    RefusedError
        When Radau gives up.
    """
    times, centre = np.asarray(times, dtype=np.float64), np.array(box.centre)
    places, force = box.nodes(panels, order)
    arms, pull_arm = places - centre, np.array(box.anchor) - centre
    length, stiffness = tether

    def rate(t: float, state: Array) -> Array:
        heading, velocity, spin = state[2], state[3:5], state[5]
        turned, lever = planar(heading, arms), planar(heading, pull_arm)
        span = hinge(t) - state[:2] - lever
        reach = np.hypot(*span)
        pull = max(0.0, stiffness * (reach - length)) * span / reach
        sliding = velocity + spin * np.column_stack([-turned[:, 1], turned[:, 0]])
        speed = np.sqrt(np.einsum("ij,ij->i", sliding, sliding)) + _LEAST_SPEED
        drag = -(box.friction * force * np.tanh(speed / box.stiction_velocity) / speed)[:, None] * sliding
        torque = turned[:, 0] @ drag[:, 1] - turned[:, 1] @ drag[:, 0] + lever[0] * pull[1] - lever[1] * pull[0]
        return np.concatenate([velocity, [spin], (drag.sum(axis=0) + pull) / box.mass, [torque / box.inertia]])

    start = np.asarray(start_pose, dtype=np.float64)
    state = np.array([*(start[:2] + planar(start[2], centre)), start[2], 0.0, 0.0, 0.0])
    accuracy = {"rtol": tolerance, "atol": tolerance / 100, "max_step": longest_step_s}
    solution = solve_ivp(rate, (times[0], times[-1]), state, "Radau", times, **accuracy)
    if not solution.success:
        raise RefusedError("the reference motion cannot be computed", got=solution.message)
    origin = np.array([p - planar(h, centre) for p, h in zip(solution.y[:2].T, solution.y[2], strict=True)])
    return np.column_stack([origin, solution.y[2]])


def planar(heading: float, points: Array) -> Array:
    """Points (..., 2) turned by an angle [rad]."""
    c, s = np.cos(heading), np.sin(heading)
    return points @ np.array([[c, s], [-s, c]])
