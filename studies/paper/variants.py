"""The claims again with other values of what the paper does not state: for which of them does a claim hold?"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from studies.frame import Part, Row, Settings, Study
from studies.paper.claims import CLAIMS
from studies.paper.controls import tables_of

_MODELS = ("speeds", "time_steps", "feedforward_paths", "starts")
_PLANNER = ("loop", "thresholds")
_SHORT = {
    "mean_speeds_m_s": [0.0051, 0.02, 0.05, 0.1, 0.2],
    "time_steps_s": [0.02, 0.1, 0.5],
    "thresholds_m": [0.02, 0.06, 0.103, 0.14, 0.18, 0.227, 0.28, 0.34, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2],
}


@dataclass(frozen=True)
class Variant:
    """One assumed setting with another value: its name in words, the key of the plan, the value, what to compute."""

    name: str
    key: tuple[str, str]
    value: Any
    studies: tuple[str, ...]


VARIANTS = (
    *(Variant(f"κ = {value:g} N/m", ("tether", "stiffness_n_m"), value, _MODELS) for value in (1e3, 1e4, 1e6)),
    *(Variant(f"wheelbase {value} m", ("rover", "wheelbase_m"), value, _PLANNER) for value in (0.3, 0.5, 0.6)),
    *(Variant(f"close within {value} m", ("planner", "close_distance_m"), value, _PLANNER) for value in (0.1, 0.6)),
    *(Variant(f"cube of {value} m", ("cube", "side_m"), value, (*_MODELS, *_PLANNER)) for value in (0.3, 0.6)),
)
"""Values of the assumed settings. The cube's load and anchor stay where they are."""

_NEEDS = {
    "planner stays in case A": "loop",
    "case B shows in the object's path": "loop",
    "case C shows in the object's path": "loop",
    "case A reaches its point": "loop",
    "realigns after B and C": "loop",
    "feedforward falls with speed": "speeds",
    "feedback flat, hinge at rest length": "speeds",
    "feedback flat, hinge at stretched length": "speeds",
    "time step does not matter": "time_steps",
    "an order of magnitude, hinge at rest length": "time_steps",
    "an order of magnitude, hinge at stretched length": "time_steps",
    "feedforward drift grows": "feedforward_paths",
    "feedforward fails from rest, friction with a peak": "starts",
    "feedforward fails from rest, friction without a peak": "starts",
    "best thresholds": "thresholds",
    "lemniscate is erratic": "thresholds",
    "towing along a path works": "thresholds",
}
"""Claims that are decided again, and the study that each needs."""


def variant_rows(plan: Mapping[str, Any], name: str, studies: list[str]) -> list[Row]:
    """Decide the claims in a changed scene: a row a claim."""
    tables = tables_of(plan, tuple(studies))
    rows: list[Row] = []
    for claim in CLAIMS:
        if _NEEDS.get(claim.name) in studies:
            result, numbers = claim.decide(tables)
            rows.append({"claim": claim.name, "setting": name, "outcome": str(result), "numbers": numbers})
    return rows


def _parts(settings: Settings) -> dict[str, Part]:
    parts: dict[str, Part] = {}
    for number, variant in enumerate(VARIANTS if settings.plan else ()):
        plan = deepcopy(dict(settings.plan))
        plan["sensitivity"] |= _SHORT
        section, key = variant.key
        plan[section][key] = variant.value
        parts[f"{number:02d}"] = {"plan": plan, "name": variant.name, "studies": list(variant.studies)}
    return parts


STUDY = Study(_parts, variant_rows)
