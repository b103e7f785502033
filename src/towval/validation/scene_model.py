"""A scene prepared for the physics, in the same way for simulation, uncertainty and identification."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionSpecification, SimulatedMotion, Sliding, TowingScene
from towval.physics.dynamics import Accuracy, feedback
from towval.physics.friction_laws import Coulomb, FittedLaw, Makkar, fitted_law, risen_law
from towval.physics.ladder import simulate_rung
from towval.physics.mass import towed_object
from towval.physics.spatial.tow import Sticking, is_planar
from towval.physics.splines import Spline, spline_values
from towval.physics.tether import nearest_rest

RISE_SHARE = 1e-4
"""Speed over which the law of an object that sticks rises, as a share of v_k [1]; the peak is at a few of it."""

_HOLD = 2.0
"""Speed below which friction may hold the object, as a multiple of the speed of this rise."""


class SceneModel:
    """The object of a scene under its weight, ``towed``, with the friction ``law`` that the scene's numbers give.

    ``sticking``: whether an object below the friction limit stays at rest, and the law of sliding begins at its peak;
    else the law applies at every speed, and below the limit the object creeps.

    Raises `InputError` or `RefusedError` when the load's weight is outside the footprint, or no law has such numbers.
    """

    def __init__(self, scene: TowingScene, *, sticking: bool = False):
        self.scene, self.sticking, self.towed = scene, sticking, towed_object(scene)
        self.law = risen_friction(scene.friction) if sticking else fitted_law(scene.friction)

    @property
    def planar(self) -> bool:
        """Whether the scene has no effect that the rungs below the dynamics leave out."""
        scene = self.scene
        return is_planar(self.towed, self._sliding(), scene.tether, scene.ground, scene.hinge_height, self._hold())

    def motion(
        self,
        rung: str,
        hinge: Spline,
        start: ArrayLike,
        times: ArrayLike,
        tolerance_m: float,
        start_twist: ArrayLike | None = None,
    ) -> SimulatedMotion:
        """Motion of the object by a rung of the ladder, from rest, as far as it goes.

        ``hinge`` is the path of the tether's hinge [m], ``start`` (3,) the object's pose at ``times[0]`` [s] as
        measured, from which the motion begins as near as the object can rest (:meth:`resting`); ``tolerance_m`` of a
        step [m]. Rungs below the dynamics use the planar model only. The dynamics may begin with a ``start_twist``
        (3,) of the body frame [m/s, m/s, rad/s].
        """
        scene, times = self.scene, np.asarray(times, dtype=np.float64)
        start = self.resting(spline_values(hinge, times[:1])[0][0], start)
        given = self.towed, self._sliding(), scene.tether, hinge, start, times
        whole: dict[str, Any] = {
            "accuracy": Accuracy(tolerance_m), "ground": scene.ground, "hinge_height": scene.hinge_height,
            "sticking": self._hold(),
        }  # fmt: skip
        if start_twist is not None:
            return feedback(*given, start_twist=start_twist, **whole)
        return simulate_rung(rung, *given, **whole)

    def resting(self, hinge: Array, pose: ArrayLike) -> Array:
        """As :func:`towval.physics.tether.nearest_rest` in this scene."""
        scene = self.scene
        return nearest_rest(self.towed, scene.friction, scene.tether, scene.ground, scene.hinge_height, hinge, pose)

    def _sliding(self) -> Sliding:
        friction = self.scene.friction
        return Sliding(self.law.law, friction.across_over_along, friction.radius_over_planar)

    def _hold(self) -> Sticking | None:
        return hold_at_rest(self.scene.friction) if self.sticking else None


def hold_at_rest(friction: FrictionSpecification) -> Sticking:
    """What holds an object that sticks, sliding by :func:`risen_friction`."""
    return Sticking(_held(friction), _HOLD * RISE_SHARE * friction.friction_velocity)


def _held(friction: FrictionSpecification) -> float:
    """The coefficient that holds an object at rest: Coulomb's law knows the kinetic one only."""
    return friction.kinetic if friction.law == Coulomb.name else friction.static


def risen_friction(friction: FrictionSpecification) -> FittedLaw:
    """The law of sliding of an object that sticks, of Makkar's form; ``residual``: how far it misses the stated law.

    That is the law that campaign.yaml names, from the stiction velocity on; Makkar's own is met by its numbers.
    """
    rise, settled = RISE_SHARE * friction.friction_velocity, friction.friction_velocity
    law = risen_law(_held(friction), friction.kinetic, rise, settled)
    if friction.law == Makkar.name:
        return FittedLaw(law, 0.0)
    stated, speeds = fitted_law(friction), np.geomspace(friction.stiction_velocity, 10 * settled, 100)
    if friction.law == Coulomb.name:
        return FittedLaw(law, stated.residual)
    misfit = np.abs(law.coefficient(speeds) / stated.law.coefficient(speeds) - 1).max()
    return FittedLaw(law, max(stated.residual, float(misfit)))
