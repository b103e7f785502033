"""The scene of the paper's figures: that of a plan, and what only the paper's figures need beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from towval.model import FrictionSpecification, TowedObject
from towval.planning.scene import PlanScene, friction_of, plan_scene, towed_object

CURVES = ("line", "circle", "lemniscate", "rounded_square")
"""The four curves in the order of Fig. 4."""


@dataclass(frozen=True)
class PaperScene(PlanScene):
    """What all of the paper's figures share.

    ``general`` objects by the name of their centre of mass; ``peaked_friction`` the numbers of another law, with a
    peak; ``time_step`` [s] of the nominal paths.
    """

    general: dict[str, TowedObject]
    peaked_friction: FrictionSpecification
    time_step: float


def paper_scene(plan: Mapping[str, Any]) -> PaperScene:
    """Build the scene from a ``plan.yaml`` that its schema has checked."""
    shared = plan_scene(plan)
    shape = plan["general_object"]
    return PaperScene(
        **{field.name: getattr(shared, field.name) for field in fields(shared)},
        general={
            name: towed_object(shape["outline_m"], shape["mass_kg"], centre, shape["anchor_m"])
            for name, centre in shape["centres_of_mass_m"].items()
        },
        peaked_friction=friction_of(plan["peaked_friction"]),
        time_step=plan["quasi_static"]["time_step_s"],
    )
