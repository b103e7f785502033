"""Makkar's friction law, and its fit to the four numbers that a lab measures.

ASSUME: μ peaks with the value μ_s at v_s, has come down to μ_k at v_k and stays there. That is three conditions and an
asymptote for five coefficients. The rest is settled as follows:

- "has come down at v_k" means that a hundredth of the rise μ_s − μ_k is left there (:data:`SETTLED_FRACTION`);
- Coulomb's part rises twice as steeply as Stribeck's, γ5 = 2 γ2 (:data:`RISE_RATIO`), so that it is saturated at
  v_s and the peak is that of Stribeck's part alone. This affects μ only below v_s, where it sets the creep at rest.
"""

import functools
import math
from dataclasses import astuple, dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionLaw, FrictionSpecification, check_friction_law, locked
from towval.model.checks import instance_of, numbers_of, positive
from towval.model.compiling import compiled
from towval.model.errors import InputError, RefusedError
from towval.physics.friction_laws.fitted import SATURATED, TANH_LINEAR, TANH_SATURATED, FittedLaw
from towval.physics.rosenbrock import inverse_3, product_3

SETTLED_FRACTION = 0.01
RISE_RATIO = 2.0

_RESIDUAL_LIMIT = 1e-3
_LOG_BOUNDS = ((-1.0, 3.0), (-2.0, 3.0), (-2.0, 3.0))  # of γ1 / (μ_s − μ_k), γ2 v_s, γ3 v_k
_LOG_BOUNDS_ARRAY = np.array(_LOG_BOUNDS)
_STARTS = ((0.3, 0.7, 1.03), (0.3, 1.2, 1.03))  # within these bounds: of middling and of small rises
_NEWTON_LIMIT, _ROOT = 30, 1e-13


@dataclass(frozen=True)
class Makkar(FrictionLaw):
    """Makkar's law, ``μ(v) = γ1 (tanh γ2 v − tanh γ3 v) + γ4 tanh γ5 v + γ6 v``.

    SOURCE: eq. (3). ``gamma1`` and ``gamma4`` [1] are the amplitudes of Stribeck's and Coulomb's part; ``gamma2``,
    ``gamma3``, ``gamma5`` their rates and ``gamma6`` the viscous term [s/m]. All are zero or more.

    Examples
    --------
    >>> law = Makkar(0.06, 400, 40, 0.35, 800, 0)
    >>> law.coefficient([0.0, 0.0052, 0.5]).round(4)
    array([0.    , 0.3957, 0.35  ])
    """

    name: ClassVar[str] = "makkar"
    gamma1: float
    gamma2: float
    gamma3: float
    gamma4: float
    gamma5: float
    gamma6: float

    def __post_init__(self) -> None:
        positive(self, *(field.name for field in fields(self)), zero=True)
        check_friction_law(self)

    @property
    def gamma(self) -> Array:
        """The six coefficients (6,)."""
        return np.array(astuple(self), dtype=np.float64)

    def coefficient(self, speed: ArrayLike) -> Array:
        """μ(v) [1]."""
        v = numbers_of(speed, "speed")
        stribeck = self.gamma1 * (np.tanh(self.gamma2 * v) - np.tanh(self.gamma3 * v))
        return stribeck + self.gamma4 * np.tanh(self.gamma5 * v) + self.gamma6 * v

    def slope(self, speed: ArrayLike) -> Array:
        """dμ/dv [s/m]."""
        v = numbers_of(speed, "speed")
        t2, t3, t5 = np.tanh(self.gamma2 * v), np.tanh(self.gamma3 * v), np.tanh(self.gamma5 * v)
        stribeck = self.gamma1 * (self.gamma2 * (1 - t2 * t2) - self.gamma3 * (1 - t3 * t3))
        return stribeck + self.gamma4 * self.gamma5 * (1 - t5 * t5) + self.gamma6

    @property
    def speed_range(self) -> tuple[float, float]:
        """From where every tanh is linear to where every tanh has saturated [m/s]."""
        terms = (self.gamma1, self.gamma2), (self.gamma1, self.gamma3), (self.gamma4, self.gamma5)
        rates = [rate for amplitude, rate in terms if amplitude > 0 and rate > 0] or [1.0]
        return TANH_LINEAR / max(rates), TANH_SATURATED / min(rates)

    @property
    def plateau(self) -> float:
        """γ4, and γ1 where its tanh terms do not cancel [1]."""
        return self.gamma1 * (float(self.gamma2 > 0) - float(self.gamma3 > 0)) + self.gamma4 * (self.gamma5 > 0)

    @property
    def viscous(self) -> float:
        """γ6 [s/m]."""
        return self.gamma6


def fit_specification(specification: FrictionSpecification) -> FittedLaw:
    """Makkar's law for the numbers of a specification; see :func:`fit_makkar`."""
    return fit_makkar(
        specification.static, specification.kinetic, specification.stiction_velocity, specification.friction_velocity
    )


def risen_law(static: float, kinetic: float, rise_velocity: float, friction_velocity: float) -> Makkar:
    """Makkar's law for an object that sticks by itself: μ has risen to μ_s at once and falls to μ_k at v_k.

    Both parts rise over ``rise_velocity`` [m/s], a number of the numerics: at rest the law plays no part. Of the
    rise μ_s − μ_k a hundredth is left at ``friction_velocity`` v_k [m/s]; v_s, where a regularised law peaks, has no
    place in it.

    Examples
    --------
    >>> risen_law(0.4, 0.35, 1e-5, 0.01).coefficient([1e-4, 0.01, 0.1]).round(4)
    array([0.3987, 0.3505, 0.35  ])
    """
    _check_numbers(static, kinetic, rise_velocity, friction_velocity, 0.0)
    _check_rise(static, kinetic)
    rise = static - kinetic
    falling = math.atanh(1 - SETTLED_FRACTION) / friction_velocity if rise > 0 else 0.0
    rising = 1 / rise_velocity
    return Makkar(rise, rising if rise > 0 else 0.0, falling, kinetic, rising, 0.0)


def fit_makkar(
    static: float,
    kinetic: float,
    stiction_velocity: float,
    friction_velocity: float,
    viscous: float = 0.0,
    seed: int = 0,
) -> FittedLaw:
    """Makkar's law for a static and a kinetic coefficient and the speeds that go with them.

    Newton's method finds the law in a millisecond from the one of a middling rise. Where it does not, as with v_s and
    v_k close together, dual annealing finds the basin (SOURCE: section 2.1) and least squares polish it. The same
    numbers give the same law: the search is seeded, and results are kept for the life of the process.

    Parameters
    ----------
    static, kinetic : float
        μ_s and μ_k [1], 0 < μ_k ≤ μ_s.
    stiction_velocity, friction_velocity : float
        v_s where μ peaks and v_k where it has come down to μ_k [m/s], 0 < v_s < v_k.
    viscous : float, optional
        γ6 [s/m]; μ_k then includes its share at v_k.
    seed : int, optional
        Seed of the annealing.

    Raises
    ------
    InputError
        When the four numbers contradict each other.
    RefusedError
        When no law of this form meets them, as with v_s and v_k too close together.

    Examples
    --------
    >>> fit = fit_makkar(0.396, 0.35, stiction_velocity=0.0052, friction_velocity=0.07)
    >>> fit.law.coefficient([0.0052, 0.07, 0.5]).round(4)
    array([0.396 , 0.3505, 0.35  ])
    """
    _check_specification(static, kinetic, stiction_velocity, friction_velocity, viscous)
    return _fit(float(static), float(kinetic), float(stiction_velocity), float(friction_velocity), float(viscous), seed)


def _check_specification(static: float, kinetic: float, v_s: float, v_k: float, viscous: float) -> None:
    _check_numbers(static, kinetic, v_s, v_k, viscous)
    _check_rise(static, kinetic)
    if v_s >= v_k:
        raise InputError(
            "the stiction velocity is not below the friction velocity",
            got=f"stiction {v_s} m/s, friction {v_k} m/s",
            allowed="stiction velocity below friction velocity",
        )
    if viscous * v_k >= kinetic:
        raise InputError(
            "viscous friction alone exceeds the kinetic coefficient at the friction velocity",
            got=f"{viscous} s/m × {v_k} m/s ≥ {kinetic}",
            allowed=f"viscous below {kinetic / v_k:.4g} s/m",
        )


def _check_numbers(static: float, kinetic: float, v_s: float, v_k: float, viscous: float) -> None:
    for value in (static, kinetic, v_s, v_k, viscous):
        instance_of(value, "a number of the specification of the friction law", float, int, np.number)
    values = locked([static, kinetic, v_s, v_k, viscous], "the specification of the friction law", (5,), finite=False)
    if not (np.isfinite(values).all() and (values[:4] > 0).all() and values[4] >= 0):
        raise InputError(
            "a number of the friction law is out of range",
            got=f"static {static}, kinetic {kinetic}, velocities {v_s} and {v_k} m/s, viscous {viscous} s/m",
            allowed="finite numbers above zero; viscous zero or more",
        )


def _check_rise(static: float, kinetic: float) -> None:
    if static < kinetic:
        raise InputError(
            "static friction is below kinetic friction",
            got=f"static {static} < kinetic {kinetic}",
            allowed="static equal to kinetic or above",
        )


@functools.lru_cache(maxsize=64)
def _fit(static: float, kinetic: float, v_s: float, v_k: float, viscous: float, seed: int) -> FittedLaw:
    coulomb, rise = kinetic - viscous * v_k, static - kinetic
    if rise == 0:
        return FittedLaw(Makkar(0.0, 0.0, 0.0, coulomb, SATURATED / v_s, viscous), 0.0)

    numbers = static, kinetic, v_s, v_k, viscous
    found = (root for start in _STARTS if np.isfinite(root := _newton(numbers, *start)).all())
    unknowns = next(found, None)
    if unknowns is None:
        unknowns = _annealed(numbers, seed)
    residual = float(np.abs(_misfits(numbers, *unknowns)[0]).max()) * rise / static
    gamma = _gamma(numbers, *unknowns)
    if residual > _RESIDUAL_LIMIT or gamma[1] <= gamma[2]:
        raise RefusedError(
            "no friction law of Makkar's form meets the four numbers",
            got=f"static {static}, kinetic {kinetic} at {v_s} and {v_k} m/s: relative misfit {residual:.1e}",
            allowed=f"a misfit up to {_RESIDUAL_LIMIT:.0e}",
            remedy="move the friction velocity further above the stiction velocity",
        )
    return FittedLaw(Makkar(*gamma), residual)


Numbers = tuple[float, float, float, float, float]
"""Static and kinetic coefficient, v_s, v_k and the viscous slope."""


@compiled()
def _gamma(numbers: Numbers, g1: float, g2: float, g3: float) -> tuple[float, float, float, float, float, float]:
    """The six coefficients, from logarithms of γ1, γ2 and γ3 in their units."""
    static, kinetic, v_s, v_k, viscous = numbers
    first, second = math.exp(g1) * (static - kinetic), math.exp(g2) / v_s
    return first, second, math.exp(g3) / v_k, kinetic - viscous * v_k, RISE_RATIO * second, viscous


@compiled()
def _misfits(numbers: Numbers, g1: float, g2: float, g3: float) -> tuple[Array, Array]:
    """Value and slope at the peak, value at v_k, all in units of the rise (3,); and their slopes by the unknowns."""
    static, kinetic, v_s, v_k, _ = numbers
    rise = static - kinetic
    values, slopes = np.empty(3), np.empty((3, 3))
    gamma = _gamma(numbers, g1, g2, g3)
    peak, slope = _at_speed(gamma, v_s, slopes[0], slopes[1])
    settled, _ = _at_speed(gamma, v_k, slopes[2], np.empty(3))
    slopes[1] *= v_s
    values[0], values[1], values[2] = peak - static, slope * v_s, settled - kinetic - SETTLED_FRACTION * rise
    return values / rise, slopes / rise


@compiled()
def _newton(numbers: Numbers, g1: float, g2: float, g3: float) -> Array:
    """The root (3,) of the misfits next to a start; NaN where Newton's steps do not get there."""
    unknowns, inverse = np.array([g1, g2, g3]), np.empty((3, 3))
    for _ in range(_NEWTON_LIMIT):
        residual, slopes = _misfits(numbers, unknowns[0], unknowns[1], unknowns[2])
        if np.abs(residual).max() < _ROOT:
            return unknowns
        if not inverse_3(slopes, inverse):
            break
        for i, step in enumerate(product_3(inverse, residual)):
            unknowns[i] -= min(max(step, -0.5), 0.5)
        low, high = _LOG_BOUNDS_ARRAY[:, 0], _LOG_BOUNDS_ARRAY[:, 1]
        if not ((unknowns >= low) & (unknowns <= high)).all():
            break
    return np.full(3, np.nan)


def _annealed(numbers: Numbers, seed: int) -> Array:
    """Where the squares of the misfits are least, by annealing and least squares."""
    # Here, because scipy.optimize takes as long to import as all the rest of the physics.
    from scipy.optimize import dual_annealing, least_squares  # noqa: PLC0415

    def residuals(x: Array) -> Array:
        return np.asarray(_misfits(numbers, *x)[0])

    found = dual_annealing(lambda x: float(np.sum(residuals(x) ** 2)), _LOG_BOUNDS, seed=seed, maxiter=100)
    polished = least_squares(residuals, found.x, lambda x: _misfits(numbers, *x)[1], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.asarray(polished.x)


@compiled()
def _at_speed(
    gamma: tuple[float, float, float, float, float, float], v: float, by_value: Array, by_slope: Array
) -> tuple[float, float]:
    """μ and dμ/dv at a speed; their slopes by the logarithms of γ1, of γ2 with γ5, and of γ3 into two arrays (3,)."""
    g1, g2, g3, g4, g5, g6 = gamma
    t2, t3, t5 = math.tanh(g2 * v), math.tanh(g3 * v), math.tanh(g5 * v)
    f2, f3, f5 = g1 * g2 * (1 - t2 * t2), g1 * g3 * (1 - t3 * t3), g4 * g5 * (1 - t5 * t5)
    by_value[0], by_value[1], by_value[2] = g1 * (t2 - t3), v * (f2 + f5), -v * f3
    by_slope[0] = f2 - f3
    by_slope[1] = f2 * (1 - 2 * g2 * v * t2) + f5 * (1 - 2 * g5 * v * t5)
    by_slope[2] = -f3 * (1 - 2 * g3 * v * t3)
    return g1 * (t2 - t3) + g4 * t5 + g6 * v, f2 - f3 + f5 + g6
