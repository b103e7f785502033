"""A scene laid out for the physics: what simulation, uncertainty and identification run alike."""

from numpy.typing import ArrayLike

from towval.model import SimulatedMotion, TimedPath, TowingScene
from towval.physics.contact import pressure_plane
from towval.physics.dynamics import Accuracy
from towval.physics.friction_laws import fitted_law
from towval.physics.ladder import simulate_rung
from towval.physics.mass import towed_object
from towval.physics.wrench import sliding_patch


class SceneModel:
    """The towed object of a scene under its weight, with the friction law that its numbers give.

    Attributes
    ----------
    towed : TowedObject
    law : FittedLaw
        With the misfit of the numbers that were stated.

    Raises
    ------
    InputError, RefusedError
        When the load's weight is outside the footprint, or no law has such numbers.
    """

    def __init__(self, scene: TowingScene):
        self.scene, self.towed, self.law = scene, towed_object(scene), fitted_law(scene.friction)
        resting = pressure_plane(self.towed.patch, [(scene.weight, self.towed.centre_of_mass)])
        self._patch = sliding_patch(resting, self.law.law)

    def motion(
        self, rung: str, hinge: TimedPath, start: ArrayLike, times: ArrayLike, tolerance_m: float
    ) -> SimulatedMotion:
        """Motion of the object by a rung of the ladder, as far as it goes.

        ``hinge`` is the path of the tether's hinge [m], ``start`` (3,) the object's pose at ``times[0]`` [s],
        ``tolerance_m`` of a step [m].
        """
        given = (self.towed, self._patch, self.scene.tether, hinge, start, times)
        return simulate_rung(rung, *given, accuracy=Accuracy(tolerance_m))
