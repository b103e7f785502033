"""Charts of what whole runs end with: bound and error against cost, and the verdicts with and without a fault."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch as Swatch
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from studies.charts import COLOURS, MARKERS, below_chart, foot, medians, outcome_summary, repeats, title_of
from studies.frame import BOUND, OFF, REFUSED
from towval.model import Verdict
from towval.report.style import PAGE_WIDTH_IN, figure_function

VERDICTS = {
    Verdict.AGREES: "#d3e3d0",
    Verdict.CANNOT_TELL: "#dddddd",
    Verdict.DISAGREES: "#e9b4a6",
    Verdict.NOT_JUDGED: "#f4efe1",
    REFUSED: "#ffffff",
}
"""Faces of the bars, light enough for the numbers on them."""

_ROW_IN, _TOP_IN, _PANEL_IN, _LINE_IN = 0.24, 0.5, 2.1, 0.16
_LEFT_IN, _NAMES_IN, _RIGHT_IN, _BETWEEN_IN = 0.62, 1.5, 0.12, 0.3
_HELD_IN = 0.75
"""Room beside the bars for how often the bound held."""
_DECADE, _FEW_DECADES = 10.0, 60.0


@figure_function
def outcome_chart(table: pd.DataFrame, title: str, stage_cost: str, planted: str, note: str, take: str) -> Figure:
    """What a run ends with, setting by setting, against its cost.

    Above, the bound of the largest error (filled) and the error itself (hollow), medians and quartiles, against the CPU
    time of the whole and of the stage; below, the verdicts on the right model and on the one with a planted fault, and
    how often the bound held.

    Parameters
    ----------
    table : DataFrame
        Columns of :class:`studies.frame.Outcomes`.
    title, note, take : str
        As in :func:`studies.charts.scatter_chart`.
    stage_cost : str
        Label of the stage's cost.
    planted : str
        Which fault is planted.
    """
    table = table.assign(setting=table["setting"].astype(str))
    names, found = list(dict.fromkeys(table["setting"])), outcome_summary(table)
    first, notes = below_chart(table, take, f"{repeats(medians(table))} {note}")
    bars_in = _ROW_IN * len(names)
    bottom = 0.55 + _LINE_IN * (1 + len(notes))
    height = _TOP_IN + _PANEL_IN + 0.85 + bars_in + bottom
    figure = Figure(figsize=(PAGE_WIDTH_IN, height))
    width = PAGE_WIDTH_IN
    inner = width - _LEFT_IN - _RIGHT_IN - _BETWEEN_IN
    for index, (cost, label) in enumerate((("cost", "CPU time of the whole [s]"), ("stage_cost", stage_cost))):
        left = _LEFT_IN + index * (inner / 2 + _BETWEEN_IN)
        at = (left / width, (height - _TOP_IN - _PANEL_IN) / height, inner / 2 / width, _PANEL_IN / height)
        _draw_errors(figure.add_axes(at), table, names, cost, label, named=index == 0)
    wide = (width - _NAMES_IN - _RIGHT_IN - 2 * _HELD_IN) / 2
    for index, (prefix, model) in enumerate((("", "right model"), ("wrong_", f"wrong model: {planted}"))):
        left = _NAMES_IN + index * (wide + _HELD_IN)
        own = figure.add_axes((left / width, bottom / height, wide / width, bars_in / height))
        _draw_verdicts(own, found, prefix)
        own.set_title(model, fontsize=7.5)
        if index == 0:
            _name_rows(own, table, names)
    title_of(figure, title)
    foot(figure, _handles(table), 4, notes, advice=first)
    return figure


def _look(index: int) -> dict[str, Any]:
    return {"marker": MARKERS[index % len(MARKERS)], "color": COLOURS[index % len(COLOURS)]}


def _draw_errors(axes: Axes, table: pd.DataFrame, names: list[str], cost: str, label: str, *, named: bool) -> None:
    axes.set(xscale="log", yscale="log", xlabel=label)
    if named:
        axes.set_ylabel("largest error and its bound [mm]")
    for index, name in enumerate(names):
        runs = table[table["setting"] == name]
        for panel, face in ((BOUND, None), (OFF, "white")):
            part = runs[(runs["panel"] == panel) & (runs["error"] > 0)]
            if part.empty:
                continue
            default = part["default"].astype(bool).any()
            # Where settings end alike, the default's mark is the one to be seen.
            above = 0.5 if default else 0.0
            x, (low, middle, high) = part[cost].median(), part["error"].quantile([0.25, 0.5, 0.75])
            look = _look(index)
            axes.plot(
                [x],
                [middle],
                ls="none",
                ms=5,
                mew=0.9,
                mfc=face or look["color"],
                mec=look["color"],
                zorder=3 + above,
                **look,
            )
            axes.vlines([x], low, high, colors=look["color"], lw=0.7, zorder=2)
            if default:
                axes.plot([x], [middle], "o", mfc="none", mec="#000000", mew=0.9, ms=10, zorder=4)
    low, high = axes.get_xlim()
    middle = math.sqrt(low * high)
    # Within less than a decade of costs there are hardly any round numbers for ticks.
    axes.set_xlim(min(low, middle / 2.5), max(high, middle * 2.5))
    axes.margins(y=0.12)
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_minor_formatter(NullFormatter())
        span = limits[1] / limits[0]
        subs = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if span < _DECADE else (1.0, 2.0, 5.0) if span < _FEW_DECADES else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs, numticks=20))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    if not named:
        axes.tick_params(labelleft=False)


def _draw_verdicts(axes: Axes, found: pd.DataFrame, prefix: str) -> None:
    count = int(found["campaigns"].max())
    for row, (_, runs) in enumerate(found.iterrows()):
        left = 0
        for verdict, face in VERDICTS.items():
            width = runs[f"{prefix}{verdict}"]
            if width:
                axes.barh(row, width, left=left, height=0.8, color=face, edgecolor="#777777", lw=0.4)
                axes.text(left + width / 2, row, str(width), ha="center", va="center_baseline", fontsize=6.5)
            left += width
        stated = runs[f"{prefix}stated"]
        said = f"{runs[f'{prefix}held']} of {stated}" if stated else "none"
        axes.text(1.03, row, said, transform=axes.get_yaxis_transform(), fontsize=6.5, va="center_baseline")
    axes.text(1.03, -0.75, "bound held", transform=axes.get_yaxis_transform(), fontsize=6.5, va="bottom")
    axes.set(xlim=(0, count), ylim=(len(found) - 0.5, -0.5), yticks=[])
    axes.set_xlabel("campaigns", fontsize=7.5)
    axes.xaxis.set_major_locator(FixedLocator([0, count]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(visible=False)


def _name_rows(axes: Axes, table: pd.DataFrame, names: list[str]) -> None:
    """Names of the settings left of the bars, each with its mark, the default's in bold."""
    width = axes.get_position().width * PAGE_WIDTH_IN
    for row, name in enumerate(names):
        default = table.loc[table["setting"] == name, "default"].astype(bool).any()
        weight = "bold" if default else "normal"
        place: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "clip_on": False}
        axes.plot([-0.12 / width], [row], ms=5, mec=_look(row)["color"], **_look(row), **place)
        axes.text(-0.24 / width, row, name, ha="right", va="center_baseline", fontsize=7, weight=weight, **place)


def _handles(table: pd.DataFrame) -> list[Any]:
    grey: dict[str, Any] = {"ls": "none", "marker": "o", "color": "#555555", "ms": 5, "mew": 0.9}
    shown = {*table["verdict"], *table["wrong_verdict"]}
    return [
        Line2D([], [], label="bound", **grey),
        Line2D([], [], label="largest error", mfc="white", **grey),
        Line2D([], [], ls="none", marker="o", mfc="none", mec="#000000", ms=8, label="default"),
        *(
            Swatch(facecolor=face, edgecolor="#777777", lw=0.4, label=str(name))
            for name, face in VERDICTS.items()
            if str(name) in shown
        ),
    ]
