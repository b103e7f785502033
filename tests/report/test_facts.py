"""Numbers of the page that are computed for it."""

from dataclasses import replace

import numpy as np
import pytest

from report_scenes import TOWED, towed_run
from towval.report.facts import metric_facts, middle_rms_m

OFFSET_M = np.array([0.3, 0.4])


def with_error(run, error):
    return replace(run, comparison=replace(run.comparison, error=np.tile(error, (len(run.simulated.pose), 1))))


def test_the_middle_of_a_top_about_its_own_frame_is_off_like_the_frame():
    run = with_error(towed_run(), [0.003, 0.004, 0.02])
    assert middle_rms_m(run) == pytest.approx(0.005, rel=1e-9)


def test_a_turn_moves_the_middle_by_its_distance_from_the_frame():
    """The chord of an arc of 0.02 rad at half a metre, wherever the object is."""
    run = with_error(towed_run(), [0.0, 0.0, 0.02])
    beside = replace(run, towed=replace(TOWED, top_corners_m=TOWED.top_corners_m + OFFSET_M))
    assert middle_rms_m(beside) == pytest.approx(2 * 0.5 * np.sin(0.01), rel=1e-9)
    assert middle_rms_m(run) == 0


def test_frames_without_a_pose_are_left_out_and_the_page_names_the_measure():
    run = with_error(towed_run(), [0.003, 0.004, 0.0])
    error = run.comparison.error.copy()
    error[5:9] = np.nan
    run = replace(run, comparison=replace(run.comparison, error=error))
    assert middle_rms_m(run) == pytest.approx(0.005, rel=1e-9)
    assert dict(metric_facts(run))["Path RMS of the middle of the top, which the paper compares, mm"] == "5.00"
