"""Radial integrals of a friction law, tabulated once and evaluated in nanoseconds.

The wrench of a turning patch needs, beside μ itself, the means of μ along a ray from the instantaneous centre,

    m_n(u) = ∫₀¹ μ(u x) xⁿ dx = H_n(u) / u^(n+1),   H_n(u) = ∫₀ᵘ μ(v) vⁿ dv,   n = 1, 2, 3.

They are bounded and analytic for u > 0, with the nearest singularities at a distance of u or more. So equal parts of a
binade serve every u alike: each of 16 parts holds polynomials of degree six (interpolated in Chebyshev's
points) for μ, m_1, m_2 and m_3, good to some 1e-13 for laws made of tanh. Below the table the law is linear to
rounding, above it has reached its plateau and closed forms hold; the viscous term is linear and added there.
"""

import functools
import math

import numpy as np

from towval.model import Array, FrictionLaw, check_friction_law
from towval.model.checks import instance_of
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.physics.lanes import Lanes, lanes, load_lanes, multiply_add

_PARTS_LOG2 = 4  # parts of a binade: 2⁴
_DEGREE = 6
_INTERPOLATION = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))  # Chebyshev's points of a part
_TO_POWERS = np.linalg.inv(np.vander(_INTERPOLATION, increasing=True))
_NODES = 8  # of a part
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(_NODES)
# What is known at Gauss' nodes, at a part's points and integrated up to these, by the polynomial through it.
_THROUGH_NODES = np.linalg.inv(np.polynomial.legendre.legvander(_GAUSS, _NODES - 1)).T
_AT_POINTS = _THROUGH_NODES @ np.polynomial.legendre.legvander(_INTERPOLATION, _NODES - 1).T
_TO_POINTS = np.stack(
    [
        np.polynomial.legendre.legint(row, lbnd=-1) @ np.polynomial.legendre.legvander(_INTERPOLATION, _NODES).T
        for row in _THROUGH_NODES
    ]
)
_MISFIT_LIMIT = 1e-8  # relative, of a tabulated law; a smooth one stays below 1e-11

# The table is one flat array, which compiled code passes on at no cost: a head, then the polynomials.
LOWEST, HIGHEST, SLOPE, VISCOUS, FIRST_PART, PLATEAU = 0, 1, 2, 3, 4, 5  # then c_1, c_2, c_3
_HEAD = 9

# Bits of a double: 52 of them are the fraction, of which the first _PARTS_LOG2 number the part.
_SHIFT = 52 - _PARTS_LOG2
_WITHIN = (1 << _SHIFT) - 1
_TO_LOCAL = 2.0 ** (1 - _SHIFT)
_TO_SLOPE = 2 * 1023 + _PARTS_LOG2 + 1


def friction_table(law: FrictionLaw) -> Array:
    """Tabulate a friction law: some milliseconds, once a law in a process.

    Returns a flat array. Head: lowest and highest speed covered [m/s], dμ/dv at rest [s/m], viscous slope [s/m], number
    of the first part, the plateau μ_∞ and c_n in ``m_n → μ_∞/(n+1) + c_n/u^(n+1)``. Then, for each part, each power of
    the local variable in [−1, 1] and each of μ, m_1, m_2, m_3, a coefficient.
    """
    instance_of(law, "friction law", FrictionLaw)
    return _tabulated(law)


@functools.lru_cache(maxsize=96)  # The search of a visible fault simulates 64 draws with each of its kinds.
def _tabulated(law: FrictionLaw) -> Array:
    check_friction_law(law)
    lowest, highest = law.speed_range
    slope, plateau, viscous = float(law.slope(0.0)), law.plateau, law.viscous
    binades = math.floor(math.log2(lowest)), math.ceil(math.log2(highest))
    parts = 2**_PARTS_LOG2
    exponents = np.arange(*binades)
    binade = np.asarray(2.0 ** exponents[:, None], dtype=np.float64)
    starts: Array = (binade * (1 + np.arange(parts) / parts)).ravel()
    widths: Array = (binade * np.full(parts, 1 / parts)).ravel()
    speed = starts[:, None] + widths[:, None] * (_GAUSS + 1) / 2
    values = law.coefficient(speed)  # Takes most of the time.
    first = values * speed * (widths[:, None] / 2)
    integrand = np.stack([first, first * speed, first * speed * speed])
    integrals = _integrals(slope, starts, integrand)
    coefficients = _local_polynomials(values, starts, widths, integrals[:, :-1, None] + integrand @ _TO_POINTS)
    _check_smoothness(law, starts + widths, coefficients[..., 0].sum(axis=1))
    highest = 2.0 ** binades[1]
    powers = np.arange(2, 5)
    constants = integrals[:, -1] - plateau * highest**powers / powers - viscous * highest ** (powers + 1) / (powers + 1)
    first_part = np.float64(starts[0]).view(np.int64) >> _SHIFT
    head = [starts[0], highest, slope, viscous, first_part, plateau, *constants]
    return np.concatenate([head, coefficients.ravel()])


def _check_smoothness(law: FrictionLaw, speed: Array, tabulated: Array) -> None:
    """Refuse a law whose coefficients at some speeds [m/s] are not the ``tabulated`` ones: it has kinks or jumps."""
    misfit = np.abs(tabulated / law.coefficient(speed) - 1)
    if misfit.max() > _MISFIT_LIMIT:
        raise InputError(
            f"the friction law '{law.name}' is not smooth enough to be tabulated",
            got=f"relative misfit {misfit.max():.1e} at {speed[misfit.argmax()]:.3g} m/s",
            allowed=f"up to {_MISFIT_LIMIT:.0e}",
            remedy="round off kinks and jumps, as with tanh",
        )


def _integrals(slope: float, starts: Array, integrand: Array) -> Array:
    """H_1, H_2, H_3 at the starts of the parts and at the end of the last (3, parts + 1), of values at Gauss' nodes."""
    powers = np.arange(3, 6)
    below = slope * starts[0] ** powers / powers
    return np.cumsum(np.concatenate([below[:, None], integrand @ _GAUSS_WEIGHTS], axis=1), axis=1)


def _local_polynomials(at_nodes: Array, starts: Array, widths: Array, integrals: Array) -> Array:
    """Monomial coefficients of μ, m_1, m_2, m_3 in each part's variable −1 … 1 (parts, degree + 1, 4).

    μ comes at Gauss' nodes (parts, nodes), the integrals at the points of the parts (3, parts, degree + 1).
    """
    speed = starts[:, None] + widths[:, None] * (_INTERPOLATION + 1) / 2
    square = speed * speed
    means = integrals / np.stack([square, square * speed, square * square])
    values = np.concatenate([(at_nodes @ _AT_POINTS)[None], means])
    coefficients: Array = np.moveaxis(values @ _TO_POWERS.T, 0, -1)
    return coefficients


@compiled(allocates=False, inline="always")
def _part(table: Array, speed: float) -> tuple[np.uint64, float]:
    """Where the part that holds a speed begins, and the local variable there, from the bits of the float."""
    bits = np.float64(speed).view(np.int64)
    # Unsigned, so that reading the table needs no wrap-around for negative indices.
    begin = np.uint64(((bits >> _SHIFT) - np.int64(table[FIRST_PART])) * (4 * (_DEGREE + 1)) + _HEAD)
    return begin, (bits & _WITHIN) * _TO_LOCAL - 1.0


@compiled(allocates=False, forceinline=True)
def radial_means(table: Array, speed: float) -> Lanes:
    """μ, m_1, m_2, m_3 at a speed u ≥ 0 [m/s], as lanes."""
    means: Lanes
    if not speed >= table[LOWEST]:
        linear = table[SLOPE] * speed
        means = lanes(linear, linear / 3, linear / 4, linear / 5)
        return means
    if speed >= table[HIGHEST]:
        inverse = 1 / speed
        square = inverse * inverse
        viscous = table[VISCOUS] * speed
        means = lanes(
            table[PLATEAU] + viscous,
            table[PLATEAU] / 2 + table[PLATEAU + 1] * square + viscous / 3,
            table[PLATEAU] / 3 + table[PLATEAU + 2] * square * inverse + viscous / 4,
            table[PLATEAU] / 4 + table[PLATEAU + 3] * square * square + viscous / 5,
        )
        return means
    begin, x = _part(table, speed)
    local = lanes(x, x, x, x)
    means = load_lanes(table, begin + np.uint64(4 * _DEGREE))
    for power in range(_DEGREE - 1, -1, -1):
        means = multiply_add(means, local, load_lanes(table, begin + np.uint64(4 * power)))
    return means


@compiled(allocates=False, forceinline=True)
def coefficient_over_speed(table: Array, speed: float) -> float:
    """μ / v [s/m] at a sliding speed [m/s]; the slope at rest where v is zero."""
    if not speed >= table[LOWEST]:
        at_rest: float = table[SLOPE]
        return at_rest
    if speed >= table[HIGHEST]:
        above: float = table[PLATEAU] / speed + table[VISCOUS]
        return above
    begin, x = _part(table, speed)
    value: float = table[begin + np.uint64(4 * _DEGREE)]
    for power in range(_DEGREE - 1, -1, -1):
        value = value * x + table[begin + np.uint64(4 * power)]
    return value / speed


@compiled(allocates=False, inline="always")
def ratio_and_slope(table: Array, speed: float, inverse: float) -> tuple[float, float]:
    """μ / v and dμ/dv [s/m] at a sliding speed [m/s] and one over it; both the slope at rest where v is zero."""
    if not speed >= table[LOWEST]:
        return table[SLOPE], table[SLOPE]
    if speed >= table[HIGHEST]:
        return table[PLATEAU] * inverse + table[VISCOUS], table[VISCOUS]
    begin, x = _part(table, speed)
    value, slope = table[begin + np.uint64(4 * _DEGREE)], 0.0
    for power in range(_DEGREE - 1, -1, -1):
        slope = slope * x + value
        value = value * x + table[begin + np.uint64(4 * power)]
    # The local variable runs through 2 over a part. 2 over the width of the part is a power of two, whose exponent
    # (biased, as that of the speed) is made of bits instead of dividing.
    steepness = np.int64((_TO_SLOPE - (np.float64(speed).view(np.int64) >> 52)) << 52).view(np.float64)
    return value * inverse, slope * steepness
