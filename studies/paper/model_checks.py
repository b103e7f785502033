"""Checks of the paper's claims about the models, on the tables of its studies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from studies.paper.ledger import ClaimOutcome, Tables, growth_exponent, outcome
from studies.paper.scene import CURVES
from towval.model import Array

Decision = tuple[ClaimOutcome, str]

FLAT_UNTIL = 0.05
"""Speed up to which the paper finds feedback dynamics flat [m/s]."""

SHOWS_M = 0.02
"""Error of feedforward dynamics that shows in a figure of the paper's, whose curves are 2 and 4 m wide [m]."""


def contact_converges(tables: Tables) -> Decision:
    """Whether the iteration ends at forces that balance the load, push everywhere, and act on less than the footprint.

    Equilibrium is taken anew from the forces of the cells at their centroids, not from the iteration's own residual.
    """
    rows = tables["contact"]
    steps, cells, load = (rows[rows["row"] == kind] for kind in ("iteration", "cell", "load"))
    force = cells["force_n"].to_numpy()
    centroids = np.column_stack([cells[["x0", "x1", "x2"]].mean(axis=1), cells[["y0", "y1", "y2"]].mean(axis=1)])
    weight = float(load["force_n"].iloc[0])
    lever = centroids - load[["x0", "y0"]].to_numpy()[0]
    size = float(np.ptp(centroids, axis=0).max())
    unbalanced = max(abs(force.sum() / weight - 1), np.abs(force @ lever).max() / (weight * size))
    share = float(steps["contact"].iloc[-1])
    exact = _ring_area(rows[rows["row"] == "exact"]) / _triangle_areas(cells).sum()
    apart = _pressure_apart(rows, centroids)
    close = abs(share / exact - 1) < 0.02 and apart < 0.01
    held = unbalanced < 1e-9 and force.min() >= 0 and share < 0.9 and close
    return outcome(held), (
        f"{len(steps)} iterations; force and moments of the cells balance the load to {unbalanced:.0e} of it, the "
        f"least force is {force.min():.1g} N; {100 * share:.1f} % of the footprint stay in contact, "
        f"{100 * exact:.1f} % by exact clipping; the two pressures are {100 * apart:.1f} % of the greatest apart"
    )


def _pressure_apart(rows: pd.DataFrame, places: Array) -> float:
    """Greatest difference of the pressures of mesh and exact plane, over the greatest exact pressure."""
    planes = rows.set_index("row").loc[["mesh plane", "exact plane"], ["a", "b", "c"]].to_numpy()
    mesh, exact = np.maximum(0.0, planes[:, :2] @ places.T + planes[:, 2:])
    return float(np.abs(mesh - exact).max() / exact.max())


def _triangle_areas(cells: pd.DataFrame) -> Array:
    ax, ay, bx, by, cx, cy = (cells[name].to_numpy() for name in ("x0", "y0", "x1", "y1", "x2", "y2"))
    return 0.5 * np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))


def _ring_area(corners: pd.DataFrame) -> float:
    """Area of rings of corners by the shoelace formula."""
    areas = []
    for _, ring in corners.groupby("number"):
        x, y = ring["x0"].to_numpy(), ring["y0"].to_numpy()
        areas.append(0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))))
    return sum(areas)


def centre_matters(tables: Tables) -> Decision:
    """Whether the rover's paths differ with the centre of mass."""
    spans, settled = {}, {}
    for curve, rows in tables["nominal"].groupby("curve"):
        paths = [part[["hinge_x_m", "hinge_y_m"]].to_numpy() for _, part in rows.groupby("centre")]
        gaps = np.max([np.linalg.norm(a - b, axis=1) for a in paths for b in paths], axis=0)
        spans[curve], settled[curve] = gaps.max(), gaps[-len(gaps) // 4 :].max()
    text = ", ".join(f"{curve} {1e3 * settled[curve]:.1f} ({1e3 * spans[curve]:.0f}) mm" for curve in CURVES)
    turning = [gap for curve, gap in settled.items() if curve != "line"]
    return outcome(min(turning) > 0.01), (
        "greatest distance between the rover's paths at equal times over the last quarter, in brackets over all: "
        f"{text}"
    )


def mesh_costs(tables: Tables) -> Decision:
    """Whether the time grows with the mesh, to more than twice."""
    rows = tables["meshes"]
    meshes = rows[rows["method"] == "mesh"].sort_values("cells")
    exact = float(rows.loc[rows["method"] != "mesh", "seconds"].iloc[0])
    ours = ", ".join(f"{row.cells:,.0f} cells {row.seconds:.3g} s" for row in meshes.itertuples())
    seconds = meshes["seconds"]
    held = bool(seconds.is_monotonic_increasing) and seconds.iloc[-1] > 2 * seconds.iloc[0]
    return outcome(held), (
        f"{ours}; without a mesh, and with few solves, {exact:.2f} s, {meshes['seconds'].min() / exact:.0f} to "
        f"{meshes['seconds'].max() / exact:.0f} times less"
    )


def mesh_table(tables: Tables) -> Decision:
    """Our seconds beside the paper's: another machine, and a number of steps that the paper does not state."""
    rows = tables["meshes"].dropna(subset=["paper_cells"])
    cells = (rows["cells"] / rows["paper_cells"] - 1).abs().max()
    ratio = rows["seconds"] / rows["paper_seconds"]
    growth = [growth_exponent(rows["cells"], rows[name]) for name in ("seconds", "paper_seconds")]
    return ClaimOutcome.UNDECIDED, (
        f"numbers of cells within {100 * cells:.1f} %; our seconds, on another machine, are {ratio.min():.1f} to "
        f"{ratio.max():.1f} times those of the paper and grow as the cells to the power {growth[0]:.2f}, those of the "
        f"paper to the power {growth[1]:.2f}"
    )


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


def stiffer_is_slower(name: str) -> Callable[[Tables], Decision]:
    """Whether feedback, by the start of its columns, takes longest with the greatest stiffness."""

    def decide(tables: Tables) -> Decision:
        rows = tables["stiffnesses"].sort_values("stiffness_n_m")
        time, steps = rows[f"{name}_compute_time_s"], rows[f"{name}_steps"]
        listed = ", ".join(f"{count:.0f}" for count in steps)
        return outcome(bool(steps.iloc[-1] > steps.iloc[:-1].max()) and time.iloc[-1] > 1.2 * time.iloc[0]), (
            f"{listed} steps of the integrator from {rows['stiffness_n_m'].iloc[0]:g} to "
            f"{rows['stiffness_n_m'].iloc[-1]:g} N/m, {1e3 * time.iloc[0]:.0f} to {1e3 * time.iloc[-1]:.0f} ms"
        )

    return decide


def _end_gaps(tables: Tables) -> tuple[dict[str, pd.Series], str]:
    """How far from the nominal end feedforward ends on each curve, by speed [m], and in words."""
    found = {}
    for curve, rows in tables["feedforward_paths"].groupby("curve"):
        end = rows[rows["path"] == "nominal"][["x_m", "y_m"]].to_numpy()[-1]
        driven = rows[rows["path"] == "feedforward"].groupby("mean_speed_m_s")[["x_m", "y_m"]].last()
        found[curve] = pd.Series(np.linalg.norm(driven.to_numpy() - end, axis=1), index=driven.index).sort_index()
    texts = [
        f"{curve}: {', '.join(f'{1e3 * gap:.0f} mm at {speed:g} m/s' for speed, gap in gaps.items())} from the end"
        for curve, gaps in found.items()
    ]
    return found, "; ".join(texts)


def drift_grows(tables: Tables) -> Decision:
    """Whether the drift of feedforward grows by a fifth or more from each speed to the next, to where it shows."""
    found, text = _end_gaps(tables)
    grows = all((gaps.to_numpy()[1:] > 1.2 * gaps.to_numpy()[:-1]).all() for gaps in found.values())
    return outcome(grows and all(gaps.iloc[-1] > SHOWS_M for gaps in found.values())), text


def slow_is_nominal(tables: Tables) -> Decision:
    """Whether feedforward at the lowest speed ends within a hundredth of the curve's width of the nominal end."""
    found, text = _end_gaps(tables)
    paths = tables["feedforward_paths"]
    widths = paths[paths["path"] == "nominal"].groupby("curve")["x_m"].agg(np.ptp)
    return outcome(all(gaps.iloc[0] < 0.01 * widths[curve] for curve, gaps in found.items())), text


def accurate_when_slow(tables: Tables) -> Decision:
    """Whether feedforward is within 2 mm at the lowest speed and off by more than ten times that at the highest."""
    rows = tables["speeds"].sort_values("mean_speed_m_s")
    rms, speed = rows["feedforward_rms_m"], rows["mean_speed_m_s"]
    return outcome(rms.iloc[0] < 0.1 * SHOWS_M and rms.iloc[-1] > SHOWS_M), (
        f"RMS of feedforward {1e3 * rms.iloc[0]:.2g} mm at {speed.iloc[0]:g} m/s, {1e3 * rms.iloc[-1]:.2g} mm at "
        f"{speed.iloc[-1]:g} m/s"
    )


def start(law: str) -> Callable[[Tables], Decision]:
    """Whether feedforward fails from rest, with one of the two laws of friction."""

    def decide(tables: Tables) -> Decision:
        rows = tables["starts"].set_index(["law", "start"])["rms_m"]
        rest, matched = rows[law, "rest"], rows[law, "nominal velocity"]
        # NaN: the motion from rest ended early.
        return outcome(bool(matched < 0.01 and (np.isnan(rest) or rest > 10 * matched))), (
            f"RMS {rest:.2g} m from rest, {matched:.2g} m from the nominal velocity"
        )

    return decide
