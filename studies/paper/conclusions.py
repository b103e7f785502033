"""What to conclude from a figure of the paper: the outcomes of the claims about it, decided on the tables it shows."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from studies.charts import short_variant, wrapped
from studies.paper.claims import CLAIMS
from studies.paper.ledger import ClaimOutcome
from studies.registry import PAPER
from towval.report.style import figure_function

SHORT = "Short variant: what is to be concluded rests on the whole study (docs/claims.md)."
_LINE_IN, _CHARACTERS = 0.13, 150


def conclusion(name: str, tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """The claims about ``figure_<n>`` or ``table_<n>`` by their outcome; those that need other tables are left out."""
    kind, _, number = name.partition("_")
    place = re.compile(rf"{'Table' if kind == 'table' else 'Fig.'} {number}\b")
    names: dict[ClaimOutcome, list[str]] = {}
    for claim in CLAIMS:
        if not place.search(claim.where):
            continue
        try:
            result, _ = claim.decide(tables)
        except KeyError as missing:
            if missing.args[0] not in PAPER:
                raise
            continue
        names.setdefault(result, []).append(claim.name)
    if not names:
        return ["Conventions and names, drawn to scale: no claim of the paper rests on it."]
    found = [f"{str(result).capitalize()}: {'; '.join(names[result])}." for result in ClaimOutcome if result in names]
    short = any(short_variant(table) for table in tables.values())
    return [*found, SHORT if short else "By which check, and what rests on other tables as well: docs/claims.md."]


@figure_function
def conclude(figure: Figure, texts: Sequence[str]) -> None:
    """Write texts above a figure, which grows by their height."""
    lines = [line for text in texts for line in wrapped(text, _CHARACTERS)]
    width, height = figure.get_size_inches()
    taller = height + _LINE_IN * (len(lines) + 1)
    share = height / taller
    figure.set_size_inches(width, taller)
    layout = figure.get_layout_engine()
    if isinstance(layout, ConstrainedLayoutEngine):
        layout.set(rect=(0, 0, 1, share))
    else:
        for axes in figure.axes:
            left, bottom, across, up = axes.get_position().bounds
            axes.set_position((left, share * bottom, across, share * up))
    figure.text(0.012, 1 - 0.05 / taller, "\n".join(lines), fontsize=7, weight="bold", va="top", color="#1d1d1b")
