"""Command of the ledger: tables of the paper's studies → the paper's claims as Markdown and JSON."""

from __future__ import annotations

import datetime
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from studies.evidence.compute import commit
from studies.frame import read_table
from studies.paper.claims import CLAIMS
from studies.paper.controls import Place
from studies.paper.ledger import ClaimClass, ClaimOutcome, decided, without_control
from towval.io.atomic import write_text
from towval.model.errors import RefusedError

_HEAD = """# Claims of the paper, one by one

Made by the rule `claims` from the tables in `results/figures/tables/`; do not edit. The same as data is
`claims.json`. Every outcome is decided by the check beside it on our own numbers, with the scene of
`src/towval/workflow/plan.yaml`, which marks the paper's values and our assumptions.

- *Statement*: what stands in quotation marks is the paper's own wording, the rest is ours.
- *Class* says how much an outcome means: found as it is, follows by construction, or after an assumed setting was tuned
  with the figure in view.
- *Control* plants a fault and decides the claim again (`studies/paper/controls.py`): a check that still holds then
  proves nothing. It says where the fault is: in the program, in what the program is given, or in the result read, which
  shows that the check can fail but not that it would notice a wrong program. Where a claim is not reproduced, the
  control is a change with which it would be. A decided claim without such a control is refused.
- *Other settings* decides the claim with other values of what the paper does not state (`studies/paper/variants.py`),
  for the rows of the response surface on 12 by 13 points.
"""


def write_ledger(plan: Mapping[str, Any], tables: Mapping[str, Path], outputs: Sequence[Path]) -> None:
    """Decide all claims and write the ledger.

    Parameters
    ----------
    plan : mapping
        The scene, ``src/towval/workflow/plan.yaml``, kept in the JSON.
    tables : mapping
        CSV files of the studies by name.
    outputs : sequence of Path
        Files to write: the ledger as ``.md``, the same as data as ``.json``.
    """
    read = {name: read_table(path) for name, path in tables.items()}
    rows = decided(CLAIMS, read)
    if unproven := without_control(rows, read):
        raise RefusedError(
            "a claim is decided by a check that no planted fault turns",
            got=", ".join(unproven),
            remedy="plant one in studies/paper/controls.py that does",
        )
    made = made_of(read)
    data = json.dumps({"claims": rows, "made": made, "plan": plan}, indent=2, ensure_ascii=False) + "\n"
    for output in outputs:
        write_text(output, data if output.suffix == ".json" else markdown(rows, made))


def made_of(tables: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """With what the tables were made: processors, commit, versions and today's date."""
    joined = {
        name: "; ".join(sorted({str(value) for table in tables.values() for value in table[name].unique()}))
        for name in ("machine", "versions")
    }
    return {"date": datetime.date.today().isoformat(), "commit": commit()} | joined


def markdown(rows: Sequence[Mapping[str, str]], made: Mapping[str, str]) -> str:
    """The ledger as Markdown: counts, a table of outcomes, then each claim with its check and numbers."""
    lines = [
        _HEAD,
        _counted(rows),
        "",
        _places(rows),
        "",
        f"Made on {made['date']} at commit {made['commit']} with {made['versions']}. Times are those of "
        f"{made['machine']}.",
        "",
        "| section | claim | outcome | class |",
        "|---|---|---|---|",
    ]
    lines += [f"| {row['where']} | {row['name']} | {row['outcome']} | {row['kind'] or '–'} |" for row in rows]
    for row in rows:
        lines += ["", f"## {row['name']}", "", f"Section {row['where']}: {row['statement']}", ""]
        lines += [
            f"- Check: {row['check']}",
            f"- Ours: {row['numbers']}.",
            f"- Outcome: **{row['outcome']}**{', ' if row['kind'] else ''}{row['kind']}.",
        ]
        optional = {"Control": "control", "Other settings": "variants", "Note": "note", "To decide it": "takes"}
        lines += [f"- {title}: {row[name]}" for title, name in optional.items() if row[name]]
    return "\n".join(lines) + "\n"


def _places(rows: Sequence[Mapping[str, str]]) -> str:
    """Where the faults of the controls are: those in the program alone show that a wrong program is noticed."""
    counts = {place: sum(row["control"].count(f", {place}: ") for row in rows) for place in Place}
    return "Of the controls " + ", ".join(f"{count} are {place}" for place, count in counts.items()) + "."


def _counted(rows: Sequence[Mapping[str, str]]) -> str:
    """How many decisions on how many statements, and what each class came to."""
    statements = len({(row["where"], row["statement"]) for row in rows})
    undecided = sum(row["outcome"] == ClaimOutcome.UNDECIDED for row in rows)
    counts = Counter((row["kind"], row["outcome"]) for row in rows)
    parts = [
        f"{kind}: "
        + ", ".join(f"{counts[kind, outcome]} {outcome}" for outcome in ClaimOutcome if counts[kind, outcome])
        for kind in ClaimClass
    ]
    return f"{len(rows)} decisions on {statements} statements. {'; '.join(parts)}; {undecided} cannot be decided."
