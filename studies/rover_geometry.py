"""Rover kinematics that the studies and tests need beside the planner: constraints, centres, the whole feasible region.

Equations of section 2.4.1 in the notation of ``towval.planning.kinematics``; the planner uses nothing of this, so that
it can be checked against it.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import rotation, wrapped
from towval.planning.feasible_region import Piece, feasible_piece
from towval.planning.kinematics import Rover, polar, rolling_matrix, wheel_velocities

PARALLEL_AXLES = 1e-12
"""Relative size of the second singular value below which the axles coincide and the twist is undetermined."""


def sliding_matrix(wheel_positions: ArrayLike, steering: ArrayLike) -> Array:
    """C1: maps a twist to the sideways speeds of the wheels [m/s]; shapes as in J1.

    SOURCE: eq. (15), row ``[cos(α+β), sin(α+β), λ sin β]``.
    """
    distance, angle = polar(wheel_positions)
    beta = np.asarray(steering, dtype=np.float64) - angle + np.pi / 2
    return np.stack([np.cos(angle + beta), np.sin(angle + beta), distance * np.sin(beta)], axis=-1)


def constraint_residual(rover: Rover, steering: ArrayLike, rates: ArrayLike, twist: ArrayLike) -> Array:
    """Residual (...,) of eq. (13), relative to the RMS of the wheels' speeds: the larger of rolling and sliding."""
    twist, rates = np.asarray(twist, dtype=np.float64), np.asarray(rates, dtype=np.float64)
    rolling = np.einsum("...ij,...j->...i", rolling_matrix(rover.wheel_positions, steering), twist)
    sliding = np.einsum("...ij,...j->...i", sliding_matrix(rover.wheel_positions, steering), twist)
    slip = np.maximum(np.abs(rolling - rover.wheel_radius * rates).max(axis=-1), np.abs(sliding).max(axis=-1))
    speed = np.sqrt(np.mean(np.sum(wheel_velocities(rover.wheel_positions, twist) ** 2, axis=-1), axis=-1))
    return slip / speed


def twist_of_steering(wheel_positions: ArrayLike, steering: ArrayLike) -> tuple[Array, float]:
    """The motion that the steering angles allow: the null space of C1.

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
        Unit vector, first wheel rolling forward; the speed is free.
    misalignment : float
        Residual sideways speed of the wheels [m/s]; above rounding, the axles do not meet in one point and the wheels
        must slip.

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
            "the steering angles do not determine the motion",
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
    """Forward twist (..., 3), v_x > 0, about centres (..., 2) [m] of the rover frame, with 1 m/s at the origin."""
    x, y = np.moveaxis(np.asarray(centre, dtype=np.float64), -1, 0)
    rate = np.where(y >= 0, 1.0, -1.0) / np.hypot(x, y)
    return np.stack([rate * y, -rate * x, rate], axis=-1)


def centre_between(start: ArrayLike, end: ArrayLike) -> tuple[Array, float]:
    """Centre of the rotation that takes one pose to another.

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


def feasible_pieces(rover: Rover, extent: float) -> tuple[Piece, ...]:
    """All pieces of the feasible region that reach into a square of half width ``extent`` [m] about the rover."""
    pieces = (feasible_piece(rover, sides) for sides in itertools.product((1, -1), repeat=4))
    return tuple(piece for piece in pieces if len(piece.polygon(extent)) >= 3)


def is_feasible(rover: Rover, centres: ArrayLike) -> NDArray[np.bool_]:
    """Whether every wheel can steer so that its axle passes through centres (..., 2) [m], (...,) bool."""
    centres = np.asarray(centres, dtype=np.float64)
    offset = centres[..., None, :] - rover.wheel_positions
    least, greatest = rover.steering_ranges.T
    above = offset[..., 0] * np.cos(least) + offset[..., 1] * np.sin(least)
    below = offset[..., 0] * np.cos(greatest) + offset[..., 1] * np.sin(greatest)
    left, right = (above <= 0) & (below >= 0), (above >= 0) & (below <= 0)
    inside: NDArray[np.bool_] = (left | right).all(axis=-1)
    return inside
