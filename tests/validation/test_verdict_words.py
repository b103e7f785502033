"""What a verdict says in words holds, whatever the digits that are left out."""

import re

import pytest

from towval.model.statement import Bounds, Verdict
from towval.validation.verdict import Evidence, verdict_of

TOLERANCE_M = 0.02


def judged(upper_m=0.01, detectable_m=0.01, tolerance_m=TOLERANCE_M, seen=1.0, moved_m=2.0):
    """The verdict, and its sentence, on a run that is not rejected."""
    bounds = Bounds({"position_max": (0.0, upper_m)}, {"position_max": (0.0, upper_m)})
    tests, limits = {"size": 1.0}, {"size": 2.0}
    verdict, said = verdict_of(
        Evidence(tolerance_m, bounds, tests, limits, detectable_m, seen, moved_m, (), None, {"friction": 0.5}, "")
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


def test_what_is_too_little_to_be_judged_is_less_than_what_is_named():
    assert "moved by 39 mm, less than 2 times the 20 mm that matter" in judged(moved_m=0.0399)[1]
    assert "moved by 35 mm, less than 2 times the 20 mm that matter" in judged(moved_m=0.035)[1]
    assert "seen in 49 % of" in judged(seen=0.4996)[1]
