"""Coulomb friction of loads at points: wrench from twist, and twist from wrench by the convex dissipation.

The power that friction takes, ``D(ξ) = μ Σ N_i |v_i(ξ)|``, is convex and of first degree, so the twist that belongs to
a wrench w (that of the pusher, balanced by friction) is

    ξ = argmax w·ξ / D(ξ) = argmin { D(ξ) : w·ξ = 1 },    max w·ξ / D(ξ) = the gauge of w: 1 on the limit surface.

SOURCE: Goyal, Ruina, Papadopoulos, "Planar sliding with dry friction 1", Wear 143 (1991). μ, the same at all points,
scales D only: no direction depends on it. Where the twist turns about a point, that point rests: its friction is any
force up to μN_i, the limit surface has a facet there, and one twist belongs to a whole set of wrenches. The twist from
a wrench stays unique, unless all points lie on one line; whether a point rests is an exact test on its force
(:func:`resting_point`).

Wrenches are those of the pusher on the body; lengths in m, forces in N.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.real.push_data import angle_deg, scaled_twist, scaled_wrench
from towval.model import Array
from towval.model.errors import RefusedError

_SMOOTHING = (1.0, 1e-4, 1e-8)  # of the speed: from a round bowl down to the kinks of D; the last is 1e-5° off at most
_STEP_LIMIT = 60
_FACET_TOLERANCE = 1e-12


def foot_loads(feet: ArrayLike, weight: float, force: ArrayLike, height: float) -> Array:
    """Loads of three feet (3,) [N] from the weight at the origin and a pusher's force at a height.

    Equilibrium: ``Σ N = W``, ``Σ N p = h F``, for friction bears −F at the floor. Where a foot would have to pull, the
    body starts to tip: the loads are then those at which that foot just lifts, its own zero, along the same force.
    """
    fx, fy = np.asarray(force, dtype=np.float64)[:2]
    balance = _equilibrium(feet)
    at_rest = np.linalg.solve(balance, (weight, 0.0, 0.0))
    return _until_lifting(at_rest, np.linalg.solve(balance, (weight, height * fx, height * fy)))


def loads_while_sliding(feet: ArrayLike, weight: float, twist: ArrayLike, height: float, friction: float) -> Array:
    """As :func:`foot_loads`, where the pusher's force is not known but what friction at this twist balances.

    Linear in the loads: ``F = μ Σ N_i v_i/|v_i|``.
    """
    balance = _equilibrium(feet)
    at_rest = np.linalg.solve(balance, (weight, 0.0, 0.0))
    balance[1:] -= height * friction * _directions(feet, twist).T
    return _until_lifting(at_rest, np.linalg.solve(balance, (weight, 0.0, 0.0)))


def pushing_wrench(points: ArrayLike, loads: ArrayLike, twist: ArrayLike) -> Array:
    """Wrench (3,) of the pusher that moves the body at this twist, for μ = 1; a point at rest gives nothing."""
    points, loads = np.asarray(points, dtype=np.float64), np.asarray(loads, dtype=np.float64)
    force = loads[:, None] * _directions(points, twist)
    moment = points[:, 0] @ force[:, 1] - points[:, 1] @ force[:, 0]
    return np.array([*force.sum(axis=0), moment])


def dissipation(points: ArrayLike, loads: ArrayLike, twist: ArrayLike) -> float:
    """D(ξ) [W] for μ = 1."""
    return float(np.asarray(loads) @ np.linalg.norm(_velocities(points, twist), axis=1))


def gauge(points: ArrayLike, loads: ArrayLike, wrench: ArrayLike) -> float:
    """The μ at which a wrench lies on the limit surface: max over ξ of w·ξ / D(ξ), [1]."""
    twist = sliding_twist(points, loads, wrench)
    return float(np.asarray(wrench) @ twist) / dissipation(points, loads, twist)


def sliding_twist(points: ArrayLike, loads: ArrayLike, wrench: ArrayLike) -> Array:
    """Direction of the twist (3,) that a pusher's wrench causes, w·ξ = 1 W.

    Turning about a point is tried exactly; else Newton with a line search on D, rounded off by less and less.

    Raises
    ------
    RefusedError
        For a wrench of zero.
    """
    points, loads = np.asarray(points, dtype=np.float64), np.asarray(loads, dtype=np.float64)
    wrench = np.asarray(wrench, dtype=np.float64)
    if not np.abs(wrench).max() > 0:
        raise RefusedError("a wrench of zero moves nothing", got=wrench.tolist())
    if len(points) <= 12:  # of a mesh no single cell can hold the body
        rests = resting_point(points, loads, wrench)
        if rests is not None:
            twist = _turning_about(points[rests])
            return np.asarray(twist / (wrench @ twist))
    size = float(np.sqrt((loads @ (points**2).sum(axis=1)) / loads.sum()))
    scale = np.array([1.0, 1.0, size])
    twist = _smooth_minimum(points / size, loads / loads.sum(), wrench / scale) / scale
    return np.asarray(twist / (wrench @ twist))


def resting_point(points: Array, loads: Array, wrench: Array) -> int | None:
    """The point that the body turns about under a wrench, or None where all slide.

    The others give the wrench W of sliding at ξ, the twist about point i. By power ``λ w·ξ = D(ξ)``; the force that i
    has to bear is the rest ``λ F − F_W``, and it can if that is at most N_i (μ = 1: both sides scale alike). The
    optimum is unique, and so is the point.
    """
    for i, point in enumerate(points):
        twist = _turning_about(point)
        power = float(wrench @ twist)
        if power == 0:
            continue
        twist *= np.sign(power)
        share = dissipation(points, loads, twist) / abs(power)
        rest = share * wrench[:2] - pushing_wrench(np.delete(points, i, 0), np.delete(loads, i), twist)[:2]
        if np.linalg.norm(rest) <= loads[i] * (1 + _FACET_TOLERANCE):
            return i
    return None


def facet_angle_deg(points: Array, loads: Array, wrench: Array, pivot: int) -> float:
    """Angle [deg] of a wrench to the set of those that turn the body about one of its points.

    The set is the cone of ``W + (f, p × f)``, ``|f| ≤ N_pivot``: W from the other points, both senses of rotation.
    Inside it the angle is zero (:func:`resting_point`), else the nearest is on its rim. Moments over 0.05 m.
    """
    if resting_point(points, loads, wrench) == pivot:
        return 0.0
    x, y = points[pivot]
    angle = np.linspace(0.0, 2 * np.pi, 1441)
    fx, fy = loads[pivot] * np.cos(angle), loads[pivot] * np.sin(angle)
    rim = np.column_stack([fx, fy, x * fy - y * fx])
    others = np.delete(points, pivot, 0), np.delete(loads, pivot)
    nearest = []
    for sense in (1.0, -1.0):
        set_rim = pushing_wrench(*others, sense * _turning_about(points[pivot])) + rim
        nearest.append(angle_deg(scaled_wrench(set_rim), scaled_wrench(wrench)).min())
    return float(np.min(nearest))


def wrench_spread_deg(points: Array, loads: Array, twist: Array, path_std_m: float) -> float:
    """How far the predicted wrench turns [deg, rms] when the twist is off by a path's deviation in any direction.

    From the model and stated deviations alone. Near a point its friction turns by about path_std / path, and the wrench
    is ill-posed: more precise measurement would be needed than stated. Moments over, turns by 0.05 m.
    """
    axes = np.vstack([np.eye(3), np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / np.sqrt(3)])
    predicted = scaled_wrench(pushing_wrench(points, loads, twist))
    steps = path_std_m * np.vstack([axes, -axes]) / scaled_twist(np.ones(3))
    turned = np.array([scaled_wrench(pushing_wrench(points, loads, twist + step)) for step in steps])
    return float(np.sqrt(np.mean(angle_deg(turned, predicted) ** 2)))


def slowest_path_m(points: ArrayLike, twist: ArrayLike) -> float:
    """Path of the point that moves least [m] over a push of that twist in unit time."""
    return float(np.linalg.norm(_velocities(points, twist), axis=1).min())


def _smooth_minimum(points: Array, loads: Array, wrench: Array) -> Array:
    """argmin of D(ξ) on w·ξ = 1, in lengths of the points' spread."""
    base = wrench / (wrench @ wrench)
    along = np.linalg.svd(wrench[None, :])[2][1:].T
    spin = np.column_stack([-points[:, 1], points[:, 0]])
    place = np.zeros(2)
    speed = float(np.linalg.norm(base))
    for part in _SMOOTHING:
        place = _newton(place, base, along, spin, loads, part * speed)
    return np.asarray(base + along @ place)


def _newton(place: Array, base: Array, along: Array, spin: Array, loads: Array, rounding: float) -> Array:
    def velocity(x: Array) -> Array:
        twist = base + along @ x
        return np.asarray(twist[:2] + twist[2] * spin)

    def value(x: Array) -> float:
        return float(loads @ np.sqrt((velocity(x) ** 2).sum(axis=1) + rounding**2))

    turn = along[None, :2, :] + along[2][None, None, :] * spin[:, :, None]  # (k, 2, 2): d v_i / d x
    now = value(place)
    for _ in range(_STEP_LIMIT):
        v = velocity(place)
        w = np.sqrt((v**2).sum(axis=1) + rounding**2)
        towards = np.einsum("kij,ki->kj", turn, v / w[:, None])
        slope = loads @ towards
        curvature = np.einsum("k,kij,kil->jl", loads / w, turn, turn) - towards.T @ (towards * (loads / w)[:, None])
        step = -np.linalg.lstsq(curvature, slope, rcond=1e-14)[0]
        gain = float(slope @ step)
        if not gain < -1e-15 * now:
            break
        size = 1.0
        while (new := value(place + size * step)) > now + 0.1 * size * gain and size > 1e-10:
            size /= 2
        if size <= 1e-10:
            break
        place, now = place + size * step, new
    return place


def _velocities(points: ArrayLike, twist: ArrayLike) -> Array:
    points, (vx, vy, omega) = np.asarray(points, dtype=np.float64), np.asarray(twist, dtype=np.float64)
    return np.column_stack([vx - omega * points[:, 1], vy + omega * points[:, 0]])


def _directions(points: ArrayLike, twist: ArrayLike) -> Array:
    velocities = _velocities(points, twist)
    speeds = np.linalg.norm(velocities, axis=1)[:, None]
    return np.asarray(np.divide(velocities, speeds, out=np.zeros_like(velocities), where=speeds > 0))


def _turning_about(point: Array) -> Array:
    return np.array([point[1], -point[0], 1.0])


def _equilibrium(feet: ArrayLike) -> Array:
    feet = np.asarray(feet, dtype=np.float64)
    return np.vstack([np.ones(len(feet)), feet.T])


def _until_lifting(at_rest: NDArray[np.floating], loads: NDArray[np.floating]) -> Array:
    """Loads (k,) between those at rest and the ones asked for, as far as none is below zero."""
    if at_rest.min() <= 0:
        raise RefusedError("the body does not rest on its feet", got=f"loads {np.round(at_rest, 3).tolist()} N")
    if loads.min() >= 0:
        return np.asarray(loads, dtype=np.float64)
    change = loads - at_rest
    part = float((at_rest[change < 0] / -change[change < 0]).min())
    return np.asarray(np.maximum(at_rest + part * change, 0.0), dtype=np.float64)
