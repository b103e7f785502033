"""The frame of all studies: parts → rows → table → chart.

A study is cut into *parts*, plain mappings, so that a workflow can make a job of each and see when it has changed. A
part gives *rows*; the rows of all parts are one tidy table; charts are drawn from tables. :mod:`studies.registry` names
the studies and charts. Nothing here imports a study: modules are loaded by reference when they are needed, so that an
edit in one reruns that one only.
"""

from __future__ import annotations

import enum
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from towval.model.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Row = dict[str, Any]
Part = dict[str, Any]

SWEEPS = ("sensitivity", "closed_loop", "table_1")
"""Sections of the plan that say what the paper's studies vary; the others describe the scene."""


class Judgement(enum.StrEnum):
    """Outcome of a method in one cell of a map."""

    RIGHT = "right"
    """Within the error allowed, and nothing flagged."""
    FLAGGED = "flagged"
    """The method reported a problem or refused, whether or not its result is off."""
    SILENTLY_WRONG = "silently wrong"
    """Beyond the error allowed, and nothing reported."""


def judged(error: float, allowed: float, flags: list[str]) -> Row:
    """Columns of a cell of a map: judgement, error, error allowed, and the codes of what was flagged."""
    unflagged = Judgement.RIGHT if error <= allowed else Judgement.SILENTLY_WRONG
    judgement = Judgement.FLAGGED if flags else unflagged
    return {"judgement": str(judgement), "error": error, "allowed": allowed, "flags": " ".join(sorted(set(flags)))}


def worst(cells: Sequence[Row]) -> Row:
    """Of the columns of :func:`judged` the silently wrong, else the flagged, else the right with the largest error."""
    order = list(Judgement)
    return max(cells, key=lambda cell: (order.index(cell["judgement"]), cell["error"] if cell["error"] > 0 else 0.0))


@dataclass(frozen=True)
class Scatter:
    """A chart of error against cost: rows have ``panel``, ``series``, ``setting``, ``cost``, ``error``, ``default``.

    ``take`` says in a line what to take; ``why`` the reasons, with numbers from the rows of
    :func:`studies.charts.medians`, and why the default is what it is where another is cheaper or better; ``truth`` what
    the errors are against, and what code that shares with what is measured. Rows that differ by their
    seed alone are drawn as median and quartiles. Without ``cost`` the panels' names are the costs. Without ``front``
    the points of a series are joined, and no Pareto front is drawn.
    """

    title: str
    cost: str
    error: str
    note: str
    take: str = ""
    why: Callable[[pd.DataFrame], str] | None = None
    truth: str = ""
    front: bool = True


@dataclass(frozen=True)
class Outcomes(Scatter):
    """A chart of what whole runs end with, against cost.

    Rows have the columns of :class:`Scatter`, with the panels of :data:`BOUND` and :data:`OFF` and errors in mm, and
    ``stage_cost``, the CPU time of the stage that is charted [s]; ``verdict`` and ``holds``, whether the bound held;
    ``wrong_verdict``, ``wrong_holds`` and ``wrong_error`` of the same run with a planted fault. ``planted`` says which,
    ``stage`` what the label of its cost names. ``why`` takes the rows of :func:`studies.charts.outcome_summary`.
    """

    planted: str = ""
    stage: str = ""


BOUND, OFF = "bound of the largest error", "largest error, simulated - true"
"""Panels of a chart of outcomes."""

REFUSED = "refused"
"""The verdict of a run of which a stage refuses to go on."""


@dataclass(frozen=True)
class Maps:
    """Maps of judgements: rows have ``map``, ``x``, ``y`` and the columns of :func:`judged`.

    ``axes`` give the labels of x and y by the name of the map, ``take`` says in a line what to conclude; ``default``
    holds, by the name of a map, the values that are defaults of the package, as ``{"x": value}`` or ``{"y": value}``.
    """

    title: str
    axes: dict[str, tuple[str, str]]
    note: str
    take: str
    default: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Drawing:
    """A figure drawn by a function of its own from the tables of one or more studies.

    ``draw`` takes the plan (``src/towval/workflow/plan.yaml``) and the tables by the name of the study.
    """

    tables: tuple[str, ...]
    draw: Callable[[Mapping[str, Any], Mapping[str, pd.DataFrame]], Figure]


@dataclass(frozen=True)
class Settings:
    """What the parts of studies depend on: ``quick`` for a short version; ``plan``, the scene of the paper."""

    quick: bool = False
    plan: Mapping[str, Any] = field(default_factory=dict)

    @property
    def scene(self) -> dict[str, Any]:
        """The plan without the sections that say what the studies vary: a longer sweep runs its new parts only."""
        return {name: section for name, section in self.plan.items() if name not in SWEEPS}


@dataclass(frozen=True)
class Study:
    """One study.

    ``parts`` by name, from the settings; ``rows`` computes one part, whose entries are its keyword arguments; ``chart``
    is drawn from the table, where the table has a chart of its own.
    """

    parts: Callable[[Settings], dict[str, Part]]
    rows: Callable[..., list[Row]]
    chart: Scatter | Maps | None = None


def point(rows: pd.DataFrame, series: str, setting: str, panel: str = "") -> Any:
    """The row of one method and setting in a table with one row each.

    Raises
    ------
    KeyError
        There is none.
    """
    return rows.set_index(["panel", "series", "setting"]).loc[(panel, series, setting)]


def default_point(rows: pd.DataFrame, panel: str = "") -> Any:
    """The row of the default in a panel."""
    return rows[(rows["panel"] == panel) & (rows["default"].astype(float) > 0)].iloc[0]


def loaded(reference: str) -> Any:
    """The object behind ``module:name``."""
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)


def module_of(reference: str) -> str:
    """The module of a reference ``module:name``."""
    return reference.partition(":")[0]


def read_table(path: Path) -> pd.DataFrame:
    """Read the table of a study, as :func:`towval.io.plan_files.write_table` wrote it."""
    import pandas as pd  # noqa: PLC0415  # not at start-up: a study that computes reads no table

    try:
        return pd.read_csv(path)
    except FileNotFoundError:
        raise InputError(f"{path} is missing", remedy="run the rule that makes it") from None
