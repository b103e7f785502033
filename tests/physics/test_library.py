"""The physics as a notebook uses it: names, examples, many values at once, and errors that a person can read."""

import contextlib
import doctest
import importlib
import pkgutil
import timeit

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import towval.physics
from towval import physics
from towval.model import FrictionSpecification, Patch, Tether, TimedPath, geometry
from towval.model.errors import InputError, TowvalError
from towval.physics import (
    choose_rung,
    feedback,
    friction_wrench,
    pressure_plane,
    quasistatic_plan,
    resting_pressure,
    sliding_patch,
)
from towval.physics.ladder import path_difference
from towval.physics.limit_surface import limit_surface
from towval.physics.mass import spread_over
from towval.physics.tether import lowest_point

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


NO_NUMBERS = (None, "x", "1e-3", [], [1.0, 2.0], [[1, 2], [3]], object(), {}, 1 + 2j, np.zeros((2, 4)))
TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])


def _calls(cube, makkar, square, lap):
    """Functions with arguments that they take; each argument is then put wrong."""
    law, tether, hinge, start = lap
    times = [0.0, 0.1]
    motion = feedback(cube, law, tether, hinge, start, times)
    patch = sliding_patch(resting_pressure(cube), makkar)
    heavy = Tether(0.6, 1e7, mass_per_length=1.0)
    stated = FrictionSpecification(0.4, 0.35, 0.005, 0.07)
    return (
        (pressure_plane, square, [(50.0, (0.0, 0.0))]),
        (friction_wrench, patch, (0.1, 0.0, 0.0)),
        (limit_surface, patch),
        (feedback, cube, law, tether, hinge, start, times),
        (physics.trail, "tractrix", cube, law, tether, hinge, start, times),
        (physics.simulate_rung, "tractrix", cube, law, tether, hinge, start, times),
        (choose_rung, cube, law, tether, hinge, start, times, 0.05),
        (path_difference, cube, motion, motion),
        (physics.creep_length, motion, cube, 1e-3),
        (physics.tether_force, tether, (0.61, 0.0)),
        (lowest_point, heavy, 0.59, 0.0),
        (physics.fitted_law, stated),
        (physics.fit_makkar, 0.4, 0.35, 0.005, 0.07),
        (law.coefficient, 0.1),
        (physics.Accuracy, 1e-7),
        (spread_over, square),
        (Patch.of, [TRIANGLE]),
        (TimedPath, [0.0, 1.0, 2.0], TRIANGLE),
        (geometry.transform, (0.0, 0.0, 0.0), TRIANGLE),
        (geometry.velocity_at, (0.0, 0.0, 0.0), TRIANGLE),
        (geometry.compose, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (geometry.rigid_fit, TRIANGLE, TRIANGLE, (1.0, 1.0, 1.0)),
        (geometry.polygon_area, TRIANGLE),
        (geometry.inside_polygon, TRIANGLE, (0.5, 0.5)),
        (geometry.error_signature, np.zeros((30, 3))),
        (geometry.path_length, TRIANGLE),
    )


def test_whatever_is_given_in_place_of_an_argument_is_taken_or_an_input_error(cube, makkar, square, lap):
    for function, *right in _calls(cube, makkar, square, lap):
        function(*right)
        for place in range(len(right)):
            for wrong in NO_NUMBERS:
                with contextlib.suppress(TowvalError):
                    function(*right[:place], wrong, *right[place + 1 :])


@pytest.mark.parametrize(
    "call",
    [
        lambda: physics.Accuracy("1e-3"),
        lambda: limit_surface(None),
        lambda: geometry.rigid_fit(TRIANGLE, TRIANGLE[:2]),
        lambda: geometry.rigid_fit(TRIANGLE, TRIANGLE, (0.0, 0.0, 0.0)),
        lambda: geometry.error_signature([]),
        lambda: geometry.transform(None, TRIANGLE),
        lambda: geometry.transform(np.zeros((2, 3)), TRIANGLE),
        lambda: geometry.transform((0.0, 0.0), TRIANGLE),
        lambda: physics.tether_force(Tether(0.6, 1000.0), [[0.61, 0.0], [0.5, 0.0]], np.zeros((3, 2))),
    ],
)
def test_shapes_that_do_not_match_are_input_errors(call):
    with pytest.raises(InputError):
        call()


def test_an_unknown_sticking_is_refused(cube, lap):
    law, tether, hinge, start = lap
    for wrong in (0.4, True, "auto", 0, []):
        with pytest.raises(InputError, match="sticking"):
            feedback(cube, law, tether, hinge, start, [0.0, 1.0], sticking=wrong)


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
