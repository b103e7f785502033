"""The ledger: what the paper's sections 2 to 5 state, the check that decides it on our numbers, and what came out.

Every claim has a function that reads the tables of the studies and returns an outcome with the numbers it rests on.
Nothing here is written down in advance but the statement, the check and, where we may differ, the reason looked for.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

Tables = Mapping[str, pd.DataFrame]


class ClaimOutcome(enum.StrEnum):
    """What became of a claim."""

    REPRODUCED = "reproduced"
    NOT_REPRODUCED = "not reproduced"
    UNDECIDED = "cannot be decided"


class ClaimClass(enum.StrEnum):
    """How much an outcome says."""

    FOUND = "found as it is"
    """Computed with values of the paper, or assumed ones that were not chosen for it."""
    CONSTRUCTION = "follows by construction"
    """The model cannot give anything else; a failure would be a defect of the program."""
    TUNED = "after a setting was tuned with the figure in view"
    """An assumed setting was chosen so that the figure looks like the paper's."""


@dataclass(frozen=True)
class Claim:
    """A statement of the paper: ``where`` it stands, the ``statement``, the ``check`` in words, how to ``decide`` it.

    ``decide`` maps the tables to an outcome and the numbers behind it, as text; ``kind`` how much the outcome says;
    ``note`` why we differ, or on what assumption the outcome rests; ``takes`` what it would take to decide it better.
    """

    name: str
    where: str
    statement: str
    check: str
    decide: Callable[[Tables], tuple[ClaimOutcome, str]]
    note: str = ""
    kind: ClaimClass = ClaimClass.FOUND
    takes: str = ""


def outcome(held: bool) -> ClaimOutcome:
    """Reproduced or not."""
    return ClaimOutcome.REPRODUCED if held else ClaimOutcome.NOT_REPRODUCED


def undecided(reason: str) -> Callable[[Tables], tuple[ClaimOutcome, str]]:
    """A claim that our numbers cannot decide, with the reason."""
    return lambda _: (ClaimOutcome.UNDECIDED, reason)


def decided(claims: Sequence[Claim], tables: Tables) -> list[dict[str, str]]:
    """Decide all claims on the tables: a row a claim, all texts.

    With the tables ``controls`` and ``variants`` each row also says what became of its planted fault, and with which
    other values of the assumed settings the outcome is another.
    """
    rows = []
    for claim in claims:
        result, numbers = claim.decide(tables)
        texts = {name: getattr(claim, name) for name in ("name", "where", "statement", "check", "note", "takes")}
        # How an outcome came about says nothing where there is none.
        kind = "" if result is ClaimOutcome.UNDECIDED else str(claim.kind)
        rows.append(texts | {"kind": kind, "outcome": str(result), "numbers": numbers})
        rows[-1] |= {"control": _control_of(claim, tables), "variants": _variants_of(claim, result, tables)}
    return rows


def _control_of(claim: Claim, tables: Tables) -> str:
    if "controls" not in tables:
        return ""
    rows = tables["controls"]
    rows = rows[rows["claim"] == claim.name]
    return "; ".join(f"{row.fault}, {row.place}: {row.outcome} ({row.numbers})" for row in rows.itertuples())


def without_control(rows: Sequence[Mapping[str, str]], tables: Tables) -> list[str]:
    """Claims that are decided, but no planted fault turns what their check says."""
    if "controls" not in tables:
        return [row["name"] for row in rows if row["outcome"] != ClaimOutcome.UNDECIDED]
    found = tables["controls"]
    return [
        row["name"]
        for row in rows
        if row["outcome"] != ClaimOutcome.UNDECIDED
        and not (found.loc[found["claim"] == row["name"], "outcome"] == _OTHER[row["outcome"]]).any()
    ]


_OTHER = {
    str(ClaimOutcome.REPRODUCED): str(ClaimOutcome.NOT_REPRODUCED),
    str(ClaimOutcome.NOT_REPRODUCED): str(ClaimOutcome.REPRODUCED),
}


def _variants_of(claim: Claim, result: ClaimOutcome, tables: Tables) -> str:
    """Settings with which a claim is decided alike, and those with which it is not."""
    if "variants" not in tables:
        return ""
    rows = tables["variants"]
    rows = rows[rows["claim"] == claim.name]
    alike = rows["outcome"] == str(result)
    parts = [
        f"{word} with {', '.join(rows.loc[held, 'setting'])}"
        for word, held in (("the same", alike), ("otherwise", ~alike))
        if held.any()
    ]
    return "; ".join(parts)


def growth_exponent(x: pd.Series, y: pd.Series) -> float:
    """Slope of log y over log x, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
