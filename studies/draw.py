"""Command of all charts: tables of studies → PDF, SVG and PNG."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from studies.charts import advice, map_chart, scatter_chart
from studies.frame import Drawing, Maps, Outcomes, Scatter, Study, loaded, read_table
from studies.outcome_charts import outcome_chart
from studies.paper.conclusions import conclude, conclusion
from towval.report.style import save_figure


def draw_chart(name: str, chart: str, plan: Mapping[str, Any], tables: Mapping[str, Path], folder: Path) -> None:
    """Draw one chart and save it in three formats.

    Parameters
    ----------
    name : str
        Name of the files, without an ending.
    chart : str
        Reference ``module:name`` of a study with a chart, or of a drawing.
    plan : mapping
        The scene of the paper, ``src/towval/workflow/plan.yaml``; charts of other studies need none.
    tables : mapping
        CSV files of the studies, by name.
    folder : Path
        Where the files go.
    """
    source: Study | Drawing = loaded(chart)
    read = {study: read_table(path) for study, path in tables.items()}
    figure = figure_of(source, plan, read)
    if isinstance(source, Drawing):
        conclude(figure, conclusion(name, read))
    save_figure(figure, folder, name)


def figure_of(source: Study | Drawing, plan: Mapping[str, Any], tables: Mapping[str, pd.DataFrame]) -> Figure:
    """A chart as a matplotlib figure, from the tables of studies by name; a study has one table, its own."""
    if isinstance(source, Drawing):
        return source.draw(plan, tables)
    (table,), chart = tables.values(), source.chart
    if isinstance(chart, Outcomes):
        note = f"{chart.note} {chart.truth}".strip()
        stage = f"CPU time of {chart.stage} [s]"
        return outcome_chart(table, chart.title, stage, chart.planted, note, advice(chart, table))
    if isinstance(chart, Scatter):
        note = f"{chart.note} {chart.truth}".strip()
        labels = (chart.cost, chart.error)
        return scatter_chart(table, chart.title, labels, note, advice(chart, table), front=chart.front)
    if isinstance(chart, Maps):
        return map_chart(table, chart.title, chart.axes, chart.note, chart.take, chart.default)
    raise ValueError("this study has no chart of its own")
