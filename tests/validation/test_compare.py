"""Comparison: known errors, known verdicts, the place of a fault, missing frames."""

import re
from dataclasses import replace

import numpy as np
import pytest

from towval.model import Draws, Explanation, Finding, RunUncertainty, Severity, SimulatedMotion, Verdict, VisibleFault
from towval.model.errors import InputError, RefusedError
from towval.validation.compare import CompareSettings, compare

N = 240
LENGTH_M = 2.4


def straight(time_s):
    """2.4 m along the floor's y axis in 9.6 s."""
    return np.stack([0 * time_s, 0.25 * time_s, np.full_like(time_s, np.pi / 2)], axis=1)


@pytest.fixture
def measured(make_track):
    return make_track(straight, body="object", duration_s=9.6, std=(1e-9, 1e-9, 1e-9))


def simulated(measured, error):
    time_s = measured.time_s
    zero = np.zeros((N, 3))
    return SimulatedMotion(
        time_s,
        straight(time_s) + error,
        np.tile([0.0, 0.25, 0.0], (N, 1)),
        zero[:, :2],
        zero[:, 0],
        "converged",
        "",
        "dynamics",
        statistics={"u_num_m": 1e-6, "u_tolerance_m": 1e-6},
    )


def known(level=1e-3, seed=0):
    """A model whose error is one unknown shift and turn, and a little wandering."""
    rng = np.random.default_rng(seed)
    draws = rng.normal(size=(500, 1, 3)) * level + rng.normal(size=(500, N, 3)).cumsum(axis=1) * level / 50
    covariance = np.einsum("kni,knj->nij", draws, draws) / 500
    measured = rng.normal(size=(500, N, 3)) * 1e-4
    kept = Draws(np.arange(N), draws, measured, np.empty((500, 0)), {})
    faults = (VisibleFault("rest length", 5 * level, "m", 5 * level, 6 * level, 0.3),)
    return RunUncertainty(
        np.arange(N) / 25, covariance / 4, covariance, covariance, 0.99, {}, 500, 0, draws=kept, faults=faults
    )


def test_a_constant_shift_is_measured_exactly(measured):
    result = compare("a", simulated(measured, np.array([0.003, 0.004, 0.01])), measured, known(level=0.01))
    assert result.path_rms_m == pytest.approx(5e-3, rel=1e-5)
    assert result.path_max_m == pytest.approx(5e-3, rel=1e-5)
    assert result.heading_rms_rad == pytest.approx(0.01, rel=1e-5)
    assert result.path_length_m == pytest.approx(LENGTH_M, abs=0.02)
    # The path runs along y: the shift along it is y, across it (to the left) is −x.
    np.testing.assert_allclose(result.along_across[10], [0.004, -0.003], atol=1e-8)


def test_an_object_that_was_seen_in_one_frame_is_not_judged(make_track):
    """Its path has no best rigid motion, and the stage ended in words of that."""
    once = make_track(straight, body="object", duration_s=9.6, lost=range(1, N))
    result = compare("a", simulated(once, np.array([0.003, 0.004, 0.0])), once, known())
    assert result.verdict == Verdict.NOT_JUDGED
    assert result.final_error_m == pytest.approx(0.005, abs=1e-3)
    assert np.isnan(result.aligned_rms_m)


def test_a_small_error_agrees(measured):
    result = compare("a", simulated(measured, np.array([0.001, 0.0005, 0.0])), measured, known())
    assert result.verdict == Verdict.AGREES
    assert result.u_val_m == pytest.approx(result.u_input_m, rel=1e-12)
    (reason,) = (each.text for each in result.findings if each.code == "verdict")
    # No input was drawn: none is said to have been tested.
    assert re.search(r"\(size 0\.\d of at most \d\.\d, shape \d\.\d of at most \d\.\d\)", reason), reason


def test_an_error_that_begins_under_way_is_found_there(measured):
    """From 1.2 m on, 8 mm to the side: under the run's own uncertainty of its constant part, but not of its changes."""
    error = np.zeros((N, 3))
    error[N // 2 :, 0] = 0.008
    settings = CompareSettings(tolerance_m=0.005)
    result = compare("a", simulated(measured, error), measured, known(level=4e-3), settings)
    assert result.verdict == Verdict.DISAGREES
    assert result.shape_statistic > result.shape_limit
    text = next(finding.text for finding in result.findings if finding.code == "verdict")
    begin, end = (float(word.rstrip("m")) for word in text.split("between ")[1].split(" m of")[0].split(" m and "))
    assert begin <= 1.25
    assert end >= 1.15
    assert end - begin < 0.5
    assert "-8.0 mm across" in text


def test_no_fault_under_a_huge_uncertainty_is_no_agreement(measured):
    result = compare(
        "a", simulated(measured, np.zeros(3)), measured, known(level=0.05), CompareSettings(resolution_m=0.02)
    )
    assert result.verdict == Verdict.CANNOT_TELL
    assert result.detectable_m == pytest.approx(0.25)


def test_a_fault_beyond_a_huge_uncertainty_is_still_a_fault(measured):
    error = np.zeros((N, 3))
    error[N // 2 :, 0] = 0.5
    assert compare("a", simulated(measured, error), measured, known(level=0.05)).verdict == Verdict.DISAGREES


def test_an_error_between_the_times_of_the_draws_counts_in_the_bounds(measured):
    """Draws of a long run are kept at some of its times; an error of a second between two of them was not in them."""
    error, known_at_some = np.zeros((N, 3)), known()
    draws = known_at_some.draws
    rows = np.arange(0, N, 8)
    kept = replace(draws, rows=rows, error=draws.error[:, rows], measurement=draws.measurement[:, rows])
    error[81:88, 0] = 0.05
    result = compare("a", simulated(measured, error), measured, replace(known_at_some, draws=kept))
    assert result.path_max_m == pytest.approx(0.05, rel=1e-3)
    assert result.error_upper_m > result.path_max_m
    assert result.model_error_upper_m > result.path_max_m
    assert result.verdict == Verdict.CANNOT_TELL
    (reason,) = (each.text for each in result.findings if each.code == "verdict")
    assert "between the times that were tested" in reason


def test_a_start_that_leads_off_by_what_matters_is_not_judged(measured):
    """A quarter of the tolerance: 2 mm of 5 are too much, of 20 they are not."""
    motion = simulated(measured, np.zeros(3))
    motion = replace(motion, statistics={**motion.statistics, "start_off_m": 2e-3})
    fine, coarse = (compare("a", motion, measured, known(), CompareSettings(tolerance_m=at)) for at in (5e-3, 2e-2))
    assert (fine.verdict, coarse.verdict) == (Verdict.NOT_JUDGED, Verdict.AGREES)
    assert any("Begin the video while all bodies rest" in each.text for each in fine.findings)


def test_lost_frames_take_no_part_and_are_told(make_track):
    track = make_track(straight, body="object", duration_s=9.6, std=(1e-9,) * 3, lost=range(50, 60))
    error = np.zeros((N, 3))
    error[50:60] = 1.0
    result = compare("a", simulated(track, error), track, known())
    assert result.path_max_m < 1e-6
    assert result.lost_frames == 10
    assert "compare_lost" in {finding.code for finding in result.findings}


@pytest.mark.parametrize(
    ("hidden", "shift", "turn", "verdict"),
    [
        (range(100, 130), 0.03, 0.0, Verdict.CANNOT_TELL),
        (range(100, 130), 0.004, 0.3, Verdict.CANNOT_TELL),
        ((), 0.03, 0.0, Verdict.DISAGREES),
        (range(60, 90), 0.03, 0.0, Verdict.DISAGREES),
    ],
    ids=["moved while hidden", "turned while hidden", "in sight", "hidden at another time"],
)
def test_a_difference_that_came_about_while_the_object_was_hidden_may_be_somebodys(
    make_track, hidden, shift, turn, verdict
):
    """A person hides the object for a second and moves it: the right model disagreed."""
    track = make_track(straight, body="object", duration_s=9.6, std=(1e-9,) * 3, lost=hidden)
    error = np.zeros((N, 3))
    error[115:] = shift, 0.0, turn
    # The turned object goes on elsewhere.
    error[115:, 0] += turn * 0.05 * np.linspace(0, 1, N - 115)
    result = compare("a", simulated(track, error), track, known(), CompareSettings(tolerance_m=0.01))
    assert result.verdict == verdict
    said = [each.text for each in result.findings if each.code == "changed_unseen"]
    assert len(said) == (verdict == Verdict.CANNOT_TELL)
    assert all(text.startswith("Most of the difference came about between 3.96 and 5.20 s") for text in said)


def test_a_difference_that_grows_is_not_excused_by_a_gap(make_track):
    """A wrong model is off by more and more, before, during and after a second in which a hand hid the object."""
    track = make_track(straight, body="object", duration_s=9.6, std=(1e-9,) * 3, lost=range(100, 130))
    error = np.zeros((N, 3))
    error[:, 0] = np.linspace(0, 0.06, N)
    result = compare("a", simulated(track, error), track, known(), CompareSettings(tolerance_m=0.01))
    assert result.verdict == Verdict.DISAGREES


def test_frames_without_a_simulation_are_counted(make_track):
    track = make_track(straight, body="object", duration_s=10.0, std=(1e-9,) * 3)
    motion = simulated(make_track(straight, body="object", duration_s=9.6, std=(1e-9,) * 3), np.zeros(3))
    found = {finding.code: finding.text for finding in compare("a", motion, track, known()).findings}
    assert found["compare_cut"].startswith("10 measured frames")


def test_nothing_seen_is_refused(make_track):
    track = make_track(straight, body="object", duration_s=9.6, lost=range(N))
    with pytest.raises(RefusedError, match="cannot be compared"):
        compare("a", simulated(track, np.zeros(3)), track, known())


def test_settings_out_of_range_are_refused():
    with pytest.raises(InputError, match=r"compare\.resolution_m"):
        CompareSettings(resolution_m=0)
    with pytest.raises(InputError, match="former name"):
        CompareSettings(resolution_m=0.02, tolerance_m=0.02)
    with pytest.raises(InputError, match="bound_confidence"):
        CompareSettings(bound_confidence=1.0)


def test_a_difference_too_small_to_matter_is_reported_as_that(measured):
    """Ten deviations, a millimetre: detected, and of no importance."""
    result = compare("a", simulated(measured, np.array([0.001, 0, 0])), measured, known(level=1e-4))
    assert result.size_statistic > result.size_limit
    assert result.verdict == Verdict.AGREES
    assert result.error_upper_m < 0.0015
    assert "a difference is detected" in text_of(result, "verdict")


def test_a_large_error_within_wide_deviations_is_no_agreement(measured):
    """Of 29 mm where 20 matter, and inputs may well do that: neither agreement nor disagreement."""
    vague = replace(known(level=0.02), faults=())
    result = compare("a", simulated(measured, np.array([0.029, 0, 0])), measured, vague)
    assert result.verdict == Verdict.CANNOT_TELL
    assert result.error_upper_m == pytest.approx(0.029, abs=5e-4)
    assert result.model_error_lower_m == 0


def test_a_default_tolerance_is_said_and_a_stated_one_is_not(measured):
    still = simulated(measured, np.zeros(3))
    assert text_of(compare("a", still, measured, known()), "tolerance_default")
    stated = compare("a", still, measured, known(), CompareSettings(tolerance_m=0.02))
    assert not text_of(stated, "tolerance_default")
    assert (stated.tolerance_m, stated.tolerance_stated) == (0.02, True)


def test_findings_that_forbid_a_verdict_do(measured):
    """Upstream, in the track and in the simulation alike; a note forbids nothing."""
    moved = Finding(Severity.WARNING, "edges_not_found", "the edges are not there")
    still = simulated(measured, np.zeros(3))
    result = compare("a", still, measured, replace(known(), upstream=(moved,)))
    assert result.verdict == Verdict.NOT_JUDGED
    assert "Not judged: the edges are not there" in text_of(result, "verdict")
    assert "edges_not_found" in result.warnings.split()
    assert compare("a", still, replace(measured, findings=(moved,)), known()).verdict == Verdict.NOT_JUDGED
    note = replace(known(), upstream=(replace(moved, severity=Severity.NOTE),))
    assert compare("a", still, measured, note).verdict == Verdict.AGREES


def test_a_motion_of_which_less_than_half_was_seen_is_not_judged(make_track):
    track = make_track(straight, body="object", duration_s=9.6, std=(1e-9,) * 3, lost=range(100, 230))
    result = compare("a", simulated(track, np.zeros(3)), track, known())
    assert result.verdict == Verdict.NOT_JUDGED
    assert result.seen_share == pytest.approx(110 / 240)


def test_an_object_that_hardly_moved_is_not_judged(measured):
    result = compare(
        "a", simulated(measured, np.zeros(3)), measured, known(), CompareSettings(tolerance_m=1.5 * LENGTH_M)
    )
    assert result.verdict == Verdict.NOT_JUDGED
    assert "moved by" in text_of(result, "verdict")


def text_of(result, code):
    return " ".join(each.text for each in result.findings if each.code == code)


def test_the_reason_of_a_rejection_names_the_inputs(measured):
    """Drawn errors come from one input, a shift along; the run has eight of its deviations."""
    rng = np.random.default_rng(5)
    inputs = rng.normal(size=(500, 1))
    draws = np.zeros((500, N, 3))
    draws[:, :, 1] = 5e-3 * inputs
    draws += 1e-4 * rng.normal(size=draws.shape)
    names = {"rest_length": 1}
    explanation = Explanation({"rest_length": -8.0}, True, 0.04, 0.001)
    one = replace(known(), draws=Draws(np.arange(N), draws, 0.01 * draws, inputs, names), explanation=explanation)
    result = compare("a", simulated(measured, np.array([0, 0.04, 0])), measured, one)
    assert result.verdict == Verdict.DISAGREES
    assert "rest length (tether.rest_length_std_m) -8" in text_of(result, "explanation")
    stated = text_of(result, "statement")
    assert "of what happened all along" in stated
    # The RMS stands last: before bounds of the largest error it was read as theirs, and was smaller than they.
    assert stated.index("in heading") < stated.index("RMS")


@pytest.mark.parametrize(("assumed", "verdict"), [(True, Verdict.CANNOT_TELL), (False, Verdict.AGREES)])
def test_a_difference_below_the_tolerance_is_no_agreement_where_a_guess_explains_it(measured, assumed, verdict):
    error = np.zeros((N, 3))
    error[N // 2 :, 0] = 0.015
    guess = Explanation({"hinge_height": 7.0}, True, 0.01, 0.001, assumed=("hinge_height",) * assumed)
    result = compare("a", simulated(measured, error), measured, replace(known(), explanation=guess))
    assert result.tested_ratio > 1
    assert result.error_upper_m < result.tolerance_m
    assert result.verdict == verdict
    named = "height of the hinge (rover.tether_hinge_height_m)"
    assert (named in text_of(result, "verdict")) == assumed
    assert named in text_of(result, "explanation")


def test_what_explains_an_error_best_is_named_where_inputs_may_have_made_it(measured):
    static = Explanation({"static_friction": -5.5}, True, 0.02, 0.001)
    wide = replace(known(level=0.05), explanation=static)
    result = compare("a", simulated(measured, np.array([0.03, 0, 0])), measured, wide)
    assert result.verdict == Verdict.CANNOT_TELL
    assert "static friction (friction.static_std) -5.5 deviations" in text_of(result, "verdict")
