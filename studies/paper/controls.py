"""Negative controls of the ledger: a planted fault with which a claim's check must not hold.

Each control replaces one function of the package or of the studies, computes the tables that the claim needs anew, and
decides the claim on them: what a wrong program, or a program that was given something else, would have given. Sweeps
are shorter than the paper's, as the check allows.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from studies.frame import Part, Row, Settings, Study, loaded
from studies.paper import closed_loop, dynamics, finite_volumes, further, meshes, nominal
from studies.paper.claims import CLAIMS
from studies.paper.loop_checks import BREAKING_THRESHOLDS
from studies.registry import PAPER
from towval.model import Tether, TimedPath
from towval.planning import planner
from towval.planning.plan import tow
from towval.planning.planner import PlanOutcome
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


def _one_mesh(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every element size gives the coarsest mesh."""
    coarsest = meshes.SIDES_PER_ELEMENT_SIZE * max(meshes.PAPER_TABLE_1)
    return lambda footprint, loads, _: original(footprint, loads, coarsest)


def _towed_as_planned(original: Callable[..., Any]) -> Callable[..., Any]:
    """The object is towed along the nominal path of the hinge, wherever the rover is."""

    def loop(motion: Any, towed: Any, patch_: Any, tether: Any, *args: Any, **settings: Any) -> Any:
        found = original(motion, towed, patch_, tether, *args, **settings)
        start = {"start_pose": motion.pose[0], "start_twist": motion.twist[0]}
        hinge = motion.hinge
        behind = tow(hinge.time_s, hinge.position, towed, patch_, tether, stride=settings["report_stride"], **start)
        return replace(found, towed=behind)

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


def _hinge_elsewhere(original: Callable[..., Any]) -> Callable[..., Any]:
    """The planner takes the hinge to be 0.02 m ahead of where it is."""

    def drive(path: Any, start: Any, rover: Any, *args: Any) -> Any:
        hinge, *others = rover
        return original(path, start, (hinge + np.array([0.02, 0.0]), *others), *args)

    return drive


def _lost_on_lemniscate(original: Callable[..., Any]) -> Callable[..., Any]:
    """On the lemniscate the rover is stuck with the paper's breaking thresholds, and with no other."""
    lost = _lost_unless("threshold", lambda threshold: threshold not in BREAKING_THRESHOLDS)(original)

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        width, height = np.ptp(motion.pose[:, :2], axis=0)
        flat = height < 0.5 * width  # of the four curves the lemniscate alone
        return (lost if flat else original)(scene, patch_, motion, **settings)

    return loop


def _aside(original: Callable[..., Any]) -> Callable[..., Any]:
    """The rover is given a path that is 0.3 m beside its own."""

    def loop(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Any:
        beside = TimedPath(motion.time_s, motion.hinge.position + np.array([0.3, 0.0]))
        return original(scene, patch_, replace(motion, hinge=beside), **settings)

    return loop


def _threshold_with_step(original: Callable[..., Any]) -> Callable[..., Any]:
    """The threshold falls with the cube root of the time step, from 0.4 m at 0.4 s."""

    def row(scene: Any, patch_: Any, motion: Any, **settings: Any) -> Row:
        step = float(np.diff(motion.time_s[:2])[0])
        return original(scene, patch_, motion, **settings, threshold=0.4 * np.cbrt(step / 0.4))

    return row


def _thresholds_times(factor: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The rover drives with other thresholds than stated."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *args, threshold, **settings: original(*args, threshold=factor * threshold, **settings)

    return wrong


def _look_ahead_outside(steps: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Look-aheads other than 300 to 400 steps are all taken as another one."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(*args: Any, look_ahead_steps: int, **settings: Any) -> Any:
            within = 300 <= look_ahead_steps <= 400
            return original(*args, look_ahead_steps=look_ahead_steps if within else steps, **settings)

        return loop

    return wrong


def _wheelbase(length: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The rover has another wheelbase."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def loop(scene: Any, *args: Any, **settings: Any) -> Any:
            wheels = scene.rover.wheel_positions
            longer = replace(scene.rover, wheel_positions=wheels * [length / np.ptp(wheels[:, 0]), 1.0])
            return original(replace(scene, rover=longer), *args, **settings)

        return loop

    return wrong


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


def _stiffness_times_ten(original: Callable[..., Any]) -> Callable[..., Any]:
    """A tether is given ten times the stiffness asked for."""
    return lambda tether, stiffness: original(tether, stiffness=10 * stiffness)


def _tighter_by(factor: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The centres about which the rover can turn begin closer to it than they do."""

    def wrong(original: Callable[..., Any]) -> Callable[..., Any]:
        def region(rover: Any) -> Any:
            found = original(rover)
            nearer = {name: getattr(found, name) / factor for name in ("offsets", "corners", "tips")}
            return found._replace(**nearer)

        return region

    return wrong


def _wide_turn(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda rover: original(rover)._replace(tips=100 * original(rover).tips)


def _narrow_steering(original: Callable[..., Any]) -> Callable[..., Any]:
    """Every wheel steers by as little to one side as to the other."""

    def pieces(rover: Any, extent: float) -> Any:
        least = np.abs(rover.steering_ranges).min()
        return original(replace(rover, steering_ranges=np.tile([-least, least], (4, 1))), extent)

    return pieces


def _either_flank(original: Callable[..., Any]) -> Callable[..., Any]:
    """Both flanks are taken for one."""

    def piece(rover: Any, _: Any) -> Any:
        flanks = [original(rover, (side,) * 4) for side in (1, -1)]
        return SimpleNamespace(contains=lambda points: flanks[0].contains(points) | flanks[1].contains(points))

    return piece


def _twice_the_friction_velocity(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda asked: original(replace(asked, friction_velocity=2 * asked.friction_velocity))


def _high_tow(original: Mapping[str, Any]) -> Mapping[str, Any]:
    """Anchor and hinge are 0.1 m above the floor."""
    return {**original, "plane": lambda scene, **_: further.plane_rows(scene, heights=0.1)}


def _names(module: Any, function: str) -> str:
    return f"{module.__name__}.{function}"


_LOOP, _NOMINAL, _LOOP_ROW = (_names(closed_loop, name) for name in ("planned_loop", "cube_nominal", "loop_row"))
_FEEDBACK, _FLANKS = _names(dynamics, "feedback_motion"), _names(planner, "flanks")
_FEEDFORWARD, _SWAPPED = (
    _names(dynamics, "feedforward"),
    _curve({"lemniscate": "rounded_square", "rounded_square": "lemniscate"}),
)

CONTROLS = (
    Control(
        "planar forces leave the pressure", "anchor and hinge are 0.1 m above the floor", _names(further, "_ROWS"),
        _high_tow, ("further/plane",),
    ),
    Control(
        "contact converges", "the iteration ends at a residual of 0.19, after two passes",
        _names(finite_volumes, "_RESIDUAL_LIMIT"), lambda _: 0.19, ("contact",), Place.PROGRAM,
    ),
    Control(
        "law meets its four numbers", "the law is made for twice the friction velocity",
        _names(further, "fitted_law"), _twice_the_friction_velocity, ("further/law",),
    ),
    Control(
        "friction by direction", "the mesh takes friction as the same in all directions",
        _names(further, "meshed_patch"), _given(anisotropy=np.eye(2)), ("further/direction",),
    ),
    Control(
        "limits make the rover deviate", "the steering is limited in both", _names(further, "without_limits"),
        lambda _: lambda rover: rover, ("further/limits",),
    ),
    Control(
        "smaller areas of feasible centres", "every wheel steers by 33.7 degrees to either side",
        _names(further, "feasible_pieces"), _narrow_steering, ("further/areas",),
    ),
    Control(
        "centre moves within an area", "both flanks are taken for one", _names(further, "feasible_piece"),
        _either_flank, ("further/areas",), Place.PROGRAM,
    ),
    Control(
        "four-wheel control misaligns", "the turn is a hundred times as wide", _names(further, "flanks"), _wide_turn,
        ("further/steered",),
    ),
    Control(
        "settings of Fig. 5 stress the method", "threshold and look-ahead are 0.14 m and 350 steps always", _LOOP,
        _given(threshold=0.14, look_ahead_steps=350), ("loop", "thresholds"),
    ),
    Control(
        "centre of mass matters", "every object has its centre of mass at G1", _names(nominal, "general_nominal"),
        _first_centre, ("nominal",),
    ),
    Control(
        "planner stays in case A", "the rover is taken to turn five times as tightly as it can", _FLANKS,
        _tighter_by(5.0), ("loop",), Place.PROGRAM,
    ),
    Control(
        "detours are where it is tight", "the rover is taken to turn a hundred times as tightly as it can", _FLANKS,
        _tighter_by(100.0), ("loop",), Place.PROGRAM,
    ),
    *(
        Control(
            f"case {letter} shows in the object's path", "the object is towed along the nominal path of the hinge",
            _names(closed_loop, "close_loop"), _towed_as_planned, ("loop",), Place.PROGRAM,
        )
        for letter in "BC"
    ),
    Control(
        "case A reaches its point", "the planner takes the hinge to be 0.02 m ahead of where it is",
        _names(planner, "_drive"), _hinge_elsewhere, ("loop",), Place.PROGRAM,
    ),
    *(
        Control(
            f"realigns after case {letter}", "the rover is given a path 0.3 m beside its own", _LOOP, _aside, ("loop",),
        )
        for letter in "BC"
    ),
    Control(
        "deviation is small at small time steps", "the threshold is 1 m", _LOOP_ROW, _given(threshold=1.0),
        ("planner_steps", "thresholds"),
    ),
    Control(
        "mesh sets the computing time", "every element size gives the coarsest mesh",
        _names(meshes, "mesh_pressure"), _one_mesh, ("meshes",),
    ),
    Control(
        "feedforward falls with speed", "the tow force is 2 % too large", _FEEDFORWARD, _too_strong, ("speeds",),
    ),
    Control(
        "feedforward is accurate when slow", "all speeds are 5.1e-3 m/s", _names(dynamics, "cube_nominal"),
        _given(speed=0.0051), ("speeds",),
    ),
    Control(
        "feedback flat, hinge at rest length", "the hinge is moved ahead by the stretch after all", _FEEDBACK,
        _given(at_rest_length=False), ("speeds",),
    ),
    Control(
        "time step does not matter", "the tow force errs by 4 % for each second of the time step", _FEEDFORWARD,
        _stronger_by_the_step, ("time_steps",),
    ),
    Control(
        "an order of magnitude, hinge at rest length", "the tether is a hundred times stiffer", _FEEDBACK,
        _hundred_times_stiffer, ("time_steps",),
    ),
    Control(
        "stiffer is closer, hinge at rest length", "every tether has the same stiffness", _FEEDBACK,
        _without_tether_of_its_own, ("stiffnesses",),
    ),
    Control(
        "feedforward drift grows", "all speeds are 5.1e-3 m/s", _names(dynamics, "cube_nominal"), _given(speed=0.0051),
        ("feedforward_paths",),
    ),
    Control(
        "feedforward at reasonable speed", "the tow force is 2 % too large", _FEEDFORWARD, _too_strong,
        ("feedforward_paths",),
    ),
    Control(
        "spring corrects", "the tether has 1 N/m", _names(further, "feedback_motion"),
        _given(tether=Tether(0.6, 1.0)), ("further/disturbed",),
    ),
    Control(
        "blind forces exacerbate", "friction is as planned in both", _names(further, "slippery"),
        lambda _: resting_patch, ("further/disturbed",),
    ),
    Control(
        "feedforward fails from rest, friction with a peak", "the object starts with the nominal velocity after all",
        _names(dynamics, "feedforward_motion"), _given(from_rest=False), ("starts",),
    ),
    Control(
        "best thresholds", "the rover drives with ten times the thresholds", _LOOP, _thresholds_times(10.0),
        ("thresholds",),
    ),
    *(
        Control(name, "the threshold is 0.2 m always", _LOOP, _given(threshold=0.2), ("thresholds",))
        for name in ("thresholds above 0.4 m are worse", "far centres break the controller")
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
        "towing along a path works", "the rover is led along the object's path", _NOMINAL, _hinge_on_the_object,
        ("thresholds",),
    ),
)  # fmt: skip
"""A control a claim whose check can hold."""

OPPOSITES = (
    *(
        Control(name, "the hinge is not moved ahead by the stretch", _FEEDBACK, _given(at_rest_length=True), (study,))
        for name, study in (
            ("feedback flat, hinge at stretched length", "speeds"),
            ("an order of magnitude, hinge at stretched length", "time_steps"),
            ("stiffer is closer, hinge at stretched length", "stiffnesses"),
        )
    ),
    *(
        Control(
            f"stiffer is slower, hinge at {place} length", "every tether is ten times as stiff",
            _names(dynamics, "replace"), _stiffness_times_ten, ("stiffnesses",),
        )
        for place in ("rest", "stretched")
    ),
    Control(
        "feedforward fails from rest, friction without a peak", "friction has a peak after all",
        _names(dynamics, "resting_patch"), _with_peak, ("starts",),
    ),
    Control(
        "deviation vanishes with the time step",
        "the threshold falls with the cube root of the time step, from 0.4 m at 0.4 s", _LOOP_ROW,
        _threshold_with_step, ("planner_steps",),
    ),
    Control(
        "thresholds below 0.1 m are worse", "the rover is stuck with thresholds below 0.1 m", _LOOP,
        _lost_unless("threshold", lambda threshold: threshold >= 0.1), ("thresholds",), Place.RESULT,
    ),
    *(
        Control(
            name, "on the lemniscate the rover is stuck with 0.103 and 0.227 m, and with no other", _LOOP,
            _lost_on_lemniscate, studies, Place.RESULT,
        )
        for name, studies in (
            ("lemniscate is erratic", ("thresholds",)),
            ("single thresholds break the controller", ("thresholds", "wheelbases")),
        )
    ),
    Control(
        "errors of the surfaces, over all that arrive", "the two curves are exchanged", _NOMINAL, _SWAPPED,
        ("surface",),
    ),
    *(
        Control(
            claim, "other look-aheads than 300 to 400 steps are taken as 3000 steps", _LOOP,
            _look_ahead_outside(3000), ("surface",),
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
