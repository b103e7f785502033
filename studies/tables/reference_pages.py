"""Pages of docs/ that are tables of the package in print: ``python -m studies.tables.reference_pages`` writes them."""

from __future__ import annotations

from pathlib import Path

from towval.model.findings import FINDINGS

DOCS = Path(__file__).parents[2] / "docs"

_FINDINGS = """# Findings

What the stages can remark on: the table of `towval/model/findings.py` in print (`python -m
studies.tables.reference_pages`).
A text holds the names of its values in braces. The consequence is what a finding means for the verdict of its run:
*widens* names the uncertain inputs whose stated deviations are too small once it is there, *not judged* that the
comparison says nothing about the model. It is recorded here; the verdict does not use it yet.

| code | stage | severity | text | consequence |
|---|---|---|---|---|
"""


def findings_page() -> str:
    """docs/findings.md, a row a code."""
    rows = (
        f"| `{row.code}` | {row.stage} | {' or '.join(row.severities)} | {row.text} | {row.consequence} |"
        for row in FINDINGS.values()
    )
    return _FINDINGS + "\n".join(rows) + "\n"


PAGES = {"findings.md": findings_page}
"""Text of each page, by its name."""


if __name__ == "__main__":
    for name, page in PAGES.items():
        (DOCS / name).write_text(page())
