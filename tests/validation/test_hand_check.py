"""The lines of docs/validation.md that judge a run by hand, run on a folder of results and held against summary.csv."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from towval.io.records import (
    read_simulated,
    read_tracks,
    read_uncertainty,
    write_comparison,
    write_simulated,
    write_tracks,
    write_uncertainty,
)
from towval.io.summary import write_summary
from towval.validation.compare import compare
from towval.validation.sampler import UncertaintySettings
from towval.validation.uncertainty import sample_uncertainty

PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation.md"


@pytest.fixture(scope="module")
def folder(case, tmp_path_factory):
    """Results of one run, through the files as the stages leave them."""
    folder = tmp_path_factory.mktemp("results")
    known = sample_uncertainty(case, UncertaintySettings(samples=64))
    tracks = {"rover": case.rover_track, "object": case.object_track}
    write_tracks(folder / "track.mcap", tracks, {})
    write_simulated(folder / "simulate.mcap", case.simulated, {})
    write_uncertainty(folder / "uncertainty.mcap", known, case.simulated, {})
    track, motion = read_tracks(folder / "track.mcap")["object"], read_simulated(folder / "simulate.mcap")
    found = compare("a", motion, track, read_uncertainty(folder / "uncertainty.mcap"))
    write_comparison(folder / "compare.mcap", found, track, motion, {})
    write_summary(folder / "summary.csv", [found])
    return folder


def by_hand(folder):
    """What the page's lines find in a folder, by the columns of the summary."""
    section = PAGE.read_text(encoding="utf-8").split("## Check of one run by hand")[1]
    lines = re.search(r"```python\n(.*?)```", section, re.DOTALL)[1]
    assert 'Path("results/lab_small/a")' in lines
    names: dict = {}
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(lines.replace('"results/lab_small/a"', repr(str(folder))), names)
    return names["by_hand"], printed.getvalue()


def test_the_lines_of_the_page_find_what_the_summary_states(folder):
    found, printed = by_hand(folder)
    summary = pd.read_csv(folder / "summary.csv").iloc[0]
    assert set(found) == {"error_upper_m", "model_error_upper_m", "size_statistic", "shape_statistic"}
    for name, value in found.items():
        assert value == pytest.approx(summary[name], rel=1e-6), name
        assert name in printed
    assert np.isfinite(list(found.values())).all()
