"""The wrench of the ellipsoidal limit surface, which the package uses inside the trailing rungs alone."""

import math

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, locked
from towval.model.compiling import compiled
from towval.physics.friction_table import coefficient_over_speed
from towval.physics.limit_surface import LimitSurface


def limit_surface_wrench(surface: LimitSurface, twist: ArrayLike) -> Array:
    """Friction force and moment about the body frame's origin (3,) [N, N, N m], body axes.

    ``twist`` (3,): velocity of the body frame's origin and heading rate, body axes [m/s, m/s, rad/s].

    Examples
    --------
    >>> from towval.physics.limit_surface import limit_surface
    >>> from towval.physics import Coulomb, Patch, TowedObject, resting_pressure, sliding_patch
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> patch = sliding_patch(resting_pressure(towed), Coulomb(0.35, 1e-3))
    >>> limit_surface_wrench(limit_surface(patch), (0.1, 0.0, 0.0)).round(2) + 0.0
    array([-17.17,   0.  ,   0.  ])
    """
    vx, vy, omega = locked(twist, "twist", (3,))
    x, y = surface.centre
    numbers = np.array([surface.normal_force, surface.radius**2])
    fx, fy, moment = surface_wrench_at_centre(surface.table, numbers, vx - omega * y, vy + omega * x, omega)
    return np.array([fx, fy, moment + x * fy - y * fx])


@compiled()
def surface_wrench_at_centre(
    table: Array, numbers: Array, vx: float, vy: float, omega: float
) -> tuple[float, float, float]:
    """Force [N] and moment [N m] about the centre of pressure, from N [N] and r² [m²] in ``numbers`` (2,)."""
    speed = math.sqrt(vx * vx + vy * vy + numbers[1] * omega * omega)
    pull = coefficient_over_speed(table, speed) * numbers[0]
    return -pull * vx, -pull * vy, -pull * numbers[1] * omega
