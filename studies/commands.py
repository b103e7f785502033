"""Commands of the studies: the blocks of a chart → table and figure, all charts → the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from studies.charts import map_chart, scatter_chart
from studies.frame import STABILITY, TRADEOFF, Scatter, study
from studies.page import ChartView, ProductView, front_view, map_view, read_svg, write_study_page
from towval.io.atomic import write_text
from towval.io.plan_files import read_table, write_table
from towval.report.style import save_figure

PRODUCTS = {"tradeoff": TRADEOFF, "stability": STABILITY}


def draw_chart(chart: str, blocks: Sequence[Path], table: Path) -> None:
    """Gather the rows of a chart into one table and draw it, as PDF, SVG and PNG beside the table."""
    rows = pd.concat([read_table(block) for block in blocks], ignore_index=True)
    kind = study(chart).chart
    if isinstance(kind, Scatter):
        figure = scatter_chart(rows, kind.title, (kind.cost, kind.error), kind.note, front=kind.front)
    else:
        figure = map_chart(rows, kind.title, kind.axes, kind.note)
    write_table(table, rows)
    save_figure(figure, table.parent, chart)


def write_product(product: str, folder: Path, summary: Path) -> None:
    """Write the summary of a product and the page ``study.html`` of all charts in a folder.

    The page holds whatever charts there are, so that either product alone gives one, and the second completes it. Both
    may be made at once: whoever is last looks again after writing, so that no chart is left out.

    Parameters
    ----------
    product : str
        "tradeoff" or "stability".
    folder : Path
        With the tables and figures.
    summary : Path
        Markdown file to write: each chart with its numbers.
    """
    write_text(summary, _markdown([_view(chart, folder) for chart in PRODUCTS[product]]))
    shown: list[str] = []
    while shown != (found := _there(folder)):
        views = [
            ProductView(name, tuple(_view(chart, folder) for chart in charts if chart in found))
            for name, charts in PRODUCTS.items()
        ]
        write_study_page(folder / "study.html", views)
        shown = found


def _there(folder: Path) -> list[str]:
    return [chart for chart in TRADEOFF | STABILITY if all((folder / f"{chart}.{e}").is_file() for e in ("csv", "svg"))]


def _view(chart: str, folder: Path) -> ChartView:
    kind, table = study(chart).chart, read_table(folder / f"{chart}.csv")
    svg = read_svg(folder / f"{chart}.svg")
    if isinstance(kind, Scatter):
        return front_view(chart, kind.title, table, svg, front=kind.front)
    return map_view(chart, kind.title, table, svg)


def _markdown(views: Sequence[ChartView]) -> str:
    lines: list[str] = []
    for view in views:
        lines += [f"## {view.title}", "", view.summary, ""]
        if view.rows:
            lines += [f"{view.rows_title}:", "", f"| {' | '.join(view.columns)} |", "|---" * len(view.columns) + "|"]
            lines += [f"| {' | '.join(row)} |" for row in view.rows] + [""]
    return "\n".join(lines)
