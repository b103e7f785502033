"""The ledger: what the paper's sections 3 to 5 state, the check that decides it on our numbers, and what came out.

Every claim has a function that reads the tables of the studies and returns an outcome with the numbers it rests on.
Nothing here is written down in advance but the statement, the check and, where we may differ, the reason looked for.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

Tables = Mapping[str, pd.DataFrame]


class ClaimOutcome(enum.StrEnum):
    """What became of a claim."""

    REPRODUCED = "reproduced"
    NOT_REPRODUCED = "not reproduced"
    UNDECIDED = "cannot be decided"


@dataclass(frozen=True)
class Claim:
    """A statement of the paper: ``where`` it stands, the ``statement``, the ``check`` in words, how to ``decide`` it.

    ``decide`` maps the tables to an outcome and the numbers behind it, as text; ``note`` says why we differ, or on what
    assumption the outcome rests.
    """

    name: str
    where: str
    statement: str
    check: str
    decide: Callable[[Tables], tuple[ClaimOutcome, str]]
    note: str = ""


def outcome(held: bool) -> ClaimOutcome:
    """Reproduced or not."""
    return ClaimOutcome.REPRODUCED if held else ClaimOutcome.NOT_REPRODUCED


def undecided(reason: str) -> Callable[[Tables], tuple[ClaimOutcome, str]]:
    """A claim that our numbers cannot decide, with the reason."""
    return lambda _: (ClaimOutcome.UNDECIDED, reason)


def decided(claims: tuple[Claim, ...], tables: Tables) -> list[dict[str, str]]:
    """Decide all claims on the tables: a row a claim, all texts."""
    rows = []
    for claim in claims:
        result, numbers = claim.decide(tables)
        rows.append(
            {
                "name": claim.name,
                "where": claim.where,
                "statement": claim.statement,
                "check": claim.check,
                "outcome": str(result),
                "numbers": numbers,
                "note": claim.note,
            }
        )
    return rows


def growth_exponent(x: pd.Series, y: pd.Series) -> float:
    """Slope of log y over log x, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
