"""Checks of the paper's claims about the planner and the closed loop, on the tables of its studies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np
import pandas as pd

from studies.paper.ledger import ClaimOutcome, Tables, outcome
from studies.paper.scene import CURVES

Decision = tuple[ClaimOutcome, str]

BEST_THRESHOLDS = (0.1, 0.4)
"""Thresholds that the paper finds best for most curves [m]."""

BEST_LOOK_AHEADS = (300, 400)
"""Look-aheads that the paper finds feasible [steps]."""

EXACT_M = {0.5: 2e-5, 0.95: 2.5e-4}
"""Distances within which the arcs of half and of 95 % of the steps must pass the point aimed at to reach it exactly
[m]: what the PD control of the steering leaves. A rate of turn that is 20 % wrong misses by 0.2 mm and more."""

LEAST_ADVANTAGE = 0.05
"""By which share of points more must arrive before a look-ahead counts as better."""

AS_GOOD = 1.1
"""An RMS up to this times another is as good."""

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


def detours_where_tight(tables: Tables) -> Decision:
    """Whether the planner is in case B or C over most of the tightest tenth of its steps."""
    rows = tables["loop"]
    rover = rows[rows["row"] == "rover"]
    tight = rover["curvature_1_m"] >= rover["curvature_1_m"].quantile(0.9)
    free = rover["case"] == "A"
    within, beyond = float((~free[tight]).mean()), float((~free[~tight]).mean())
    return outcome(within > 0.5), (
        f"B or C in {100 * within:.0f} % of the tenth of the steps where the path aimed at is tightest, in "
        f"{100 * beyond:.0f} % of the others"
    )


def case_in_object(letter: str) -> Callable[[Tables], Decision]:
    """Whether the object is clearly farther from its path where the rover was in case B or C than in case A.

    The object passes a place a tether's length of travel after the rover: its distance is that to the case then.
    """

    def decide(tables: Tables) -> Decision:
        rows = tables["loop"]
        towed = rows[rows["row"] == "object"]
        delayed, at_once = (towed.groupby(column)["gap_m"].mean() for column in ("case_ahead", "case"))
        texts = [
            ", ".join(f"case {name} {1e3 * gap:.1f} mm" for name, gap in gaps.items()) for gaps in (delayed, at_once)
        ]
        held = delayed.get(letter, 0.0) > max(1.5 * delayed["A"], 1e-3)
        return outcome(bool(held)), (
            f"mean distance of the object from its nominal path a tether's length later: {texts[0]}; at equal times: "
            f"{texts[1]}"
        )

    return decide


def case_a_exact(tables: Tables) -> Decision:
    """Whether the arc of a step in case A, driven on, meets the point aimed at."""
    rows = tables["loop"]
    aims = rows[rows["row"] == "rover"].groupby("case")["miss_m"]
    texts = [
        f"case {name} {1e3 * miss.median():.2g} mm, {1e3 * miss.quantile(0.95):.2g} mm at 95 %, "
        f"{1e3 * miss.max():.2g} mm at most"
        for name, miss in aims
    ]
    held = all(float(aims.quantile(share)["A"]) < limit for share, limit in EXACT_M.items())
    return outcome(held), f"distance at which the arc passes the point aimed at, median: {'; '.join(texts)}"


@dataclass(frozen=True)
class _Detour:
    """A stretch in cases B and C: these in turn, the greatest distance from the path until the next, that left [m]."""

    cases: str
    largest: float
    left: float


def _detours(rover: pd.DataFrame) -> list[_Detour]:
    """The stretches in cases B and C that one in case A follows; what is left is the median of its last quarter."""
    case, gap = rover["case"].to_numpy(), rover["gap_m"].to_numpy()
    free = case == "A"
    bounds = [*np.flatnonzero(np.diff(free, prepend=not free[0])), len(free)]
    found = []
    for (begin, middle), (_, end) in pairwise(pairwise(bounds)):
        if not free[begin]:
            left = float(np.median(gap[middle + 3 * (end - middle) // 4 : end]))
            cases = "".join(name for name, _ in groupby(case[begin:middle]))
            found.append(_Detour(cases, float(gap[begin:end].max()), left))
    return found


def realigns(letter: str) -> Callable[[Tables], Decision]:
    """Whether the rover comes back to its path in case A after each stretch in case B alone, or with case C in it.

    It has to arrive, in case A: else its last stretch has not been followed by one.
    """

    def decide(tables: Tables) -> Decision:
        rows = tables["loop"]
        rover = rows[rows["row"] == "rover"]
        last, result = rover["case"].iloc[-1], rows.loc[rows["row"] == "numbers", "outcome"].iloc[0]
        detours = [detour for detour in _detours(rover) if ("C" in detour.cases) == (letter == "C")]
        held = bool(detours) and all(detour.left < 0.1 * detour.largest for detour in detours)
        pairs = ", ".join(f"{each.cases} {1e3 * each.largest:.0f} to {1e3 * each.left:.2g} mm" for each in detours)
        return outcome(held and last == "A" and result == "arrived"), (
            "greatest distance from the path of each stretch, by its cases in turn, to that late in case A after: "
            f"{pairs or 'no such stretch'}; {result} in case {last}"
        )

    return decide


def _steps_of_curves(tables: Tables) -> tuple[dict[str, pd.DataFrame], str]:
    """Rows of each curve over the planner's time step, the smallest first, and the outermost in words."""
    curves = dict(iter(tables["planner_steps"].sort_values("time_step_s").groupby("curve")))
    texts = [
        f"{curve} {1e3 * rows['rover_rms_m'].iloc[-1]:.2f} mm at {rows['time_step_s'].iloc[-1]:g} s, "
        f"{1e3 * rows['rover_rms_m'].iloc[0]:.2f} mm at {rows['time_step_s'].iloc[0]:g} s"
        for curve, rows in curves.items()
    ]
    return curves, f"RMS of the rover from its nominal path: {'; '.join(texts)}"


def deviation_vanishes(tables: Tables) -> Decision:
    """Whether the deviation from the nominal path tends to zero with the time step."""
    curves, text = _steps_of_curves(tables)
    held = all(
        (rows["outcome"] == "arrived").all() and rows["rover_rms_m"].iloc[0] < 0.5 * rows["rover_rms_m"].iloc[-1]
        for rows in curves.values()
    )
    return outcome(held), text


def deviation_small(tables: Tables) -> Decision:
    """Whether the deviation at the smallest time step is below a hundredth of the curve's width."""
    curves, text = _steps_of_curves(tables)
    paths = tables["thresholds"]
    paths = paths[paths["row"] == "nominal object"].groupby("curve")["x_m"]
    shares = {
        curve: float(rows["rover_rms_m"].iloc[0] / np.ptp(paths.get_group(curve))) for curve, rows in curves.items()
    }
    held = all(shares[curve] < 0.01 and rows["outcome"].iloc[0] == "arrived" for curve, rows in curves.items())
    widths = ", ".join(f"{curve} {100 * share:.2g} %" for curve, share in shares.items())
    return outcome(held), f"{text}; the last in parts of the curve's width: {widths}"


def _numbers(tables: Tables) -> pd.DataFrame:
    rows = tables["thresholds"]
    return rows[rows["row"] == "numbers"]


def _best(rows: pd.DataFrame, least: float = 0.0, most: float = np.inf) -> tuple[float, float]:
    """Least RMS of the object with thresholds in a range that arrive, and the threshold; infinite without one."""
    rows = rows[(rows["outcome"] == "arrived") & rows["threshold_m"].between(least, most)]
    if rows.empty:
        return float("inf"), float("nan")
    best = rows.loc[rows["object_rms_m"].idxmin()]
    return float(best["object_rms_m"]), float(best["threshold_m"])


def _best_of_curves(tables: Tables, *ranges: tuple[float, float]) -> tuple[dict[str, list[tuple[float, float]]], str]:
    """The best of each range of thresholds on each curve, and in words."""
    found = {curve: [_best(rows, *each) for each in ranges] for curve, rows in _numbers(tables).groupby("curve")}
    texts = [
        f"{curve} " + ", ".join(f"{1e3 * rms:.2f} mm at {threshold:g} m" for rms, threshold in best)
        for curve, best in found.items()
    ]
    return found, "; ".join(texts)


def best_thresholds(tables: Tables) -> Decision:
    """Whether on most curves a threshold from 0.1 to 0.4 m is as good as the best of all."""
    found, text = _best_of_curves(tables, (0.0, np.inf), BEST_THRESHOLDS)
    good = sum(within <= AS_GOOD * best < np.inf for (best, _), (within, _) in found.values())
    return outcome(good >= 3), f"best RMS of the object of all thresholds, and of those from 0.1 to 0.4 m: {text}"


def smaller_are_worse(tables: Tables) -> Decision:
    """Whether on most curves thresholds below 0.1 m are worse than those from 0.1 to 0.4 m."""
    found, text = _best_of_curves(tables, (0.0, 0.999 * BEST_THRESHOLDS[0]), BEST_THRESHOLDS)
    worse = sum(below > AS_GOOD * within for (below, _), (within, _) in found.values())
    return outcome(worse >= 3), f"best RMS of the object of thresholds below 0.1 m, and from 0.1 to 0.4 m: {text}"


def larger_are_worse(tables: Tables) -> Decision:
    """Whether on most curves thresholds above 0.4 m are worse than those from 0.1 to 0.4 m."""
    found, text = _best_of_curves(tables, (1.001 * BEST_THRESHOLDS[1], np.inf), BEST_THRESHOLDS)
    worse = sum(above > AS_GOOD * within for (above, _), (within, _) in found.values())
    return outcome(worse >= 3), f"best RMS of the object of thresholds above 0.4 m, and from 0.1 to 0.4 m: {text}"


def lemniscate_erratic(tables: Tables) -> Decision:
    """Whether single thresholds fail on the lemniscate between two that arrive, more than on any other curve."""
    alone, texts = {}, []
    for curve, rows in _numbers(tables).groupby("curve"):
        arrived = (rows.sort_values("threshold_m")["outcome"] == "arrived").to_numpy()
        alone[curve] = int((arrived[:-2] & ~arrived[1:-1] & arrived[2:]).sum())
        ranges = sum(not key for key, _ in groupby(arrived))
        texts.append(f"{curve} {alone[curve]} of {int((~arrived).sum())} in {ranges} ranges")
    most = max(count for curve, count in alone.items() if curve != "lemniscate")
    return outcome(alone["lemniscate"] > most), (
        f"thresholds that fail between two that arrive, of those that fail: {', '.join(texts)}"
    )


def far_centres_break(tables: Tables) -> Decision:
    """Whether the rover uses the tip more where it does not arrive on the lemniscate than where it does."""
    rows = _numbers(tables)
    rows = rows[rows["curve"] == "lemniscate"]
    share = rows.groupby(rows["outcome"] == "arrived")["case_c_share"].median()
    broken, whole = float(share.get(False, np.nan)), float(share.get(True, np.nan))
    return outcome(broken > 2 * whole), (
        f"share of the steps in case C, where a centre far from the one desired is used, median over the thresholds: "
        f"{100 * broken:.0f} % with those that fail, {100 * whole:.0f} % with those that arrive"
    )


def stresses(tables: Tables) -> Decision:
    """Whether the settings of Fig. 5 lead the object much farther off than the best threshold does."""
    rows = tables["loop"]
    shown = float(rows.loc[rows["row"] == "numbers", "object_rms_m"].iloc[0])
    numbers = _numbers(tables)
    best, threshold = _best(numbers[numbers["curve"] == "lemniscate"])
    return outcome(shown > 2 * best), (
        f"RMS of the object {1e3 * shown:.1f} mm, with the look-ahead of Fig. 7 and {threshold:g} m {1e3 * best:.1f} mm"
    )


def breaking_values(tables: Tables) -> Decision:
    """Whether the paper's two thresholds break the controller."""
    rows = _numbers(tables)
    rows = rows[rows["curve"] == "lemniscate"].set_index("threshold_m")
    broken = rows[rows["outcome"] != "arrived"]
    found = {value: rows.loc[value, "outcome"] for value in BREAKING_THRESHOLDS if value in rows.index}
    text = ", ".join(
        f"{value:g} m {result}, RMS of the rover {1e3 * rows.loc[value, 'rover_rms_m']:.1f} mm"
        for value, result in found.items()
    )
    away = int((broken["first_tip_turns_away"] == 1).sum())
    astray = 1e3 * broken["rover_rms_m"]
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
        f"{text}; ours fail at {', '.join(f'{value:g}' for value in broken.index)} m, the rover's RMS then "
        f"{astray.min():.0f} to {astray.max():.0f} mm; in {away} of {len(broken)} the first step in case C turns away "
        f"from the point aimed at; failing by wheelbase: {listed}"
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


def _surface_errors(tables: Tables) -> tuple[pd.DataFrame, tuple[pd.Series, pd.Series]]:
    """RMS of both curves where both arrive, and of each where it arrives."""
    keys = ["threshold", "look_ahead_steps"]
    first, second = (
        rows.loc[rows["arrived"]].set_index(keys)["object_rms_m"]
        for rows in (_surface(tables, curve) for curve in ("lemniscate", "rounded_square"))
    )
    return pd.concat([first, second], axis=1, join="inner", keys=["lemniscate", "square"]), (first, second)


def surface_errors(tables: Tables) -> Decision:
    """Whether the lemniscate's errors are higher where both curves arrive."""
    both, _ = _surface_errors(tables)
    higher = float((both["lemniscate"] > both["square"]).mean())
    return outcome(higher > 0.5), (
        f"higher on the lemniscate at {100 * higher:.0f} % of the {len(both)} points where both arrive, median "
        f"{1e3 * both['lemniscate'].median():.0f} and {1e3 * both['square'].median():.0f} mm"
    )


def surface_errors_of_all(tables: Tables) -> Decision:
    """Whether the lemniscate's errors are higher, each curve over all its points that arrive."""
    _, (first, second) = _surface_errors(tables)
    return outcome(first.median() > second.median()), (
        f"median over all points that arrive: lemniscate {1e3 * first.median():.0f} mm, rounded square "
        f"{1e3 * second.median():.0f} mm"
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


def look_ahead_helps(tables: Tables) -> Decision:
    """Whether with a look-ahead the rover is more often in case A than without."""
    texts, held = [], True
    for curve in ("lemniscate", "rounded_square"):
        rows = _surface(tables, curve)
        ahead = rows["look_ahead_steps"].between(*BEST_LOOK_AHEADS)
        without = rows["look_ahead_steps"] == rows["look_ahead_steps"].min()
        shares = [float(rows.loc[chosen, "case_a_share"].mean()) for chosen in (ahead, without)]
        held &= shares[0] > shares[1] + LEAST_ADVANTAGE
        texts.append(f"{curve} {100 * shares[0]:.0f} % with, {100 * shares[1]:.0f} % without")
    return outcome(held), f"steps in case A with and without a look-ahead of 300 to 400 steps: {'; '.join(texts)}"


def followed(tables: Tables) -> Decision:
    """Whether every curve can be followed."""
    best = _numbers(tables).query("outcome == 'arrived'").groupby("curve")["object_rms_m"].min()
    text = ", ".join(f"{curve} {1e3 * best[curve]:.1f} mm" for curve in CURVES if curve in best)
    return outcome(len(best) == len(CURVES) and best.max() < 0.01), f"best RMS of the object: {text}"
