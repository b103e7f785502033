import numpy as np
import pytest

from towval.model.geometry import compose, inverse, transform
from towval.tracking.pose import Motion, moved, robust_rigid_fit, step_between


def test_a_rigid_fit_ignores_outliers():
    rng = np.random.default_rng(0)
    source = rng.uniform(-0.3, 0.3, (60, 2))
    pose = np.array([0.4, -0.2, 1.1])
    target = transform(pose, source) + 1e-4 * rng.standard_normal(source.shape)
    target[:15] += 0.05
    fit = robust_rigid_fit(source, target, 1e-6)
    assert np.allclose(fit.pose, pose, atol=1e-4)
    assert (fit.weights[:15] == 0).all()


def test_its_deviation_is_that_of_the_scatter():
    rng = np.random.default_rng(1)
    source = rng.uniform(-0.3, 0.3, (50, 2))
    pose = np.array([0.4, -0.2, 1.1])
    fits = [
        robust_rigid_fit(source, transform(pose, source) + 1e-3 * rng.standard_normal((50, 2)), 1e-6)
        for _ in range(300)
    ]
    scatter = np.std([fit.pose for fit in fits], axis=0)
    predicted = np.sqrt(np.mean([np.diag(fit.covariance) for fit in fits], axis=0))
    assert predicted == pytest.approx(scatter, rel=0.25)


def test_steps_of_single_poses_are_those_of_the_geometry():
    pose, step = np.array([0.3, -1.2, 4.0]), np.array([0.1, 0.05, -0.4])
    assert np.allclose(moved(pose, step), compose(pose, step))
    assert np.allclose(step_between(pose, moved(pose, step)), step)
    assert np.allclose(step_between(pose, np.zeros(3))[:2], inverse(pose)[:2])


def test_a_constant_twist_is_predicted_exactly_and_headings_unwrap():
    twist = np.array([0.2, 0.05, 2.0])
    motion = Motion(0.0, np.zeros(3))
    pose = np.zeros(3)
    for i in range(1, 60):
        pose = moved(pose, 0.1 * twist)
        if i > 2:
            assert np.allclose(motion.predict(0.1 * i), pose, atol=1e-9)
        seen = pose.copy()
        seen[2] = np.arctan2(np.sin(seen[2]), np.cos(seen[2]))
        motion.observe(0.1 * i, seen)
    assert motion.pose[2] == pytest.approx(59 * 0.2)
