"""Pushes of a block on three feet, predicted by the package with the feet as stated and nothing trained.

Beside the predictions of ``program_pushes`` stand ellipsoids, and Coulomb's law in closed form (``point_friction``):
it checks the package's numbers, and says which pushes turn about a foot.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from studies.real.ellipsoid import leave_one_out, point_limit_surface, surface_pushing_wrench, surface_twist
from studies.real.one_parameter import between_groups, identified
from studies.real.point_friction import (
    facet_angle_deg,
    foot_loads,
    loads_while_sliding,
    pushing_wrench,
    resting_point,
    sliding_twist,
    slowest_path_m,
    wrench_spread_deg,
)
from studies.real.program_pushes import PushedBody, shrinking_feet
from studies.real.push_data import MASS_KG, STATED_FRICTION, PushLog, angle_deg, scaled_twist, scaled_wrench
from towval.model import Array
from towval.model.conventions import GRAVITY_M_PER_S2

WEIGHT_N = MASS_KG * GRAVITY_M_PER_S2
PATH_STD_M = 0.0008
"""Stated calibration of tip to block, what limits the data."""
SPREAD_LIMIT_DEG = 10.0
"""ASSUME: above, the wrench that belongs to a twist is ill-posed."""
SLOW_M = 0.002
"""Path of a foot below which the direction of its friction is not known."""
SCALES = np.round(np.arange(0.70, 1.4001, 0.025), 3)


def pushed(log: PushLog, height_m: float, scale: float = 1.0) -> PushedBody:
    """The block of a log on its feet, their distances changed by a factor, in the package's model."""
    return PushedBody(shrinking_feet(scale * log.feet), MASS_KG, height_m, STATED_FRICTION)


def push_rows(log: PushLog, height_m: float) -> pd.DataFrame:
    """A row a push: errors of the package and of the ellipsoid from statics [deg], and what is known of it otherwise.

    ``closed_form_deg`` is the larger of the angles between the package's predictions and those of Coulomb's law at
    points, of the wrench where all feet move by ``SLOW_M``. ``foot_rests`` from the measured wrench alone;
    ``wrench_spread_deg`` and ``slowest_path_m`` from the measured twist alone; both by the closed form, before any
    comparison. ``set_error_deg`` judges the wrench against the set of those that turn the body about the foot that the
    twist moves least.
    """
    body = pushed(log, height_m)
    return pd.DataFrame([_push_row(log, i, height_m, body) for i in range(len(log.twist))])


def _push_row(log: PushLog, i: int, height_m: float, body: PushedBody) -> dict[str, Any]:
    feet, twist, wrench = log.feet, log.twist[i], log.wrench[i]
    known = foot_loads(feet, WEIGHT_N, wrench, height_m)
    sliding = loads_while_sliding(feet, WEIGHT_N, twist, height_m, STATED_FRICTION)
    v, w = scaled_twist(twist), scaled_wrench(wrench)
    caused, coefficient = body.twist(wrench)
    taken = body.wrench(twist)
    surface, moving = point_limit_surface(feet, known), point_limit_surface(feet, sliding)
    slowest = int(np.argmin([slowest_path_m(feet[[k]], twist) for k in range(len(feet))]))
    rests = resting_point(feet, known, wrench)
    by_points = angle_deg(scaled_twist(caused), scaled_twist(sliding_twist(feet, known, wrench)))
    if slowest_path_m(feet, twist) > SLOW_M:
        at_points = pushing_wrench(feet, sliding, twist)
        by_points = np.maximum(by_points, angle_deg(scaled_wrench(taken), scaled_wrench(at_points)))
    return {
        "log": log.name,
        "twist_deg": float(angle_deg(scaled_twist(caused), v)),
        "wrench_deg": float(angle_deg(scaled_wrench(taken), w)),
        "closed_form_deg": float(by_points),
        "set_error_deg": facet_angle_deg(feet, known, wrench, slowest),
        "ellipsoid_twist_deg": float(angle_deg(scaled_twist(surface_twist(surface, wrench)), v)),
        "ellipsoid_wrench_deg": float(angle_deg(scaled_wrench(surface_pushing_wrench(moving, twist)), w)),
        "slowest_path_m": slowest_path_m(feet, twist),
        "foot_rests": rests is not None,
        "rests_at_slowest": rests == slowest,
        "wrench_spread_deg": wrench_spread_deg(feet, sliding, twist, PATH_STD_M),
        "lifts": bool(known.min() == 0),
        "friction_by_size": STATED_FRICTION * float(np.linalg.norm(w) / np.linalg.norm(scaled_wrench(taken))),
        "friction_by_wrench": coefficient,
        "friction_by_power": STATED_FRICTION * float(wrench @ twist) / float(taken @ twist),
    }


def course_errors_deg(log: PushLog, height_m: float) -> Array:
    """Angles [deg] (n,) of twists that are predicted from the whole course of the wrench, not from its mean.

    The sum over samples of the twist that each wrench causes, as long as the tip's work on the block, ``w·ξ = dW``,
    makes it; no start of the push has to be cut off. Body twists are added: a push turns by 0.1 rad.
    """
    body = pushed(log, height_m)
    predicted = [np.sum([row[3] * body.twist(row[:3])[0] for row in course], axis=0) for course in log.courses]
    return angle_deg(scaled_twist(np.array(predicted)), scaled_twist(log.twist))


def fitted_rows(log: PushLog) -> pd.DataFrame:
    """Errors [deg] of ellipsoids fitted to a log's other pushes, one for each direction of prediction."""
    w, v = scaled_wrench(log.wrench), scaled_twist(log.twist)
    return pd.DataFrame({"log": log.name, "twist_deg": leave_one_out(w, v), "wrench_deg": leave_one_out(v, w)})


def friction_rows(pushes: pd.DataFrame, column: str) -> tuple[pd.DataFrame, tuple[float, float, float]]:
    """μ by log (mean, scatter of pushes, deviation of the mean), and (mean, its deviation, scatter between logs)."""
    by_log = pushes.groupby("log", sort=False)[column].agg(["mean", "std", "count"]).reset_index()
    by_log["std_of_mean"] = by_log["std"] / np.sqrt(by_log["count"])
    return by_log, between_groups(by_log["mean"].to_numpy(), by_log["std_of_mean"].to_numpy())


def scale_rows(logs: list[PushLog], height_m: float) -> tuple[pd.DataFrame, tuple[float, float, float]]:
    """The feet's distances over the stated ones, identified from the twists: 1 if the statement and the model hold."""
    rows = []
    for log in logs:
        errors = np.array([_twist_errors(log, scale, height_m) for scale in SCALES])
        found = identified(SCALES, errors)
        rows.append({"log": log.name, "pushes": len(log.twist), **vars(found)})
    table = pd.DataFrame(rows)
    return table, between_groups(table["value"].to_numpy(), table["bootstrap_std"].to_numpy())


def _twist_errors(log: PushLog, scale: float, height_m: float) -> Array:
    body = pushed(log, height_m, scale)
    predicted = [body.twist(wrench)[0] for wrench in log.wrench]
    return angle_deg(scaled_twist(np.array(predicted)), scaled_twist(log.twist))
