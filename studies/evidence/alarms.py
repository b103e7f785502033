"""Checks of how often right runs and campaigns of them are rejected, on normal numbers and on draws of filmed runs."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import norm

from studies.evidence.filmed import filmed
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced
from towval.model import Array, Verdict
from towval.validation import campaign, statistics
from towval.validation.sampler import UncertaintySettings
from towval.validation.uncertainty import UncertaintySampling

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
    return np.array([_limit(keys, _drawn(seed, shared, count)) for seed in range(_CAMPAIGNS)])


def _limit(keys: Array, drawn: Sequence[Array] | Array) -> float:
    """The limit of a campaign from the ratios (n,) of each of its runs in the draws with these keys (n,)."""
    runs: Any = [
        SimpleNamespace(
            run=str(i), verdict=Verdict.AGREES, tested_ratio=0.1, drawn_tests=np.column_stack([keys, ratios]),
            error_upper_m=0.002, tolerance_m=0.01, detectable_m=0.003, warnings="",
        )
        for i, ratios in enumerate(drawn)
    ]  # fmt: skip
    return campaign.campaign_verdict(runs).limit


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


_DRAWS, _HALVINGS = 512, 10


def _filmed() -> Values:
    """Shares of draws of lab_a's runs beyond limits from as many others [%], alone and together, over the halvings."""
    runs = {}
    for _, case in filmed("lab_a", "abcd"):
        sampling = UncertaintySampling(case, UncertaintySettings(samples=_DRAWS))
        known = sampling.describe(_DRAWS)
        path = sampling.on_path(known)
        if path is not None and known.draws is not None and len(path.drawn) == _DRAWS:
            runs[case.run] = path.drawn, known.draws.inputs, known.confidence
    beyond: dict[str, list[float]] = {}
    for seed in range(_HALVINGS):
        kept, fresh = np.split(np.random.default_rng(seed).permutation(_DRAWS), 2)
        known_ratios, new_ratios = [], []
        for run, (drawn, inputs, confidence) in runs.items():
            right = statistics.RightModel.of(drawn[kept], inputs[kept], confidence)
            known_ratios.append((right.drawn / right.limits).max(axis=1))
            new_ratios.append((right.statistics(drawn[fresh]) / right.limits).max(axis=1))
            beyond.setdefault(f"run {run}", []).append(float(np.mean(new_ratios[-1] > 1)))
        largest = np.max(new_ratios, axis=0)
        beyond.setdefault("campaign", []).append(float(np.mean(largest > _limit(kept.astype(float), known_ratios))))
        beyond.setdefault("campaign, each run by itself", []).append(float(np.mean(largest > 1)))
    found = {name: 100 * float(np.mean(shares)) for name, shares in beyond.items()}
    together = beyond["campaign"]
    return found | {"campaign, least": 100 * min(together), "campaign, most": 100 * max(together)}


def _lower(original: Any) -> Any:
    return lambda values, confidence: original(values, 1 - 3 * (1 - confidence))


FILMED = Check(
    _filmed,
    {
        "limits are exceeded three times as often as is said": both(
            replaced(campaign, "upper_limit", _lower), replaced(statistics, "upper_limit", _lower)
        )
    },
    needs=("footage/lab_a",),
)
