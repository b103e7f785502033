"""What the recipes of extending share."""

import numpy as np
import pytest

from studies.worlds.campaign import towed_motion
from studies.worlds.scenes import drive
from towval.io.records import write_decimated, write_tracks
from towval.validation.decimate import decimate


@pytest.fixture(scope="session")
def tracked(make_track, tmp_path_factory):
    """Tracks of a motion of four seconds, and the same decimated."""
    folder = tmp_path_factory.mktemp("results")
    rover = drive((-0.15, 0.05, 0.1), speed=0.25, turn=0.5, rest_s=0.3)
    towed = towed_motion(rover, (-1.2, 0.0, 0.15), np.arange(100) / 25)
    tracks = {
        "rover": make_track(lambda t: np.array([rover(x) for x in t]), duration_s=4.0, seed=1),
        "object": make_track(lambda t: towed, body="object", duration_s=4.0, seed=2),
    }
    write_tracks(folder / "track.mcap", tracks, {})
    write_decimated(folder / "decimate.mcap", {name: decimate(one) for name, one in tracks.items()}, {})
    return folder
