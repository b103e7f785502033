"""Numbers of the page that are computed for it."""

from dataclasses import replace

import numpy as np
import pytest

from report_scenes import TOWED, ceiling_calibration, towed_run
from towval.model import CameraTrack, Stamp, Verdict
from towval.model.results import START_OFF, STICKING
from towval.report.facts import (
    calibration_facts,
    deciding,
    metric_facts,
    middle_rms_m,
    scale_facts,
    simulation_facts,
    tracking_facts,
)
from towval.report.wording import NOT_COMPUTED

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


def test_a_statistic_that_could_not_be_anything_but_zero_is_no_test_that_was_passed():
    """As with few draws, where no effect of an input is sought."""
    run = with_error(towed_run(), [0.003, 0.004, 0.0])
    tested = {"size_statistic": 1.0, "size_limit": 2.0, "shape_statistic": 3.0, "shape_limit": 4.0}
    nothing = {"input_statistic": 0.0, "input_limit": 1e-9}
    run = replace(run, comparison=replace(run.comparison, **tested, **nothing, verdict=Verdict.AGREES))
    assert "Effect of one input" not in [name for name, _, _ in deciding(run.comparison)]
    assert [share for name, _, share in deciding(run.comparison) if name.endswith("the error")] == [0.5, 0.75]
    said = dict(metric_facts(run))
    assert said["One input's effect, in deviations, and limit"] == NOT_COMPUTED
    assert said["Shape of the error, in deviations, and limit"] == "3.00 / 4.00"


def test_nothing_decides_a_run_that_is_not_judged():
    """Beside "none: not judged" a green bar had said "Error at most 3.1 of 20.0 mm", as what decides."""
    known = {"error_upper_m": 0.0031, "detectable_m": 0.005, "tolerance_m": 0.02}
    run = replace(towed_run().comparison, **known, verdict=Verdict.AGREES)
    assert [name for name, _, _ in deciding(run)] == ["Error at most", "Faults seen from"]
    assert deciding(replace(run, verdict=Verdict.NOT_JUDGED)) == ()


def test_scale_and_motion_of_the_camera_are_stated():
    run, full = towed_run(), ceiling_calibration()
    n = len(run.rover_track.time_s)
    picture = np.outer(np.linspace(0, 1, n), [3.0, -4.0, np.deg2rad(0.5), -0.02])
    stamps = np.zeros(n, dtype=np.uint8)
    stamps[[20, 90, 91]] = Stamp.REPEATED, Stamp.CONTRADICTED, Stamp.CONTRADICTED
    std = np.full((n, 4), 0.03)
    camera = CameraTrack(full.camera, full.floor, np.zeros((n, 9)), picture, std, stamps, -0.0033, 0.0011)
    watched = replace(run, rover_track=replace(run.rover_track, camera=camera))
    said = dict(tracking_facts(watched))
    assert said["camera: its own motion"] == (
        "picture shifted by up to 5.00 px (± 0.042 px), turned by 0.50°, grown by 2.00 %; corrected"
    )
    still = replace(camera, picture=1e-17 * picture)
    of_still = replace(run, rover_track=replace(run.rover_track, camera=still))
    assert dict(tracking_facts(of_still))["camera: its own motion"] == (
        "none found (picture shifted by 0 ± 0.042 px); nothing corrected"
    )
    assert said["camera: stamps"] == "1 repeated, 2 contradicted, of 200"
    assert scale_facts((watched, run)) == (("Tops in run a, measured − stated size", "−0.33 ± 0.11 %"),)
    board = {"board_size_percent": 0.021, "board_size_std_percent": 0.05, "board_bow_mm": -0.5, "board_bow_std_mm": 0.0}
    known = dict(calibration_facts(replace(full, quality=full.quality | board)))
    assert known["Board, measured − stated size"] == "+0.02 ± 0.050 %"
    assert not any("bow" in name for name in known)


def test_statistics_of_a_simulation_have_names_that_say_what_they_are():
    """The page said "U tolerance", "Start off", and of the friction at rest 0 or 1."""
    run = towed_run()
    statistics = {"u_tolerance_m": 2e-6, START_OFF: 0.003, STICKING: 1.0}
    facts = dict(simulation_facts(replace(run, simulated=replace(run.simulated, statistics=statistics))))
    assert facts["of it, by the tolerance of a step"] == "0.0020 mm"
    assert facts["motion of the object at the start: path moves by up to"] == "3.00 mm"
    assert facts["friction holds the object at rest"] == "yes"
