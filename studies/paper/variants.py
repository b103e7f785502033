"""The claims again with other values of what the paper does not state: for which of them does a claim hold?"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from studies.frame import Part, Row, Settings, Study
from studies.paper.claims import CLAIMS
from studies.paper.controls import tables_of

_FEEDBACK, _FEEDFORWARD = ("speeds", "time_steps"), ("feedforward_paths", "starts")
_MODELS = (*_FEEDBACK, *_FEEDFORWARD)
_PLANNER = ("loop", "thresholds")
_SHORT = {
    "mean_speeds_m_s": [0.0051, 0.02, 0.05, 0.1, 0.2],
    "time_steps_s": [0.02, 0.1, 0.5],
    "surface_thresholds_m": [0.02, 1.5, 12],
    "surface_look_aheads_steps": [0, 600, 13],
    "surface_blocks": 1,
}
"""Sweeps of the variants, in place of those of the plan. The surface's is such that 350 steps are in it."""


@dataclass(frozen=True)
class Variant:
    """One assumed setting with another value: its name in words, the key of the plan, the value, what to compute."""

    name: str
    key: tuple[str, str]
    value: Any
    studies: tuple[str, ...]


VARIANTS = (
    *(Variant(f"κ = {value:g} N/m", ("tether", "stiffness_n_m"), value, _FEEDBACK) for value in (1e3, 1e4, 1e6)),
    Variant("κ = 1000 N/m", ("tether", "stiffness_n_m"), 1e3, _PLANNER),
    *(
        Variant(f"tether of {value} m", ("tether", "rest_length_m"), value, (*_FEEDBACK, *_PLANNER))
        for value in (0.4, 1.0)
    ),
    Variant("load in the middle", ("cube", "centre_of_mass_m"), [0.0, 0.0], (*_MODELS, *_PLANNER)),
    Variant("load at (-0.1, 0.1) m", ("cube", "centre_of_mass_m"), [-0.1, 0.1], (*_MODELS, *_PLANNER)),
    *(Variant(f"wheelbase {value} m", ("rover", "wheelbase_m"), value, (*_PLANNER, "surface")) for value in (0.3, 0.5)),
    *(Variant(f"track {value} m", ("rover", "track_m"), value, _PLANNER) for value in (0.3, 0.5)),
    *(
        Variant(f"close within {value} m", ("planner", "close_distance_m"), value, (*_PLANNER, "surface"))
        for value in (0.1, 0.6)
    ),
    *(
        Variant(f"look-ahead {value} steps", ("planner", "look_ahead_steps"), value, ("thresholds",))
        for value in (250, 450)
    ),
    *(
        Variant(f"look-ahead {value} steps", ("closed_loop", "look_ahead_steps"), value, ("loop",))
        for value in (50, 200)
    ),
    Variant("planner's step 0.2 s", ("planner", "time_step_s"), 0.2, ("surface",)),
)
"""Values of the assumed settings; the cube's side is the paper's.

None has friction with a peak along whole paths, on which the object sticks and slips and a run takes minutes: claims
that stand on friction without one say so.
"""

_DYNAMIC = ("κ", "tether")
"""Settings that feedforward dynamics know nothing of: its claims are not decided again with them."""

_OF_FEEDFORWARD = ("feedforward falls with speed", "feedforward is accurate when slow")
"""Claims about feedforward in tables that hold feedback as well."""

_NEEDS = {
    **dict.fromkeys(
        (
            "planner stays in case A",
            "detours are where it is tight",
            "case B shows in the object's path",
            "case C shows in the object's path",
            "case A reaches its point",
            "realigns after case B",
            "realigns after case C",
        ),
        "loop",
    ),
    **dict.fromkeys(
        (*_OF_FEEDFORWARD, "feedback flat, hinge at rest length", "feedback flat, hinge at stretched length"), "speeds"
    ),
    **dict.fromkeys(
        (
            "time step does not matter",
            "an order of magnitude, hinge at rest length",
            "an order of magnitude, hinge at stretched length",
        ),
        "time_steps",
    ),
    **dict.fromkeys(("feedforward drift grows", "feedforward at reasonable speed"), "feedforward_paths"),
    "feedforward fails from rest, friction with a peak": "starts",
    "feedforward fails from rest, friction without a peak": "starts",
    **dict.fromkeys(
        (
            "best thresholds",
            "thresholds above 0.4 m are worse",
            "thresholds below 0.1 m are worse",
            "lemniscate is erratic",
            "far centres break the controller",
            "towing along a path works",
        ),
        "thresholds",
    ),
    **dict.fromkeys(
        (
            "look-ahead pre-empts turns",
            "feasible areas",
            "errors of the surfaces, where both arrive",
            "errors of the surfaces, over all that arrive",
            "feasible look-aheads",
            "orientation must be planned",
        ),
        "surface",
    ),
}
"""Claims that are decided again, and the study that each needs."""


def variant_rows(plan: Mapping[str, Any], name: str, studies: list[str]) -> list[Row]:
    """Decide the claims in a changed scene: a row a claim."""
    tables = tables_of(plan, tuple(studies))
    rows: list[Row] = []
    for claim in CLAIMS:
        untouched = claim.name in _OF_FEEDFORWARD and name.startswith(_DYNAMIC)
        if _NEEDS.get(claim.name) in studies and not untouched:
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
