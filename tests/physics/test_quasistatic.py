from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from footprints import rectangle
from oracles import TRACTRIX
from towval.model import Ground, Tether, TimedPath, TowedObject
from towval.model.errors import InputError
from towval.model.geometry import rotation, transform
from towval.physics.contact import resting_pressure
from towval.physics.dynamics import feedback
from towval.physics.friction_laws import Coulomb
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.splines import spline_covering, spline_values
from towval.physics.trailing import TRAILING_RUNGS, trail
from towval.physics.wrench import friction_wrench, sliding_patch

TETHER = Tether(0.6, 1000.0)


def lemniscate(duration, steps):
    time = np.linspace(0, duration, steps + 1)
    tau = 2 * np.pi * time / duration
    return TimedPath(time, np.column_stack([np.cos(tau), np.sin(tau) * np.cos(tau)]) / (1 + np.sin(tau) ** 2)[:, None])


def test_moments_balance_about_the_anchor_and_the_hinge_follows(cube, makkar):
    path = lemniscate(600, 6000)
    plan = quasistatic_plan(cube, makkar, path, TETHER, point=(0.05, 0.02), times=path.time_s[::500])
    patch = sliding_patch(resting_pressure(cube), makkar)
    assert not plan.findings
    for i in range(13):
        turn = rotation(plan.pose[i, 2])
        body_twist = [*(turn.T @ plan.twist[i, :2]), plan.twist[i, 2]]
        fx, fy, moment = friction_wrench(patch, body_twist)
        assert moment - (0.2 * fy) == pytest.approx(0, abs=1e-9)
        assert plan.tether_force[i] == pytest.approx(-turn @ (fx, fy), abs=1e-9)
        pull = np.linalg.norm(plan.tether_force[i])
        anchor = transform(plan.pose[i], cube.anchor)
        reach = (0.6 + pull / 1000) * plan.tether_force[i] / pull
        assert plan.hinge.position[i] == pytest.approx(anchor + reach, abs=1e-12)


def test_tracked_point_stays_on_the_path(cube, makkar):
    path, point = lemniscate(600, 3000), (0.05, 0.15)
    plan = quasistatic_plan(cube, makkar, path, TETHER, point=point)
    assert transform(plan.pose, point) == pytest.approx(path.position, abs=1e-12)


def test_straight_path_needs_the_friction_force_and_no_turning(cube):
    time = np.linspace(0, 140, 1401)
    path = TimedPath(time, np.outer(0.01 * time, [np.sqrt(0.5), np.sqrt(0.5)]))
    plan = quasistatic_plan(cube, Coulomb(0.35, 1e-6), path, TETHER)
    assert plan.pose[:, 2] == pytest.approx(np.pi / 4, abs=1e-12)
    assert np.linalg.norm(plan.tether_force, axis=1) == pytest.approx(0.35 * 5 * 9.81, rel=1e-9)


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
@pytest.mark.parametrize("angle", [0.0, 2.0, np.pi])
def test_while_the_path_pauses_the_tether_stays_where_it_was(angle, space, cube):
    """Friction that has risen at any speed: the hinge is l0 + F/κ ahead of the anchor, all the time."""
    ahead = np.array([np.cos(angle), np.sin(angle)])
    ground = Ground(slope=[1e-300, 0.0] if space else [0.0, 0.0])
    for apart in (0.0, 1e-13):  # rounding between the two ends of a pause is no motion
        along = [0.0, 0.0, 0.1, 0.2, 0.2 + apart, 0.3, 0.4, 0.4]
        path = TimedPath([0, 5, 15, 25, 45, 55, 65, 70], np.outer(along, ahead))
        plan = quasistatic_plan(cube, Coulomb(0.35, 1e-14), path, TETHER, times=np.linspace(0, 70, 141), ground=ground)
        lead = (0.2 + 0.6 + 0.35 * 5 * 9.81 / 1000) * ahead
        assert plan.hinge.position - plan.pose[:, :2] == pytest.approx(np.tile(lead, (141, 1)), abs=1e-7)


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_through_a_pause_on_a_curve_the_hinge_stays_whatever_the_law_is_at_rest(space, cube):
    """At a creep a law that rises over 1 mm/s has another direction and no force: the hinge swung by 10 mm or more."""
    along = np.r_[np.arange(51), np.arange(50, 101)] * 0.02
    time = np.r_[np.arange(51.0), 250.0 + np.arange(51)]
    path = TimedPath(time, np.column_stack([np.cos(along), np.sin(along)]))
    ground = Ground(slope=[1e-300, 0.0] if space else [0.0, 0.0])
    times = np.r_[np.arange(45.0, 50.0, 0.1), np.arange(50.0, 250.05, 0.5), np.arange(250.1, 255.0, 0.1)]
    plan = quasistatic_plan(cube, Coulomb(0.35, 1e-3), path, Tether(0.6, 1e5), times=np.r_[0.0, times], ground=ground)
    hinge, pull = plan.hinge.position[1:], np.linalg.norm(plan.tether_force[1:], axis=1)
    resting = (times > 50.0) & (times < 250.0)
    assert hinge[resting] == pytest.approx(np.tile(hinge[resting][0], (resting.sum(), 1)), abs=1e-6)
    assert pull == pytest.approx(17.1, abs=0.2)
    assert not plan.twist[1:][resting].any()
    # The spline through the points turns by 0.7 degrees where it rests, and with it object and tether, 0.8 m.
    assert np.linalg.norm(np.diff(hinge, axis=0), axis=1).max() < 0.01


def test_heading_is_that_of_an_integrator_with_a_root_at_every_step(cube, makkar):
    """Without panels, slopes or Newton: scipy's eighth order, the rate by Brent's method."""
    path, patch = lemniscate(600, 60_000), sliding_patch(resting_pressure(cube), makkar)
    plan = quasistatic_plan(cube, makkar, path, TETHER, times=[0.0, 90.0])
    way = spline_covering(path, path.time_s, "the path")

    def rate(time, theta):
        velocity = rotation(theta[0]).T @ spline_values(way, np.array([time]))[1][0]

        def moment_about_anchor(omega):
            _, fy, moment = friction_wrench(patch, [*velocity, omega])
            return moment - 0.2 * fy

        return brentq(moment_about_anchor, -0.2, 0.2, xtol=1e-15, rtol=1e-14)

    exact = solve_ivp(rate, (0.0, 90.0), [plan.pose[0, 2]], "DOP853", rtol=1e-10, atol=1e-11).y[0, -1]
    assert plan.pose[-1, 2] == pytest.approx(exact, abs=1e-8)
    assert plan.statistics["heading_error_rad"] < 1e-8


@pytest.mark.parametrize("steps", [1, 10, 2500, 80_000])
def test_a_plan_is_the_same_at_whatever_times_it_is_reported(steps, cube, makkar):
    path, times = lemniscate(600, 6000), np.linspace(0, 600, steps + 1)
    often = quasistatic_plan(cube, makkar, path, TETHER, times=np.linspace(0, 600, 5001))
    plan = quasistatic_plan(cube, makkar, path, TETHER, times=times)
    assert plan.pose[-1, 2] == pytest.approx(often.pose[-1, 2], abs=2e-9)
    assert plan.hinge.position[-1] == pytest.approx(often.hinge.position[-1], abs=2e-9)


def test_what_is_interpolated_is_what_is_solved(cube, makkar):
    path = lemniscate(600, 60_000)
    often = quasistatic_plan(cube, makkar, path, TETHER)
    seldom = quasistatic_plan(cube, makkar, path, TETHER, times=path.time_s[::500])
    assert often.statistics["solves"] <= 2 * 9 * often.statistics["panels"] < 0.02 * len(often.time_s)
    assert often.tether_force[::500] == pytest.approx(seldom.tether_force, abs=1e-8)
    assert often.hinge.position[::500] == pytest.approx(seldom.hinge.position, abs=1e-9)
    assert often.twist[::500] == pytest.approx(seldom.twist, abs=1e-10)


def test_a_jerk_between_the_nodes_of_a_panel_is_seen(cube):
    """A bump of 10 mm within half a second of a straight path of 200 s."""
    time = np.linspace(0, 200, 40_001)
    bump = 0.01 * np.clip(1 - ((time - 103.3) / 0.25) ** 2, 0, None) ** 4
    path = TimedPath(time, np.column_stack([0.01 * time, bump]))
    plan, straight = (
        quasistatic_plan(cube, Coulomb(0.35, 1e-6), each, TETHER)
        for each in (path, TimedPath(time, np.column_stack([0.01 * time, 0 * time])))
    )
    assert plan.statistics["panels"] > 5 * straight.statistics["panels"]
    assert np.abs(plan.pose[:, 2]).max() > 1e-3
    assert plan.pose[time < 103, 2] == pytest.approx(0, abs=1e-9)


def test_feedback_along_the_planned_hinge_follows_the_plan(cube):
    law = Coulomb(0.35, 1e-3)
    plan = quasistatic_plan(cube, law, lemniscate(600, 6000), TETHER)
    motion = feedback(cube, law, TETHER, plan.hinge, plan.pose[0], plan.time_s[::100], start_twist=plan.twist[0])
    assert motion.outcome == "converged"
    assert np.abs(motion.pose[:, :2] - plan.pose[::100, :2]).max() < 2e-3


def test_small_patch_towed_far_off_is_a_tractrix():
    """With P at the anchor and a patch that is almost a point, the body trails its anchor as a tractrix."""
    tiny = rectangle(1e-3, 1e-3)
    towed = TowedObject(tiny, 1.0, [0, 0], 1e-3, [TRACTRIX["length"], 0])
    path = TimedPath([0.0, 1.0], [[0.0, 0.0], [TRACTRIX["s"], 0.0]])
    plan = quasistatic_plan(
        towed,
        Coulomb(0.3, 1e-6),
        path,
        TETHER,
        point=towed.anchor,
        start_heading=np.pi / 2,
        times=np.linspace(0, 1, 5001),
    )
    assert plan.pose[-1, 2] == pytest.approx(TRACTRIX["theta"], abs=2e-6)
    assert plan.pose[-1, :2] == pytest.approx(TRACTRIX["object_m"], abs=2e-6)


def test_lost_root_is_reported(makkar):
    """Drawn by a corner that it must drag behind a point on the other side, the object cannot be balanced."""
    towed = TowedObject(rectangle(0.4, 0.4), 5.0, [0.1, 0.15], 0.2, [0.2, 0.2])
    plan = quasistatic_plan(towed, makkar, lemniscate(60, 3000), TETHER, point=(-0.6, -0.5), start_heading=2.0)
    assert {finding.code for finding in plan.findings} & {"root_lost", "root_jumped", "cable_would_push"}


def test_a_jump_between_two_reported_times_is_reported(cube):
    zigzag = TimedPath(10.0 * np.arange(5), [[0.0, 0.0], [0.3, 0.2], [0.6, -0.2], [0.9, 0.2], [1.2, 0.0]])
    scene = cube, Coulomb(0.35, 1e-3), zigzag, TETHER
    plan = quasistatic_plan(*scene, point=(-0.15, 0.15), start_heading=0.3, times=[0.0, 20.0])
    assert "root_jumped" in {found.code for found in plan.findings}


def test_drawn_by_its_anchor_an_object_starts_with_its_centre_of_mass_behind(makkar):
    """A straight path then leaves it as it is; balance is where the centre of mass is in line with the anchor."""
    towed = TowedObject(rectangle(0.4, 0.4), 5.0, [0.05, -0.02], 0.13, [0.0, 0.2])
    path = TimedPath([0.0, 60.0], [[0.0, 0.0], [3.0, 0.0]])
    plan = quasistatic_plan(towed, makkar, path, TETHER, point=towed.anchor, times=[0.0, 30.0, 60.0])
    assert plan.pose[:, 2] == pytest.approx(-np.arctan2(0.22, -0.05), abs=1e-9)


@pytest.mark.parametrize("heading", [np.nan, "x", [0.0, 1.0]])
def test_a_start_heading_that_is_none_is_an_input_error(heading, cube, makkar):
    with pytest.raises(InputError, match="start heading"):
        quasistatic_plan(cube, makkar, lemniscate(60, 30), TETHER, start_heading=heading)


def test_turned_and_moved_path_is_the_turned_and_moved_plan(cube, makkar):
    frame, path = np.array([1.0, -2.0, 0.8]), lemniscate(600, 2000)
    moved = TimedPath(path.time_s, transform(frame, path.position))
    here = quasistatic_plan(cube, makkar, path, TETHER)
    there = quasistatic_plan(cube, makkar, moved, TETHER)
    assert there.hinge.position == pytest.approx(transform(frame, here.hinge.position), abs=1e-10)
    assert np.unwrap(there.pose[:, 2] - here.pose[:, 2]) == pytest.approx(np.full(2001, 0.8), abs=1e-10)


def test_resting_path_is_an_input_error(cube, makkar):
    with pytest.raises(InputError, match="never moves"):
        quasistatic_plan(cube, makkar, TimedPath([0, 1, 2.0], np.zeros((3, 2))), TETHER)


def test_a_tow_out_of_the_plane_is_refused_by_the_models_in_the_plane(cube, makkar):
    hinge = TimedPath([0.0, 10.0], [[0.9, 0.0], [1.9, 0.0]])
    for towed, tether in (
        (replace(cube, anchor_height=0.1), TETHER),
        (cube, replace(TETHER, stiffening=0.2, full_load=20.0)),
        (cube, replace(TETHER, mass_per_length=0.01)),
    ):
        for rung in TRAILING_RUNGS:
            with pytest.raises(InputError, match="plane of the floor"):
                trail(rung, towed, makkar, tether, hinge, (0.0, 0.0, 0.0), [0.0, 1.0])
