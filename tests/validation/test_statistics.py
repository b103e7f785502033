"""Limits and bounds: closed forms, coverage on fresh noise."""

import numpy as np
import pytest
from scipy.stats import norm, qmc

from towval.model.errors import InputError
from towval.model.geometry import block_means, signature_entries
from towval.validation.statistics import (
    SIZES,
    RightModel,
    bounds,
    error_sizes,
    holding_levels,
    place,
    upper_error,
    upper_limit,
)

N, K = 96, 512
MM = 1e-3
TIME = np.linspace(0, 1, N)
EFFECTS = np.stack(
    [
        np.stack([np.ones(N), 0 * TIME, 0 * TIME], axis=1),
        np.stack([0 * TIME, TIME, TIME], axis=1),
        np.stack([np.sin(6 * TIME), TIME**2, 0 * TIME], axis=1),
    ]
)


def drawn(k, seed, scale=1.0):
    """Errors of three inputs, the last of which cannot be below zero, and of noise; and the inputs."""
    rng = np.random.default_rng(seed)
    inputs = rng.standard_normal((k, 3))
    acting = scale * np.column_stack([inputs[:, :2], np.abs(inputs[:, 2])])
    wander = rng.standard_normal((k, 12, 3)).repeat(N // 12, axis=1) * 0.2
    return MM * (np.einsum("kj,jnc->knc", acting, EFFECTS) + wander), inputs


def test_sizes_of_a_known_error():
    error = np.zeros((4, 3))
    error[2] = [3.0, -4.0, -0.5]
    found = dict(zip(SIZES, error_sizes(error), strict=True))
    assert found == pytest.approx(
        {
            "position_rms": 2.5, "position_max": 5.0, "along_max": 3.0, "across_max": 4.0,
            "heading_rms": 0.25, "heading_max": 0.5,
        }
    )  # fmt: skip


def test_the_tail_of_an_exponential_is_met():
    draws = np.random.default_rng(0).exponential(size=(200, 512))
    found = [upper_limit(each, 0.99) for each in draws]
    # What one more draw exceeds: the mean of the closed form over what the draws may be.
    assert np.mean(np.exp(np.negative(found))) == pytest.approx(0.01, rel=0.05)
    # A quantile by rank scatters by 0.44 here.
    assert np.std(found) < 0.4
    assert upper_limit(draws[0], 0.9) == np.quantile(draws[0], 0.9)


def test_a_right_model_is_rejected_once_in_a_hundred():
    """Limits of 256 draws, held against errors that they have not seen; 1.3 % from the draws themselves."""
    fresh = drawn(4000, 99)[0]
    alarms = [RightModel.of(*drawn(256, seed), 0.99).rejects(-fresh).mean() for seed in range(12)]
    assert np.mean(alarms) == pytest.approx(0.01, abs=0.0025)


def test_a_right_model_is_rejected_once_in_a_hundred_where_the_first_input_matters_most():
    """Every eighth draw of a Sobol sequence has an eighth of the first input: limits from such parts were too wide."""
    alarms = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        paths = 1e-4 * np.cumsum(rng.normal(size=(20, 120, 3)), axis=1)
        paths[0] *= 4

        def errors(inputs, rng=rng, paths=paths):
            bent = inputs.copy()
            bent[:, 0] += 0.3 * inputs[:, 0] * inputs[:, 1]
            return np.tensordot(bent, paths, axes=1) + 2e-4 * rng.normal(size=(len(inputs), 120, 3))

        drawn = norm.ppf(qmc.Sobol(20, seed=seed).random(512))
        model = RightModel.of(errors(drawn), drawn, 0.99)
        alarms.append(model.rejects(errors(rng.normal(size=(2000, 20)))).mean())
    # 0.9 % ± 0.1 over the seeds; with every eighth draw together 0.4 %.
    assert np.mean(alarms) == pytest.approx(0.009, abs=0.003)


def test_too_few_draws_or_times_are_refused():
    error, inputs = drawn(16, 0)
    with pytest.raises(InputError, match="too few"):
        RightModel.of(error, inputs, 0.99)
    error, inputs = drawn(64, 0)
    with pytest.raises(InputError, match="too few"):
        RightModel.of(error[:, :20], inputs, 0.99)


def test_a_shift_shows_from_its_threshold_on():
    """Of shifts, one a draw, that are noticed by size, by shape, or only a thousand of them."""
    right, error = RightModel.of(*drawn(256, 5), 0.99), drawn(60, 6)[0]
    error[7] *= 10
    shift = np.resize([4.0, 1.0, 1e-3], 60)[:, None, None] * np.concatenate([EFFECTS] * 20) * MM
    least = right.thresholds(shift, error)
    alone = right.rejects(error)
    np.testing.assert_array_equal(least == 0, alone)
    assert 0 < alone.sum() < 6
    assert np.median(least[2::3]) > 500 * np.median(least[1::3])
    for share, rejected in ((1 + 1e-6, True), (1 - 1e-6, False)):
        times = share * least[~alone, None, None]
        assert (right.rejects(error[~alone] + times * shift[~alone]) == rejected).all()


def test_no_multiple_of_nothing_shows():
    right, error = RightModel.of(*drawn(256, 5), 0.99), drawn(60, 6)[0]
    least = right.thresholds(0 * error, error)
    assert set(least[~right.rejects(error)]) == {np.inf}


def test_the_effects_of_the_inputs_are_found_again():
    error, inputs = drawn(2048, 3)
    right = RightModel.of(error, inputs, 0.99)
    assert right.columns.tolist() == [0, 1, 2]
    assert right.one_sided.tolist() == [False, False, True]
    expected = MM * block_means(EFFECTS).reshape(3, -1)
    np.testing.assert_allclose(right.effects, expected, atol=0.05 * MM)


def test_inputs_that_do_nothing_have_no_effect():
    """Forty idle inputs beside the three, of 256 draws: what noise makes of their coefficients does not matter."""
    error, acting = drawn(256, 3)
    wander = MM * np.random.default_rng(8).standard_normal((256, 3, 3))
    error = error + np.einsum("kmc,mn->knc", wander, np.cos(np.pi * np.arange(3)[:, None] * TIME))
    idle = np.random.default_rng(9).standard_normal((256, 40))
    right = RightModel.of(error, np.column_stack([acting, idle]), 0.99)
    assert right.columns.tolist() == [0, 1, 2]


def noise(rng, k):
    """A constant of each draw, and frame noise."""
    return MM * (0.3 * rng.standard_normal((k, 1, 3)) + 0.03 * rng.standard_normal((k, N, 3)))


@pytest.mark.parametrize("size", [0.0, 0.3, 1.0, 4.0])
@pytest.mark.parametrize("shared", [True, False])
def test_bounds_cover_what_is_behind_the_noise(size, shared):
    """Truths of a shape of their own, of 0 to 13 times the noise.

    Shared: simulation and measurement move alike, as with the camera's errors, and the error does not show it. Else it
    is in the error already, and the upper bound is wide where the noise is as large as the truth.
    """
    rng = np.random.default_rng(4)
    shape = MM * size * np.stack([np.sin(5 * TIME), TIME, 0.5 * TIME], axis=1)
    draws, held = noise(rng, 400), []
    for off in noise(rng, 300):
        error, truth = (shape, shape + off) if shared else (shape - off, shape)
        low, high = bounds(error, draws, 0.95)
        held.append([high >= error_sizes(truth), low <= error_sizes(truth)])
    above, below = np.mean(held, axis=0)
    assert above.min() > 0.92
    assert below[:2].min() > 0.92
    if shared or size > 1:
        assert above[:2].max() < 0.985


def test_the_error_of_a_bound_is_its_scatter_over_sets_of_draws():
    rng = np.random.default_rng(7)
    shape = MM * np.stack([np.sin(5 * TIME), TIME, 0.5 * TIME], axis=1)
    found = [
        (bounds(shape, draws, 0.95)[1, 1], upper_error(shape, draws, 0.95))
        for draws in noise(rng, 60 * 256).reshape(60, 256, N, 3)
    ]
    bound, stated = np.array(found).T
    assert np.mean(stated) == pytest.approx(np.std(bound) / np.mean(bound), rel=0.3)
    assert upper_error(shape, noise(rng, 4096), 0.95) == pytest.approx(np.mean(stated) / 4, rel=0.35)


def right_runs(rng, k, share):
    """Errors (k, N, 3) that are seen of truths about as large as the noise, and the noise (k, N, 3), of which they
    contain a share."""
    off = noise(rng, k)
    shape = np.stack([np.sin(5 * TIME), TIME, 0.5 * TIME], axis=1)
    return 0.5 * MM * rng.standard_normal((k, 1, 3)) * shape - share * off, off


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_bound_at_the_level_found_holds_as_often_as_stated(share):
    """Where the error contains noise the plain quantile holds too often."""
    rng = np.random.default_rng(5)
    held = []
    for _ in range(8):
        drawn, draws = right_runs(rng, 256, share)
        levels = holding_levels(drawn, draws, 0.95)
        for error, off in zip(*right_runs(rng, 40, share), strict=True):
            truth = error_sizes(error + off)[1]
            held.append([truth <= bounds(error, draws, 0.95, at)[1, 1] for at in (levels, None)])
    at_level, plain = np.mean(held, axis=0)
    assert at_level == pytest.approx(0.95, abs=0.02)
    assert plain > 0.975


def test_the_level_of_errors_that_contain_no_noise_is_the_confidence():
    rng = np.random.default_rng(6)
    levels = [holding_levels(*right_runs(rng, 256, 0.0), 0.95) for _ in range(8)]
    np.testing.assert_allclose(np.mean(levels, axis=0), 0.95, atol=0.015)


def test_bounds_hold_where_noise_hides_a_wrong_model():
    """All of the draws is noise, and a model's error of 2 mm shows in three of four runs only."""
    rng = np.random.default_rng(1)

    def noisy(k):
        return MM * (0.5 * rng.standard_normal((k, N, 3)) + 0.3 * rng.standard_normal((k, 1, 3)))

    off, truth = noisy(256), 2 * MM * TIME[:, None] * [1.0, 0.5, 0.5]
    drawn = 0.3 * MM * rng.standard_normal((256, 1, 3)) * TIME[:, None] - off
    right, levels = RightModel.of(drawn, np.empty((256, 0)), 0.99), holding_levels(drawn, off, 0.95)
    runs = truth - noisy(160)
    rejected = right.rejects(runs)
    assert 0.5 < np.mean(rejected) < 0.9
    found = [bounds(error, off, 0.95, None if out else levels)[1] for error, out in zip(runs, rejected, strict=True)]
    assert np.mean(error_sizes(truth) <= found, axis=0).min() >= 0.94


def test_noise_of_one_direction_moves_the_bounds_by_its_quantiles():
    """An error of ten along, noise of one there: 10 ∓ 1.645."""
    noise = np.random.default_rng(2).normal(size=(20_000, 1, 3)) * [MM, 0.0, 0.0]
    low, high = bounds(np.tile([10 * MM, 0, 0], (24, 1)), noise.repeat(24, axis=1), 0.95)
    assert low[1] == pytest.approx(8.355 * MM, abs=0.06 * MM)
    assert high[1] == pytest.approx(11.645 * MM, abs=0.06 * MM)


def test_bounds_of_a_high_confidence_hold_as_often_as_stated():
    """At 99.9 % the largest of 256 draws is exceeded in 0.4 %, and the bounds were that draw."""
    rng = np.random.default_rng(3)
    beyond = []
    for _ in range(400):
        draws = MM * rng.standard_normal((256, 1, 3)) * [1.0, 0.0, 0.0]
        low, high = bounds(np.tile([20 * MM, 0, 0], (24, 1)), draws.repeat(24, axis=1), 0.999)[:, 1]
        # The truth is 20 mm and one more draw.
        beyond.append([norm.sf((high - 20 * MM) / MM), norm.cdf((low - 20 * MM) / MM)])
    assert np.mean(beyond, axis=0).max() < 0.0015


def test_what_noise_alone_makes_has_no_lower_bound():
    noise = MM * np.random.default_rng(2).normal(size=(400, N, 3))
    low, high = bounds(noise[0], noise[1:], 0.95)
    assert not low.any()
    assert (high < 6 * MM).all()


@pytest.mark.parametrize("begins", [0.2, 0.42, 0.63])
def test_a_growing_error_is_placed_where_it_begins(begins):
    """Slope from there on, in a right model's error: its begin lies within what is reported, which is a tenth wide."""
    (right_errors, inputs), (fresh, _) = drawn(K, 1), drawn(24, 2)
    right = RightModel.of(right_errors, inputs, 0.99)
    ramp = np.zeros((N, 3))
    ramp[:, 1] = 0.05 * np.maximum(0, TIME - begins)
    places = np.array([place(error + ramp, right, TIME) for error in fresh])
    assert np.mean((places[:, 0] <= begins) & (begins <= places[:, 1])) > 0.8
    assert np.median(places[:, 1] - places[:, 0]) < 0.15
    none = np.array([place(error, right, TIME) for error in fresh])
    assert np.mean(np.isnan(none)) > 0.95


def test_an_error_from_the_start_on_begins_there():
    """A mean that is too large says until when it came to be, and not since when."""
    draws, inputs = drawn(K, 1)
    shift = np.zeros((N, 3))
    shift[:, 0] = 0.1
    begins, ends = place(draws[0] + shift, RightModel.of(draws, inputs, 0.99), TIME)
    assert begins == 0
    assert 0 < ends < 0.05


def test_an_error_within_a_long_change_is_placed_by_the_limit_of_the_few_changes_within_it():
    """A small step ahead of slow growth: it exceeds not the limit of all entries, but that of the few within the change
    that does."""
    draws, inputs = drawn(K, 1)
    right = RightModel.of(draws, inputs, 0.99)
    step = np.zeros((N, 3))
    step[N // 2 :, 1] = 1.0
    entries = signature_entries()
    (at,) = (i for i, e in enumerate(entries) if (e.first, e.last) == (11, 12))
    inside = [i for i, e in enumerate(entries) if 8 <= e.first < e.last <= 15]
    few, all_ = upper_limit(right.entries[:, inside].max(axis=1), 0.99), right.limits[1]
    assert few < all_
    size = 0.5 * (few + all_) / right.signature(step)[at]
    assert right.signature(size * step)[at] < all_
    later = 4 * np.maximum(0, TIME - 0.54)[:, None] * step * size
    begins, ends = place(size * step + later, right, TIME)
    assert begins <= 0.5 <= ends
    assert ends - begins < 0.1
