"""Figs. 6, 7 and 8: what speed, time step, stiffness, threshold and look-ahead do to the error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch as LegendPatch

from studies.frame import Drawing
from studies.paper.figures.drawing import (
    CURVE_TITLES,
    OBJECT_PATH,
    ROVER_PATH,
    SPECIFICATION,
    draw_outline,
    letter,
    map_axes,
)
from towval.model import Array
from towval.report.style import PAGE_WIDTH_IN, figure_function

FEEDFORWARD = "#d9480f"
FEEDBACK = "#1f63b4"
AT_REST_LENGTH = "#5f9ed1"
TIME = "#2b8a3e"
BROKEN = "#b9b9b9"

SPEED_COLOURS = ("#2b8a3e", "#e08a00", "#c8322b")
THRESHOLD_COLOURS = ("#7b3fb5", "#2b8a3e", "#e08a00", "#c8322b")
"""Colours of the paths shown, from the least to the greatest value."""

SHOWN_CUBES = 12
"""Poses of the cube drawn along its nominal path."""

CUBE_SCALE = 0.5
"""The drawn cube is scaled down, as in the paper's Fig. 6(d) and (e)."""


@figure_function
def dynamics_figure(
    speeds: pd.DataFrame, time_steps: pd.DataFrame, stiffnesses: pd.DataFrame, paths: pd.DataFrame, side: float
) -> Figure:
    """Fig. 6: error of feedforward and feedback dynamics.

    Parameters
    ----------
    speeds, time_steps, stiffnesses, paths : DataFrame
        The studies ``speeds``, ``time_steps``, ``stiffnesses`` and ``feedforward_paths``.
    side : float
        Side of the cube [m].
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 4.9), layout="constrained")
    upper, lower = np.asarray(figure.subfigures(2, 1, height_ratios=[1, 1.15])).tolist()
    above, below = upper.subplots(1, 3), lower.subplots(1, 2, width_ratios=[1, 1.35])
    above[1].sharey(above[0])
    _errors(above[0], speeds, "mean_speed_m_s", r"mean speed $\bar{v}$ [m/s]")
    _errors(above[1], time_steps, "time_step_s", r"time step $t_s$ [s]")
    _stiffness(above[2], stiffnesses)
    for axes, curve in zip(below, ("rounded_square", "lemniscate"), strict=True):
        _feedforward_paths(axes, paths[paths["curve"] == curve], side)
    for axes, name in zip([*above, *below], "abcde", strict=True):
        letter(axes, name)
    handles, _ = above[0].get_legend_handles_labels()
    upper.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    handles, _ = below[1].get_legend_handles_labels()
    lower.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _errors(axes: Axes, table: pd.DataFrame, column: str, label: str) -> None:
    lines = (
        ("feedforward", "FFD", FEEDFORWARD, "o-"),
        ("feedback_at_rest_length", "FBD, hinge at rest length", AT_REST_LENGTH, "s--"),
        ("feedback", "FBD, hinge at stretched length", FEEDBACK, "s-"),
    )
    for name, text, colour, style in lines:
        axes.plot(table[column], table[f"{name}_rms_m"], style, color=colour, label=text, markersize=2.6)
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="RMS [m]")


def _stiffness(axes: Axes, table: pd.DataFrame) -> None:
    kappa = table["stiffness_n_m"]
    axes.plot(kappa, table["feedback_at_rest_length_rms_m"], "s--", color=AT_REST_LENGTH, markersize=2.6)
    axes.plot(kappa, table["feedback_rms_m"], "s-", color=FEEDBACK, markersize=2.6)
    axes.set(xscale="log", yscale="log", xlabel=r"stiffness $\kappa$ [N/m]", ylabel="RMS [m]")
    times = axes.twinx()
    times.plot(kappa, 1e3 * table["feedback_compute_time_s"], "^-", color=TIME, markersize=2.6)
    times.set_ylabel(r"computing time $t_c$ [ms]", color=TIME)
    times.set_ylim(bottom=0)
    times.tick_params(axis="y", colors=TIME)
    times.grid(False)


def _feedforward_paths(axes: Axes, table: pd.DataFrame, side: float) -> None:
    nominal = table[table["path"] == "nominal"][["x_m", "y_m"]].to_numpy()
    square = CUBE_SCALE * side / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    axes.plot(*nominal.T, color=OBJECT_PATH, lw=1.4, label="nominal")
    for k in np.linspace(0, len(nominal) - 2, SHOWN_CUBES, endpoint=False).astype(int):
        heading = np.arctan2(*(nominal[k + 1] - nominal[k])[::-1])
        draw_outline(axes, square, np.array([*nominal[k], heading]), edgecolor="#999999")
    driven = table[table["path"] == "feedforward"].groupby("mean_speed_m_s")
    for (speed, rows), colour in zip(driven, SPEED_COLOURS, strict=False):
        axes.plot(rows["x_m"], rows["y_m"], color=colour, lw=0.9, label=rf"FFD, $\bar{{v}}$ = {speed:g} m/s")
    map_axes(axes)


@figure_function
def threshold_figure(table: pd.DataFrame) -> Figure:
    """Fig. 7: error of rover and object against the threshold d_t, and paths for some of its values.

    Parameters
    ----------
    table : DataFrame
        The study ``thresholds``.
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 3.9), layout="constrained")
    panels = figure.subplots(2, len(CURVE_TITLES))
    for column, (curve, title) in enumerate(CURVE_TITLES.items()):
        rows = table[table["curve"] == curve]
        _threshold_errors(panels[0, column], rows[rows["row"] == "numbers"])
        _threshold_paths(panels[1, column], rows)
        letter(panels[0, column], "abcd"[column], title)
        letter(panels[1, column], "efgh"[column], title)
        panels[0, column].set_xlabel(r"$d_t$ [m]")
        panels[1, column].set_xlabel(r"$x$ [m]")
    panels[0, 0].set_ylabel("RMS [m]")
    panels[1, 0].set_ylabel(r"$y$ [m]")
    handles = [
        Line2D([], [], color=ROVER_PATH, marker="o", markersize=2.6, label="RMS, rover"),
        Line2D([], [], color=OBJECT_PATH, marker="s", markersize=2.6, label="RMS, object"),
        Line2D([], [], color=SPECIFICATION, marker="x", ls="", markersize=4, label="did not arrive"),
        Line2D([], [], color=OBJECT_PATH, lw=1.6, label="nominal object"),
    ]
    shown = sorted(table.loc[table["row"] == "object", "threshold_m"].unique())
    handles += [
        Line2D([], [], color=colour, label=rf"object, $d_t$ = {value:g} m")
        for value, colour in zip(shown, THRESHOLD_COLOURS, strict=False)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _threshold_errors(axes: Axes, numbers: pd.DataFrame) -> None:
    for column, colour, style in (("rover_rms_m", ROVER_PATH, "o-"), ("object_rms_m", OBJECT_PATH, "s-")):
        axes.plot(numbers["threshold_m"], numbers[column], style, color=colour, markersize=1.8, lw=0.7)
        failed = numbers[numbers["outcome"] != "arrived"]
        axes.plot(failed["threshold_m"], failed[column], "x", color=SPECIFICATION, markersize=4, markeredgewidth=0.9)
    axes.set(yscale="log", ylim=(1e-4, 5.0))


def _threshold_paths(axes: Axes, rows: pd.DataFrame) -> None:
    nominal = rows[rows["row"] == "nominal object"]
    axes.plot(nominal["x_m"], nominal["y_m"], color=OBJECT_PATH, lw=1.6)
    for (_, path), colour in zip(rows[rows["row"] == "object"].groupby("threshold_m"), THRESHOLD_COLOURS, strict=False):
        axes.plot(path["x_m"], path["y_m"], color=colour, lw=0.8)
    map_axes(axes, labels=False)


@figure_function
def surface_figure(table: pd.DataFrame) -> Figure:
    """Fig. 8: error of the object over threshold and look-ahead; grey where the rover did not arrive.

    Parameters
    ----------
    table : DataFrame
        The study ``surface``.
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 2.95), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    reached = table.loc[table["outcome"] == "arrived", "object_rms_m"]
    scale = LogNorm(10 ** np.floor(np.log10(reached.min())), 10 ** np.ceil(np.log10(reached.max())))
    for axes, curve, name in zip(panels, ("lemniscate", "rounded_square"), "ab", strict=True):
        mesh = _surface(axes, table[table["curve"] == curve], scale)
        letter(axes, name, CURVE_TITLES[curve])
        axes.set_xlabel(r"threshold $d_t$ [m]")
    panels[0].set_ylabel(r"look-ahead $\vartheta_{lh}$ [steps]")
    figure.colorbar(mesh, ax=panels, label="RMS of the object [m]", pad=0.015)
    handle = LegendPatch(facecolor=BROKEN, edgecolor="none", label="did not arrive")
    figure.legend(handles=[handle], loc="outside lower center")
    return figure


def _surface(axes: Axes, rows: pd.DataFrame, scale: LogNorm) -> QuadMesh:
    grid = rows.pivot_table(index="look_ahead_steps", columns="threshold", values="object_rms_m")
    arrived = rows.assign(ok=rows["outcome"] == "arrived").pivot_table(
        index="look_ahead_steps", columns="threshold", values="ok"
    )
    values = np.ma.masked_where(arrived.to_numpy() < 1, grid.to_numpy())
    axes.set_facecolor(BROKEN)
    axes.grid(False)
    return axes.pcolormesh(
        _edges(grid.columns.to_numpy()),
        _edges(grid.index.to_numpy()),
        values,
        cmap="viridis",
        norm=scale,
        rasterized=True,
    )


def _edges(centres: Array) -> Array:
    """Edges (n + 1,) of cells around equally spaced centres (n,)."""
    half = (centres[-1] - centres[0]) / (len(centres) - 1) / 2
    return np.append(centres - half, centres[-1] + half)


def _figure_6(plan: Mapping[str, Any], tables: Mapping[str, pd.DataFrame]) -> Figure:
    speeds, time_steps, stiffnesses, paths = (tables[name] for name in FIGURE_6.tables)
    return dynamics_figure(speeds, time_steps, stiffnesses, paths, plan["cube"]["side_m"])


FIGURE_6 = Drawing(("speeds", "time_steps", "stiffnesses", "feedforward_paths"), _figure_6)
FIGURE_7 = Drawing(("thresholds",), lambda _, tables: threshold_figure(tables["thresholds"]))
FIGURE_8 = Drawing(("surface",), lambda _, tables: surface_figure(tables["surface"]))
