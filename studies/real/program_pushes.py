"""Quasi-static pushes by the package's own physics: what ``towval.physics.spatial`` makes of a pusher at a height.

To the package a push is a force at the anchor. Under a known wrench the body starts to move by the twist in which
friction at rest gives way first (``holding``); at a known twist the pusher's wrench is what friction takes, at the
pressure that friction itself shifts (``pressure``). Feet are points in the data: here they are squares, the last of
:data:`FEET_M`, 0.1 % of their distances. Where a body turns about a foot the twist that gives way first is at a kink as
wide as the foot; the search for it starts from that of larger feet. Where a push would lift a foot the body starts to
tip: the push is then taken to be lower, by as many hundredths as balance it.

Wrenches (3,) are the pusher's, about the centre of mass in body axes [N, N, N m]; twists (3,) of the centre of mass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Ground, Patch, Sliding, Tether, TimedPath, TowedObject
from towval.model.errors import RefusedError
from towval.physics.friction_laws import Coulomb
from towval.physics.spatial.holding import holding_margin
from towval.physics.spatial.pressure import BALANCED, TIPS, solve_pressure
from towval.physics.spatial.problem import ABOVE, ANCHOR_X, ANCHOR_Y, GRAVITY_N, HEIGHT, MASS, TowProblem, tow_problem
from towval.physics.spatial.soles import RADIUS, Work, work_for
from towval.physics.spatial.unit_wrenches import W
from towval.physics.splines import spline_through

FEET_M = (5e-3, 1e-3, 3e-4, 1e-4)
"""Sides of the feet, one after another."""
_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_RISE_M_PER_S = 1e-9  # of friction; a push of 1 s goes some millimetres
_LOWER, _LEAST_SHARE = 0.99, 0.5  # of the pusher's height, where a foot lifts
_UNIT = TimedPath(np.array([0.0, 1.0]), np.ones((2, 2)))


def shrinking_feet(places: ArrayLike) -> list[Patch]:
    """Feet at places (k, 2) [m] as squares, smaller and smaller."""
    return [Patch.of([place + side * _SQUARE for place in np.asarray(places, dtype=np.float64)]) for side in FEET_M]


class PushedBody:
    """A body under a pusher at a height, in the package's model; its centre of mass is the origin.

    Parameters
    ----------
    footprints : sequence of Patch
        About the centre of mass [m]: the last is the body's, on those before a search starts.
    mass : float
        [kg].
    height : float
        Of the pusher above the floor [m].
    friction : float
        Coefficient [1], which shifts the pressure at a known twist; the twist under a known wrench does not need it.
    radius_over_planar : float, optional
        Friction radius over that of the planar pressure, as in :class:`towval.model.Sliding`.
    """

    def __init__(
        self, footprints: Sequence[Patch], mass: float, height: float, friction: float, radius_over_planar: float = 1.0
    ) -> None:
        sliding = Sliding(Coulomb(friction, _RISE_M_PER_S), radius_over_planar=radius_over_planar)
        self._laid_out = [_laid_out(patch, mass, height, sliding) for patch in footprints]

    def twist(self, wrench: ArrayLike) -> tuple[Array, float]:
        """Twist (3,) that a wrench causes, w·ξ = 1 W, and the coefficient of friction [1] that just bears it."""
        fx, fy, moment = np.asarray(wrench, dtype=np.float64)
        # The force acts where its moment is the given one, nearest to the centre of mass.
        arm = moment / (fx * fx + fy * fy)
        twist, margin, share = np.zeros(3), -1.0, 1.0
        for laid_out, work in self._laid_out:
            numbers, radius = laid_out.numbers.copy(), laid_out.soles.numbers[RADIUS]
            numbers[ANCHOR_X], numbers[ANCHOR_Y] = fy * arm, -fx * arm
            force = laid_out.drive._replace(coefficients=laid_out.drive.coefficients * [[[fx], [fy]]])
            problem = laid_out._replace(numbers=numbers, drive=force)
            while share > _LEAST_SHARE:
                found = twist * (1.0, 1.0, radius)
                numbers[ABOVE] = share * laid_out.numbers[ABOVE]
                margin = holding_margin(problem, True, 0.0, 0, np.zeros(6), work, found)
                if margin > -1.0:
                    break
                share *= _LOWER
            twist = found / (1.0, 1.0, radius)
        if margin == -1.0:
            raise RefusedError("the push tips the body over", got=f"{fx:.3f} N, {fy:.3f} N, {moment:.4f} N m")
        return twist, 1 / (1 + margin)

    def wrench(self, twist: ArrayLike) -> Array:
        """Wrench (3,) of the pusher that moves the body at this twist."""
        vx, vy, omega = (float(part) for part in np.asarray(twist, dtype=np.float64))
        problem, work = self._laid_out[-1]
        n = problem.numbers
        height, balance = n[HEIGHT] + n[ABOVE], TIPS
        for share in _LOWER ** np.arange(60):
            # Steady sliding: what friction takes at the floor the pusher gives at its height.
            balance = solve_pressure(
                problem.soles, problem.regions, problem.sliding, (0.0, 0.0, 1.0, 0.0), (vx, vy, omega),
                share * height, (n[MASS] * n[GRAVITY_N], 0.0, 0.0), work,
            )  # fmt: skip
            if balance == BALANCED:
                break
        if balance != BALANCED:
            raise RefusedError("a push at this twist tips the body over", got=f"{[vx, vy, omega]}")
        return np.asarray(-work.matrices[W] @ work.pressure)


def _laid_out(patch: Patch, mass: float, height: float, sliding: Sliding) -> tuple[TowProblem, Work]:
    towed = TowedObject(patch, mass, np.zeros(2), 1.0, np.zeros(2), anchor_height=height)
    unused, drive = Tether(1.0, 1.0), spline_through(_UNIT)
    problem = tow_problem(towed, sliding, unused, Ground(), height, drive, (1.0, 1.0))
    return problem, work_for(problem.soles, problem.regions)
