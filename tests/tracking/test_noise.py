import numpy as np
import pytest

from towval.model.geometry import path_length
from towval.tracking.noise import as_when_moving, hold_rest, local_scatter, scatter_factors, steadied

MOST = np.array([2e-4, 2e-4, 1e-3])


def arc(rng, n=400, std=5e-5):
    time_s = np.arange(n) / 25
    pose = np.column_stack([np.sin(0.3 * time_s), 0.2 * time_s, 0.3 * time_s])
    return time_s, pose + std * rng.standard_normal((n, 3)), np.tile(np.eye(3) * (5e-5) ** 2, (n, 1, 1))


@pytest.mark.parametrize("larger", [1.0, 3.0])
def test_scatter_in_time_shows_noise_that_was_not_predicted(larger):
    time_s, pose, covariance = arc(np.random.default_rng(0), std=5e-5 * larger)
    factors = scatter_factors(time_s, pose, covariance, np.ones(len(pose), dtype=bool))
    assert factors == pytest.approx((larger, larger), rel=0.15)


def test_headings_that_scatter_more_than_predicted_are_told_from_places():
    rng = np.random.default_rng(6)
    time_s, pose, covariance = arc(rng)
    pose[:, 2] += 1.2e-4 * rng.standard_normal(len(pose))
    whole, turn = scatter_factors(time_s, pose, covariance, np.ones(len(pose), dtype=bool))
    assert 1.0 < whole < 1.8
    assert turn == pytest.approx(2.6, rel=0.15)


def test_a_gap_is_no_scatter():
    time_s, pose, covariance = arc(np.random.default_rng(1))
    pose[100:140] = np.nan
    assert max(scatter_factors(time_s, pose, covariance, np.ones(len(pose), dtype=bool))) < 1.2


def widened(time_s, pose, covariance):
    """How many times as large the deviation of a place is with the scatter around each picture (n,)."""
    return np.sqrt(1 + local_scatter(time_s, pose, covariance)[:, 0, 0] / covariance[:, 0, 0])


@pytest.mark.parametrize(("alike", "told"), [(0.0, (0.95, 1.25)), (0.5, (0.95, 1.25)), (0.8, (0.6, 0.85))])
def test_noise_that_goes_on_for_some_pictures_is_stated_as_large_as_it_is(alike, told):
    """Autoregressive noise, four times as large as stated; of one that is much alike a part passes for motion."""
    rng = np.random.default_rng(3)
    time_s, pose, covariance = arc(rng, n=4000, std=0.0)
    noise = 2e-4 * rng.standard_normal(pose.shape)
    for k in range(1, len(noise)):
        noise[k] = alike * noise[k - 1] + np.sqrt(1 - alike**2) * noise[k]
    low, high = told
    assert low < np.sqrt(np.mean(widened(time_s, pose + noise, covariance) ** 2)) / 4 < high


def test_noise_counts_where_it_is():
    rng = np.random.default_rng(4)
    time_s, pose, covariance = arc(rng)
    pose[150:250] += 3e-4 * rng.standard_normal((100, 3))
    times = widened(time_s, pose, covariance)
    assert np.median(times[165:235]) > 4
    assert np.median(times[:130]) < 1.3
    assert max(scatter_factors(time_s, pose, covariance, np.ones(len(pose), dtype=bool))) < 2


def test_a_picture_that_a_codec_leaves_behind_is_as_unsure_as_it_is_late():
    time_s, pose, covariance = arc(np.random.default_rng(5))
    pose[200, 0] -= 2e-3
    times = widened(time_s, pose, covariance)
    assert 20 < times[200] < 60
    assert times[202] < 0.7 * times[200]
    assert np.median(times) < 1.2


@pytest.mark.parametrize(
    "path", [lambda t: 0.3 * np.maximum(0, t - 5) ** 2, lambda t: 0.03 * np.sin(4 * t)], ids=["sets off", "goes round"]
)
def test_motion_is_no_noise(path):
    time_s, pose, covariance = arc(np.random.default_rng(7))
    pose[:, 0] += path(time_s)
    assert np.percentile(widened(time_s, pose, covariance), 90) < 1.7


def test_a_few_pictures_a_second_are_no_noise():
    """A drive of three pictures a second: a quadratic through five of them misses it by centimetres."""
    time_s, pose, covariance = arc(np.random.default_rng(8), std=0.0)
    drive = 0.3 * np.sin(1.5 * time_s[::8])
    pose = pose[::8] + np.column_stack([drive, 0 * drive, 0 * drive])
    assert np.median(widened(time_s[::8], pose, covariance[::8])) < 1.1


@pytest.mark.parametrize("count", [1, 4, 8])
def test_few_pictures_add_no_scatter(count):
    time_s, pose, covariance = arc(np.random.default_rng(9), n=8)
    assert not local_scatter(time_s[:count], pose[:count], covariance[:count]).any()


def test_a_still_body_adds_no_path():
    rng = np.random.default_rng(2)
    time_s = np.arange(140) / 25
    pose = np.array([0.3, 0.2, 0.1]) + 3e-5 * rng.standard_normal((140, 3))
    covariance = np.tile(np.eye(3) * (3e-5) ** 2, (140, 1, 1))
    assert path_length(pose[:, :2]) > 5e-3
    held = hold_rest(time_s, pose, covariance, np.ones(140, dtype=bool), MOST)
    assert path_length(held[:, :2]) < 0.1e-3
    assert np.allclose(held.mean(axis=0), pose.mean(axis=0), atol=1e-5)


def test_a_creeping_body_goes_on_creeping():
    rng = np.random.default_rng(3)
    time_s = np.arange(500) / 25
    true = np.column_stack([3e-4 * time_s, 0 * time_s, 0 * time_s])
    pose = true + 3e-5 * rng.standard_normal((500, 3))
    held = hold_rest(time_s, pose, np.tile(np.eye(3) * (3e-5) ** 2, (500, 1, 1)), np.ones(500, dtype=bool), MOST)
    assert np.abs(held - true).max() < 1.6e-4
    assert held[-1, 0] - held[0, 0] == pytest.approx(true[-1, 0], abs=1e-4)


def test_a_moving_body_is_left_alone():
    time_s, pose, covariance = arc(np.random.default_rng(4))
    assert np.array_equal(hold_rest(time_s, pose, covariance, np.ones(len(pose), dtype=bool), MOST), pose)


def test_a_body_at_rest_is_not_known_better_than_one_that_moves():
    covariance = np.tile(np.diag([4e-8, 4e-8, 1e-7]), (60, 1, 1))
    covariance[:20] /= 25
    resting = np.arange(60) < 20
    assert np.allclose(as_when_moving(covariance, ~resting, resting), covariance[-1])
    assert np.array_equal(as_when_moving(covariance, np.arange(60) > 50, resting), covariance)


@pytest.mark.parametrize("tiles", [4, 12])
def test_a_picture_that_agrees_by_chance_is_no_better_known(tiles):
    """Deviations that a few tiles tell are too small now and then: without pictures around, errors exceed three."""
    rng = np.random.default_rng(5)
    told, errors = rng.chisquare(tiles, 20_000) / tiles, np.abs(rng.standard_normal(20_000))
    covariance = told[:, None, None] * np.eye(3)
    known = steadied(covariance)
    assert np.array_equal(known[told > 2], covariance[told > 2])
    beyond = [np.mean(errors > 3 * np.sqrt(stated[:, 0, 0])) for stated in (covariance, known)]
    assert beyond[0] > 0.01
    assert beyond[1] < 0.006


@pytest.mark.parametrize(("pictures", "followed"), [(8, False), (20, True)])
def test_pictures_that_are_better_for_long_are_better_known(pictures, followed):
    quality = np.ones(100)
    quality[40 : 40 + pictures] = 0.04
    known = steadied(quality[:, None, None] * np.eye(3))[:, 0, 0]
    assert (known[40 + pictures // 2] < 0.1) == followed
    assert np.array_equal(steadied(np.zeros((0, 3, 3))), np.zeros((0, 3, 3)))
