"""The checks that decide the paper's claims on the tables of the studies: each returns an outcome and its numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from studies.paper.ledger import ClaimOutcome, Tables, growth_exponent, outcome
from studies.paper.scene import CURVES

Decision = tuple[ClaimOutcome, str]

FLAT_UNTIL = 0.05
"""Speed up to which the paper finds feedback dynamics flat [m/s]."""

BEST_THRESHOLDS = (0.1, 0.4)
"""Thresholds that the paper finds best for most curves [m]."""

BEST_LOOK_AHEADS = (300, 400)
"""Look-aheads that the paper finds feasible [steps]."""

BREAKING_THRESHOLDS = (0.103, 0.227)
"""Thresholds that break the paper's controller on the lemniscate [m]."""


def contact_converges(tables: Tables) -> Decision:
    """Whether the iteration on the mesh converges to a smaller patch."""
    rows = tables["contact"]
    steps = rows[rows["row"] == "iteration"]
    planes = rows[rows["row"].isin(["mesh plane", "exact plane"])].set_index("row")[["a", "b", "c"]]
    gap = float((planes.loc["mesh plane"] / planes.loc["exact plane"] - 1).abs().max())
    held = steps["residual"].iloc[-1] < 1e-9 and steps["contact"].iloc[-1] < 0.9
    return outcome(held), (
        f"{len(steps)} iterations, residual {steps['residual'].iloc[0]:.1e} to {steps['residual'].iloc[-1]:.1e}; "
        f"{100 * steps['contact'].iloc[-1]:.0f} % of the footprint stay in contact; coefficients within "
        f"{100 * gap:.1f} % of the exact ones by clipping"
    )


def centre_matters(tables: Tables) -> Decision:
    """Whether the rover's paths differ with the centre of mass."""
    spans, settled = {}, {}
    for curve, rows in tables["nominal"].groupby("curve"):
        paths = [part[["hinge_x_m", "hinge_y_m"]].to_numpy() for _, part in rows.groupby("centre")]
        gaps = np.max([np.linalg.norm(a - b, axis=1) for a in paths for b in paths], axis=0)
        spans[curve], settled[curve] = gaps.max(), gaps[-len(gaps) // 4 :].max()
    text = ", ".join(f"{curve} {1e3 * spans[curve]:.0f} ({1e3 * settled[curve]:.1f}) mm" for curve in CURVES)
    return outcome(min(spans.values()) > 0.01), (
        f"greatest distance between the rover's paths at equal times, in brackets over the last quarter: {text}"
    )


def quasistatic_time(tables: Tables) -> Decision:
    """Whether the quasi-static model takes less than a second."""
    times = tables["nominal"].groupby(["curve", "centre"])["compute_time_s"].first()
    steps = int(tables["nominal"]["steps"].max())
    return outcome(times.max() < 1.0), f"{steps:,} steps take {times.min():.2f} to {times.max():.2f} s of one core"


def mesh_costs(tables: Tables) -> Decision:
    """Whether the time grows with the mesh."""
    rows = tables["meshes"]
    meshes = rows[rows["method"] == "mesh"].sort_values("cells")
    exact = float(rows.loc[rows["method"] != "mesh", "seconds"].iloc[0])
    ours = ", ".join(f"{row.cells:,.0f} cells {row.seconds:.3g} s" for row in meshes.itertuples())
    return outcome(bool(meshes["seconds"].is_monotonic_increasing)), (
        f"{ours}; without a mesh {exact:.2f} s, {meshes['seconds'].min() / exact:.0f} to "
        f"{meshes['seconds'].max() / exact:.0f} times less"
    )


def mesh_table(tables: Tables) -> Decision:
    """Whether the paper's seconds are ours."""
    rows = tables["meshes"].dropna(subset=["paper_cells"])
    cells = (rows["cells"] / rows["paper_cells"] - 1).abs().max()
    ratio = rows["seconds"] / rows["paper_seconds"]
    held = bool(ratio.between(0.5, 2.0).all())
    return outcome(held), (
        f"numbers of cells within {100 * cells:.0f} %; our seconds are {ratio.min():.1f} to {ratio.max():.1f} times "
        "those of the paper"
    )


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


def cases_in_both(tables: Tables) -> Decision:
    """Whether cases B and C show in the object's path."""
    rows = tables["loop"]
    gaps = {}
    for name, part in rows[rows["row"] == "object"].groupby("case"):
        nominal = rows[rows["row"] == "nominal object"][["x_m", "y_m"]].to_numpy()
        points = part[["x_m", "y_m"]].to_numpy()
        gaps[name] = float(np.linalg.norm(points[:, None] - nominal, axis=-1).min(axis=1).mean())
    worse = max(gap for name, gap in gaps.items() if name != "A")
    text = ", ".join(f"case {name} {1e3 * gap:.1f} mm" for name, gap in gaps.items())
    return outcome(worse > gaps["A"]), f"mean distance of the object from its nominal path: {text}"


def feedforward_falls(tables: Tables) -> Decision:
    """Whether the error of feedforward falls with the speed."""
    rows = tables["speeds"].sort_values("mean_speed_m_s")
    rms, speed = rows["feedforward_rms_m"], rows["mean_speed_m_s"]
    exponent = growth_exponent(speed, rms)
    return outcome(bool(rms.is_monotonic_increasing) and exponent > 0.5), (
        f"from {rms.iloc[0]:.2g} m at {speed.iloc[0]:g} m/s to {rms.iloc[-1]:.2g} m at {speed.iloc[-1]:g} m/s, as the "
        f"speed to the power {exponent:.2f}"
    )


def feedback_flat(column: str) -> Callable[[Tables], Decision]:
    """Whether an error of feedback, by its column, is flat and then rises."""

    def decide(tables: Tables) -> Decision:
        rows = tables["speeds"].sort_values("mean_speed_m_s")
        slow, fast = rows[rows["mean_speed_m_s"] < FLAT_UNTIL], rows[rows["mean_speed_m_s"] >= FLAT_UNTIL]
        below = growth_exponent(slow["mean_speed_m_s"], slow[column])
        above = growth_exponent(fast["mean_speed_m_s"], fast[column])
        return outcome(abs(below) < 0.3 and above > 1), (
            f"{slow[column].min():.1e} to {slow[column].max():.1e} m below {FLAT_UNTIL} m/s (as the speed to the power "
            f"{below:.2f}), {fast[column].max():.1e} m at most above (power {above:.2f})"
        )

    return decide


def time_step_free(tables: Tables) -> Decision:
    """Whether the errors are free of the time step."""
    rows = tables["time_steps"]
    names = ("feedforward_rms_m", "feedback_rms_m", "feedback_at_rest_length_rms_m")
    spread = max(float(rows[name].max() / rows[name].min() - 1) for name in names)
    steps = rows["time_step_s"]
    return outcome(spread < 0.05), f"RMS changes by {100 * spread:.2g} % from {steps.min():g} to {steps.max():g} s"


def order_of_magnitude(column: str) -> Callable[[Tables], Decision]:
    """Whether feedforward is an order of magnitude above an error of feedback."""

    def decide(tables: Tables) -> Decision:
        row = tables["time_steps"].iloc[0]
        ratio = row["feedforward_rms_m"] / row[column]
        return outcome(
            round(float(np.log10(ratio))) == 1
        ), f"feedforward is {ratio:.1f} times feedback at {row['mean_speed_m_s']:g} m/s"

    return decide


def stiffer_is_closer(column: str) -> Callable[[Tables], Decision]:
    """Whether an error of feedback falls with the stiffness."""

    def decide(tables: Tables) -> Decision:
        rows = tables["stiffnesses"].sort_values("stiffness_n_m")
        exponent = growth_exponent(rows["stiffness_n_m"], rows[column])
        return outcome(exponent < -0.5), (
            f"{rows[column].iloc[0]:.2g} to {rows[column].iloc[-1]:.2g} m from {rows['stiffness_n_m'].iloc[0]:g} to "
            f"{rows['stiffness_n_m'].iloc[-1]:g} N/m, as the stiffness to the power {exponent:.2f}"
        )

    return decide


def stiffer_is_slower(tables: Tables) -> Decision:
    """Whether the computing time grows with the stiffness."""
    rows = tables["stiffnesses"].sort_values("stiffness_n_m")
    upper = rows[rows["stiffness_n_m"] >= 1e3]
    time, steps = upper["feedback_compute_time_s"], upper["feedback_steps"]
    return outcome(bool(steps.is_monotonic_increasing) and time.iloc[-1] > 1.2 * time.iloc[0]), (
        f"from {upper['stiffness_n_m'].iloc[0]:g} to {upper['stiffness_n_m'].iloc[-1]:g} N/m {steps.iloc[0]:.0f} to "
        f"{steps.iloc[-1]:.0f} steps of the integrator, {1e3 * time.iloc[0]:.0f} to {1e3 * time.iloc[-1]:.0f} ms"
    )


def drift_grows(tables: Tables) -> Decision:
    """Whether the drift of feedforward grows with the speed."""
    texts, held = [], True
    for curve, rows in tables["feedforward_paths"].groupby("curve"):
        end = rows[rows["path"] == "nominal"][["x_m", "y_m"]].to_numpy()[-1]
        driven = rows[rows["path"] == "feedforward"].groupby("mean_speed_m_s")[["x_m", "y_m"]].last()
        gap = pd.Series(np.linalg.norm(driven.to_numpy() - end, axis=1), index=driven.index).sort_index()
        held &= bool(gap.is_monotonic_increasing)
        values = ", ".join(f"{1e3 * value:.0f} mm at {speed:g} m/s" for speed, value in gap.items())
        texts.append(f"{curve}: {values} from the end")
    return outcome(held), "; ".join(texts)


def start(law: str) -> Callable[[Tables], Decision]:
    """Whether feedforward fails from rest, with one of the two laws of friction."""

    def decide(tables: Tables) -> Decision:
        rows = tables["starts"].set_index(["law", "start"])["rms_m"]
        rest, matched = rows[law, "rest"], rows[law, "nominal velocity"]
        return outcome(bool(np.isnan(rest) or rest > 10 * matched)), (
            f"RMS {rest:.2g} m from rest, {matched:.2g} m from the nominal velocity"
        )

    return decide


def _numbers(tables: Tables) -> pd.DataFrame:
    rows = tables["thresholds"]
    return rows[rows["row"] == "numbers"]


def best_thresholds(tables: Tables) -> Decision:
    """Whether thresholds from 0.1 to 0.4 m are best for most curves."""
    texts, good = [], 0
    for curve, rows in _numbers(tables).groupby("curve"):
        best = rows.loc[rows["object_rms_m"].idxmin()]
        within = rows[rows["threshold_m"].between(*BEST_THRESHOLDS)]["object_rms_m"].min()
        good += within <= 1.5 * best["object_rms_m"]
        texts.append(
            f"{curve} {1e3 * best['object_rms_m']:.1f} mm at {best['threshold_m']:g} m, {1e3 * within:.1f} mm within"
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
    failed = tables["wheelbases"].assign(failed=lambda table: table["outcome"] != "arrived")
    shares = failed.groupby("wheelbase_m")["failed"].mean()
    sizes = ", ".join(f"{100 * share:.0f} % at {length:g} m" for length, share in shares.items())
    return outcome(all(result != "arrived" for result in found.values())), (
        f"{text}; ours break at {', '.join(f'{value:g}' for value in broken.index)} m, in {away} of {len(broken)} of "
        f"these the first step in case C turns away from the point aimed at; thresholds that fail by wheelbase: {sizes}"
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
    """Whether look-aheads of 300 to 400 steps are feasible."""
    shares = {}
    for curve in ("lemniscate", "rounded_square"):
        rows = _surface(tables, curve)
        shares[curve] = rows.loc[rows["look_ahead_steps"].between(*BEST_LOOK_AHEADS), "arrived"].mean()
    text = ", ".join(f"{curve} {100 * share:.0f} %" for curve, share in shares.items())
    return outcome(min(shares.values()) > 0.5), f"points that arrive with 300 to 400 steps: {text}"


def followed(tables: Tables) -> Decision:
    """Whether every curve can be followed."""
    best = _numbers(tables).query("outcome == 'arrived'").groupby("curve")["object_rms_m"].min()
    text = ", ".join(f"{curve} {1e3 * best[curve]:.1f} mm" for curve in CURVES if curve in best)
    return outcome(len(best) == len(CURVES) and best.max() < 0.01), f"best RMS of the object: {text}"
