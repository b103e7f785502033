"""Nominal motions by the quasi-static model: the general object on each curve (Fig. 4), the cube elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.costs import cpu_seconds
from studies.frame import Part, Row
from studies.paper.scene import CURVES, PaperScene, paper_study
from towval.model import Array, TowedObject
from towval.model.geometry import polygon_centroid
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import fitted_law
from towval.physics.quasistatic import QuasistaticMotion, quasistatic_plan
from towval.physics.wrench import SlidingPatch, sliding_patch
from towval.planning.paths import path_heading, timed

SHOWN_ROWS = 800
"""Rows kept of a path that is drawn."""


def cube_nominal(
    scene: PaperScene, patch: SlidingPatch, curve: str, time_step: float, *, speed: float | None = None
) -> QuasistaticMotion:
    """Quasi-static motion of the cube along a curve, at a mean speed [m/s] or, without, in the paper's 600 s."""
    duration = scene.duration if speed is None else None
    specification = timed(scene.curves[curve], time_step, mean_speed=speed, duration=duration)
    return quasistatic_plan(scene.towed, patch, specification, scene.tether)


def general_nominal(scene: PaperScene, curve: str, centre: str) -> QuasistaticMotion:
    """Quasi-static motion of the general object along a curve, with its centre of mass at a named place.

    ASSUME: the object starts as its footprint alone would settle, its centroid behind the anchor, whatever the load:
    so what an eccentric load does shows from the start.
    """
    towed = scene.general[centre]
    patch = sliding_patch(resting_pressure(towed), fitted_law(scene.friction).law)
    specification = timed(scene.curves[curve], scene.time_step, duration=scene.duration)
    heading = settled_heading(towed, path_heading(specification.position[:3])[0])
    return quasistatic_plan(towed, patch, specification, scene.tether, start_heading=heading)


def settled_heading(towed: TowedObject, direction: float) -> float:
    """Heading at which the centroid of the footprint lies straight behind the anchor [rad]."""
    lever = towed.anchor - polygon_centroid(towed.patch.outline)
    return float(direction - np.arctan2(lever[1], lever[0]))


def _nominal_rows(scene: PaperScene, curve: str, centre: str) -> list[Row]:
    nominal = general_nominal(scene, curve, centre)
    seconds = cpu_seconds(lambda: general_nominal(scene, curve, centre))
    common = {
        "curve": curve,
        "centre": centre,
        "steps": len(nominal.time_s) - 1,
        "compute_time_s": seconds,
        "findings": " ".join(finding.code for finding in nominal.findings),
    }
    return [common | row for row in _motion_rows(nominal)]


def _motion_rows(nominal: QuasistaticMotion) -> list[Row]:
    shown = _shown(len(nominal.time_s))
    columns = {
        "time_s": nominal.time_s,
        "x_m": nominal.pose[:, 0],
        "y_m": nominal.pose[:, 1],
        "heading_rad": nominal.pose[:, 2],
        "hinge_x_m": nominal.hinge.position[:, 0],
        "hinge_y_m": nominal.hinge.position[:, 1],
        "force_x_n": nominal.tether_force[:, 0],
        "force_y_n": nominal.tether_force[:, 1],
    }
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*(v[shown] for v in columns.values()), strict=True)
    ]


def _shown(count: int) -> NDArray[np.int_]:
    return np.unique(np.linspace(0, count - 1, min(count, SHOWN_ROWS + 1)).round().astype(int))


def path_rows(common: Row, position: Array) -> list[Row]:
    """Rows of a path (n, 2) [m] that is drawn, each with the columns ``common``."""
    return [common | {"x_m": x, "y_m": y} for x, y in position[_shown(len(position))]]


def _nominal_parts(plan: Mapping[str, Any]) -> dict[str, Part]:
    centres = plan["general_object"]["centres_of_mass_m"]
    return {f"{curve}_{centre}": {"curve": curve, "centre": centre} for curve in CURVES for centre in centres}


NOMINAL = paper_study(_nominal_parts, _nominal_rows)
