"""Findings that need a fault which no scene of the other tests has: made from the numbers that call for them."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from studies.worlds.scenes import ceiling
from towval.calibration.calibrate import _lens_findings
from towval.model import Body
from towval.model.errors import InputError
from towval.model.findings import FINDINGS
from towval.physics.dynamics import Outcome
from towval.physics.trailing import _motion
from towval.planning.planner import PlanOutcome, _deviation_findings
from towval.tracking.camera_motion import CameraMotion
from towval.tracking.finished_track import judge_registration
from towval.tracking.outline import judge_clicks

BODY = Body("rover", 0.4, [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])


def test_clicks_that_miss_the_corners_are_reported_and_far_ones_refused():
    assert judge_clicks(BODY, 1.0, 0.005) == []
    assert [found.code for found in judge_clicks(BODY, 8.0, 0.005)] == ["clicks_misfit"]
    with pytest.raises(InputError, match="do not fit its outline"):
        judge_clicks(BODY, 200.0, 0.005)


def test_a_body_without_edges_rests_on_its_clicks():
    followed = SimpleNamespace(start_covariance=4e-6 * np.eye(3), target=SimpleNamespace(body=BODY))
    (found,) = judge_registration(followed, None, np.zeros(2))
    assert found.code == "edges_not_found"
    assert "(2.0 mm)" in found.text


def test_a_plain_floor_does_not_show_a_motion_of_the_camera():
    camera, floor = ceiling((480, 270), focal_px=390.0)
    grey = np.full((270, 480), 128, np.uint8)
    motion = CameraMotion(camera, floor, grey, [BODY], [np.zeros(3)])
    for time_s in range(4):
        motion.register(2.0 * time_s, grey, [np.zeros(3)])
    assert [found.code for found in motion.findings(motion.estimate())] == ["camera_not_watched"]


def test_a_lens_whose_coefficients_cancel_is_reported():
    chosen = SimpleNamespace(model="k1", score_px2=0.04, determined=True, condition=10.0)
    larger = SimpleNamespace(model="rational", score_px2=0.03, determined=False, condition=1e9)
    assert [found.code for found in _lens_findings([chosen, larger], chosen)] == ["lens-undetermined"]
    assert _lens_findings([chosen], chosen) == []


def test_steps_without_a_balance_are_counted():
    motion = _motion("trailing", np.arange(3.0), np.zeros((3, 9)), np.zeros(2), True, 2)
    assert [found.code for found in motion.findings] == ["not_balanced"]
    assert motion.findings[0].text.startswith("At 2 steps")


def test_a_plan_that_cuts_corners_is_reported():
    settings = SimpleNamespace(arrival_distance=0.01)
    plan = SimpleNamespace(outcome=PlanOutcome.ARRIVED, rms=1.0)
    assert [found.code for found in _deviation_findings(plan, settings)] == ["path_not_followed"]


@pytest.mark.parametrize("code", ["slack_all_along", "step_limit", "step_too_small", "not_finite"])
def test_each_early_end_of_an_integration_has_its_finding(code):
    assert code in {str(outcome).replace(" ", "_") for outcome in Outcome if outcome is not Outcome.CONVERGED}
    assert not FINDINGS[code].consequence.judged


def test_every_code_is_in_a_test():
    texts = "".join(path.read_text() for path in Path(__file__).parent.rglob("test_*.py"))
    assert [code for code in FINDINGS if not re.search(f'"{code}"', texts)] == []
