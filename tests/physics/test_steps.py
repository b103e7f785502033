"""Step control: where a stop is ahead, and what the errors of two steps say about the third."""

import math
from dataclasses import replace

import numpy as np
import pytest

from towval.model import Tether, TimedPath
from towval.physics.dynamics import Accuracy, feedback
from towval.physics.friction_laws import Coulomb, Makkar
from towval.physics.splines import hermite_spline, spline_through
from towval.physics.steps import GROW, SHRINK, bend_ahead, following, least_step, retried, step_to_stop


def state(velocity, acceleration):
    return np.array([0.0, 0.0, 0.0, *velocity]), np.array([*velocity, *acceleration])


def test_a_step_towards_a_stop_takes_a_share_of_the_time_left():
    y, rates = state([0.3, 0.4, 0.0], [-0.6, -0.8, 0.0])
    assert step_to_stop(y, rates, 0.2, 1e-3) == pytest.approx(0.25, rel=1e-12)  # it stops after 0.5 s
    turning = state([0.0, 0.0, 2.0], [0.0, 0.0, -4.0])
    assert step_to_stop(*turning, 0.2, 1e-3) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("velocity", "acceleration"),
    [
        ([0.5, 0.0, 0.0], [1.0, 0.0, 0.0]),  # faster
        ([0.5, 0.0, 0.0], [0.0, -1.0, 0.0]),  # round a bend
        ([0.5, 0.0, 0.0], [-1.0, -1.0, 0.0]),  # past the stop at 0.35 m/s
        ([1e-3, 0.0, 0.0], [-1.0, 0.0, 0.0]),  # where friction is linear
    ],
)
def test_without_a_stop_ahead_a_step_is_free(velocity, acceleration):
    assert step_to_stop(*state(velocity, acceleration), 0.2, 1e-3) == math.inf


def test_errors_that_grow_are_expected_to_grow_on():
    alone = following(0.1, 0.5, GROW, 0.0, 0.0)
    assert alone == pytest.approx(0.1 * 0.9 * 0.5**-0.2, rel=1e-12)
    assert following(0.1, 0.5, GROW, 0.1, 0.5) == pytest.approx(alone, rel=1e-12)
    assert following(0.1, 0.5, GROW, 0.1, 0.05) < 0.9 * alone
    assert following(0.1, 0.5, GROW, 0.1, 5.0) == pytest.approx(alone, rel=1e-12)  # never longer for it
    assert following(0.1, 0.0, 2.0, 0.1, 0.0) == pytest.approx(0.2, rel=1e-12)
    assert retried(0.1, 1e9) == pytest.approx(0.1 * SHRINK, rel=1e-12)
    assert retried(0.1, math.inf) == pytest.approx(0.01, rel=1e-12)


def test_from_the_end_of_a_long_piece_a_step_does_not_go_beyond_a_short_one():
    """A pause of a minute, then a second to and a second fro: from the pause's end a quarter of it spans both."""
    time = np.array([0.0, 60.0, 61.0, 62.0, 70.0])
    drive = hermite_spline(time, np.column_stack([[0.0, 0.0, 0.02, 0.0, 0.0], np.zeros(5)]), np.zeros((5, 2)))
    assert least_step(drive, 10.0, 0) == pytest.approx(15.0)
    assert least_step(drive, 59.0, 0) == pytest.approx(1.25)
    assert least_step(drive, 60.5, 1) == pytest.approx(0.25)
    assert least_step(drive, 69.0, 3) == pytest.approx(2.0)


def bent_drive():
    """Cubics of half a second, along x, at whose ends the acceleration jumps by some 0.1 m/s²."""
    time = 0.5 * np.arange(41)
    speed = 0.05 + 0.01 * np.random.default_rng(3).standard_normal(41)
    place = 0.8 + np.concatenate([[0.0], np.cumsum(0.25 * (speed[1:] + speed[:-1]))])
    return hermite_spline(time, np.column_stack([place, 0 * place]), np.column_stack([speed, 0 * speed]))


def test_a_step_ends_where_the_drive_bends():
    time = np.array([0.0, 1.0, 2.0, 3.0])
    along = np.array([0.0, 0.0, 0.5, 1.5])  # at rest, 1 m/s² from 1 s on, then steady
    drive = hermite_spline(time, np.column_stack([along, 0 * along]), np.array([[0, 0], [0, 0], [1, 0], [1, 0.0]]))
    assert bend_ahead(drive, 0.5, 0, 0.4, 1e-6) == math.inf
    assert bend_ahead(drive, 0.5, 0, 0.6, 0.0049) == 1.0  # led off by 0.5 · 1 m/s² · (0.1 s)²
    assert bend_ahead(drive, 0.5, 0, 0.6, 0.0051) == math.inf
    assert bend_ahead(drive, 1.0, 1, 5.0, 1e-6) == 2.0
    assert bend_ahead(drive, 1.0 - 1e-9, 0, 0.5, 1e-6) == math.inf  # it is there


def test_a_drive_whose_acceleration_is_continuous_has_no_bends():
    time = np.linspace(0.0, 10.0, 101)
    drive = spline_through(TimedPath(time, np.column_stack([np.sin(time), np.cos(2 * time)])))
    assert bend_ahead(drive, 0.0, 0, 10.0, 1e-9) == math.inf


def test_few_steps_fail_at_bends_of_the_drive(cube):
    drive, times = bent_drive(), np.linspace(0, 20, 201)
    towed, tether = replace(cube, anchor_height=0.1, centre_of_mass_height=0.15), Tether(0.6, 800.0, damping=12.0)
    motion, exact = (
        feedback(towed, Coulomb(0.35, 1e-3), tether, drive, (0, 0, 0), times, hinge_height=0.2,
                 accuracy=Accuracy(tolerance))
        for tolerance in (1e-6, 1e-10)
    )  # fmt: skip
    assert motion.statistics["rejections"] < len(drive.knots)  # one and a half a bend, once
    assert np.abs(motion.pose - exact.pose).max() < 1e-4


def test_few_steps_fail_where_a_tether_without_damping_swings(cube):
    """Stick-slip of 0.5 s: more than a quarter of all steps failed there once."""
    hinge = TimedPath([0.0, 20.0], [[0.8, 0.0], [1.8, 0.0]])
    law, times = Makkar(0.06, 400, 40, 0.35, 800, 0), np.linspace(0, 20, 401)
    motion, exact = (
        feedback(cube, law, Tether(0.6, 800.0), hinge, (0, 0, 0), times, accuracy=Accuracy(tolerance))
        for tolerance in (1e-6, 1e-11)
    )
    assert np.ptp(motion.twist[100:, 0]) > 0.1
    assert motion.statistics["rejections"] < 0.17 * motion.statistics["steps"]
    assert np.abs(motion.pose - exact.pose).max() < 1e-4
