"""The ledger: statements with their tolerances, the checks that make their numbers anew, and faults planted in them.

``rows.yaml`` is the table; this module reads it and judges what the checks have measured. A check belongs to a group of
statements that one computation decides. Each of its faults replaces a part of the program by a wrong one: where no
statement of the group fails then, the check proves nothing.
"""

from __future__ import annotations

import enum
import importlib.util
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.machine import program_path
from towval.io.yaml_text import read_yaml
from towval.model.errors import InputError

ROWS = Path(__file__).with_name("rows.yaml")

Values = Mapping[str, float | str]
"""What a check has measured, by the names of its statements."""


class EvidenceClass(enum.StrEnum):
    """How far from us the truth is with which a number is compared."""

    OWN = "own synthetic"
    """Made by our worlds, which share no code with what is measured but where the row says so."""
    OTHER = "other program"
    """Made by a program that others wrote."""
    REAL = "real"
    """Measured in the world by others."""
    COST = "cost"
    """Times and sizes: no truth but the clock."""


class Effort(enum.StrEnum):
    """When a check runs."""

    QUICK = "quick"
    """Always, also with ``--config quick=true``."""
    WHOLE = "whole"
    """With ``snakemake evidence``."""
    LONG = "long"
    """When it is asked for by ``--config long=[GROUP]``."""


@dataclass(frozen=True)
class Check:
    """A computation that makes the numbers of a group anew.

    ``measure`` returns them by name; ``faults`` give, by their description, a context in which the program is wrong;
    ``needs`` are modules and programs, and folders below the one that ``TOWVAL_SHARED`` names, without which it cannot
    run.
    """

    measure: Callable[[], Values]
    faults: Mapping[str, Callable[[], AbstractContextManager[object]]]
    needs: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()
    """Folders of the repository whose code it runs in other processes: what they import does not show them."""

    def missing(self, shared: Path) -> list[str]:
        """What is needed and not here: names with a slash are folders, the others modules or programs."""
        return [
            name
            for name in self.needs
            if not ((shared / name).is_dir() if "/" in name else importlib.util.find_spec(name) or program_path(name))
        ]


@dataclass(frozen=True)
class Statement:
    """A number as the documents state it, ``stated`` with its ``unit``, and what it has to be for that to hold.

    ``rule`` is ``within`` (the number that follows, as a difference), ``factor`` (a ratio either way), ``at most``,
    ``at least`` (the stated number itself) or ``is`` (a word).
    """

    name: str
    stated: str
    unit: str
    rule: str
    allowed: float = 0.0

    def holds(self, measured: float | str | None) -> bool:
        """Whether what was measured is what is stated; nothing measured, and NaN, is not."""
        if measured is None:
            return False
        if self.rule == "is":
            return str(measured) == self.stated
        value, stated = float(measured), float(self.stated.replace(",", ""))
        rules: dict[str, Callable[[], bool]] = {
            "within": lambda: abs(value - stated) <= self.allowed * (1 + 1e-9),
            "factor": lambda: stated / self.allowed <= value <= stated * self.allowed,
            "at most": lambda: value <= stated,
            "at least": lambda: value >= stated,
        }
        return rules[self.rule]()

    @property
    def tolerance(self) -> str:
        """The rule in words."""
        return {
            "within": f"± {self.allowed:g}",
            "factor": f"factor {self.allowed:g}",
            "at most": "at most",
            "at least": "at least",
            "is": "the same",
        }[self.rule]


@dataclass(frozen=True)
class Group:
    """Statements that one computation decides.

    ``says`` what is stated; ``data`` on what; ``shares`` what the truth shares with the program, if anything;
    ``command`` makes the numbers by hand; ``check`` is a reference ``module:NAME``; ``conditions`` are numbers of the
    documents that are no results.
    """

    name: str
    says: str
    kind: EvidenceClass
    effort: Effort
    data: str
    command: str
    check: str
    statements: tuple[Statement, ...]
    shares: str = ""
    note: str = ""
    conditions: tuple[str, ...] = ()


def read_groups(path: Path = ROWS) -> dict[str, Group]:
    """The ledger's table, groups by name.

    Raises
    ------
    InputError
        A group or statement lacks a key, or has one that there is not.
    """
    return {name: _group(name, entry) for name, entry in read_yaml(path).items()}


def _group(name: str, entry: Mapping[str, Any]) -> Group:
    keys = dict(entry)
    try:
        statements = tuple(_statement(key, value) for key, value in keys.pop("states").items())
        kind, effort = EvidenceClass(keys.pop("class")), Effort(keys.pop("effort"))
        conditions = tuple(str(keys.pop("conditions", "")).split())
        return Group(name, kind=kind, effort=effort, statements=statements, conditions=conditions, **keys)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the group {name} of the ledger cannot be read", got=str(error), remedy="mend rows.yaml"
        ) from None


def made_now(groups: Mapping[str, Group], efforts: Iterable[Effort], long: Iterable[str]) -> dict[str, Group]:
    """Groups whose checks run now: long ones that are named, and no others then; else those of some efforts.

    Raises
    ------
    InputError
        A name is not that of a long group.
    """
    named, chosen = set(long), set(efforts)
    if not named:
        return {name: group for name, group in groups.items() if group.effort in chosen}
    known = {name for name, group in groups.items() if group.effort is Effort.LONG}
    if named - known:
        raise InputError(
            "there is no such long check", got=", ".join(sorted(named - known)), allowed=", ".join(sorted(known))
        )
    return {name: group for name, group in groups.items() if name in named}


def _statement(name: str, text: str) -> Statement:
    """A statement from ``"5.29 ° ± 0.01"``, ``"57 × at least"``, ``"0.7 µs factor 2"`` or ``"agrees"``."""
    words = str(text).split()
    if len(words) == 1:
        return Statement(name, words[0], "", "is")
    if words[-2] in ("±", "factor"):
        rule, allowed, words = "within" if words[-2] == "±" else "factor", float(words[-1]), words[:-2]
    elif words[-2:] in (["at", "most"], ["at", "least"]):
        rule, allowed, words = " ".join(words[-2:]), 0.0, words[:-2]
    else:
        rule, allowed = "is", 0.0
        return Statement(name, " ".join(words), "", rule, allowed)
    return Statement(name, words[0], " ".join(words[1:]), rule, allowed)
