"""Rows of the table of measured pushes: what friction models predict, untrained, beside fitted and published ones.

``studies.tables.measured_pushes`` prints them. Angles are in degrees, as median (mean) over the pushes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from studies.real.feet_study import (
    SLOW_M,
    SPREAD_LIMIT_DEG,
    course_errors_deg,
    fitted_rows,
    friction_rows,
    push_rows,
    scale_rows,
)
from studies.real.push_data import PROGRAMMED_HEIGHT_M, TIP_HEIGHT_M, PushLog
from studies.real.sole_study import sole_table
from towval.model import Array

Row = tuple[str, str, str, bool]
"""What, at least, measured, and whether it holds; lines that require nothing hold."""

PUBLISHED = "Zhou et al. 2016, mean twist error, 30 pushes trained, 10 held out"


def median_mean(errors: pd.Series | Array) -> str:
    """How errors are printed."""
    return f"{np.median(errors):.2f} ({np.mean(errors):.2f}), n {len(errors)}"


def foot_rows(feet: list[PushLog]) -> Iterator[Row]:
    """Predictions from mean wrenches and twists, nothing trained, with the tip at several heights."""
    for height in (0.0, PROGRAMMED_HEIGHT_M, TIP_HEIGHT_M, 0.018):
        pushes = pd.concat([push_rows(log, height) for log in feet], ignore_index=True)
        twist, all_move = pushes.twist_deg, pushes[pushes.slowest_path_m > SLOW_M]
        final = height == TIP_HEIGHT_M
        label = f"h = {1e3 * height:g} mm"
        holds = bool(twist.mean() <= 8.8 and twist.median() <= 5.3)
        yield f"twist from wrench, {label}", "5.3 (8.8)" if final else "", median_mean(twist), holds or not final
        errors = all_move.wrench_deg
        holds = bool(errors.median() <= 5.5)
        yield (
            f"wrench from twist, feet move 2 mm, {label}",
            "5.5" if final else "",
            median_mean(errors),
            holds or not final,
        )
        if final or height == 0:
            yield f"  ellipsoid from statics, twist, {label}", "", median_mean(pushes.ellipsoid_twist_deg), True
            yield (
                f"  ellipsoid from statics, wrench, 2 mm, {label}",
                "",
                median_mean(all_move.ellipsoid_wrench_deg),
                True,
            )
        if final:
            yield from posedness_rows(pushes)
            yield from coefficient_rows(pushes)


def posedness_rows(pushes: pd.DataFrame) -> Iterator[Row]:
    """Which pushes turn about a foot, by the model alone, and what that means for each prediction."""
    ill = pushes[pushes.wrench_spread_deg > SPREAD_LIMIT_DEG]
    well = pushes[pushes.wrench_spread_deg <= SPREAD_LIMIT_DEG]
    rests = pushes[pushes.foot_rests]
    slow = pushes.slowest_path_m <= SLOW_M
    yield "wrench from twist, well-posed (spread ≤ 10°)", "", median_mean(well.wrench_deg), True
    yield "wrench from twist, ill-posed (spread > 10°)", "reported", median_mean(ill.wrench_deg), True
    yield "  the same, against the set of wrenches", "", median_mean(ill.set_error_deg), True
    yield "  the same, twist from wrench", "", median_mean(ill.twist_deg), True
    yield "  a foot moves less than 2 mm", "", f"{slow[ill.index].sum()} of {slow.sum()}", True
    yield "foot rests by the measured wrench: twist", "", median_mean(rests.twist_deg), True
    yield "  it is the slowest foot of the measured twist", "", f"{rests.rests_at_slowest.sum()} of {len(rests)}", True
    yield "no foot rests by the wrench: twist", "", median_mean(pushes[~pushes.foot_rests].twist_deg), True
    yield "a foot lifts by statics", "", f"{pushes.lifts.sum()}", True


def coefficient_rows(pushes: pd.DataFrame) -> Iterator[Row]:
    """μ by log; its deviation for a new log is the scatter between logs, not that of the mean."""
    well = pushes[pushes.wrench_spread_deg <= SPREAD_LIMIT_DEG]
    for column, name, used in (
        ("friction_by_size", "size of wrench, well-posed", well),
        ("friction_by_wrench", "limit surface", pushes),
        ("friction_by_power", "power", pushes),
    ):
        by_log, (mean, std, scatter) = friction_rows(used, column)
        yield f"μ by {name}: mean of logs, scatter between them", "", f"{mean:.4f} ± {std:.4f}, {scatter:.4f}", True
        for row in by_log.itertuples():
            value = f"{row.mean:.4f} ± {row.std_of_mean:.4f} (pushes {row.std:.3f})"
            yield f"  {row.log}", "", value, True


def scale_lines(feet: list[PushLog]) -> Iterator[Row]:
    """A check of the identification on supports that are known: the feet are where they are stated to be."""
    table, (mean, std, scatter) = scale_rows(feet, TIP_HEIGHT_M)
    agrees = abs(mean - 1) <= 2 * np.hypot(std, scatter)
    value = f"{mean:.3f} ± {std:.3f}, {scatter:.3f}"
    yield "feet's distances over stated: mean, scatter between", "1 within 2 σ", value, bool(agrees)
    for row in table.itertuples():
        low, high = row.interval
        yield f"  {row.log}", "", f"{row.value:.3f} ± {row.bootstrap_std:.3f} [{low:.3f}, {high:.3f}]", True


def slow_rows(feet: list[PushLog], patch: PushLog) -> Iterator[Row]:
    """What takes a minute: courses, fitted ellipsoids with the published results beside them, the whole face."""
    for height in (PROGRAMMED_HEIGHT_M, TIP_HEIGHT_M):
        courses = np.concatenate([course_errors_deg(log, height) for log in feet])
        holds = bool(courses.mean() <= 8.8 and np.median(courses) <= 5.3)
        what = f"twist from the wrench's course, h = {1e3 * height:g} mm"
        yield what, "5.3 (8.8)", median_mean(courses), holds
    fitted = pd.concat([fitted_rows(log) for log in feet])
    yield "fitted ellipsoid, leave one out: twist", "", median_mean(fitted.twist_deg), True
    yield "fitted ellipsoid, leave one out: wrench", "", median_mean(fitted.wrench_deg), True
    for model, error in (("convex quartic", 12.2), ("ellipsoid", 13.7), ("Gaussian process", 12.3)):
        yield f"published {model}", "", f"mean {error}", True
    yield from sole_rows(patch)


def sole_rows(patch: PushLog) -> Iterator[Row]:
    """The whole face: planar pressure, fitted ellipsoid, and the one parameter that is identified."""
    fitted = fitted_rows(patch)
    yield "face, fitted ellipsoid, leave one out: twist", "", median_mean(fitted.twist_deg), True
    yield "face, fitted ellipsoid, leave one out: wrench", "", median_mean(fitted.wrench_deg), True
    for i, row in enumerate(sole_table(patch, TIP_HEIGHT_M).to_dict("records")):
        if i == 0:
            yield "face, planar pressure: twist", "", median_mean(row["planar_twist_deg"]), True
            yield "face, planar pressure: wrench", "", median_mean(row["planar_wrench_deg"]), True
        low, high = row["interval"]
        value = f"{row['value']:.3f} ± {row['std']:.3f} [{low:.3f}, {high:.3f}]"
        yield f"face, {row['family']}: parameter", "not at a bound", value, not row["at_bound"]
        parts = (row["jackknife_std"], row["bootstrap_std"], row["systematic_std"])
        yield "  jackknife, bootstrap, systematic", "", ", ".join(f"{part:.3f}" for part in parts), True
        yield "  from twists alone, from wrenches alone", "", f"{row['by_twist']:.3f}, {row['by_wrench']:.3f}", True
        value = f"{row['radius_over_planar']:.3f} ± {row['radius_over_planar_std']:.3f}"
        yield "  friction radius over that of planar pressure", "", value, True
        yield "  ten-fold: twist", "", median_mean(row["cv_twist_deg"]), True
        yield "  ten-fold: wrench", "", median_mean(row["cv_wrench_deg"]), True
