"""The table of what a scene needed, in the report and out of it."""

from dataclasses import replace

import numpy as np
import pytest

from report_scenes import ceiling_calibration, towed_run
from towval.model import Choice
from towval.report.data import Provenance, ReportData, RunReport
from towval.report.needed import needed_rows
from towval.report.page import write_report

LENS = Choice("lens model", "k1 k2", "k1 k2 p1 p2", 1.234e-4, "RMS over the picture at 0.25 m")
TRACKING = Choice("tracking", "plane, 1024 points", "plane, 4096 points", 2e-5, "RMS over 12 frames")
RUNG = Choice("model of the object", "dynamics", "quasi-static patch", 2.5e-3, "at most over the path")
UNKNOWN = Choice("draws", "512", "1024", np.nan, "of u_val")


@pytest.fixture
def record():
    run = towed_run("a")
    return replace(
        run,
        rover_track=replace(run.rover_track, choices=(TRACKING,)),
        simulated=replace(run.simulated, choices=(RUNG, UNKNOWN)),
        comparison=replace(run.comparison, u_measurement_m=5e-4),
    )


def test_changes_stand_beside_the_measurement_uncertainty(record):
    calibration = replace(ceiling_calibration(), choices=(LENS,))
    rows = {row.what: row for row in needed_rows(calibration, (record,))}
    assert [row.where for row in rows.values()] == ["all runs", "run a, rover", "run a", "run a"]
    assert (rows["lens model"].change_mm, rows["lens model"].share) == ("0.12", "25 %")
    assert (rows["tracking"].change_mm, rows["tracking"].share) == ("0.02", "4 %")
    assert (rows["model of the object"].change_mm, rows["model of the object"].share) == ("2.5", "500 %")
    assert (rows["draws"].change_mm, rows["draws"].share) == ("not computed", "not computed")


def test_the_report_shows_the_table_and_leaves_it_out_without_choices(record, tmp_path):
    for run, shown in ((record, True), (towed_run("a"), False)):
        data = ReportData("synthetic", (RunReport(run),), Provenance("none"))
        page = write_report(tmp_path / "report.html", data).read_text(encoding="utf-8")
        assert ("Model selection" in page) == shown
        assert ("plane, 4096 points" in page) == shown
