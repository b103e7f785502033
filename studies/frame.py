"""The two products of the studies, speed against accuracy and stability: what a chart is, and where each is computed.

A chart's module has ``STUDY``. Its parts are plain mappings, so that a workflow can make a job of each and see when it
has changed; its rows are one tidy table. Modules are imported by name when they are needed, so that an edit in one of
them runs that one again.
"""

from __future__ import annotations

import enum
import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Row = dict[str, Any]
Part = dict[str, Any]

TRADEOFF = {
    "friction": "tradeoff.friction",
    "dynamics": "tradeoff.dynamics",
    "calibration": "tradeoff.calibration",
    "tracking": "tradeoff.tracking",
    "decimation": "tradeoff.decimation",
    "presets": "tradeoff.presets",
}
"""Charts of error against cost, and the module of this package that computes each."""

STABILITY = {
    "integrators": "maps.integrators",
    "open_loop": "maps.open_loop",
    "planner": "maps.planner",
    "tracker": "maps.tracker",
    "views": "maps.views",
    "carry_over": "maps.carry_over",
}
"""Maps of where methods are right, flagged or silently wrong, and the module that computes each."""


class Judgement(enum.StrEnum):
    """What became of a method somewhere on a map."""

    RIGHT = "right"
    """Within the error allowed, and nothing flagged."""
    FLAGGED = "flagged"
    """The method said by itself that something is wrong, or refused; whether it was is another matter."""
    SILENTLY_WRONG = "silently wrong"
    """Beyond the error allowed, without a word."""


def judged(error: float, allowed: float, flags: list[str]) -> Row:
    """Columns of a cell of a map: judgement, error, what was allowed, and the codes of what was flagged."""
    unflagged = Judgement.RIGHT if error <= allowed else Judgement.SILENTLY_WRONG
    judgement = Judgement.FLAGGED if flags else unflagged
    return {"judgement": str(judgement), "error": error, "allowed": allowed, "flags": " ".join(sorted(set(flags)))}


@dataclass(frozen=True)
class Scatter:
    """A chart of error against cost: rows have ``panel``, ``series``, ``setting``, ``cost``, ``error``, ``default``.

    Without ``front`` the points of a series are joined instead of drawing what no other point beats.
    """

    title: str
    cost: str
    error: str
    note: str
    front: bool = True


@dataclass(frozen=True)
class Maps:
    """Maps of judgements: rows have ``map``, ``x``, ``y`` and the columns of :func:`judged`.

    ``axes`` give the labels of x and y by the name of the map.
    """

    title: str
    axes: dict[str, tuple[str, str]]
    note: str


@dataclass(frozen=True)
class Study:
    """A chart with the parts that it is computed in, quick or full, and the function that computes one of them."""

    chart: Scatter | Maps
    parts: Callable[[bool], dict[str, Part]]
    rows: Callable[..., list[Row]]


def study(chart: str) -> Study:
    """The study of that name."""
    module: Study = importlib.import_module(f"studies.{module_of(chart)}").STUDY
    return module


def module_of(chart: str) -> str:
    """Name of the module in this package that computes a chart."""
    return (TRADEOFF | STABILITY)[chart]
