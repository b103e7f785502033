"""Pages of docs/ that are tables of the package in print: ``python -m studies.tables.reference_pages`` writes them."""

from __future__ import annotations

import argparse
from pathlib import Path

from towval.commands.console import errors_reported
from towval.model.findings import FINDINGS
from towval.model.inputs import INPUTS

DOCS = Path(__file__).parents[2] / "docs"

_STAGES = ("calibrate", "track", "decimate", "simulate", "uncertainty", "compare", "campaign", "identify", "plan")

_FINDINGS = """# Findings

All remarks that the stages can make, printed from the table in `towval/model/findings.py` (`python -m
studies.tables.reference_pages`).
A text holds the names of its values in braces. The consequence is what a warning means for the verdict of its run:
*widens* names the uncertain inputs whose stated deviations are then too small, so that they are drawn three times as
wide; *excuses a difference* means that a difference beyond the tolerance may come from what the finding says, so that
the verdict is "cannot tell" where it would be "disagrees"; *not judged* means that the comparison says nothing about
the model, and the run gets no verdict.

| code | stage | severity | text | consequence |
|---|---|---|---|---|
"""


def findings_page() -> str:
    """docs/findings.md, a row a code."""
    rows = (
        f"| `{row.code}` | {row.stage} | {' or '.join(row.severities)} | {row.text} | {row.consequence} |"
        for row in sorted(FINDINGS.values(), key=lambda row: _STAGES.index(row.stage))
    )
    return _FINDINGS + "\n".join(rows) + "\n"


_INPUTS = """# Uncertain inputs

What is drawn for the validation uncertainty: the table of `towval/model/inputs.py` in print (`python -m
studies.tables.reference_pages`). *Stated by* is the key of campaign.yaml for the standard deviation of each component,
or the stage that gives the covariance. Inputs with the same unknown error in all runs of a campaign are shared by the
*campaign*, the others are those of a *run*. Inputs with a search range can be identified (`identify.parameters`).
*Left out*: where campaign.yaml states neither the value nor its deviation, this value and deviation are taken, and the
report names the input. Inputs *within* another act through its covariance and are not drawn by themselves.

| input | unit | stated by | default | because | left out | because | shared by | identified as |
|---|---|---|---|---|---|---|---|---|
"""


def inputs_page() -> str:
    """docs/inputs.md, a row an input."""
    rows = []
    for row in INPUTS.values():
        stated = row.stated
        source = f"`{stated.key}`" if stated else "calibrate" if row.name == "camera" else "track"
        default, why = (stated.default_text, stated.why) if stated else ("", "")
        fitted = ", ".join(f"`{name}`" for name in row.components) if row.search else ""
        missing = stated.left_out if stated else None
        left_out, reason = (f"{missing.value} ± {missing.std_text}", missing.why) if missing else ("", "")
        source += f", within {INPUTS[row.within].label}" if row.within else ""
        cells = (row.label, row.unit, source, default, why, left_out, reason, row.shared, fitted)
        rows.append(f"| {' | '.join(cells)} |")
    return _INPUTS + "\n".join(rows) + "\n"


PAGES = {"findings.md": findings_page, "inputs.md": inputs_page}
"""Text of each page, by its name."""


@errors_reported()
def main() -> None:
    """Write the pages."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
