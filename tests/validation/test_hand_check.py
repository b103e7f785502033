"""The lines of docs/validation.md that judge a run by hand, run on a folder of results and held against summary.csv."""

import contextlib
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from towval.commands.compare import run
from towval.io.records import (
    read_comparison,
    read_simulated,
    read_tracks,
    read_uncertainty,
    write_comparison,
    write_simulated,
    write_tracks,
    write_uncertainty,
)
from towval.io.summary import write_summary
from towval.model import TrackStatus
from towval.model.statement import Bounds
from towval.validation.compare import compare
from towval.validation.sampler import UncertaintySettings
from towval.validation.statistics import STATISTICS
from towval.validation.uncertainty import sample_uncertainty
from towval.validation.verdict import Evidence, verdict_of

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


def blocks():
    """Lines of Python of the page's section."""
    section = PAGE.read_text(encoding="utf-8").split("## Check of one run by hand")[1].split("\n## ")[0]
    return re.findall(r"```python\n(.*?)```", section, re.DOTALL)


def by_hand(folder):
    """What the page's lines find in a folder, by the columns of the summary."""
    lines = blocks()[0]
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


def test_the_verdict_follows_from_the_summary_by_the_lines_of_the_page(folder):
    names: dict = {}
    exec(blocks()[1], names)
    row = pd.read_csv(folder / "summary.csv").iloc[0]
    assert names["verdict_by_hand"](row) == row["verdict"]
    rng, seen = np.random.default_rng(1), set()
    for _ in range(300):
        upper, detectable, moved = 0.02 * np.exp(0.7 * rng.standard_normal(3)) * [1, 1, 4]
        tests = dict(zip(STATISTICS, np.exp(0.5 * rng.standard_normal(3)), strict=True))
        bounds = Bounds({"position_max": (0.0, upper)}, {"position_max": (0.0, upper)})
        limits = dict.fromkeys(STATISTICS, 2.0)
        evidence = Evidence(0.02, bounds, tests, limits, detectable, rng.uniform(0.3, 1), moved, (), None, {}, "")
        row = {"tolerance_m": 0.02, "error_upper_m": upper, "detectable_m": detectable, "path_length_m": moved}
        row |= {"seen_share": evidence.seen_share}
        row |= {
            f"{name}_{what}": of[name] for name in STATISTICS for what, of in (("statistic", tests), ("limit", limits))
        }
        assert names["verdict_by_hand"](row) == verdict_of(evidence)[0]
        seen.add(names["verdict_by_hand"](row))
    assert seen == {"agrees", "disagrees", "cannot tell", "not judged"}


def test_the_stage_does_not_judge_a_cut_in_which_less_than_half_of_the_motion_is_seen(folder, tmp_path):
    tracks = read_tracks(folder / "track.mcap")
    towed = tracks["object"]
    gone = np.arange(len(towed.time_s)) > 0.45 * len(towed.time_s)
    status = np.where(gone, TrackStatus.LOST, towed.status).astype(np.uint8)
    pose = np.where(gone[:, None], np.nan, towed.pose)
    write_tracks(tmp_path / "track.mcap", tracks | {"object": replace(towed, status=status, pose=pose)}, {})
    files = [tmp_path / "track.mcap", folder / "simulate.mcap", folder / "uncertainty.mcap"]
    found = run("a", *files, tmp_path / "compare.mcap")
    assert found.numbers["verdict"] == "not judged"
    assert read_comparison(tmp_path / "compare.mcap").seen_share < 0.5
