"""Command of the ledger: tables of the paper's studies → the paper's claims as Markdown and JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.paper.claims import CLAIMS
from studies.paper.ledger import ClaimOutcome, decided
from towval.io.atomic import write_text
from towval.io.plan_files import read_table

_HEAD = """# Claims of the paper, one by one

Made by the rule `claims` from the tables in `results/figures/tables/`; do not edit. The same as data is
`claims.json`. Every outcome is decided by the check beside it on our own numbers, with the scene of
`src/towval/workflow/plan.yaml`, which marks the paper's values and our assumptions.

- *Class* says how much an outcome means: found as it is, follows by construction, or after an assumed setting was tuned
  with the figure in view.
- *Control* plants a fault in the program and decides the claim again (`studies/paper/controls.py`): a check that still
  holds then proves nothing. Where a claim is not reproduced, the control is a change with which it would be.
- *Other settings* decides the claim with other values of what the paper does not state
  (`studies/paper/variants.py`).
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
    rows = decided(CLAIMS, {name: read_table(path) for name, path in tables.items()})
    data = json.dumps({"claims": rows, "plan": plan}, indent=2, ensure_ascii=False) + "\n"
    for output in outputs:
        write_text(output, data if output.suffix == ".json" else markdown(rows))


def markdown(rows: Sequence[Mapping[str, str]]) -> str:
    """The ledger as Markdown: counts, a table of outcomes, then each claim with its check and numbers."""
    counts = Counter(row["outcome"] for row in rows)
    summary = ", ".join(f"{counts[outcome]} {outcome}" for outcome in ClaimOutcome)
    lines = [
        _HEAD,
        f"{len(rows)} statements: {summary}.",
        "",
        "| section | claim | outcome | class |",
        "|---|---|---|---|",
    ]
    lines += [f"| {row['where']} | {row['name']} | {row['outcome']} | {row['kind'] or '–'} |" for row in rows]
    for row in rows:
        lines += ["", f"## {row['name']}", "", f"Section {row['where']}: “{row['statement']}”", ""]
        lines += [
            f"- Check: {row['check']}",
            f"- Ours: {row['numbers']}.",
            f"- Outcome: **{row['outcome']}**{', ' if row['kind'] else ''}{row['kind']}.",
        ]
        optional = {"Control": "control", "Other settings": "variants", "Note": "note", "To decide it": "takes"}
        lines += [f"- {title}: {row[name]}" for title, name in optional.items() if row[name]]
    return "\n".join(lines) + "\n"
