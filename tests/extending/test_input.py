"""An uncertain input from outside the package: one file, one registration line, named in ``TOWVAL_PLUGINS``."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from studies.worlds.campaign import towed_motion
from studies.worlds.scenes import ceiling, drive
from towval.io.campaign import load_campaign
from towval.io.records import read_uncertainty, write_calibration, write_decimated, write_simulated, write_tracks
from towval.model import Calibration
from towval.validation.decimate import decimate
from towval.validation.simulate import simulate

PLUGIN = Path(__file__).with_name("gravity_input.py")
CHECK = """
import sys, yaml
from towval.io.schema import check
from towval.model.plugins import load_plugins
load_plugins()
config = {"campaign": "lab", "results": "out", "identify": {"parameters": ["gravity"]}}
check(config, yaml.safe_load(open(sys.argv[1])), "config")
"""


def python(*arguments, plugins=str(PLUGIN)):
    environment = os.environ | {"TOWVAL_PLUGINS": plugins}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def campaign(lab_small, tmp_path_factory):
    """The sample campaign with run a alone, whose gravity is known to 1 m/s²."""
    folder = tmp_path_factory.mktemp("lab")
    document = yaml.safe_load((lab_small / "campaign.yaml").read_text())
    document["runs"] = {"a": document["runs"]["a"]}
    document["gravity_std_m_per_s2"] = 1.0
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document))
    for name in ("calibration", "a.mp4"):
        (folder / name).symlink_to(lab_small / name)
    return folder


@pytest.fixture(scope="module")
def results(lab_small, make_track, tmp_path_factory):
    """Run a up to the stage simulate, of a motion of four seconds."""
    results = tmp_path_factory.mktemp("results")
    rover = drive((-0.15, 0.05, 0.1), speed=0.25, turn=0.5, rest_s=0.3)
    towed = towed_motion(rover, (-1.2, 0.0, 0.15), np.arange(100) / 25)
    tracks = {
        "rover": make_track(lambda t: np.array([rover(x) for x in t]), duration_s=4.0, seed=1),
        "object": make_track(lambda t: towed, body="object", duration_s=4.0, seed=2),
    }
    thin = {name: decimate(track) for name, track in tracks.items()}
    simulated = simulate(load_campaign(lab_small).scene, thin["rover"], thin["object"], tracks["rover"].time_s)
    camera, floor = ceiling((960, 540), focal_px=780.0)
    write_calibration(results / "camera.mcap", Calibration(camera, floor, 1e-8 * np.eye(18), 0.05), {})
    write_tracks(results / "a" / "track.mcap", tracks, {})
    write_decimated(results / "a" / "decimate.mcap", thin, {})
    write_simulated(results / "a" / "simulate.mcap", simulated, {})
    return results


def test_an_input_of_ones_own_goes_through_commands_and_report(campaign, results):
    folder = results / "a"
    given = (campaign, "--camera", results / "camera.mcap", "--folder", folder, "--run", "a", "--set", "samples=128")
    done = python("-m", "towval.cli", "uncertainty", *given, "-o", folder / "uncertainty.mcap")
    assert done.returncode == 0, done.stderr
    shares = read_uncertainty(folder / "uncertainty.mcap").shares
    assert shares["local gravity"] > 0.02
    stages = {"--track": "track", "--simulated": "simulate", "--uncertainty": "uncertainty"}
    files = [part for option, stage in stages.items() for part in (option, folder / f"{stage}.mcap")]
    done = python("-m", "towval.cli", "compare", *files, "--run", "a", "-o", folder / "compare.mcap")
    assert done.returncode == 0, done.stderr
    done = python("-m", "towval.cli", "report", campaign, "--results", results)
    assert done.returncode == 0, done.stderr
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "local gravity" in page.split('id="inputs"')[1]


def test_the_workflow_knows_the_input_where_it_is_registered(repository):
    schema = repository / "src" / "towval" / "io" / "config.schema.yaml"
    assert python("-c", CHECK, schema).returncode == 0
    refused = python("-c", CHECK, schema, plugins="")
    assert refused.returncode != 0
    assert "gravity" in refused.stderr


def test_without_its_registration_the_key_is_unknown(campaign):
    code = "import sys, pathlib, towval.io.campaign as c; c.load_campaign(pathlib.Path(sys.argv[1]))"
    refused = python("-c", code, campaign, plugins="")
    assert "unknown key gravity_std_m_per_s2" in refused.stderr
