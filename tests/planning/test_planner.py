"""The planner: constraints along every plan, invariance, what it does where it must fail."""

import numpy as np
import pytest

from paper_plan import quick_plan
from studies.rover_geometry import constraint_residual, moved_by
from towval.commands.plan import run
from towval.model import TimedPath
from towval.model.errors import InputError
from towval.model.geometry import compose, transform
from towval.planning import paths
from towval.planning.feasible_region import GUARD, flanks
from towval.planning.kinematics import Rover, symmetric_rover
from towval.planning.planner import (
    PlanCase,
    PlannerSettings,
    PlanOutcome,
    heading_over_hinge,
    plan_rover,
    tightest_radius,
)

DEFAULTS = {
    "threshold": 0.2,
    "look_ahead_steps": 150,
    "proportional_gain": 2.0,
    "derivative_gain": 0.05,
    "close_distance": 0.5,
    "arrival_distance": 0.02,
    "stray_distance": 1.0,
}


def polyline(points):
    """Straight lines from point to point, with kinks."""
    points = np.asarray(points, dtype=float)
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return paths.Curve("polyline", knots[-1], lambda s: np.stack([np.interp(s, knots, x) for x in points.T], axis=-1))


CURVES = {
    "line": paths.line(1.4),
    "circle": paths.circle(1.5),
    "tight circle": paths.circle(0.4),
    "lemniscate": paths.lemniscate(4.0),
    "tight lemniscate": paths.lemniscate(1.0),
    "rounded square": paths.rounded_square(4.0, 0.5),
    "kink": polyline([[0, 0], [2, 0], [2, 2], [4, 2]]),
    "cusp": polyline([[0, 0], [2, 0], [0, 0.2]]),
}


def settings(**changes):
    return PlannerSettings(**(DEFAULTS | changes))


def timed(name):
    return paths.timed(CURVES[name], 0.1, duration=300.0)


@pytest.mark.parametrize("threshold", [0.03, 0.2, 0.7])
@pytest.mark.parametrize("look_ahead", [0, 150])
@pytest.mark.parametrize("name", CURVES)
def test_wheels_roll_without_slip_and_stay_in_range_on_every_plan_good_or_bad(rover, name, look_ahead, threshold):
    plan = plan_rover(timed(name), rover, settings(threshold=threshold, look_ahead_steps=look_ahead))
    assert constraint_residual(rover, plan.steering, plan.wheel_rates, plan.twist).max() < 1e-9
    assert (plan.steering >= rover.steering_ranges[:, 0] + GUARD / 2).all()
    assert (plan.steering <= rover.steering_ranges[:, 1] - GUARD / 2).all()
    np.testing.assert_allclose(moved_by(plan.pose, plan.twist, 0.1)[:-1], plan.pose[1:], atol=1e-11)
    assert plan.outcome in PlanOutcome
    assert plan.advice


@pytest.mark.parametrize(("name", "rms"), [("line", 2e-3), ("circle", 2e-3), ("lemniscate", 5e-2)])
def test_arrives_on_paths_that_the_rover_can_follow(rover, name, rms):
    plan = plan_rover(timed(name), rover, settings())
    assert plan.outcome is PlanOutcome.ARRIVED
    assert plan.rms < rms


def test_the_hinge_moves_at_the_mean_speed_of_the_path_wherever_it_is(rover):
    trailing = Rover(rover.wheel_positions, rover.steering_ranges, 0.08, np.array([-0.4, 0.1]))
    plan = plan_rover(timed("circle"), trailing, settings())
    assert plan.outcome is PlanOutcome.ARRIVED
    chord = np.linalg.norm(np.diff(plan.hinge, axis=0), axis=1)
    np.testing.assert_allclose(chord / 0.1, 3 * np.pi / 300, rtol=1e-5)
    np.testing.assert_allclose(plan.hinge[0], [1.5, 0.0], atol=1e-12)


def test_a_hinge_that_gives_way_by_less_than_a_step_at_a_pause_bends_nothing():
    """As the pull fades where the object comes to rest: of a straight path a bend of 0.008 mm was reported."""
    there = np.linspace(0.0, 1.0, 101)
    x = np.concatenate([there, [1.0 - 4e-5] * 20, 1.0 + there])
    straight = np.column_stack([x, np.zeros_like(x)])
    assert tightest_radius(straight) == np.inf
    arc = 2.0 * np.column_stack([np.cos(x / 2), np.sin(x / 2)])
    assert tightest_radius(arc) == pytest.approx(2.0, rel=1e-3)
    back = np.concatenate([there, there[::-1]])
    assert tightest_radius(np.column_stack([back, 0 * back])) < 0.01  # but one that turns back


def test_a_pause_does_not_hold_back_the_planned_heading(rover):
    """Its points filled the moving average of the heading, as if the path went straight there: 5.5 mm RMS."""
    moving = timed("circle")
    pause = np.tile(moving.position[1000], (3000, 1))
    paused = np.concatenate([moving.position[:1000], pause, moving.position[1000:]])
    plan = plan_rover(TimedPath(0.1 * np.arange(len(paused)), paused), rover, settings(look_ahead_steps=350))
    assert plan.outcome is PlanOutcome.ARRIVED
    assert plan.rms < 1e-3


def test_a_feasible_circle_is_case_a_throughout_and_its_wheels_turn_as_they_must(rover):
    plan = plan_rover(timed("circle"), rover, settings(look_ahead_steps=0))
    assert plan.share_of(PlanCase.A) == 1.0
    middle = len(plan.time_s) // 2
    front_left = np.arctan2(0.3, 1.5 - 0.25)
    assert plan.steering[middle, 0] == pytest.approx(front_left, abs=2e-3)
    assert plan.wheel_rates[middle, 0] == pytest.approx(3 * np.pi / 300 / 1.5 * np.hypot(1.25, 0.3) / 0.08, rel=2e-3)


def test_the_plan_on_a_turned_and_moved_path_is_the_turned_and_moved_plan(rover):
    frame = np.array([3.0, -2.0, 2.4])
    path = timed("lemniscate")
    plan = plan_rover(path, rover, settings())
    moved = plan_rover(TimedPath(path.time_s, transform(frame, path.position)), rover, settings())
    assert moved.outcome is plan.outcome
    expected = compose(frame, plan.pose)
    np.testing.assert_allclose(moved.pose[:, :2], expected[:, :2], atol=1e-9)
    np.testing.assert_allclose(moved.steering, plan.steering, atol=1e-8)
    assert (moved.case == plan.case).all()


def test_the_plan_on_a_mirrored_path_with_mirrored_limits_is_the_mirrored_plan():
    positions = np.array([[0.3, 0.25], [-0.3, 0.25], [-0.3, -0.25], [0.3, -0.25]])
    ranges = np.array([[-1.2, 0.7], [-0.6, 1.4], [-1.5, 0.8], [-0.8, 1.0]])
    hinge = np.array([-0.1, 0.05])
    swap = [3, 2, 1, 0]  # left and right wheels trade places
    path = timed("lemniscate")
    plan = plan_rover(path, Rover(positions, ranges, 0.08, hinge), settings())
    mirrored = plan_rover(
        TimedPath(path.time_s, path.position * [1, -1]),
        Rover(positions, -ranges[swap][:, ::-1], 0.08, hinge * [1, -1]),
        settings(),
    )
    assert plan.outcome is PlanOutcome.ARRIVED
    np.testing.assert_allclose(mirrored.hinge, plan.hinge * [1, -1], atol=1e-9)
    np.testing.assert_allclose(mirrored.steering, -plan.steering[:, swap], atol=1e-8)
    assert (mirrored.case == plan.case).all()


@pytest.mark.parametrize("ahead", [-0.4, 0.3])
def test_on_a_circle_a_hinge_off_the_middle_asks_for_a_steady_lead_or_lag(ahead):
    angle = np.linspace(0, 6 * np.pi, 6000)
    lead = heading_over_hinge(np.column_stack([np.cos(angle), np.sin(angle)]), ahead) - (angle + np.pi / 2)
    # sin(φ − ϑ) = ξ/R, once the transient of length ξ from the end where it starts is over.
    np.testing.assert_allclose(lead[2000:4000], -np.arcsin(ahead), atol=2e-3)


@pytest.mark.parametrize("name", ["line", "circle", "lemniscate", "rounded square"])
def test_a_hinge_behind_the_rover_is_led_along_every_kind_of_curve(name):
    trailing = symmetric_rover(0.4, 0.4, 0.1, outward=np.radians(33.7), inward=np.radians(93.0), hinge=[-0.42, 0.0])
    plan = plan_rover(timed(name), trailing, settings())
    assert plan.outcome is PlanOutcome.ARRIVED
    assert plan.rms < 0.05


def test_a_sharp_kink_is_not_followed_and_the_advice_says_why(rover):
    plan = plan_rover(timed("kink"), rover, settings(look_ahead_steps=0, threshold=0.05))
    assert plan.outcome is PlanOutcome.STRAYED
    assert plan.share_of(PlanCase.C) > 0
    assert plan.hinge[-1, 0] > 2.0  # it left at the first corner
    assert "path_too_tight" in [finding.code for finding in plan.findings]


def test_look_ahead_brings_the_rover_round_a_gentle_kink(rover):
    bent = polyline([[0, 0], [2, 0], [2 + 2 * np.cos(0.5), 2 * np.sin(0.5)]])
    path = paths.timed(bent, 0.1, duration=300.0)
    abrupt = plan_rover(path, rover, settings(look_ahead_steps=0, threshold=0.05))
    prepared = plan_rover(path, rover, settings(look_ahead_steps=150, threshold=0.05))
    assert prepared.share_of(PlanCase.A) > abrupt.share_of(PlanCase.A)
    assert prepared.outcome is PlanOutcome.ARRIVED
    assert prepared.rms < abrupt.rms


def test_a_path_that_starts_behind_the_rover_strays_and_says_so(rover):
    plan = plan_rover(timed("line"), rover, settings(), start=[0.8, 0.8, np.pi / 4])
    assert plan.outcome is not PlanOutcome.ARRIVED
    assert "behind" in plan.advice


def test_curvature_beyond_the_steering_range_is_named_with_both_radii(rover):
    plan = plan_rover(timed("tight circle"), rover, settings())
    assert plan.outcome is not PlanOutcome.ARRIVED
    assert "tightest radius is 0.4 m" in plan.advice
    assert f"{flanks(rover).tightest_radius:.3g} m" in plan.advice
    assert [finding.code for finding in plan.findings] == ["path_too_tight"]


def test_a_threshold_longer_than_the_path_is_named(rover):
    plan = plan_rover(timed("line"), rover, settings(threshold=2.0))
    assert [finding.code for finding in plan.findings] == ["threshold_exceeds_path"]
    assert (plan.target == 3000).all()
    assert plan.outcome is PlanOutcome.ARRIVED


def test_a_look_ahead_longer_than_the_path_is_named(rover):
    plan = plan_rover(timed("rounded square"), rover, settings(look_ahead_steps=5000))
    assert "look_ahead_exceeds_path" in [finding.code for finding in plan.findings]


def test_a_threshold_that_no_step_can_meet_gets_stuck(rover):
    plan = plan_rover(timed("lemniscate"), rover, settings(threshold=0.0, stray_distance=10.0))
    assert plan.outcome is PlanOutcome.STUCK
    assert "larger threshold" in plan.advice


@pytest.mark.parametrize("change", [{"threshold": -1.0}, {"arrival_distance": 0.0}, {"proportional_gain": np.nan}])
def test_impossible_settings_are_refused(change):
    with pytest.raises(InputError, match=next(iter(change))):
        settings(**change)


def test_a_path_without_length_is_refused(rover):
    still = TimedPath(np.arange(5.0), np.zeros((5, 2)))
    with pytest.raises(InputError, match="cannot be planned"):
        plan_rover(still, rover, settings())


def test_tightest_radius_of_sampled_curves():
    assert tightest_radius(timed("circle").position) == pytest.approx(1.5, rel=1e-5)
    assert tightest_radius(timed("lemniscate").position) == pytest.approx(2 / 3, rel=1e-4)
    assert tightest_radius(timed("line").position) == np.inf


def test_a_path_is_planned_to_its_end_where_its_time_is_no_whole_number_of_steps(tmp_path):
    """What was left after the last whole step was left out: 17 cm of two metres, and the plan had arrived."""
    plan, file = quick_plan(), tmp_path / "path.csv"
    plan["planner"]["time_step_s"], plan["cube"]["centre_of_mass_m"] = 1.0, [0.0, 0.0]
    file.write_text("x_m,y_m,time_s\n0,0,5\n1,0,10.45\n2,0,15.95\n")
    planned = run(plan, str(file), tmp_path / "p.mcap", tmp_path / "p.csv")
    assert planned.numbers["path_length_m"] == pytest.approx(2.0, abs=1e-6)
