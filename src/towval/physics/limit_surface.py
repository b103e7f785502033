"""The ellipsoidal limit surface: friction of a whole patch as one point with a turning radius.

SOURCE: Howe and Cutkosky, "Practical force-motion models for sliding manipulation", Int. J. Robotics Research 15
(1996): forces and moments that friction can bear form an ellipsoid ``(F/μN)² + (M/μNr)² = 1``, and the twist is
normal to it. As a function of the twist, with the moment about the centre of pressure and r the mean distance of
the pressure from there,

    F = −μ(s) N v / s,   M = −μ(s) N r² ω / s,   s = √(|v|² + r² ω²).

It is exact in pure translation and pure rotation; in between a uniform disk is up to 13 % off in F² + (M/μNr)², 10 %
with the centre of rotation on its rim.
"""

from typing import NamedTuple

from towval.model import Array
from towval.model.checks import instance_of
from towval.physics.friction_laws.coulomb import Coulomb
from towval.physics.friction_table import friction_table
from towval.physics.wrench import SlidingPatch, wrench_at_origin

_UNIT_FRICTION = Coulomb(1.0, 1e-9)


class LimitSurface(NamedTuple):
    """The limit surface of a patch.

    ``centre`` (2,) of pressure, body frame [m]; ``normal_force`` N [N]; ``radius`` r [m]; ``table`` of the law.
    """

    centre: Array
    normal_force: float
    radius: float
    table: Array


def limit_surface(patch: SlidingPatch) -> LimitSurface:
    """The limit surface that has the patch's own force in translation and its own moment in rotation.

    Raises `InputError` when ``patch`` is no sliding patch.

    Examples
    --------
    >>> from towval.model import Patch
    >>> from towval.physics.contact import pressure_plane
    >>> from towval.physics.friction_laws.coulomb import Coulomb
    >>> from towval.physics.wrench import sliding_patch
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> patch = sliding_patch(pressure_plane(square, [(50.0, (0.0, 0.0))]), Coulomb(0.35, 1e-3))
    >>> round(limit_surface(patch).radius, 4)  # mean distance from the middle of a square of 0.4 m
    0.153
    """
    instance_of(patch, "patch", SlidingPatch)
    # Unit Coulomb friction, turning about the centre of pressure: its moment is N times the mean distance.
    _, _, moment = wrench_at_origin(patch._replace(table=friction_table(_UNIT_FRICTION)), 0.0, 0.0, 1.0)
    return LimitSurface(patch.origin, 1 / patch.per_force, -moment * patch.per_force, patch.table)
