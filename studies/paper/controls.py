"""Negative controls of the ledger: a fault planted in the program, with which a claim's check must not hold.

Each control replaces one function of the studies, computes the tables that the claim needs anew, and decides the claim
on them: what a wrong program would have given. Sweeps are shorter than the paper's, as the check allows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from studies.frame import Part, Row, Settings, Study, loaded
from studies.paper import closed_loop, dynamics, meshes, nominal
from studies.paper.claims import CLAIMS
from studies.paper.loop_checks import BREAKING_THRESHOLDS
from studies.registry import PAPER
from towval.model import TimedPath
from towval.planning import planner
from towval.planning.planner import PlanCase, PlanOutcome

Plan = dict[str, Any]

_SHORT = {
    "mean_speeds_m_s": [0.0051, 0.02, 0.07, 0.2],
    "time_steps_s": [0.02, 0.5],
    "stiffnesses_n_m": [1e3, 1e4, 1e5, 1e6],
    "surface_thresholds_m": [0.02, 1.5, 7],
    "surface_look_aheads_steps": [0, 600, 7],
    "surface_blocks": 1,
}
"""Sweeps of the controls, in place of those of the plan."""


@dataclass(frozen=True)
class Control:
    """A planted fault.

    ``claim`` whose check must fail; ``fault`` in words; ``target``, a function as ``module.name``, and ``wrong``, from
    it to what takes its place; ``studies`` to compute with it.
    """

    claim: str
    fault: str
    target: str
    wrong: Callable[[Callable[..., Any]], Callable[..., Any]]
    studies: tuple[str, ...]


def _given(**changed: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The same function, deaf to some of its arguments."""
    return lambda original: lambda *args, **kwargs: original(*args, **{**kwargs, **changed})


def _first_centre(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda scene, curve, _: original(scene, curve, "G1")


def _curve(names: Mapping[str, str]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The motion on another curve than asked for."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def on_other(scene: Any, patch_: Any, curve: str, *args: Any, **kwargs: Any) -> Any:
            return original(scene, patch_, names.get(curve, curve), *args, **kwargs)

        return on_other

    return wrong


def _two_passes(original: Callable[..., Any]) -> Callable[..., Any]:
    """The iteration ends after its second pass; what is in traction then still pulls."""

    def stopped(footprint: Any, loads: Any, element_size: float) -> Any:
        whole = original(footprint, loads, element_size)
        history = whole.history[:2]
        plane, mesh = history[-1].coefficients, whole.mesh
        pressure = mesh.centroids @ plane[:2] + plane[2]
        return replace(whole, history=history, force=np.where(history[-1].in_contact, pressure, 0.0) * mesh.areas)

    return stopped


def _one_mesh(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every element size gives the coarsest mesh."""
    coarsest = meshes.SIDES_PER_ELEMENT_SIZE * max(meshes.PAPER_TABLE_1)
    return lambda footprint, loads, _: original(footprint, loads, coarsest)


def _object_on_its_path(original: Callable[..., Any]) -> Callable[..., Any]:
    """The object is put on its nominal path, whatever the rover does."""

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        found = original(scene, patch_, motion, **settings)
        at = np.searchsorted(motion.time_s, found.towed.time_s).clip(max=len(motion.time_s) - 1)
        return replace(found, towed=replace(found.towed, pose=motion.pose[at]))

    return loop


def _aside_in_case_b(original: Callable[..., Any]) -> Callable[..., Any]:
    """The object is 0.1 m beside its nominal path while the rover is in case B, and on it otherwise."""
    on_its_path = _object_on_its_path(original)

    def loop(*args: Any, **settings: Any) -> Any:
        found = on_its_path(*args, **settings)
        at = np.searchsorted(found.rover.time_s, found.towed.time_s).clip(max=len(found.rover.case) - 1)
        aside = np.where(found.rover.case[at] == PlanCase.B, 0.1, 0.0)
        return replace(found, towed=replace(found.towed, pose=found.towed.pose + aside[:, None] * [0.0, 1.0, 0.0]))

    return loop


def _lost_unless(setting: str, good: Callable[[float], bool]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The rover arrives with good values of a setting of the planner; with others it is stuck, the object 1 m off."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(*args: Any, **settings: Any) -> Any:
            found = original(*args, **settings)
            if good(settings[setting]):
                return replace(found, rover=replace(found.rover, outcome=PlanOutcome.ARRIVED))
            return replace(found, rover=replace(found.rover, outcome=PlanOutcome.STUCK), object_rms=1.0)

        return loop

    return wrong


def _half_the_turn(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every arc is driven about a centre twice as far away as planned, in the books alone."""

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        found = original(scene, patch_, motion, **settings)
        return replace(found, rover=replace(found.rover, twist=found.rover.twist * [1.0, 1.0, 0.5]))

    return loop


def _lost_after_first_detour(original: Callable[..., Any]) -> Callable[..., Any]:
    """The rover is 0.3 m beside its place from the end of its first stretch in case B or C on."""

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        found = original(scene, patch_, motion, **settings)
        detours = np.flatnonzero((found.rover.case[:-1] != 0) & (found.rover.case[1:] == 0))
        hinge = found.rover.hinge.copy()
        hinge[detours[0] :] += 0.3
        return replace(found, rover=replace(found.rover, hinge=hinge))

    return loop


def _with_peak(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda scene: original(replace(scene, friction=scene.peaked_friction))


def _too_strong(original: Callable[..., Any]) -> Callable[..., Any]:
    """The tow force is 2 % above what friction takes."""

    def motion(towed: Any, patch_: Any, force: TimedPath, *args: Any, **kwargs: Any) -> Any:
        return original(towed, patch_, TimedPath(force.time_s, 1.02 * force.position), *args, **kwargs)

    return motion


def _stronger_by_the_step(original: Callable[..., Any]) -> Callable[..., Any]:
    """The tow force errs in proportion to the time step: by 2 % at half a second."""

    def motion(towed: Any, patch_: Any, force: TimedPath, *args: Any, **kwargs: Any) -> Any:
        share = 0.04 * float(np.diff(force.time_s).min())
        return original(towed, patch_, TimedPath(force.time_s, (1 + share) * force.position), *args, **kwargs)

    return motion


def _hinge_on_the_object(original: Callable[..., Any]) -> Callable[..., Any]:
    """The rover is led along the object's own path, as if there were no tether between them."""

    def motion(*args: Any, **kwargs: Any) -> Any:
        found = original(*args, **kwargs)
        return replace(found, hinge=TimedPath(found.time_s, found.pose[:, :2]))

    return motion


def _without_tether_of_its_own(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every tether has the stiffness of the plan."""
    return lambda scene, patch_, motion, **kwargs: original(scene, patch_, motion, **{**kwargs, "tether": None})


def _hundred_times_stiffer(original: Callable[..., Any]) -> Callable[..., Any]:
    def motion(scene: Any, patch_: Any, planned: Any, **kwargs: Any) -> Any:
        tether = replace(scene.tether, stiffness=100 * scene.tether.stiffness)
        return original(scene, patch_, planned, **{**kwargs, "tether": tether})

    return motion


def _step_for_radius(original: Callable[..., Any]) -> Callable[..., Any]:
    """The time step leads to a deviation in proportion: the error of a first-order rule."""

    def row(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Row:
        found = original(scene, patch_, motion, **settings)
        return found | {"rover_rms_m": found["rover_rms_m"] * float(np.diff(motion.time_s[:2])[0])}

    return row


def _five_times_as_tight(original: Callable[..., Any]) -> Callable[..., Any]:
    """The centres about which the rover can turn begin at a fifth of their distance from it."""

    def region(rover: Any) -> Any:
        found = original(rover)
        return found._replace(offsets=found.offsets / 5, corners=found.corners / 5, tips=found.tips / 5)

    return region


def _names(module: Any, function: str) -> str:
    return f"{module.__name__}.{function}"


_LOOP, _NOMINAL, _LOOP_ROW = (_names(closed_loop, name) for name in ("planned_loop", "cube_nominal", "loop_row"))
_FEEDBACK, _FLANKS = _names(dynamics, "feedback_motion"), _names(planner, "flanks")
_SWAPPED = _curve({"lemniscate": "rounded_square", "rounded_square": "lemniscate"})

CONTROLS = (
    Control(
        "contact converges", "the iteration ends after two passes", _names(meshes, "mesh_pressure"), _two_passes,
        ("contact",),
    ),
    Control(
        "centre of mass matters", "every object has its centre of mass at G1", _names(nominal, "general_nominal"),
        _first_centre, ("nominal",),
    ),
    Control(
        "planner stays in case A", "the rover is taken to turn five times as tightly as it can", _FLANKS,
        _five_times_as_tight, ("loop",),
    ),
    Control(
        "case C shows in the object's path", "the object stays on its path whatever the rover does", _LOOP,
        _object_on_its_path, ("loop",),
    ),
    Control(
        "case A reaches its point", "arcs are driven with half the turn", _LOOP, _half_the_turn, ("loop",),
    ),
    Control(
        "realigns after B and C", "the rover is 0.3 m off after its first detour", _LOOP, _lost_after_first_detour,
        ("loop",),
    ),
    Control(
        "mesh sets the computing time", "every element size gives the coarsest mesh",
        _names(meshes, "mesh_pressure"), _one_mesh, ("meshes",),
    ),
    Control(
        "feedforward falls with speed", "the tow force is 2 % too large", _names(dynamics, "feedforward"), _too_strong,
        ("speeds",),
    ),
    Control(
        "feedback flat, hinge at rest length", "the hinge is moved ahead by the stretch after all", _FEEDBACK,
        _given(at_rest_length=False), ("speeds",),
    ),
    Control(
        "time step does not matter", "the tow force errs by 4 % for each second of the time step",
        _names(dynamics, "feedforward"), _stronger_by_the_step, ("time_steps",),
    ),
    Control(
        "an order of magnitude, hinge at rest length", "the tether is a hundred times stiffer", _FEEDBACK,
        _hundred_times_stiffer, ("time_steps",),
    ),
    *(
        Control(name, "every tether has the same stiffness", _FEEDBACK, _without_tether_of_its_own, ("stiffnesses",))
        for name in ("stiffer is closer, hinge at rest length", "stiffer is slower")
    ),
    Control(
        "feedforward drift grows", "all speeds are 5.1e-3 m/s", _names(dynamics, "cube_nominal"), _given(speed=0.0051),
        ("feedforward_paths",),
    ),
    Control(
        "feedforward fails from rest, friction with a peak", "the object starts with the nominal velocity after all",
        _names(dynamics, "feedforward_motion"), _given(from_rest=False), ("starts",),
    ),
    Control(
        "lemniscate is erratic", "the rover is sent along the circle instead", _NOMINAL,
        _curve({"lemniscate": "circle"}), ("thresholds",),
    ),
    Control(
        "feasible areas", "the two curves are exchanged", _NOMINAL, _SWAPPED, ("surface",),
    ),
    Control(
        "errors of the surfaces", "the two curves are exchanged", _NOMINAL, _SWAPPED, ("surface",),
    ),
    Control(
        "towing along a path works", "the rover is led along the object's path", _NOMINAL, _hinge_on_the_object,
        ("thresholds",),
    ),
)  # fmt: skip
"""A control a claim whose check can hold."""

OPPOSITES = (
    Control(
        "feedback flat, hinge at stretched length", "the hinge is not moved ahead by the stretch", _FEEDBACK,
        _given(at_rest_length=True), ("speeds",),
    ),
    Control(
        "an order of magnitude, hinge at stretched length", "the hinge is not moved ahead by the stretch", _FEEDBACK,
        _given(at_rest_length=True), ("time_steps",),
    ),
    Control(
        "stiffer is closer, hinge at stretched length", "the hinge is not moved ahead by the stretch", _FEEDBACK,
        _given(at_rest_length=True), ("stiffnesses",),
    ),
    Control(
        "feedforward fails from rest, friction without a peak", "friction has a peak after all",
        _names(dynamics, "resting_patch"), _with_peak, ("starts",),
    ),
    Control(
        "deviation vanishes with the time step", "the deviation is multiplied by the time step", _LOOP_ROW,
        _step_for_radius, ("planner_steps",),
    ),
    Control(
        "case B shows in the object's path", "the object is 0.1 m aside while the rover is in case B", _LOOP,
        _aside_in_case_b, ("loop",),
    ),
    Control(
        "best thresholds", "the rover is stuck with other thresholds than 0.1 to 0.4 m, the object 1 m off", _LOOP,
        _lost_unless("threshold", lambda threshold: 0.1 <= threshold <= 0.4), ("thresholds",),
    ),
    Control(
        "single thresholds break the controller", "the rover is stuck with these two, and with no other", _LOOP,
        _lost_unless("threshold", lambda threshold: threshold not in BREAKING_THRESHOLDS), ("thresholds", "wheelbases"),
    ),
    *(
        Control(
            claim, "the rover arrives with look-aheads of 300 to 400 steps, and with no other", _LOOP,
            _lost_unless("look_ahead_steps", lambda steps: 300 <= steps <= 400), ("surface",),
        )
        for claim in ("feasible look-aheads", "orientation must be planned")
    ),
)  # fmt: skip
"""For claims that are not reproduced the other way round: a change with which the check holds, so that it can."""


def tables_of(plan: Mapping[str, Any], studies: tuple[str, ...]) -> dict[str, pd.DataFrame]:
    """Tables of some studies of the paper, computed here and now."""
    tables = {}
    for name in studies:
        study: Study = loaded(PAPER[name])
        parts = study.parts(Settings(plan=plan))
        tables[name] = pd.DataFrame([row for part in parts.values() for row in study.rows(**part)])
    return tables


def control_rows(plan: Plan, name: str, fault: str) -> list[Row]:
    """Plant a fault, compute, decide: one row with the claim, the fault and the outcome."""
    control = next(c for c in (*CONTROLS, *OPPOSITES) if (c.claim, c.fault) == (name, fault))
    module, _, function = control.target.rpartition(".")
    with patch(control.target, control.wrong(getattr(_module(module), function))):
        tables = tables_of(plan, control.studies)
    claim = next(claim for claim in CLAIMS if claim.name == name)
    result, numbers = claim.decide(tables)
    return [{"claim": name, "fault": fault, "outcome": str(result), "numbers": numbers}]


def _module(name: str) -> Any:
    return {module.__name__: module for module in (closed_loop, dynamics, meshes, nominal, planner)}[name]


def _parts(settings: Settings) -> dict[str, Part]:
    if not settings.plan:
        return {}
    plan = {**settings.plan, "sensitivity": {**settings.plan["sensitivity"], **_SHORT}}
    return {
        f"{number:02d}": {"plan": plan, "name": control.claim, "fault": control.fault}
        for number, control in enumerate((*CONTROLS, *OPPOSITES))
    }


STUDY = Study(_parts, control_rows)
