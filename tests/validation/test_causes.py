"""Maxima of what is off most probably, in scenes whose posterior is known in closed form or by a fine grid."""

import numpy as np
import pytest
from scipy.integrate import quad

from towval.model.geometry import block_means
from towval.validation import causes
from towval.validation.causes import Causes, Mode, Unknowns, distinct, off_by_name, surprise
from towval.validation.statistics import RightModel

N, K, MM, D = 96, 512, 1e-3, 4
RNG = np.random.default_rng(8)
SHAPES = RNG.standard_normal((D, 24, 3)).repeat(N // 24, axis=1) * MM
SWING = MM**2


def unknowns(**kinds):
    none = [False] * D
    names = [f"input {c}" for c in range(D)]
    return Unknowns(range(D), names, **({"assumed": none, "computed": none, "mirrored": none} | kinds))


@pytest.fixture(scope="module")
def right():
    inputs = RNG.standard_normal((K, D))
    noise = 0.3 * MM * RNG.standard_normal((K, 24, 3)).repeat(N // 24, axis=1)
    return RightModel.of(np.tensordot(inputs, SHAPES, 1) + noise, inputs, 0.99)


def search(right, true, acts=lambda off: np.tensordot(off, SHAPES, 1), **kinds):
    error = -acts(np.array(true)[None])[0]
    return Causes(right, right.effects, SWING, unknowns(**kinds), lambda off: error + acts(off))


def test_in_a_linear_scene_the_maximum_is_that_of_the_ridge_regression(right):
    true = np.array([6.0, -2.5, 0.0, 4.0])
    found_by = search(right, true)
    found = found_by.mode(np.zeros(D), common=True)
    rows = found_by.whiten @ block_means(SHAPES).reshape(D, -1).T
    normal = rows.T @ rows + np.eye(D) / found.factor**2
    assert found.off == pytest.approx(np.linalg.solve(normal, rows.T @ rows @ true), abs=2e-3)
    assert found.covariance == pytest.approx(np.linalg.inv(normal), rel=1e-6, abs=1e-9)
    assert 2.5 < found.factor < 4.4


def test_each_by_itself_is_more_probable_where_one_is_far_off_and_all_together_where_all_are(right):
    def by_how_much(true):
        found_by = search(right, true)
        own, common = (found_by.mode(np.zeros(D), common=each) for each in (False, True))
        return common.cost - own.cost

    assert by_how_much([9.0, 0.0, 0.0, 0.0]) > 4
    assert by_how_much([2.6, -2.5, 2.4, -2.6]) < 0


def test_an_input_that_was_computed_gives_way_least_and_one_that_was_assumed_most(right):
    """Two that do the same: the one of which less is known is off."""
    shapes = SHAPES[[0, 0, 1, 2]]

    def found(**kinds):
        found_by = search(right, [5.0, 0.0, 0.0, 0.0], lambda off: np.tensordot(off, shapes, 1), **kinds)
        start = np.array([2.5, 2.5, 0.0, 0.0])
        return found_by.mode(start, common=False).off

    first, second = found(computed=[False, True, False, False])[:2]
    assert first > second + 2
    first, second = found(assumed=[True, False, False, False])[:2]
    assert first > second + 2


def test_what_acts_by_its_size_stays_above_zero_and_nothing_is_sought_beyond_twenty(right):
    mirrored = [True, False, False, False]
    found = search(right, [-6.0, 30.0, 0.0, 0.0], mirrored=mirrored).mode(np.full(D, 1.0), common=False)
    assert found.off[0] == 0
    assert found.off[1] == 20


@pytest.mark.parametrize("fails", [lambda off: np.abs(off) > 0.3, lambda off: off == 0], ids=["away", "at the start"])
def test_a_scene_that_cannot_be_simulated_has_no_maximum(right, fails):
    def acts(off):
        failed = fails(off[:, :1]) & (off[:, 1:] == 0).all(axis=1, keepdims=True)
        return np.where(failed[..., None], np.nan, np.tensordot(off, SHAPES, 1))

    error = SHAPES[1]
    found_by = Causes(right, right.effects, SWING, unknowns(), lambda off: error + acts(off))
    assert found_by.mode(np.zeros(D), common=False) is None


def test_an_oscillation_alone_tells_how_far_an_input_is_off(right):
    """Block means without a trace of it; a linear model of them would say nothing."""
    wave = np.zeros((N, 3))
    wave[:, 0] = 4 * MM * np.tile([1, -1], N // 2)

    def acts(off):
        return off[:, 0, None, None] * wave

    found = search(right, [5.0, 0.0, 0.0, 0.0], acts).mode(np.zeros(D), common=False)
    assert found.off == pytest.approx([5.0, 0.0, 0.0, 0.0], abs=0.2)


def test_the_covariance_is_that_of_where_the_search_ends(right, monkeypatch):
    """After its last step, too, where each one has gained: here the effect of an input grows with its size."""
    monkeypatch.setattr(causes, "_STEPS", 2)

    def acts(off):
        return np.tensordot(np.column_stack([off[:, 0] + 0.1 * off[:, 0] ** 3, off[:, 1:]]), SHAPES, 1)

    found = search(right, [6.0, 0.0, 0.0, 0.0], acts).mode(np.zeros(D), common=False)
    slopes = SHAPES * np.array([1 + 0.3 * found.off[0] ** 2 + 0.1 * 0.5**2, 1, 1, 1])[:, None, None]
    rows = search(right, np.zeros(D)).whiten @ block_means(slopes).reshape(D, -1).T
    pull = 3 / (2 + found.off**2)  # Student's t of two degrees of freedom.
    assert found.covariance == pytest.approx(np.linalg.inv(rows.T @ rows + np.diag(pull)), rel=1e-6, abs=1e-9)


def test_maxima_that_are_as_probable_count_alike():
    def mode(off, cost):
        return Mode(np.array(off), 1e-4 * np.eye(2), np.zeros((N, 3)), cost, 1.0)

    off = off_by_name([mode([6.0, 0.0], 1.0), mode([3.0, 5.0], 1.0 + 2 * np.log(3))], ["one", "other"])
    assert off["one"].mean() == 1
    # To the side of the most probable, which has none: it counts as off in neither.
    assert off["other"].mean() == 0
    off = off_by_name([mode([6.0, 0.1], 1.0), mode([0.0, 5.0], 1.0 + 2 * np.log(3))], ["one", "other"])
    assert off["one"].mean() == pytest.approx(0.75, abs=1e-3)
    assert off["other"].mean() == pytest.approx(0.25, abs=1e-3)


def test_a_maximum_that_was_found_twice_counts_once():
    def mode(off, cost, factor=1.0):
        return Mode(np.array(off), 0.04 * np.eye(2), np.zeros((N, 3)), cost, factor)

    first, again, other, common = (
        mode([6.0, 0.0], 1.0),
        mode([6.1, 0.1], 1.2),
        mode([0.0, 5.0], 3.0),
        mode([6, 0], 2, 1.5),
    )
    assert distinct([again, other, first, common]) == [first, common, other]


@pytest.mark.parametrize(("freedom", "scale"), [(np.inf, 1.0), (2.0, 1.0), (1.0, 2.0)])
def test_the_surprise_is_that_of_a_density(freedom, scale):
    area, _ = quad(lambda off: np.exp(-0.5 * surprise(off, freedom, scale)), -np.inf, np.inf)
    assert area == pytest.approx(np.sqrt(2 * np.pi), rel=1e-6)
