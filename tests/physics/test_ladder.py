from dataclasses import replace

import numpy as np
import pytest

from footprints import rectangle
from oracles import TRACTRIX, disk_wrench
from towval.model import Ground, Tether, TimedPath, TowedObject
from towval.model.errors import InputError
from towval.physics.contact import resting_pressure
from towval.physics.friction_laws import Coulomb
from towval.physics.ladder import RUNGS, choose_rung, path_difference, simulate_rung
from towval.physics.trailing import TRAILING_RUNGS, trail
from towval.physics.wrench import friction_wrench, sliding_patch

TIMES = np.linspace(0, 1, 201)
STRAIGHT = TimedPath([0.0, 1.0], [[0.0, 0.0], [TRACTRIX["s"], 0.0]])
STIFF = Tether(TRACTRIX["length"], 1e12)


def test_limit_surface_is_a_tenth_off_in_between():
    """F² + (M / M0)² of a disk, M0 two thirds of μ N R: a tenth below one with the centre of rotation on the rim."""

    def off(ratio):
        force, moment = disk_wrench(ratio)
        return 1 - (force**2 + (1.5 * moment) ** 2)

    assert off(1 - 1e-9) == pytest.approx(0.0994, abs=1e-4)
    assert max(map(off, np.linspace(0.05, 0.99, 95))) == pytest.approx(0.1273, abs=1e-4)
    assert off(0.05) < 0.01
    assert off(10.0) < 0.01


def test_tractrix_has_the_closed_form():
    towed = TowedObject(rectangle(1e-3, 1e-3), 1.0, [0, 0], 1e-3, [0, 0])
    start = (0, -TRACTRIX["length"], np.pi / 2)
    motion = simulate_rung("tractrix", towed, Coulomb(0.35, 1e-3), STIFF, STRAIGHT, start, TIMES)
    assert motion.pose[-1, :2] == pytest.approx(TRACTRIX["object_m"], abs=1e-9)
    assert motion.pose[-1, 2] == pytest.approx(TRACTRIX["theta"], abs=1e-9)


@pytest.mark.parametrize("rung", RUNGS)
def test_every_rung_tows_a_small_object_along_the_tractrix(rung):
    """A patch of a centimetre at the end of 0.6 m is almost a point, and slow motion has almost no inertia."""
    towed = TowedObject(rectangle(0.01, 0.01), 1.0, [0, 0], 1e-4, [0, 0])
    slow = TimedPath(400 * STRAIGHT.time_s, STRAIGHT.position)
    tether, start = Tether(TRACTRIX["length"], 1e5), (0, -TRACTRIX["length"], np.pi / 2)
    motion = simulate_rung(rung, towed, Coulomb(0.35, 1e-5), tether, slow, start, 400 * TIMES)
    assert motion.outcome == "converged"
    assert motion.pose[-1, :2] == pytest.approx(TRACTRIX["object_m"], abs=1e-3)
    assert motion.rung == rung


@pytest.mark.parametrize("rung", TRAILING_RUNGS)
def test_a_rung_without_inertia_weighs_the_object_under_the_gravity_of_its_ground(cube, rung):
    """On the moon the tether stretches by a sixth of what it does on the earth."""
    hinge = TimedPath([0.0, 10.0], [[0.8, 0.0], [1.8, 0.0]])
    scene = cube, Coulomb(0.35, 1e-6), Tether(0.6, 1000.0), hinge, (0.0, 0.0, 0.0), [0.0, 10.0]
    pull = simulate_rung(rung, *scene, ground=Ground(gravity=1.62)).tether_force[-1]
    assert np.hypot(*pull) == pytest.approx(0.35 * cube.mass * 1.62, rel=1e-6)


def test_quasi_static_rungs_balance_forces_at_the_tether(cube, lap):
    law, tether, hinge, start = lap
    times = np.linspace(0, 100, 21)
    motion = simulate_rung("quasi-static patch", cube, law, tether, hinge, start, times)
    patch = sliding_patch(resting_pressure(cube), law)
    for i in range(5, 20):
        c, s = np.cos(motion.pose[i, 2]), np.sin(motion.pose[i, 2])
        turn = np.array([[c, -s], [s, c]])
        friction = friction_wrench(patch, [*(turn.T @ motion.twist[i, :2]), motion.twist[i, 2]])
        assert turn @ friction[:2] == pytest.approx(-motion.tether_force[i], abs=0.02)
        lever = turn @ cube.anchor
        assert friction[2] == pytest.approx(
            -(lever[0] * motion.tether_force[i, 1] - lever[1] * motion.tether_force[i, 0]), abs=0.01
        )


def test_ladder_takes_the_lowest_rung_that_is_enough(cube, lap):
    law, tether, hinge, start = lap
    times = np.linspace(0, 400, 81)
    scene = (cube, law, tether, hinge, start, times)
    choices = [choose_rung(*scene, tolerance) for tolerance in (1e-6, 0.03, 0.2, 5.0)]
    assert [choice.rung for choice in choices] == ["dynamics", "quasi-static patch", "limit surface", "tractrix"]
    for choice in choices:
        assert choice.motion.rung == choice.rung
    # None below a rung that is more than twice the tolerance away can be within it of both: not run.
    assert [list(choice.to_dynamics_m) for choice in choices[::3]] == [["quasi-static patch"], [*RUNGS][-2::-1]]


def test_slack_hinge_moves_nothing_on_any_rung(cube, makkar):
    hinge = TimedPath([0.0, 1.0], [[0.3, 0.0], [0.31, 0.0]])
    for rung in RUNGS:
        motion = simulate_rung(rung, cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), [0.0, 0.5, 1.0])
        assert motion.outcome == "slack all along"
        assert np.abs(motion.pose).max() < 1e-12


@pytest.mark.parametrize("rung", TRAILING_RUNGS)
def test_a_rung_without_inertia_ends_at_the_same_place_however_seldom_it_is_reported(rung, cube):
    """The hinge rests for half the time: the step follows from where it is fast."""
    knots = [0.0, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0, 10.0]
    along, across = [0.8, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.35, 1.35], [0, 0, 0.05, 0.15, 0.3, 0.5, 0.8, 1.1, 1.1]
    scene = cube, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), TimedPath(knots, np.column_stack([along, across]))
    often = trail(rung, *scene, (0.0, 0.0, 0.0), np.linspace(0, 10, 1001))
    for n in (2, 6):
        seldom = trail(rung, *scene, (0.0, 0.0, 0.0), np.linspace(0, 10, n))
        assert seldom.pose[-1] == pytest.approx(often.pose[-1], abs=1e-3)


@pytest.mark.parametrize("rung", TRAILING_RUNGS)
def test_a_resting_hinge_and_one_over_the_anchor_are_followed(rung, cube):
    scene = cube, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0)
    resting = trail(rung, *scene, TimedPath([0.0, 10.0], [[0.7, 0.0], [0.7, 0.0]]), (0, 0, 0), [0.0, 5.0, 10.0])
    assert resting.outcome == "slack all along"
    assert resting.pose == pytest.approx(np.zeros((3, 3)), abs=0)
    taken = trail(rung, *scene, TimedPath([0.0, 10.0], [[0.2, 0.0], [1.8, 0.0]]), (0, 0, 0), [0.0, 5.0, 10.0])
    assert not taken.findings
    # Behind the hinge by the anchor's lever, the tether and its stretch under μ N.
    assert taken.pose[-1] == pytest.approx([1.8 - 0.2 - 0.6 - 0.35 * 5 * 9.80665 / 1000, 0, 0], abs=1e-4)


@pytest.mark.parametrize("rung", TRAILING_RUNGS)
def test_a_turned_tow_is_pulled_alike_from_rest(rung, cube):
    """Friction is looked at no slower than a share of the hinge's mean speed, which no direction changes."""
    pulls, time = [], np.arange(4.0)
    for heading in (0.0, np.pi / 4):
        hinge = TimedPath(time, np.outer(0.9 + 0.1 * time**2, [np.cos(heading), np.sin(heading)]))
        motion = trail(rung, cube, Coulomb(0.35, 0.1), Tether(0.6, 1000.0), hinge, (0, 0, heading), time)
        pulls.append(np.linalg.norm(motion.tether_force, axis=1))
    assert pulls[0].min() > 0
    assert pulls[1] == pytest.approx(pulls[0], rel=1e-9)


@pytest.mark.parametrize("rung", TRAILING_RUNGS)
def test_reported_rates_do_not_depend_on_the_first_interval(rung, cube):
    knots = np.linspace(0, 20, 201)
    way = np.column_stack([0.8 * np.cos(0.1 * knots) + 0.1 * knots, 0.8 * np.sin(0.1 * knots)])
    scene = cube, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), TimedPath(knots, way), (0.0, 0.0, 0.0)
    even, uneven = (trail(rung, *scene, np.r_[0, first, knots[2:]]) for first in (0.1, 1e-7))
    assert uneven.twist[20:] == pytest.approx(even.twist[20:], abs=1e-4)


@pytest.mark.parametrize("rung", TRAILING_RUNGS)
def test_a_slack_tether_does_not_pull_before_the_hinge_has_gone_far(rung, cube):
    hinge = TimedPath([0.0, 10.0], [[0.7, 0.0], [1.8, 0.0]])  # slack by 100 mm
    motion = trail(rung, cube, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0), hinge, (0, 0, 0), [0.0, 10.0])
    assert [*motion.twist[0], *motion.tether_force[0]] == [0] * 5
    assert motion.twist[-1] == pytest.approx([0.11, 0, 0], abs=1e-4)


def test_unknown_rung_and_tolerance_are_input_errors(cube, lap):
    law, tether, hinge, start = lap
    with pytest.raises(InputError, match="unknown rung"):
        simulate_rung("guess", cube, law, tether, hinge, start, [0.0, 1.0])
    with pytest.raises(InputError, match="unknown rung"):
        trail("dynamics", cube, law, tether, hinge, start, [0.0, 1.0])
    with pytest.raises(InputError, match="tolerance"):
        choose_rung(cube, law, tether, hinge, start, [0.0, 1.0], 0.0)


def test_ladder_of_an_object_with_a_raised_anchor_compares_with_the_dynamics_in_space(cube, lap):
    law, tether, hinge, start = lap
    scene = replace(cube, anchor_height=0.1), law, tether, hinge, start, np.linspace(0, 20, 5)
    choice = choose_rung(*scene, 5.0)
    assert choice.rung == "tractrix"
    planar = simulate_rung("quasi-static patch", cube, *scene[1:])
    top = simulate_rung("dynamics", *scene)
    assert choice.to_dynamics_m["quasi-static patch"] == pytest.approx(path_difference(cube, planar, top), rel=1e-9)
