"""The scene of the paper's figures: that of a plan, and what only the paper's figures need beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from studies.frame import Part, Row, Settings, Study
from towval.model import FrictionSpecification, TowedObject
from towval.planning.scene import PlanScene, friction_of, object_with_load, plan_scene

CURVES = ("line", "circle", "lemniscate", "rounded_square")
"""The four curves in the order of Fig. 4."""


@dataclass(frozen=True)
class PaperScene(PlanScene):
    """What all of the paper's figures share.

    ``general`` objects by the name of their centre of mass; ``peaked_friction`` the specification of another law, with
    a peak; ``time_step`` [s] of the nominal paths.
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
            name: object_with_load(shape["outline_m"], shape["mass_kg"], centre, shape["anchor_m"])
            for name, centre in shape["centres_of_mass_m"].items()
        },
        peaked_friction=friction_of(plan["peaked_friction"]),
        time_step=plan["quasi_static"]["time_step_s"],
    )


def paper_study(parts: Callable[[Mapping[str, Any]], dict[str, Part]], rows: Callable[..., list[Row]]) -> Study:
    """A study in the paper's scene.

    Parameters
    ----------
    parts : callable
        From the plan to the parts by name.
    rows : callable
        From the :class:`PaperScene` and the entries of one part to its rows.
    """

    def parts_in_scene(settings: Settings) -> dict[str, Part]:
        return {name: {"scene": settings.scene, **part} for name, part in parts(settings.plan).items()}

    def rows_in_scene(scene: Mapping[str, Any], **part: Any) -> list[Row]:
        return rows(paper_scene(scene), **part)

    return Study(parts_in_scene, rows_in_scene)
