"""Thinning: the bound holds, pauses stay pauses, times stay times, and the noise comes from the track."""

import tracemalloc
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from towval.model.errors import InputError, RefusedError
from towval.validation.bridges import off_bridge_m
from towval.validation.consequences import excused
from towval.validation.decimate import DecimateSettings, _fit, decimate, find_pauses, noise_of

STD = np.array([1e-4, 1e-4, 2e-4])


def stop_and_go(time_s):
    """Along x at 0.1 m/s, from 2 to 5 s and from 8 s on, with smooth starts and stops of half a second."""

    def ramp(t, start):
        s = np.clip((t - start) / 0.5, 0, 1)
        return np.where(t > start + 0.5, t - start - 0.25, 0.5 * (s**3 - 0.5 * s**4))

    x = 0.1 * (ramp(time_s, 2.0) - ramp(time_s, 4.5) + ramp(time_s, 8.0))
    return np.stack([x, 0.2 * x, 0.5 * x], axis=1)


def arc(time_s):
    angle = 0.1 * time_s
    return np.stack([np.sin(angle), 1 - np.cos(angle), angle], axis=1)


def test_noise_is_read_off_the_track(make_track):
    estimates = np.array([noise_of(t.time_s, t.pose, t.std) for t in (make_track(arc, seed=s) for s in range(20))])
    # 300 poses: one estimate scatters by about 6 %, the mean of 20 by 1.5 %; third differences of the arc add nothing.
    np.testing.assert_allclose(estimates.mean(axis=0), STD, rtol=0.05)


def test_noise_does_not_come_from_a_constant(make_track):
    loud = make_track(arc, std=10 * STD)
    np.testing.assert_allclose(noise_of(loud.time_s, loud.pose, loud.std), 10 * STD, rtol=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_what_sticks_and_slips_between_few_frames_a_second_is_no_noise(make_track, seed):
    """At 5 frames a second slips of 5 to 60 mm scatter as noise of 10 mm does, and smoothed away where it began."""
    rng = np.random.default_rng(seed)
    begin_s, slips_m = 2 + np.cumsum(rng.uniform(0.2, 0.9, 60)), rng.uniform(0.005, 0.06, 60)

    def slipping(time_s):
        x = np.clip((time_s[:, None] - begin_s) / 0.05, 0, 1) @ slips_m
        return np.column_stack([x, 0 * x, 0 * x])

    thin = decimate(make_track(slipping, duration_s=24.0, rate_hz=5.0, seed=seed))
    assert abs(thin.poses_at(0.0)[0]) < 6e-4
    assert (thin.noise <= 6 * STD).all()


@pytest.mark.parametrize("motion", [arc, stop_and_go])
@pytest.mark.parametrize("level", [0.3, 1.0, 10.0])
def test_the_stated_bound_holds_between_all_kept_times(make_track, motion, level):
    track = make_track(motion, std=level * STD, seed=3)
    thin = decimate(track)
    misfit = (track.pose - thin.poses_at(track.time_s)) / thin.noise
    edges = np.searchsorted(track.time_s, thin.time_s)
    for i, j in pairwise(edges):
        inside = misfit[i : j + 1]
        if j - i >= 3:
            assert np.mean(inside**2) <= 1 + 3 * np.sqrt(2 / inside.size) + 1e-9


@pytest.mark.parametrize("motion", [arc, stop_and_go])
def test_smoothing_brings_the_track_closer_to_the_truth(make_track, motion):
    track = make_track(motion, seed=5)
    error = decimate(track).poses_at(track.time_s) - motion(track.time_s)
    assert (np.sqrt(np.mean(error**2, axis=0)) < 0.7 * STD).all()
    assert len(decimate(track).time_s) < len(track.time_s) / 8


def winding(time_s):
    """Along a winding path at 0.2 m/s from 1 s on, by integration in milliseconds."""
    fine = np.arange(0.0, time_s[-1] + 0.002, 1e-3)
    speed = 0.2 * np.clip((fine - 1) / 0.4, 0, 1)
    heading = np.cumsum(1.2 * np.sin(1.5 * fine) * (speed > 0)) * 1e-3
    steps = speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]) * 1e-3
    return np.stack([np.interp(time_s, fine, each) for each in (*np.cumsum(steps, axis=0).T, heading)], axis=1)


def rate_errors(thin, motion):
    """Errors [m/s] of the rates between frames of a decimated track."""
    time_s = np.arange(0.1, thin.time_s[-1] - 0.1, 0.005)
    true = (motion(time_s + 0.002) - motion(time_s - 0.002)) / 0.004
    return np.linalg.norm((thin.poses_and_rates_at(time_s)[:, 3:] - true)[:, :2], axis=1)


@pytest.mark.parametrize("motion", [arc, stop_and_go, winding])
def test_a_track_without_noise_keeps_its_rates_with_few_poses(make_track, motion):
    """A part of the tracker's deviation counts; without it every second pose was kept, and rates swung by 0.2 m/s."""
    thin = decimate(replace(make_track(motion), pose=motion(make_track(motion).time_s)))
    assert len(thin.time_s) < 300 / 6
    assert rate_errors(thin, motion).max() < 0.006


@pytest.mark.parametrize("seed", range(4))
def test_noise_that_neighbours_share_is_not_followed(make_track, seed):
    """A tracker's errors wander as a body moves over the pixels: here by 28 µm in five frames, with 13 µm of white."""
    rng = np.random.default_rng(seed)
    track = make_track(winding, std=STD * 0.13, seed=seed)
    wander = np.zeros((len(track.time_s), 3))
    for i in range(1, len(wander)):
        wander[i] = 0.8 * wander[i - 1] + 0.6 * rng.standard_normal(3)
    covariance = np.diag((0.31 * STD) ** 2)
    stated = replace(track, pose=track.pose + 0.28 * STD * wander, covariance=np.tile(covariance, (len(wander), 1, 1)))
    thin = decimate(stated)
    np.testing.assert_allclose(thin.noise, 0.31 * STD, rtol=0.1)
    errors = rate_errors(thin, winding)
    assert errors.max() < 0.01
    assert np.sqrt(np.mean(errors**2)) < 1e-3
    between = np.arange(1.0, 11.0, 0.005)
    assert np.abs((thin.poses_at(between) - winding(between))[:, :2]).max() < 1.5e-4


@pytest.mark.parametrize("times", [3.0, 100.0])
def test_a_deviation_that_holds_more_than_noise_does_not_smooth_the_path(make_track, times):
    """What a tracker adds where it doubts the times, a hundred times the noise, would hide bends of centimetres."""
    track = make_track(winding, seed=4)
    thin = decimate(replace(track, covariance=times**2 * track.covariance))
    assert (thin.noise < 6 * STD).all()
    off = (thin.poses_at(track.time_s) - winding(track.time_s))[:, :2]
    assert np.sqrt(np.mean(off**2)) < times / (1 + times) * 3e-4


def test_stretches_too_short_for_their_unknowns_take_their_rates_from_the_frames():
    """Kept at every frame, all rates are undetermined; the curve through a parabola has its slopes."""
    time_s = np.arange(12) / 25
    pose = np.stack([time_s**2, 0.3 * time_s, -0.1 * time_s], axis=1)
    fit = _fit(time_s, pose, np.tile(STD, (12, 1)), list(range(12)), [])
    true = np.stack([2 * time_s, np.full(12, 0.3), np.full(12, -0.1)], axis=1)
    np.testing.assert_allclose(fit.nodes[1:-1, 1], true[1:-1], atol=1e-9)
    np.testing.assert_allclose(fit.nodes[:, 0], pose, atol=1e-9)


def test_a_rest_ends_before_the_body_moves(make_track):
    """A rest that lasts some frames too long is caught up with at once, with rates three times as wrong."""

    def starting(t):
        t = np.maximum(t - 2.0, 0.0)
        return np.stack([0.1 * t**2 / (0.5 + t), 0.06 * t**2 / (0.8 + t), 0.0 * t], axis=-1)

    h, times, off = 1e-5, np.linspace(1.5, 3.0, 100), []
    for seed in range(12):
        thin = decimate(make_track(starting, std=3 * STD, seed=seed))
        off.append(
            thin.poses_and_rates_at(times)[:, 3:5] - (starting(times + h) - starting(times - h))[:, :2] / (2 * h)
        )
    assert np.sqrt(np.mean(np.square(off))) < 3e-3


def test_pauses_stay_pauses(make_track):
    thin = decimate(make_track(stop_and_go, seed=1))
    assert len(thin.pauses) == 2
    # The ramps start and end without a jerk that 0.1 mm of noise would show at once: 0.25 s is what they hide.
    np.testing.assert_allclose(thin.pauses, [[0, 2], [5, 8]], atol=0.25)
    inside = np.linspace(thin.pauses[1, 0], thin.pauses[1, 1], 50)
    assert np.ptp(thin.poses_at(inside), axis=0).max() < 1e-12
    assert np.abs(thin.poses_and_rates_at(inside)[:, 3:]).max() < 1e-12


def test_poses_are_those_of_the_spline(make_track):
    thin = decimate(make_track(stop_and_go, seed=1))
    times = np.concatenate([np.linspace(thin.time_s[0] - 0.1, thin.time_s[-1] + 0.1, 999), thin.time_s])
    reference = CubicHermiteSpline(thin.time_s, thin.pose, thin.rate, extrapolate=False)
    np.testing.assert_allclose(thin.poses_at(times), reference(times), rtol=1e-14, atol=1e-16)
    assert np.isnan(thin.poses_at(thin.time_s[-1] + 1e-9)).all()
    assert thin.poses_at(thin.time_s[0]).shape == (3,)


def test_creep_is_no_pause(make_track):
    """1 mm/s with 0.1 mm of noise: slow, but it moves."""
    track = make_track(lambda t: np.stack([1e-3 * t, 0 * t, 0 * t], axis=1), seed=2)
    thin = decimate(track)
    assert np.sum(np.diff(thin.pauses, axis=1)) < 2.0
    error = thin.poses_at(track.time_s)[:, 0] - 1e-3 * track.time_s
    assert np.abs(error).max() < 3 * STD[0]


def test_times_are_times_of_frames(make_track):
    track = make_track(arc)
    assert np.isin(decimate(track).time_s, track.time_s).all()
    assert decimate(track).time_s[[0, -1]] == pytest.approx(track.time_s[[0, -1]])


def test_a_still_body_becomes_one_pose(make_track):
    thin = decimate(make_track(lambda t: np.tile([0.3, -0.2, 0.1], (len(t), 1)), seed=4))
    assert len(thin.time_s) == 2
    np.testing.assert_allclose(thin.pose[0], [0.3, -0.2, 0.1], atol=4e-5)
    # The mean of 300 poses is known sqrt(300) times better than one.
    np.testing.assert_allclose(np.sqrt(np.diag(thin.covariance[0])), STD / np.sqrt(300), rtol=0.15)


def test_predicted_deviation_of_kept_poses_matches_their_scatter(make_track):
    """Reduced to one knot pattern by a still body: the error over 60 seeds against the prediction."""
    thin = [decimate(make_track(lambda t: np.zeros((len(t), 3)), seed=s, duration_s=4)) for s in range(60)]
    error = np.array([t.pose[0] / np.sqrt(np.diag(t.covariance[0])) for t in thin])
    assert 0.8 < np.sqrt(np.mean(error**2)) < 1.25


def test_lost_frames_are_bridged_and_told(make_track):
    track = make_track(arc, lost=range(100, 120))
    thin = decimate(track)
    assert "decimate_bridged" in {finding.code for finding in thin.findings}
    assert np.abs(thin.poses_at(track.time_s) - arc(track.time_s)).max() < 1e-3


@pytest.mark.parametrize("std", [(0.0, 0.0, 0.0), (1e-4, 1e-4, 0.0)])
def test_a_track_that_states_no_deviation_is_decimated_by_its_scatter(make_track, std):
    """Its noise counted as zero, and the fit divided by it."""
    stated = make_track(arc, std=(1e-4, 1e-4, 2e-4))
    thin = decimate(replace(stated, covariance=np.tile(np.diag(np.square(std)), (len(stated.time_s), 1, 1))))
    np.testing.assert_allclose(thin.noise, [1e-4, 1e-4, 2e-4], rtol=0.2)
    assert np.abs(thin.poses_at(stated.time_s) - arc(stated.time_s)).max() < 1e-3


def test_frames_lost_before_and_after_all_others_are_not_bridged(make_track):
    """A body that leaves the picture: the curve ends there, and was said to bridge it by a gap of one step."""
    thin = decimate(make_track(arc, lost=[*range(10), *range(250, 300)]))
    assert [finding.code for finding in thin.findings] == ["decimated"]
    assert thin.time_s[-1] == pytest.approx(249 / 25)


def stop(t):
    """At 0.13 m/s to a stand at 5 s, within 0.2 s."""
    along = 0.13 * np.where(t < 4.8, t, np.where(t > 5, 4.9, t - (t - 4.8) ** 2 / 0.4))
    return np.column_stack([along, 0 * t, 0 * t])


def test_a_stop_that_nobody_saw_leaves_the_run_unjudged(make_track):
    """The bridge slows down all along the gap; how far off that is follows from both ends."""
    track = make_track(stop, duration_s=10, lost=range(75, 175))
    thin = decimate(track)
    (doubt,) = [found for found in thin.findings if found.code == "bridge_unsure"]
    gap = track.time_s[[74, 175]]
    hidden = track.time_s[74:176]
    missed = np.abs(thin.poses_at(hidden) - stop(hidden))[:, 0].max()
    assert missed > 0.03
    assert off_bridge_m(thin, *gap) == pytest.approx(missed, rel=0.1)
    assert f"{1000 * off_bridge_m(thin, *gap):.0f} mm" in doubt.text


def test_a_steady_rover_may_be_hidden_and_so_may_the_object(make_track):
    even = make_track(lambda t: np.column_stack([0.13 * t, 0 * t, 0 * t]), duration_s=10, lost=range(75, 175))
    steady = decimate(even)
    assert "bridge_unsure" not in {found.code for found in steady.findings}
    track = replace(make_track(stop, duration_s=10, lost=range(75, 175)), body="object")
    assert "bridge_unsure" not in {found.code for found in decimate(track).findings}


def test_a_turn_on_the_spot_that_nobody_saw_leaves_the_run_unjudged(make_track):
    """A turn of 0.5 rad within a second of a gap of four: a hinge 0.3 m off the middle swings by 0.15 m."""
    turn = make_track(
        lambda t: np.column_stack([0 * t, 0 * t, 0.5 * np.clip(t - 3.2, 0, 1)]), duration_s=10, lost=range(75, 175)
    )
    assert "bridge_unsure" in {found.code for found in decimate(turn).findings}
    even = make_track(lambda t: np.column_stack([0 * t, 0 * t, 0.1 * t]), duration_s=10, lost=range(75, 175))
    assert "bridge_unsure" not in {found.code for found in decimate(even).findings}


@pytest.mark.parametrize(("rate_hz", "sparse"), [(2.0, True), (10.0, False), (25.0, False)])
def test_a_stop_between_two_pictures_is_held_against_no_model(make_track, rate_hz, sparse):
    """A right model that was filmed twice a second disagreed, where the tolerance was small."""

    def earlier(t):
        return stop(t + 0.15)

    track = make_track(earlier, duration_s=20, rate_hz=rate_hz)
    thin = decimate(track)
    named = [found for found in thin.findings if found.code == "pictures_sparse"]
    assert bool(named) == excused(found.code for found in named) == sparse
    if sparse:
        between = np.arange(4.5, 5.0, 0.01)
        missed = np.abs(thin.poses_at(between) - earlier(between))[:, 0].max()
        assert 0.004 < missed < off_bridge_m(thin, 4.5, 5.0)
        assert f"{1000 * off_bridge_m(thin, 4.5, 5.0):.0f} mm ahead of or behind" in named[0].text
    even = make_track(lambda t: np.column_stack([0.13 * t, 0 * t, 0 * t]), duration_s=20, rate_hz=rate_hz)
    for other in (even, replace(track, body="object")):
        assert "pictures_sparse" not in {found.code for found in decimate(other).findings}


def test_a_burst_that_neither_end_shows_counts_by_half_of_what_is_missing(make_track):
    thin = decimate(make_track(arc))
    burst = replace(
        thin, time_s=[0.0, 2.0], pose=[[0, 0, 0], [0.2, 0, 0]], rate=np.zeros((2, 3)), covariance=np.zeros((2, 3, 3))
    )
    assert off_bridge_m(burst, 0.0, 2.0) == pytest.approx(0.1, rel=1e-3)


def test_the_result_moves_and_turns_with_the_track(make_track):
    """Shifting a track shifts what is kept: no origin is special."""
    track = make_track(arc, seed=7)
    shifted = make_track(lambda t: arc(t) + np.array([10.0, -20.0, 3.0]), seed=7)
    np.testing.assert_allclose(
        decimate(shifted).pose - decimate(track).pose, np.tile([10, -20, 3], (len(decimate(track).pose), 1)), atol=1e-9
    )


def test_too_short_a_track_is_refused(make_track):
    with pytest.raises(RefusedError, match="tracked frames"):
        decimate(make_track(arc, duration_s=0.2))


def test_settings_out_of_range_are_refused():
    with pytest.raises(InputError, match=r"decimate\.excess"):
        DecimateSettings(excess=0)


def test_find_pauses_finds_none_in_motion(make_track):
    track = make_track(arc)
    assert find_pauses(track.time_s, track.pose, np.tile(STD, (len(track.pose), 1)), 0.3) == []


def test_a_pose_far_off_the_smoothed_track_is_reported(make_track):
    track = make_track(arc, std=STD)
    pose = np.array(track.pose)
    pose[150, 0] = arc(track.time_s)[150, 0] + 7 * STD[0]
    # With the usual bound the curve bends towards such a pose; with a loose one it is left out.
    loose = DecimateSettings(excess=30)
    codes = {finding.code for finding in decimate(replace(track, pose=pose), loose).findings}
    assert "decimate_outlier" in codes
    assert [finding.code for finding in decimate(track, loose).findings] == ["decimated"]


def rounds(time_s):
    """Two laps of :func:`stop_and_go` a minute, for any time."""
    whole, part = np.divmod(time_s, 30.0)
    return stop_and_go(part) + whole[:, None] * stop_and_go(np.array([30.0]))


def test_poses_and_their_covariances_are_those_of_the_least_squares_cubic(make_track):
    """All equations at once, by SciPy's cubic and a dense inverse; the weak pull on open rates moves both by 1e-4."""
    track = make_track(stop_and_go, duration_s=12.0, seed=11)
    thin = decimate(track)
    # Value and rate of each knot; at rest both ends have one value and no rate.
    columns, knots = [], len(thin.time_s)
    for k, time_s in enumerate(thin.time_s):
        value, rate = np.zeros((2, knots)), np.zeros((2, knots))
        value[0, k] = rate[1, k] = 1.0
        if time_s in thin.pauses[:, 0]:
            value[0, k + 1] = 1.0
        if time_s not in thin.pauses[:, 1]:
            columns.append(value)
        if time_s not in thin.pauses:
            columns.append(rate)
    design = np.stack([CubicHermiteSpline(thin.time_s, *unknown)(track.time_s) for unknown in columns], axis=1)
    values = np.stack([unknown[0] for unknown in columns], axis=1)
    assert len(thin.pauses) > 1
    for c in range(3):
        solution, *_ = np.linalg.lstsq(design, track.pose[:, c], rcond=None)
        np.testing.assert_allclose(thin.pose[:, c], values @ solution, atol=1e-3 * STD[c])
        covariance = values @ np.linalg.inv(design.T @ design) @ values.T * thin.noise[c] ** 2
        np.testing.assert_allclose(thin.covariance[:, c, c], np.diag(covariance), rtol=1e-3)


def test_memory_is_linear_in_length(make_track):
    """Three minutes and twelve: dense equations of the joint cubic would take sixteen times as much for four times."""

    def peak(duration_s):
        track = make_track(rounds, duration_s=duration_s)
        tracemalloc.start()
        decimate(track)
        peak_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak_bytes

    assert peak(720.0) < 5 * peak(180.0)
