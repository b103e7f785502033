"""The table of findings: complete, documented, tested, and the only way to make one."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from studies.tables.reference_pages import DOCS, PAGES
from towval.model.errors import InputError
from towval.model.findings import FINDINGS, Severity, finding, register
from towval.model.inputs import INPUTS

ROOT = Path(__file__).parents[2]


def test_a_finding_is_its_row_with_the_values_put_in():
    found = finding("compare_cut", count=7)
    assert (found.severity, found.code) == (Severity.WARNING, "compare_cut")
    assert found.text == "7 measured frames have no simulated counterpart."


def test_an_unknown_code_is_refused():
    with pytest.raises(InputError, match="unknown finding"):
        finding("no_such_code")


def test_a_severity_that_the_row_does_not_have_is_refused():
    assert (
        finding("no-tilt", Severity.REFUSAL, held=3, tilt_deg=1, focal_percent=9, remedy="tilt").severity == "refusal"
    )
    with pytest.raises(InputError, match="unknown severity"):
        finding("compare_cut", Severity.REFUSAL, count=7)


def test_a_text_without_its_values_is_a_defect():
    with pytest.raises(KeyError):
        finding("compare_cut")


def test_two_rows_cannot_share_a_code():
    with pytest.raises(InputError, match="registered twice"):
        register(replace(FINDINGS["compare_cut"], text="Something else."))


def test_the_package_makes_findings_through_the_table_alone():
    by_hand = [
        str(path.relative_to(ROOT))
        for path in (ROOT / "src").rglob("*.py")
        if re.search(r"\bFinding\(", path.read_text())
    ]
    assert sorted(by_hand) == ["src/towval/io/records/details.py", "src/towval/model/findings.py"]


@pytest.mark.parametrize("name", PAGES)
def test_the_printed_page_is_the_table(name):
    assert (DOCS / name).read_text() == PAGES[name](), "python -m studies.tables.reference_pages writes it"


def test_a_consequence_widens_inputs_that_exist():
    named = {name for row in FINDINGS.values() for name in row.consequence.widens}
    # The noise of the tracks is drawn frame by frame and is no row of the table of inputs.
    assert named <= {*INPUTS, "tracking"}
