"""Explanations of planted causes: linear, far beyond linear, oscillating, guessed; and of what no input does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_t

from towval.model.geometry import block_means
from towval.validation.explain import _Search, explain
from towval.validation.sampler import UncertaintySettings
from towval.validation.simulate import simulate
from towval.validation.statistics import RightModel
from towval.validation.uncertainty import sample_uncertainty
from towval.validation.verdict import _explained, _moves

N, K, MM = 96, 512, 1e-3
TIME = np.linspace(0, 1, N)
NONE = 0 * TIME
EFFECTS = {
    "along": np.stack([np.ones(N), NONE, NONE], axis=1),
    "turning": np.stack([NONE, TIME, TIME], axis=1),
    "one-sided": np.stack([np.sin(6 * TIME), TIME**2, NONE], axis=1),
}


def linear(moves):
    """What inputs do to the error; the last cannot be below zero."""
    acting = [abs(moves.get(2, 0.0)) if c == 2 else moves.get(c, 0.0) for c in range(3)]
    return MM * np.einsum("j,jnc->nc", acting, list(EFFECTS.values()))


class World:
    """Draws of inputs that act somehow, of the measurement and of what else wanders; and how an error is explained."""

    def __init__(self, acts=linear, names=tuple(EFFECTS)):
        rng = np.random.default_rng(5)
        inputs = rng.standard_normal((K, len(names)))
        wander = MM * rng.standard_normal((K + 1, 12, 3)).repeat(N // 12, axis=1) * 0.2
        self.off = MM * 0.05 * rng.standard_normal((K, N, 3))
        self.acts, self.names, self.rest = acts, names, wander[-1] / 3 + self.off[0]
        draws = np.array([acts(dict(enumerate(row))) for row in inputs]) + wander[:-1] + self.off
        self.right = RightModel.of(draws, inputs, 0.99)

    def explained(self, error, assumed=()):
        def left(moves):
            return np.array([error + self.acts(each) for each in moves])

        return explain(error, self.off, self.right, self.names, assumed, left, TIME)

    def explained_true(self, moves, assumed=()):
        """Of the error that there is where the truth has these moves, which simulated − measured is less by."""
        return self.explained(self.rest - self.acts(moves), assumed)


@pytest.fixture(scope="module")
def world():
    return World()


def test_block_means_count_as_one_more_draw_of_a_covariance_known_from_the_draws(world):
    """One more draw beside k of p numbers follows Student's t of k − p + 1 degrees of freedom, here SciPy's."""
    search = _Search(world.off, world.right, world.names, (), lambda moves: np.zeros((len(moves), N, 3)))
    errors = [world.rest, world.rest + 3 * linear({0: 1.0, 1: 1.0})]
    degrees = K - world.right.weight.shape[0] + 1
    student = multivariate_t(shape=np.linalg.inv(world.right.weight) * K / degrees, df=degrees)
    expected = [-2 * student.logpdf(block_means(each).ravel()) for each in errors]
    found = [search._means(each) for each in errors]
    assert found[1] - found[0] > 10
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], rel=1e-6)


def test_a_run_of_as_few_instants_as_blocks_is_explained(world):
    inputs = np.random.default_rng(6).standard_normal((K, 3))
    off = world.off[:, ::4]
    right = RightModel.of(np.array([linear(dict(enumerate(row)))[::4] for row in inputs]) + off, inputs, 0.99)

    def left(moves):
        return np.array([error + linear(each)[::4] for each in moves])

    error = off[0] - linear({0: 6.0})[::4]
    with np.errstate(divide="raise"):  # one instant has no oscillation about itself
        found = explain(error, off, right, world.names, (), left, TIME[::4])
    assert list(found.moved) == ["along"]


@pytest.mark.parametrize(("column", "deviations"), [(0, 6.0), (1, -7.0), (2, 6.0)])
def test_an_input_beyond_its_deviation_is_named_with_its_size(world, column, deviations):
    found = world.explained_true({column: deviations})
    assert list(found.moved) == [tuple(EFFECTS)[column]]
    assert found.moved[tuple(EFFECTS)[column]] == pytest.approx(deviations, abs=1.0)
    assert found.explained
    assert found.remaining_rms_m < 0.1 * found.error_rms_m
    assert not found.assumed


def test_two_inputs_that_are_off_are_both_named(world):
    found = world.explained_true({0: 8.0, 1: -7.0})
    assert found.moved == pytest.approx({"along": 8.0, "turning": -7.0}, abs=1.0)
    assert found.explained


def test_what_no_input_does_is_left_to_the_model_with_its_place(world):
    error = np.zeros((N, 3))
    error[N // 2 :, :2] = [-6 * MM, 6 * MM]
    found = world.explained(error)
    assert not found.explained
    assert found.begins_m <= 0.55
    assert found.ends_m >= 0.45


def test_an_input_at_the_end_of_the_search_is_no_explanation(world):
    error = np.zeros((N, 3))
    error[N // 2 :, 0] = -60 * MM
    found = world.explained(error)
    assert not found.explained
    assert found.moved == {}
    assert found.remaining_rms_m == found.error_rms_m
    assert 0.4 <= found.begins_m <= 0.55
    assert _explained(found).startswith("No input explains the difference")


def test_an_input_far_off_is_taken_for_what_it_does_there():
    """A height acts by its square; enlarging what one deviation does, the wrong input would leave less."""

    def acts(moves):
        height, length = moves.get(0, 0.0), moves.get(1, 0.0)
        path = np.stack([height**2 * np.sqrt(TIME), 0.02 * height**2 * (1 + height**2) * TIME, NONE], axis=1)
        return 0.1 * MM * (path + 3 * length * np.stack([TIME, NONE, NONE], axis=1))

    found = World(acts, ("height", "length")).explained_true({0: 7.0})
    assert found.moved == pytest.approx({"height": 7.0}, abs=0.3)
    assert found.explained


def test_of_equals_the_input_that_nobody_stated_is_suspected():
    def acts(moves):
        return (moves.get(0, 0.0) + moves.get(1, 0.0)) * MM * EFFECTS["turning"]

    world = World(acts, ("one", "other"))
    for name in world.names:
        found = world.explained_true({0: 8.0}, assumed=(name,))
        assert list(found.moved) == [name]
        assert found.assumed == (name,)


def test_an_oscillation_tells_inputs_apart_that_shift_the_path_alike():
    """Stick and slip: block means alone would name either."""
    swing = np.stack([3 * np.sin(240 * TIME), NONE, NONE], axis=1)

    def acts(moves):
        stiff, damped = moves.get(0, 0.0), moves.get(1, 0.0)
        return 0.3 * MM * ((stiff + damped) * EFFECTS["along"] + stiff * swing)

    world = World(acts, ("stiff", "damped"))
    assert list(world.explained_true({0: 8.0}).moved) == ["stiff"]
    assert list(world.explained_true({1: 8.0}).moved) == ["damped"]


def test_inputs_that_do_the_same_are_named_together():
    """Up to a share that no run can show; a third one, which does something else, is not among them."""

    def acts(moves):
        one, other, third = (moves.get(c, 0.0) for c in range(3))
        return MM * ((one + 1.01 * other) * EFFECTS["along"] + third * EFFECTS["turning"])

    found = World(acts, ("one", "other", "third")).explained_true({0: 8.0})
    assert {*found.moved, *found.instead} == {"one", "other"}
    assert found.explained
    assert found.factor == 1
    assert _moves(found).endswith("which this run cannot separate")


def test_where_all_deviations_are_too_small_that_is_said_and_an_input_that_is_far_off_is_named():
    """Thirty inputs, each of its own shape, all off by some of their deviations, and one by more."""
    rng = np.random.default_rng(3)
    shapes = rng.standard_normal((30, 24, 3)).repeat(N // 24, axis=1)
    names = tuple(f"input {c}" for c in range(30))

    def acts(moves):
        return MM * sum((value * shapes[c] for c, value in moves.items()), np.zeros((N, 3)))

    world = World(acts, names)
    off = 2.5 * rng.standard_normal(30)
    off[4] = -9.0
    found = world.explained_true(dict(enumerate(off)))
    assert found.explained
    assert 1.8 < found.factor < 3.6
    assert next(iter(found.moved)) == "input 4"
    assert found.moved["input 4"] == pytest.approx(-9, abs=1)
    assert world.explained_true({4: -9.0}).factor == 1
    assert "times as large would explain it" in _explained(found)


@pytest.mark.parametrize(("deviations", "named"), [(2.0, []), (2.2, []), (2.6, ["along"])])
def test_where_the_test_does_not_reject_an_input_is_named_only_if_it_is_off_for_certain(world, deviations, named):
    """Off is beyond two deviations; which side of that 2.0 and 2.2 are on, the draws leave open."""
    error = world.rest - linear({0: deviations})
    assert not world.right.rejects(error)
    found = world.explained(error)
    assert list(found.moved) == named
    assert found.explained == bool(named)


def test_what_cannot_be_simulated_is_no_explanation(world):
    error = world.rest - linear({0: 6.0})

    def left(moves):
        errors = np.array([error + linear(each) for each in moves])
        errors[[abs(each.get(0, 0.0)) > 3 for each in moves]] = np.nan
        return errors

    found = explain(error, world.off, world.right, world.names, (), left, TIME)
    assert abs(found.moved.get("along", 0.0)) <= 3


def test_a_wrong_length_of_a_run_is_named_first_and_a_right_one_not_at_all(case):
    settings = UncertaintySettings(samples=64)
    assert sample_uncertainty(case, settings).explanation is None
    scene = replace(case.scene, tether=replace(case.scene.tether, rest_length=case.scene.tether.rest_length + 0.012))
    simulated = simulate(scene, case.rover_decimated, case.object_decimated, case.simulated.time_s)
    found = sample_uncertainty(replace(case, scene=scene, simulated=simulated), settings).explanation
    assert next(iter(found.moved)) == "rest_length"
    assert found.moved["rest_length"] == pytest.approx(-12, abs=1.5)
    assert found.remaining_rms_m < 0.2 * found.error_rms_m
