"""The page of the studies: one HTML file with all charts that there are, which opens offline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from studies.charts import FLAGGED, RIGHT, SILENT, medians, unbeaten
from towval.io.atomic import write_text
from towval.report.view import inline_svg

_MOST_ROWS = 60


@dataclass(frozen=True)
class ChartView:
    """A chart as the page shows it."""

    name: str
    title: str
    summary: str
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


def front_view(name: str, title: str, table: pd.DataFrame, svg: str, *, front: bool) -> ChartView:
    """A chart of error against cost, with the methods that no other beats as a table."""
    rows = medians(table)
    default = rows[rows["default"].astype(float) > 0]
    said = "; ".join(f"{row.series}, {row.setting}" for row in default.drop_duplicates("setting").itertuples())
    summary = f"{len(rows)} points" + (f", default: {said}." if said else ".")
    best = pd.concat([unbeaten(part) for _, part in rows.groupby("panel", sort=False)]) if front else rows.iloc[:0]
    cells = tuple(
        (row.panel, row.series, row.setting, f"{row.cost:.3g}", f"{row.error:.3g}") for row in best.itertuples()
    )
    columns = ("panel", "method", "setting", "cost", "error")
    return ChartView(name, title, summary, inline_svg(svg, name), f"{name}.csv", "Not beaten in both", columns, cells)


def map_view(name: str, title: str, table: pd.DataFrame, svg: str) -> ChartView:
    """Maps of judgements, with the cells that are silently wrong as a table."""
    counts = table["judgement"].value_counts()
    summary = (
        ", ".join(f"{counts.get(kind, 0)} {kind}" for kind in (RIGHT, FLAGGED, SILENT)) + f" of {len(table)} cells."
    )
    wrong = table[table["judgement"] == SILENT]
    cells = tuple((row.map, f"{row.x}", f"{row.y}", f"{row.error:.3g}") for row in wrong.head(_MOST_ROWS).itertuples())
    title_of_rows = f"Silently wrong: {len(wrong)} cells" + (
        f", the first {_MOST_ROWS}" if len(wrong) > _MOST_ROWS else ""
    )
    columns = ("map", "x", "y", "error [m]")
    return ChartView(name, title, summary, inline_svg(svg, name), f"{name}.csv", title_of_rows, columns, cells)


def write_study_page(path: Path, products: Sequence[ProductView]) -> None:
    """Write the page, whole or not at all."""
    environment = Environment(
        loader=PackageLoader("studies"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # The package's own style sheet, never data: it goes into the page as it is.
    css = Markup((files("towval.report") / "templates" / "report.css").read_text(encoding="utf-8"))
    write_text(path, environment.get_template("study.html.j2").render(products=products, css=css))


def read_svg(path: Path) -> str:
    """A saved figure as an ``<svg>`` element, without the XML prologue."""
    text = path.read_text(encoding="utf-8")
    return text[text.index("<svg") :]
