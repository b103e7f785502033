import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from footprints import rectangle
from oracles import (
    COAST,
    COAST_DISTANCE,
    COAST_REST_DISTANCE,
    COAST_SPEED,
    DISK_STOP_RATIO,
    LAP_FINAL_POSE,
    coast_speed,
)
from studies.paper.finite_volumes import mesh_pressure, meshed_patch
from towval.model import Patch, Tether, TimedPath, TowedObject
from towval.model.errors import InputError
from towval.model.geometry import transform
from towval.physics.dynamics import Accuracy, Outcome, feedback, feedforward
from towval.physics.friction_laws import Coulomb, Makkar
from towval.physics.quasistatic import quasistatic_plan
from towval.physics.tether import tether_force

NO_FORCE = TimedPath([0.0, 1000.0], np.zeros((2, 2)))


def coast(towed, law, twist, times, **options):
    return feedforward(towed, law, NO_FORCE, (0, 0, 0), times, start_twist=twist, **options)


def test_coasting_down_has_the_closed_form(cube):
    law = Coulomb(COAST["mu"], COAST["v_s"])
    motion = coast(cube, law, (COAST["v0"], 0, 0), [0.0, COAST["t"], 2.0], accuracy=Accuracy(1e-12))
    assert coast_speed(**COAST) == pytest.approx(COAST_SPEED, abs=1e-12)
    assert motion.outcome == Outcome.CONVERGED
    assert motion.twist[1, 0] == pytest.approx(COAST_SPEED, abs=1e-10)
    assert motion.pose[1:, 0] == pytest.approx([COAST_DISTANCE, COAST_REST_DISTANCE], abs=1e-11)


def test_steady_pull_against_viscous_friction_has_the_closed_form(cube):
    """Once Coulomb's part has saturated, m dv/dt = T − μ N − γ6 N v."""
    mu, viscous, pull = 0.3, 0.5, 20.0
    law = Makkar(0.0, 0.0, 0.0, mu, 1e6, viscous)
    times = np.linspace(0, 1.5, 16)
    force = TimedPath([0.0, 1.5], [[pull, 0.0]] * 2)
    motion = feedforward(cube, law, force, (0, 0, 0), times, accuracy=Accuracy(1e-11))
    weight, rate = 5.0 * 9.81, viscous * 9.81
    final_speed = (pull - mu * weight) / (viscous * weight)
    assert motion.outcome == Outcome.CONVERGED
    # It breaks away within 1e-6 s: that is how far the two differ.
    assert motion.twist[:, 0] == pytest.approx(final_speed * (1 - np.exp(-rate * times)), abs=2e-6)
    assert motion.pose[-1, 0] == pytest.approx(
        final_speed * (times[-1] - (1 - np.exp(-rate * times[-1])) / rate), abs=2e-6
    )
    assert motion.tether_force == pytest.approx(np.tile([pull, 0.0], (16, 1)))
    assert np.abs(motion.pose[:, 1:]).max() < 1e-12


def test_force_does_the_work_that_becomes_motion_and_heat(cube, makkar):
    """A constant force works by the way of its point of attack; friction takes the rest, and never gives."""
    frame = (0.3, -0.2, 0.9)
    force = np.array([22.0, 6.0])
    times = np.linspace(0, 1.0, 101)
    motion = feedforward(cube, makkar, TimedPath([0.0, 1.0], [force, force]), frame, times, accuracy=Accuracy(1e-10))
    kinetic = cube.mass * (motion.twist[:, :2] ** 2).sum(1) / 2 + cube.inertia * motion.twist[:, 2] ** 2 / 2
    work = (transform(motion.pose, cube.anchor) - transform(frame, cube.anchor)) @ force
    assert kinetic[-1] > 1.0
    assert (np.diff(work - kinetic) > 0).all()
    frictionless = Coulomb(1e-12, 1.0)
    free = feedforward(
        cube, frictionless, TimedPath([0.0, 1.0], [force, force]), frame, times, accuracy=Accuracy(1e-12)
    )
    kinetic = cube.mass * (free.twist[:, :2] ** 2).sum(1) / 2 + cube.inertia * free.twist[:, 2] ** 2 / 2
    work = (transform(free.pose, cube.anchor) - transform(frame, cube.anchor)) @ force
    assert kinetic == pytest.approx(work, abs=1e-8)


def test_planned_force_applied_blindly_follows_the_plan_only_if_started_as_planned(cube):
    """Friction that rises with speed keeps a feedforward motion close; the first swing from rest is never made up."""
    law = Makkar(0.0, 0.0, 0.0, 0.35, 1e3, 0.5)
    time = np.linspace(0, 20, 2001)
    path = np.column_stack([np.cos(0.1 * time), np.sin(0.1 * time)])
    plan = quasistatic_plan(cube, law, TimedPath(time, path), Tether(0.6, 1000.0))
    force, times = TimedPath(plan.time_s, plan.tether_force), time[::100]
    matched = feedforward(cube, law, force, plan.pose[0], times, start_twist=plan.twist[0])
    resting = feedforward(cube, law, force, plan.pose[0], times)
    apart = [np.linalg.norm(m.pose[:, :2] - plan.pose[::100, :2], axis=1) for m in (matched, resting)]
    # Without a tether nothing leads back to the path: inertia, 5 kg on a circle of 1 m at 0.1 m/s, adds up to mm.
    assert apart[0].max() < 5e-3
    # From rest the speed rises as 1 − exp(−γ6 g t), so the way lags by v / (γ6 g).
    assert apart[1][1] == pytest.approx(0.1 / (0.5 * 9.81), rel=0.05)


def test_moved_and_turned_force_gives_the_moved_and_turned_motion(makkar):
    towed = TowedObject(rectangle(0.5, 0.35), 5.8, [-0.05, 0.03], 0.2, [0.25, 0.0])
    frame, times = np.array([2.0, -3.0, 1.1]), np.linspace(0, 2, 21)
    time = np.linspace(0, 2, 41)
    force = np.column_stack([24 + 4 * np.sin(3 * time), 5 * np.cos(2 * time)])
    accuracy = Accuracy(1e-10)
    here = feedforward(towed, makkar, TimedPath(time, force), (0.1, 0.2, 0.3), times, accuracy=accuracy)
    turned = transform([0.0, 0.0, frame[2]], force)
    start = (*transform(frame, np.array([0.1, 0.2])), 0.3 + frame[2])
    there = feedforward(towed, makkar, TimedPath(time, turned), start, times, accuracy=accuracy)
    assert there.pose[:, :2] == pytest.approx(transform(frame, here.pose[:, :2]), abs=1e-8)
    assert there.pose[:, 2] == pytest.approx(here.pose[:, 2] + frame[2], abs=1e-8)


def test_integrator_has_the_order_of_its_method(cube):
    """Error over steps, on a smooth motion: Rodas5P is of order five."""
    time = np.linspace(0, 4, 401)
    force = CubicSpline(time, np.column_stack([20 + 3 * np.sin(2 * time), 4 * np.cos(time)]))
    scene = (cube, Coulomb(0.35, 0.05), force, (0, 0, 0), [0, 4.0])

    def solved(tolerance):
        return feedforward(*scene, start_twist=(0.1, 0.02, 0.1), accuracy=Accuracy(tolerance))

    exact = solved(1e-14).pose[-1]
    loose, tight = solved(1e-8), solved(1e-11)
    errors = [np.abs(motion.pose[-1] - exact).max() for motion in (loose, tight)]
    more_steps = tight.statistics["steps"] / loose.statistics["steps"]
    assert np.log(errors[0] / errors[1]) / np.log(more_steps) == pytest.approx(5, abs=0.5)


def test_sliding_and_spinning_disk_stops_both_at_once():
    angle = 2 * np.pi * np.arange(64) / 64
    mass, radius, law = 2.0, 0.3, Coulomb(0.3, 1e-6)
    patch = Patch(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
    disk = TowedObject(patch, mass, [0, 0], mass * radius**2 / 2, [0, 0])
    motion = coast(disk, law, (0.3, 0, 0.8), np.linspace(0, 0.2, 200_001), accuracy=Accuracy(1e-10))
    speed, spin = np.abs(motion.twist[:, 0]), radius * motion.twist[:, 2]
    late = (speed > 2e-5) & (speed < 5e-5)
    # The ratio is approached as the motion dies out, until the regularisation sets in; 64 corners are not quite a disk.
    assert late.any()
    assert (speed / spin)[late] == pytest.approx(DISK_STOP_RATIO, abs=5e-3)


@pytest.mark.parametrize(("tolerance", "error"), [(1e-6, 1e-5), (1e-7, 1e-6), (1e-9, 1e-7)])
def test_lap_ends_where_the_oracle_says(cube, lap, tolerance, error):
    law, tether, hinge, start = lap
    motion = feedback(cube, law, tether, hinge, start, [0.0, 200.0, 400.0], accuracy=Accuracy(tolerance))
    assert motion.outcome == Outcome.CONVERGED
    assert motion.statistics["mode_changes"] >= 1
    assert motion.pose[-1] == pytest.approx(LAP_FINAL_POSE, abs=error)


def test_stiction_velocity_matters_more_than_the_mesh(cube, lap):
    """From elsewhere: 5 to 6 mm for v_s from 1e-3 to 1e-4 m/s, 0.13 to 0.25 mm for 1,352 cells, on the lap."""
    law, tether, hinge, start = lap
    times = np.linspace(0, 400, 101)
    exact = feedback(cube, law, tether, hinge, start, times).pose[:, :2]
    sharper = feedback(cube, Coulomb(0.35, 1e-4), tether, hinge, start, times).pose[:, :2]
    assert np.linalg.norm(sharper - exact, axis=1).max() == pytest.approx(5.5e-3, abs=1e-3)
    mesh = meshed_patch(mesh_pressure(cube.patch, [(cube.mass * 9.81, (0, 0))], 0.028), law)
    assert len(mesh.area_nodes) == pytest.approx(1352, rel=0.1)
    coarse = feedback(cube, mesh, tether, hinge, start, times).pose[:, :2]
    assert 5e-5 < np.linalg.norm(coarse - exact, axis=1).max() < 5e-4


def test_energy_never_grows_in_free_sliding(cube, makkar):
    rng = np.random.default_rng(2)
    for twist in rng.normal(size=(5, 3)) * (0.3, 0.3, 1.0):
        motion = coast(cube, makkar, twist, np.linspace(0, 1, 201))
        energy = cube.mass * (motion.twist[:, :2] ** 2).sum(1) / 2 + cube.inertia * motion.twist[:, 2] ** 2 / 2
        assert (np.diff(energy) <= 1e-9).all()
        assert energy[-1] < 1e-9


def test_moved_and_turned_scene_gives_the_moved_and_turned_motion(lap, makkar):
    _, tether, hinge, start = lap
    towed = TowedObject(rectangle(0.5, 0.35), 5.8, [-0.05, 0.03], 0.2, [0.25, 0.0])
    times = np.linspace(0, 100, 51)
    accuracy = Accuracy(1e-9)
    here = feedback(towed, makkar, tether, hinge, start, times, accuracy=accuracy)
    frame = np.array([2.0, -3.0, 1.1])
    moved = TimedPath(hinge.time_s, transform(frame, hinge.position))
    there_start = (*transform(frame, np.array(start[:2])), start[2] + frame[2])
    there = feedback(towed, makkar, tether, moved, there_start, times, accuracy=accuracy)
    # Rounding may change a step here or there, so the two agree to a few times what a step is allowed.
    assert there.pose[:, :2] == pytest.approx(transform(frame, here.pose[:, :2]), abs=1e-8)
    assert there.pose[:, 2] == pytest.approx(here.pose[:, 2] + frame[2], abs=1e-8)


def test_tether_force_and_length_are_those_of_the_poses(cube, lap):
    law, tether, hinge, start = lap
    times = np.linspace(0, 400, 41)
    motion = feedback(cube, law, tether, hinge, start, times)
    span = hinge.position[::100] - transform(motion.pose, cube.anchor)
    assert motion.tether_length == pytest.approx(np.linalg.norm(span, axis=1), abs=1e-8)
    assert motion.tether_force == pytest.approx(tether_force(tether, span), abs=1e-5)
    assert (np.linalg.norm(motion.tether_force, axis=1) < 0.4 * 49.05).all()


def test_the_force_of_a_stiffening_tether_is_that_of_the_motion(cube, lap):
    law, _, hinge, start = lap
    tether, times = Tether(0.6, 1000.0, stiffening=0.6, full_load=60.0), np.linspace(0, 40, 21)
    motion = feedback(cube, law, tether, hinge, start, times)
    span = hinge.position[np.searchsorted(hinge.time_s, times)] - transform(motion.pose, cube.anchor)
    assert np.hypot(*motion.tether_force.T).max() > 10
    assert motion.tether_force == pytest.approx(tether_force(tether, span), abs=1e-5)


def test_the_force_of_a_tether_with_mass_is_refused():
    with pytest.raises(InputError, match="with mass does not follow from its span"):
        tether_force(Tether(0.6, 1000.0, mass_per_length=0.1), [0.61, 0.0])


def test_slack_tether_is_named(cube, makkar):
    hinge = TimedPath([0.0, 1.0, 2.0], [[0.3, 0], [0.3, 0.1], [0.3, 0]])
    motion = feedback(cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), [0, 1, 2])
    assert motion.outcome == Outcome.SLACK_ALL_ALONG
    assert (motion.pose == 0).all()
    assert [found.code for found in motion.findings] == ["slack_all_along"]


def test_tightening_is_not_stepped_over(cube, makkar):
    """A hinge at rest for long, then a short pull: the one moment that matters."""
    time = np.linspace(0, 100, 2001)
    away = 0.7 + 0.2 * np.exp(-(((time - 60) / 3.0) ** 2))
    hinge = TimedPath(time, np.column_stack([away, np.zeros_like(away)]))
    motion = feedback(cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), [0, 50, 100])
    assert motion.pose[1, 0] == pytest.approx(0, abs=1e-12)
    # The tether reaches 0.6 m at 0.8 m from the start; the hinge goes to 0.9 m.
    assert 0.08 < motion.pose[2, 0] < 0.11


@pytest.mark.parametrize("relaxation", [0.0, 1.0, 3.8, 10.0])
def test_tightening_is_not_stepped_over_with_high_damping(cube, relaxation):
    """Tugs of 0.6 s with slack in between; at c/κ = 10 s four of six were once stepped over, which cost 40 mm."""
    time = np.linspace(0, 60, 1201)
    within = time % 10
    away = 0.75 - 0.25 * np.sin(np.pi * np.clip((within - 1) / 8.4, 0, 1)) ** 2 + 0.02 * np.floor(time / 10)
    away += np.where(within > 9.4, 0.08 * np.sin(np.pi * (within - 9.4) / 0.6) ** 2, 0)
    hinge = TimedPath(time, np.column_stack([away, np.zeros_like(away)]))
    scene = (cube, Coulomb(0.35, 1e-3), Tether(0.6, 1000, 1000 * relaxation), hinge, (0, 0, 0), np.arange(61.0))
    motion, finer = feedback(*scene), feedback(*scene, accuracy=Accuracy(1e-9))
    assert motion.outcome == Outcome.CONVERGED
    assert finer.statistics["mode_changes"] == 12
    assert motion.pose == pytest.approx(finer.pose, abs=2e-6)


def arc_with_a_stop(stop):
    """Times and places (n, 2) on a circle of 1 m: 20 s at 0.05 m/s, a stop, 20 s more, each with soft ends."""
    t = np.linspace(0, 40 + stop, int((40 + stop) * 50) + 1)

    def rise(t):
        u = np.clip(t, 0, 1)
        return u**3 * (1 - u / 2) + np.maximum(t - 1, 0)

    def leg(t):
        u = np.clip(t, 0, 20)
        return 0.05 * (rise(u) - rise(np.maximum(u - 19, 0)))

    s = leg(t) + leg(t - 20 - stop)
    return t, np.column_stack([np.sin(s), 1 - np.cos(s)])


@pytest.mark.parametrize("stop", [10, 60, 600])
def test_a_stop_given_by_its_two_ends_is_a_stop(cube, stop):
    """One point a second; before the path was split at pauses the object went 10, 81 and 975 mm astray."""
    time, place = arc_with_a_stop(stop)
    whole = np.arange(0, len(time), 50)
    kept = whole[(time[whole] <= 20) | (time[whole] >= 20 + stop)]
    reports = np.linspace(0, 40 + stop, 201)
    scene = (cube, Coulomb(0.35, 1e-3), Tether(0.6, 1000.0, 10.0))
    dense = feedback(*scene, TimedPath(time, place), (-0.8, 0, 0), reports)
    sparse = feedback(*scene, TimedPath(time[kept], place[kept]), (-0.8, 0, 0), reports)
    # What is left is that a point a second does not say when within the second the hinge sets off.
    assert np.linalg.norm(sparse.pose[:, :2] - dense.pose[:, :2], axis=1).max() < 3e-3


def test_matched_start_slides_on_without_a_transient(cube, makkar):
    time = np.linspace(0, 10, 101)
    hinge = TimedPath(time, np.column_stack([0.8 + 0.35 * 49.05 / 1000 + 0.1 * time, np.zeros_like(time)]))
    motion = feedback(cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), time, start_twist=(0.1, 0, 0))
    assert motion.pose[:, 0] == pytest.approx(0.1 * time, abs=5e-5)


def test_step_limit_is_named_and_the_motion_ends_early(cube, lap):
    law, tether, hinge, start = lap
    motion = feedback(
        cube, law, tether, hinge, start, np.linspace(0, 400, 401), accuracy=Accuracy(1e-8, step_limit=200)
    )
    assert motion.outcome == Outcome.STEP_LIMIT
    assert [found.code for found in motion.findings] == ["step_limit"]
    assert 0 < len(motion.time_s) < 401


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"hinge_height": "1"}, "hinge height"),
        ({"hinge_height": np.nan}, "hinge height"),
        ({"hinge_height": None}, "hinge height"),
        ({"accuracy": 1e-7}, "accuracy"),
    ],
)
def test_arguments_of_the_wrong_kind_are_input_errors(given, why, cube, lap):
    law, tether, hinge, start = lap
    with pytest.raises(InputError, match=why):
        feedback(cube, law, tether, hinge, start, [0.0, 1.0], **given)


@pytest.mark.parametrize("height", [0.0, 0.1])
def test_times_of_a_unix_clock_give_the_motion_of_small_times(height, cube, makkar):
    """Stick-slip with slack in between: the seconds of ROS leave no digits for a moment of tightening."""
    time = np.arange(0, 8.01, 0.25)
    hinge = np.column_stack([0.75 + 0.3 * time + 0.15 * np.sin(3 * time), 0.1 * np.sin(time)])
    begun = 1.7e9
    motions = [
        feedback(
            cube, makkar, Tether(0.6, 3000.0), TimedPath(since + time, hinge), (0, 0, 0.3), since + time,
            hinge_height=height,
        )
        for since in (0.0, begun)
    ]  # fmt: skip
    assert motions[1].time_s[-1] == begun + time[-1]
    np.testing.assert_allclose(motions[1].pose, motions[0].pose, atol=2e-8)
    np.testing.assert_allclose(motions[1].tether_length, motions[0].tether_length, atol=2e-8)
    assert motions[1].statistics["steps"] < 1.05 * motions[0].statistics["steps"]
    force = np.column_stack([20 + 4 * np.sin(9 * time), np.zeros_like(time)])
    pushed = [
        feedforward(cube, makkar, TimedPath(since + time, force), (0, 0, 0.3), since + time) for since in (0.0, begun)
    ]
    np.testing.assert_allclose(pushed[1].pose, pushed[0].pose, rtol=1e-8, atol=2e-8)
    np.testing.assert_array_equal(pushed[1].tether_force, pushed[0].tether_force)


def test_times_outside_the_hinges_way_are_refused(cube, lap):
    law, tether, hinge, start = lap
    with pytest.raises(InputError, match="does not cover"):
        feedback(cube, law, tether, hinge, start, [0.0, 401.0])
    with pytest.raises(InputError, match="increasing"):
        feedback(cube, law, tether, hinge, start, [1.0, 0.0])


@pytest.mark.parametrize(("stiffness", "stiction"), [(1e2, 1e-6), (1e3, 1e-5), (1e5, 1e-2), (1e6, 1e-3), (1e6, 1e-6)])
@pytest.mark.parametrize("start", [-0.05, 0.01])
def test_extreme_stiffness_and_stiction_are_right_or_named(cube, stiffness, stiction, start):
    """The corners of studies/tables/physics_stability.py: each was once wrong without a sign of it."""
    time = np.linspace(0, 2, 101)
    advance = 0.1 * time - 0.06 * np.sin(np.pi * time)
    hinge = TimedPath(time, np.column_stack([0.8 + start + advance, 0.05 * advance]))
    scene = (cube, Coulomb(0.35, stiction), Tether(0.6, stiffness), hinge, (0, 0, 0), time[::10])
    motion, reference = feedback(*scene), feedback(*scene, accuracy=Accuracy(1e-10))
    assert reference.outcome == Outcome.CONVERGED
    if motion.outcome == Outcome.CONVERGED:
        assert np.abs(motion.pose - reference.pose).max() < 1e-4
