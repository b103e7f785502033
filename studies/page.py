"""The page of the studies: one HTML file with all charts that exist, which opens offline, and summaries as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from studies.charts import FLAGGED, RIGHT, SILENT, advice, medians, short_variant, unbeaten
from studies.frame import Maps, Scatter, loaded, read_table
from towval.io.atomic import write_text
from towval.report.inline import FigureSheet

_MOST_ROWS = 60


@dataclass(frozen=True)
class ChartView:
    """A chart as the page shows it: ``counts`` beside the picture, which says itself what to take."""

    name: str
    title: str
    summary: str
    counts: str
    svg: Markup
    table: str
    rows_title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class ProductView:
    """The charts of one product, in order."""

    name: str
    charts: tuple[ChartView, ...]


def front_view(name: str, chart: Scatter, table: pd.DataFrame, svg: Markup) -> ChartView:
    """A chart of error against cost, with its Pareto front as a table: the methods that no other beats in both."""
    rows = medians(table)
    default = rows[rows["default"].astype(float) > 0]
    named = "; ".join(f"{row.series}, {row.setting}" for row in default.drop_duplicates("setting").itertuples())
    points = f"{len(rows)} points" + (f", default: {named}. {_beside(rows)}" if named else ".")
    panels = [unbeaten(part) for _, part in rows.groupby("panel", sort=False)]
    best = pd.concat(panels) if chart.front else rows.iloc[:0]
    cells = tuple(
        (row["panel"], row["series"], row["setting"], f"{row['cost']:.3g}", f"{row['error']:.3g}")
        for row in best.to_dict("records")
    )
    columns = ("panel", "method", "setting", "cost", "error")
    summary = _summary(advice(chart, table), table, points)
    return ChartView(name, chart.title, summary, points, svg, f"{name}.csv", "Pareto front", columns, cells)


def _summary(take: str, table: pd.DataFrame, counts: str) -> str:
    return " ".join(filter(None, (take, short_variant(table), counts)))


def better_than_default(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of :func:`studies.charts.medians` that cost less than their panel's default, with quartiles below its."""
    found = [
        panel[(panel["cost"] < default.cost) & (panel["high"] < default.low)]
        for _, panel in rows.groupby("panel", sort=False)
        for default in panel[panel["default"].astype(float) > 0].itertuples()
    ]
    return pd.concat(found) if found else rows.iloc[:0]


def _beside(rows: pd.DataFrame) -> str:
    """What is better than the default in cost and error alike, beyond scatter where there are several seeds."""
    better = better_than_default(rows)
    by_how_much = "better beyond scatter" if rows["seeds"].max() > 1 else "better"
    if better.empty:
        return f"Nothing is cheaper than the default and {by_how_much}."
    named = ", ".join(
        f"{row.series} {row.setting}".strip() + (f" ({row.panel})" if row.panel else "") for row in better.itertuples()
    )
    return f"Cheaper than the default and {by_how_much}: {named}."


def map_view(name: str, chart: Maps, table: pd.DataFrame, svg: Markup) -> ChartView:
    """Maps of judgements, with the cells that are silently wrong as a table."""
    counts = table["judgement"].value_counts()
    cells_by_kind = ", ".join(f"{counts.get(kind, 0)} {kind}" for kind in (RIGHT, FLAGGED, SILENT))
    counted = f"{cells_by_kind} of {len(table)} cells."
    wrong = table[table["judgement"] == SILENT]
    cells = tuple(
        (row["map"], f"{row['x']}", f"{row['y']}", f"{row['error']:.3g}")
        for row in wrong.head(_MOST_ROWS).to_dict("records")
    )
    title_of_rows = f"Silently wrong: {len(wrong)} cells" + (
        f", the first {_MOST_ROWS}" if len(wrong) > _MOST_ROWS else ""
    )
    columns = ("map", "x", "y", "error [m]")
    summary = _summary(chart.take, table, counted)
    return ChartView(name, chart.title, summary, counted, svg, f"{name}.csv", title_of_rows, columns, cells)


def write_study_page(path: Path, products: Sequence[ProductView], sheet: FigureSheet) -> None:
    """Write the page, whole or not at all; ``sheet`` holds what its figures share."""
    environment = Environment(
        loader=PackageLoader("studies"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # The package's own style sheet, never data: it goes into the page as it is.
    css = Markup((files("towval.report") / "templates" / "report.css").read_text(encoding="utf-8"))
    write_text(path, environment.get_template("study.html.j2").render(products=products, css=css, sheet=sheet))


def read_svg(path: Path) -> str:
    """A saved figure as an ``<svg>`` element, without the XML prologue."""
    text = path.read_text(encoding="utf-8")
    return text[text.index("<svg") :]


def write_page(product: str, products: Mapping[str, Mapping[str, str]], folder: Path, summary: Path) -> None:
    """Write the summary of a product and the page ``study.html`` of all charts in a folder.

    The page holds whatever charts there are, so that either product alone gives one, and the second completes it. Two
    products may be made at the same time: whichever ends last checks again after writing, so that no chart is left out.

    Parameters
    ----------
    product : str
        Name of the product.
    products : mapping
        References ``module:name`` of the studies by name, for each product.
    folder : Path
        With the tables and figures.
    summary : Path
        Markdown file to write: each chart with its numbers.
    """
    charts = products[product]
    write_text(summary, _markdown([_view(name, charts[name], folder, FigureSheet()) for name in charts]))
    shown: list[str] = []
    while shown != (found := _finished(products, folder)):
        sheet = FigureSheet()
        views = [
            ProductView(each, tuple(_view(name, charts[name], folder, sheet) for name in charts if name in found))
            for each, charts in products.items()
        ]
        write_study_page(folder / "study.html", views, sheet)
        shown = found


def _finished(products: Mapping[str, Mapping[str, str]], folder: Path) -> list[str]:
    """Names of the charts whose table and picture are in a folder."""
    names = [name for charts in products.values() for name in charts]
    return [name for name in names if all((folder / f"{name}.{ending}").is_file() for ending in ("csv", "svg"))]


def _view(name: str, reference: str, folder: Path, sheet: FigureSheet) -> ChartView:
    chart, table = loaded(reference).chart, read_table(folder / f"{name}.csv")
    svg = sheet.inline(read_svg(folder / f"{name}.svg"), name)
    if isinstance(chart, Scatter):
        return front_view(name, chart, table, svg)
    return map_view(name, chart, table, svg)


def _markdown(views: Sequence[ChartView]) -> str:
    lines: list[str] = []
    for view in views:
        lines += [f"## {view.title}", "", view.summary, ""]
        if view.rows:
            lines += [f"{view.rows_title}:", "", f"| {' | '.join(view.columns)} |", "|---" * len(view.columns) + "|"]
            lines += [f"| {' | '.join(row)} |" for row in view.rows] + [""]
    return "\n".join(lines)
