"""Negative controls of the ledger: a planted fault with which a claim's check must not hold.

Each control replaces one function of the package or of the studies, computes the tables that the claim needs anew, and
decides the claim on them: what a wrong program, or a program that was given something else, would have given. Sweeps
are shorter than the paper's, as the check allows.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from studies.frame import Part, Row, Settings, Study, loaded
from studies.paper import closed_loop, dynamics, finite_volumes, further, law_shapes, meshes, nominal, planted
from studies.paper.claims import CLAIMS
from studies.registry import PAPER
from towval.model import Tether
from towval.planning import planner
from towval.planning.scene import resting_patch

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
    """In a function of the package, or of our version of the paper's mesh, that computes what is judged."""
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
    place: Place = Place.INPUT


def _names(module: Any, function: str) -> str:
    return f"{module.__name__}.{function}"


_LOOP, _NOMINAL, _LOOP_ROW = (_names(closed_loop, name) for name in ("planned_loop", "cube_nominal", "loop_row"))
_FEEDBACK, _FLANKS = _names(dynamics, "feedback_motion"), _names(planner, "flanks")
_FEEDFORWARD, _SWAPPED = (
    _names(dynamics, "feedforward"),
    planted.curve({"lemniscate": "rounded_square", "rounded_square": "lemniscate"}),
)

CONTROLS = (
    Control(
        "planar forces leave the pressure", "anchor and hinge are 0.1 m above the floor", _names(further, "_ROWS"),
        planted.high_tow, ("further/plane",),
    ),
    Control(
        "contact converges", "the iteration ends at a residual of 0.19, after two passes",
        _names(finite_volumes, "_RESIDUAL_LIMIT"), lambda _: 0.19, ("contact",), Place.PROGRAM,
    ),
    Control(
        "continuity of the friction law", "the law that jumps rises over 0.1 mm/s",
        _names(law_shapes, "jumping"), planted.steep, ("further/law_shapes",),
    ),
    Control(
        "law meets its four numbers", "the law is made for twice the friction velocity",
        _names(further, "fitted_law"), planted.twice_the_friction_velocity, ("further/law",),
    ),
    Control(
        "friction by direction", "the mesh takes friction as the same in all directions",
        _names(further, "meshed_patch"), planted.given(anisotropy=np.eye(2)), ("further/direction",),
    ),
    Control(
        "limits make the rover deviate", "the steering is limited in both", _names(further, "without_limits"),
        lambda _: lambda rover: rover, ("further/limits",),
    ),
    Control(
        "smaller areas of feasible centres", "every wheel steers by 33.7 degrees to either side",
        _names(further, "feasible_pieces"), planted.narrow_steering, ("further/areas",),
    ),
    Control(
        "centre moves within an area", "both flanks are taken for one", _names(further, "feasible_piece"),
        planted.either_flank, ("further/areas",), Place.PROGRAM,
    ),
    Control(
        "four-wheel control misaligns", "the turn is a hundred times as wide", _names(further, "flanks"),
        planted.wide_turn, ("further/steered",),
    ),
    Control(
        "settings of Fig. 5 stress the method", "threshold and look-ahead are 0.14 m and 350 steps always", _LOOP,
        planted.given(threshold=0.14, look_ahead_steps=350), ("loop", "thresholds"),
    ),
    Control(
        "centre of mass matters", "every object has its centre of mass at G1", _names(nominal, "general_nominal"),
        planted.first_centre, ("nominal",),
    ),
    Control(
        "planner stays in case A", "the rover is taken to turn five times as tightly as it can", _FLANKS,
        planted.tighter_by(5.0), ("loop",), Place.PROGRAM,
    ),
    Control(
        "detours are where it is tight", "the rover is taken to turn a hundred times as tightly as it can", _FLANKS,
        planted.tighter_by(100.0), ("loop",), Place.PROGRAM,
    ),
    *(
        Control(
            f"case {letter} shows in the object's path", "the object is towed along the nominal path of the hinge",
            _names(closed_loop, "close_loop"), planted.towed_as_planned, ("loop",), Place.PROGRAM,
        )
        for letter in "BC"
    ),
    Control(
        "case A reaches its point", "the planner takes the hinge to be 0.02 m ahead of where it is",
        _names(planner, "_drive"), planted.hinge_elsewhere, ("loop",), Place.PROGRAM,
    ),
    *(
        Control(
            f"realigns after case {letter}", "the rover is given a path 0.3 m beside its own", _LOOP, planted.aside,
            ("loop",),
        )
        for letter in "BC"
    ),
    Control(
        "deviation is small at small time steps", "the threshold is 1 m", _LOOP_ROW, planted.given(threshold=1.0),
        ("planner_steps", "thresholds"),
    ),
    Control(
        "mesh sets the computing time", "every element size gives the coarsest mesh",
        _names(meshes, "mesh_pressure"), planted.one_mesh, ("meshes",),
    ),
    Control(
        "feedforward falls with speed", "the tow force is 2 % too large", _FEEDFORWARD, planted.too_strong, ("speeds",),
    ),
    Control(
        "feedforward is accurate when slow", "all speeds are 5.1e-3 m/s", _names(dynamics, "cube_nominal"),
        planted.given(speed=0.0051), ("speeds",),
    ),
    Control(
        "feedback flat, hinge at rest length", "the hinge is moved ahead by the stretch after all", _FEEDBACK,
        planted.given(at_rest_length=False), ("speeds",),
    ),
    Control(
        "time step does not matter", "the tow force errs by 4 % for each second of the time step", _FEEDFORWARD,
        planted.stronger_by_the_step, ("time_steps",),
    ),
    Control(
        "an order of magnitude, hinge at rest length", "the tether is a hundred times stiffer", _FEEDBACK,
        planted.hundred_times_stiffer, ("time_steps",),
    ),
    Control(
        "stiffer is closer, hinge at rest length", "every tether has the same stiffness", _FEEDBACK,
        planted.without_tether_of_its_own, ("stiffnesses",),
    ),
    Control(
        "feedforward drift grows", "all speeds are 5.1e-3 m/s", _names(dynamics, "cube_nominal"),
        planted.given(speed=0.0051), ("feedforward_paths",),
    ),
    Control(
        "feedforward at reasonable speed", "the tow force is 2 % too large", _FEEDFORWARD, planted.too_strong,
        ("feedforward_paths",),
    ),
    Control(
        "spring corrects", "the tether has 1 N/m", _names(further, "feedback_motion"),
        planted.given(tether=Tether(0.6, 1.0)), ("further/disturbed",),
    ),
    Control(
        "blind forces exacerbate", "friction is as planned in both", _names(further, "slippery"),
        lambda _: resting_patch, ("further/disturbed",),
    ),
    Control(
        "feedforward fails from rest, friction with a peak", "the object starts with the nominal velocity after all",
        _names(dynamics, "feedforward_motion"), planted.given(from_rest=False), ("starts",),
    ),
    Control(
        "best thresholds", "the rover drives with ten times the thresholds", _LOOP, planted.thresholds_times(10.0),
        ("thresholds",),
    ),
    Control(
        "thresholds above 0.4 m are worse", "the threshold is 0.2 m always", _LOOP, planted.given(threshold=0.2),
        ("thresholds",),
    ),
    Control(
        "far centres break the controller", "every feasible centre counts as close", _LOOP,
        planted.given(close_distance=10.0), ("thresholds",),
    ),
    Control(
        "tight turns are the cause", "the wider lemniscate is as wide as the paper's", _names(further, "wider"),
        lambda _: lambda: 1.001, ("further/wider",),
    ),
    *(
        Control(name, "the two curves are exchanged", _NOMINAL, _SWAPPED, ("surface",))
        for name in ("feasible areas", "errors of the surfaces, where both arrive")
    ),
    Control(
        "towing along a path works", "the rover is led along the object's path", _NOMINAL, planted.hinge_on_the_object,
        ("thresholds",),
    ),
    *(
        Control(
            f"stiffer is slower, hinge at {place} length", "the stiffness asked for is not heeded",
            _names(dynamics, "replace"), planted.stiffness_not_heeded, ("stiffnesses",),
        )
        for place in ("rest", "stretched")
    ),
)  # fmt: skip
"""A control a claim whose check can hold."""

OPPOSITES = (
    *(
        Control(
            name, "the hinge is not moved ahead by the stretch", _FEEDBACK, planted.given(at_rest_length=True), (study,)
        )
        for name, study in (
            ("feedback flat, hinge at stretched length", "speeds"),
            ("an order of magnitude, hinge at stretched length", "time_steps"),
            ("stiffer is closer, hinge at stretched length", "stiffnesses"),
        )
    ),
    Control(
        "differentiability of the friction law", "the law with a kink jumps at rest", _names(law_shapes, "kinked"),
        planted.jump_for_kink, ("further/law_shapes",),
    ),
    Control(
        "feedforward fails from rest, friction without a peak", "friction has a peak after all",
        _names(dynamics, "resting_patch"), planted.with_peak, ("starts",),
    ),
    Control(
        "deviation vanishes with the time step",
        "the threshold falls with the cube root of the time step, from 0.4 m at 0.4 s", _LOOP_ROW,
        planted.threshold_with_step, ("planner_steps",),
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
        "six thresholds and seven look-aheads are taken, not forty each", _NOMINAL, lambda original: original,
        ("surface",),
    ),
    *(
        Control(
            claim, "other look-aheads than 300 to 400 steps are taken as 3000 steps", _LOOP,
            planted.look_ahead_outside(3000), ("surface",),
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
