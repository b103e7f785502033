"""Pushes of a block on its whole face: which pressure of three one-parameter families they show, and how well.

The family "radius" is the package's own, ``Sliding.radius_over_planar``, and with it the planar pressure; the other two
the package does not have.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from studies.real.feet_study import WEIGHT_N
from studies.real.one_parameter import cross_validated, identified
from studies.real.program_pushes import PushedBody
from studies.real.push_data import MASS_KG, OUTLINE, STATED_FRICTION, PushLog, angle_deg, scaled_twist, scaled_wrench
from studies.real.sole_pressure import (
    Loads,
    Sole,
    corner_loads,
    friction_radius,
    lobe_loads,
    push_errors_deg,
    radius_loads,
    sole,
)
from towval.model import Array, Patch

Family = Callable[[Sole, float], Loads]
FAMILIES: dict[str, tuple[Family, Array, float]] = {
    "radius": (radius_loads, np.round(np.arange(0.90, 1.601, 0.05), 3), 1.0),
    "corners": (corner_loads, np.round(np.arange(0.0, 0.601, 0.05), 3), 0.0),
    "lobes": (lobe_loads, np.round(np.geomspace(0.1, 1.0, 13), 4), 1.0),
}
"""Family, grid of its parameter, and the parameter of the planar pressure."""

OFFSET_STD_M = 0.0008
"""Stated calibration of tip to block, common to the pushes of a log: resampling pushes does not show it."""


def profiles(log: PushLog, family: str, height_m: float, element_size: float) -> tuple[Array, Array]:
    """Angles [deg] (g, n) of twist from wrench and of wrench from twist over the family's grid."""
    make, grid, _ = FAMILIES[family]
    if family == "radius":
        errors = [_program_errors_deg(log, height_m, float(p)) for p in grid]
    else:
        of, pushes = sole(OUTLINE, element_size), (log.wrench, log.twist)
        errors = [push_errors_deg(make(of, float(p)), WEIGHT_N, pushes, height_m, STATED_FRICTION) for p in grid]
    return np.array([e[0] for e in errors]), np.array([e[1] for e in errors])


def _program_errors_deg(log: PushLog, height_m: float, radius_over_planar: float) -> tuple[Array, Array]:
    """Angles (n,), (n,) [deg] of twist from wrench and wrench from twist, by the package."""
    body = PushedBody([Patch(OUTLINE)], MASS_KG, height_m, STATED_FRICTION, radius_over_planar)
    twists = np.array([body.twist(wrench)[0] for wrench in log.wrench])
    wrenches = np.array([body.wrench(twist) for twist in log.twist])
    return (
        angle_deg(scaled_twist(twists), scaled_twist(log.twist)),
        angle_deg(scaled_wrench(wrenches), scaled_wrench(log.wrench)),
    )


def family_row(
    log: PushLog, family: str, height_m: float, element_size: float, systematic_std: float
) -> dict[str, Any]:
    """What pushes say of a family: parameter with its deviations, friction radius over the planar one, errors.

    The parameter is that of the least mean angle over both directions of prediction; ``std`` joins the bootstrap over
    pushes with the systematic part. ``cv_*`` are predictions with the parameter chosen on the other folds.
    """
    make, grid, planar = FAMILIES[family]
    of_twist, of_wrench = profiles(log, family, height_m, element_size)
    both = (of_twist + of_wrench) / 2
    found = identified(grid, both)
    of = sole(OUTLINE, element_size)

    def radius(parameter: float) -> float:
        return friction_radius(*make(of, parameter)(WEIGHT_N, OUTLINE.mean(axis=0)))

    at_planar = int(np.argmin(np.abs(grid - planar)))
    std = float(np.hypot(found.bootstrap_std, systematic_std))
    ends = [np.clip(found.value + side * std, 1e-2, None) for side in (-1, 1)]
    return {
        "family": family,
        **vars(found),
        "by_twist": identified(grid, of_twist).value,
        "by_wrench": identified(grid, of_wrench).value,
        "systematic_std": systematic_std,
        "std": std,
        "radius_over_planar": radius(found.value) / radius(planar),
        "radius_over_planar_std": abs(radius(float(ends[1])) - radius(float(ends[0]))) / 2 / radius(planar),
        "planar_twist_deg": of_twist[at_planar],
        "planar_wrench_deg": of_wrench[at_planar],
        "cv_twist_deg": cross_validated(grid, both, of_twist),
        "cv_wrench_deg": cross_validated(grid, both, of_wrench),
    }


def systematic_std(log: PushLog, family: str, height_m: float, element_size: float) -> float:
    """Deviation of the parameter from what all pushes share: the tip's place on the block, x and y, and its height.

    Each is shifted by its deviation (height: one third, for it is only known to lie between 10 and 20 mm) and the
    parameter identified again.
    """
    fx, fy, moment = log.wrench.T
    shifted = [np.column_stack([fx, fy, moment + dx * fy - dy * fx]) for dx, dy in OFFSET_STD_M * np.eye(2)]
    logs = [PushLog(log.name, log.feet, log.twist, w) for w in shifted]
    grid = FAMILIES[family][1]

    def value(of: PushLog, height: float) -> float:
        of_twist, of_wrench = profiles(of, family, height, element_size)
        return identified(grid, (of_twist + of_wrench) / 2, draws=2).value

    base = value(log, height_m)
    changes = [value(other, height_m) - base for other in logs] + [value(log, height_m * 4 / 3) - base]
    return float(np.linalg.norm(changes))


def sole_table(log: PushLog, height_m: float, element_size: float = 0.008) -> pd.DataFrame:
    """A row a family; the systematic part on cells of twice the size."""
    return pd.DataFrame(
        [
            family_row(log, name, height_m, element_size, systematic_std(log, name, height_m, 2 * element_size))
            for name in FAMILIES
        ]
    )
