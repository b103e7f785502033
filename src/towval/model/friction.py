"""The interface of a friction law: μ and its slope over the sliding speed, and the speeds beyond which μ is linear."""

import functools
import math
from abc import ABC, abstractmethod
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from towval.model.checks import Array
from towval.model.errors import InputError

_TO_ROUNDING = 1e-6  # relative to μ there: how closely a law must meet its limits at both ends of its speed range


class FrictionLaw(ABC):
    """Friction coefficient as a function of the sliding speed, μ(v), the same at every point of a patch.

    A law is a frozen dataclass that derives from this class and is registered under its ``name`` in
    :data:`towval.physics.friction_laws.LAWS`. It must be hashable: fields are numbers and tuples, no arrays or lists,
    since its table is kept by the law. It is tabulated once (``physics.friction_table``), so its methods need not be
    fast. μ is zero at rest, positive for v > 0 and smooth: a law with a jump at rest has to be regularised.
    """

    name: ClassVar[str]

    @abstractmethod
    def coefficient(self, speed: ArrayLike) -> Array:
        """μ(v) [1] for sliding speeds (...) [m/s], zero or more."""

    @abstractmethod
    def slope(self, speed: ArrayLike) -> Array:
        """dμ/dv [s/m] for sliding speeds (...) [m/s], zero or more."""

    @property
    @abstractmethod
    def speed_range(self) -> tuple[float, float]:
        """Speeds [m/s] below which μ is linear and above which it is ``plateau + viscous v``, both to rounding."""

    @property
    @abstractmethod
    def plateau(self) -> float:
        """μ at high speed [1], without the viscous term."""

    @property
    def viscous(self) -> float:
        """Slope at high speed [s/m]; zero unless a law has a viscous term."""
        return 0.0

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters by name, for records."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]


def check_friction_law(law: FrictionLaw) -> None:
    """Refuse a law that the physics cannot compute with.

    Raises `InputError` when ``law`` is no friction law or its speed range unusable; when μ at a speed above zero or its
    slope at rest is not finite and positive; or when μ does not meet its stated limits at low and high speed.
    """
    if not isinstance(law, FrictionLaw):
        raise InputError("not a friction law", got=type(law).__name__, allowed="an instance of FrictionLaw")
    try:
        _check_values(law)
    except TypeError as error:
        # Tables are kept by the law they are of.
        what = f"the friction law {type(law).__name__} cannot be computed with"
        raise InputError(
            what, got=error, remedy="derive a frozen dataclass of numbers and tuples, no arrays"
        ) from error


@functools.lru_cache(maxsize=32)  # A law is checked where it is made and where it is tabulated, in each of many draws.
def _check_values(law: FrictionLaw) -> None:
    title = f"the friction law '{law.name}'"
    low, high = law.speed_range
    if not 0 < low < high < math.inf:
        raise InputError(f"{title} has an unusable speed range", got=f"{low} to {high} m/s", allowed="0 < low < high")
    speeds = np.geomspace(1e-3 * low, 1e3 * high, 1001)
    values = law.coefficient(speeds)
    unusable = ~(np.isfinite(values) & (values > 0))
    if unusable.any():
        raise InputError(
            f"{title} gives a friction coefficient that is out of range",
            got=f"μ = {values[unusable][0]} at {speeds[unusable][0]:.3g} m/s",
            allowed="finite and above zero at every speed above zero",
        )
    at_rest = float(law.slope(0.0))
    ends = np.abs(law.coefficient([low, high]) - [at_rest * low, law.plateau + law.viscous * high])
    if not (at_rest > 0 and (ends <= _TO_ROUNDING * law.coefficient([low, high])).all()):
        raise InputError(
            f"{title} does not reach its limits within its speed range",
            got=f"slope at rest {at_rest} s/m, plateau {law.plateau}, misfits {ends[0]:.2g} and {ends[1]:.2g}",
            allowed="linear at the lower speed, plateau plus viscous term at the higher",
            remedy="widen speed_range",
        )
