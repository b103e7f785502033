"""Runs a tow in three dimensions for :mod:`towval.physics.dynamics`: what it needs, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Ground, Sliding, Tether, TowedObject
from towval.model.checks import positive
from towval.physics.friction_table import SLOPE
from towval.physics.motion import TAUT
from towval.physics.spatial.integrator import FILLED, STUCK, integrate, march_from
from towval.physics.spatial.problem import GRAVITY_N, HOLD_SPEED, KAPPA, MASS, REST, TETHER_WEIGHT, TowProblem
from towval.physics.spatial.rates import tensions
from towval.physics.spatial.soles import RADIUS, work_for
from towval.physics.splines import spline_values
from towval.physics.steps import error_scales

_COUNTS = ("steps", "rejections", "mode_changes", "break_aways", "looks")
_FINEST_SPEED = 1e-4  # m/s; with sticking friction rises faster only where an object is let go or comes to rest


@dataclass(frozen=True)
class Sticking:
    """Friction at rest as a set: ``static`` coefficient μ_s [1] and ``speed`` [m/s] below which it may hold.

    The law of sliding should have risen to μ_s at that speed, as :func:`towval.physics.friction_laws.risen_law` has.

    Examples
    --------
    Half the limit for ten minutes: an object stays where the regularised law creeps.

    >>> from towval.physics import *
    >>> square = Patch([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    >>> towed = TowedObject(square, 5.0, (0.0, 0.0), 0.13, (0.2, 0.0))
    >>> half = TimedPath([0.0, 600.0], [[9.8, 0.0], [9.8, 0.0]])
    >>> law, times = risen_law(0.4, 0.35, 1e-4, 0.01), [0.0, 600.0]
    >>> feedforward(towed, law, half, (0.0, 0.0, 0.0), times, sticking=Sticking(0.4, 2e-4)).pose[-1]
    array([0., 0., 0.])
    """

    static: float
    speed: float

    def __post_init__(self) -> None:
        positive(self, "static", "speed")


def is_planar(
    towed: TowedObject, sliding: Sliding, tether: Tether, ground: Ground, hinge_height: float, sticking: Sticking | None
) -> bool:
    """Whether no effect is on that the planar model leaves out."""
    heights = hinge_height, towed.anchor_height, towed.centre_of_mass_height
    floor = float(np.abs(ground.slope).max()), len(ground.regions)
    friction = sliding.across_over_along - 1, sliding.radius_over_planar - 1
    return sticking is None and not any((*heights, *floor, *friction, tether.stiffening, tether.mass_per_length))


class TowRun(NamedTuple):
    """How a tow went: code of the integrator, states (n, 6) and modes (n,), tether (n, 3) or force, counts by name."""

    code: int
    states: Array
    tension: Array
    towed: bool
    statistics: dict[str, float]


def run_tow(problem: TowProblem, forced: bool, start: Array, times: Array, tolerance: float, step_limit: int) -> TowRun:
    """Integrate from a state of the centre of mass (6,) at ``times[0]``."""
    # An object trails a tether stretched by some 10 mm: of an error of friction its place errs by a hundredth metre.
    work = work_for(problem.soles, problem.regions, friction_error=tolerance)
    numbers, radius = problem.numbers, problem.soles.numbers[RADIUS]
    rise = max(1 / problem.sliding[SLOPE], _FINEST_SPEED if numbers[HOLD_SPEED] > 0 else 0.0)
    stretch = np.inf if forced else numbers[MASS] * numbers[GRAVITY_N] / numbers[KAPPA]
    weights = tolerance * error_scales(rise, stretch, radius)
    march = march_from(problem, work, forced, start, times, weights)
    code, filled = integrate(march, step_limit), int(march.clock[FILLED])
    states, tension = march.states[:filled], np.zeros((filled, 3))
    if forced:
        tension[:, 1:] = spline_values(problem.drive, times[:filled])[0]
    else:
        tensions(problem, times, states, tension)
    towed = forced or _ever_towed(problem, march.modes[:filled], march.counts, tension[:, 0])
    return TowRun(code, states, tension, towed, dict(zip(_COUNTS, map(float, march.counts), strict=True)))


def _ever_towed(problem: TowProblem, modes: NDArray[np.int64], counts: NDArray[np.int64], lengths: Array) -> bool:
    if problem.numbers[TETHER_WEIGHT] > 0:  # It pulls a little all along.
        return bool((lengths >= problem.numbers[REST]).any())
    return bool((modes == TAUT).any() or (modes == STUCK).any() or counts[2] or counts[3])
