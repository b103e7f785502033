"""Negative controls of the ledger: a planted fault with which a claim's check must not hold.

Each control replaces one function of the package or of the studies, computes the tables that the claim needs anew, and
decides the claim on them: what a wrong program would have given. Where a claim is not reproduced, it is what a program
that was given something else would have. Sweeps are shorter than the paper's, as the check allows.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any
from unittest.mock import patch

import pandas as pd

from studies.frame import Part, Row, Settings, Study, loaded
from studies.paper import closed_loop, dynamics, finite_volumes, further, law_shapes, meshes, nominal, planted
from studies.paper.claims import CLAIMS
from studies.registry import PAPER
from towval.physics import quasistatic
from towval.physics.friction_laws import makkar
from towval.planning import planner
from towval.planning import scene as plan_scene

Plan = dict[str, Any]

_SHORT = {
    "mean_speeds_m_s": [0.0051, 0.02, 0.07, 0.2],
    "time_steps_s": [0.02, 0.5],
    "stiffnesses_n_m": [1e3, 1e4, 1e5, 1e6],
    "thresholds_m": [0.02, 0.04, 0.06, 0.08, 0.103, 0.14, 0.2, 0.227, 0.25, 0.4, 0.5, 0.7, 1.0, 1.2],
    "wheelbases_m": [0.4],
    "surface_thresholds_m": [0.1, 1.5, 6],
    "surface_look_aheads_steps": [0, 600, 7],
    "surface_blocks": 1,
}
"""Sweeps of the controls, in place of those of the plan."""


class Place(enum.StrEnum):
    """Where a fault is planted."""

    PROGRAM = "in the program"
    """In a function of the package, or of a model of the studies beside it, that computes what is judged."""
    INPUT = "in what the program is given"
    RESULT = "in the result read"
    """After the computation: shows that the check can fail, not that it notices a wrong program."""


@dataclass(frozen=True)
class Control:
    """A planted fault.

    ``claim`` whose check must fail; ``fault`` in words; ``target``, a function or constant as ``module.name``, and
    ``wrong``, from it to what takes its place; ``studies`` to compute with it; ``place`` of the fault.
    """

    claim: str
    fault: str
    target: str
    wrong: Callable[[Any], Any]
    studies: tuple[str, ...]
    place: Place = Place.PROGRAM


def _names(module: Any, function: str) -> str:
    return f"{module.__name__}.{function}"


_LOOP, _LOOP_ROW, _CLOSE = (_names(closed_loop, name) for name in ("planned_loop", "loop_row", "close_loop"))
_FEEDBACK, _FEEDFORWARD = _names(dynamics, "feedback"), _names(dynamics, "feedforward")
_FLANKS, _DRIVE, _LAW = _names(planner, "flanks"), _names(planner, "_drive"), _names(plan_scene, "fitted_law")

CONTROLS = (
    Control(
        "planar forces leave the pressure", "the equations in space have anchor and hinge 0.1 m higher",
        _names(quasistatic, "tow_problem"), planted.anchor_higher, ("further/plane",),
    ),
    Control(
        "contact converges", "the iteration ends at a residual of 0.19, after two passes",
        _names(finite_volumes, "_RESIDUAL_LIMIT"), lambda _: 0.19, ("contact",),
    ),
    Control(
        "continuity of the friction law", "the equation of motion lets friction rise over 0.1 mm/s, whatever the law",
        _names(law_shapes, "equation_of_motion"), planted.friction_rises, ("further/law_shapes",),
    ),
    Control(
        "law meets its four numbers", "the law is fitted to twice the friction velocity",
        _names(makkar, "_fit"), planted.twice_the_friction_velocity, ("further/law",),
    ),
    Control(
        "friction by direction", "the wrench leaves out by how much friction differs with the direction",
        _names(further, "friction_wrench"), planted.without_direction, ("further/direction",),
    ),
    Control(
        "limits make the rover deviate", "the planner's centres are those of a rover without steering limits", _FLANKS,
        planted.limits_forgotten, ("further/limits",),
    ),
    Control(
        "smaller areas of feasible centres", "the areas are those of the smaller of a wheel's two steering limits",
        _names(further, "feasible_pieces"), planted.narrow_steering, ("further/areas",),
    ),
    Control(
        "centre moves within an area", "both flanks are taken for one", _names(further, "feasible_piece"),
        planted.either_flank, ("further/areas",),
    ),
    Control(
        "four-wheel control misaligns", "steering angles leave out how far a wheel is from the rover's middle line",
        _names(further, "steering_of_twist"), planted.in_line, ("further/steered",),
    ),
    Control(
        "settings of Fig. 5 stress the method", "the planner takes threshold and look-ahead to be 0.14 m and 350 steps",
        _CLOSE, planted.planner_reads(threshold=0.14, look_ahead_steps=350), ("loop", "thresholds"),
    ),
    Control(
        "centre of mass matters", "the pressure is that of a centre of mass in the middle of the footprint",
        _names(nominal, "resting_pressure"), planted.load_in_the_middle, ("nominal",),
    ),
    Control(
        "planner stays in case A", "the rover is taken to turn five times as tightly as it can", _FLANKS,
        planted.tighter_by(5.0), ("loop",),
    ),
    Control(
        "detours are where it is tight", "the rover is taken to turn a hundred times as tightly as it can", _FLANKS,
        planted.tighter_by(100.0), ("loop",),
    ),
    *(
        Control(
            f"case {letter} shows in the object's path", "the object is towed along the nominal path of the hinge",
            _CLOSE, planted.towed_as_planned, ("loop",),
        )
        for letter in "BC"
    ),
    Control(
        "case A reaches its point", "the planner takes the hinge to be 0.02 m ahead of where it is",
        _DRIVE, planted.hinge_elsewhere(0.02, 0.0), ("loop",),
    ),
    *(
        Control(
            f"realigns after case {letter}", "the planner takes the hinge to be 0.3 m to the left of where it is",
            _DRIVE, planted.hinge_elsewhere(0.0, 0.3), ("loop",),
        )
        for letter in "BC"
    ),
    Control(
        "deviation is small at small time steps", "the planner takes the hinge to be 0.3 m to the left of where it is",
        _DRIVE, planted.hinge_elsewhere(0.0, 0.3), ("planner_steps", "thresholds"),
    ),
    Control(
        "mesh sets the computing time", "the mesh is the coarsest, whatever size of its cells is asked for",
        _names(meshes, "mesh_pressure"), planted.one_mesh, ("meshes",),
    ),
    Control(
        "feedforward falls with speed", "the dynamics apply 2 % more force than they are given", _FEEDFORWARD,
        planted.too_strong, ("speeds",),
    ),
    Control(
        "feedforward is accurate when slow", "the dynamics leave out the object's inertia", _FEEDFORWARD,
        planted.without_inertia, ("speeds",),
    ),
    Control(
        "feedback flat, hinge at rest length", "the dynamics have the hinge where it was 0.1 s ago", _FEEDBACK,
        planted.hinge_late(0.1), ("speeds",),
    ),
    Control(
        "time step does not matter", "the dynamics apply 4 % more force for each second of the time step", _FEEDFORWARD,
        planted.stronger_by_the_step, ("time_steps",),
    ),
    Control(
        "an order of magnitude, hinge at rest length", "the dynamics take the stiffness for that in N/cm", _FEEDBACK,
        planted.tether_taken(lambda stiffness: 100 * stiffness), ("time_steps",),
    ),
    Control(
        "stiffer is closer, hinge at rest length", "the dynamics take every tether to have 1e5 N/m", _FEEDBACK,
        planted.tether_taken(lambda _: 1e5), ("stiffnesses",),
    ),
    Control(
        "feedforward drift grows", "the dynamics leave out the object's inertia", _FEEDFORWARD, planted.without_inertia,
        ("feedforward_paths",),
    ),
    Control(
        "feedforward at reasonable speed", "the dynamics apply 2 % more force than they are given", _FEEDFORWARD,
        planted.too_strong, ("feedforward_paths",),
    ),
    Control(
        "spring corrects", "the dynamics take the tether to have 1 N/m", _FEEDBACK, planted.tether_taken(lambda _: 1.0),
        ("further/disturbed",),
    ),
    Control(
        "blind forces exacerbate", "the dynamics keep pressure and friction of their first call", _FEEDFORWARD,
        planted.first_patch_kept, ("further/disturbed",),
    ),
    Control(
        "feedforward fails from rest, friction with a peak", "the law is made without its peak", _LAW,
        planted.without_peak, ("starts",),
    ),
    Control(
        "best thresholds", "the planner takes its threshold ten times as large", _CLOSE,
        planted.planner_reads(threshold=lambda threshold: 10 * threshold), ("thresholds",),
    ),
    Control(
        "thresholds above 0.4 m are worse", "the planner takes its threshold to be 0.2 m always", _CLOSE,
        planted.planner_reads(threshold=0.2), ("thresholds",),
    ),
    Control(
        "far centres break the controller", "the planner takes every feasible centre to be close", _CLOSE,
        planted.planner_reads(close_distance=10.0), ("thresholds",),
    ),
    Control(
        "tight turns are the cause", "the rover is taken to turn a third as tightly as it can", _FLANKS,
        planted.tighter_by(0.3), ("further/wider",),
    ),
    Control(
        "feasible areas", "the planner takes threshold and look-ahead to be 0.14 m and 350 steps", _CLOSE,
        planted.planner_reads(threshold=0.14, look_ahead_steps=350), ("surface",),
    ),
    Control(
        "errors of the surfaces, where both arrive",
        "the planner takes the hinge to be 0.3 m to the left of where it is", _DRIVE,
        planted.hinge_elsewhere(0.0, 0.3), ("surface",),
    ),
    Control(
        "towing along a path works", "the plan leads the hinge along the object's own path",
        _names(nominal, "quasistatic_plan"), planted.hinge_on_the_object, ("thresholds",),
    ),
    *(
        Control(
            f"stiffer is slower, hinge at {place} length", "the dynamics take every tether to have 1e5 N/m", _FEEDBACK,
            planted.tether_taken(lambda _: 1e5), ("stiffnesses",),
        )
        for place in ("rest", "stretched")
    ),
)  # fmt: skip
"""A control a claim whose check can hold."""

OPPOSITES = (
    *(
        Control(
            name, "the hinge is not moved ahead by the stretch", _names(dynamics, "feedback_motion"),
            planted.given(at_rest_length=True), (study,), Place.INPUT,
        )
        for name, study in (
            ("feedback flat, hinge at stretched length", "speeds"),
            ("an order of magnitude, hinge at stretched length", "time_steps"),
            ("stiffer is closer, hinge at stretched length", "stiffnesses"),
        )
    ),
    Control(
        "differentiability of the friction law", "the law with a kink jumps at rest", _names(law_shapes, "kinked"),
        planted.jump_for_kink, ("further/law_shapes",), Place.INPUT,
    ),
    Control(
        "feedforward fails from rest, friction without a peak", "friction has a peak after all",
        _names(dynamics, "resting_patch"), planted.with_peak, ("starts",), Place.INPUT,
    ),
    Control(
        "deviation vanishes with the time step",
        "the threshold falls with the cube root of the time step, from 0.4 m at 0.4 s", _LOOP_ROW,
        planted.threshold_with_step, ("planner_steps",), Place.INPUT,
    ),
    Control(
        "thresholds below 0.1 m are worse", "the rover is stuck with thresholds below 0.1 m", _LOOP,
        planted.lost_unless("threshold", lambda threshold: threshold >= 0.1), ("thresholds",), Place.RESULT,
    ),
    *(
        Control(
            name, "on the lemniscate the rover is stuck with 0.103 and 0.227 m, and with no other", _LOOP,
            planted.lost_on_lemniscate, studies, Place.RESULT,
        )
        for name, studies in (
            ("lemniscate is erratic", ("thresholds",)),
            ("single thresholds break the controller", ("thresholds", "wheelbases")),
        )
    ),
    Control(
        "errors of the surfaces, over all that arrive",
        "six thresholds and seven look-aheads are taken, not forty each", _names(closed_loop, "cube_nominal"),
        lambda original: original, ("surface",), Place.INPUT,
    ),
    *(
        Control(
            claim, "other look-aheads than 300 to 400 steps are taken as 3000 steps", _LOOP,
            planted.look_ahead_outside(3000), ("surface",), Place.INPUT,
        )
        for claim in ("look-ahead pre-empts turns", "feasible look-aheads", "orientation must be planned")
    ),
)  # fmt: skip
"""For claims that are not reproduced the other way round: a change with which the check holds, so that it can."""


def tables_of(plan: Mapping[str, Any], studies: tuple[str, ...]) -> dict[str, pd.DataFrame]:
    """Tables of some studies of the paper, computed here and now; ``study/part`` for one part alone."""
    tables = {}
    for wanted in studies:
        name, _, only = wanted.partition("/")
        study: Study = loaded(PAPER[name])
        parts = study.parts(Settings(plan=plan))
        parts = {only: parts[only]} if only else parts
        tables[name] = pd.DataFrame([row for part in parts.values() for row in study.rows(**part)])
    return tables


def control_rows(plan: Plan, name: str, fault: str) -> list[Row]:
    """Plant a fault, compute, decide: one row with the claim, the fault and the outcome."""
    control = next(c for c in (*CONTROLS, *OPPOSITES) if (c.claim, c.fault) == (name, fault))
    module, _, function = control.target.rpartition(".")
    with patch(control.target, control.wrong(getattr(import_module(module), function))):
        tables = tables_of(plan, control.studies)
    claim = next(claim for claim in CLAIMS if claim.name == name)
    result, numbers = claim.decide(tables)
    given = {"claim": name, "fault": fault, "place": str(control.place)}
    return [given | {"outcome": str(result), "numbers": numbers}]


def _parts(settings: Settings) -> dict[str, Part]:
    if not settings.plan:
        return {}
    plan = {**settings.plan, "sensitivity": {**settings.plan["sensitivity"], **_SHORT}}
    return {
        f"{number:02d}": {"plan": plan, "name": control.claim, "fault": control.fault}
        for number, control in enumerate((*CONTROLS, *OPPOSITES))
    }


STUDY = Study(_parts, control_rows)
