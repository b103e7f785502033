"""Kinematics of a rover with steered wheels: constraints, steering, instantaneous centre of rotation (ICR).

A planar twist ``(v_x, v_y, ω)`` is that of the rover's reference point, in the rover frame (i forward, j to the left).
It is also the ICR in homogeneous coordinates, ``Ω = (−v_y, v_x)/ω``, finite or not: driving straight is no exception.

A wheel stands at ``λ (cos α, sin α)``; its steering angle is ``ρ = α + β − π/2`` from the i axis to the direction in
which it rolls, counter-clockwise. SOURCE: section 2.4.1, equations (13) to (20).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, locked
from towval.model.errors import InputError
from towval.model.geometry import rotation, wrapped

WHEEL_NAMES = ("front_left", "rear_left", "rear_right", "front_right")
"""Order of the wheels of a rover, counter-clockwise from the front left."""

BICYCLE_NAMES = ("front", "rear")
"""Order of the wheels of the equivalent bicycle."""

PARALLEL_AXLES = 1e-12
"""Below this relative gap between two singular values, axles coincide and leave the twist open."""


@dataclass(frozen=True)
class Rover:
    """A rover with four steered wheels.

    ``wheel_positions`` (4, 2) [m] in the rover frame, ordered as :data:`WHEEL_NAMES`; ``steering_ranges`` (4, 2) least
    and greatest steering angle of each wheel [rad], counter-clockwise positive, holding straight ahead and narrower
    than half a turn; ``wheel_radius`` [m]; ``hinge`` (2,) [m] where the tether holds the rover.
    """

    wheel_positions: Array
    steering_ranges: Array
    wheel_radius: float
    hinge: Array

    def __post_init__(self) -> None:
        for name, shape in (("wheel_positions", (4, 2)), ("steering_ranges", (4, 2)), ("hinge", (2,))):
            object.__setattr__(self, name, locked(getattr(self, name), f"Rover.{name}", shape))
        least, greatest = self.steering_ranges.T
        if not ((least < 0) & (greatest > 0) & (greatest - least < np.pi)).all():
            raise InputError(
                "a steering range of the rover cannot be used",
                got=f"{np.degrees(self.steering_ranges).tolist()} degrees",
                allowed="from below zero to above zero, less than 180 degrees wide",
            )
        if not (np.isfinite(self.wheel_radius) and self.wheel_radius > 0):
            raise InputError("the rover's wheel radius is out of range", got=self.wheel_radius, allowed="above zero")
        if np.abs(self.axles[:, 1]).max() > 1e-9 or self.axles[0, 0] <= self.axles[1, 0]:
            raise InputError(
                "the wheels of the rover make no bicycle",
                got=self.wheel_positions.tolist(),
                allowed="the middles of the front and of the rear pair on the i axis, front ahead of rear",
            )

    @property
    def axles(self) -> Array:
        """Places of the two wheels of the equivalent bicycle (2, 2) [m]: the middles of the front and rear pair."""
        front_left, rear_left, rear_right, front_right = self.wheel_positions
        return np.array([(front_left + front_right) / 2, (rear_left + rear_right) / 2])


def symmetric_rover(
    wheelbase: float, track: float, wheel_radius: float, *, outward: float, inward: float, hinge: ArrayLike = (0.0, 0.0)
) -> Rover:
    """A rover with its wheels at the corners of a rectangle and steering ranges mirrored from wheel to wheel.

    ASSUME: the paper gives one range, −33.7° to +93°, "with the negative angle directed toward the j axis", and the
    figure that shows it is not in the text. Here each wheel turns its outer end (of a front wheel its front, of a rear
    wheel its rear) by at most ``outward`` to the side it stands on and by at most ``inward`` to the other: front and
    rear as well as left and right are mirror images. The rover can then turn on the spot, and the feasible centres form
    the two large triangles at the flanks and the smaller areas under the belly of which the paper speaks.

    Parameters
    ----------
    wheelbase, track : float
        Distances between the wheels' contact points, front to rear and left to right [m].
    wheel_radius : float
        Radius of the wheels [m].
    outward, inward : float
        Steering limits, both above zero [rad]; 33.7° and 93° in the paper.
    hinge : array_like (2,), optional
        Hinge of the tether in the rover frame [m], whose origin is the middle of the rectangle.
    """
    if min(wheelbase, track) <= 0:
        raise InputError("the rover has no wheelbase or no track", got=(wheelbase, track), allowed="above zero")
    x, y = wheelbase / 2, track / 2
    positions = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
    left_front, mirrored = (-inward, outward), (-outward, inward)
    return Rover(positions, np.array([left_front, mirrored, left_front, mirrored]), wheel_radius, np.asarray(hinge))


def polar(wheel_positions: ArrayLike) -> tuple[Array, Array]:
    """λ [m] and α [rad], each (...,), of wheels at given positions (..., 2) [m]."""
    x, y = np.moveaxis(np.asarray(wheel_positions, dtype=np.float64), -1, 0)
    return np.hypot(x, y), np.arctan2(y, x)


def rolling_matrix(wheel_positions: ArrayLike, steering: ArrayLike) -> Array:
    """J1: maps a twist to the speeds with which the wheels roll [m/s].

    SOURCE: eq. (14), row ``[sin(α+β), −cos(α+β), −λ cos β]`` with ``β = ρ − α + π/2``.

    Parameters
    ----------
    wheel_positions : array_like (n, 2)
        In the rover frame [m].
    steering : array_like (..., n)
        Steering angles ρ [rad].

    Returns
    -------
    ndarray (..., n, 3)
    """
    distance, angle = polar(wheel_positions)
    beta = np.asarray(steering, dtype=np.float64) - angle + np.pi / 2
    return np.stack([np.sin(angle + beta), -np.cos(angle + beta), -distance * np.cos(beta)], axis=-1)


def sliding_matrix(wheel_positions: ArrayLike, steering: ArrayLike) -> Array:
    """C1: maps a twist to the speeds with which the wheels slip sideways [m/s]; shapes as in J1.

    SOURCE: eq. (15), row ``[cos(α+β), sin(α+β), λ sin β]``.
    """
    distance, angle = polar(wheel_positions)
    beta = np.asarray(steering, dtype=np.float64) - angle + np.pi / 2
    return np.stack([np.cos(angle + beta), np.sin(angle + beta), distance * np.sin(beta)], axis=-1)


def wheel_velocities(wheel_positions: ArrayLike, twist: ArrayLike) -> Array:
    """Velocities of the wheels' contact points (..., n, 2) [m/s] under twists (..., 3) in the rover frame."""
    positions, twist = np.asarray(wheel_positions, dtype=np.float64), np.asarray(twist, dtype=np.float64)
    vx, vy, rate = (twist[..., k, None] for k in range(3))
    return np.stack([vx - rate * positions[:, 1], vy + rate * positions[:, 0]], axis=-1)


def steering_of_twist(wheel_positions: ArrayLike, twist: ArrayLike) -> Array:
    """Steering angles (..., n) in (−π, π] [rad] with which wheels roll forward under twists (..., 3)."""
    velocity = wheel_velocities(wheel_positions, twist)
    return np.arctan2(velocity[..., 1], velocity[..., 0])


def wheel_rates(rover: Rover, steering: ArrayLike, twist: ArrayLike) -> Array:
    """Spin of the wheels φ̇ (..., 4) [rad/s] that solves eq. (13), ``J1 ξ = J2 φ̇``, for twists ξ (..., 3)."""
    rolling = rolling_matrix(rover.wheel_positions, steering)
    return np.einsum("...ij,...j->...i", rolling, np.asarray(twist, dtype=np.float64)) / rover.wheel_radius


def constraint_residual(rover: Rover, steering: ArrayLike, rates: ArrayLike, twist: ArrayLike) -> Array:
    """What is left of eq. (13), relative to the speed: the larger of rolling and sliding residual (...,).

    The speed is the root mean square of the wheels' speeds; 0 is a motion without any slip.
    """
    twist, rates = np.asarray(twist, dtype=np.float64), np.asarray(rates, dtype=np.float64)
    rolling = np.einsum("...ij,...j->...i", rolling_matrix(rover.wheel_positions, steering), twist)
    sliding = np.einsum("...ij,...j->...i", sliding_matrix(rover.wheel_positions, steering), twist)
    slip = np.maximum(np.abs(rolling - rover.wheel_radius * rates).max(axis=-1), np.abs(sliding).max(axis=-1))
    speed = np.sqrt(np.mean(np.sum(wheel_velocities(rover.wheel_positions, twist) ** 2, axis=-1), axis=-1))
    return slip / speed


def twist_of_steering(wheel_positions: ArrayLike, steering: ArrayLike) -> tuple[Array, float]:
    """The motion that steered wheels allow: the null space of C1.

    SOURCE: equations (16) to (18).

    Parameters
    ----------
    wheel_positions : array_like (n, 2)
        Two wheels or more [m].
    steering : array_like (n,)
        Their steering angles ρ [rad].

    Returns
    -------
    twist : ndarray (3,)
        Of unit length as a vector, first wheel rolling forward: direction only, the speed is free.
    misalignment : float
        Sideways speed [m/s] left at the wheels for that twist; above rounding, the axles do not meet in one point and
        the wheels must slip.

    Raises
    ------
    InputError
        When all axles lie on one line, so that every centre on it is allowed.
    """
    sliding = sliding_matrix(wheel_positions, steering)
    _, singular, basis = np.linalg.svd(sliding)
    second = singular[1] if len(singular) > 1 else 0.0
    if second <= PARALLEL_AXLES * singular[0]:
        raise InputError(
            "the steering angles leave the motion open",
            got=np.degrees(np.asarray(steering)).round(3).tolist(),
            allowed="axles that meet in one point or are parallel without coinciding [degrees]",
        )
    twist = basis[-1]
    forward = rolling_matrix(wheel_positions, steering)[0] @ twist
    twist = -twist if forward < 0 else twist
    return twist, float(np.linalg.norm(sliding @ twist))


def instantaneous_centre(twist: ArrayLike) -> Array:
    """Centre ``Ω = (−v_y, v_x)/ω`` (..., 2) [m] in the frame of the twists (..., 3), not finite at ω = 0."""
    vx, vy, rate = np.moveaxis(np.asarray(twist, dtype=np.float64), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([-vy / rate, vx / rate], axis=-1)


def twist_about(centre: ArrayLike) -> Array:
    """Forward twist (..., 3) that turns about centres (..., 2) [m] of the rover frame, with 1 m/s at the origin.

    ``v_x > 0``, so the sense of rotation is the side on which the centre lies.
    """
    x, y = np.moveaxis(np.asarray(centre, dtype=np.float64), -1, 0)
    rate = np.where(y >= 0, 1.0, -1.0) / np.hypot(x, y)
    return np.stack([rate * y, -rate * x, rate], axis=-1)


def centre_between(start: ArrayLike, end: ArrayLike) -> tuple[Array, float]:
    """The centre about which one turn brings a pose to another.

    SOURCE: equations (19), (20): ``φ = ϑ1 − ϑ0``, ``Ω = (P0 + P1)/2 + cot(φ/2)/2 k × (P1 − P0)``.

    Parameters
    ----------
    start, end : array_like (3,)
        Poses [m, m, rad] in one frame.

    Returns
    -------
    centre : ndarray (2,)
        Ω in the same frame [m], infinite where the headings are equal.
    turn : float
        φ in (−π, π] [rad].
    """
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    turn = float(wrapped(end[2] - start[2]))
    chord = end[:2] - start[:2]
    across = np.array([-chord[1], chord[0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        return (start[:2] + end[:2]) / 2 + across / (2 * np.tan(turn / 2)), turn


def moved_by(pose: ArrayLike, twist: ArrayLike, duration: float) -> Array:
    """Pose (..., 3) after moving with constant twists (..., 3) of the body frame for a time [s]: an arc, exactly."""
    pose, twist = np.asarray(pose, dtype=np.float64), np.asarray(twist, dtype=np.float64)
    turn = twist[..., 2] * duration
    along = duration * np.sinc(turn / (2 * np.pi))  # the chord of the arc: 2 sin(φ/2)/ω, finite at ω = 0
    middle = rotation(pose[..., 2] + turn / 2)
    shift = np.einsum("...ij,...j->...i", middle, twist[..., :2]) * along[..., None]
    return np.concatenate([pose[..., :2] + shift, (pose[..., 2] + turn)[..., None]], axis=-1)
