"""Ellipsoidal limit surfaces of pushed supports: one from statics, one fitted to pushes.

From statics: ``physics.limit_surface`` with the mean distance of the loads from the centre of pressure. Fitted: a
general ellipsoid ``wᵀ A w = 1`` in (fx, fy, m / 0.05 m); the twist is its normal, ``ξ ∝ A w``.
SOURCE: Howe and Cutkosky 1996; Zhou et al. 2016 (their convex quadratic).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from studies.comparators.limit_surface import limit_surface_wrench
from studies.real.push_data import angle_deg
from towval.model import Array
from towval.physics.friction_laws import Coulomb
from towval.physics.friction_table import friction_table
from towval.physics.limit_surface import LimitSurface


def point_limit_surface(points: ArrayLike, loads: ArrayLike) -> LimitSurface:
    """The ellipsoid with the points' own force in translation and their mean distance from the centre of pressure."""
    points, loads = np.asarray(points, dtype=np.float64), np.asarray(loads, dtype=np.float64)
    centre = loads @ points / loads.sum()
    radius = float(loads @ np.linalg.norm(points - centre, axis=1) / loads.sum())
    return LimitSurface(centre, float(loads.sum()), radius, _unit_table())


@cache
def _unit_table() -> Array:
    return friction_table(Coulomb(1.0, 1e-9))


def surface_twist(surface: LimitSurface, wrench: ArrayLike) -> Array:
    """Twist of the body frame's origin (3,), up to length, that a pusher's wrench about the origin causes."""
    fx, fy, moment = np.asarray(wrench, dtype=np.float64)
    x, y = surface.centre
    omega = (moment - x * fy + y * fx) / surface.radius**2
    return np.array([fx + omega * y, fy - omega * x, omega])


def surface_pushing_wrench(surface: LimitSurface, twist: ArrayLike) -> Array:
    """The pusher's wrench (3,) for μ = 1."""
    return -limit_surface_wrench(surface, twist)


def fitted_ellipsoid(given: ArrayLike, sought: ArrayLike, start: Array | None = None) -> Array:
    """Five parameters (5,) of the ellipsoid whose A turns given directions (n, 3) into the sought ones best.

    Least squares of the differences of unit vectors. Wrenches and twists, scaled, give A; exchanged, its inverse.
    """
    given, sought = _unit(np.asarray(given, dtype=np.float64)), _unit(np.asarray(sought, dtype=np.float64))

    def residuals(parameters: Array) -> Array:
        return np.asarray(_unit(given @ matrix(parameters)) - sought).ravel()

    fitted: Array = least_squares(residuals, np.zeros(5) if start is None else start).x
    return fitted


def matrix(parameters: ArrayLike) -> Array:
    """A (3, 3) = L Lᵀ of determinant one: logarithms of two of L's diagonal terms, then the three below it."""
    a, b, c, d, e = np.asarray(parameters, dtype=np.float64)
    lower = np.array([[np.exp(a), 0.0, 0.0], [c, np.exp(b), 0.0], [d, e, np.exp(-a - b)]])
    product: Array = lower @ lower.T
    return product


def leave_one_out(given: ArrayLike, sought: ArrayLike) -> Array:
    """Angles [deg] (n,) between predicted and sought directions, each predicted by a fit to the others."""
    given, sought = np.asarray(given, dtype=np.float64), np.asarray(sought, dtype=np.float64)
    start = fitted_ellipsoid(given, sought)
    angles = np.empty(len(given))
    for i in range(len(given)):
        kept = np.arange(len(given)) != i
        angles[i] = angle_deg(given[i] @ matrix(fitted_ellipsoid(given[kept], sought[kept], start)), sought[i])
    return angles


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
