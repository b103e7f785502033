"""Checks of the charts of outcomes: what runs end with, setting by setting of a stage, and with a planted fault."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pandas as pd

from studies import end_to_end
from studies.charts import outcome_summary
from studies.costs import Cost
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from studies.frame import REFUSED, Settings, Study
from studies.tradeoff import outcomes
from studies.tradeoff.outcomes import LONGER_M, Variant
from towval.model import Verdict

_COUNTS = {
    "agrees": str(Verdict.AGREES),
    "refused": REFUSED,
    "wrong model disagrees": f"wrong_{Verdict.DISAGREES}",
    "bound held": "held",
    "wrong model, bound held": "wrong_held",
}


def _ends(study: Study) -> Callable[[], Values]:
    """By setting: bound and error [mm] with their quartiles, costs over the default's, and numbers of campaigns."""

    def measure() -> Values:
        parts = study.parts(Settings()).values()
        summary = outcome_summary(pd.DataFrame([row for part in parts for row in study.rows(**part)]))
        default = summary[summary["default"]].iloc[0]
        found: dict[str, float] = {"default, CPU": float(default.cost)}
        for setting, row in summary.iterrows():
            for name, column in (("bound", "bound"), ("largest error", "off")):
                found |= {
                    f"{setting}, {name}, median": float(row[column]),
                    f"{setting}, {name}, lower quartile": float(row[f"{column}_low"]),
                    f"{setting}, {name}, upper quartile": float(row[f"{column}_high"]),
                }
            found |= {f"{setting}, {name}": float(row[column]) for name, column in _COUNTS.items()}
            found[f"{setting}, CPU over the default's"] = float(row["cost"] / default["cost"])
            found[f"{setting}, CPU of the stage over the default's"] = float(row["stage_cost"] / default["stage_cost"])
        return found

    return measure


def _default_slower(original: Any) -> Any:
    """What makes an outcome, where all stages take ten times as long by default."""

    def wrong(pipeline: Any, variant: Variant, *rest: Any) -> Any:
        outcome, result = original(pipeline, variant, *rest)
        if result is not None and variant == Variant(variant.series):
            costs = {stage: Cost(10 * each.cpu_s, each.wall_s) for stage, each in result.costs.items()}
            result = replace(result, costs=costs)
        return outcome, result

    return wrong


def _shorter(original: Any) -> Any:
    """What states a longer tether, where the program takes every tether to be as much shorter."""
    return lambda scene, by_m: original(scene, by_m - LONGER_M)


def _ignored(original: Any) -> Any:
    """What makes an outcome, deaf to the setting."""
    return lambda pipeline, variant, *rest: original(pipeline, Variant(variant.series), *rest)


_FAULTS = {
    "tethers are taken to be 14 mm shorter than stated, bounds are a third, the default's clock counts tenfold": both(
        replaced(end_to_end, "stated_longer", _shorter),
        replaced(end_to_end, "compare", result_of(lambda found: replace(found, error_upper_m=found.error_upper_m / 3))),
        replaced(outcomes, "_outcome", _default_slower),
    ),
    "settings are not heeded, the default is taken": replaced(outcomes, "_outcome", _ignored),
}

TRACKER = Check(_ends(outcomes.TRACKER), _FAULTS)
DECIMATION = Check(_ends(outcomes.DECIMATION), _FAULTS)
CALIBRATION = Check(_ends(outcomes.CALIBRATION), _FAULTS)
RUNG = Check(_ends(outcomes.RUNG), _FAULTS)
