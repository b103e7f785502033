"""Checks of the maps of stability: how many of their cells are right, flagged and silently wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from studies.comparators import lab_tow_models
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from studies.frame import Judgement, Part, Row, Settings, Study
from studies.maps import integrators, lab_tows, open_loop, planner
from studies.tables import physics_stability_space
from towval.model.findings import Severity
from towval.physics.dynamics import Accuracy
from towval.planning.planner import PlanOutcome


def _parts(study: Study, **keys: Any) -> list[Part]:
    """All parts of a study, some of their keys changed."""
    return [part | keys for part in study.parts(Settings()).values()]


def _counted(study: Study, parts: Callable[[], Iterable[Part]], names: Mapping[str, str]) -> Callable[[], Values]:
    """Cells of some parts by judgement; ``names`` of the rows by the beginning of the map's name."""

    def measure() -> Values:
        rows = [row for part in parts() for row in study.rows(**part)]
        found: dict[str, float] = {}
        for start, name in names.items():
            own = [row for row in rows if row["map"].startswith(start)]
            found |= {f"{name}, {each}": float(sum(row["judgement"] == each for row in own)) for each in Judgement}
            found[f"{name}, flagged within the error allowed"] = float(sum(map(_overcautious, own)))
        return found

    return measure


def _overcautious(row: Row) -> bool:
    return bool(row["judgement"] == Judgement.FLAGGED and row["error"] <= row["allowed"])


def _fixed(tolerance: float) -> Callable[[Any], Any]:
    """Deaf to the tolerance that is asked for."""
    return lambda _: lambda *_args, **_keys: Accuracy(tolerance)


INTEGRATOR = Check(
    _counted(integrators.STUDY, lambda: _parts(integrators.STUDY, methods=["towval"]), {"towval": "integrator"}),
    {
        "every run has a tolerance of 1 cm, also the one that checks another": replaced(
            integrators, "Accuracy", _fixed(1e-2)
        )
    },
)

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

TOWS = Check(
    _counted(
        lab_tows.STUDY,
        lambda: [part for part in _parts(lab_tows.STUDY) if part["over"] != "rests"],
        {"tether": "stiffness and damping", "heights": "heights"},
    ),
    {
        "the model's tether is 5 mm too long": replaced(
            lab_tow_models, "Tether", lambda tether: lambda length, *rest: tether(length + 0.005, *rest)
        )
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
