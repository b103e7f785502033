"""What the fit of every friction law returns, and constants of laws made of hyperbolic tangents."""

import math
from dataclasses import dataclass

from towval.model import FrictionLaw

TANH_LINEAR = 1e-4  # tanh x = x to 4e-13 below
TANH_SATURATED = 20.0  # tanh x = 1 to rounding above
SATURATED = math.atanh(0.999)  # ASSUME: without a peak, μ has risen to 99.9 % at the stiction velocity


@dataclass(frozen=True)
class FittedLaw:
    """A friction law fitted to the coefficients and speeds that a lab states.

    ``law``; ``residual`` the largest relative misfit of the stated numbers [1].
    """

    law: FrictionLaw
    residual: float
