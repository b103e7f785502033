"""What a verdict says in words holds, whatever the digits that are left out."""

import re

import pytest

from towval.model.statement import Bounds, Verdict
from towval.validation.verdict import Evidence, verdict_of

TOLERANCE_M = 0.02


def judged(
    upper_m=0.01, detectable_m=0.01, tolerance_m=TOLERANCE_M, seen=1.0, moved_m=2.0, largest_m=float("nan"),
    size=1.0, excusing=(), u_num_m=0.0,
):  # fmt: skip
    """The verdict, and its sentence, on a run that is rejected where ``size`` is above 2."""
    bounds = Bounds({"position_max": (0.0, upper_m)}, {"position_max": (0.0, upper_m)})
    tests, limits = {"size": size}, {"size": 2.0}
    verdict, said = verdict_of(
        Evidence(
            tolerance_m,
            bounds,
            tests,
            limits,
            detectable_m,
            seen,
            moved_m,
            (),
            None,
            {"friction": 0.5},
            "",
            (),
            largest_m,
            excusing=excusing,
            u_num_m=u_num_m,
            u_val_m=0.01,
        )
    )
    return verdict, said.text


@pytest.mark.parametrize("upper_m", [0.01, 0.0200004, 0.0204, 0.02049])
@pytest.mark.parametrize("detectable_m", [0.01, 0.0200004, 0.0204, 0.02049])
def test_with_the_tolerance_that_is_named_it_would_agree(upper_m, detectable_m):
    verdict, said = judged(upper_m, detectable_m)
    if max(upper_m, detectable_m) <= TOLERANCE_M:
        assert verdict is Verdict.AGREES
        return
    assert verdict is Verdict.CANNOT_TELL
    named = [float(length) for length in re.findall(r"(?:off by up to|only from|agree if only) ([0-9.]+) mm", said)]
    assert len(named) == 2 + (min(upper_m, detectable_m) > TOLERANCE_M)
    assert all(length > 1e3 * TOLERANCE_M for length in named)
    as_stated = float(f"{max(named)}e-3")
    assert judged(upper_m, detectable_m, as_stated)[0] is Verdict.AGREES


def test_no_tolerance_is_promised_where_the_visible_faults_are_not_known():
    verdict, said = judged(0.03, float("nan"))
    assert verdict is Verdict.CANNOT_TELL
    assert "hardly any fault would have shown" in said
    assert "would agree" not in said


@pytest.mark.parametrize(("u_num_m", "simulated"), [(0.006, False), (0.008, True)])
def test_a_simulation_that_is_too_coarse_is_told_and_not_a_measurement(u_num_m, simulated):
    verdict, said = judged(0.03, 0.03, u_num_m=u_num_m)
    assert verdict is Verdict.CANNOT_TELL
    assert said.endswith("simulate.rung_tolerance_m, for u_num is 8.0 mm.") == simulated
    assert judged(u_num_m=u_num_m) == judged()


def test_what_is_too_little_to_be_judged_is_less_than_what_is_named():
    assert "moved by 39 mm, less than 2 times the 20 mm that matter" in judged(moved_m=0.0399)[1]
    assert "moved by 35 mm, less than 2 times the 20 mm that matter" in judged(moved_m=0.035)[1]
    assert "seen in 49 % of" in judged(seen=0.4996)[1]


def test_a_bound_that_is_cited_is_not_below_the_bound():
    """2.24 mm were "within 2.2 mm"."""
    assert "Agrees within 2.3 mm, where 20 mm matter" in judged(upper_m=0.00224)[1]


@pytest.mark.parametrize(
    ("upper_m", "detectable_m", "largest_m", "bound", "inputs"),
    [
        (0.03, 0.01, 0.005, True, False),  # The measurement alone makes the bound: friction known better is no help.
        (0.03, 0.03, 0.005, True, True),
        (0.03, 0.01, 0.025, False, True),
        (0.01, 0.03, 0.005, False, True),
    ],
)
def test_what_to_measure_better_is_what_the_reason_depends_on(upper_m, detectable_m, largest_m, bound, inputs):
    said = judged(upper_m, detectable_m, largest_m=largest_m)[1]
    assert ("calibration, heights of the tops and camera.readout_s" in said) == bound
    assert ("friction (friction.kinetic_std)" in said) == inputs


def test_a_difference_that_a_finding_may_explain_is_not_held_against_the_model():
    assert judged(upper_m=0.03, size=3.0)[0] is Verdict.DISAGREES
    verdict, said = judged(upper_m=0.03, size=3.0, excusing=("Nothing confirms the rate. State camera.fps.", "other"))
    assert verdict is Verdict.CANNOT_TELL
    assert said.endswith("which may come from this: Nothing confirms the rate. State camera.fps.")
    # Within the tolerance a difference does not matter, whatever it comes from.
    assert judged(upper_m=0.01, size=3.0, excusing=("x",))[0] is Verdict.AGREES
    assert judged(upper_m=0.01, excusing=("x",))[0] is Verdict.AGREES
