"""A tracker from outside the package: one file, one registration line, named in ``TOWVAL_PLUGINS``."""

import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from studies.worlds.film import write_video
from towval.commands.calibrate import run as calibrate
from towval.io.records import read_tracks
from towval.io.video import Video
from towval.report.figures.tracking import tracking_figure

PLUGIN = Path(__file__).with_name("patch_tracker.py")
CHECK = """
import sys, yaml
from towval.io.schema import check
from towval.model.plugins import load_plugins
load_plugins()
check({"campaign": "lab", "results": "out", "track": {"method": "patch"}}, yaml.safe_load(open(sys.argv[1])), "config")
"""


def python(*arguments, plugins=str(PLUGIN)):
    environment = os.environ | {"TOWVAL_PLUGINS": plugins}
    return subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(lab_small, tmp_path_factory):
    """The sample campaign with a run of twelve frames, calibrated."""
    folder = tmp_path_factory.mktemp("toy")
    document = yaml.safe_load((lab_small / "campaign.yaml").read_text())
    write_video(folder / "a.mp4", itertools.islice(Video(lab_small / "a.mp4"), 12), crf="18")
    document["runs"] = {"a": document["runs"]["a"]}
    (folder / "calibration").symlink_to(lab_small / "calibration")
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document))
    calibrate(folder, folder / "camera.mcap", {"lens_models": ["k1 k2"], "folds": 2})
    return folder


def test_a_tracker_of_ones_own_goes_through_command_file_and_report(folder):
    command = ["-m", "towval.cli", "track", str(folder), "--run", "a", "--camera", str(folder / "camera.mcap")]
    done = python(*command, "-o", str(folder / "track.mcap"), "--set", "method=patch")
    assert done.returncode == 0, done.stderr
    tracks = read_tracks(folder / "track.mcap")
    assert set(tracks) == {"rover", "object"}
    for track in tracks.values():
        assert track.method == "patch"
        assert track.seen.all()
        # It matches at whole pixels of 5 mm; the body moves by less than that in twelve frames.
        assert np.ptp(track.pose[:, :2], axis=0).max() < 0.03
        assert tracking_figure(track, "a").axes


def test_the_workflow_accepts_a_registered_tracker_and_no_other(repository):
    schema = str(repository / "src/towval/io/config.schema.yaml")
    assert python("-c", CHECK, schema).returncode == 0
    refused = python("-c", CHECK, schema, plugins="")
    assert "track.method is 'patch'; allowed: one of plane, klt" in refused.stderr
