"""A friction law from outside the package: an exponential Stribeck peak."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from towval.model import FrictionLaw
from towval.physics.friction_laws import LAWS, FittedLaw


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    """μ_k + (μ_s − μ_k) exp(−(v / v_s)²), regularised over v_s / 10."""

    name: ClassVar[str] = "stribeck"
    static: float
    kinetic: float
    stiction_velocity: float

    def coefficient(self, speed):
        """μ(v) [1]."""
        x = np.asarray(speed) / self.stiction_velocity
        return (self.kinetic + (self.static - self.kinetic) * np.exp(-x * x)) * np.tanh(10 * x)

    def slope(self, speed):
        """dμ/dv [s/m]."""
        x = np.asarray(speed) / self.stiction_velocity
        peak, rise = (self.static - self.kinetic) * np.exp(-x * x), np.tanh(10 * x)
        return (-2 * x * peak * rise + (self.kinetic + peak) * 10 * (1 - rise * rise)) / self.stiction_velocity

    @property
    def speed_range(self):
        """Linear below and constant above [m/s]."""
        return 1e-5 * self.stiction_velocity, 7 * self.stiction_velocity

    @property
    def plateau(self):
        """Kinetic coefficient [1]."""
        return self.kinetic


LAWS.register("stribeck", lambda s: FittedLaw(Stribeck(s.static, s.kinetic, s.stiction_velocity), residual=0.0))
