"""Fig. 2: footprint on a mesh, the part that stays in contact under a very eccentric load, and how that is found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from studies.frame import Drawing
from studies.paper.figures.drawing import SPECIFICATION, letter, limits_around
from towval.model import Array
from towval.report.style import PAGE_WIDTH_IN, figure_function

CELL = "#dbe7f3"
CELL_EDGE = "#6d8fb3"
CUT = "#8a8a8a"
COEFFICIENT_COLOURS = {"a": "#1f63b4", "b": "#e08a00", "c": "#2b8a3e"}


@figure_function
def contact_figure(table: pd.DataFrame, outline: Array, load: Array) -> Figure:
    """Fig. 2 in the paper's arrangement.

    Parameters
    ----------
    table : DataFrame
        The study ``contact``.
    outline : ndarray (n, 2)
        Footprint [m].
    load : ndarray (2,)
        Where the load acts [m].
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 2.45), layout="constrained")
    panels = figure.subplots(1, 3, width_ratios=[1, 1, 1.25])
    cells = table[table["row"] == "cell"]
    corners = cells[["x0", "y0", "x1", "y1", "x2", "y2"]].to_numpy().reshape(-1, 3, 2)
    _mesh(panels[0], outline, corners)
    _reduced(panels[1], table, outline, corners[cells["contact"].to_numpy() > 0])
    for axes in panels[:2]:
        axes.plot(*load, "o", color=SPECIFICATION, markersize=3.5)
        axes.annotate("load", load, xytext=(-3, 4), textcoords="offset points", fontsize=7, color=SPECIFICATION)
    limits = limits_around(outline)
    for axes in panels[:2]:
        axes.set_aspect("equal")
        axes.set(xlim=limits[0], ylim=limits[1], xlabel=r"$\xi$ [m]")
        axes.grid(False)
    panels[0].set_ylabel(r"$\eta$ [m]")
    _convergence(panels[2], table[table["row"] == "iteration"])
    for axes, name in zip(panels, "abc", strict=True):
        letter(axes, name)
    return figure


def _mesh(axes: Axes, outline: Array, corners: Array) -> None:
    axes.add_collection(PolyCollection(list(corners), facecolors=CELL, edgecolors=CELL_EDGE, linewidths=0.25))
    axes.add_patch(Polygon(outline, closed=True, facecolor="none", edgecolor="#222222", linewidth=0.8))


def _reduced(axes: Axes, table: pd.DataFrame, outline: Array, corners: Array) -> None:
    axes.add_patch(Polygon(outline, closed=True, facecolor="#f4f4f4", edgecolor=CUT, linewidth=0.5, ls="--"))
    axes.add_collection(PolyCollection(list(corners), facecolors=CELL, edgecolors=CELL_EDGE, linewidths=0.25))
    for _, ring in table[table["row"] == "exact"].groupby("number"):
        axes.add_patch(Polygon(ring[["x0", "y0"]].to_numpy(), closed=True, fill=False, edgecolor="#222222", lw=1.0))


def _convergence(axes: Axes, iterations: pd.DataFrame) -> None:
    """Residual on the left, coefficients over their last values on the right."""
    number, floor = iterations["number"], 1e-17
    residual = np.maximum(iterations["residual"], floor)
    (line,) = axes.plot(number, residual, "ks-", markersize=2.6, label="res")
    axes.set(yscale="log", xlabel="iteration", ylabel=r"residual $\|Ax - B\|$")
    axes.set_xticks(number)
    right = axes.twinx()
    handles = [line]
    for name, colour in COEFFICIENT_COLOURS.items():
        handles += right.plot(number, iterations[name], "o-", color=colour, markersize=2.2, label=f"${name}$")
    right.set_ylabel("coefficient / last value")
    right.grid(False)
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.3, 0.0))


def _figure_2(plan: Mapping[str, Any], tables: Mapping[str, pd.DataFrame]) -> Figure:
    shape = plan["general_object"]
    return contact_figure(tables["contact"], np.array(shape["outline_m"]), np.array(shape["extreme_centre_of_mass_m"]))


FIGURE_2 = Drawing(("contact",), _figure_2)
