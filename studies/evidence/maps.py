"""Checks of the maps of stability: how many of their cells are right, flagged and silently wrong."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies.comparators import lab_tow_models
from studies.comparators.break_away import break_away_s
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, replaced, result_of
from studies.frame import Judgement, Part, Row, Settings, Study
from studies.maps import integrators, lab_tows, open_loop, planner, tracker, views
from studies.tables import physics_stability_space
from studies.tables.workflow_time import REPOSITORY, SAMPLE
from towval.commands import plan
from towval.model import Array, Ground, SimulatedMotion, Track
from towval.model.errors import RefusedError
from towval.model.findings import Severity
from towval.model.tracks import TrackStatus
from towval.physics.dynamics import STANDARD, Accuracy
from towval.planning import plan as loop
from towval.planning import planner as rover_planner
from towval.planning.planner import PlanOutcome


def _parts(study: Study, **keys: Any) -> list[Part]:
    """All parts of a study, some of their keys changed."""
    return [part | keys for part in study.parts(Settings()).values()]


def _counted(study: Study, parts: Callable[[], Iterable[Part]], names: Mapping[str, str]) -> Callable[[], Values]:
    """Cells of some parts by judgement; ``names`` of the rows by the beginning of the map's name."""

    def measure() -> Values:
        return _judgements([row for part in parts() for row in study.rows(**part)], names)

    return measure


def _judgements(rows: list[Row], names: Mapping[str, str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for start, name in names.items():
        own = [row for row in rows if row["map"].startswith(start)]
        found |= {f"{name}, {each}": float(sum(row["judgement"] == each for row in own)) for each in Judgement}
        found[f"{name}, flagged within the error allowed"] = float(sum(map(_overcautious, own)))
        silent = [row["error"] for row in own if row["judgement"] == Judgement.SILENTLY_WRONG]
        found[f"{name}, largest silent error"] = 1e3 * max(silent, default=0.0)
    return found


def _overcautious(row: Row) -> bool:
    return bool(row["judgement"] == Judgement.FLAGGED and row["error"] <= row["allowed"])


def _fixed(tolerance: float) -> Callable[[Any], Any]:
    """Deaf to the tolerance that is asked for."""
    return lambda _: lambda *_args, **_keys: Accuracy(tolerance)


_HERE = sys.modules[__name__]

INTEGRATOR = Check(
    _counted(
        integrators.STUDY,
        lambda: _parts(integrators.STUDY),
        {"towval": "integrator"} | {name: name for name in ("LSODA", "Runge-Kutta 4", "semi-implicit Euler")},
    ),
    {
        "every run has a tolerance of 1 cm, also the one that checks another; steps of others count threefold, and the "
        "success of LSODA is read as a failure": both(
            replaced(integrators, "Accuracy", _fixed(1e-2)),
            replaced(integrators, "fixed_steps", lambda original: lambda *given: original(*given[:-1], 3 * given[-1])),
            replaced(integrators, "scipy_steps", result_of(lambda found: (not found[0], *found[1:]))),
        )
    },
)

_EARLY_S = 6.0

_UNNOTICED = result_of(lambda motion: replace(motion, findings=()))

OPEN_LOOP = Check(
    _counted(
        open_loop.STUDY, lambda: _parts(open_loop.STUDY), {"feedforward": "feedforward", "creep at rest": "creep"}
    ),
    {
        "feedforward has no findings, and creep is not summed": both(
            replaced(open_loop, "feedforward", _UNNOTICED),
            replaced(open_loop, "creep_length", result_of(lambda length: 0.0 * length)),
        ),
        "friction is a tenth of what is stated": replaced(
            open_loop, "Coulomb", lambda law: lambda coefficient, stiction: law(0.1 * coefficient, stiction)
        ),
    },
)


def _says_nothing(plan: Any) -> Any:
    findings = tuple(each for each in plan.findings if each.severity is Severity.NOTE)
    return replace(plan, findings=findings, outcome=PlanOutcome.ARRIVED)


PLANNER = Check(
    _counted(
        planner.STUDY,
        lambda: _parts(planner.STUDY),
        {"d_t and ϑ_lh": "threshold and look-ahead", "curvature and steering": "curvature and steering"},
    ),
    {
        "a plan that strays says that it arrived": replaced(planner, "plan_rover", result_of(_says_nothing)),
        "wheels steer half as far": replaced(
            planner, "rover", lambda original: lambda outward_deg=planner.OUTWARD_DEG: original(0.5 * outward_deg)
        ),
    },
)

_PAPER = REPOSITORY / "src" / "towval" / "workflow" / "plan.yaml"
_CURVES = ("line", "circle", "lemniscate", "rounded_square")


def _led() -> Values:
    """On which of the paper's curves the rover of lab_small, its hinge behind it, arrives, its heading led or not."""
    unled = replaced(rover_planner, "heading_over_hinge", lambda lead: lambda position, _: lead(position, 0.0))
    found: dict[str, float | str] = {}
    with TemporaryDirectory() as folder:
        for how, planted in (("led", nullcontext), ("not led", unled)):
            with planted():
                outcomes = {curve: _planned(curve, Path(folder)) for curve in _CURVES}
            found[f"{how}, arrives"] = float(list(outcomes.values()).count("arrived"))
            found |= {f"{how}, {curve}": outcome for curve, outcome in outcomes.items()}
    return found


def _planned(curve: str, folder: Path) -> str:
    """How `towval plan` with the scene of the paper and the campaign lab_small ends."""
    try:
        plan.run(_PAPER, curve, folder / "plan.mcap", folder / "plan.csv", SAMPLE)
    except RefusedError as error:
        return re.sub(r".*does not arrive: (\w+).*", r"\1", str(error).splitlines()[0])
    return "arrived"


LEAD = Check(
    _led,
    {
        "the heading is led to the wrong side": replaced(
            rover_planner, "heading_over_hinge", lambda lead: lambda position, ahead: lead(position, -ahead)
        ),
        "the hinge is at the rover's centre": replaced(
            loop,
            "plan_rover",
            lambda original: lambda path, rover, settings: original(path, replace(rover, hinge=np.zeros(2)), settings),
        ),
    },
)


def _tows() -> Values:
    """Cells by judgement, and those of the heights that are flagged by comparison with the truth alone."""
    rows = [row for part in _parts(lab_tows.STUDY) for row in lab_tows.STUDY.rows(**part)]
    names = {"tether": "stiffness and damping", "heights": "heights", "rests": "standstill and speed"}
    covered = [row for row in rows if row["map"] == "heights" and row["flags"] == lab_tows.COVERED]
    return _judgements(rows, names) | {"heights, wrong but within the stated uncertainty": float(len(covered))}


TOWS = Check(
    _tows,
    {
        "a deviation of the static coefficient counts for nothing": replaced(lab_tows, "COVERAGE", lambda _: 0.0),
        "the model's tether is 5 mm too long": replaced(
            lab_tow_models, "Tether", lambda tether: lambda length, *rest: tether(length + 0.005, *rest)
        ),
    },
)


def _close_to_tipping() -> Values:
    found: dict[str, float] = {}
    for name, heights in {"anchor at 0.4 m, hinge on the floor": (0.4, 0.0), "at 0.5 and 0.2 m": (0.5, 0.2)}.items():
        tow = lab_tows.varied("heights", *heights)
        times, truth = lab_tows.on_bristles(tow, lab_tows.DEFLECTION_M)
        present = lab_tow_models.present_effects(tow)
        motion, finer = (
            lab_tow_models.modelled(tow, present, times, Accuracy(STANDARD.tolerance / part)) for part in (1, 100)
        )
        found[f"{name}, from the truth"] = _farthest_mm(motion, truth)
        found[f"{name}, from a hundredth of the tolerance"] = _farthest_mm(motion, finer.pose)
        found[f"{name}, moved by static friction"] = 1e3 * lab_tows.moved_by_static_friction_m(tow, motion)
        slipping, early = tuple(each for each in present if each != "sticking"), times[times <= _EARLY_S]
        regularised = lab_tow_models.modelled(tow, slipping, early)
        found[f"{name}, regularised, first 6 s"] = _farthest_mm(regularised, truth[: len(early)])
    undamped = lab_tows.varied("tether", 100.0, 0.0)
    present = lab_tow_models.present_effects(undamped)
    for deflection in (0.6, 2.5, 10.0):
        times, truth = lab_tows.on_bristles(undamped, 1e-6 * deflection, lab_tows.TRUTH_STEP_S / 2)
        motion = lab_tow_models.modelled(undamped, present, times)
        found[f"undamped, bristles of {deflection:g} µm"] = _farthest_mm(motion, truth)
    return found


def _farthest_mm(motion: SimulatedMotion, truth: Array) -> float:
    return 1e3 * float(lab_tow_models.distances_m(motion, truth).max())


def _coarse_by_default(accuracy: Callable[[float], Accuracy]) -> Callable[[float], Accuracy]:
    return lambda tolerance: accuracy(1e-4 if tolerance == STANDARD.tolerance else tolerance)


CLOSE_TO_TIPPING = Check(
    _close_to_tipping,
    {
        "the model's tether is 5 mm too long": replaced(
            lab_tow_models, "Tether", lambda tether: lambda length, *rest: tether(length + 0.005, *rest)
        ),
        "the floor's slope is left out of the model, a deviation of the static coefficient is 1 %": both(
            replaced(lab_tow_models, "feedback", given(ground=Ground())),
            replaced(lab_tows, "STATIC_STD", lambda std: std / 2),
        ),
        "the default tolerance is 0.1 mm a step": replaced(_HERE, "Accuracy", _coarse_by_default),
    },
)


def _break_away() -> Values:
    """When the tow close to tipping breaks away [s], and how far the limit surface computed apart is from that [ms]."""
    tow = lab_tows.varied("heights", 0.4, 0.0)
    tow = replace(tow, slope=(0.0, 0.0), towed=replace(tow.towed, across_over_along=1.0))
    times = np.arange(0.0, 2.0, 2e-4)
    motion = lab_tow_models.modelled(tow, lab_tow_models.present_effects(tow), times)
    at_rest = (motion.pose == motion.pose[0]).all(axis=1)
    simulated, apart = float(times[at_rest.argmin()]), break_away_s(tow, 1.6)
    return {"breaks away": simulated, "against the limit surface computed apart": 1e3 * abs(simulated - apart)}


BREAK_AWAY = Check(
    _break_away,
    {
        "the model's static friction is 1 % too small": replaced(
            lab_tow_models, "Sticking", lambda sticking: lambda static, speed: sticking(0.99 * static, speed)
        )
    },
)


def _tracker() -> Values:
    """Cells of all maps, and what some of them are off by."""
    rows = [row for part in _parts(tracker.STUDY) for row in tracker.STUDY.rows(**part)]
    found = _judgements(rows, {name: name for name in tracker.CHANGES})
    stated = [row["flags"].split() for row in rows if "stated_deviation" in row["flags"]]
    found["within four stated deviations"] = float(len(stated))
    found["within four stated deviations, with another flag"] = float(sum(len(flags) > 1 for flags in stated))
    for contrast in (35, 3):
        (cell,) = [row for row in rows if (row["map"], row["x"], row["y"]) == ("noise and texture", 24, contrast)]
        found[f"noise of 24 on a texture of {contrast}"] = 1e3 * cell["error"]
    return found


def _late_and_silent(tracks: Mapping[str, Track]) -> dict[str, Track]:
    """Poses a frame late, none of them lost, and nothing found."""
    return {
        body: replace(
            track,
            pose=np.concatenate([track.pose[:1], track.pose[:-1]]),
            status=np.full_like(track.status, TrackStatus.TRACKED),
            findings=(),
        )
        for body, track in tracks.items()
    }


TRACKER = Check(
    _tracker,
    {"poses are a frame late, and nothing is said of any": replaced(tracker, "track", result_of(_late_and_silent))},
)

VIEWS = Check(
    _counted(
        views.STUDY,
        lambda: _parts(views.STUDY),
        {"boards over 100 %": "over the whole image", "boards over 30 %": "in the middle 30 %"},
    ),
    {
        "findings are dropped": replaced(
            views, "calibrate_observations", result_of(lambda found: replace(found, findings=()))
        ),
        "no lens bends straight lines": replaced(
            views, "CalibrateSettings", lambda settings: lambda: settings(lens_models=("none",))
        ),
    },
)


def _in_space() -> Values:
    found = [physics_stability_space.judge(scene) for scene in physics_stability_space.scenes()]
    verdicts = [verdict for verdict, _ in found]
    right, wrong = verdicts.count("right"), verdicts.count("SILENTLY WRONG")
    return {
        "scenes": float(len(found)),
        "right": float(right),
        "ended with a name": float(len(found) - right - wrong),
        "silently wrong": float(wrong),
        "largest error of those that are right": 1e3 * max(error for verdict, error in found if verdict == "right"),
    }


def _coarser(tolerance: float, steps: int) -> Accuracy:
    """A thousand times the tolerance of 1e-7 m, and that of the reference as it is."""
    return Accuracy(1000 * tolerance if tolerance > 1e-8 else tolerance, steps)


IN_SPACE = Check(
    _in_space,
    {
        "the default tolerance is taken for a thousand times as wide": replaced(
            physics_stability_space, "Accuracy", lambda _: _coarser
        ),
        "a motion may have a tenth of the steps": replaced(physics_stability_space, "_STEPS", lambda most: most // 10),
        "scenes that stop are left out": replaced(
            physics_stability_space, "scenes", result_of(lambda found: [scene for scene in found if not scene.stops])
        ),
    },
)
