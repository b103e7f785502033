"""Checks on synthetic runs with all stages: presets, and what the error of a run tells of the measurement's own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pandas as pd

from studies import end_to_end
from studies.costs import Timed
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, flawed, replaced, result_of, tethered_longer
from studies.frame import Settings
from studies.tables import bound_given_error, verdict_worlds
from studies.tradeoff import presets
from towval.model import RunUncertainty, Verdict
from towval.model.errors import TowvalError
from towval.validation.scene_model import SceneModel


def _presets() -> Values:
    """Medians and quartiles by preset, one round, and how many campaigns have which verdict."""
    parts = presets.STUDY.parts(Settings()).values()
    table = pd.DataFrame([row for part in parts for row in presets.STUDY.rows(**part | {"rounds": 1})])
    found: dict[str, float] = {}
    for (preset, quantity), runs in table.groupby(["setting", "panel"]):
        quartiles = runs.error.quantile([0.25, 0.5, 0.75])
        for name, value in zip(("lower quartile", "median", "upper quartile"), quartiles, strict=True):
            found[f"{preset}, {quantity}, {name}"] = float(value)
        found[f"{preset}, CPU"] = float(runs.cost.median())
        found |= {f"{preset}, {verdict}": float((runs.verdict == verdict).sum()) for verdict in Verdict}
    return found


def _longer(original: Any) -> Any:
    """What simulates, with a tether that is 5 % too long."""

    def wrong(scene: Any, *args: Any, **keys: Any) -> Any:
        tether = replace(scene.tether, rest_length=1.05 * scene.tether.rest_length)
        return original(replace(scene, tether=tether), *args, **keys)

    return wrong


def _flawed_selected(original: Any) -> Any:
    """What tracks with settings of its choice, with poses that scatter."""

    def wrong(*args: Any) -> Any:
        settings, tracks = original(*args)
        return settings, flawed(3e-3, 1e-3)(lambda: tracks)()

    return wrong


def _halved(found: RunUncertainty) -> RunUncertainty:
    """Half of u_val, and nothing found of the draws."""
    return replace(found, validation=found.validation / 4, findings=())


def _tenfold(timed: dict[str, Timed[Any]]) -> dict[str, Timed[Any]]:
    return {name: replace(each, cpu_s=10 * each.cpu_s) for name, each in timed.items()}


PRESETS = Check(
    _presets,
    {
        "the simulated tether is 5 % too long, poses scatter by 3 mm, the clock counts tenfold": both(
            replaced(end_to_end, "simulate_selecting", _longer),
            replaced(end_to_end, "track", flawed(3e-3, 1e-3)),
            replaced(end_to_end, "track_selecting", _flawed_selected),
            replaced(presets, "take_turns", result_of(_tenfold)),
        ),
        "u_val is halved, and what is found of the draws gets lost": replaced(
            end_to_end, "sample_selecting", result_of(_halved)
        ),
    },
)


def _known_errors() -> Values:
    """Of each world what is left of u_D and of the bound given E, least and most [%]; how many bounds hold."""
    runs = list(bound_given_error.known_errors(range(6200, 6210), 512))
    found: dict[str, float] = {}
    for world in bound_given_error.TRIED:
        own = [each for each in runs if each.world == world]
        left = {
            "u_D": [100 * each.u_d_given / each.u_d for each in own],
            "bound": [100 * each.bound_given / each.bound for each in own],
        }
        for name, percent in left.items():
            found |= {f"{world}, {name} given E, least": min(percent), f"{world}, {name} given E, most": max(percent)}
        found[f"{world}, bounds given E of {len(own)} that hold"] = sum(each.off <= each.bound_given for each in own)
    return found | {f"first bounds of {len(runs)} that hold": sum(each.off <= each.bound for each in runs)}


def _stated_longer(original: Any) -> Any:
    """What is stated and measured of a run, with a tether that is 1 cm longer than the true one."""

    def wrong(run: Any, *args: Any, **keys: Any) -> Any:
        stated = {**run.stated, "rest": run.stated["rest"] + 0.01}
        return original(replace(run, stated=stated), *args, **keys)

    return wrong


GIVEN_ERROR = Check(
    _known_errors,
    {
        "tethers are stated 1 cm too long, deviations of the camera half as large": both(
            replaced(bound_given_error, "cases", _stated_longer),
            replaced(
                bound_given_error,
                "nominal_calibration",
                result_of(lambda camera: replace(camera, covariance=camera.covariance / 4)),
            ),
        )
    },
)


def _ropes() -> Values:
    """Of runs behind ropes: how many are judged, how often the first bound holds, and the largest model error [mm]."""
    judged, held, off = 0, [], []
    for seed in range(230, 240):
        for name in ("rope", "lab, rope"):
            try:
                row = verdict_worlds.judged_run(name, seed, 256)
            except TowvalError:
                continue
            judged += row["run"]["verdict"] != Verdict.NOT_JUDGED
            held += [each["off_m"] <= each["upper_m"] for each in (row["run"], *row["faults"])]
            off.append(1e3 * row["model_error_m"])
    return {
        "runs judged": float(judged),
        "first bound holds, share": 100 * sum(held) / max(1, len(held)),
        "model error with all inputs right, largest": max(off, default=float("nan")),
    }


def _as_measured(_: Any) -> Any:
    return lambda self, hinge, pose: pose


ROPES = Check(
    _ropes,
    {
        "objects start as measured, however the tether pulls": replaced(SceneModel, "resting", _as_measured),
        "the simulated tether is 2 mm too long": replaced(verdict_worlds, "simulate", tethered_longer(2e-3)),
        "the bound is half as large": replaced(
            verdict_worlds, "compare", result_of(lambda found: replace(found, error_upper_m=found.error_upper_m / 2))
        ),
    },
)
