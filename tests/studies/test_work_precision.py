import importlib.util

import numpy as np
import pytest

from studies.comparators import work_precision as study
from studies.comparators.tow_scenes import lap_scene, stick_slip_scene
from towval.model.errors import InputError

JERKS = stick_slip_scene(duration=14.0)


def rows_of(method, tolerances):
    return study.work_precision_rows(JERKS, tolerances, (method,))


def test_object_sticks_and_slips():
    motion = study.feedback(JERKS.towed, JERKS.patch, JERKS.tether, JERKS.hinge, JERKS.start_pose, JERKS.times)
    speed = np.hypot(*motion.twist[:, :2].T)
    assert motion.outcome == "converged"
    assert speed.max() > 0.1  # ten times the tether's end
    assert np.mean(speed < 1e-3) > 0.3


def test_tighter_tolerances_cost_more_calls_and_leave_less_error():
    loose, tight = rows_of(study.ROSENBROCK, (1e-5, 1e-9))
    assert tight["error_m"] < 0.01 * loose["error_m"]
    assert tight["rate_calls"] > loose["rate_calls"]
    assert loose["cpu_s"] > 0


@pytest.mark.parametrize("method", [study.RADAU, study.CVODE])
def test_other_integrators_come_to_the_same_motion(method):
    """The reference is our integrator's; that others agree with it is what makes it one."""
    if method == study.CVODE:
        pytest.importorskip("sksundae", reason="an optional peer to compare with: pip install 'towval[bench]'")
    (row,) = rows_of(method, (1e-10,))
    assert row["outcome"] == "converged"
    assert row["error_m"] < 1e-5


def test_missing_solver_is_skipped_with_the_reason(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    (row,) = rows_of(study.CVODE, (1e-6,))
    assert row["outcome"] == "skipped: scikit-sundae is not installed"
    assert np.isnan(row["error_m"])


def test_unknown_integrator_is_an_input_error():
    with pytest.raises(InputError, match="Euler"):
        rows_of("Euler", (1e-6,))


@pytest.mark.parametrize("scene", [lap_scene(), JERKS])
def test_jacobian_is_the_derivative_of_the_rates(scene):
    problem = study._Problem(scene)
    state = problem.start + np.array([-0.01, 0.003, 0.05, 0.02, -0.01, 0.1])
    exact = problem.jacobian(1.0, state, np.empty((6, 6)))
    step = 1e-6 * np.eye(6)
    above = [problem.rates(1.0, state + e, np.empty(6)) for e in step]
    below = [problem.rates(1.0, state - e, np.empty(6)) for e in step]
    numeric = (np.array(above) - np.array(below)).T / 2e-6
    assert exact == pytest.approx(numeric, abs=1e-5 * np.abs(numeric).max())
