"""The ellipsoidal limit surface: friction of a whole patch as one point with a turning radius.

SOURCE: Howe and Cutkosky, "Practical force-motion models for sliding manipulation", Int. J. Robotics Research 15
(1996): forces and moments that friction can bear form an ellipsoid ``(F/μN)² + (M/μNr)² = 1``, and the twist is
normal to it. As a function of the twist, with the moment about the centre of pressure and r the mean distance of
the pressure from there,

    F = −μ(s) N v / s,   M = −μ(s) N r² ω / s,   s = √(|v|² + r² ω²).

It is exact in pure translation and pure rotation; in between a uniform disk is up to 13 % off in F² + (M/μNr)², 10 %
with the centre of rotation on its rim.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, FrictionLaw, locked
from towval.model.compiling import compiled
from towval.physics.contact import PressurePlane
from towval.physics.friction_laws import Coulomb
from towval.physics.friction_table import coefficient_over_speed, friction_table
from towval.physics.wrench import friction_wrench, sliding_patch


class LimitSurface(NamedTuple):
    """``centre`` (2,) of pressure, body frame [m]; ``normal_force`` [N]; ``radius`` r [m]; ``law`` of friction."""

    centre: Array
    normal_force: float
    radius: float
    law: FrictionLaw


def limit_surface(contact: PressurePlane, law: FrictionLaw) -> LimitSurface:
    """The limit surface that has the patch's own force in translation and its own moment in rotation."""
    x, y = contact.centre
    # Unit Coulomb friction turning about the centre of pressure: its moment is N times the mean distance.
    spin = friction_wrench(sliding_patch(contact, Coulomb(1.0, 1e-9)), (y, -x, 1.0))
    moment = spin[2] - (x * spin[1] - y * spin[0])
    return LimitSurface(contact.centre, contact.normal_force, float(-moment / contact.normal_force), law)


def limit_surface_wrench(surface: LimitSurface, twist: ArrayLike) -> Array:
    """Friction force and moment about the body frame's origin (3,) [N, N, N m], body axes.

    Parameters
    ----------
    surface : LimitSurface
    twist : array_like (3,)
        Velocity of the body frame's origin and heading rate, body axes [m/s, m/s, rad/s].
    """
    vx, vy, omega = locked(twist, "twist", (3,))
    x, y = surface.centre
    numbers = np.array([surface.normal_force, surface.radius**2])
    fx, fy, moment = surface_wrench_at_centre(
        friction_table(surface.law), numbers, vx - omega * y, vy + omega * x, omega
    )
    return np.array([fx, fy, moment + x * fy - y * fx])


@compiled()
def surface_wrench_at_centre(
    table: Array, numbers: Array, vx: float, vy: float, omega: float
) -> tuple[float, float, float]:
    """Force [N] and moment [N m] about the centre of pressure, from N [N] and r² [m²] in ``numbers`` (2,)."""
    speed = math.sqrt(vx * vx + vy * vy + numbers[1] * omega * omega)
    pull = coefficient_over_speed(table, speed) * numbers[0]
    return -pull * vx, -pull * vy, -pull * numbers[1] * omega
