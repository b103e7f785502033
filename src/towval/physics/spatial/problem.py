"""All that stays the same during a tow in three dimensions, laid out for compiled code."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from towval.model import Array, FrictionLaw, Ground, Sliding, Tether, TowedObject
from towval.physics.friction_laws import Coulomb
from towval.physics.friction_table import friction_table
from towval.physics.spatial.soles import Regions, Soles, regions_of, soles
from towval.physics.splines import Spline

# Numbers of a problem: mass [kg], inertia [kg m²], height of the centre of mass, anchor above it, anchor from it [m];
# gravity along the floor and towards it [m/s²]; stiffness, rest length, damping, hinge above the anchor, stiffening and
# stretch at full load; speed below which friction may hold [m/s], zero: never; weight of the tether [N/m].
MASS, INERTIA, HEIGHT, ABOVE, ANCHOR_X, ANCHOR_Y, GRAVITY_X, GRAVITY_Y, GRAVITY_N = range(9)
KAPPA, REST, DAMPING, RISE, STIFFENING, FULL_STRETCH, HOLD_SPEED, TETHER_WEIGHT = range(9, 17)

_HOLD_RISE = 1e-9  # m/s; the law at rest is Coulomb's: only its plateau counts, and this is far below it


class TowProblem(NamedTuple):
    """What stays the same during a tow.

    ``sliding`` and ``holding`` are the tables of the friction law in motion and at rest; ``numbers`` are indexed by the
    names above; ``drive`` is the hinge's path [m] or the force on the anchor [N].
    """

    soles: Soles
    regions: Regions
    sliding: Array
    holding: Array
    numbers: Array
    drive: Spline


def tow_problem(
    towed: TowedObject,
    sliding: Sliding,
    tether: Tether,
    ground: Ground,
    hinge_height: float,
    drive: Spline,
    hold: tuple[float, float] = (0.0, 0.0),
) -> TowProblem:
    """Lay out a tow; ``hold``: static coefficient [1] and the speed [m/s] below which friction may hold, or zeros.

    The floor rises by ``ground.slope``, so in its axes gravity is ``g (−s_x, −s_y, −1)/√(1 + s²)``.
    """
    steepness = math.sqrt(1 + float(ground.slope @ ground.slope))
    level = ground.gravity / steepness
    body = [
        towed.mass,
        towed.inertia,
        towed.centre_of_mass_height,
        towed.anchor_height - towed.centre_of_mass_height,
        *(towed.anchor - towed.centre_of_mass),
        *(-level * ground.slope),
        level,
    ]
    numbers = tether_numbers(tether, hinge_height - towed.anchor_height, level)
    numbers[: len(body)], numbers[HOLD_SPEED] = body, hold[1]
    return TowProblem(
        soles=soles(towed.patch, towed.centre_of_mass, sliding.across_over_along, sliding.radius_over_planar),
        regions=regions_of(ground),
        sliding=friction_table(sliding.law),
        holding=_holding_table(hold[0] if hold[0] > 0 else 1.0),
        numbers=numbers,
        drive=drive,
    )


def tether_numbers(tether: Tether, rise: float, gravity: float) -> Array:
    """The numbers of a problem with those of its tether; ``rise`` of the hinge over the anchor [m], gravity [m/s²]."""
    numbers = np.zeros(TETHER_WEIGHT + 1)
    numbers[KAPPA : STIFFENING + 1] = tether.stiffness, tether.rest_length, tether.damping, rise, tether.stiffening
    numbers[FULL_STRETCH] = tether.full_load / tether.stiffness if tether.stiffening > 0 else 1.0
    numbers[TETHER_WEIGHT] = tether.mass_per_length * gravity
    return numbers


@functools.lru_cache(maxsize=32)
def _holding_table(static: float) -> Array:
    return friction_table(Coulomb(static, _HOLD_RISE))


def as_sliding(law: FrictionLaw | Sliding) -> Sliding:
    """A friction law, or what is known beyond it, as the latter."""
    return law if isinstance(law, Sliding) else Sliding(law)
