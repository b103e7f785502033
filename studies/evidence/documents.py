"""Numbers that README and the documentation state, and whether the ledger has a row for them.

    python -m studies.evidence.documents

A paragraph, list or table with a number and a unit is marked, in a comment at its end or after the heading of its
section: ``<!-- evidence: group, group -->`` where the numbers are results, which then have to be in rows of these
groups of ``rows.yaml``, or ``<!-- settings -->`` where they are settings, definitions and examples. In what is marked
as evidence decimal numbers count without a unit as well. Of a table that is evidence every number counts, and a group's
``conditions`` do not found it; a column headed "required" is left out. What is compared is the number, rounded as it is
written or in a unit a thousand times as large or small, not its place in the sentence. Pages that a command makes are
left out.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from studies.evidence.compute import REPOSITORY
from studies.evidence.ledger import Group, read_groups
from towval.commands.console import errors_reported

MADE = ("claims.md", "evidence.md", "findings.md", "inputs.md", "scenes.md")
"""Pages that commands make from the code or from tables."""

_NUMBER = r"\d[\d,]*(?:\.\d+)?(?:e-?\d+)?"
_UNIT = (
    r"(?:mm|µm|nm|cm|m|°|%|s|ms|µs|ns|px|mrad|rad|Hz|kg|g|N|N/m|mm/s|m/s|kbit/s|MB|kB|GB|×|min|CPU minutes|seconds|"
    r"minutes)"
)
_JOINED = r"(?:\s*(?:,|/|to|and|or|±|–)\s*)"
_MEASURE = re.compile(rf"(?<![\w.])((?:{_NUMBER}{_JOINED})*{_NUMBER})\s?{_UNIT}(?![\w/²³])")
_DECIMAL = re.compile(r"(?<![\w.,])\d[\d,]*\.\d+(?![\w.])")
_MARK = re.compile(r"<!-- (evidence: ([\w, ]+)|settings) -->")
_MEASURED = re.compile(
    rf"{_NUMBER}\s?(?:mm|µm|°|px)[^.|]*\bRMS\b|\bRMS[^.|]*{_NUMBER}\s?(?:mm|µm|°|px)|predicted / actual"
    rf"|\blab_(?:[ac]|small)\b[^.|]*(?:{_NUMBER}\s?{_UNIT}|\b0\.\d)|\b\d+ of (?:the )?\d+\b|\bseeds?\b"
    rf"|{_NUMBER}\s?(?:s|ms|minutes) of (?:CPU|wall)|\b(?:is|are) (?:late|early)\b[^.|]*{_NUMBER}\s?{_UNIT}"
)


@dataclass(frozen=True)
class Passage:
    """A paragraph, list or table: its text without marks, the groups that it cites, and whether it is settings."""

    document: str
    text: str
    groups: tuple[str, ...]
    settings: bool

    @property
    def is_table(self) -> bool:
        """Whether it is a table."""
        return self.text.startswith("|")

    @property
    def numbers(self) -> list[str]:
        """Numbers with a unit, in evidence decimal ones without; of a table of it all beyond first column and head."""
        if self.groups and self.is_table:
            head, _, *rows = (line.strip().strip("|").split("|") for line in self.text.splitlines())
            results = [k for k, name in enumerate(head) if k > 0 and name.strip() != "required"]
            cells = [re.sub("`[^`]*`", "", row[k]) for row in rows for k in results]
            return [number for cell in cells for number in re.findall(rf"(?<![\w.]){_NUMBER}", cell)]
        plain = re.sub("`[^`]*`", "", self.text)
        measures = [number for found in _MEASURE.findall(plain) for number in re.findall(_NUMBER, found)]
        return list(dict.fromkeys(measures + (_DECIMAL.findall(plain) if self.groups else [])))


def passages(document: str, text: str) -> Iterator[Passage]:
    """The passages of a document, code left out."""
    text = re.sub(r"(?ms)^```.*?^```$", "", text)
    text = re.sub(r"(?m)^(#+ .*)$", r"\n\1\n", text)
    of_section: list[str] = []
    waiting: tuple[str, list[str]] | None = None
    headed = False
    for block in [*re.split(r"\n\s*\n", text), "# end"]:
        plain = _MARK.sub("", block).strip()
        marks = [found[0] for found in _MARK.findall(re.sub("`[^`]*`", "", block))]  # a mark in code is an example
        if headed and block.strip().startswith("<!--"):
            of_section += marks[:1]
            marks = marks[1:]
        headed = plain.startswith("#")
        if not plain:
            if waiting is not None:
                waiting[1].extend(marks)
            continue
        if waiting is not None:
            yield _passage(document, waiting[0], [*waiting[1], *of_section])
        if headed:
            of_section, waiting = marks, None
        else:
            waiting = None if block.startswith("    ") else (plain, marks)


def _passage(document: str, text: str, marks: list[str]) -> Passage:
    groups = [
        name.strip() for mark in marks if mark != "settings" for name in mark.removeprefix("evidence:").split(",")
    ]
    return Passage(document, text, tuple(dict.fromkeys(groups)), "settings" in marks)


def documented(repository: Path = REPOSITORY) -> list[Passage]:
    """The passages of README and of the pages that are written by hand."""
    pages = [repository / "README.md", *sorted((repository / "docs").glob("*.md"))]
    pages = [page for page in pages if page.name not in MADE]
    return [each for page in pages for each in passages(page.name, page.read_text(encoding="utf-8"))]


def unfounded(found: list[Passage], groups: Mapping[str, Group]) -> list[str]:
    """What is stated without a row, and what is marked as a setting but says that it was measured."""
    wrong = []
    for each in found:
        where = f"{each.document}: {' '.join(each.text.split())[:70]}"
        wrong += [f"{where}: there is no group {name}" for name in each.groups if name not in groups]
        known = {value for name in each.groups if name in groups for value in numbers_in(groups[name], each.is_table)}
        missing = [number for number in each.numbers if not _is_among(number, known)]
        if each.groups:
            wrong += [f"{where}: no row has {number}" for number in missing]
        elif each.numbers and not each.settings:
            wrong.append(f"{where}: {', '.join(each.numbers)} without a mark: name the group of rows, or `settings`")
        elif each.numbers and _MEASURED.search(each.text):
            wrong.append(f"{where}: marked as settings, but it speaks of what was measured")
    return wrong


def _is_among(number: str, known: set[float]) -> bool:
    """Whether a number as written is one of those known, rounded as it is or in another unit."""
    text = number.rstrip(",").replace(",", "")
    value, decimals = float(text), len(text.partition(".")[2].partition("e")[0])
    if "." not in text and "e" not in text:
        decimals = len(text.rstrip("0")) - len(text)
    for one in known:
        for scaled in (one, 1e3 * one, 1e-3 * one):
            rounded = float(f"{scaled:.{decimals}e}") if "e" in text else round(scaled, decimals)
            near = decimals > 0 or abs(scaled - value) <= _ROUNDED * abs(value)
            if value == scaled or (rounded == value and near and (value or scaled == one)):
                return True
    return False


_ROUNDED = 0.05
"""By how much a number may be rounded that is written without decimals."""


def numbers_in(group: Group, of_table: bool = False) -> set[float]:
    """All numbers that found a passage: what is stated and on what data, and for a sentence on what conditions."""
    texts = [group.data, *(text for each in group.statements for text in (each.name, each.stated))]
    texts += [] if of_table else [group.says, *group.conditions]
    found = {number for text in texts for number in re.findall(rf"(?<![\w.]){_NUMBER}", text)}
    return {float(number.rstrip(",").replace(",", "")) for number in found}


@errors_reported()
def main() -> None:
    """Print what is stated without a row."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    print("\n".join(unfounded(documented(), read_groups())) or "every number has a row")


if __name__ == "__main__":
    main()
