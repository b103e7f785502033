import numpy as np
import pytest
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
from towval.errors import InputError
from towval.geometry import transform
from towval.physics.dynamics import Accuracy, Outcome, feedback, feedforward
from towval.physics.friction_law import coulomb_law
from towval.physics.tether import tether_force
from towval.types import Patch, Path, Tether, TowedObject

NO_FORCE = Path([0.0, 1000.0], np.zeros((2, 2)))


def coast(towed, law, twist, times, **options):
    return feedforward(towed, law, NO_FORCE, (0, 0, 0), times, start_twist=twist, **options)


def test_coasting_down_has_the_closed_form(cube):
    law = coulomb_law(COAST["mu"], COAST["v_s"])
    motion = coast(cube, law, (COAST["v0"], 0, 0), [0.0, COAST["t"], 2.0], accuracy=Accuracy(1e-12))
    assert coast_speed(**COAST) == pytest.approx(COAST_SPEED, abs=1e-12)
    assert motion.outcome == Outcome.CONVERGED
    assert motion.twist[1, 0] == pytest.approx(COAST_SPEED, abs=1e-10)
    assert motion.pose[1:, 0] == pytest.approx([COAST_DISTANCE, COAST_REST_DISTANCE], abs=1e-11)


def test_sliding_and_spinning_disk_stops_both_at_once():
    angle = 2 * np.pi * np.arange(64) / 64
    mass, radius, law = 2.0, 0.3, coulomb_law(0.3, 1e-6)
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
    moved = Path(hinge.time_s, transform(frame, hinge.position))
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


def test_slack_tether_is_named(cube, makkar):
    hinge = Path([0.0, 1.0, 2.0], [[0.3, 0], [0.3, 0.1], [0.3, 0]])
    motion = feedback(cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), [0, 1, 2])
    assert motion.outcome == Outcome.SLACK_ALL_ALONG
    assert (motion.pose == 0).all()
    assert motion.findings


def test_tightening_is_not_stepped_over(cube, makkar):
    """A hinge at rest for long, then a short pull: the one moment that matters."""
    time = np.linspace(0, 100, 2001)
    away = 0.7 + 0.2 * np.exp(-(((time - 60) / 3.0) ** 2))
    hinge = Path(time, np.column_stack([away, np.zeros_like(away)]))
    motion = feedback(cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), [0, 50, 100])
    assert motion.pose[1, 0] == pytest.approx(0, abs=1e-12)
    # The tether reaches 0.6 m at 0.8 m from the start; the hinge goes to 0.9 m.
    assert 0.08 < motion.pose[2, 0] < 0.11


def test_matched_start_slides_on_without_a_transient(cube, makkar):
    time = np.linspace(0, 10, 101)
    hinge = Path(time, np.column_stack([0.8 + 0.35 * 49.05 / 1000 + 0.1 * time, np.zeros_like(time)]))
    motion = feedback(cube, makkar, Tether(0.6, 1000), hinge, (0, 0, 0), time, start_twist=(0.1, 0, 0))
    assert motion.pose[:, 0] == pytest.approx(0.1 * time, abs=5e-5)


def test_step_limit_is_named_and_the_motion_ends_early(cube, lap):
    law, tether, hinge, start = lap
    motion = feedback(
        cube, law, tether, hinge, start, np.linspace(0, 400, 401), accuracy=Accuracy(1e-8, step_limit=200)
    )
    assert motion.outcome == Outcome.STEP_LIMIT
    assert 0 < len(motion.time_s) < 401


def test_times_outside_the_hinges_way_are_refused(cube, lap):
    law, tether, hinge, start = lap
    with pytest.raises(InputError, match="does not cover"):
        feedback(cube, law, tether, hinge, start, [0.0, 401.0])
    with pytest.raises(InputError, match="increasing"):
        feedback(cube, law, tether, hinge, start, [1.0, 0.0])


@pytest.mark.parametrize(("stiffness", "stiction"), [(1e2, 1e-6), (1e3, 1e-5), (1e5, 1e-2), (1e6, 1e-3), (1e6, 1e-6)])
@pytest.mark.parametrize("start", [-0.05, 0.01])
def test_extreme_stiffness_and_stiction_are_right_or_named(cube, stiffness, stiction, start):
    """The corners of benchmarks/physics_stability.py: each was once wrong without a sign of it."""
    time = np.linspace(0, 2, 101)
    advance = 0.1 * time - 0.06 * np.sin(np.pi * time)
    hinge = Path(time, np.column_stack([0.8 + start + advance, 0.05 * advance]))
    scene = (cube, coulomb_law(0.35, stiction), Tether(0.6, stiffness), hinge, (0, 0, 0), time[::10])
    motion, reference = feedback(*scene), feedback(*scene, accuracy=Accuracy(1e-10))
    assert reference.outcome == Outcome.CONVERGED
    if motion.outcome == Outcome.CONVERGED:
        assert np.abs(motion.pose - reference.pose).max() < 1e-4
