"""The verdict on all runs of a campaign together, with one joint false alarm rate and shared inputs counted once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from towval.model import Array, Comparison
from towval.model.statement import Verdict, rounded_up
from towval.validation.consequences import excused
from towval.validation.statistics import upper_limit

_SHARED_DRAWS = 0.9
"""Share of the draws that all runs must have in common; with fewer, each run gets a part of the false alarm rate."""


@dataclass(frozen=True)
class CampaignVerdict:
    """The verdict on several runs.

    ``limit``: of the largest ratio of a tested statistic to its own limit, which right models keep in all runs together
    with the confidence asked for; ``runs`` judged; ``beyond``: those above; ``sentence``: the verdict in words.
    """

    verdict: Verdict
    limit: float
    runs: tuple[str, ...]
    beyond: tuple[str, ...]
    sentence: str


def campaign_verdict(comparisons: Sequence[Comparison], confidence: float = 0.99) -> CampaignVerdict:
    """Judge all runs together, with ``confidence`` that a right model keeps the limit in all of them.

    Draw i of every run has the same values of the inputs that they share, so the largest ratio over the runs of draw i
    is one realisation of the campaign; its quantile is the limit that a right model keeps in all runs at once.
    """
    judged = [c for c in comparisons if c.verdict is not Verdict.NOT_JUDGED and len(c.drawn_tests)]
    if not judged:
        return CampaignVerdict(Verdict.NOT_JUDGED, float("nan"), (), (), "No run was judged.")
    ratios = {c.run: c.tested_ratio for c in judged}
    limit = _joint_limit([c.drawn_tests for c in judged], confidence)
    beyond = tuple(run for run, ratio in ratios.items() if ratio > limit)
    mattering = [c.run for c in judged if c.error_upper_m > c.tolerance_m]
    # A run within the tolerance is still open where an assumed value would explain what is detected, and where nothing
    # is detected though faults might not have shown.
    shown = {c.run for c in judged if c.run in beyond or c.detectable_m <= c.tolerance_m}
    unsure = [c.run for c in judged if c.verdict is Verdict.CANNOT_TELL or c.run not in shown]
    bound = rounded_up(1e3 * max(c.error_upper_m for c in judged), 1)
    who = "All runs" if len(judged) == len(comparisons) else "The judged runs"
    level = f"{100 * (1 - confidence):.3g} % false alarms over {len(judged)} run{'s' * (len(judged) != 1)}"
    blamed = [c.run for c in judged if c.run in beyond and c.run in mattering and not excused(c.warnings.split())]
    if blamed:
        verdict = Verdict.DISAGREES
        sentence = f"{who} together disagree ({level}), because of {', '.join(blamed)}"
    elif mattering or unsure:
        verdict = Verdict.CANNOT_TELL
        sentence = f"{who} together leave it open, because of {', '.join(dict.fromkeys([*mattering, *unsure]))}"
    else:
        verdict = Verdict.AGREES
        sentence = f"{who} together agree within {bound:.1f} mm ({level})"
    runs = tuple(c.run for c in judged)
    return CampaignVerdict(verdict, limit, runs, beyond, f"{sentence}.")


def _joint_limit(tests: Sequence[Array], confidence: float) -> float:
    """Limit of the largest ratio over runs, from their draws (k, 2) of key and ratio."""
    by_key = [dict(zip(keys.tolist(), ratios.tolist(), strict=True)) for keys, ratios in (each.T for each in tests)]
    common = set(by_key[0]).intersection(*by_key[1:])
    if len(common) < _SHARED_DRAWS * min(map(len, tests)):
        # Runs that were not drawn together: each gets an equal part of the false alarm rate.
        alone = 1 - (1 - confidence) / len(tests)
        return max(upper_limit(each[:, 1], alone) for each in tests)
    largest = np.array([max(each[key] for each in by_key) for key in sorted(common)])
    return upper_limit(largest, confidence)
