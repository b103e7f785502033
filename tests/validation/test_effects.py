"""The ladder of effects, and many simulations at once."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from towval.model import Ground, Load
from towval.model.geometry import position_rms
from towval.model.inputs import INPUTS
from towval.physics.ladder import DYNAMICS
from towval.validation.effects import EFFECTS, moves_of_inputs, to_be_measured
from towval.validation.sampler import UncertaintySettings
from towval.validation.shares import variance_shares
from towval.validation.simulate import RunSimulation, SimulateSettings
from towval.validation.simulate_many import Batch, Drawn
from towval.validation.uncertainty import UncertaintySampling

DEVIATIONS = {"slope": 1e-3, "across_over_along": 0.05, "friction": 0.005, "stiffness": 40.0}


def rms(one, other):
    return float(np.sqrt(np.mean(np.sum((one - other)[:, :2] ** 2, axis=1))))


@pytest.fixture(scope="module")
def sloping(case):
    """The run on a floor that falls by 10 mm/m, with an anchor 20 mm up."""
    scene = replace(case.scene, ground=Ground(slope=(0.0, 0.01)), anchor_height=0.02)
    simulated = RunSimulation(scene, case.rover_decimated, case.object_decimated, case.simulated.time_s).simulate(
        SimulateSettings(rung=DYNAMICS)
    )
    return replace(case, scene=scene, simulated=simulated, deviations=DEVIATIONS)


@pytest.fixture(scope="module")
def sampling(sloping):
    return UncertaintySampling(sloping, UncertaintySettings(samples=64))


@pytest.fixture(scope="module")
def found(sampling):
    return sampling.describe(64)


def test_effects_of_a_scene_are_what_the_run_without_them_moves(sloping, sampling, found):
    choices = {choice.what: choice for choice in sampling.effects(found)}
    level = replace(sloping.scene, ground=Ground())
    tracks = sloping.rover_decimated, sloping.object_decimated
    motion = RunSimulation(level, *tracks, sloping.simulated.time_s).motion(DYNAMICS, 1e-7)
    slope = choices["effect: slope of the floor"]
    assert (slope.chosen, slope.next) == ("taken", "left out")
    assert slope.change_m == pytest.approx(rms(motion.pose, sloping.simulated.pose), rel=0.05)
    assert slope.change_m > 1e-3
    assert choices["effect: tow above the floor"].chosen == "taken"
    sticking = choices["effect: sticking"]
    assert (sticking.chosen, sticking.next) == ("left out", "taken")
    # What moves the path by less than matters is there without need.
    strict = {choice.what: choice.chosen for choice in sampling.effects(found, slope.change_m)}
    assert strict["effect: slope of the floor"] == "taken without need"


def test_an_effect_without_which_nothing_can_be_simulated_is_needed(sampling, found, monkeypatch):
    missing = np.full((len(sampling.case.simulated.time_s), 3), np.nan)
    monkeypatch.setattr(Batch, "simulate", lambda self, draws: iter([missing for _ in draws]))
    choices = {choice.what: choice for choice in sampling.effects(found, 1.0)}
    assert np.isnan(choices["effect: slope of the floor"].change_m)
    assert choices["effect: slope of the floor"].chosen == "taken"


def test_an_effect_the_scene_is_without_moves_what_a_deviation_of_it_does(sloping, sampling, found):
    choices = {choice.what: choice for choice in sampling.effects(found)}
    across = choices["effect: friction across and along"]
    assert across.chosen == "left out"
    tracks = sloping.rover_decimated, sloping.object_decimated
    moved = []
    for value in (0.95, 1.05):
        scene = replace(sloping.scene, friction=replace(sloping.scene.friction, across_over_along=value))
        moved.append(RunSimulation(scene, *tracks, sloping.simulated.time_s).motion(DYNAMICS, 1e-6).pose)
    assert across.change_m == pytest.approx(rms(*moved) / 2, rel=0.35)  # 64 draws


def test_inputs_to_be_known_better_are_those_beyond_the_limit_the_largest_first(sloping, found):
    moves = moves_of_inputs(found, sloping.scene)
    limit = sorted(moves.values())[-3]
    choices = to_be_measured(found, sloping.scene, sloping.deviations, limit)
    stated = [move for name, move in moves.items() if move > limit and name in DEVIATIONS]
    assert [choice.change_m for choice in choices] == sorted(stated, reverse=True)
    assert all(choice.next.startswith("known better: ") for choice in choices)
    assert to_be_measured(found, sloping.scene, sloping.deviations, 1.0) == ()
    assert moves_of_inputs(replace(found, draws=None), sloping.scene) == {}


def test_coarse_steps_are_no_effect_of_an_input(sloping):
    """u_num belongs to no input: with much of it, one deviation of an input moves the path by no more."""
    settings = UncertaintySettings(samples=256)
    fine = UncertaintySampling(sloping, settings).describe(256)
    statistics = sloping.simulated.statistics | {"u_tolerance_m": 3 * position_rms(fine.validation)}
    coarse = replace(sloping, simulated=replace(sloping.simulated, statistics=statistics))
    noisy = UncertaintySampling(coarse, settings).describe(256)
    first = max(moves_of_inputs(fine, sloping.scene).items(), key=lambda item: item[1])
    assert moves_of_inputs(noisy, sloping.scene)[first[0]] < 1.7 * first[1]


@pytest.mark.parametrize(("name", "size"), [("rest_length", False), ("hinge_height", True)])
def test_one_deviation_moves_the_path_by_what_it_does(case, name, size):
    """By 10 mm, also of a height of zero, which is drawn to one side."""
    z = np.random.default_rng(0).standard_normal((2048, 2))
    error = np.zeros((2048, 30, 3))
    error[..., 0] = 0.010 * (np.abs(z[:, :1]) if size else z[:, :1])
    shares = variance_shares(z, error[..., 0], {INPUTS[name].label: 1, "idle": 1})
    drawn = SimpleNamespace(draws=SimpleNamespace(error=error), shares=shares)
    assert moves_of_inputs(drawn, case.scene) == {name: pytest.approx(0.010, rel=0.03)}


def test_what_draws_do_not_tell_is_no_shift_of_zero(case):
    label = INPUTS["rest_length"].label
    drawn = SimpleNamespace(draws=SimpleNamespace(error=np.ones((64, 30, 3))), shares={label: 0.0})
    assert moves_of_inputs(drawn, case.scene) == {}


def test_an_effect_is_switched_off_and_only_that(sloping):
    for effect in EFFECTS:
        assert not effect.acts(effect.without(sloping.scene))
    flat = EFFECTS[2].without(sloping.scene)
    assert flat.anchor_height == sloping.scene.anchor_height
    assert EFFECTS[0].acts(flat)


@pytest.mark.parametrize("threads", [1, 3])
def test_many_simulations_are_those_one_by_one_and_refused_ones_are_missing(sloping, threads):
    times = sloping.simulated.time_s
    hinge_times = np.linspace(times[0], times[-1], 200)
    rover, start = sloping.rover_decimated.poses_and_rates_at(hinge_times), sloping.simulated.pose[0]
    batch = Batch(hinge_times, times, DYNAMICS, tolerance_m=1e-6, threads=threads)
    tipping = replace(sloping.scene, load=Load(50.0, np.array([5.0, 0.0]), np.array([0.1, 0.1, 0.0])))
    heavier = replace(sloping.scene, body_mass=5.0)
    scenes = [sloping.scene, tipping, heavier, *[sloping.scene] * 12]
    found = list(batch.simulate([None, *(Drawn(scene, rover, start) for scene in scenes)]))
    assert len(found) == 16
    assert np.isnan(found[0]).all()
    assert np.isnan(found[2]).all()
    for same in found[4:]:
        np.testing.assert_array_equal(same, found[1])
    assert rms(found[1], found[3]) > 1e-5
    assert rms(found[1], sloping.simulated.pose) < 2e-4
