"""A finding from outside the package: one row registered; its text and consequence are there, and the page shows it."""

import dataclasses

import pytest

from report_scenes import towed_run
from towval.model.findings import FINDINGS, Consequence, FindingType, Severity, finding, register
from towval.report.data import ReportData, RunReport
from towval.report.view import collect_findings


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setattr(FINDINGS, "_values", dict(FINDINGS))
    worse = Consequence(widens=("camera",))
    text = "The light changed by {percent:.0f} % during the run. Switch it on an hour earlier."
    register(FindingType("light_changed", "track", (Severity.WARNING,), worse, text))


@pytest.mark.usefixtures("registered")
def test_a_finding_of_ones_own_is_made_from_its_row_and_reaches_the_report():
    made = finding("light_changed", percent=12.4)
    assert made.text == "The light changed by 12 % during the run. Switch it on an hour earlier."
    assert str(FINDINGS[made.code].consequence) == "widens camera"
    record = towed_run("a")
    record = dataclasses.replace(record, rover_track=dataclasses.replace(record.rover_track, findings=(made,)))
    data = ReportData(campaign="lab", runs=(RunReport(record),), provenance=None)
    assert made.text in [shown.text for shown in collect_findings(data)]
