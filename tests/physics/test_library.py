"""The physics as a notebook uses it: names, examples, many values at once, and errors that a person can read."""

import doctest
import importlib
import pkgutil
import timeit

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import towval.physics
from towval.model import Patch, Tether, TimedPath
from towval.model.errors import InputError
from towval.physics import (
    choose_rung,
    feedback,
    friction_wrench,
    pressure_plane,
    quasistatic_plan,
    resting_pressure,
    sliding_patch,
)

MODULES = [
    module.name
    for module in pkgutil.walk_packages(towval.physics.__path__, "towval.physics.")
    if not module.name.endswith("lanes")
]


@pytest.mark.parametrize("name", ["towval.physics", *MODULES])
def test_examples_run(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_every_exported_function_is_there_with_an_example():
    for name in towval.physics.__all__:
        value = getattr(towval.physics, name)
        if callable(value) and not isinstance(value, type) and value.__module__.startswith("towval.physics"):
            assert ">>>" in value.__doc__, name
    with pytest.raises(AttributeError, match="friction_wrenches"):
        _ = towval.physics.friction_wrenches


def test_many_wrenches_are_those_of_each_twist_and_cost_little(cube, makkar):
    patch = sliding_patch(resting_pressure(cube), makkar)
    twists = np.random.default_rng(4).normal(size=(40, 50, 3)) * (0.1, 0.1, 0.5)
    wrenches = friction_wrench(patch, twists)
    assert wrenches.shape == twists.shape
    assert wrenches[3, 7] == pytest.approx(friction_wrench(patch, twists[3, 7]), rel=1e-14)
    together = min(timeit.repeat(lambda: friction_wrench(patch, twists), number=1, repeat=5)) / 2000
    one = min(timeit.repeat(lambda: friction_wrench(patch, twists[0, 0]), number=20, repeat=5)) / 20
    assert together < one / 3  # Measured: 0.5 µs a twist against 10 µs; the rest is for a busy machine.


def test_wrong_types_are_input_errors(cube, makkar, lap, square):
    law, tether, hinge, start = lap
    patch, times = sliding_patch(resting_pressure(cube), makkar), [0.0, 1.0]
    for call in (
        lambda: pressure_plane([[0, 0], [1, 0], [0, 1]], [(1.0, (0.1, 0.1))]),
        lambda: pressure_plane(square, [(1.0, "here")]),
        lambda: resting_pressure(square),
        lambda: sliding_patch(square, makkar),
        lambda: sliding_patch(resting_pressure(cube), 0.35),
        lambda: friction_wrench(cube, (0, 0, 1)),
        lambda: friction_wrench(patch, "fast"),
        lambda: friction_wrench(patch, (0, 1)),
        lambda: friction_wrench(patch, (0, np.nan, 1)),
        lambda: feedback(square, law, tether, hinge, start, times),
        lambda: feedback(cube, 0.35, tether, hinge, start, times),
        lambda: feedback(cube, law, 0.6, hinge, start, times),
        lambda: feedback(cube, law, tether, [[0.0, 0.0]], start, times),
        lambda: feedback(cube, law, tether, hinge, None, times),
        lambda: quasistatic_plan(cube, law, np.zeros((3, 2)), tether),
        lambda: quasistatic_plan(square, law, hinge, tether),
        lambda: choose_rung(cube, law, tether, hinge, start, times, "1 mm"),
        lambda: Tether("long", 1000.0),
        lambda: Patch([["a", "b"]]),
    ):
        with pytest.raises(InputError):
            call()


def test_spline_with_a_third_column_is_refused(cube, lap):
    law, tether, hinge, start = lap
    curve = CubicSpline(hinge.time_s, np.column_stack([hinge.position, hinge.time_s]))
    with pytest.raises(InputError, match="2 columns"):
        feedback(cube, law, tether, curve, start, [0.0, 1.0])


def test_results_print_on_a_screen(cube, lap):
    law, tether, hinge, start = lap
    motion = feedback(cube, law, tether, hinge, start, np.linspace(0, 10, 201))
    contact = resting_pressure(cube)
    plan = quasistatic_plan(cube, law, TimedPath(hinge.time_s[:200], hinge.position[:200]), tether)
    for result in (motion, motion.pose[:1], hinge, contact, sliding_patch(contact, law), plan):
        assert len(repr(result)) < 1000
        assert repr(result).count("\n") < 20
