"""A study from outside the package: one file, one registration line, named in ``TOWVAL_PLUGINS``."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from studies.compute import gather, run_part
from studies.draw import draw_chart
from studies.frame import Settings, loaded
from studies.page import write_page
from studies.registry import TRADEOFF

PLUGIN = Path(__file__).with_name("sine_study.py")
REFERENCE = "sine_study:STUDY"


def dry_run(repository, folder, plugin):
    """What the workflow would do for the product that charts error against cost."""
    command = [sys.executable, "-m", "snakemake", "tradeoff", "-n", "--snakefile", str(repository / "Snakefile")]
    keys = ["quick=true", f"campaign={repository / 'data_samples' / 'lab_small'}"]
    environment = os.environ | {"TOWVAL_PLUGINS": str(plugin)}
    command += ["--configfile", str(repository / "config.yaml"), "--config", *keys]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_the_workflow_plans_its_parts_table_and_chart(repository, tmp_path):
    done = dry_run(repository, tmp_path, PLUGIN)
    assert done.returncode == 0, done.stderr
    files = ("blocks/sine/terms_1.csv", "blocks/sine/terms_3.csv", "sine.csv", "sine.svg", "tradeoff.md")
    for file in files:
        assert f"results/study/{file}" in done.stdout + done.stderr


def test_a_name_that_is_taken_is_one_message(repository, tmp_path):
    twin = tmp_path / "twin_study.py"
    twin.write_text(PLUGIN.read_text(encoding="utf-8").replace('register("sine"', 'register("friction"'))
    done = dry_run(repository, tmp_path, twin)
    assert done.returncode != 0
    assert "'friction' is registered twice" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Table and chart of the study, made as the workflow makes them; it is registered for one test."""
    monkeypatch.setattr(TRADEOFF, "_values", dict(TRADEOFF))
    monkeypatch.delitem(sys.modules, "sine_study", raising=False)
    monkeypatch.syspath_prepend(PLUGIN.parent)
    written = []
    for name, part in loaded(REFERENCE).parts(Settings(quick=True)).items():
        written.append(tmp_path / f"{name}.part.csv")
        run_part(REFERENCE, part, written[-1])
    gather(written, tmp_path / "sine.csv")
    draw_chart("sine", REFERENCE, {}, {"sine": tmp_path / "sine.csv"}, tmp_path)
    return tmp_path


def test_the_page_shows_its_chart_and_its_numbers(folder):
    write_page("tradeoff", {"tradeoff": {"sine": REFERENCE}}, folder, folder / "tradeoff.md")
    assert "Sine of one" in (folder / "study.html").read_text(encoding="utf-8")
    assert "3 terms" in (folder / "tradeoff.md").read_text(encoding="utf-8")
    error = pd.read_csv(folder / "sine.csv").set_index("setting")["error"]
    assert error["3 terms"] == pytest.approx(1 / 5040, rel=0.05)
