"""Figs. 4 and 5: nominal paths from the quasi-static model, and the planned rover with the object behind it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from studies.frame import Drawing
from studies.paper.figures.drawing import (
    CASE_COLOURS,
    CENTRE_COLOURS,
    CURVE_TITLES,
    OBJECT_PATH,
    SPECIFICATION,
    TETHER,
    draw_outline,
    letter,
    limits_around,
    map_axes,
)
from towval.model import Array
from towval.model.geometry import transform
from towval.report.style import PAGE_WIDTH_IN, figure_function

SHOWN_POSES = {"line": 4, "circle": 14, "lemniscate": 9, "rounded_square": 20}
"""How many poses of the object are drawn along each curve."""

INSETS = {
    "line": (0.52, 0.06, 0.45, 0.45),
    "circle": (0.31, 0.31, 0.38, 0.38),
    "lemniscate": (0.31, 0.03, 0.38, 0.3),
    "rounded_square": (0.3, 0.3, 0.4, 0.4),
}
"""Place of the magnified box in each panel, as shares of the panel."""

MAGNIFIED_SHARE = 1 / 16
"""Share of the path, from its start, that the magnified box shows."""


@figure_function
def nominal_figure(table: pd.DataFrame, outline: Array, anchor: Array) -> Figure:
    """Fig. 4: the object on its path, and the rover's path for each centre of mass.

    Parameters
    ----------
    table : DataFrame
        The study ``nominal``.
    outline : ndarray (n, 2)
        Footprint of the object [m].
    anchor : ndarray (2,)
        Where the tether holds it [m].
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 3.75), layout="constrained")
    panels = figure.subplots(2, len(CURVE_TITLES))
    for column, (curve, title) in enumerate(CURVE_TITLES.items()):
        rows = table[table["curve"] == curve]
        _object_poses(panels[0, column], rows, curve, outline, anchor)
        _rover_paths(panels[1, column], rows, curve)
        letter(panels[0, column], "abcd"[column], title)
        letter(panels[1, column], "efgh"[column], title)
    for axes in panels[:, 0]:
        axes.set_ylabel(r"$y$ [m]")
    for axes in panels[1]:
        axes.set_xlabel(r"$x$ [m]")
    lines = [Line2D([], [], color=OBJECT_PATH, label="object")]
    lines += [Line2D([], [], color=colour, label=f"rover, {name}") for name, colour in CENTRE_COLOURS.items()]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines))
    return figure


def _object_poses(axes: Axes, rows: pd.DataFrame, curve: str, outline: Array, anchor: Array) -> None:
    rows = rows[rows["centre"] == rows["centre"].iloc[0]]
    pose = rows[["x_m", "y_m", "heading_rad"]].to_numpy()
    hinge = rows[["hinge_x_m", "hinge_y_m"]].to_numpy()
    axes.plot(pose[:, 0], pose[:, 1], color=OBJECT_PATH, lw=0.9)
    for k in np.linspace(0, len(pose) - 1, SHOWN_POSES[curve] + 1).round().astype(int):
        draw_outline(axes, outline, pose[k], facecolor="#e8eef5", edgecolor="#4a6a8a", linewidth=0.35, alpha=0.8)
        axes.plot(*np.transpose([transform(pose[k], anchor), hinge[k]]), color=TETHER, lw=0.5)
        axes.plot(*hinge[k], ".", color=CENTRE_COLOURS["G1"], markersize=1.6)
    map_axes(axes, labels=False)


def _rover_paths(axes: Axes, rows: pd.DataFrame, curve: str) -> None:
    lines = [(OBJECT_PATH, rows[rows["centre"] == rows["centre"].iloc[0]][["x_m", "y_m"]].to_numpy())]
    lines += [
        (CENTRE_COLOURS[name], part[["hinge_x_m", "hinge_y_m"]].to_numpy()) for name, part in rows.groupby("centre")
    ]
    for colour, line in lines:
        axes.plot(*line.T, color=colour, lw=0.9)
    points = np.concatenate([line for _, line in lines])
    (x_low, x_high), (y_low, y_high) = limits_around(points)
    if curve == "lemniscate":
        y_low -= 0.55 * (y_high - y_low)
    axes.update_datalim([(x_low, y_low), (x_high, y_high)])
    map_axes(axes, labels=False)
    _magnified(axes, lines, INSETS[curve])


def _magnified(axes: Axes, lines: list[tuple[str, Array]], place: tuple[float, float, float, float]) -> None:
    """A box with the rover's paths shortly after their start, where they differ."""
    inset = axes.inset_axes(place)
    for colour, line in lines:
        inset.plot(*line.T, color=colour, lw=0.8)
    shown = np.concatenate([line[: int(len(line) * MAGNIFIED_SHARE)] for _, line in lines[1:]])
    centre, extent = (shown.max(axis=0) + shown.min(axis=0)) / 2, 1.15 * np.ptp(shown, axis=0)
    width = max(extent[0], extent[1] * place[2] / place[3])
    height = width * place[3] / place[2]
    inset.set_xlim(centre[0] - width / 2, centre[0] + width / 2)
    inset.set_ylim(centre[1] - height / 2, centre[1] + height / 2)
    inset.set(xticks=[], yticks=[], facecolor="#eaf4fb")
    for spine in inset.spines.values():
        spine.set_color("#5b9bd5")
    axes.indicate_inset_zoom(inset, edgecolor="#5b9bd5", linewidth=0.5)


@figure_function
def loop_figure(table: pd.DataFrame) -> Figure:
    """Fig. 5: paths of rover and object on the lemniscate, coloured by the planner's case.

    Parameters
    ----------
    table : DataFrame
        The study ``loop``.
    """
    figure = Figure(figsize=(PAGE_WIDTH_IN, 2.75), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, body, name in zip(panels, ("rover", "object"), "ab", strict=True):
        nominal = table[table["row"] == f"nominal {body}"][["x_m", "y_m"]].to_numpy()
        actual = table[table["row"] == body]
        axes.plot(*nominal.T, color=SPECIFICATION, lw=2.6, alpha=0.55, solid_capstyle="butt")
        _coloured_by_case(axes, actual[["x_m", "y_m"]].to_numpy(), actual["case"].to_numpy())
        letter(axes, name, body)
        map_axes(axes)
    numbers = table[table["row"] == "numbers"].iloc[0]
    handles = [Line2D([], [], color=SPECIFICATION, lw=2.6, alpha=0.55, label="nominal path")]
    handles += [
        Line2D(
            [], [], color=colour, label=f"case {case} ({100 * numbers[f'case_{case.lower()}_share']:.1f} % of steps)"
        )
        for case, colour in CASE_COLOURS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _coloured_by_case(axes: Axes, points: Array, case: np.ndarray) -> None:
    segments = np.stack([points[:-1], points[1:]], axis=1)
    colours = [CASE_COLOURS[name] for name in case[:-1]]
    axes.add_collection(LineCollection(list(segments), colors=colours, linewidths=1.1, capstyle="butt"))
    axes.autoscale_view()


def _figure_4(plan: Mapping[str, Any], tables: Mapping[str, pd.DataFrame]) -> Figure:
    shape = plan["general_object"]
    return nominal_figure(tables["nominal"], np.array(shape["outline_m"]), np.array(shape["anchor_m"]))


FIGURE_4 = Drawing(("nominal",), _figure_4)
FIGURE_5 = Drawing(("loop",), lambda _, tables: loop_figure(tables["loop"]))
