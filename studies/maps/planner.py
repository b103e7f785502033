"""Where the planner follows a path: over threshold and look-ahead, and over the path's curvature and steering range."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from studies.frame import Maps, Part, Row, Settings, Study, judged
from studies.maps.integrators import CUBE, FRICTION, STICTION
from towval.model import Tether, TimedPath
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import Coulomb
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.wrench import sliding_patch
from towval.planning.kinematics import Rover, symmetric_rover
from towval.planning.paths import circle, lemniscate, rounded_square, timed
from towval.planning.planner import FOLLOWED, PlannerSettings, PlanOutcome, plan_rover

SETTINGS = PlannerSettings(
    threshold=0.2,
    look_ahead_steps=350,
    proportional_gain=2.0,
    derivative_gain=0.05,
    close_distance=0.3,
    arrival_distance=0.02,
    stray_distance=2.0,
)
"""The paper's gains and threshold; see src/towval/workflow/plan.yaml."""

ALLOWED_M = FOLLOWED * SETTINGS.arrival_distance
DURATION_S, STEP_S = 600.0, 0.1
OUTWARD_DEG = 33.7


def rover(outward_deg: float = OUTWARD_DEG) -> Rover:
    """The rover of src/towval/workflow/plan.yaml with another outer steering range."""
    return symmetric_rover(0.4, 0.4, 0.1, outward=np.radians(outward_deg), inward=np.radians(93.0))


def planner_rows(curve: str, thresholds_m: list[float], look_aheads: list[int]) -> list[Row]:
    """Cells over d_t and ϑ_lh on the path of the hinge that draws the cube along a curve."""
    desired = {"lemniscate": lemniscate(2.0), "rounded square": rounded_square(4.0, 1.0)}[curve]
    patch = sliding_patch(resting_pressure(CUBE), Coulomb(FRICTION, STICTION))
    path = quasistatic_plan(CUBE, patch, timed(desired, STEP_S, duration=DURATION_S), Tether(0.6, 1e5)).hinge
    return [
        {"map": f"d_t and ϑ_lh, {curve}", "x": threshold, "y": steps} | _judged(path, rover(), threshold, steps)
        for threshold in thresholds_m
        for steps in look_aheads
    ]


def steering_rows(radii_m: list[float], outward_deg: list[float]) -> list[Row]:
    """Cells over the curvature of a circle and the outer steering range."""
    rows = []
    for radius in radii_m:
        path = timed(circle(radius), STEP_S, duration=DURATION_S)
        rows += [
            {"map": "curvature and steering", "x": 1 / radius, "y": outward} | _judged(path, rover(outward), 0.2, 100)
            for outward in outward_deg
        ]
    return rows


def _judged(path: TimedPath, machine: Rover, threshold: float, look_ahead: int) -> Row:
    settings = replace(SETTINGS, threshold=threshold, look_ahead_steps=look_ahead)
    plan = plan_rover(path, machine, settings)
    flags = [finding.code for finding in plan.findings if finding.severity != "note"]
    flags += [] if plan.outcome is PlanOutcome.ARRIVED else [str(plan.outcome)]
    return judged(plan.rms, ALLOWED_M, flags)


def rows_of(what: str, **keys: Any) -> list[Row]:
    """Cells of one part: "threshold" or "steering"."""
    return planner_rows(**keys) if what == "threshold" else steering_rows(**keys)


def _parts(settings: Settings) -> dict[str, Part]:
    thresholds = [0.05, 0.2, 1.0] if settings.quick else [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5]
    look_aheads = [0, 350] if settings.quick else [0, 50, 100, 200, 300, 350, 400, 500, 600]
    parts: dict[str, Part] = {
        curve.replace(" ", "_"): {
            "what": "threshold",
            "curve": curve,
            "thresholds_m": thresholds,
            "look_aheads": look_aheads,
        }
        for curve in ("lemniscate", "rounded square")
    }
    radii = [0.3, 1.0] if settings.quick else [0.15, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0]
    ranges = [15.0, 33.7] if settings.quick else [10.0, 20.0, 33.7, 45.0, 60.0, 75.0]
    return parts | {"steering": {"what": "steering", "radii_m": radii, "outward_deg": ranges}}


STUDY = Study(
    parts=_parts,
    rows=rows_of,
    chart=Maps(
        title="Planner of the rover",
        axes={
            "d_t and ϑ_lh, lemniscate": ("threshold d_t [m]", "look-ahead ϑ_lh [steps]"),
            "d_t and ϑ_lh, rounded square": ("threshold d_t [m]", "look-ahead ϑ_lh [steps]"),
            "curvature and steering": ("curvature of the path [1/m]", "outer steering range [deg]"),
        },
        note="Right: arrived, 50 mm RMS or less from the path. Flagged: strayed, stuck, or a warning of the planner.",
        take="Take the paper's threshold of 0.2 m with a look-ahead of 350 steps, the defaults; at 0.2 m any "
        "look-ahead up to 500 steps is right. A path with more curvature needs more steering. The planner warns of a "
        "path that it cannot follow.",
        default={
            f"d_t and ϑ_lh, {curve}": {"x": SETTINGS.threshold, "y": SETTINGS.look_ahead_steps}
            for curve in ("lemniscate", "rounded square")
        }
        | {"curvature and steering": {"y": OUTWARD_DEG}},
    ),
)
