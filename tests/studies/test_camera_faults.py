import cv2
import numpy as np
import pandas as pd
import pytest

from studies.camera_faults import light, optics, timing
from studies.camera_faults.faults import FAULTS
from studies.camera_faults.film import Film
from studies.camera_faults.trial import MARGIN_M, covered_if_off, lateness_s, outcomes, pose_errors, reported_if_lost
from towval.model import Track, TrackStatus
from towval.model.findings import FINDINGS

WIDTH, HEIGHT, COUNT = 640, 360, 60


@pytest.fixture
def film():
    rng = np.random.default_rng(0)
    floor = cv2.GaussianBlur(rng.uniform(0, 255, (HEIGHT, WIDTH)).astype(np.float32), (0, 0), 3)
    floor = np.clip(128 + 8 * (floor - floor.mean()), 0, 255).astype(np.uint8)

    def picture(i):
        luma = floor.copy()
        luma[10:200, 20 + 6 * i : 100 + 6 * i] = 250
        return luma

    return Film(
        np.arange(COUNT) / 25,
        picture,
        lambda _i: np.full((2, HEIGHT // 2, WIDTH // 2), 128, np.uint8),
        (500.0, 320.0, 180.0, -0.05),
    )


def place(luma):
    """Left edge of the white body."""
    return int(np.argmax((luma[10:200] == 250).all(axis=0)))


def test_each_fault_is_reported_by_findings_that_exist():
    assert {code for fault in FAULTS for code in fault.named_by} <= set(FINDINGS)
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) > 30


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault.film], ids=lambda fault: fault.name)
def test_each_fault_in_a_film_grows_with_its_strength(film, fault):
    def change(strength):
        made = fault.film(film, strength, np.random.default_rng(1))
        last = min(len(made), len(film))
        stamped = np.abs(made.time_s[:last] - film.time_s[:last]).sum() + abs(len(made) - len(film))
        shown = sum(cv2.absdiff(made.picture(i), film.picture(i)).mean() for i in range(15, last, 5))
        return stamped + shown

    kinds = not fault.unit and fault.strengths == (1, 2, 3)
    weak, _, strong = (change(strength) for strength in fault.strengths)
    assert weak > 0
    assert kinds or strong > weak


def test_pictures_are_lost_under_even_stamps(film):
    made = timing.dropped(film, 10, np.random.default_rng(2))
    assert len(made) == COUNT - 6
    assert np.allclose(np.diff(made.time_s), 0.04)
    steps = np.diff([place(made.picture(i)) for i in range(len(made))])
    assert steps.sum() == 6 * (len(steps) + (steps - 6).sum() // 6)
    assert 4 <= (steps - 6).sum() // 6 <= 6, "one that was lost last does not show"


def test_a_knock_shifts_the_middle_of_the_picture_for_good(film):
    made = optics.knock(film, 30, np.random.default_rng(3))
    middle = np.s_[100:260, 220:420]
    for i, shifted in ((20, 0.0), (59, 30 * film.px)):
        found = cv2.matchTemplate(made.picture(i), film.picture(i)[middle], cv2.TM_CCOEFF_NORMED)
        _, _, _, (u, v) = cv2.minMaxLoc(found)
        assert np.hypot(u - 220, v - 100) == pytest.approx(shifted, abs=1.5)


def test_a_banner_stands_still_over_what_moves(film):
    made = light.banner(film, 6, np.random.default_rng(0))
    rows = np.flatnonzero((made.picture(0) != film.picture(0)).any(axis=1))
    assert 10 < rows.mean() < 200
    assert np.array_equal(made.picture(0)[rows], made.picture(40)[rows])


def test_poses_are_wrong_beyond_three_deviations_and_a_margin():
    truth = pd.DataFrame({"t_s": [0.0, 1.0], "rover_x_m": 0.0, "rover_y_m": 0.0, "rover_heading_rad": 0.0})
    pose = np.array([[1e-3, 0, 0], [3e-3, 0, 0], [0, 0, 0.02], [np.nan] * 3])
    covariance = np.tile(np.diag([1e-6, 1e-8, 1e-6]), (4, 1, 1))
    covariance[3] = np.nan
    status = np.array([TrackStatus.TRACKED] * 3 + [TrackStatus.LOST], dtype=np.uint8)
    ones = np.ones(4)
    own = (pose, covariance, status, ones, ones, np.eye(3))
    track = Track("rover", np.linspace(0, 1, 4), *own, total_covariance=covariance)
    over, off = pose_errors(track, truth)
    assert off == pytest.approx([1e-3, 3e-3, 0])
    assert over[:2] == pytest.approx([1e-3 / (3e-3 + MARGIN_M), 3e-3 / (3e-3 + MARGIN_M)])
    assert over[2] > 1


def test_outcomes_are_told_apart():
    named = ("stamps_uneven",)
    assert outcomes(0.9, set(), "agrees", named) == ("corrected", "corrected")
    assert outcomes(1.1, {"stamps_uneven"}, "not judged", named) == ("reported", "reported")
    assert outcomes(1.1, {"low_texture"}, "cannot tell", named) == ("silently wrong", "reported")
    assert outcomes(0.9, set(), "disagrees", named) == ("corrected", "silently wrong")
    assert outcomes(np.nan, set(), "refused: too few views", named) == ("reported", "reported")


def test_poses_that_are_far_off_within_their_deviations_are_covered_and_not_corrected():
    assert [covered_if_off("corrected", rms_mm) for rms_mm in (0.4, 1.9, 2.0, 110.0)] == [
        "corrected", "corrected", "covered", "covered",
    ]  # fmt: skip
    assert covered_if_off("reported", 110.0) == "reported"


def test_poses_that_are_lost_are_not_corrected():
    outcomes_of = ("corrected", "covered", "reported", "silently wrong")
    assert [reported_if_lost(each, 0.5) for each in outcomes_of] == list(outcomes_of)
    assert [reported_if_lost(each, 0.6) for each in outcomes_of] == ["reported"] * 3 + ["silently wrong"]


def test_one_fault_plants_nothing():
    assert [fault.name for fault in FAULTS if fault.is_none] == ["none"]


def drawn(pose, time_s):
    """The track of a rover at poses (n, 3), sure to a tenth of a millimetre."""
    covariance, ones = np.tile(1e-8 * np.eye(3), (len(time_s), 1, 1)), np.ones(len(time_s))
    status = np.full(len(time_s), TrackStatus.TRACKED, dtype=np.uint8)
    return Track("rover", time_s, pose, covariance, status, ones, ones, np.eye(3), total_covariance=covariance)


def gone(time_s):
    """Way of a body that speeds up after a rest [m]."""
    return 0.1 * np.maximum(time_s - 1, 0) ** 1.5


@pytest.fixture
def tow():
    time_s = np.arange(100) / 25
    truth = pd.DataFrame({"t_s": time_s, "rover_x_m": gone(time_s), "rover_y_m": 0.0, "rover_heading_rad": 0.0})
    return time_s, truth, np.zeros((100, 2))


@pytest.mark.parametrize("off_m", [0.0, 0.004, -0.004])
def test_a_clock_that_begins_late_is_no_fault(tow, off_m):
    time_s, truth, still = tow
    late = drawn(np.column_stack([gone(time_s - 0.03), still]), time_s)
    off = drawn(np.column_stack([gone(time_s - 0.03) + off_m, still]), time_s)
    late_s = lateness_s([off], truth)
    assert late_s == pytest.approx(0.03, rel=0.02)
    assert pose_errors(late, truth)[1].max() > 5e-3
    assert pose_errors(late, truth, late_s)[1].max() < 2e-4


@pytest.mark.parametrize(("scale", "off_m"), [(1.005, 0.0), (1.0, -0.002), (1.005, -0.002)])
def test_neither_an_error_of_scale_nor_one_of_place_is_a_delay(tow, scale, off_m):
    time_s, truth, still = tow
    noise = np.random.default_rng(0).normal(0, 1e-5, 100)
    track = drawn(np.column_stack([scale * gone(time_s) + off_m + noise, still]), time_s)
    assert lateness_s([track], truth) == 0.0
