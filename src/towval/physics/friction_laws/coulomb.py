"""Coulomb friction, regularised."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionLaw, FrictionSpecification, check_friction_law
from towval.model.checks import numbers_of, positive
from towval.physics.friction_laws.fitted import SATURATED, TANH_LINEAR, TANH_SATURATED, FittedLaw


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """Coulomb friction regularised as ``μ tanh(v / v_s)``, without a peak.

    ``kinetic`` μ [1] and ``stiction_velocity`` v_s [m/s], both above zero.

    Examples
    --------
    >>> Coulomb(0.35, 1e-3).coefficient([0.0, 1e-3, 0.1]).round(4)
    array([0.    , 0.2666, 0.35  ])
    """

    name: ClassVar[str] = "coulomb"
    kinetic: float
    stiction_velocity: float

    def __post_init__(self) -> None:
        positive(self, "kinetic", "stiction_velocity")
        check_friction_law(self)

    def coefficient(self, speed: ArrayLike) -> Array:
        """μ(v) [1]."""
        return self.kinetic * np.tanh(numbers_of(speed, "speed") / self.stiction_velocity)

    def slope(self, speed: ArrayLike) -> Array:
        """dμ/dv [s/m]."""
        rise = np.tanh(numbers_of(speed, "speed") / self.stiction_velocity)
        return self.kinetic / self.stiction_velocity * (1 - rise * rise)

    @property
    def speed_range(self) -> tuple[float, float]:
        """From where the tanh is linear to where it has saturated [m/s]."""
        return TANH_LINEAR * self.stiction_velocity, TANH_SATURATED * self.stiction_velocity

    @property
    def plateau(self) -> float:
        """The kinetic coefficient [1]."""
        return self.kinetic


def fit_coulomb(specification: FrictionSpecification) -> FittedLaw:
    """The Coulomb law with the kinetic coefficient, of which 99.9 % is reached at the stiction velocity.

    ``residual`` says how far the static coefficient is missed: the law has no peak.
    """
    law = Coulomb(specification.kinetic, specification.stiction_velocity / SATURATED)
    return FittedLaw(law, abs(specification.static - specification.kinetic) / specification.static)
