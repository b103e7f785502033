"""Stamps against motion: two bodies on smooth paths, filmed by a camera whose stamps are wrong in a known way."""

from dataclasses import replace

import numpy as np
import pytest

from towval.model import Stamp, Track, TrackStatus
from towval.tracking import near_losses
from towval.tracking import stamps as stamps_module
from towval.tracking.rate import rate_findings, usual_steps_s
from towval.tracking.stamps import _common, _dropped, _enough, _lateness_s, _share, _smoother, check_stamps


def filmed(true_s, stamps_s, shown=None, speeds=(0.15, 0.12), bumps=0.0, seed=0, noise_m=2e-5):
    """Tracks of two bodies photographed at ``true_s``; ``shown``: index of the picture shown at each stamp."""
    rng = np.random.default_rng(seed)
    true_s = np.asarray(true_s)[np.arange(len(stamps_s)) if shown is None else shown]
    tracks, n = {}, len(stamps_s)
    for k, (name, speed) in enumerate(zip(("rover", "object"), speeds, strict=True)):
        along = speed * (true_s + 0.1 * np.sin(2 * true_s + k)) + bumps * np.sin(9 * true_s + 2 * k) / 9
        heading = 0.3 * np.sin(0.5 * true_s)
        pose = np.column_stack([along, 0.2 * np.sin(0.8 * true_s), heading]) + noise_m * rng.standard_normal((n, 3))
        ones = np.ones(n)
        cov = np.tile(np.diag([4e-10, 4e-10, 1e-9]), (n, 1, 1))
        tracks[name] = Track(name, stamps_s, pose, cov, np.full(n, TrackStatus.TRACKED), ones, ones, 1e-8 * np.eye(3))
    return tracks


def codes(tracks):
    return [one.code for one in check_stamps(tracks)[1]]


EVEN = np.arange(250) / 25


@pytest.mark.parametrize("bumps", [0.0, 0.05])
def test_true_stamps_are_believed(bumps):
    rng = np.random.default_rng(1)
    uneven = EVEN + rng.uniform(-0.009, 0.009, 250)
    lost = np.delete(EVEN, [50, 51, 120])
    assert codes(filmed(EVEN, EVEN, bumps=bumps)) == []
    assert codes(filmed(uneven, uneven, bumps=bumps)) == []
    assert codes(filmed(lost, lost, bumps=bumps)) == ["pictures_missing"]


@pytest.mark.parametrize("share", [0.01, 0.05, 0.15])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_dropped_pictures_under_even_stamps_are_found(share, seed):
    rng = np.random.default_rng(seed)
    kept = np.flatnonzero(rng.random(250) > share) if share > 0.01 else np.delete(np.arange(250), [80, 170])
    assert "stamps_contradicted" in codes(filmed(EVEN[kept], EVEN[: len(kept)], seed=seed))


@pytest.mark.parametrize("every", [3, 4, 6, 8])
def test_pictures_that_are_lost_regularly_are_found(every):
    """No eight pictures in a row hold no jump, and a tracker states as much noise as it sees: that across is less."""
    kept = np.flatnonzero(np.arange(250) % every)
    tracks = {
        name: replace(track, covariance=np.tile(np.diag([1e-6, 1e-6, 1e-9]), (len(kept), 1, 1)))
        for name, track in filmed(EVEN[kept], EVEN[: len(kept)]).items()
    }
    assert codes(tracks) == ["stamps_contradicted"]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_dropped_pictures_are_found_where_a_deviation_holds_what_wanders_slowly(seed):
    """Of a picture to the next a motion shows 0.02 mm, as filmed; a codec may leave it uncertain by much more."""

    def unsure(tracks):
        return {name: replace(track, covariance=2000 * track.covariance) for name, track in tracks.items()}

    kept = np.flatnonzero(np.random.default_rng(seed).random(250) > 0.15)
    assert "stamps_contradicted" in codes(unsure(filmed(EVEN[kept], EVEN[: len(kept)], seed=seed)))
    assert codes(unsure(filmed(EVEN, EVEN, seed=seed))) == []


def shown_so(shown, deviations):
    """Both bodies without noise, whose steps are so many stated deviations where they move at 0.127 m/s."""
    stated = np.diag([(0.127 / 25 / deviations) ** 2] * 2 + [1e-9])
    tracks = filmed(EVEN, EVEN, shown, noise_m=0.0)
    return {name: replace(track, covariance=np.tile(stated, (250, 1, 1))) for name, track in tracks.items()}


@pytest.mark.parametrize(("deviations", "told"), [(1.2, False), (2.4, True)])
def test_steps_of_a_motion_without_noise_are_compared_with_a_share_of_what_is_stated(deviations, told):
    shown = np.arange(250)
    shown[49] = 48
    assert ("pictures_repeated" in codes(shown_so(shown, deviations))) == told


@pytest.mark.parametrize(("deviations", "told"), [(2.0, False), (3.5, True)])
def test_a_picture_that_is_inserted_once_is_told_where_steps_are_long(deviations, told):
    """The next step makes up for nothing, so that only the lack of a step tells."""
    shown = np.delete(np.sort(np.r_[np.arange(250), 48]), -1)
    assert ("pictures_repeated" in codes(shown_so(shown, deviations))) == told


@pytest.mark.parametrize(("rest_s", "lost"), [(0, 60), (0, 61), (0, 103), (3.4, 120)])
def test_a_single_lost_picture_is_found_while_the_motion_changes(rest_s, lost):
    """One body slips and sticks, as a towed one does, or rests; the other alone says no more than that it leapt."""
    kept = np.delete(np.arange(250), [lost])

    def slipping(true_s):
        tracks = filmed(true_s, EVEN[: len(true_s)], speeds=(0.15, 0.0))
        along = 0.12 * (true_s - np.sin(16 * true_s) / 16) * (true_s > rest_s)
        pose = tracks["object"].pose + along[:, None] * [1, 0, 0]
        return tracks | {"object": replace(tracks["object"], pose=pose)}

    assert codes(slipping(EVEN)) == []
    assert codes(slipping(EVEN[kept])) == ["stamps_contradicted"]


@pytest.mark.parametrize("apart", [2, 3, 4])
@pytest.mark.parametrize("lost", [60, 117, 180])
def test_two_pictures_lost_near_each_other_are_found_while_the_motion_changes(lost, apart):
    """Eight pictures around either hold the other loss, too: poses were off by 8 times what is allowed, in silence."""
    kept = np.delete(np.arange(250), [lost, lost + apart])
    assert codes(filmed(EVEN, EVEN, bumps=0.05)) == []
    assert codes(filmed(EVEN[kept], EVEN[:248], bumps=0.05)) == ["stamps_contradicted"]


@pytest.mark.parametrize(("bend", "found"), [(0.47, True), (3.6, False)])
def test_two_losses_are_not_told_from_a_start(bend, found):
    """Of all the way of the three steps on one side, a half is gone on the other, or a quarter."""
    since = np.array([0.0, 1, 2, 3, 5, 6, 8, 9])
    place = 1e-3 * np.column_stack([since + bend / 9 * since**2, 0 * since])[None]
    gone = [np.ptp(place[0, part, 0]) for part in (slice(4), slice(4, 8))]
    assert gone[0] / gone[1] == pytest.approx(0.5 if found else 0.25, abs=0.01)
    bodies, c = [(place, 1e-10), (2 * place, 1e-10)], stamps_module.CONSTANTS
    assert near_losses.lost_in_two(np.arange(8.0)[None], bodies, c.dropped, c.smoother, c.goes_on) == [found]


def test_a_start_that_a_codec_holds_back_is_no_loss():
    """A taut tether starts both bodies at once. As measured on a filmed cube, which was not judged."""
    rover = [0, 3, 4, 6, 15, 82, 96, 121, 193, 576, 858, 1176, 1501, 1914, 2336, 2766, 3217, 3738]
    towed = [0, -1, 9, 17, 26, 66, 74, 73, 112, 449, 757, 1014, 1406, 1762, 2204, 2588, 3024, 3538]
    tracks, rng = filmed(EVEN, EVEN), np.random.default_rng(1)
    for name, start_um in (("rover", rover), ("object", towed)):
        along_um = [*start_um, *(start_um[-1] + 480 * np.arange(1, 251 - len(start_um)))]
        pose = np.column_stack([along_um, np.zeros((250, 2))]) + rng.normal(0, 2, (250, 3))
        tracks[name] = replace(tracks[name], pose=1e-6 * pose)
    assert codes(tracks) == []


@pytest.mark.parametrize(("true_step", "seed"), [(-10, 0), (-3, 1), (-1, 2), (-1.5, 3), (0.5, 4)])
def test_a_step_of_another_length_than_stamped_is_found(true_step, seed):
    """The second of two clips begins before the first one ends, or the clock is set."""
    stepped = EVEN + (true_step - 1) / 25 * (np.arange(250) >= 125)
    assert codes(filmed(stepped, EVEN, seed=seed)) == ["stamps_contradicted"]


def test_a_clock_that_was_set_is_found_at_the_odd_step_it_leaves():
    """By half a picture's time, under noise that hides it from those who do not know where to look."""
    later, found = EVEN + 0.02 * (np.arange(250) >= 125), []
    for seed in range(200, 210):
        found.append("stamps_contradicted" in codes(filmed(EVEN, later, seed=seed, noise_m=2e-4)))
        assert "stamps_contradicted" not in codes(filmed(later, later, seed=seed, noise_m=2e-4))
    assert sum(found) >= 9


def test_pictures_that_are_late_in_turn_are_as_uncertain():
    """By 3 ms, under a noise that hides it in any one step."""
    late = np.resize([-0.003, 0.003], 250)
    stated = np.tile(np.diag([16e-8, 16e-8, 1e-9]), (250, 1, 1))
    even, uneven = (
        {name: replace(track, covariance=stated) for name, track in filmed(EVEN + each, EVEN, noise_m=4e-4).items()}
        for each in (0 * late, late)
    )
    assert codes(even) == []
    tracks, findings, _ = check_stamps(uneven)
    assert [one.code for one in findings] == ["stamps_uneven"]
    speed = np.gradient(uneven["rover"].pose[:, 0], EVEN)
    added = np.sqrt((tracks["rover"].covariance - uneven["rover"].covariance)[:, 0, 0])
    assert np.median(added / np.abs(speed)) == pytest.approx(0.003, rel=0.2)


def started(true_s, way_m):
    """Tracks of a rover that drives a way (n,) [m], and of an object at rest, photographed at ``true_s``."""
    tracks = filmed(true_s, EVEN[: len(true_s)], speeds=(0.0, 0.0))
    row = np.searchsorted(EVEN, true_s - 1e-9)
    at_rest, driven = (np.random.default_rng(8 + k).normal(0, 2e-5, (len(EVEN), 3))[row] for k in (0, 1))
    driven[:, 0] += way_m[row]
    return {name: replace(tracks[name], pose=pose) for name, pose in (("rover", driven), ("object", at_rest))}


@pytest.mark.parametrize("repeated", [[100], [40, 41, 43], [56, 57], [248]])
def test_repeated_pictures_are_found_while_the_rover_speeds_up_and_the_object_rests(repeated):
    way_m = np.where(EVEN > 1, 0.02 * (EVEN - 1) ** 2, 0.0)
    shown = np.arange(250)
    for i in repeated:
        shown[i] = shown[i - 1]
    tracks, findings, stamps = check_stamps(started(EVEN[shown], way_m))
    assert [one.code for one in findings] == ["pictures_repeated"]
    assert np.flatnonzero(stamps == Stamp.REPEATED).tolist() == repeated
    assert not tracks["rover"].seen[repeated].any()


@pytest.mark.parametrize("pictures", [1, 2, 3])
def test_a_rover_that_halts_for_a_moment_repeats_no_picture(pictures):
    """It goes on from where it stood."""
    rolling_s = np.cumsum(
        np.r_[0.0, np.where((np.arange(1, 250) // 40 > 0) & (np.arange(1, 250) % 40 < pictures), 0, 0.04)]
    )
    assert "pictures_repeated" not in codes(started(EVEN, 0.08 * rolling_s + 0.01 * np.sin(rolling_s)))


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_repeated_pictures_that_fill_a_loss_are_left_out(share):
    rng = np.random.default_rng(3)
    shown = np.arange(250)
    for i in np.flatnonzero(rng.random(250) < share):
        shown[i] = shown[i - 1] if i > 5 else i
    tracks, findings, stamps = check_stamps(filmed(EVEN, EVEN, shown))
    assert findings[0].code == "pictures_repeated"
    assert share > 0.02 or len(findings) == 1
    repeated = np.flatnonzero(np.diff(shown) == 0) + 1
    assert np.array_equal(stamps == Stamp.REPEATED, ~tracks["rover"].seen)
    missed = set(repeated) - set(np.flatnonzero(~tracks["rover"].seen))
    assert len(missed) <= 0.2 * len(repeated)


@pytest.mark.parametrize("every", [3, 4, 10, 50])
def test_inserted_pictures_are_found(every):
    shown = np.sort(np.concatenate([np.arange(200), np.arange(5, 200, every - 1)]))
    assert "stamps_contradicted" in codes(filmed(EVEN, np.arange(len(shown)) / 25, shown))


@pytest.mark.parametrize(("frozen", "lost"), [(6, 0), (25, 0), (25, 4)])
def test_a_picture_that_is_frozen_for_a_while_is_found(frozen, lost):
    """Bodies seem to rest, and are then where they have come to; a tracker may need some pictures to find them."""
    shown = np.arange(250)
    shown[100 : 100 + frozen] = 99
    status = np.full(250, TrackStatus.TRACKED)
    status[100 + frozen : 100 + frozen + lost] = TrackStatus.LOST
    gone = (status == TrackStatus.LOST)[:, None]
    tracks = {
        name: replace(track, status=status, pose=np.where(gone, np.nan, track.pose))
        for name, track in filmed(EVEN, EVEN, shown).items()
    }
    assert "stamps_contradicted" in codes(tracks)


@pytest.mark.parametrize("moved_s", [0.42, 2.02, 6.02])
def test_a_film_that_shows_a_rest_but_for_a_short_drive_freezes_nowhere(moved_s):
    """Of two minutes: at less than a twentieth of it, what a body usually does in a step is nothing.

    It ends between two pictures; out of a whole step the picture could have frozen.
    """
    stamps_s = np.arange(3000) / 25
    true_s = np.clip(stamps_s - 60, 0, moved_s)
    assert codes(filmed(true_s, stamps_s)) == []


@pytest.mark.parametrize(("begins_s", "seed"), [(0.2, 4), (0.24, 1), (0.16, 0), (0.22, 7)])
@pytest.mark.parametrize("within_s", [0.2, 0.32])
def test_a_start_that_all_bodies_make_in_one_picture_is_no_lost_one(begins_s, seed, within_s):
    """In a short film, off from one picture to the next: a rest may have ended at any time, and no step be a lost one.

    The first two were told as such.
    """
    stamps_s = np.arange(40) / 25
    since = np.clip(stamps_s - begins_s, 0, None)
    along = 0.35 * (since - within_s * (1 - np.exp(-since / within_s)))
    tracks = filmed(stamps_s, stamps_s)
    for k, (name, track) in enumerate(tracks.items()):
        place = np.column_stack([along, 0.1 * along]) + 2.5e-5 * np.random.default_rng([seed, k]).standard_normal(
            (40, 2)
        )
        tracks[name] = replace(track, pose=np.column_stack([place, np.zeros(40)]))
    assert codes(tracks) == []


def test_a_rest_that_ends_as_bodies_do_is_none():
    """Rover and object stand for a second and go on: at full speed within a picture, or sliding off at a jerk."""
    still = np.clip(np.arange(250), None, 100) + np.clip(np.arange(250) - 125, 0, None)
    assert codes(filmed(still / 25, EVEN)) == []


@pytest.mark.parametrize(("jitter_ms", "found"), [(0.5, False), (1.4, False), (2.8, True), (4.0, True), (8.0, True)])
def test_stamps_that_shake_by_more_than_two_milliseconds_are_reported(jitter_ms, found):
    late = 1e-3 * jitter_ms * np.random.default_rng(5).standard_normal(250)
    assert bool({"stamps_uneven", "stamps_contradicted"} & set(codes(filmed(EVEN + late, EVEN)))) == found


@pytest.mark.parametrize("seed", range(3))
def test_stamps_that_shake_by_more_than_steps_can_tell_make_poses_as_uncertain(seed):
    """By a quarter of a step, with poses known to a seventh of one: no step is steady, none is large against noise."""
    late, noise_m = 0.01 * np.random.default_rng(seed).standard_normal(250), 6e-4
    shaken = filmed(EVEN + late, EVEN, speeds=(0.1, 0.06), noise_m=noise_m, seed=seed)
    shaken = {
        name: replace(track, covariance=noise_m**2 * np.tile(np.eye(3), (250, 1, 1))) for name, track in shaken.items()
    }
    tracks, findings, _ = check_stamps(shaken)
    assert [one.code for one in findings] == ["stamps_uneven"]
    speed = np.gradient(shaken["rover"].pose[:, 0], EVEN)
    added = np.sqrt((tracks["rover"].covariance - shaken["rover"].covariance)[:, 0, 0])
    assert np.median(added / np.abs(speed)) == pytest.approx(0.01, rel=0.25)


def evenly_on(speed, due, jumps):
    """Whether a body that goes on at a speed, in deviations of a velocity, does so through ``jumps`` of another one."""
    std = 2e-5 * stamps_module.CONSTANTS.least_noise * 25  # of a motion without noise, a share of what is stated
    pose = np.outer(EVEN, [speed * std, 0.0, 0.0])
    track = replace(filmed(EVEN, EVEN)["rover"], pose=pose)
    at = np.isin(np.arange(249), 100 + 5 * np.arange(jumps))
    return stamps_module._goes_on(track, np.ones(250, dtype=bool), at, np.full(249, due))


@pytest.mark.parametrize(("speed", "shows"), [(8.8, False), (16.8, True)])
def test_a_body_goes_on_that_misses_a_jump_by_three_deviations(speed, shows):
    """By half of a step the jump is, and two poses make a velocity: a quarter of the speed is missed by."""
    assert evenly_on(speed, 0.5, 1) is shows


@pytest.mark.parametrize(("speed", "moves"), [(3.5, False), (7.0, True)])
def test_a_body_that_creeps_by_less_than_five_deviations_goes_on_through_nothing(speed, moves):
    """However many the jumps of the other one are, and however sure their sum."""
    assert evenly_on(speed, 1.0, 25) is moves


def test_one_body_may_jump_by_itself():
    tracks = filmed(EVEN, EVEN)
    slipped = tracks["object"].pose.copy()
    slipped[100:] += [0.006, 0, 0]
    shown = {**tracks, "object": filmed(EVEN, EVEN)["object"]}
    object.__setattr__(shown["object"], "pose", slipped)
    assert codes(shown) == []


def test_a_long_gap_is_reported():
    assert codes(filmed(EVEN, np.where(EVEN > 5, EVEN + 3600, EVEN)))[0] == "time_gap"


def test_a_rate_against_the_camera_or_the_sound_is_reported():
    nan = float("nan")
    assert rate_findings(1 / 25, 25.0, 10.0, nan) == ()
    assert rate_findings(1 / 29.97, 30.0, 10.0, 10.01) == ()
    assert [one.code for one in rate_findings(1 / 24, 25.0, 10.0, nan)] == ["rate_contradicted"]
    assert [one.code for one in rate_findings(1 / 25, None, 60.0, 62.4)] == ["rate_contradicted"]


@pytest.mark.parametrize(("stated_hz", "found_hz", "times"), [(240, 30, 8), (240, 29.97, 8), (120, 30, 4), (30, 10, 3)])
def test_slow_motion_looks_like_pictures_left_out_and_is_told_without_sound(stated_hz, found_hz, times):
    """Stamped eight times as slow, every speed is an eighth of what it was; nothing in the pictures shows it."""
    nan = float("nan")
    (found,) = rate_findings(1 / found_hz, stated_hz, 10.0, nan)
    assert found.code == "rate_divided"
    assert f"is {times} times the" in found.text
    assert rate_findings(1 / found_hz, stated_hz, 10.0, 10.01) == (), "the sound runs as fast as the pictures"
    assert rate_findings(1 / found_hz, found_hz, 10.0, nan) == ()
    assert rate_findings([1 / stated_hz, 1 / found_hz], stated_hz, 10.0, nan) == (), "pictures missing by the stamps"


def test_a_percent_of_the_rate_is_seen_and_stamps_in_whole_milliseconds_are_none():
    nan = float("nan")
    assert [one.code for one in rate_findings(1 / 24.75, 25.0, 10.0, nan)] == ["rate_contradicted"]
    for rate_hz in (29.97, 59.94, 24.0):
        rounded = np.round(np.arange(300) / rate_hz, 3)
        assert rate_findings(usual_steps_s(np.delete(rounded, [50, 51, 200])), round(rate_hz), 10.0, nan) == ()
    assert usual_steps_s(np.arange(3) / 25) == pytest.approx(1 / 25)
    assert np.isnan(usual_steps_s(np.zeros(1))).all()
    assert [one.code for one in rate_findings(usual_steps_s(np.zeros(1)), None, 10.0, nan)] == ["rate_unconfirmed"]


@pytest.mark.parametrize(("rate_hz", "unusual"), [
    (25.0, False), (25.075, False), (29.97, False), (59.94, False), (12.0, False), (5.0, False), (1.0, False),
    (100 / 3, False), (26.0, True), (25.25, True), (25.15, True), (28.8, True), (31.5, True),
])  # fmt: skip
def test_a_rate_that_nothing_confirms_is_named_and_must_be_one_of_a_camera(rate_hz, unusual):
    found = [one.code for one in rate_findings(1 / rate_hz, None, 10.0, float("nan"))]
    assert found == ["rate_unusual" if unusual else "rate_unconfirmed"]
    assert rate_findings(1 / rate_hz, rate_hz, 10.0, float("nan")) == ()
    assert rate_findings(1 / rate_hz, None, 10.0, 10.0) == ()


def test_the_picture_before_a_jump_is_marked():
    kept = np.delete(np.arange(250), [80, 81, 170])
    stamps = check_stamps(filmed(EVEN[kept], EVEN[: len(kept)]))[2]
    assert np.flatnonzero(stamps == Stamp.CONTRADICTED).tolist() == [79, 167]


@pytest.mark.parametrize(
    ("shares", "common"), [((1.0, 1.15), True), ((1.0, 1.3), False), ((4.0, 4.6), True), ((4.0, 5.2), False)]
)
def test_bodies_jump_together_where_they_agree_to_a_fifth_of_the_step(shares, common):
    assert _common(np.array(shares)[:, None], np.ones((2, 1), dtype=bool)).all() == common


@pytest.mark.parametrize(("gap_s", "found"), [(0.72, "pictures_missing"), (1.4, "time_gap")])
def test_a_second_without_a_picture_is_a_gap_and_less_of_it_lost_pictures(gap_s, found):
    later = EVEN + (gap_s - 0.04) * (np.arange(250) >= 125)
    assert codes(filmed(later, later)) == [found]


@pytest.mark.parametrize(("heard_s", "found"), [(201.5, []), (203.0, ["rate_contradicted"])])
def test_sound_and_pictures_are_as_long_to_a_hundredth(heard_s, found):
    """Two seconds of 200, by which a recorder may start or stop one of them before the other."""
    assert [one.code for one in rate_findings(1 / 25, None, 200.0, heard_s)] == found


@pytest.mark.parametrize(("heard_s", "found"), [(20.4, []), (20.6, ["rate_contradicted"])])
def test_sound_and_pictures_of_a_short_film_end_within_half_a_second(heard_s, found):
    assert [one.code for one in rate_findings(1 / 25, None, 20.0, heard_s)] == found


@pytest.mark.parametrize(("heard_s", "fps", "found"), [
    (48.0, 25.0, []), (48.0, None, ["rate_unconfirmed"]), (50.0, 25.0, ["rate_contradicted"]), (-1.0, 25.0, []),
    (62.0, 25.0, ["rate_contradicted"]),
])  # fmt: skip
def test_a_sound_that_ends_before_the_pictures_contradicts_only_by_a_rate_of_cameras(heard_s, fps, found):
    """A minute of pictures; filmed at 30 a second and stamped as 25, it would sound for 50 s."""
    assert [one.code for one in rate_findings(1 / 25, fps, 60.0, heard_s)] == found


@pytest.mark.parametrize(("share", "found"), [(0.07, "pictures_repeated"), (0.15, "stamps_contradicted")])
def test_a_picture_is_repeated_where_bodies_move_by_less_than_a_tenth_of_a_step(share, found):
    true_s = EVEN.copy()
    true_s[49] = EVEN[48] + 0.04 * share
    _, findings, stamps = check_stamps(filmed(true_s, EVEN))
    assert found in {one.code for one in findings}
    assert np.flatnonzero(stamps == Stamp.REPEATED).tolist() == ([49] if found == "pictures_repeated" else [])


@pytest.mark.parametrize(("steps", "found"), [(2.2, []), (4.5, ["stamps_contradicted"])])
def test_a_leap_out_of_a_rest_is_three_times_as_fast_as_a_body_ever_is(steps, found):
    """Two bodies stand for a second, and are then so many steps farther: by a jerk, or since the picture was frozen."""
    index = np.arange(250)
    way = np.where(index < 100, index, 99 + (index - 125 + steps) * (index >= 125))
    tracks = {
        name: replace(track, pose=np.outer(speed * way / 25, [1, 0, 0]))
        for (name, track), speed in zip(filmed(EVEN, EVEN).items(), (0.15, 0.12), strict=True)
    }
    assert codes(tracks) == found


def along(tracks, rover_m, object_m, noise_m, seed=0):
    """The tracks of two bodies that go straight, to places (n,) [m], with a deviation of each pose."""
    rng = np.random.default_rng(seed)
    return {
        name: replace(
            track,
            pose=np.outer(way, [1, 0, 0]) + noise_m * rng.standard_normal((len(way), 3)),
            covariance=noise_m**2 * np.tile(np.eye(3), (len(way), 1, 1)),
        )
        for (name, track), way in zip(tracks.items(), (rover_m, object_m), strict=True)
    }


def slips(time_s, slip_m=0.02, lasts_s=0.314, every_s=2.0):
    """Place (n,) [m] of a body that sticks and slips, by half a cosine."""
    count, since = np.divmod(time_s, every_s)
    return slip_m * (count + (1 - np.cos(np.pi * np.clip(since / lasts_s, 0, 1))) / 2)


@pytest.mark.parametrize("seed", range(3))
def test_a_slow_body_that_goes_on_shows_that_the_other_one_slips(seed):
    """The rover goes 13 deviations a picture: too slow for any one step to be compared, not for ten of them."""
    time_s = np.arange(750) / 25
    kept = np.flatnonzero(np.random.default_rng(seed).random(750) > 0.05)

    def towed(true_s):
        tracks = filmed(EVEN, time_s[: len(true_s)], np.zeros(len(true_s), dtype=int))
        return along(tracks, 0.01 * true_s, slips(true_s + 0.1), 3e-5, seed)

    assert codes(towed(time_s)) == []
    steady = towed(time_s[kept]) | {"object": filmed(time_s[kept], time_s[: len(kept)])["object"]}
    assert codes(steady) == ["stamps_contradicted"]


@pytest.mark.parametrize(
    ("rover_speed", "slip_m", "lasts_s", "noise_m"),
    [
        # Fastest in its middle, as if a picture had been lost there, four times.
        (0.002, 0.008, 0.27, 3e-5),
        # Within three pictures, out of a rest of several seconds.
        (0.002, 0.008, 0.12, 3e-5),
        (0.001, 0.02, 0.12, 1e-4),
    ],
)
def test_a_rover_too_slow_to_be_seen_to_move_from_picture_to_picture_tows_what_sticks(
    rover_speed, slip_m, lasts_s, noise_m
):
    time_s = np.arange(600) / 25
    tracks = filmed(EVEN, time_s, np.zeros(600, dtype=int))
    towed_m = slips(time_s + 0.03, slip_m, lasts_s, slip_m / rover_speed)
    assert codes(along(tracks, rover_speed * time_s, towed_m, noise_m)) == []
    # Both are frozen for a second.
    shown = np.where((time_s > 7) & (time_s < 8), 7.0, time_s)
    fast_m = 0.05 * shown
    assert codes(along(tracks, rover_speed * shown, fast_m, noise_m)) == ["stamps_contradicted"]


@pytest.mark.parametrize(("rover_speed", "found"), [(0.0, ["stamps_contradicted"]), (0.002, [])])
def test_a_picture_is_not_frozen_in_which_one_body_creeps(rover_speed, found):
    """The other one stands for a second, then leaps by ten of its steps; the rover goes 2.7 deviations a picture."""
    index = np.arange(250)
    leapt = 0.001 * (np.minimum(index, 100) + np.maximum(index - 125, 0) + 10 * (index > 125))
    assert codes(along(filmed(EVEN, EVEN), rover_speed * EVEN, leapt, 3e-5)) == found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("noise_m", "found"), [(5e-4, ["stamps_uneven"]), (1.1e-3, [])])
def test_stamps_are_uneven_where_more_than_half_of_the_lateness_is_common_to_two_bodies(noise_m, found, seed):
    """By 6 ms; noise makes each body seem early or late by itself, by some 3.5 or 8 ms."""
    late = 6e-3 * np.random.default_rng(seed).standard_normal(250)
    stated = noise_m**2 * np.tile(np.eye(3), (250, 1, 1))
    shaken = filmed(EVEN + late, EVEN, speeds=(0.1, 0.1), noise_m=noise_m, seed=seed)
    assert codes({name: replace(track, covariance=stated) for name, track in shaken.items()}) == found


@pytest.mark.parametrize(("deviations", "tells"), [(2.2, False), (4.5, True)])
def test_a_body_tells_how_late_a_picture_is_from_three_deviations_a_step_on(deviations, tells):
    rover = filmed(EVEN[:20], EVEN[:20])["rover"]
    std_m = np.sqrt(rover.covariance[0, 0, 0])
    pose = np.outer(np.arange(20) * deviations * std_m, [0.6, 0.8, 0.0])
    late = _lateness_s(replace(rover, pose=pose), np.ones(20, dtype=bool))
    assert np.isfinite(late).any() == tells


class Missed:
    """Stands in for how far a body misses smooth curves: as usual, but at the middle step so many times as much.

    Taken for a step of another length, it fits some ``times`` as well.
    """

    def __init__(self, misfit, times):
        self.misfit, self.times = misfit, times

    def __call__(self, time_s, _place, extra):
        missed = self.misfit if np.all(extra == 0) else self.misfit / self.times
        return np.where(np.isclose(time_s[:, 3], EVEN[125]), missed, 1.0)


def dropped_steps(monkeypatch, stamps_s, missed):
    monkeypatch.setattr(stamps_module, "misfit", missed)
    monkeypatch.setattr(stamps_module, "_noise_m", lambda *_: 0.0)
    return np.flatnonzero(_dropped({"rover": filmed(EVEN, stamps_s)["rover"]}, np.ones(250, dtype=bool))).tolist()


@pytest.mark.parametrize(("times", "found"), [(7, []), (14, [125])])
def test_a_step_is_longer_than_stamped_where_bodies_fit_ten_times_as_well(monkeypatch, times, found):
    assert dropped_steps(monkeypatch, EVEN, Missed(100, times)) == found


@pytest.mark.parametrize(("misfit", "found"), [(18, []), (35, [125])])
def test_a_step_is_as_stamped_where_bodies_miss_by_less_than_five_times_the_usual_deviation(monkeypatch, misfit, found):
    """Squared, 25 times, however well another length fits."""
    assert dropped_steps(monkeypatch, EVEN, Missed(misfit, misfit)) == found


@pytest.mark.parametrize(
    ("share", "misfit", "times", "found"),
    [(0.15, 20, 20, [125]), (0.07, 20, 20, []), (0.15, 20, 7.5, [125]), (0.15, 20, 3.5, []), (0.15, 9, 9, [125]),
     (0.15, 4, 7.5, [])],
)  # fmt: skip
def test_a_clock_was_set_at_a_step_a_tenth_off_where_bodies_fit_five_times_as_well(
    monkeypatch, share, misfit, times, found
):
    """As it is stamped, they miss by six times their usual square: less than where any other length is tried."""
    later = EVEN + 0.04 * share * (np.arange(250) > 125)
    assert dropped_steps(monkeypatch, later, Missed(misfit, times)) == found


@pytest.mark.parametrize(("times", "jumps"), [(2.2, False), (4.2, True)])
def test_a_body_alone_jumps_where_it_fits_three_times_as_well(monkeypatch, times, jumps):
    monkeypatch.setattr(stamps_module, "misfit", Missed(100, times))
    monkeypatch.setattr(stamps_module, "_noise_m", lambda *_: 0.0)
    rover, at = filmed(EVEN, EVEN)["rover"], np.arange(249) == 125
    assert _smoother(rover, np.ones(250, dtype=bool), at, np.ones(249)).any() == jumps


@pytest.mark.parametrize(("change", "told"), [(0.18, True), (0.35, False)])
def test_a_jump_is_told_where_the_speed_changes_by_less_than_a_quarter(change, told):
    rover = filmed(EVEN[:8], EVEN[:8])["rover"]
    step = 0.006 * np.array([1 - change / 2] * 3 + [1] + [1 + change / 2] * 3)
    pose = np.outer(np.concatenate([[0], np.cumsum(step)]), [0.6, 0.8, 0])
    assert _share(replace(rover, pose=pose), np.ones(8, dtype=bool))[1].tolist() == [False] * 3 + [told] + [False] * 3


@pytest.mark.parametrize(("jumps", "bodies", "enough"), [(2, 1, False), (4, 1, True), (1, 2, True)])
def test_a_body_that_moves_alone_slips_twice_but_does_not_jump_four_times(jumps, bodies, enough):
    assert _enough(np.arange(50) < jumps, np.ones((bodies, 50), dtype=bool)) == enough


@pytest.mark.parametrize(("pictures", "found"), [(26, []), (50, ["stamps_uneven"])])
def test_how_far_stamps_shake_is_told_from_thirty_pictures_on(pictures, found):
    late = np.random.default_rng(5).uniform(-5e-3, 5e-3, pictures)
    assert codes(filmed(EVEN[:pictures] + late, EVEN[:pictures])) == found


@pytest.mark.parametrize("rate_hz", [25.0, 29.97, 59.94, 239.76])
def test_the_step_of_stamps_in_whole_milliseconds_is_known_to_a_fiftieth_of_one(rate_hz):
    rounded = np.round(np.arange(600) / rate_hz, 3)
    assert usual_steps_s(rounded) == pytest.approx(1 / rate_hz, abs=1e-3 / 50)


def test_a_picture_lost_in_eighty_leaves_the_usual_step_as_it_is():
    lossy = np.delete(np.arange(400) / 25, np.arange(40, 400, 80))
    assert usual_steps_s(lossy) == pytest.approx(0.04, rel=1e-6)


@pytest.mark.parametrize("lost", [0.03, 0.1, 0.25])
@pytest.mark.parametrize("rate_hz", [25.0, 59.94])
def test_pictures_that_are_lost_by_their_stamps_leave_the_rate_as_it_is(rate_hz, lost):
    nan = float("nan")
    for seed in range(10):
        kept = np.flatnonzero(np.random.default_rng(seed).random(400) > lost)
        steps_s = usual_steps_s(np.round(kept / rate_hz, 3))
        assert rate_findings(steps_s, rate_hz, nan, nan) == ()
        assert [one.code for one in rate_findings(steps_s, None, nan, nan)] == ["rate_unconfirmed"]
        assert [one.code for one in rate_findings(0.98 * steps_s, rate_hz, nan, nan)] == ["rate_contradicted"]


@pytest.mark.parametrize(("rate_hz", "counted_hz"), [(25, 30), (20, 30), (24, 60), (50, 60), (12.5, 15), (30, 100)])
def test_pictures_that_seem_to_be_lost_by_coarse_stamps_leave_the_rate_as_it_is(rate_hz, counted_hz):
    """Stamps in whole pictures of a file that holds more of them than the camera took."""
    stamps_s = np.round(np.arange(600) / rate_hz * counted_hz) / counted_hz
    assert rate_findings(usual_steps_s(stamps_s), rate_hz, 10.0, float("nan")) == ()


@pytest.mark.parametrize(("off", "found"), [(0.002, []), (0.0045, ["rate_contradicted"])])
def test_a_rate_is_the_stated_one_within_three_thousandths(off, found):
    assert [one.code for one in rate_findings((1 + off) / 25, 25.0, 10.0, float("nan"))] == found


@pytest.mark.parametrize(("share", "jumps"), [(0.2, False), (0.45, True), (-0.2, False), (-0.45, True)])
def test_a_step_jumps_that_is_longer_or_shorter_by_three_tenths(share, jumps):
    assert _common(np.full((2, 1), share), np.ones((2, 1), dtype=bool)).all() == jumps
