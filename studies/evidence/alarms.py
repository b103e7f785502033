"""Check of how often a campaign of right runs is rejected, on normal numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import norm

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced
from towval.model import Array, Verdict
from towval.validation import campaign

_CAMPAIGNS, _RUNS, _FRESH = 200, 4, 200_000
_ALONE = float(norm.ppf(0.995))


def _drawn(seed: int, shared: float, count: int) -> Array:
    """Ratios (4, n) of draws whose limit alone is one with 99 %, of which the runs share a part of the variance."""
    rng = np.random.default_rng(seed)
    common, own = rng.normal(size=count), rng.normal(size=(_RUNS, count))
    ratios: Array = np.abs(np.sqrt(shared) * common + np.sqrt(1 - shared) * own) / _ALONE
    return ratios


def _limits(shared: float, count: int) -> Array:
    """The limits (200,) of campaigns of four right runs."""
    keys = np.arange(count, dtype=float)
    found = []
    for seed in range(_CAMPAIGNS):
        runs: Any = [
            SimpleNamespace(
                run=str(i), verdict=Verdict.AGREES, tested_ratio=0.1, drawn_tests=np.column_stack([keys, ratios]),
                error_upper_m=0.002, tolerance_m=0.01, detectable_m=0.003,
            )
            for i, ratios in enumerate(_drawn(seed, shared, count))
        ]  # fmt: skip
        found.append(campaign.campaign_verdict(runs).limit)
    return np.array(found)


def _alarms() -> Values:
    """Shares of right campaigns that are rejected [%], averaged over the limits."""
    found: dict[str, float] = {}
    for count in (256, 512):
        alone = 2 * norm.sf(_ALONE * _limits(0.0, count))
        found[f"nothing, limits from {count} draws, closed form"] = 100 * float(np.mean(1 - (1 - alone) ** _RUNS))
    for name, shared in {"half of the variance": 0.5, "nine tenths": 0.9}.items():
        fresh = np.sort(_drawn(1000, shared, _FRESH).max(axis=0))
        beyond = 1 - np.searchsorted(fresh, _limits(shared, 512)) / len(fresh)
        found[f"{name}, from 512 draws, 200,000 campaigns"] = 100 * float(beyond.mean())
    return found


ALARMS = Check(
    _alarms,
    {
        "a campaign's limit is that of each run alone": replaced(
            campaign, "_joint_limit", lambda _: lambda *_args: 1.0
        ),
        "the limit is exceeded by one campaign in eighty": replaced(
            campaign, "upper_limit", lambda original: lambda values, confidence: original(values, 0.9875)
        ),
    },
)
