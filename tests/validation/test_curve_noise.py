"""Draws of a curve's noise: as loud as what noise really does to it, in rates, too; at rest in pauses."""

from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.measured import measured_track
from towval.model import TrackStatus
from towval.validation.curve_noise import CurveNoise
from towval.validation.decimate import decimate

STD = np.array([3e-4, 3e-4, 6e-4])
TIMES = np.arange(200) / 25


def winding(t):
    """Off after a second and a half's rest, in a bend."""
    t = np.maximum(t - 1.5, 0.0)
    return np.stack([0.1 * t**2 / (0.5 + t), 0.06 * t**2 / (0.8 + t), 0.3 * t**2 / (1 + t)], axis=-1)


def seen(seed):
    noise = STD * np.random.default_rng(seed).standard_normal((len(TIMES), 3))
    return measured_track("rover", TIMES, winding(TIMES) + noise, STD)


@pytest.fixture(scope="module")
def tracks():
    """Forty tracks of one motion, as measured and as decimated."""
    return [(track, decimate(track)) for track in map(seen, range(40))]


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=tuple(range(values.ndim - 1))))


def test_draws_are_as_loud_as_the_noise_of_the_curve_in_poses_and_rates(tracks):
    """Rates drawn through independent poses were a third of this, and right models behind them were rejected."""
    h = 1e-5
    rate = (winding(TIMES + h) - winding(TIMES - h)) / (2 * h)
    true = np.concatenate([winding(TIMES), rate], axis=1)
    off = rms(np.array([thin.poses_and_rates_at(TIMES) - true for _, thin in tracks]))
    rng = np.random.default_rng(1)
    noises = [CurveNoise.of(track, thin, TIMES) for track, thin in tracks[:10]]
    drawn = rms(np.array([noise.drawn(rng) for noise in noises for _ in range(40)]))
    assert (drawn > 0.7 * off).all()
    assert (drawn < 1.6 * off).all()


def test_rates_are_slopes_of_poses_and_nothing_moves_in_a_pause(tracks):
    track, thin = tracks[0]
    h, times = 1e-5, np.linspace(0.1, 7.8, 300)
    before, now, after = (
        CurveNoise.of(track, thin, times + shift).drawn(np.random.default_rng(3)) for shift in (-h, 0.0, h)
    )
    np.testing.assert_allclose((after - before)[:, :3] / (2 * h), now[:, 3:], atol=1e-4 * np.abs(now[:, 3:]).max())
    begin, end = thin.pauses[0]
    resting = (times > begin) & (times < end)
    assert resting.sum() > 30
    assert np.ptp(now[resting], axis=0).max() < 1e-12


def test_over_a_gap_nothing_grows_without_bound():
    """No frame says how large a bump in the gap would be: none is drawn."""
    track = seen(5)
    status, pose, covariance = track.status.copy(), track.pose.copy(), track.covariance.copy()
    gone = slice(100, 130)
    status[gone], pose[gone], covariance[gone] = TrackStatus.LOST, np.nan, np.nan
    lost = replace(track, status=status, pose=pose, covariance=covariance)
    noise, rng = CurveNoise.of(lost, decimate(lost), TIMES), np.random.default_rng(2)
    drawn = np.array([noise.drawn(rng) for _ in range(50)])
    assert rms(drawn[:, gone, :3]).max() < 20 * STD.max()
