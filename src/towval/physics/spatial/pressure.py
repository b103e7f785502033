"""The pressure plane under moving soles, solved together with the friction that it causes.

With basis pressures 1, X, Y about G, ``x`` the pressure at G and its slopes, A their moments over the region in contact
and W their friction wrench, balance of force and moments at the height of the centre of mass h_G reads

    (A + C W) x = b,   C = [[0, 0, 0], [h_G, 0, 0], [0, h_G, 0]],

b the loads without friction. Linear while the region stays. A region that the plane itself cuts off is found by
Newton's method for a given W, in which only the moments A are recomputed; then W on that region, and so on. The
pressure is zero where the region ends, so friction misses what a shift of the pressure moves by that to second order:
``Work.friction_error`` says how much of it may be missed.
"""

from __future__ import annotations

import math

from towval.model import Array
from towval.model.compiling import compiled
from towval.physics.contact import clipped_moments
from towval.physics.rosenbrock import inverse_3, product_3
from towval.physics.spatial.contact_parts import Frame, contact_parts
from towval.physics.spatial.soles import (
    ANY_CUT,
    MOMENTS,
    PER_AREA,
    PLAIN,
    RADIUS,
    STRETCH,
    Regions,
    Soles,
    Work,
    all_parts,
)
from towval.physics.spatial.unit_wrenches import EQUILIBRIUM, S, W, unit_wrenches

BALANCED, TIPS, LIFTED = 0, 1, 2
"""A pressure balances the loads; none does and the object tips over; nothing presses it to the floor."""

LEAST_CONTACT = 1e-3
"""Share of the footprint in contact below which an object is said to tip: Newton takes ever more steps towards zero."""

_STEP_LIMIT, _RESIDUAL, _ACCEPTED = 100, 1e-13, 1e-10  # the latter two over the load
_LARGEST_SHIFT, _LEFT = 1e-3, 0.01  # of the mean pressure; of the error of friction that is allowed
_PASSES = 60
_LOST = 0.1 * LEAST_CONTACT
Loads = tuple[float, float, float]
Twist = tuple[float, float, float]


@compiled(allocates=False)
def area_matrix(moments: Array, matrix: Array) -> None:
    """Fill A (3, 3) from the six moments of an area."""
    matrix[0, 0], matrix[0, 1], matrix[0, 2] = moments[0], moments[1], moments[2]
    matrix[1, 0], matrix[1, 1], matrix[1, 2] = moments[1], moments[3], moments[4]
    matrix[2, 0], matrix[2, 1], matrix[2, 2] = moments[2], moments[4], moments[5]


@compiled(allocates=False, forceinline=True)
def _equilibrium(height: float, work: Work) -> bool:
    """A + C W and its inverse; False where it is singular."""
    matrix, wrench = work.matrices[EQUILIBRIUM], work.matrices[W]
    area_matrix(work.moments, matrix)
    for j in range(3):
        matrix[1, j] += height * wrench[0, j]
        matrix[2, j] += height * wrench[1, j]
    return inverse_3(matrix, work.matrices[S])


@compiled(allocates=False)
def _residual(work: Work, b: Loads, radius: float) -> float:
    force, about_y, about_x = product_3(work.matrices[EQUILIBRIUM], work.pressure)
    force, about_y, about_x = force - b[0], (about_y - b[1]) / radius, (about_x - b[2]) / radius
    return math.sqrt(force * force + about_y * about_y + about_x * about_x)


@compiled(allocates=False, forceinline=True)
def solve_pressure(
    soles: Soles, regions: Regions, table: Array, frame: Frame, twist: Twist, height: float, b: Loads, work: Work
) -> int:
    """Pressure, W, S and active parts into ``work`` for a twist of G in body axes; BALANCED, TIPS or LIFTED.

    ``b``: normal load [N] and its moments about G [N m] without friction, (∫p, ∫X p, ∫Y p); ``height`` of the centre of
    mass [m]. Where the region in contact was cut, pressure and W start as the last call left them.
    """
    x = work.pressure
    if not b[0] > 0:
        return LIFTED
    if work.counts[ANY_CUT] == 0:
        # Nothing was cut the last time: a step from the whole region usually is the answer.
        x[0], x[1], x[2] = 1.0, 0.0, 0.0
        contact_parts(soles, regions, frame, work)
        unit_wrenches(soles, table, twist[0], twist[1], twist[2], work)
        if not _equilibrium(height, work):
            return TIPS
        x[0], x[1], x[2] = product_3(work.matrices[S], b)
        if _is_whole(soles, x):
            return BALANCED
    if _refine(soles, regions, table, frame, twist, height, b, work):
        return BALANCED
    _even_pressure(soles, b, work)
    if _refine(soles, regions, table, frame, twist, height, b, work) or _in_turn(
        soles, regions, table, frame, twist, height, b, work
    ):
        return BALANCED
    all_parts(soles, work)
    return TIPS


@compiled(allocates=False)
def _refine(
    soles: Soles, regions: Regions, table: Array, frame: Frame, twist: Twist, height: float, b: Loads, work: Work
) -> bool:
    """W on the region in contact and the pressure under it in turn, until that stays; False where it does not."""
    x, allowed = work.pressure, min(_LARGEST_SHIFT, math.sqrt(work.friction_error[0]))
    for _ in range(_PASSES):
        contact_parts(soles, regions, frame, work)
        unit_wrenches(soles, table, twist[0], twist[1], twist[2], work)
        o0, o1, o2 = x[0], x[1], x[2]
        if not _balance(soles, height, b, work):
            break
        shift = abs(x[0] - o0) + soles.numbers[RADIUS] * (abs(x[1] - o1) + abs(x[2] - o2))
        if shift * work.moments[0] <= allowed * b[0]:  # W serves on: friction errs by the square of the shift.
            return True
    return False


@compiled(allocates=False)
def _in_turn(
    soles: Soles, regions: Regions, table: Array, frame: Frame, twist: Twist, height: float, b: Loads, work: Work
) -> bool:
    """As ``_refine``, from even pressure by ones under the friction force of the one before; False if that fails.

    Newton's method on A + C W may lose its way in a region far from the solution's. On A alone, the moment of a known
    force with the loads, it finds the pressure, of which there is one at most.
    """
    x = work.pressure
    _even_pressure(soles, b, work)
    for _ in range(_PASSES):
        contact_parts(soles, regions, frame, work)
        unit_wrenches(soles, table, twist[0], twist[1], twist[2], work)
        fx, fy, _ = product_3(work.matrices[W], x)
        o0, o1, o2 = x[0], x[1], x[2]
        if not _balance(soles, 0.0, (b[0], b[1] - height * fx, b[2] - height * fy), work):
            return False
        shift = abs(x[0] - o0) + soles.numbers[RADIUS] * (abs(x[1] - o1) + abs(x[2] - o2))
        if shift * work.moments[0] <= _LARGEST_SHIFT * b[0]:
            return _refine(soles, regions, table, frame, twist, height, b, work)
    return False


@compiled(allocates=False)
def _even_pressure(soles: Soles, b: Loads, work: Work) -> None:
    x = work.pressure
    x[0], x[1], x[2] = b[0] * soles.numbers[PER_AREA] * soles.numbers[STRETCH], 0.0, 0.0


@compiled(allocates=False, forceinline=True)
def _is_whole(soles: Soles, x: Array) -> bool:
    lowest: float = x[0]
    for e in range(soles.edges.shape[0]):
        lowest = min(lowest, x[0] + x[1] * soles.edges[e, PLAIN] + x[2] * soles.edges[e, PLAIN + 1])
    return bool(lowest >= 0)


@compiled(allocates=False)
def _balance(soles: Soles, height: float, b: Loads, work: Work) -> bool:
    """Newton's method for the pressure and the region in contact under the W in ``work``; False where there is none.

    A step is halved until the region is not empty and the residual falls.
    """
    x, moments, radius = work.pressure, work.moments, soles.numbers[RADIUS]
    enough = b[0] * max(_RESIDUAL, _LEFT * work.friction_error[0])
    accepted = max(enough, _ACCEPTED * b[0])
    corners, ends = soles.edges[:, PLAIN : PLAIN + 2], soles.rings[:, 0]
    clipped_moments(corners, ends, x[0], x[1], x[2], moments)
    if not (moments[0] > 0 and _equilibrium(height, work)):
        return False
    residual = _residual(work, b, radius)
    for _ in range(_STEP_LIMIT):
        if residual <= enough:
            break
        o0, o1, o2 = x[0], x[1], x[2]
        n0, n1, n2 = product_3(work.matrices[S], b)
        fraction, before = 1.0, residual
        while fraction > 1e-9:
            x[0], x[1], x[2] = o0 + fraction * (n0 - o0), o1 + fraction * (n1 - o1), o2 + fraction * (n2 - o2)
            clipped_moments(corners, ends, x[0], x[1], x[2], moments)
            if moments[0] > 0 and _equilibrium(height, work):
                residual = _residual(work, b, radius)
                if residual <= (1 - 0.1 * fraction) * before or (fraction == 1.0 and residual <= accepted):
                    break
            fraction *= 0.5
        # Rounding is all that is left, or a contact that shrinks without end.
        if (residual <= accepted and residual > 0.1 * before) or not moments[0] > _LOST * _area(soles):
            break
    return bool(residual <= accepted and moments[0] >= LEAST_CONTACT * _area(soles))


@compiled(allocates=False, inline="always")
def _area(soles: Soles) -> float:
    area: float = soles.numbers[MOMENTS]
    return area
