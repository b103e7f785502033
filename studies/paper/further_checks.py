"""Checks of single sentences of the paper, on the table of :mod:`studies.paper.further`."""

from __future__ import annotations

import numpy as np
import pandas as pd

from studies.paper.ledger import ClaimOutcome, Tables, outcome

Decision = tuple[ClaimOutcome, str]


def _part(tables: Tables, name: str) -> pd.DataFrame:
    rows = tables["further"]
    return rows[rows["row"] == name]


def limits_matter(tables: Tables) -> Decision:
    """Whether the rover deviates at least twice as much with its steering limits as without."""
    rows = _part(tables, "limits").set_index("steering")
    limited, free = (1e3 * float(rows.loc[name, "rover_rms_m"]) for name in ("limited", "unlimited"))
    arrived = bool((rows["outcome"] == "arrived").all())
    return outcome(arrived and limited > 2 * free), (
        f"RMS of the rover {limited:.1f} mm with the limits, {free:.1f} mm without"
    )


def tight_turns_fail(tables: Tables) -> Decision:
    """Whether on a lemniscate twice as wide at most half as many thresholds fail."""
    rows = _part(tables, "wider")
    failed = (rows["outcome"] != "arrived").groupby(rows["width_m"]).sum().sort_index()
    text = ", ".join(f"{count} of {(rows['width_m'] == width).sum()} at {width:g} m" for width, count in failed.items())
    return outcome(failed.iloc[0] > 0 and failed.iloc[-1] <= 0.5 * failed.iloc[0]), (
        f"thresholds that fail by the width of the lemniscate: {text}"
    )


def _disturbed(tables: Tables, name: str) -> tuple[float, float]:
    rows = _part(tables, "disturbed")
    rows = rows[rows["dynamics"] == name].sort_values("friction")
    return float(rows["rms_m"].iloc[0]), float(rows["rms_m"].iloc[-1])


def spring_corrects(tables: Tables) -> Decision:
    """Whether feedback stays within a millimetre of its path on a floor with a little less friction."""
    less, planned = _disturbed(tables, "feedback")
    return outcome(less < 1e-3), (
        f"RMS of feedback {1e3 * less:.2g} mm with 1 % less friction than planned, {1e3 * planned:.2g} mm with that "
        f"planned"
    )


def blind_force_exacerbates(tables: Tables) -> Decision:
    """Whether feedforward is ten times as far off on a floor with a little less friction."""
    less, planned = _disturbed(tables, "feedforward")
    return outcome(less > 10 * planned), (
        f"RMS of feedforward {less:.2g} m with 1 % less friction than planned, {planned:.2g} m with that planned"
    )


def law_meets_numbers(tables: Tables) -> Decision:
    """Whether Makkar's law has the peak, its speed, the plateau and the remainder that are asked for."""
    row = _part(tables, "law").iloc[0]
    off = {name: abs(float(row[name]) - 1) for name in ("static", "stiction_velocity", "kinetic")}
    left = float(row["left_at_friction_velocity"])
    return outcome(max(off.values()) < 0.01 and left < 0.011), (
        f"peak within {100 * off['static']:.2g} % of μ_s, {100 * off['stiction_velocity']:.2g} % from v_s, plateau "
        f"within {100 * off['kinetic']:.2g} % of μ_k, {100 * left:.2g} % of the rise left at v_k"
    )


def continuity_counts(tables: Tables) -> Decision:
    """Whether every solver gets through with a continuous law, and none with one that jumps at rest."""
    rows = _part(tables, "law_shapes").set_index(["law", "solver"])
    through, stuck = rows.loc["kink", "ended"], rows.loc["jump", "ended"]
    got = ", ".join(f"{solver} {reached:.1e} s" for solver, reached in rows.loc["jump", "reached_s"].items())
    return outcome(bool(through.all() and not stuck.any())), (
        f"{through.sum():.0f} of {len(through)} solvers get through with a law that is continuous, {stuck.sum():.0f} "
        f"with one that jumps: {got}"
    )


def differentiability_counts(tables: Tables) -> Decision:
    """Whether every solver takes twice the evaluations with a kink in the law, or does not get through."""
    rows = _part(tables, "law_shapes").set_index(["law", "solver"])
    ended = rows["ended"] == 1
    taken = rows["evaluations"].where(ended, np.inf)
    ratio = taken.loc["kink"] / taken.loc["smooth"]
    text = ", ".join(f"{solver} {times:.2f} times" for solver, times in ratio.items())
    return outcome(bool(ended.loc["smooth"].all() and (ratio > 2).all())), (
        f"evaluations with a kink, of those with the smooth law: {text}"
    )


def four_wheels_misalign(tables: Tables) -> Decision:
    """Whether four wheels under their own PD control roll apart on the way to a turn, the bicycle's not."""
    rows = _part(tables, "steered").set_index("control")["misaligned_rad"]
    four, bicycle = rows["four wheels"], rows["bicycle"]
    return outcome(four > 0.01 and bicycle < 1e-9), (
        f"halfway to the tightest turn a wheel is up to {1e3 * four:.0f} mrad from the motion that suits all best, "
        f"{1e3 * bicycle:.0e} mrad with the bicycle's control"
    )


def smaller_areas(tables: Tables) -> Decision:
    """Whether the feasible centres form areas beside the flanks, all smaller, one under the rover."""
    rows = _part(tables, "areas")
    flank, other = rows[rows["area"] == "flank"], rows[rows["area"] == "other"]
    under = other[other["under_the_rover"] == 1]
    held = len(flank) == 2 and len(under) > 0 and other["size_m2"].max() < 0.1 * flank["size_m2"].min()
    return outcome(held), (
        f"{len(flank)} flanks of {flank['size_m2'].min():.1f} m² within 6 m, {len(other)} other areas of "
        f"{other['size_m2'].min():.2g} to {other['size_m2'].max():.2g} m², {len(under)} of them under the rover"
    )


def centre_moves_within(tables: Tables) -> Decision:
    """Whether the straight way between two centres of one flank is feasible."""
    rows = _part(tables, "areas")
    share = float(rows.loc[rows["area"] == "segments", "feasible"].iloc[0])
    return outcome(share == 1), f"{100 * share:.0f} % of 1000 straight ways between centres are feasible throughout"


def pressure_stays(tables: Tables) -> Decision:
    """Whether the motion is the same with the pressure computed once and solved anew at every instant."""
    row = _part(tables, "plane").iloc[0]
    force, heading = float(row["force_apart"]), float(row["heading_apart_rad"])
    return outcome(force < 1e-6 and heading < 1e-6), (
        f"tow force within {force:.0e} of the weight, heading within {heading:.0e} rad"
    )


def friction_by_direction(tables: Tables) -> Decision:
    """Whether friction across the body is what it is asked to be over that along it."""
    row = _part(tables, "direction").iloc[0]
    ratio = float(row["across_n"] / row["along_n"])
    return outcome(
        abs(ratio - 1.1) < 1e-3
    ), f"friction across the body is {ratio:.3f} times that along it; 1.1 asked for"
