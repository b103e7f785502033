"""Clips that nobody here made: what is asked is that a track is right or says that it is not."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from studies.real.clips import PLATES, WRITTEN_AGAIN, from_above, outline_from, puck_errors, robot_distances
from towval.io.video import Video
from towval.model import Body, Track
from towval.tracking.track import TrackSettings, track

pytestmark = pytest.mark.shared

# The blob fits begin at 200, where the striker is not yet free of its launcher; at 230 it is.
PUCKS = [(200, "plane"), (230, "plane"), (230, "klt")]


@pytest.fixture
def real_dir(shared_dir: Path) -> Path:
    folder = shared_dir / "real"
    if not folder.is_dir():
        pytest.skip(f"no real footage at {folder}")
    return folder


def codes(found: Track) -> set[str]:
    return {finding.code for finding in found.findings}


@pytest.mark.parametrize(("first", "method"), PUCKS)
def test_two_discs_of_17_pixels_that_look_alike_and_collide_keep_their_names(real_dir, first, method):
    for errors in puck_errors(real_dir, first, method).values():
        assert errors.rms_px < 0.25
        assert np.linalg.norm(errors.offset_px) < 1.8
        assert errors.most_px < 3.0
        assert errors.tracked > 0.9
        assert errors.axis_deg < 8


@pytest.mark.parametrize("clip", sorted(PLATES))
def test_a_robot_that_jumps_30_pixels_a_frame_is_tracked_in_all_frames(real_dir, clip):
    found, distance = robot_distances(real_dir, clip)
    # The box around the arrow is known to 3 px where no painted dot hides a tip, to some 10 px where one does.
    assert distance.max() < 12.0
    assert np.median(distance) < 5.0
    assert found.seen[:-WRITTEN_AGAIN].all()


@pytest.mark.parametrize("clip", sorted(PLATES))
def test_frames_at_the_end_of_a_clip_that_are_written_again_are_left_out(real_dir, clip):
    """Nothing says that they are, but that no noise of a camera is between them, and that the robot does not brake."""
    frames = [picture.astype(np.int16) for _, picture in Video(real_dir / "rover_overhead_4fps" / f"{clip}.avi")]
    changes = np.array([np.abs(after - before).mean() for before, after in pairwise(frames)])
    assert changes[-13:-WRITTEN_AGAIN].min() > 20 * changes[-WRITTEN_AGAIN:].max()
    found, _ = robot_distances(real_dir, clip)
    assert "pictures_repeated" in codes(found)
    assert not found.seen[-WRITTEN_AGAIN:].any()


@pytest.mark.parametrize(
    ("method", "clip", "clicks"),
    [
        ("plane", "box", [(356, 15), (595, 69), (552, 173), (296, 107)]),
        ("klt", "cup", [(260, 180), (380, 180), (380, 330), (260, 330)]),
    ],
)
def test_a_hand_held_box_is_no_body_on_a_floor_and_that_is_said(real_dir, method, clip, clicks):
    """It tilts and comes nearer, which no planar pose can follow: the frames that fit none are not called tracked."""
    calibration, corners = from_above(640, 480), np.array(clicks, dtype=float)
    body = Body("object", 0.0, outline_from(calibration, corners))
    video = Video(real_dir / "hand_held_box" / f"{clip}.mp4")
    found = track(video, calibration, [body], {"object": corners}, TrackSettings(method=method))["object"]
    assert len(found.time_s) == {"box": 455, "cup": 217}[clip]
    assert "not_seen" in codes(found)
