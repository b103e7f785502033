"""Checks of the paper's claims about the planner and the closed loop, on the tables of its studies."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd

from studies.paper.ledger import ClaimOutcome, Tables, outcome
from studies.paper.scene import CURVES

Decision = tuple[ClaimOutcome, str]

BEST_THRESHOLDS = (0.1, 0.4)
"""Thresholds that the paper finds best for most curves [m]."""

BEST_LOOK_AHEADS = (300, 400)
"""Look-aheads that the paper finds feasible [steps]."""

EXACT_M = 1e-3
"""An arc that passes the point aimed at within this distance reaches it exactly [m]: a hundredth of d_t."""

LEAST_ADVANTAGE = 0.05
"""Share of points that must arrive more often before a look-ahead counts as better: two of the surface's 40 rows."""

BREAKING_THRESHOLDS = (0.103, 0.227)
"""Thresholds that break the paper's controller on the lemniscate [m]."""


def mostly_case_a(tables: Tables) -> Decision:
    """Whether the planner is mostly in case A, and in all of them at times."""
    rows = tables["loop"]
    numbers = rows[rows["row"] == "numbers"].iloc[0]
    case = rows.loc[rows["row"] == "rover", "case"].to_numpy()
    changes = int((case[1:] != case[:-1]).sum())
    shares = {name: float(numbers[f"case_{name.lower()}_share"]) for name in "ABC"}
    held = shares["A"] > 0.5 and min(shares.values()) > 0 and changes >= 3
    text = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
    return outcome(held), f"{text} of the steps, {changes} changes of case; {numbers['outcome']}"


def case_in_object(letter: str) -> Callable[[Tables], Decision]:
    """Whether the object is clearly farther from its path while the rover is in case B or C than in case A."""

    def decide(tables: Tables) -> Decision:
        rows = tables["loop"]
        nominal = rows[rows["row"] == "nominal object"][["x_m", "y_m"]].to_numpy()
        gaps = {}
        for name, part in rows[rows["row"] == "object"].groupby("case"):
            points = part[["x_m", "y_m"]].to_numpy()
            gaps[name] = float(np.linalg.norm(points[:, None] - nominal, axis=-1).min(axis=1).mean())
        text = ", ".join(f"case {name} {1e3 * gap:.1f} mm" for name, gap in gaps.items())
        held = gaps.get(letter, 0.0) > max(1.5 * gaps["A"], 1e-3)
        return outcome(held), f"mean distance of the object from its nominal path: {text}"

    return decide


def case_a_exact(tables: Tables) -> Decision:
    """Whether the arc of a step in case A, driven on, meets the point aimed at."""
    rows = tables["loop"]
    aims = rows[rows["row"] == "rover"].groupby("case")["miss_m"]
    texts = [
        f"case {name} {1e3 * miss.median():.2g} mm, {1e3 * miss.quantile(0.95):.2g} mm at 95 %" for name, miss in aims
    ]
    held = float(aims.quantile(0.95)["A"]) < EXACT_M
    return outcome(held), f"distance at which the arc passes the point aimed at, median: {'; '.join(texts)}"


def realigns(tables: Tables) -> Decision:
    """Whether the rover comes back to its path in case A after each stretch of case B or C."""
    rows = tables["loop"]
    rover = rows[rows["row"] == "rover"]
    nominal = rows[rows["row"] == "nominal rover"][["x_m", "y_m"]].to_numpy()
    gap = np.array([np.linalg.norm(nominal - point, axis=1).min() for point in rover[["x_m", "y_m"]].to_numpy()])
    free = (rover["case"] == "A").to_numpy()
    starts = np.flatnonzero(np.diff(free, prepend=free[0]) != 0)
    bounds = [*starts, len(free)]
    stretches = list(pairwise(bounds))
    largest, left = [], []
    for (begin, middle), (_, end) in pairwise(stretches):
        if not free[begin]:
            largest.append(float(gap[begin:end].max()))
            left.append(float(np.median(gap[middle + 3 * (end - middle) // 4 : end])))
    held = bool(left) and all(end < 0.1 * peak for peak, end in zip(largest, left, strict=True))
    pairs = ", ".join(f"{1e3 * peak:.0f} to {1e3 * end:.2g} mm" for peak, end in zip(largest, left, strict=True))
    return outcome(
        held
    ), f"greatest distance from the path of each stretch in B or C, to that late in case A after: {pairs}"


def small_steps(tables: Tables) -> Decision:
    """Whether the deviation from the nominal path vanishes with the time step."""
    texts, held = [], True
    for curve, rows in tables["planner_steps"].sort_values("time_step_s").groupby("curve"):
        rms = rows["rover_rms_m"]
        held &= bool((rows["outcome"] == "arrived").all()) and rms.iloc[0] < 0.5 * rms.iloc[-1]
        steps = rows["time_step_s"]
        texts.append(
            f"{curve} {1e3 * rms.iloc[-1]:.2f} mm at {steps.iloc[-1]:g} s, {1e3 * rms.iloc[0]:.2f} mm at "
            f"{steps.iloc[0]:g} s"
        )
    return outcome(held), f"RMS of the rover from its nominal path: {'; '.join(texts)}"


def _numbers(tables: Tables) -> pd.DataFrame:
    rows = tables["thresholds"]
    return rows[rows["row"] == "numbers"]


def best_thresholds(tables: Tables) -> Decision:
    """Whether the best threshold of most curves lies from 0.1 to 0.4 m, and none outside is as good."""
    texts, good = [], 0
    for curve, rows in _numbers(tables).groupby("curve"):
        best = rows.loc[rows["object_rms_m"].idxmin()]
        within = rows[rows["threshold_m"].between(*BEST_THRESHOLDS)]["object_rms_m"].min()
        good += bool(BEST_THRESHOLDS[0] <= best["threshold_m"] <= BEST_THRESHOLDS[1])
        texts.append(
            f"{curve} {1e3 * best['object_rms_m']:.2f} mm at {best['threshold_m']:g} m, {1e3 * within:.2f} mm within"
        )
    return outcome(good >= 3), f"best RMS of the object, and best within 0.1 to 0.4 m: {'; '.join(texts)}"


def lemniscate_erratic(tables: Tables) -> Decision:
    """Whether the lemniscate fails more often and more erratically."""
    counts = {}
    for curve, rows in _numbers(tables).groupby("curve"):
        arrived = (rows.sort_values("threshold_m")["outcome"] == "arrived").to_numpy()
        counts[curve] = (int((~arrived).sum()), int((arrived[1:] != arrived[:-1]).sum()))
    others = [count for curve, count in counts.items() if curve != "lemniscate"]
    held = all(counts["lemniscate"] > other for other in others)
    text = ", ".join(f"{curve} {failed} ({changes})" for curve, (failed, changes) in counts.items())
    return outcome(held), f"thresholds that do not arrive (changes between arriving and not): {text}"


def breaking_values(tables: Tables) -> Decision:
    """Whether the paper's two thresholds break the controller."""
    rows = _numbers(tables)
    rows = rows[rows["curve"] == "lemniscate"].set_index("threshold_m")
    broken = rows[rows["outcome"] != "arrived"]
    found = {value: rows.loc[value, "outcome"] for value in BREAKING_THRESHOLDS if value in rows.index}
    text = ", ".join(f"{value:g} m {result}" for value, result in found.items())
    away = int((broken["first_tip_turns_away"] == 1).sum())
    sizes = tables["wheelbases"].assign(failed=lambda table: table["outcome"] != "arrived")
    listed = "; ".join(
        f"{length:g} m {100 * part['failed'].mean():.0f} % of all"
        + "".join(
            f", {value:g} m" for value in BREAKING_THRESHOLDS if part.set_index("threshold")["failed"].get(value, False)
        )
        for length, part in sizes.groupby("wheelbase_m")
    )
    held = len(found) == len(BREAKING_THRESHOLDS) and all(result != "arrived" for result in found.values())
    return outcome(held), (
        f"{text}; ours break at {', '.join(f'{value:g}' for value in broken.index)} m, in {away} of {len(broken)} of "
        f"these the first step in case C turns away from the point aimed at; failing by wheelbase: {listed}"
    )


def _surface(tables: Tables, curve: str) -> pd.DataFrame:
    rows = tables["surface"][tables["surface"]["curve"] == curve]
    return rows.assign(arrived=rows["outcome"] == "arrived")


def _jaggedness(rows: pd.DataFrame) -> float:
    """Length of the border between arriving and not, in cell sides, over the square root of the arriving cells."""
    grid = rows.pivot_table(index="look_ahead_steps", columns="threshold", values="arrived").to_numpy() > 0
    border = (grid[1:] != grid[:-1]).sum() + (grid[:, 1:] != grid[:, :-1]).sum()
    return float(border / np.sqrt(grid.sum()))


def surface_compared(tables: Tables) -> Decision:
    """Whether the lemniscate's feasible area is smaller and more jagged."""
    pair = [_surface(tables, curve) for curve in ("lemniscate", "rounded_square")]
    area = [float(rows["arrived"].mean()) for rows in pair]
    border = [_jaggedness(rows) for rows in pair]
    return outcome(area[0] < area[1] and border[0] > border[1]), (
        f"lemniscate against rounded square: {100 * area[0]:.0f} and {100 * area[1]:.0f} % arrive, border "
        f"{border[0]:.1f} and {border[1]:.1f}"
    )


def surface_errors(tables: Tables) -> Decision:
    """Whether the lemniscate's errors are higher where both curves arrive."""
    keys = ["threshold", "look_ahead_steps"]
    first, second = (
        rows.loc[rows["arrived"]].set_index(keys)["object_rms_m"]
        for rows in (_surface(tables, curve) for curve in ("lemniscate", "rounded_square"))
    )
    both = pd.concat([first, second], axis=1, join="inner", keys=["lemniscate", "square"])
    higher = float((both["lemniscate"] > both["square"]).mean())
    return outcome(higher > 0.5), (
        f"higher on the lemniscate at {100 * higher:.0f} % of the {len(both)} points where both arrive, median "
        f"{1e3 * both['lemniscate'].median():.0f} and {1e3 * both['square'].median():.0f} mm; of all that arrive "
        f"{1e3 * first.median():.0f} and {1e3 * second.median():.0f} mm"
    )


def surface_band(tables: Tables) -> Decision:
    """Whether look-aheads of 300 to 400 steps arrive, and more often than others."""
    texts, held = [], True
    for curve in ("lemniscate", "rounded_square"):
        rows = _surface(tables, curve)
        inside = rows["look_ahead_steps"].between(*BEST_LOOK_AHEADS)
        within, beyond = rows.loc[inside, "arrived"].mean(), rows.loc[~inside, "arrived"].mean()
        held &= within > 0.5 and within > beyond + LEAST_ADVANTAGE
        texts.append(f"{curve} {100 * within:.0f} %, with others {100 * beyond:.0f} %")
    return outcome(bool(held)), f"points that arrive with 300 to 400 steps: {'; '.join(texts)}"


def orientation_needed(tables: Tables) -> Decision:
    """Whether without planning the orientation ahead fewer points arrive, or with larger errors."""
    texts, held = [], True
    for curve in ("lemniscate", "rounded_square"):
        rows = _surface(tables, curve)
        ahead = rows["look_ahead_steps"].between(*BEST_LOOK_AHEADS)
        without = rows["look_ahead_steps"] == rows["look_ahead_steps"].min()
        arrive = [float(part["arrived"].mean()) for part in (rows[ahead], rows[without])]
        error = [float(part.loc[part["arrived"], "object_rms_m"].median()) for part in (rows[ahead], rows[without])]
        held &= arrive[0] > arrive[1] + LEAST_ADVANTAGE or error[1] > 1.5 * error[0]
        texts.append(
            f"{curve} {100 * arrive[0]:.0f} % arrive with, {100 * arrive[1]:.0f} % without, median RMS "
            f"{1e3 * error[0]:.0f} and {1e3 * error[1]:.0f} mm"
        )
    return outcome(bool(held)), f"with and without a look-ahead of 300 to 400 steps: {'; '.join(texts)}"


def followed(tables: Tables) -> Decision:
    """Whether every curve can be followed."""
    best = _numbers(tables).query("outcome == 'arrived'").groupby("curve")["object_rms_m"].min()
    text = ", ".join(f"{curve} {1e3 * best[curve]:.1f} mm" for curve in CURVES if curve in best)
    return outcome(len(best) == len(CURVES) and best.max() < 0.01), f"best RMS of the object: {text}"
