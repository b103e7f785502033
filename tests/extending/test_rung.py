"""A rung from outside the package: one file, one registration line, named in ``TOWVAL_PLUGINS``."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from towval.io.records import read_simulated

PLUGIN = Path(__file__).with_name("damped_rung.py")


def simulate(campaign, tracked, output, plugins=str(PLUGIN)):
    """Run the command ``simulate`` with the rung ``damped``."""
    files = ["--track", tracked / "track.mcap", "--decimated", tracked / "decimate.mcap", "-o", output]
    command = [sys.executable, "-m", "towval.cli", "simulate", campaign, *files, "--set", "rung=damped"]
    environment = os.environ | {"TOWVAL_PLUGINS": plugins}
    return subprocess.run(list(map(str, command)), env=environment, capture_output=True, text=True, check=False)


def test_a_registered_rung_is_named_in_the_settings(lab_small, tracked, tmp_path):
    done = simulate(lab_small, tracked, tmp_path / "simulate.mcap")
    assert done.returncode == 0, done.stderr
    assert read_simulated(tmp_path / "simulate.mcap").rung == "damped"


def test_a_registered_rung_is_of_use_where_the_tow_leaves_the_plane(lab_small, tracked, tmp_path):
    """As the package's own rungs it goes without heights, and the ladder states what that changes."""
    raised = tmp_path / "lab"
    shutil.copytree(lab_small, raised)
    text = (raised / "campaign.yaml").read_text(encoding="utf-8")
    text = re.sub(r"(\n *)(tether_(anchor|hinge)_m:)", r"\1tether_\3_height_m: 0.1\1\2", text)
    (raised / "campaign.yaml").write_text(text, encoding="utf-8")
    done = simulate(raised, tracked, tmp_path / "simulate.mcap")
    assert done.returncode == 0, done.stderr
    found = read_simulated(tmp_path / "simulate.mcap")
    assert found.rung == "damped"
    assert found.statistics["damped to dynamics, m"] > 0


def test_a_rung_that_nobody_registered_is_refused(lab_small, tracked, tmp_path):
    done = simulate(lab_small, tracked, tmp_path / "simulate.mcap", plugins="")
    assert done.returncode == 1
    assert "damped" in done.stderr
