"""All runs together: false alarms of four right runs, what they share counted once, and whose fault it is."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from towval.commands.report import _together
from towval.model import Severity, Verdict
from towval.validation.campaign import campaign_verdict


def run(name, ratio, tests, upper=0.002, detectable=0.003, verdict=Verdict.AGREES, warnings=""):
    """What the verdict of a campaign reads of a comparison."""
    return SimpleNamespace(
        run=name, verdict=verdict, tested_ratio=ratio, drawn_tests=tests, error_upper_m=upper, tolerance_m=0.01,
        detectable_m=detectable, warnings=warnings,
    )  # fmt: skip


def drawn(seed, shared=0.0, count=512, runs=4):
    """Ratios of draws (runs, count) whose limit alone is one with 99 %, correlated over the runs."""
    rng = np.random.default_rng(seed)
    size = np.sqrt(shared) * rng.normal(size=count) + np.sqrt(1 - shared) * rng.normal(size=(runs, count))
    return np.abs(size) / 2.576


def with_keys(ratios, first=0):
    return np.column_stack([np.arange(first, first + len(ratios), dtype=float), ratios])


def limits(shared, campaigns=60, **keys):
    """Of so many campaigns of four right runs."""
    found = []
    for seed in range(campaigns):
        tests = [with_keys(each) for each in drawn(seed, shared, **keys)]
        found.append(campaign_verdict([run(str(i), 0.1, each) for i, each in enumerate(tests)]).limit)
    return np.array(found)


@pytest.mark.parametrize("count", [256, 512])
def test_four_right_runs_raise_one_false_alarm_in_a_hundred_campaigns_by_the_closed_form(count):
    """Runs that share nothing: the largest of four normal numbers, over all that the draws may be."""
    alarms = 2 * norm.sf(2.576 * limits(0.0, count=count))
    campaigns = 1 - (1 - alarms) ** 4
    assert campaigns.mean() == pytest.approx(0.01, abs=0.0015)


@pytest.mark.parametrize("shared", [0.5, 0.9])
def test_four_right_runs_raise_one_false_alarm_in_a_hundred_campaigns_whatever_they_share(shared):
    """Where runs share nearly all, a limit for each alone would be wrong the other way."""
    fresh = np.sort(drawn(1000, shared, 200_000).max(axis=0))
    alarms = 1 - np.searchsorted(fresh, limits(shared)) / len(fresh)
    assert alarms.mean() == pytest.approx(0.01, abs=0.002)
    assert np.mean(drawn(2, 0.0, 200_000).max(axis=0) > 1) > 0.035  # each run judged by itself


def test_runs_without_common_draws_share_the_false_alarms():
    tests = [with_keys(each, 1000 * i) for i, each in enumerate(drawn(3))]
    limit = campaign_verdict([run(str(i), 0.1, each) for i, each in enumerate(tests)]).limit
    assert np.mean(drawn(4, 0.0, 200_000).max(axis=0) > limit) < 0.02


@pytest.mark.parametrize("shift", [0, 1000])
def test_a_confidence_of_95_percent_is_exceeded_by_a_twentieth_of_the_campaigns(shift):
    """Whether the runs share their draws or not: then the largest of four limits counts, which is on the safe side."""
    tests = [with_keys(each, shift * i) for i, each in enumerate(drawn(7))]
    runs = [run(str(i), 0.1, each) for i, each in enumerate(tests)]
    found = campaign_verdict(runs, 0.95)
    assert 0.02 < np.mean(drawn(8, 0.0, 200_000).max(axis=0) > found.limit) < 0.07
    assert found.limit < campaign_verdict(runs).limit
    assert found.sentence.endswith("(5 % false alarms over 4 runs).")


def test_of_runs_with_unequal_numbers_of_draws_those_that_both_have_count():
    many, few = (with_keys(each) for each in drawn(3, 0.5, runs=2))
    runs = [run("a", 0.5, many), run("b", 0.5, few[:256])]
    same = [run("a", 0.5, many[:256]), run("b", 0.5, few[:256])]
    assert campaign_verdict(runs).limit == campaign_verdict(same).limit


def test_a_run_far_beyond_the_limit_is_named():
    tests = [with_keys(each) for each in drawn(5)]
    runs = [run(name, ratio, each) for name, ratio, each in zip("abcd", (0.5, 0.4, 3.0, 1.01), tests, strict=True)]
    found = campaign_verdict(runs)
    assert found.verdict == Verdict.AGREES  # beyond, but within what matters
    assert found.beyond == ("c",)
    runs[2] = run("c", 3.0, tests[2], upper=0.02)
    found = campaign_verdict(runs)
    assert found.verdict == Verdict.DISAGREES
    assert found.sentence == "All runs together disagree (1 % false alarms over 4 runs), because of c."


def test_a_run_within_the_tolerance_is_not_why_all_disagree():
    tests = [with_keys(each) for each in drawn(5)]
    found = campaign_verdict([run("a", 3.0, tests[0]), run("b", 3.0, tests[1], upper=0.02), run("c", 0.5, tests[2])])
    assert found.beyond == ("a", "b")
    assert found.sentence.endswith("because of b.")  # and a had been named, which agrees by itself


def test_runs_that_were_not_judged_are_not_among_those_that_agree():
    judged = run("a", 0.5, with_keys(drawn(6)[0]))
    found = campaign_verdict([judged, run("b", 0.5, judged.drawn_tests, verdict=Verdict.NOT_JUDGED)])
    assert found.sentence == "The judged runs together agree within 2.0 mm (1 % false alarms over 1 run)."


def test_what_leaves_one_run_open_leaves_the_campaign_open():
    tests = [with_keys(each) for each in drawn(6)]
    runs = [run("a", 0.5, tests[0]), run("b", 0.5, tests[1], detectable=0.02)]
    assert campaign_verdict(runs).verdict == Verdict.CANNOT_TELL
    assert "because of b" in campaign_verdict(runs).sentence
    # Within the tolerance, and faults would show; but an assumed value would explain the difference.
    runs = [run("a", 0.5, tests[0]), run("b", 1.5, tests[1], verdict=Verdict.CANNOT_TELL)]
    found = campaign_verdict(runs)
    assert found.verdict == Verdict.CANNOT_TELL
    assert found.sentence == "All runs together leave it open, because of b."
    runs = [run("a", 0.5, tests[0]), run("b", 9.0, tests[1], verdict=Verdict.NOT_JUDGED)]
    found = campaign_verdict(runs)
    assert (found.verdict, found.runs) == (Verdict.AGREES, ("a",))
    assert campaign_verdict(runs[1:]).verdict == Verdict.NOT_JUDGED


def test_one_run_alone_has_the_verdict_of_its_campaign():
    """A difference that is detected and within the tolerance agrees, whatever faults would show; else that counts."""
    tests = with_keys(drawn(6)[0])
    detected = campaign_verdict([run("a", 3.0, tests, detectable=0.02)])
    assert (detected.verdict, detected.beyond) == (Verdict.AGREES, ("a",))
    assert campaign_verdict([run("a", 0.5, tests, detectable=0.02)]).verdict == Verdict.CANNOT_TELL


def test_the_verdict_of_a_campaign_is_a_finding_of_its_report():
    tests = with_keys(drawn(7)[0])

    def record(*about, confidence=0.99, **more):
        return SimpleNamespace(comparison=run(*about, **more), uncertainty=SimpleNamespace(confidence=confidence))

    found = _together([record("a", 0.5, tests)])
    assert (found.code, found.severity) == ("campaign_verdict", Severity.NOTE)
    assert found.text == "All runs together agree within 2.0 mm (1 % false alarms over 1 run)."
    assert "(5 % false alarms" in _together([record("a", 0.5, tests, confidence=0.95)]).text
    found = _together([record("a", 3.0, tests, upper=0.02)])
    assert found.severity == Severity.WARNING
    assert "disagree" in found.text


def test_a_run_whose_difference_a_finding_may_explain_does_not_let_all_disagree():
    tests = [with_keys(each) for each in drawn(5)]
    others = [run(str(i), 0.1, each) for i, each in enumerate(tests[1:])]
    off = {"upper": 0.03, "verdict": Verdict.CANNOT_TELL}
    excused = campaign_verdict([run("off", 3.0, tests[0], warnings="rate_unconfirmed", **off), *others])
    assert excused.verdict is Verdict.CANNOT_TELL
    assert excused.beyond == ("off",)
    assert "because of off" in excused.sentence
    assert campaign_verdict([run("off", 3.0, tests[0], warnings="low_texture", **off), *others]).verdict is (
        Verdict.DISAGREES
    )
