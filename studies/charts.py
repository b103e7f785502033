"""Charts of the studies: error against cost, and maps of right, flagged and silently wrong."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch as Swatch
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from studies.frame import BOUND, OFF, REFUSED, Outcomes, Scatter
from studies.labels import place_labels
from towval.model import Verdict
from towval.report.style import PAGE_WIDTH_IN, Margins, figure_function, foot_legend, place_maps

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*")
COLOURS = ("#1f63b4", "#c8322b", "#2b8a3e", "#7b3fb5", "#e08a00", "#0b7285", "#444444", "#a61e4d", "#5c940d", "#868e96")

RIGHT, FLAGGED, SILENT = "right", "flagged", "silently wrong"
FACES = {RIGHT: "#f1f3f5", FLAGGED: "#9fb6d0", SILENT: "#1d1d1b"}
SIGNS = {RIGHT: ("", "#1d1d1b"), FLAGGED: ("!", "#1d1d1b"), SILENT: ("×", "#ffffff")}
"""Cells by judgement: face, and sign in its colour; light, middle and dark, so that they can be told apart in grey."""

_LINE_IN = 0.16
_FRAME_PT = 1.2
_AWAY, _AWAY_DEFAULT = 3.5, 5.0
"""From a point to its label [pt], and from one with the ring of the default."""
_DECADE = 10.0
_ROOM = 1.15  # Factor of space below and above all points.
_HALF_DECADE = math.sqrt(10)
_FEW_DECADES = 60.0  # A range below this has numbers at 1, 2 and 5.


@figure_function
def scatter_chart(
    table: pd.DataFrame, title: str, labels: tuple[str, str], note: str, take: str = "", *, front: bool = True
) -> Figure:
    """Error against cost on logarithmic scales, a panel for each value of ``panel``.

    Parameters
    ----------
    table : DataFrame
        Columns ``panel``, ``series``, ``setting``, ``cost``, ``error``, ``default``; rows that repeat the first three
        are drawn as their median, with a line from the lower to the upper quartile of the error. The series with the
        default comes first, so that it has the same colour and mark in all charts. ``short`` says that a row is of the
        short variant of its study.
    title : str
        Of the chart.
    labels : (str, str)
        Of the axes x and y; without the first the panels' names label x.
    note : str
        A sentence or two below.
    take : str, optional
        What to take and why, above the note.
    front : bool, optional
        Draw the Pareto front and label the points; else join the points of a series.
    """
    rows = medians(table)
    panels = list(dict.fromkeys(rows["panel"]))
    series = list(dict.fromkeys(rows.sort_values("default", ascending=False, kind="stable")["series"]))
    columns = {1: 1, 2: 2, 4: 2}.get(len(panels), 3)
    first, notes = below_chart(table, take, f"{repeats(rows)} {note}")
    handles = _handles(series, front=front, default=bool(rows["default"].astype(float).max() > 0))
    legend_rows = math.ceil(len(handles) / 4)
    margins = Margins(
        left=0.62,
        right=0.1,
        top=0.42 if labels[0] and any(panels) else 0.3,
        bottom=0.62 + _LINE_IN * (legend_rows + len(notes)),
        across=0.5 if columns > 1 else 0.1,
        down=0.62,
    )
    figure = Figure(figsize=(PAGE_WIDTH_IN, 3.0))
    axes = [figure.add_subplot() for _ in panels]
    place_maps(figure, axes, 0.52 if columns == 1 else 0.8, margins, columns)
    for index, (panel, own) in enumerate(zip(panels, axes, strict=True)):
        _draw_panel(own, rows[rows["panel"] == panel], series, front=front)
        own.set_xlabel(labels[0] or panel)
        own.set_title(_set(panel) if labels[0] and panel else "")
        if index % columns == 0:
            own.set_ylabel(labels[1])
    _same_decades(axes)
    title_of(figure, title)
    foot(figure, handles, 4, notes, advice=first)
    place_labels(figure, axes)
    return figure


def medians(table: pd.DataFrame) -> pd.DataFrame:
    """One row a panel, series and setting (where points are joined: and cost), with median cost and error.

    ``low`` and ``high`` are the quartiles of the error, ``seeds`` the number of rows of the table behind it.
    """
    usable = table[(table["cost"] > 0) & (table["error"] > 0)].assign(panel=table["panel"].astype(object).fillna(""))
    usable = usable.assign(setting=usable["setting"].astype(object).fillna("").astype(str))
    keys = ["panel", "series", "setting"]
    if (usable["setting"] == "").all():
        keys.append("cost")
    groups = usable.groupby(keys, sort=False)
    rows = groups["error"].agg(["median", lambda error: error.quantile(0.25), lambda error: error.quantile(0.75)])
    rows.columns = pd.Index(["error", "low", "high"])
    rows["default"], rows["seeds"] = groups["default"].max(), groups.size()
    if "cost" not in keys:
        rows["cost"] = groups["cost"].median()
    return rows.reset_index()


def outcome_summary(table: pd.DataFrame) -> pd.DataFrame:
    """One row a setting of a chart of outcomes, by its name.

    Medians ``cost`` and ``stage_cost`` [s], ``bound`` and ``off`` [mm], each of these two with its quartiles, as
    ``bound_low`` and ``bound_high``; a column a verdict with the number of campaigns; ``stated`` and ``held``, how many
    bounds there are and how many held; ``default``. Verdicts and bounds of the wrong model begin with ``wrong_``.
    """
    found = {}
    for setting, rows in table.groupby("setting", sort=False):
        bounds, runs = rows[rows["panel"] == BOUND], rows[rows["panel"] == OFF]
        row: dict[str, Any] = {name: runs[name].median() for name in ("cost", "stage_cost")}
        for name, each in (("bound", bounds), ("off", runs)):
            row[f"{name}_low"], row[name], row[f"{name}_high"] = each["error"].quantile([0.25, 0.5, 0.75])
            row[f"wrong_{name}"] = each["wrong_error"].median()
        for model in ("", "wrong_"):
            row |= {f"{model}{name}": int((runs[f"{model}verdict"] == name).sum()) for name in (*Verdict, REFUSED)}
            # A table that was written and read again has words for what is true.
            held = runs[f"{model}holds"].dropna().map(str)
            row |= {f"{model}stated": len(held), f"{model}held": int((held == "True").sum())}
        found[str(setting)] = row | {"default": bool(runs["default"].max()), "campaigns": len(runs)}
    return pd.DataFrame.from_dict(found, orient="index")


def advice(chart: Scatter, table: pd.DataFrame) -> str:
    """What to take, and why by the numbers of a table; those of the short variant of a study are no reason."""
    if chart.why is None or short_variant(table):
        return chart.take
    return f"{chart.take} {chart.why(outcome_summary(table) if isinstance(chart, Outcomes) else medians(table))}"


def unbeaten(rows: pd.DataFrame) -> pd.DataFrame:
    """The Pareto front: rows that no other beats in both cost and error, cheapest first."""
    ordered = rows.sort_values(["cost", "error"])
    return ordered[ordered["error"] < ordered["error"].astype(float).cummin().shift(fill_value=np.inf)]


def _draw_panel(axes: Axes, rows: pd.DataFrame, series: Sequence[str], *, front: bool) -> None:
    axes.set(xscale="log", yscale="log")
    for name, points in rows.groupby("series", sort=False):
        index = series.index(name)
        line = "none" if front else "-"
        ordered = points if front else points.sort_values("cost")
        axes.plot(
            ordered["cost"],
            ordered["error"],
            linestyle=line,
            marker=MARKERS[index % len(MARKERS)],
            color=COLOURS[index % len(COLOURS)],
            ms=4.5,
            mec="white",
            mew=0.4,
            zorder=3,
        )
        axes.vlines(
            points["cost"], points["low"], points["high"], colors=COLOURS[index % len(COLOURS)], lw=0.7, zorder=2
        )
    if not front:
        return
    best = unbeaten(rows)
    axes.plot(best["cost"], best["error"], color="#777777", lw=0.8, ls="--", zorder=2)
    default = rows[rows["default"].astype(float) > 0]
    axes.plot(default["cost"], default["error"], "o", mfc="none", mec="#000000", mew=0.9, ms=10, zorder=4)
    named = pd.concat([default, best, rows.sort_values("error")]).drop_duplicates(["series", "setting"])
    for row in named.itertuples():
        away = (_AWAY_DEFAULT, 0) if row.default else (_AWAY, 0)
        axes.annotate(row.setting, (row.cost, row.error), away, textcoords="offset points", fontsize=6.5, zorder=5)
    axes.margins(x=0.1, y=0.1)


def _handles(series: Sequence[str], *, front: bool, default: bool) -> list[Line2D]:
    style: dict[str, Any] = {"ms": 4.5, "mec": "white", "mew": 0.4}
    shapes = zip(itertools.cycle(MARKERS), itertools.cycle(COLOURS))
    handles = [
        Line2D([], [], ls="" if front else "-", marker=marker, color=colour, label=_set(name), **style)
        for name, (marker, colour) in zip(series, shapes, strict=False)
    ]
    if front:
        handles.append(Line2D([], [], color="#777777", lw=0.8, ls="--", label="Pareto front"))
    if front and default:
        handles.append(Line2D([], [], ls="", marker="o", mfc="none", mec="#000000", ms=8, label="default"))
    return handles


def _same_decades(axes: Sequence[Axes]) -> None:
    """One range of errors for all panels, so that they can be compared, and numbers at the ticks of any range."""
    limits = np.array([own.get_ylim() for own in axes])
    for own in axes:
        own.set_ylim(limits[:, 0].min() / _ROOM, limits[:, 1].max() * _ROOM)
        middle = math.sqrt(math.prod(own.get_xlim()))
        # A decade of costs or more: within less there are no round numbers for ticks.
        own.set_xlim(min(own.get_xlim()[0], middle / _HALF_DECADE), max(own.get_xlim()[1], middle * _HALF_DECADE))
        for axis, (low, high) in ((own.xaxis, own.get_xlim()), (own.yaxis, own.get_ylim())):
            axis.set_minor_formatter(NullFormatter())
            if high / low < _FEW_DECADES:
                axis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=20))
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            else:
                axis.set_major_locator(LogLocator(numticks=20))


@figure_function
def map_chart(
    table: pd.DataFrame,
    title: str,
    axes_labels: dict[str, tuple[str, str]],
    note: str,
    take: str = "",
    default: Mapping[str, Mapping[str, float]] | None = None,
) -> Figure:
    """Maps of judgements, a cell a pair of values, in the order of the values.

    Parameters
    ----------
    table : DataFrame
        Columns ``map``, ``x``, ``y``, ``judgement``; maps without rows are left out.
    title : str
        Of the chart.
    axes_labels : dict
        Labels of x and y by the name of a map.
    note : str
        What counts as right and as flagged.
    take : str, optional
        What to conclude, above the note.
    default : mapping, optional
        By the name of a map, the values on its axes x or y that are defaults: their cells are framed.
    """
    names = [name for name in axes_labels if (table["map"] == name).any()]
    columns = 4 if len(names) > 6 else 3
    framed = {name: values for name, values in (default or {}).items() if name in names}
    first, notes = below_chart(table, take, note)
    margins = Margins(left=0.72, right=0.1, top=0.5, bottom=0.62 + _LINE_IN * (1 + len(notes)), across=0.62, down=0.72)
    figure = Figure(figsize=(PAGE_WIDTH_IN, 3.0))
    axes = [figure.add_subplot() for _ in names]
    place_maps(figure, axes, 0.95, margins, columns)
    for name, own in zip(names, axes, strict=True):
        _draw_map(own, table[table["map"] == name], framed.get(name, {}))
        own.set_title(_shortened(name), fontsize=7.5)
        own.set_xlabel(_set(axes_labels[name][0]), fontsize=7.5)
        own.set_ylabel(_set(axes_labels[name][1]), fontsize=7.5)
    title_of(figure, title)
    handles = [Swatch(facecolor=FACES[name], edgecolor="#777777", label=f"{name}  {SIGNS[name][0]}") for name in FACES]
    if framed:
        handles.append(Swatch(facecolor="none", edgecolor="#000000", lw=_FRAME_PT, label="default"))
    foot(figure, handles, 4, notes, advice=first)
    return figure


def _draw_map(axes: Axes, rows: pd.DataFrame, default: Mapping[str, float]) -> None:
    rows = rows.assign(x=rows["x"].map(_value), y=rows["y"].map(_value))
    across, up = _ordered(rows["x"]), _ordered(rows["y"])
    for row in rows.itertuples():
        x, y = across.index(row.x), up.index(row.y)
        axes.add_patch(_cell(x, y, FACES[row.judgement]))
        sign, colour = SIGNS[row.judgement]
        axes.text(x, y, sign, color=colour, ha="center", va="center_baseline", fontsize=7)
    axes.set(xlim=(-0.5, len(across) - 0.5), ylim=(-0.5, len(up) - 0.5))
    if default.get("x") in across:
        axes.add_patch(_frame(across.index(default["x"]) - 0.5, -0.5, 1, len(up)))
    if default.get("y") in up:
        axes.add_patch(_frame(-0.5, up.index(default["y"]) - 0.5, len(across), 1))
    axes.grid(visible=False)
    for axis, values in ((axes.xaxis, across), (axes.yaxis, up)):
        every = math.ceil(len(values) / 6)
        axis.set_major_locator(FixedLocator(list(range(0, len(values), every))))
        axis.set_minor_locator(NullLocator())
        axis.set_ticklabels([_number(value) for value in values[::every]], fontsize=6.5)


def _cell(x: int, y: int, face: str) -> Rectangle:
    return Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=face, edgecolor="white", lw=0.6)


def _frame(x: float, y: float, width: float, height: float) -> Rectangle:
    return Rectangle((x, y), width, height, fill=False, edgecolor="#000000", lw=_FRAME_PT, zorder=4, clip_on=False)


def _ordered(values: pd.Series) -> list:
    """Numbers by size, words as they come."""
    found = list(dict.fromkeys(values))
    return found if any(isinstance(value, str) for value in found) else sorted(found)


def _value(value: float | str) -> float | str:
    """A number where it is one: a column with words has its numbers as words, too."""
    try:
        return float(value)
    except ValueError:
        return value


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return value
    if value and not 1e-2 <= abs(value) < 1e3:
        exponent = math.floor(math.log10(abs(value)) + 1e-9)
        factor = value / _DECADE**exponent
        power = f"10^{{{exponent}}}"
        return f"${power}$" if abs(factor - 1) < 1e-6 else rf"${factor:.2g}\cdot{power}$"
    return f"{value:.3g}"


def _shortened(name: str) -> str:
    return _set(name.replace("semi-implicit", "semi-impl."))


def _set(text: str) -> str:
    """Symbols with an index as mathematics."""
    return (
        text.replace("u_val", r"$u_\mathrm{val}$")
        .replace(" - ", " − ")
        .replace("v_s", "$v_s$")
        .replace("d_t", "$d_t$")
        .replace("ϑ_lh", r"$\vartheta_{lh}$")
    )


def title_of(figure: Figure, title: str) -> None:
    """Set the title of a chart at its upper left."""
    height = figure.get_size_inches()[1]
    figure.text(0.012, 1 - 0.06 / height, title, fontsize=10, va="top", ha="left")


def foot(
    figure: Figure, handles: Sequence[Line2D | Swatch], columns: int, notes: Sequence[str], *, advice: int = 0
) -> None:
    """The legend at the bottom and, below it, the note, whose first lines, of ``advice``, stand out."""
    height = figure.get_size_inches()[1]
    for line, text in enumerate(reversed(notes)):
        first = len(notes) - 1 - line < advice
        style: dict[str, Any] = {"color": "#1d1d1b", "weight": "bold"} if first else {"color": "#555555"}
        figure.text(0.012, (0.05 + _LINE_IN * 0.85 * line) / height, text, fontsize=7, va="bottom", **style)
    foot_legend(figure, handles, columns)
    legend = figure.legends[-1]
    legend.set_bbox_to_anchor((0.5, (0.1 + _LINE_IN * 0.85 * len(notes)) / height))


def short_variant(table: pd.DataFrame) -> str:
    """What is to be said of a table with rows of the short variant of a study; nothing of a whole one."""
    if "short" not in table or not table["short"].any():
        return ""
    return "Short variant: few settings and seeds; what to take rests on the whole study."


def below_chart(table: pd.DataFrame, take: str, note: str) -> tuple[int, list[str]]:
    """Lines below a chart, and how many of them, the first, say what to take."""
    first = wrapped(take, 152) if take else []
    parts = [str(table[name].iloc[0]) for name in ("machine", "versions") if name in table]
    made = f"{'; '.join(parts)}." if parts else ""
    lines = first + wrapped(f"{short_variant(table)} {note} {made}", 160)
    return len(first), [_set(line) for line in lines]


def repeats(rows: pd.DataFrame) -> str:
    """On how many seeds the points of a chart stand, where on more than one."""
    fewest, most = rows["seeds"].min(), rows["seeds"].max()
    return "" if most == 1 else f"Medians and quartiles over {most if fewest == most else f'{fewest} to {most}'} seeds."


def wrapped(text: str, width: int) -> list[str]:
    """Lines of a text of at most so many characters, but for words that are longer."""
    lines, line = [], ""
    for word in text.split():
        if len(line) + len(word) + 1 > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line]
