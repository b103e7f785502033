"""Films that freeze to their end, and bodies that do stop there."""

from dataclasses import replace

import numpy as np
import pytest

from tests.tracking.test_stamps import EVEN, codes, filmed
from towval.model import Stamp, TrackStatus
from towval.tracking.frozen import frozen_at_the_end
from towval.tracking.stamps import check_stamps


@pytest.mark.parametrize("pictures", [1, 5, 100])
def test_a_film_that_freezes_to_its_end_is_left_out_from_there(pictures):
    shown = np.minimum(np.arange(250), 249 - pictures)
    tracks, findings, stamps = check_stamps(filmed(EVEN, EVEN, shown))
    assert [one.code for one in findings] == ["pictures_repeated"]
    assert (np.flatnonzero(stamps == Stamp.REPEATED) == np.arange(250 - pictures, 250)).all()
    assert not any(track.seen[250 - pictures :].any() for track in tracks.values())


@pytest.mark.parametrize(
    ("stops_in_s", "slows_s", "found"), [(0.0, 1e-3, True), (0.02, 1e-3, False), (0.0, 0.2, False)]
)
def test_a_film_freezes_at_its_end_where_bodies_stop_at_full_speed_between_two_pictures(stops_in_s, slows_s, found):
    begins_s = 6.0 + stops_in_s
    stopping = np.clip((EVEN - begins_s) / slows_s, 0.0, 1.0)
    true_s = np.where(begins_s > EVEN, EVEN, begins_s + slows_s * (stopping - stopping**2 / 2))
    assert ("pictures_repeated" in codes(filmed(true_s, EVEN))) == found


def test_a_body_that_goes_on_shows_that_no_film_froze():
    true_s = np.minimum(EVEN, 6.0)
    moves, rests = filmed(EVEN, EVEN), filmed(true_s, EVEN)
    assert codes({"rover": rests["rover"], "object": moves["object"]}) == []


def going(steps_mm, still=20, noise_m=2e-5):
    """One body by its steps, then at rest; and a second one that rests all the time."""
    along = np.concatenate([[0.0], np.cumsum(steps_mm)]) * 1e-3
    along = np.append(along, np.full(still, along[-1]))
    time_s = np.arange(len(along)) / 25
    tracks = filmed(time_s, time_s)
    pose = np.column_stack([along, np.zeros((len(along), 2))])
    rover = replace(tracks["rover"], pose=pose)
    resting = replace(tracks["object"], pose=np.zeros_like(pose))
    return {"rover": rover, "object": resting}, {"rover": noise_m, "object": noise_m}


@pytest.mark.parametrize(("last_mm", "found"), [(3.0, True), (1.55, True), (1.45, False)])
def test_a_body_did_not_slow_down_whose_last_step_is_shorter_by_less_than_a_quarter(last_mm, found):
    tracks, noise_m = going([2.0] * 50 + [last_mm])
    assert frozen_at_the_end(tracks, noise_m).any() == found


@pytest.mark.parametrize(("steps", "found"), [(3, False), (4, True)])
def test_a_body_that_had_just_begun_to_move_may_have_stopped(steps, found):
    tracks, noise_m = going([0.0] * 10 + [2.0] * steps)
    assert frozen_at_the_end(tracks, noise_m).any() == found


@pytest.mark.parametrize(("deviations", "found"), [(23, False), (27, True)])
def test_a_step_tells_of_its_end_from_twenty_five_deviations_on(deviations, found):
    tracks, noise_m = going([2.0] * 50, noise_m=2e-3 / deviations)
    assert frozen_at_the_end(tracks, noise_m).any() == found


@pytest.mark.parametrize(("share", "found"), [(0.08, True), (0.12, False)])
def test_a_body_stands_still_that_moves_by_less_than_a_tenth_of_a_step(share, found):
    tracks, noise_m = going([2.0] * 50 + [0.0] * 10 + [2.0 * share], noise_m=1e-5)
    assert frozen_at_the_end(tracks, noise_m)[51:].all() == found


@pytest.mark.parametrize(("deviations", "found"), [(6, True), (8, False)])
def test_a_body_at_rest_stands_still_that_moves_by_less_than_seven_deviations(deviations, found):
    tracks, noise_m = going([2.0] * 50)
    pose = tracks["object"].pose.copy()
    pose[-5:, 0] = deviations * noise_m["object"]
    tracks["object"] = replace(tracks["object"], pose=pose)
    assert frozen_at_the_end(tracks, noise_m).any() == found


def test_a_film_in_which_nothing_moves_or_is_seen_freezes_nowhere():
    tracks, noise_m = going([0.0] * 50)
    assert not frozen_at_the_end(tracks, noise_m).any()
    nowhere = np.full((71, 3), np.nan)
    lost = {name: replace(each, pose=nowhere, status=np.full(71, TrackStatus.LOST)) for name, each in tracks.items()}
    assert not frozen_at_the_end(lost, noise_m).any()


def test_a_body_that_drives_out_of_the_picture_freezes_nothing():
    tracks, noise_m = going([2.0] * 50)
    out = np.arange(71) > 50
    pose = np.where(out[:, None], np.nan, tracks["rover"].pose)
    status = np.where(out, TrackStatus.LOST, TrackStatus.TRACKED)
    assert frozen_at_the_end(tracks, noise_m).any()
    tracks["rover"] = replace(tracks["rover"], pose=pose, status=status)
    assert not frozen_at_the_end(tracks, noise_m).any()
