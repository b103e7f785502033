"""Makkar's law of friction for the numbers that campaign.yaml states, by its definition alone.

μ(v) = γ1 (tanh γ2 v − tanh γ3 v) + γ4 tanh γ5 v peaks at v_s with μ_s, falls to μ_k, of whose rise to μ_s a hundredth
is left at v_k, and its last part rises twice as steeply as its first, γ5 = 2 γ2 (docs/physics.md).
"""

import numpy as np
from scipy.optimize import root

from towval.model import Array, FrictionSpecification

_LEFT, _STEEPER = 0.01, 2.0
_STARTS = tuple(np.log([rise, rising, 3.0]) for rise in (1.3, 1.1, 2.0, 4.0) for rising in (2.0, 1.0, 4.0))


def makkar_coefficients(specification: FrictionSpecification) -> Array:
    """The coefficients (6,) of the law that meets a specification whose static friction is above the kinetic one."""
    static, kinetic = specification.static, specification.kinetic
    peak_at, fallen_at = specification.stiction_velocity, specification.friction_velocity

    def gamma(logarithms: Array) -> Array:
        rise, rising, falling = np.exp(logarithms) * [static - kinetic, 1 / peak_at, 1 / fallen_at]
        return np.array([rise, rising, falling, kinetic, _STEEPER * rising, 0.0])

    def misfit(logarithms: Array) -> Array:
        g1, g2, g3, g4, g5, _ = gamma(logarithms)
        value = g1 * (np.tanh(g2 * peak_at) - np.tanh(g3 * peak_at)) + g4 * np.tanh(g5 * peak_at)
        parts = [(g1, g2), (-g1, g3), (g4, g5)]
        slope = sum(factor * rate / np.cosh(rate * peak_at) ** 2 for factor, rate in parts)
        left = g1 * (np.tanh(g2 * fallen_at) - np.tanh(g3 * fallen_at)) + g4 * np.tanh(g5 * fallen_at) - kinetic
        return np.array([value - static, slope * peak_at, left - _LEFT * (static - kinetic)]) / (static - kinetic)

    for start in _STARTS:
        found = root(misfit, start, tol=1e-13).x
        if np.abs(misfit(found)).max() < 1e-9:
            return gamma(found)
    raise ArithmeticError(f"no law of Makkar's form was found for {specification}")
