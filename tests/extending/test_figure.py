"""A figure from outside the package: one file, one registration line, named in ``TOWVAL_PLUGINS``."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from report_scenes import towed_run, uncertainty_of
from studies.worlds.scenes import ceiling
from towval.io.records import (
    write_calibration,
    write_comparison,
    write_decimated,
    write_simulated,
    write_tracks,
    write_uncertainty,
)
from towval.model import Calibration
from towval.model.errors import InputError
from towval.report.contents import CampaignFigure, RunFigure

PLUGIN = Path(__file__).with_name("speed_figure.py")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of the runs a and b as the stages write them."""
    folder = tmp_path_factory.mktemp("results")
    camera, floor = ceiling((960, 540), focal_px=780.0)
    write_calibration(folder / "camera.mcap", Calibration(camera, floor, 1e-8 * np.eye(18), 0.05), {})
    for name in "ab":
        record, run = towed_run(name, n=100), folder / name
        uncertainty = uncertainty_of(record)
        write_tracks(run / "track.mcap", {"rover": record.rover_track, "object": record.object_track}, {})
        write_decimated(run / "decimate.mcap", {"rover": record.decimated, "object": record.decimated}, {})
        write_simulated(run / "simulate.mcap", record.simulated, {})
        write_uncertainty(run / "uncertainty.mcap", uncertainty, record.simulated, {})
        write_comparison(run / "compare.mcap", record.comparison, record.object_track, record.simulated, {})
    return folder


def test_a_registered_figure_is_on_the_page_and_among_the_files(results, lab_small):
    command = [sys.executable, "-m", "towval.cli", "report", str(lab_small), "--results", str(results)]
    done = subprocess.run(
        command, env=os.environ | {"TOWVAL_PLUGINS": str(PLUGIN)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    page = (results / "report.html").read_text(encoding="utf-8")
    for name in "ab":
        assert page.count(f'aria-label="Run {name}: speed of the object over time."') == 1
        # Its own cursor, besides those of the errors and of the agreement.
        section = page.split(f'id="run-{name}"')[1].split("</section>")[0]
        assert section.count('class="timeplot"') == 3
        assert {f"speed_{name}.{ending}" for ending in ("pdf", "svg", "png")} <= {
            path.name for path in (results / "figures").iterdir()
        }


@pytest.mark.parametrize(("kind", "section"), [(RunFigure, "apendix"), (CampaignFigure, "run")])
def test_a_figure_needs_a_section_of_the_page(kind, section):
    with pytest.raises(InputError, match=r"allowed: .*campaign, uncertainty"):
        kind(section, "speed", draw=lambda _: np.nan)
