"""A tether with mass: the elastic catenary, in closed form, from slack to taut.

With H the horizontal pull, V the vertical one at the hinge and w the weight of a metre of unstretched tether, the
tension at a share s of it is T(s) = √(H² + (V − w l0 s)²). The spans are the gradient of a convex function,

    x = ∂U/∂H,   z = ∂U/∂V,   U(H, V) = ∫ (E(T) + T) l0 ds,   E' the strain,

so the two forces that reach a hinge are unique and Newton's method with a line search finds them. ``∫ T ds`` gives the
inextensible catenary; the stretch adds a constant share of the forces, and of a tether that stiffens a smooth function
of T, by Gauss nodes over the angle. Damping is that of the stretch e: the force ``c ė ∂e/∂x`` takes up energy, whatever
the shape.

SOURCE: Irvine, Cable Structures (MIT Press 1981), 1.4, the elastic catenary; Jayaraman and Knudson, "A curved element
for the analysis of cable structures", Computers & Structures 14 (1981) 325, its first guess. ASSUME: the tether hangs
free in a vertical plane and has no inertia of its own.
"""

from __future__ import annotations

import math

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.area_rules import gauss_rule
from towval.physics.spatial.problem import DAMPING, FULL_STRETCH, KAPPA, REST, RISE, STIFFENING, TETHER_WEIGHT

_FIVE, _TWO = gauss_rule(5), gauss_rule(2)
_PANEL, _NEARLY_STRAIGHT = 1.5, 0.02  # of the angle: five and two nodes serve 1e-9 of the stretch
_NEWTON_LIMIT, _SETTLED, _LEAST_SHARE = 80, 1e-15, 0.1
_NEAR = 0.5  # of the last pull: how much it may change for it to be the first guess
_APART = 1e-5  # of the rest length: distances whose stretch gives the second slope, of damping in the Jacobian alone

Forces = tuple[float, float, float, float, float, float]
"""Horizontal pull and vertical force upward on the object [N], their slopes by the horizontal distance [N/m]; slopes of
the stretch by distance and rise [1]."""


@compiled(allocates=False)
def _stretch_under(n: Array, tension: float) -> tuple[float, float]:
    """Stretch [m] of the whole tether under a tension all along, and its slope [m/N]; a stiffening one by its law."""
    soft = 1.0 - n[STIFFENING]
    root = math.sqrt(soft * soft + 4 * n[STIFFENING] * tension / (n[KAPPA] * n[FULL_STRETCH]))
    return 2 * tension / (n[KAPPA] * (soft + root)), 1.0 / (n[KAPPA] * root)


@compiled(allocates=False)
def _spans(n: Array, pull: float, upper: float) -> tuple[float, float, float, float, float, float, float]:
    """Spans x, z [m] under the forces H, V, their slopes x_H, x_V = z_H, z_V, and the stretch's by H and V [m/N]."""
    w, weight = n[TETHER_WEIGHT], n[TETHER_WEIGHT] * n[REST]
    a, b = upper / pull, (upper - weight) / pull
    ra, rb = math.sqrt(1 + a * a), math.sqrt(1 + b * b)
    apart = (weight / pull) * (a + b)
    # sinh of the difference of the angles' asinh, without cancellation where both have one sign.
    turn = apart / (a * rb + b * ra) if a * b > 0 else a * rb - b * ra
    angle = math.asinh(turn)
    soft = 1 / (n[KAPPA] * (1 - n[STIFFENING]))
    x, z = pull * (angle / w + soft), pull / w * apart / (ra + rb) + soft * (upper - weight / 2)
    x_h, z_v = (angle - turn / (ra * rb)) / w + soft, turn / (ra * rb * w) + soft
    x_v = -apart / ((ra + rb) * ra * rb * w)
    e_h, e_v = soft * pull / weight * angle, soft * pull / weight * apart / (ra + rb)
    if n[STIFFENING] > 0:  # What is stiffer than a slack tether, over the angle in which T is smooth however slack.
        low, panels = math.asinh(b), 1 + int(angle / _PANEL)
        shares, areas = _TWO if angle < _NEARLY_STRAIGHT else _FIVE
        for i in range(panels * len(shares)):
            panel, node = divmod(i, len(shares))
            raised = math.exp(low + angle * (panel + shares[node]) / panels)
            tension, here = 0.5 * pull * (raised + 1 / raised), 0.5 * pull * (raised - 1 / raised)
            area = areas[node] * angle / panels * tension / weight
            stretch, softness = _stretch_under(n, tension)
            cosine, sine = pull / tension, here / tension
            even, slope = area * (stretch / tension - soft), area * (softness - soft)
            more = slope - even
            x, z = x + even * pull, z + even * here
            x_h, x_v = x_h + even + more * cosine * cosine, x_v + more * cosine * sine
            z_v += even + more * sine * sine
            e_h, e_v = e_h + slope * cosine, e_v + slope * sine
    return x, z, x_h, x_v, z_v, e_h, e_v


@compiled(allocates=False)
def _first_guess(n: Array, distance: float) -> tuple[float, float]:
    """Forces of the inextensible catenary, or of a stretched parabola where that pulls less."""
    w, rest, rise = n[TETHER_WEIGHT], n[REST], n[RISE]
    chord = math.sqrt(distance * distance + rise * rise)
    cosine, stretch = distance / chord, chord - rest
    # T = κ (e + (w l0 cos)² l0 / 24 T²): between κ e and κ e + (κ …)^(1/3)
    taut = max(stretch, 0.0)
    bow = n[KAPPA] * (w * rest * cosine) ** 2 * rest / 24
    tension = n[KAPPA] * taut * (1 + n[STIFFENING] * (taut / n[FULL_STRETCH] - 1)) + bow ** (1 / 3)
    slack = (rest * rest - rise * rise) / (distance * distance) - 1
    if slack > 0:
        steep = min(math.sqrt(3 * slack), 2 + math.log1p(slack))
        if w * distance / (2 * steep) < tension * cosine:
            return w * distance / (2 * steep), w / 2 * (rest + rise / math.tanh(steep))
    return tension * cosine, w * rest / 2 + tension * rise / chord


@compiled(allocates=False)
def hanging_forces(n: Array, distance: float) -> Forces:
    """Forces of a tether with mass at the anchor, from the hinge's horizontal distance."""
    pull, upper = _first_guess(n, distance)
    return _forces_from(n, distance, pull, upper)


@compiled(allocates=False)
def following_forces(n: Array, distance: float, last: Array) -> Forces:
    """As :func:`hanging_forces`, starting from the forces at the distance before, which takes a third of the steps.

    ``last`` (5,), the distance before with its forces and slopes, is replaced; zeros before the first call. The forces
    are the same to the last digits.
    """
    apart = distance - last[0]
    if abs(apart * last[3]) < _NEAR * last[1]:
        found = _forces_from(
            n, distance, last[1] + apart * last[3], last[2] + apart * last[4] + n[TETHER_WEIGHT] * n[REST]
        )
    else:
        found = hanging_forces(n, distance)
    last[0], last[1], last[2], last[3], last[4] = distance, found[0], found[1], found[2], found[3]
    return found


@compiled(allocates=False)
def _forces_from(n: Array, distance: float, pull: float, upper: float) -> Forces:
    """Newton's method from two forces."""
    x, z, x_h, x_v, z_v, e_h, e_v = _spans(n, pull, upper)
    for _ in range(_NEWTON_LIMIT):
        off_x, off_z = x - distance, z - n[RISE]
        det = x_h * z_v - x_v * x_v
        step_h, step_v = (x_v * off_z - z_v * off_x) / det, (x_v * off_x - x_h * off_z) / det
        if abs(step_h) + abs(step_v) <= _SETTLED * (pull + abs(upper)):
            break
        if pull + step_h < _LEAST_SHARE * pull:
            short = (_LEAST_SHARE - 1) * pull / step_h
            step_h, step_v = short * step_h, short * step_v
        slope, moved = off_x * step_h + off_z * step_v, False
        for _ in range(40):
            x, z, x_h, x_v, z_v, e_h, e_v = _spans(n, pull + step_h, upper + step_v)
            if (x - distance) * step_h + (z - n[RISE]) * step_v <= -0.9 * slope:  # The function is convex along it.
                moved = True
                break
            step_h, step_v, slope = 0.5 * step_h, 0.5 * step_v, 0.5 * slope
        pull, upper = pull + step_h, upper + step_v
        if not moved or abs(step_h) + abs(step_v) <= 1e-9 * (pull + abs(upper)):
            break  # What is left is the square of that.
    det = x_h * z_v - x_v * x_v
    by_x_h, by_x_v, by_z_v = z_v / det, -x_v / det, x_h / det
    e_x, e_z = e_h * by_x_h + e_v * by_x_v, e_h * by_x_v + e_v * by_z_v
    return pull, upper - n[TETHER_WEIGHT] * n[REST], by_x_h, by_x_v, e_x, e_z


@compiled(allocates=False)
def reach_under(n: Array, pull: float) -> tuple[float, float]:
    """Distance of the hinge along the floor [m] under a horizontal pull [N], and the upward force on the object [N]."""
    rest, rise = n[REST], n[RISE]
    if not n[TETHER_WEIGHT] > 0:
        return _straight_reach(n, pull)
    weight = n[TETHER_WEIGHT] * rest
    upper = weight / 2 + pull * rise / rest
    x, z, _, _, z_v, _, _ = _spans(n, pull, upper)
    for _ in range(_NEWTON_LIMIT):
        step, off = (rise - z) / z_v, abs(z - rise)
        for _ in range(40):
            x, z, _, _, slope, _, _ = _spans(n, pull, upper + step)
            if abs(z - rise) <= off:
                break
            step *= 0.5
        upper, z_v = upper + step, slope
        if abs(step) <= 1e-9 * (pull + abs(upper)):
            break
    return x, upper - weight


@compiled(allocates=False)
def _straight_reach(n: Array, pull: float) -> tuple[float, float]:
    """The same without mass: the tension T whose share T √(1 − (rise/L)²) along the floor is the pull.

    That grows with T from the tension at which the tether is as long as the rise. Newton's method, kept between a
    tension that is too low and one that is too high.
    """
    rest, rise = n[REST], n[RISE]
    taut = max(abs(rise) - rest, 0.0)
    low = max(pull, n[KAPPA] * taut * (1 + n[STIFFENING] * (taut / n[FULL_STRETCH] - 1)))
    if not pull > 0:
        return math.sqrt(max(rest * rest - rise * rise, 0.0)), math.copysign(low, rise)
    high, tension, length = np.inf, low, rest
    for _ in range(_NEWTON_LIMIT):
        stretch, softness = _stretch_under(n, tension)
        length = rest + stretch
        sine = min(abs(rise) / length, 1.0)
        cosine = math.sqrt(1 - sine * sine)
        off = tension * cosine - pull
        low, high = (tension, high) if off < 0 else (low, tension)
        step = off / (cosine + tension * sine * sine / (length * cosine) * softness) if cosine > 0 else 0.0
        if abs(step) <= _SETTLED * tension and cosine > 0:
            break
        before, tension = tension, tension - step
        if not low < tension < high:
            tension = 2 * before if high == np.inf else 0.5 * (low + high)
    return length * pull / tension, tension * rise / length


@compiled(allocates=False)
def damped(n: Array, forces: Forces, rate: float) -> tuple[float, float]:
    """Horizontal and vertical force with the damping's share, which takes the pull to zero at most [N]."""
    pull, lift, _, _, e_x, e_z = forces
    damping = n[DAMPING] * e_x * rate
    if pull + damping * e_x < 0:
        damping = -pull / e_x
    return pull + damping * e_x, lift + damping * e_z


@compiled(allocates=False)
def hanging_pull(
    n: Array, distance: float, rate: float, last: Array
) -> tuple[float, float, float, float, float, float]:
    """The forces with damping, their slopes by the distance and by its rate; see ``rates.Pull``."""
    forces = following_forces(n, distance, last)
    _, _, h_d, v_d, e_x, e_z = forces
    pull, lift = damped(n, forces, rate)
    if not n[DAMPING] > 0:
        return pull, lift, h_d, v_d, 0.0, 0.0
    h_r, v_r = n[DAMPING] * e_x * e_x, n[DAMPING] * e_x * e_z
    if not pull > 0:  # The damping is as large as the pull allows.
        return pull, lift, 0.0, v_d, 0.0, 0.0
    apart = _APART * n[REST]
    upper = forces[1] + n[TETHER_WEIGHT] * n[REST]
    _, _, _, _, further_x, further_z = _forces_from(n, distance + apart, forces[0], upper)
    _, _, _, _, nearer_x, nearer_z = _forces_from(n, distance - apart, forces[0], upper)
    h_d += n[DAMPING] * rate * (further_x * further_x - nearer_x * nearer_x) / (2 * apart)
    v_d += n[DAMPING] * rate * (further_x * further_z - nearer_x * nearer_z) / (2 * apart)
    return pull, lift, h_d, v_d, h_r, v_r
