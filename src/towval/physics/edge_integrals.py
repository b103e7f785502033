"""Integrals along one edge of a sliding patch, by Gauss rules whose order is known in advance.

In ``t = |d| sinh q`` along an edge at distance d from the instantaneous centre of rotation C the integrands of
``wrench`` are analytic for |Im q| < π/2, whatever the law and wherever C lies. So a bound of the error follows from the
length of the edge in q and from what its integrand may reach; both are looked up for each edge, and an edge that adds
little is given few nodes.
"""

import math

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.friction_table import radial_means
from towval.physics.lanes import Lanes, lanes, multiply, multiply_add, unpacked

# Bound of an edge's error over μN and μN times the radius. The bound knows neither signs nor where the integrand is
# large: what comes out (tests, studies/tables/physics_must_reach.py) is some 1,000 times better.
_ERROR_BOUND = 1e-7
_MOST_PAIRS = 8  # of nodes on a panel of an edge
_CELLS, _LONGEST_ALPHA = 128, 0.6  # panel lengths that are distinguished
_LOWEST_ORDER, _ORDERS = -40, 64  # binary orders of what an edge's integrand may reach, over μN
# Of the edge's length: with C so close to its line, it adds nothing to the wrench. The derivatives are already wrong
# with C within some 1e-9 m of that line, beyond the ends of the edge, too: steps and roots settle by other means.
_NEGLIGIBLE = 1e-13


def _gauss_rules() -> tuple[Array, Array]:
    """Nodes above zero and weights of symmetric Gauss rules; row k holds 2 k nodes."""
    nodes, weights = np.zeros((_MOST_PAIRS + 1, _MOST_PAIRS)), np.zeros((_MOST_PAIRS + 1, _MOST_PAIRS))
    for pairs in range(1, _MOST_PAIRS + 1):
        x, w = np.polynomial.legendre.leggauss(2 * pairs)
        nodes[pairs, :pairs], weights[pairs, :pairs] = x[pairs:], w[pairs:]
    return nodes, weights


def _error_bounds() -> Array:
    """What a Gauss rule may err on a panel whose integrand is one: (panel lengths, rules of 0, 2, 4 ... nodes).

    On an ellipse about the panel that stays within the strip |Im q| < π/2 the integrand grows by the cube of exp(Re q)
    at most; the rule errs by that times 64/15 ρ^(−2n) / (1 − ρ^−2), and the best of the ellipses is taken. SOURCE:
    Trefethen, "Is Gauss quadrature better than Clenshaw-Curtis?", SIAM Review 50 (2008), theorem 4.5.
    """
    alpha = (np.arange(_CELLS) + 1.0)[:, None, None] / _CELLS * _LONGEST_ALPHA
    rho = 1 + 10 ** np.linspace(-1.5, 3, 45)[None, :, None]
    angle = np.exp(0.5j * np.pi * np.linspace(0, 1, 9))
    place = (rho * angle + 1 / (rho * angle)) / 2
    q = 4 * np.arctanh(alpha * place)
    stretch = np.abs(4 * alpha / (1 - (alpha * place) ** 2))
    grown = stretch * np.exp(3 * (q.real - 4 * np.arctanh(alpha)).clip(0))
    within = (q.imag < 0.9 * np.pi / 2).all(axis=-1) & (np.abs(alpha * place) < 0.99).all(axis=-1)
    grown = np.where(within, grown.max(axis=-1), np.inf)[..., None]
    nodes = 2 * np.arange(1, _MOST_PAIRS + 1)
    bounds = (64 / 15 * grown * rho ** (-2.0 * nodes) / (1 - rho**-2)).min(axis=1)
    return np.column_stack([8 * np.arctanh(alpha[:, 0, 0]), bounds])


def _pairs_by_order() -> tuple[NDArray[np.int64], Array]:
    """Pairs of nodes by (binary order of what the integrand may reach, length); longest panel by that order."""
    reached = 2.0 ** (np.arange(_ORDERS) + _LOWEST_ORDER + 1)
    allowed = np.maximum(_ERROR_BOUND / reached, 1e-15)[:, None, None]
    enough = _error_bounds()[None] <= allowed
    pairs = np.where(enough.any(axis=-1), enough.argmax(axis=-1), _MOST_PAIRS + 1)
    longest = (pairs <= _MOST_PAIRS).sum(axis=-1) / _CELLS * _LONGEST_ALPHA
    return pairs, longest


_NODES, _WEIGHTS = _gauss_rules()
_PAIRS, _LONGEST = _pairs_by_order()


@compiled(allocates=False, forceinline=True)
def prepared_edge(
    edge: Array, cx: float, cy: float, bound: tuple[float, float, float]
) -> tuple[float, float, float, int, int]:
    """How an edge is to be integrated: its signed distance from C, exp q, α, panels, pairs of nodes.

    ``edge`` (5,) holds start (x, y), unit tangent (x, y) and length, C is at (``cx``, ``cy``); ``bound``: |p_C| and the
    slope of the pressure, both over N, and one over the radius of the patch. A panel runs through
    ``q = q_middle + 4 artanh(α x)``, x from −1 to 1: almost linear, yet exp q is rational in x. exp q is given for the
    middle of the first panel. No pairs: the edge adds nothing.
    """
    tx, ty, length = edge[2], edge[3], edge[4]
    x, y = edge[0] - cx, edge[1] - cy
    start, distance = x * tx + y * ty, x * ty - y * tx
    end, d = start + length, abs(distance)
    if d < _NEGLIGIBLE * (abs(start) + length):
        return distance, 1.0, 0.0, 0, 0
    first, last = _exponential(start, d), _exponential(end, d)
    half = math.sqrt(last / first)
    middle, quarter = first * half, math.sqrt(half)
    alpha = (quarter - 1) / (quarter + 1)
    far = d + max(abs(start), abs(end))
    reached = d * far * (bound[0] + bound[1] * far) * (1 + far * bound[2])
    reached_order = (np.float64(reached).view(np.int64) >> 52) - np.int64(1023 + _LOWEST_ORDER)
    order = min(max(reached_order, np.int64(0)), np.int64(_ORDERS - 1))
    panels = 1
    if alpha >= _LONGEST[order]:
        span = 8 * math.atanh(alpha)
        panels = math.ceil(span / (8 * math.atanh(0.999 * _LONGEST[order])))
        alpha = math.tanh(span / (8 * panels))
        middle = first * math.exp(span / (2 * panels))
    pairs: int = _PAIRS[order, int(alpha * (_CELLS / _LONGEST_ALPHA))]
    return distance, middle, alpha, panels, pairs


@compiled(allocates=False, forceinline=True)
def edge_integrals(
    table: Array, prepared: tuple[float, float, float, int, int], plane: tuple[float, float, float], rate: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Integrals along a prepared edge, for the heading rate ``rate`` > 0.

    With p = p_C + ρ g·e from ``plane``, p_C and the slopes of p along the edge and away from C, they are: by dφ, (t/ρ,
    d/ρ, 1) times the radial integrals of μ p; the same of its derivative along the twist; by dt, (t/ρ, d/ρ) times μ p;
    and by dφ, (t/ρ, d/ρ) times G_1.

    In q all cosh q in denominators cancel: with s, c = sinh q, cosh q, ρ = |d| c, ρ g·e = |d| (along s + across) and,
    for instance, (t/ρ) G_1 dφ = d |d| m_1 s dq. What is left are moments ∫ m sʲ dq of μ, m_1, m_2 and m_3.
    """
    distance, pressure = prepared[0], plane[0]
    d = abs(distance)
    across, along = d * plane[2], d * plane[1]
    by_1, by_s, by_s2, by_s3 = edge_moments(table, prepared, rate * d)
    mu0, m1_d, m2_0, m3_0 = unpacked(by_1)
    mu1, m1_t, m2_1, m3_1 = unpacked(by_s)
    mu2, _, m2_2, m3_2 = unpacked(by_s2)
    mu3, _, _, m3_3 = unpacked(by_s3)
    near = pressure + across
    mu_d, mu_t, mu_m = near * mu0 + along * mu1, near * mu1 + along * mu2, near * (mu0 + mu2) + along * (mu1 + mu3)
    m2_d, m2_t, m2_m = across * m2_0 + along * m2_1, across * m2_1 + along * m2_2, m2_0 + m2_2
    m3_m = across * (m3_0 + m3_2) + along * (m3_1 + m3_3)
    # dφ has the sign of the distance, and so has d/ρ; dt = ρ dq has none.
    plain, signed = d * d, d * distance
    return (
        signed * (pressure * m1_t + m2_t),
        plain * (pressure * m1_d + m2_d),
        signed * d * (pressure * m2_m + m3_m),
        signed * (mu_t - 2 * pressure * m1_t - 3 * m2_t),
        plain * (mu_d - 2 * pressure * m1_d - 3 * m2_d),
        signed * d * (mu_m - 3 * pressure * m2_m - 4 * m3_m),
        d * mu_t,
        distance * mu_d,
        signed * m1_t,
        plain * m1_d,
    )


@compiled(allocates=False, forceinline=True)
def edge_moments(
    table: Array, prepared: tuple[float, float, float, int, int], nearest_speed: float
) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """∫ m sinhʲ q dq along a prepared edge, j from 0 to 3, lanes μ, m_1, m_2, m_3; ``nearest_speed`` is |ω d|."""
    _, middle, alpha, panels, pairs = prepared
    zero = lanes(0.0, 0.0, 0.0, 0.0)
    sums = (zero, zero, zero, zero)
    for panel in range(panels):
        if panel > 0:
            middle *= ((1 + alpha) / (1 - alpha)) ** 4
        inverse = 1 / middle
        for j in range(pairs):
            more, less = 1 + alpha * _NODES[pairs, j], 1 - alpha * _NODES[pairs, j]
            both = 1 / (more * less)
            weight = 4 * alpha * both * _WEIGHTS[pairs, j]
            grown, shrunk = more * more * both, less * less * both
            grown, shrunk = grown * grown, shrunk * shrunk
            sums = _add_node(table, nearest_speed, weight, middle * grown, inverse * shrunk, sums)
            sums = _add_node(table, nearest_speed, weight, middle * shrunk, inverse * grown, sums)
    return sums


@compiled(allocates=False, forceinline=True)
def _add_node(
    table: Array, nearest_speed: float, weight: float, e: float, inverse: float, sums: tuple[Lanes, Lanes, Lanes, Lanes]
) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """Add the node with exp(±q) to the moments."""
    c, s = 0.5 * (e + inverse), 0.5 * (e - inverse)
    means, sinh = radial_means(table, nearest_speed * c), lanes(s, s, s, s)
    by_1 = lanes(weight, weight, weight, weight)
    by_s = multiply(by_1, sinh)
    by_s2 = multiply(by_s, sinh)
    return (
        multiply_add(means, by_1, sums[0]),
        multiply_add(means, by_s, sums[1]),
        multiply_add(means, by_s2, sums[2]),
        multiply_add(means, multiply(by_s2, sinh), sums[3]),
    )


@compiled(allocates=False, inline="always")
def _exponential(t: float, d: float) -> float:
    """exp(asinh(t / d)) for d > 0, without cancellation."""
    rho = math.sqrt(t * t + d * d)
    return (t + rho) / d if t > 0 else d / (rho - t)
