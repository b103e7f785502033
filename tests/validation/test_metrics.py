"""Measures of distance between motions: closed forms, and a direct sum or recursion written again."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import norm

from towval.model.errors import InputError
from towval.model.geometry import transform
from towval.validation.metrics import aligned_rms, area_metric, error_ratio, frechet_distance

PATH = np.column_stack([np.linspace(0, 3, 61), np.sin(np.linspace(0, 3, 61))])


def recursive_frechet(path, other):
    """Eiter and Mannila's recursion as they print it."""

    @cache
    def leash(i, j):
        distance = float(np.linalg.norm(path[i] - other[j]))
        before = [leash(a, b) for a, b in ((i - 1, j), (i - 1, j - 1), (i, j - 1)) if a >= 0 and b >= 0]
        return max(distance, min(before)) if before else distance

    return leash(len(path) - 1, len(other) - 1)


def test_parallel_paths_are_apart_by_their_distance():
    assert frechet_distance(PATH, PATH + np.array([0.0, 0.02])) == pytest.approx(0.02, rel=1e-12)


def test_a_delay_on_the_same_path_is_no_distance():
    waiting = np.concatenate([np.repeat(PATH[:1], 20, axis=0), PATH])
    assert frechet_distance(PATH, waiting) == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_frechet_is_the_recursion(seed):
    rng = np.random.default_rng(seed)
    path, other = rng.normal(size=(17, 2)).cumsum(axis=0), rng.normal(size=(23, 2)).cumsum(axis=0)
    assert frechet_distance(path, other) == pytest.approx(recursive_frechet(path, other), rel=1e-12)


def test_the_frechet_distance_of_long_paths_with_a_rest_is_that_of_all_pairs():
    """Of long paths only a band of pairs is looked at; here every pair is, by rows."""
    rng = np.random.default_rng(1)
    t = np.clip(np.arange(900), 0, 500) + np.clip(np.arange(900) - 700, 0, None)
    path = np.column_stack([2e-3 * t, 0.3 * np.sin(0.01 * t)]) + 1e-3 * rng.standard_normal((900, 2))
    other = np.column_stack([2e-3 * t, 0.3 * np.sin(0.01 * t)])[40:] + 2e-3 * rng.standard_normal((860, 2))
    apart = np.hypot(*(path[:, None] - other[None]).transpose(2, 0, 1))
    leash = np.maximum.accumulate(apart[0])
    for row in apart[1:]:
        before, leash = leash, np.empty(len(row))
        leash[0] = max(before[0], row[0])
        for j in range(1, len(row)):
            leash[j] = max(min(before[j], before[j - 1], leash[j - 1]), row[j])
    assert frechet_distance(path, other) == leash[-1]


def test_a_path_with_a_gap_has_no_frechet_distance():
    with pytest.raises(InputError, match="Fréchet"):
        frechet_distance(PATH, np.full((3, 2), np.nan))


def test_area_of_a_certain_model_is_the_mean_size_of_the_error():
    """Where nothing is uncertain the predicted distribution is a step at nought: the area is the mean of |e|."""
    error = np.array([0.001, -0.002, 0.004, np.nan])
    # The integral is a sum over 2,000 cells of ± 4 mm.
    assert area_metric(error, np.zeros(4)) == pytest.approx(7e-3 / 3, abs=1e-5)


def test_area_of_two_normal_distributions_is_the_shift_between_them():
    quantiles = norm.ppf((np.arange(4000) + 0.5) / 4000)
    assert area_metric(0.5 + quantiles, np.ones(4000)) == pytest.approx(0.5, abs=2e-3)
    assert area_metric(quantiles, np.ones(4000)) == pytest.approx(0.0, abs=2e-3)


def test_alignment_hides_a_rigid_motion_and_nothing_else():
    moved = transform([0.3, -0.2, 0.4], PATH)
    assert aligned_rms(moved, PATH) < 1e-12
    noise = 1e-3 * np.random.default_rng(0).standard_normal(PATH.shape)
    # Three of 122 numbers are fitted.
    assert aligned_rms(moved + noise, PATH) == pytest.approx(1e-3 * np.sqrt(2), rel=0.15)


def test_the_ratio_is_of_the_time_it_stands_at_and_leaves_out_what_is_certain():
    error = np.array([[0.003, 0.004, 0.0], [0.0, 0.0, 0.1], [0.001, 0.0, 0.0], [np.nan] * 3])
    covariance = np.zeros((4, 3, 3))
    covariance[[0, 1, 3]] = np.diag([4e-6, 5e-6, 1.0])
    np.testing.assert_allclose(error_ratio(error, covariance), [5 / 3, 0.0, np.nan, np.nan], rtol=1e-12)
