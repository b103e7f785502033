"""A friction law from outside the package: one file, one registration line, named in ``TOWVAL_PLUGINS``."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import yaml

from towval.io.records import read_simulated

PLUGIN = Path(__file__).with_name("stribeck_law.py")


def simulated(lab_small, results, law, plugins=str(PLUGIN)):
    """The result of the command ``simulate`` on the sample campaign with a law of that name, and its process."""
    folder = results / law
    folder.mkdir(exist_ok=True)
    document = yaml.safe_load((lab_small / "campaign.yaml").read_text())
    document["friction"]["law"] = law
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document))
    for name in ("calibration", "a.mp4", "b.mp4"):
        if not (folder / name).exists():
            (folder / name).symlink_to(lab_small / name)
    output = folder / "simulate.mcap"
    command = ["towval.cli", "simulate", folder, "--track", results / "track.mcap", "-o", output]
    command = [sys.executable, "-m", *map(str, command), "--decimated", str(results / "decimate.mcap")]
    environment = os.environ | {"TOWVAL_PLUGINS": plugins}
    return output, subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_a_registered_law_is_named_in_the_campaign(lab_small, tracked):
    motions = {}
    for law in ("makkar", "coulomb", "stribeck"):
        output, done = simulated(lab_small, tracked, law)
        assert done.returncode == 0, done.stderr
        motions[law] = read_simulated(output).pose[:, :2]
    apart = {law: np.linalg.norm(motions[law] - motions["makkar"], axis=1).max() for law in ("coulomb", "stribeck")}
    # Another form of the same peak moves the object less than leaving the peak out.
    assert 1e-6 < apart["stribeck"] < apart["coulomb"]


def test_a_law_that_nobody_registered_is_unknown(lab_small, tracked):
    done = simulated(lab_small, tracked, "stribeck", plugins="")[1]
    assert done.returncode == 1
    assert "friction.law is 'stribeck'; allowed: one of makkar, coulomb" in done.stderr
