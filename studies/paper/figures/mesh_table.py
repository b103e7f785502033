"""Table 1: cost of the quasi-static model on meshes and with the boundary integral, the paper's seconds beside ours."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.frame import Drawing
from towval.report.style import PAGE_WIDTH_IN, figure_function

HEADINGS = (
    "Elem. size (m)",
    "N. mesh elem.\npaper",
    "N. mesh elem.\nours",
    "QSM compute time (s)\npaper",
    "QSM compute time (s)\nours",
    "Timed steps",
    "Relative error of\nthe heading rate",
)


COLUMNS = (0.0, 0.16, 0.29, 0.42, 0.6, 0.78, 0.89)
"""Where the columns begin, as shares of the width."""


@figure_function
def mesh_table_figure(table: pd.DataFrame) -> Figure:
    """Table 1 as a figure, one row a method.

    Parameters
    ----------
    table : DataFrame
        The study ``meshes``.
    """
    rows = [_row(row) for _, row in table.sort_values("element_size_m").iterrows()]
    figure = Figure(figsize=(PAGE_WIDTH_IN, 0.2 * (len(rows) + 4)))
    axes = figure.add_axes((0.01, 0.08, 0.98, 0.9))
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(len(rows) + 1.1, -2.0))
    for place, heading in zip(COLUMNS, HEADINGS, strict=True):
        axes.text(place, -0.75, heading, fontsize=7.5, va="center")
    for line, row in enumerate(rows):
        for place, text in zip(COLUMNS, row, strict=True):
            axes.text(place, line + 0.55, text, fontsize=7.5, va="center")
    for height, width in ((-1.9, 0.9), (0.0, 0.5), (len(rows) + 0.15, 0.9)):
        axes.axhline(height, color="#222222", lw=width)
    note = (
        f"Seconds are for {_steps(table):,} steps. A mesh balances the moment at each, is timed over the steps listed, "
        "and scaled; the boundary integral balances it at the nodes of few panels."
    )
    axes.text(0.0, len(rows) + 0.75, note, fontsize=7, va="center", color="#555555")
    return figure


def _steps(table: pd.DataFrame) -> int:
    """Steps to which all times of the table are scaled."""
    return int(table["steps"].iloc[0])


def _row(row: pd.Series) -> tuple[str, ...]:
    if np.isnan(row["element_size_m"]):
        size, cells, paper_cells, paper_seconds, error = "boundary integral", "–", "–", "–", "–"
    else:
        size, cells = f"{row['element_size_m']:.4f}", f"{row['cells']:,.0f}"
        paper_cells, paper_seconds = f"{row['paper_cells']:,.0f}", f"{row['paper_seconds']:.2f}"
        error = f"{row['rate_error']:.1e}"
    return size, paper_cells, cells, paper_seconds, f"{row['seconds']:.2f}", f"{row['timed_steps']:,.0f}", error


TABLE_1 = Drawing(("meshes",), lambda _, tables: mesh_table_figure(tables["meshes"]))
