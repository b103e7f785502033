"""Kinematics of a rover with steered wheels.

A planar twist ``(v_x, v_y, ω)`` is that of the rover's reference point, in the rover frame (i forward, j to the left).
It is also the instantaneous centre in homogeneous coordinates, ``Ω = (−v_y, v_x)/ω``, finite or not: straight motion is
no special case.

A wheel is at ``λ (cos α, sin α)``; its steering angle ``ρ = α + β − π/2`` is measured counter-clockwise from the i axis
to its rolling direction. SOURCE: section 2.4.1, equations (13) to (20).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array
from towval.model.checks import lock, locked, positive
from towval.model.errors import InputError

WHEEL_NAMES = ("front_left", "rear_left", "rear_right", "front_right")
"""Order of the wheels of a rover, counter-clockwise from the front left."""


@dataclass(frozen=True)
class Rover:
    """A rover with four steered wheels.

    ``wheel_positions`` (4, 2) [m] in the rover frame, ordered as :data:`WHEEL_NAMES`; ``steering_ranges`` (4, 2)
    smallest and largest steering angle of each wheel [rad], counter-clockwise positive, including straight ahead and
    less than half a turn wide; ``wheel_radius`` [m]; ``hinge`` (2,) [m] of the tether.
    """

    wheel_positions: Array
    steering_ranges: Array
    wheel_radius: float
    hinge: Array

    def __post_init__(self) -> None:
        lock(self, wheel_positions=(4, 2), steering_ranges=(4, 2), hinge=(2,))
        positive(self, "wheel_radius")
        least, greatest = self.steering_ranges.T
        if not ((least < 0) & (greatest > 0) & (greatest - least < np.pi)).all():
            raise InputError(
                "a steering range of the rover is invalid",
                got=f"{np.degrees(self.steering_ranges).tolist()} degrees",
                allowed="from below zero to above zero, less than 180 degrees wide",
            )
        if np.abs(self.axles[:, 1]).max() > 1e-9 or self.axles[0, 0] <= self.axles[1, 0]:
            raise InputError(
                "the wheels of the rover have no equivalent bicycle",
                got=self.wheel_positions.tolist(),
                allowed="midpoints of the front and of the rear pair on the i axis, front ahead of rear",
            )

    @property
    def axles(self) -> Array:
        """Front and rear wheel of the equivalent bicycle (2, 2) [m]: the midpoints of the two pairs."""
        front_left, rear_left, rear_right, front_right = self.wheel_positions
        return np.array([(front_left + front_right) / 2, (rear_left + rear_right) / 2])


def symmetric_rover(
    wheelbase: float, track: float, wheel_radius: float, *, outward: float, inward: float, hinge: ArrayLike = (0.0, 0.0)
) -> Rover:
    """A rover with its wheels at the corners of a rectangle and mirrored steering ranges.

    ASSUME: the paper gives one range, −33.7° to +93°, "with the negative angle directed toward the j axis", and a
    figure. Here the outer end of each wheel (the front of a front wheel, the rear of a rear wheel) turns by at most
    ``outward`` to the wheel's own side and by at most ``inward`` to the other: front and rear as well as left and right
    are mirror images. The rover can then turn on the spot, and the feasible centres form the two large triangles at the
    flanks and the smaller areas under the belly that the paper describes.

    ``wheelbase`` and ``track`` are the distances between the wheels' contact points, front to rear and left to right
    [m]; ``outward`` and ``inward`` the steering limits, above zero [rad], 33.7° and 93° in the paper; ``hinge`` (2,) is
    in the rover frame [m], whose origin is the centre of the rectangle.
    """
    sizes = locked((wheelbase, track), "wheelbase and track of the rover", (2,))
    if sizes.min() <= 0:
        raise InputError("the rover's wheelbase or track is out of range", got=(wheelbase, track), allowed="above zero")
    x, y = sizes / 2
    positions = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
    left_front, mirrored = (-inward, outward), (-outward, inward)
    return Rover(positions, np.array([left_front, mirrored, left_front, mirrored]), wheel_radius, np.asarray(hinge))


def polar(wheel_positions: ArrayLike) -> tuple[Array, Array]:
    """λ [m] and α [rad], each (...,), of wheels at given positions (..., 2) [m]."""
    x, y = np.moveaxis(np.asarray(wheel_positions, dtype=np.float64), -1, 0)
    return np.hypot(x, y), np.arctan2(y, x)


def rolling_matrix(wheel_positions: ArrayLike, steering: ArrayLike) -> Array:
    """J1 (..., n, 3): maps a twist to the rolling speeds of the wheels [m/s].

    For wheels (n, 2) [m] with steering angles ρ (..., n) [rad]. SOURCE: eq. (14), row
    ``[sin(α+β), −cos(α+β), −λ cos β]`` with ``β = ρ − α + π/2``.
    """
    distance, angle = polar(wheel_positions)
    beta = np.asarray(steering, dtype=np.float64) - angle + np.pi / 2
    return np.stack([np.sin(angle + beta), -np.cos(angle + beta), -distance * np.cos(beta)], axis=-1)


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
    rates: Array = np.einsum("...ij,...j->...i", rolling, np.asarray(twist, dtype=np.float64)) / rover.wheel_radius
    return rates
