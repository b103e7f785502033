"""Motion of the object that no tether made: pushes are found, and what coasts or is pulled is not."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.measured import measured_track
from studies.worlds.towed_runs import FRAME_STD, synthetic_run, true_motion
from towval.model import Tether, TrackStatus
from towval.validation.decimate import decimate
from towval.validation.hinge_trajectory import hinge_trajectory
from towval.validation.scene_model import SceneModel
from towval.validation.simulate import simulate
from towval.validation.slack import moved_while_slack
from validation_case import SCENE

TIMES = np.arange(250) / 25
BEHIND_M = SCENE.hinge[0] - SCENE.anchor[0] - SCENE.tether.rest_length
"""Distance of the object's origin from the rover's where the tether is straight, both looking along x."""


def on_a_line(name, x, seed=1):
    """A decimated track along x (n,) [m] over TIMES with the noise of a frame."""
    pose = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    noisy = pose + FRAME_STD * np.random.default_rng(seed).standard_normal(pose.shape)
    return decimate(measured_track(name, TIMES, noisy, FRAME_STD))


def ramp(begin_s, end_s, far_m):
    """A smooth way of ``far_m`` between two times."""
    share = np.clip((TIMES - begin_s) / (end_s - begin_s), 0.0, 1.0)
    return far_m * share**2 * (3 - 2 * share)


def pushed(push_m):
    """The rover tows by 0.3 m, comes back by 0.4 m without a touch, and pushes the object from 7 to 9 s."""
    push = ramp(7.0, 9.0, -push_m)
    rover = ramp(0.5, 3.5, 0.3) + ramp(4.0, 7.0, -0.4) + push
    towed = BEHIND_M + ramp(0.5, 3.5, 0.3) + push
    return on_a_line("rover", rover), on_a_line("object", towed, seed=2)


@pytest.mark.parametrize("push_m", [0.02, 0.1])
def test_an_object_that_the_rover_pushes_is_found(push_m):
    (found,) = moved_while_slack(SCENE, *pushed(push_m), TIMES)
    assert found.code == "moved_while_slack"
    assert f"moved by {1000 * push_m:.0f} mm" in found.text


def test_a_rover_that_comes_near_and_does_not_touch_is_not():
    assert moved_while_slack(SCENE, *pushed(0.0), TIMES) == []


def test_the_motion_counts_from_where_the_tether_is_surely_slack():
    """Of a push that begins on a straight tether the part counts in which it is slack by a twentieth."""
    rover = ramp(2.0, 5.0, -0.1)
    tracks = on_a_line("rover", rover), on_a_line("object", BEHIND_M + 0.2 * rover, seed=2)
    (found,) = moved_while_slack(SCENE, *tracks, TIMES)
    slack = -0.8 * rover > 0.05 * SCENE.tether.rest_length
    expected_mm = -1000 * 0.2 * np.ptp(rover[slack])
    assert abs(float(found.text.split("moved by ")[1].split(" mm")[0]) + expected_mm) <= 1


@pytest.mark.parametrize("speed", [0.3, 0.8, 1.5])
def test_an_object_that_coasts_is_not_pushed(speed):
    """Behind a soft tether, under little friction, from a rover that stops at once: it overtakes."""
    friction = replace(SCENE.friction, static=0.1, kinetic=0.1)
    scene = replace(SCENE, tether=Tether(0.6, 30.0), friction=friction)
    moves = np.minimum(TIMES, 4.0) * speed
    rover = on_a_line("rover", moves)
    model = SceneModel(scene)
    hinge = hinge_trajectory(rover, scene.hinge, TIMES)
    motion = model.motion("dynamics", hinge, np.array([BEHIND_M, 0.0, 0.0]), TIMES, 1e-7)
    noisy = motion.pose + FRAME_STD * np.random.default_rng(3).standard_normal(motion.pose.shape)
    towed = decimate(measured_track("object", TIMES, noisy, FRAME_STD))
    slack = motion.tether_length < 0.95 * scene.tether.rest_length
    assert speed < 0.5 or np.ptp(motion.pose[slack, 0]) > 0.02, "the case is one of coasting"
    assert moved_while_slack(scene, rover, towed, TIMES) == []


@pytest.mark.parametrize("seed", range(4))
def test_towed_runs_have_none(seed):
    run = synthetic_run(seed)
    true = true_motion(run, run.truth)
    rng = np.random.default_rng(seed)
    rover, towed = (
        decimate(measured_track(name, run.time_s, pose + FRAME_STD * rng.standard_normal(pose.shape), FRAME_STD))
        for name, pose in (("rover", np.array([run.drive(t) for t in run.time_s])), ("object", true))
    )
    assert moved_while_slack(run.scene, rover, towed, run.time_s) == []


def test_a_tether_whose_weight_pulls_is_left_out():
    """A chain of half the object's weight draws it along while it sags."""
    heavy = replace(SCENE.tether, mass_per_length=0.5 * SCENE.mass / SCENE.tether.rest_length)
    assert moved_while_slack(replace(SCENE, tether=heavy), *pushed(0.1), TIMES) == []


def test_a_high_tow_whose_heights_are_not_stated_is_told_to_state_them():
    """Seen from above its taut tether is short: the run was said to be moved by something else, or a length wrong."""
    rest, rise = SCENE.tether.rest_length, 0.25
    ahead = ramp(1.0, 8.0, 0.7)
    nearer = rest - np.sqrt(rest**2 - rise**2)
    tracks = on_a_line("rover", ahead), on_a_line("object", BEHIND_M + nearer + ahead, seed=2)
    (found,) = moved_while_slack(SCENE, *tracks, TIMES)
    assert "state the heights of both" in found.text
    assert moved_while_slack(replace(SCENE, hinge_height=rise), *tracks, TIMES) == []


def hidden_tow(hidden):
    """Rover and object of a tow by 0.6 m with slack before and after it; the object hidden in frames (n,)."""
    rover = ramp(2.0, 6.0, 0.7) + ramp(7.0, 8.0, -0.1)
    pose = np.column_stack([BEHIND_M + 0.1 + np.maximum(0.0, ramp(2.0, 6.0, 0.7) - 0.1), 0 * TIMES, 0 * TIMES])
    pose += FRAME_STD * np.random.default_rng(2).standard_normal(pose.shape)
    track = measured_track("object", TIMES, pose, FRAME_STD)
    lost = hidden[:, None]
    track = replace(
        track,
        pose=np.where(lost, np.nan, pose),
        covariance=np.where(lost[..., None], np.nan, track.covariance),
        status=np.where(hidden, TrackStatus.LOST, TrackStatus.TRACKED).astype(np.uint8),
    )
    return on_a_line("rover", rover), decimate(track)


def test_what_an_object_did_while_it_was_hidden_is_not_held_against_its_slack_tether():
    """The curve that bridges it is a guess: a tow behind a hand was said to be pushed, and the run was not judged."""
    hidden = (TIMES > 2.4) & (TIMES < 7.6)
    tracks = hidden_tow(hidden)
    assert moved_while_slack(SCENE, *tracks, TIMES)
    assert moved_while_slack(SCENE, *tracks, TIMES[~hidden]) == []
    codes = [{each.code for each in simulate(SCENE, *tracks, TIMES, seen=seen).findings} for seen in (None, ~hidden)]
    assert codes[0] - codes[1] == {"moved_while_slack"}


def test_a_push_seen_in_part_is_found():
    hidden = (TIMES > 7.4) & (TIMES < 7.8)
    (found,) = moved_while_slack(SCENE, *pushed(0.1), TIMES[~hidden])
    assert found.code == "moved_while_slack"
