"""The claims of the paper, one by one, in the order in which it makes them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from towval.study.claims import Claim, ClaimOutcome, Tables, growth_exponent, outcome, undecided
from towval.study.paper_scene import CURVES

Decision = tuple[ClaimOutcome, str]

FLAT_UNTIL = 0.05
"""Speed up to which the paper finds feedback dynamics flat [m/s]."""

BEST_THRESHOLDS = (0.1, 0.4)
"""Thresholds that the paper finds best for most curves [m]."""

BEST_LOOK_AHEADS = (300, 400)
"""Look-aheads that the paper finds feasible [steps]."""

BREAKING_THRESHOLDS = (0.103, 0.227)
"""Thresholds that break the paper's controller on the lemniscate [m]."""


def _contact_converges(tables: Tables) -> Decision:
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


def _centre_matters(tables: Tables) -> Decision:
    spans = {}
    for curve, rows in tables["nominal"].groupby("curve"):
        ways = [part[["hinge_x_m", "hinge_y_m"]].to_numpy() for _, part in rows.groupby("centre")]
        spans[curve] = max(np.linalg.norm(a - b, axis=1).max() for a in ways for b in ways)
    text = ", ".join(f"{curve} {spans[curve]:.2f} m" for curve in CURVES)
    return outcome(min(spans.values()) > 0.01), f"greatest distance between the rover's ways at equal times: {text}"


def _quasistatic_time(tables: Tables) -> Decision:
    times = tables["nominal"].groupby(["curve", "centre"])["compute_time_s"].first()
    steps = int(tables["nominal"]["steps"].max())
    return outcome(times.max() < 1.0), f"{steps:,} steps take {times.min():.2f} to {times.max():.2f} s of one core"


def _mesh_costs(tables: Tables) -> Decision:
    rows = tables["meshes"]
    meshes = rows[rows["method"] == "mesh"].sort_values("cells")
    exact = float(rows.loc[rows["method"] != "mesh", "seconds"].iloc[0])
    ours = ", ".join(f"{row.cells:,.0f} cells {row.seconds:.3g} s" for row in meshes.itertuples())
    return outcome(bool(meshes["seconds"].is_monotonic_increasing)), (
        f"{ours}; without a mesh {exact:.2f} s, {meshes['seconds'].min() / exact:.0f} to "
        f"{meshes['seconds'].max() / exact:.0f} times less"
    )


def _mesh_table(tables: Tables) -> Decision:
    rows = tables["meshes"].dropna(subset=["paper_cells"])
    cells = (rows["cells"] / rows["paper_cells"] - 1).abs().max()
    ratio = rows["seconds"] / rows["paper_seconds"]
    held = bool(ratio.between(0.5, 2.0).all())
    return outcome(held), (
        f"numbers of cells within {100 * cells:.0f} %; our seconds are {ratio.min():.1f} to {ratio.max():.1f} times the "
        "paper's"
    )


def _mostly_case_a(tables: Tables) -> Decision:
    rows = tables["loop"]
    numbers = rows[rows["row"] == "numbers"].iloc[0]
    case = rows.loc[rows["row"] == "rover", "case"].to_numpy()
    changes = int((case[1:] != case[:-1]).sum())
    shares = {name: float(numbers[f"case_{name.lower()}_share"]) for name in "ABC"}
    held = shares["A"] > 0.5 and min(shares.values()) > 0 and changes >= 3
    text = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
    return outcome(held), f"{text} of the steps, {changes} changes of case; {numbers['outcome']}"


def _cases_in_both(tables: Tables) -> Decision:
    rows = tables["loop"]
    gaps = {}
    for name, part in rows[rows["row"] == "object"].groupby("case"):
        nominal = rows[rows["row"] == "nominal object"][["x_m", "y_m"]].to_numpy()
        points = part[["x_m", "y_m"]].to_numpy()
        gaps[name] = float(np.linalg.norm(points[:, None] - nominal, axis=-1).min(axis=1).mean())
    worse = max(gap for name, gap in gaps.items() if name != "A")
    text = ", ".join(f"case {name} {1e3 * gap:.1f} mm" for name, gap in gaps.items())
    return outcome(worse > gaps["A"]), f"mean distance of the object from its nominal path: {text}"


def _feedforward_falls(tables: Tables) -> Decision:
    rows = tables["speeds"].sort_values("mean_speed_m_s")
    rms, speed = rows["feedforward_rms_m"], rows["mean_speed_m_s"]
    exponent = growth_exponent(speed, rms)
    return outcome(bool(rms.is_monotonic_increasing) and exponent > 0.5), (
        f"from {rms.iloc[0]:.2g} m at {speed.iloc[0]:g} m/s to {rms.iloc[-1]:.2g} m at {speed.iloc[-1]:g} m/s, as the "
        f"speed to the power {exponent:.2f}"
    )


def _feedback_flat(column: str) -> Callable[[Tables], Decision]:
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


def _time_step_free(tables: Tables) -> Decision:
    rows = tables["time_steps"]
    names = ("feedforward_rms_m", "feedback_rms_m", "feedback_at_rest_length_rms_m")
    spread = max(float(rows[name].max() / rows[name].min() - 1) for name in names)
    steps = rows["time_step_s"]
    return outcome(spread < 0.05), f"RMS changes by {100 * spread:.2g} % from {steps.min():g} to {steps.max():g} s"


def _order_of_magnitude(column: str) -> Callable[[Tables], Decision]:
    def decide(tables: Tables) -> Decision:
        row = tables["time_steps"].iloc[0]
        ratio = row["feedforward_rms_m"] / row[column]
        return outcome(3 <= ratio <= 30), f"feedforward is {ratio:.1f} times feedback at {row['mean_speed_m_s']:g} m/s"

    return decide


def _stiffer_is_closer(column: str) -> Callable[[Tables], Decision]:
    def decide(tables: Tables) -> Decision:
        rows = tables["stiffnesses"].sort_values("stiffness_n_m")
        exponent = growth_exponent(rows["stiffness_n_m"], rows[column])
        return outcome(exponent < -0.5), (
            f"{rows[column].iloc[0]:.2g} to {rows[column].iloc[-1]:.2g} m from {rows['stiffness_n_m'].iloc[0]:g} to "
            f"{rows['stiffness_n_m'].iloc[-1]:g} N/m, as the stiffness to the power {exponent:.2f}"
        )

    return decide


def _stiffer_is_slower(tables: Tables) -> Decision:
    rows = tables["stiffnesses"].sort_values("stiffness_n_m")
    upper = rows[rows["stiffness_n_m"] >= 1e3]
    time, steps = upper["feedback_compute_time_s"], upper["feedback_steps"]
    return outcome(bool(steps.is_monotonic_increasing) and time.iloc[-1] > 1.2 * time.iloc[0]), (
        f"from {upper['stiffness_n_m'].iloc[0]:g} to {upper['stiffness_n_m'].iloc[-1]:g} N/m {steps.iloc[0]:.0f} to "
        f"{steps.iloc[-1]:.0f} steps of the integrator, {1e3 * time.iloc[0]:.0f} to {1e3 * time.iloc[-1]:.0f} ms"
    )


def _drift_grows(tables: Tables) -> Decision:
    texts, held = [], True
    for curve, rows in tables["feedforward_paths"].groupby("curve"):
        end = rows[rows["path"] == "nominal"][["x_m", "y_m"]].to_numpy()[-1]
        driven = rows[rows["path"] == "feedforward"].groupby("mean_speed_m_s")[["x_m", "y_m"]].last()
        gap = pd.Series(np.linalg.norm(driven.to_numpy() - end, axis=1), index=driven.index).sort_index()
        held &= bool(gap.is_monotonic_increasing)
        values = ", ".join(f"{1e3 * value:.0f} mm at {speed:g} m/s" for speed, value in gap.items())
        texts.append(f"{curve}: {values} from the end")
    return outcome(held), "; ".join(texts)


def _start(law: str) -> Callable[[Tables], Decision]:
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


def _best_thresholds(tables: Tables) -> Decision:
    texts, good = [], 0
    for curve, rows in _numbers(tables).groupby("curve"):
        best = rows.loc[rows["object_rms_m"].idxmin()]
        within = rows[rows["threshold_m"].between(*BEST_THRESHOLDS)]["object_rms_m"].min()
        good += within <= 1.5 * best["object_rms_m"]
        texts.append(
            f"{curve} {1e3 * best['object_rms_m']:.1f} mm at {best['threshold_m']:g} m, {1e3 * within:.1f} mm within"
        )
    return outcome(good >= 3), f"best RMS of the object, and best within 0.1 to 0.4 m: {'; '.join(texts)}"


def _lemniscate_erratic(tables: Tables) -> Decision:
    counts = {}
    for curve, rows in _numbers(tables).groupby("curve"):
        arrived = (rows.sort_values("threshold_m")["outcome"] == "arrived").to_numpy()
        counts[curve] = (int((~arrived).sum()), int((arrived[1:] != arrived[:-1]).sum()))
    others = [count for curve, count in counts.items() if curve != "lemniscate"]
    held = all(counts["lemniscate"] > other for other in others)
    text = ", ".join(f"{curve} {failed} ({changes})" for curve, (failed, changes) in counts.items())
    return outcome(held), f"thresholds that do not arrive (changes between arriving and not): {text}"


def _breaking_values(tables: Tables) -> Decision:
    rows = _numbers(tables)
    rows = rows[rows["curve"] == "lemniscate"].set_index("threshold_m")
    broken = rows[rows["outcome"] != "arrived"].index
    found = {value: rows.loc[value, "outcome"] for value in BREAKING_THRESHOLDS if value in rows.index}
    text = ", ".join(f"{value:g} m {result}" for value, result in found.items())
    return outcome(all(result != "arrived" for result in found.values())), (
        f"{text}; ours break at {', '.join(f'{value:g}' for value in broken)} m"
    )


def _surface(tables: Tables, curve: str) -> pd.DataFrame:
    rows = tables["surface"][tables["surface"]["curve"] == curve]
    return rows.assign(arrived=rows["outcome"] == "arrived")


def _jaggedness(rows: pd.DataFrame) -> float:
    """Length of the border between arriving and not, in cell sides, over the square root of the arriving cells."""
    grid = rows.pivot_table(index="look_ahead_steps", columns="threshold", values="arrived").to_numpy() > 0
    border = (grid[1:] != grid[:-1]).sum() + (grid[:, 1:] != grid[:, :-1]).sum()
    return float(border / np.sqrt(grid.sum()))


def _surface_compared(tables: Tables) -> Decision:
    pair = [_surface(tables, curve) for curve in ("lemniscate", "rounded_square")]
    area = [float(rows["arrived"].mean()) for rows in pair]
    border = [_jaggedness(rows) for rows in pair]
    rms = [float(rows.loc[rows["arrived"], "object_rms_m"].median()) for rows in pair]
    held = area[0] < area[1] and border[0] > border[1] and rms[0] > rms[1]
    return outcome(held), (
        f"lemniscate against rounded square: {100 * area[0]:.0f} and {100 * area[1]:.0f} % arrive, border "
        f"{border[0]:.1f} and {border[1]:.1f}, median RMS {1e3 * rms[0]:.0f} and {1e3 * rms[1]:.0f} mm"
    )


def _surface_band(tables: Tables) -> Decision:
    shares = {}
    for curve in ("lemniscate", "rounded_square"):
        rows = _surface(tables, curve)
        shares[curve] = rows.loc[rows["look_ahead_steps"].between(*BEST_LOOK_AHEADS), "arrived"].mean()
    text = ", ".join(f"{curve} {100 * share:.0f} %" for curve, share in shares.items())
    return outcome(min(shares.values()) > 0.5), f"points that arrive with 300 to 400 steps: {text}"


def _followed(tables: Tables) -> Decision:
    best = _numbers(tables).query("outcome == 'arrived'").groupby("curve")["object_rms_m"].min()
    text = ", ".join(f"{curve} {1e3 * best[curve]:.1f} mm" for curve in CURVES if curve in best)
    return outcome(len(best) == len(CURVES) and best.max() < 0.01), f"best RMS of the object: {text}"


STRETCH = (
    "The paper does not say whether its rover path contains the stretch |T|/κ of the tether. With the hinge at the "
    "rest length the object trails by that stretch at any speed, which gives the paper's flat curve and its dependence "
    "on κ; with the hinge where the stretched tether ends, the formula of the model, that lag is gone and only inertia "
    "is left."
)

CLAIMS = (
    Claim(
        "contact converges",
        "2.1, Fig. 2",
        "Excluding the part in traction again and again, the residual converges and a reduced contact patch is left.",
        "The residual ends below 1e-9 of the load and less than 90 % of the footprint stay in contact.",
        _contact_converges,
    ),
    Claim(
        "centre of mass matters",
        "3.1, Fig. 4",
        "A nonbarycentric place of gravity influences the path that the rover takes.",
        "The rover's ways for G1, G2 and G3 differ by more than 1 cm on every curve.",
        _centre_matters,
        "The object starts as its bare footprint would settle; on the line and between corners the ways meet again.",
    ),
    Claim(
        "no rule for the centre of mass",
        "3.1, Fig. 4",
        "No clear indication of the path of the rover can be inferred from the location of G.",
        "None: the statement names no quantity.",
        undecided("the paper says neither what would be an indication nor how clear it would have to be"),
    ),
    Claim(
        "planner stays in case A",
        "3.1, Fig. 5",
        "The planner stays in case A most of the time and changes to B or C in the most challenging segments.",
        "More than half of the steps are A, B and C occur, and the case changes three times or more.",
        _mostly_case_a,
    ),
    Claim(
        "cases show in the object's path",
        "3.1, Fig. 5",
        "Cases B and C of the rover are reflected in the real trajectory of the object.",
        "The object is farther from its nominal path in cases B or C than in case A.",
        _cases_in_both,
    ),
    Claim(
        "mesh sets the computing time",
        "3.2, Table 1",
        "The influence of the mesh on the computation time of the quasi-static model is noticeable.",
        "The time grows with the number of cells.",
        _mesh_costs,
    ),
    Claim(
        "seconds of Table 1",
        "3.2, Table 1",
        "132,900 to 1,322 cells take 47.6 to 4.5 s.",
        "Our mesh with as many cells takes between half and twice as long.",
        _mesh_table,
        "Ours are 60,000 solves of the moment balance, the mesh summed in compiled code, linear in the number of cells. "
        "The paper's seconds grow much slower than its cells: 0.8 ms a step for 132,900 cells leave 6 ns a cell, not "
        "enough for the tanh terms of its own law, so the finest meshes there cannot have been summed at each of 60,000 "
        "steps. How many steps were timed is not said.",
    ),
    Claim(
        "quasi-static model is fast",
        "3.1",
        "The quasi-static model can be used to synthesise trajectories (10 min in steps of 10 ms).",
        "60,000 steps of every path take less than a second with the exact wrench.",
        _quasistatic_time,
    ),
    Claim(
        "feedforward falls with speed",
        "3.2, Fig. 6(a)",
        "The RMS of feedforward dynamics decreases substantially with smaller mean speeds.",
        "It falls with the speed throughout, faster than its square root.",
        _feedforward_falls,
    ),
    Claim(
        "feedback flat, hinge at rest length",
        "3.2, Fig. 6(a)",
        "The RMS of feedback dynamics is low and roughly constant, and increases only above 5e-2 m/s.",
        "Below 5e-2 m/s it depends on the speed with a power under 0.3 in size, above with a power over 1.",
        _feedback_flat("feedback_at_rest_length_rms_m"),
        STRETCH,
    ),
    Claim(
        "feedback flat, hinge at stretched length",
        "3.2, Fig. 6(a)",
        "The RMS of feedback dynamics is low and roughly constant, and increases only above 5e-2 m/s.",
        "As above.",
        _feedback_flat("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "time step does not matter",
        "3.2, Fig. 6(b)",
        "At 5.1e-3 m/s no substantial variation of the RMS occurs with the time step.",
        "All RMS stay within 5 % over the time steps.",
        _time_step_free,
    ),
    Claim(
        "an order of magnitude, hinge at rest length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by an order of magnitude at 5.1e-3 m/s.",
        "Their ratio is between 3 and 30.",
        _order_of_magnitude("feedback_at_rest_length_rms_m"),
        STRETCH + " The ratio is that of our assumed stiffness.",
    ),
    Claim(
        "an order of magnitude, hinge at stretched length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by an order of magnitude at 5.1e-3 m/s.",
        "Their ratio is between 3 and 30.",
        _order_of_magnitude("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is closer, hinge at rest length",
        "3.2, Fig. 6(c)",
        "Larger κ leads to smaller RMS.",
        "The RMS falls with the stiffness with a power below -0.5.",
        _stiffer_is_closer("feedback_at_rest_length_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is closer, hinge at stretched length",
        "3.2, Fig. 6(c)",
        "Larger κ leads to smaller RMS.",
        "The RMS falls with the stiffness with a power below -0.5.",
        _stiffer_is_closer("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is slower",
        "3.2, Fig. 6(c)",
        "Larger κ leads to higher computational time: the model is numerically stiff.",
        "From 1e3 N/m on the integrator's steps grow with the stiffness, and the time by a fifth or more.",
        _stiffer_is_slower,
        "An implicit method with an exact Jacobian takes the stiffness with few more steps; the paper used ode15s.",
    ),
    Claim(
        "feedforward drift grows",
        "3.2, Fig. 6(d), (e)",
        "Feedforward trajectories drift more as the speed increases.",
        "On both curves the object's end is the farther from the nominal end, the faster it goes.",
        _drift_grows,
    ),
    Claim(
        "feedforward fails from rest, friction with a peak",
        "3.2",
        "Feedforward is unstable when it starts from rest; with the nominal initial velocity it is not.",
        "From rest the RMS is more than ten times that with the nominal velocity.",
        _start("peaked_friction"),
        "At rest the force of the quasi-static model, the kinetic friction, is less than the static peak: the object "
        "stays, and then goes where the force points later.",
    ),
    Claim(
        "feedforward fails from rest, friction without a peak",
        "3.2",
        "Feedforward is unstable when it starts from rest; with the nominal initial velocity it is not.",
        "From rest the RMS is more than ten times that with the nominal velocity.",
        _start("friction"),
        "Without a static peak nothing holds the object back: the failure is the peak's, not that of the start.",
    ),
    Claim(
        "best thresholds",
        "3.2, Fig. 7",
        "For most cases thresholds d_t between 0.1 m and 0.4 m give the best results.",
        "On three curves or more the best RMS within 0.1 to 0.4 m is at most 1.5 times the best of all.",
        _best_thresholds,
    ),
    Claim(
        "lemniscate is erratic",
        "3.2, Fig. 7",
        "The lemniscate shows a more unpredictable behaviour than the other curves.",
        "More thresholds fail on it, and more often next to one that arrives, than on any other curve.",
        _lemniscate_erratic,
    ),
    Claim(
        "single thresholds break the controller",
        "3.2, Fig. 7",
        "d_t = 0.227 m and 0.103 m break the controller on the lemniscate.",
        "The rover does not arrive with these two values.",
        _breaking_values,
        "Which values break it depends on wheelbase, track, footprint, load and speed, none of which the paper gives. "
        "With a wheelbase of 0.5 m in place of 0.4 m, for instance, most thresholds fail.",
    ),
    Claim(
        "feasible areas",
        "3.2, Fig. 8",
        "The feasible area of the lemniscate is smaller, more jagged and has higher RMS than that of the rounded square.",
        "Fewer points arrive, their border is longer for the area, and their median RMS is higher.",
        _surface_compared,
    ),
    Claim(
        "feasible look-aheads",
        "3.2, Fig. 8",
        "ϑ_lh of 300 to 400 steps and d_t from 0 to 1.5 m give feasible results.",
        "More than half of these points arrive, on both curves.",
        _surface_band,
        "The length of the paper's step is not given; ours is 0.1 s of the 600 s that each curve takes.",
    ),
    Claim(
        "towing along a path works",
        "5",
        "The approach can be used successfully for path planning of the towed object.",
        "On every curve a threshold exists with which the rover arrives and the object's RMS is below 1 cm.",
        _followed,
    ),
    Claim(
        "friction coefficient",
        "4",
        "μ between object and pavement is 0.34 to 0.36.",
        "None on our numbers.",
        undecided("a measurement of the authors' objects; it is an input here"),
    ),
    Claim(
        "experiments agree with simulation",
        "4, Fig. 10",
        "Simulated and measured object paths adhere remarkably in four runs.",
        "None on these tables.",
        undecided(
            "the authors' footage is not public; results/<campaign>/summary.csv has the verdict for any footage at hand"
        ),
    ),
)
"""All claims, in the order of the paper."""
