import numpy as np
import pytest

from studies.worlds.scenes import small_camera, standard_scene
from towval.tracking.jumps import jump_findings, stray_std, strays

SCENE = standard_scene(3, **small_camera())
CART = SCENE.target(1)
REACH_M = CART.reach_m
SURE = np.zeros((200, 3, 3))


def allowed_m(step_s):
    return np.full(len(step_s), 0.02)


def arc(n=200):
    """A body on a circle of 0.5 m, its heading along it."""
    time_s = np.cumsum(np.random.default_rng(3).uniform(0.02, 0.06, n))
    angle = 0.4 * time_s
    return time_s, np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), angle + np.pi / 2])


def test_a_constant_twist_leads_to_the_next_pose():
    # What is left is the second order of a step in its own frame, 0.5 m × (0.4 × 0.06)² / 2.
    assert strays(*arc(), REACH_M).max() < 2e-4


@pytest.mark.parametrize("jump", [(0.05, 0.0, 0.0), (0.0, 0.0, 0.2)])
def test_a_jump_is_found_once_and_placed(jump):
    time_s, pose = arc()
    pose[120:] += jump
    (found,) = jump_findings(CART, time_s, pose, SURE, allowed_m)
    assert found.code == "jumped"
    assert "1 times from one picture that shows it to the next" in found.text
    assert f"by up to {1000 * (jump[0] + REACH_M * jump[2]):.0f} mm" in found.text
    assert f"first at {time_s[120]:.2f} s" in found.text


@pytest.mark.parametrize(("hidden_s", "jumped"), [(0.3, True), (1.5, False)])
def test_a_body_that_was_hidden_has_jumped_where_no_acceleration_leads_there_in_that_time(hidden_s, jumped):
    """It is seen again 2 m from where it was going, as where another one is taken for it."""
    time_s = np.arange(0.0, 4.0, 0.04)
    time_s = time_s[(time_s < 2.0) | (time_s > 2.0 + hidden_s)]
    pose = np.column_stack([0.3 * time_s, 0 * time_s, 0 * time_s])
    pose[time_s > 2.0, 1] += 2.0
    found = jump_findings(CART, time_s, pose, np.zeros((len(time_s), 3, 3)), lambda step_s: 0.02 + 5.0 * step_s**2)
    assert [each.code for each in found] == ["jumped"] * jumped


@pytest.mark.parametrize(("std_m", "jumped"), [(0.003, True), (0.02, False)])
def test_poses_that_are_known_to_be_unsure_have_not_jumped(std_m, jumped):
    time_s, pose = arc()
    pose[120] += (0.06, 0.0, 0.0)
    unsure = SURE.copy()
    unsure[118:123] = np.diag([std_m**2, std_m**2, 0.0])
    assert bool(jump_findings(CART, time_s, pose, unsure, allowed_m)) == jumped


def test_the_deviation_of_a_stray_is_that_of_noisy_poses():
    rng = np.random.default_rng(4)
    time_s = 0.04 * np.arange(4000)
    noise = rng.normal(0, [1e-3, 2e-3, 0.0], (4000, 3))
    covariance = np.tile(np.diag([1e-6, 4e-6, 0.0]), (4000, 1, 1))
    measured = np.sqrt(np.mean(strays(time_s, noise, REACH_M) ** 2))
    assert stray_std(time_s, covariance, REACH_M).mean() == pytest.approx(measured, rel=0.05)
