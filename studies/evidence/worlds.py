"""Checks of what is said of verdicts and bounds, over fresh runs of worlds whose truth other models make."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

from studies.evidence.filmed import filmed
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of, tethered_longer
from studies.tables import speeds_misstated, validation_must_reach, validation_rendered, verdict_worlds
from studies.worlds import towed_runs
from studies.worlds.towed_runs import TrueCamera, nominal_calibration, true_motion
from studies.worlds.verdict_worlds import WORLDS, number_of, world_run
from towval.commands import simulate
from towval.model import Comparison, RunUncertainty, TowingScene, Verdict
from towval.model.errors import TowvalError
from towval.validation import compare, statistics
from towval.validation.path_frame import OnPath
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.statistics import SIZES, error_sizes, upper_error
from towval.validation.uncertainty import UncertaintySampling

_HERE = sys.modules[__name__]
_SEEDS, _DRAWS = range(9200, 9220), 256


def _worlds() -> Values:
    """Shares [%] over fresh runs of all worlds, world by world those that are judged right, and MuJoCo's distance.

    A world's shares are of what was judged, which is counted, too.
    """
    rows = []
    for name in WORLDS:
        for seed in _SEEDS:
            with suppress(TowvalError):
                rows.append(verdict_worlds.judged_run(name, seed, _DRAWS))
    found = {what: _percent(held) for what, held, _, _ in verdict_worlds.shares(rows)}
    for name, cells in verdict_worlds.counts(rows).items():
        for column, cell in zip(verdict_worlds.COLUMNS, cells, strict=True):
            judged = sum(cell[kind] for kind in ("right", "unsure", "wrong"))
            found[f"{name}, {column}"] = 100 * cell["right"] / max(judged, 1)
            found[f"{name}, {column}, judged"] = float(judged)
    by_engine = [1e3 * row["model_error_m"] for row in rows if WORLDS[row["world"]].engine]
    shortest, longest = (float(np.quantile(by_engine, share)) for share in (0.1, 0.9))
    return found | {"runs": float(len(rows)), "MuJoCo, least of eight in ten": shortest, "MuJoCo, most": longest}


def _percent(held: list[bool]) -> float:
    return 100 * float(np.mean(held)) if held else float("nan")


def _too_visible(found: RunUncertainty) -> RunUncertainty:
    return replace(found, faults=tuple(replace(fault, size=fault.size / 10) for fault in found.faults))


_EXCHANGED = {Verdict.AGREES: Verdict.DISAGREES, Verdict.DISAGREES: Verdict.AGREES}


def _exchanged(found: Comparison) -> Comparison:
    verdict = _EXCHANGED.get(found.verdict, found.verdict)
    return replace(found, verdict=verdict, size_statistic=10 * found.size_limit)


WORLDS_JUDGED = Check(
    _worlds,
    {
        "upper bounds are half as wide, visible faults are said to be a tenth as large, half of the right runs are "
        "rejected and none is explained; five seeds": both(
            replaced(compare, "bounds", result_of(lambda found: found * [[1.0], [0.5]])),
            replaced(UncertaintySampling, "with_faults", result_of(_too_visible)),
            replaced(statistics, "upper_limit", lambda original: lambda values, _confidence: original(values, 0.5)),
            replaced(UncertaintySampling, "explained", lambda _: lambda _self, known: known),
            replaced(_HERE, "_SEEDS", lambda seeds: seeds[:5]),
        ),
        "the verdicts agrees and disagrees are exchanged, every run is rejected and none explained, the model's own "
        "error counts a thousandfold; three seeds": both(
            replaced(verdict_worlds, "compare", result_of(_exchanged)),
            replaced(verdict_worlds, "model_error", result_of(lambda error: 1000 * error)),
            replaced(UncertaintySampling, "explained", lambda _: lambda _self, known: known),
            replaced(_HERE, "_SEEDS", lambda seeds: seeds[:3]),
        ),
    },
    needs=("mujoco",),
)


_RUNS = 60


def _validation() -> Values:
    """Coverage of the bands [%], and verdicts without and with each fault."""
    rows = [validation_must_reach.judged_run(seed, _DRAWS) for seed in range(_RUNS)]
    found: dict[str, float | str] = {}
    for part, name in zip(validation_must_reach.PARTS, ("u_D", "u_input", "u_val"), strict=True):
        shares = 100 * np.mean([row["coverage"][part] for row in rows], axis=0)
        found |= {
            f"95 % band of {name}, {axis}": value for axis, value in zip(("x", "y", "heading"), shares, strict=True)
        }
    for verdict in (Verdict.AGREES, Verdict.CANNOT_TELL, Verdict.DISAGREES):
        found[f"as the model says, {verdict}"] = float(sum(row["verdict"] == verdict for row in rows))
    for fault in validation_must_reach.FAULTS:
        large = [row[fault] for row in rows if validation_must_reach.matters(row[fault], row["u_val_m"])]
        disagree = [entry for entry in large if entry["verdict"] == Verdict.DISAGREES]
        found |= {f"{fault}, large": float(len(large)), f"{fault}, disagrees": float(len(disagree))}
        if fault == "stripe":
            found[f"{fault}, placed"] = float(sum(map(validation_must_reach.names_the_stripe, disagree)))
    return found


def _as_wide(times: float) -> Any:
    """Deviations that are so many times as large."""

    def wrong(found: RunUncertainty) -> RunUncertainty:
        return replace(found, **{part: times**2 * getattr(found, part) for part in validation_must_reach.PARTS})

    return result_of(wrong)


def _none_planted(original: Any) -> Any:
    return lambda run, right, fault, seed: (run.truth, original(run, right, fault, seed)[1])


def _of_a_longer_tether(original: Any) -> Any:
    return lambda run, truth: original(run, towed_runs.planted(run, original(run, truth), "tether", 0)[0])


VALIDATION = Check(
    _validation,
    {
        "deviations are twice as large, the true tether is 5 % longer, nothing is planted": both(
            replaced(validation_must_reach, "sample_uncertainty", _as_wide(2.0)),
            replaced(validation_must_reach, "simulate", tethered_longer(-0.03)),
            replaced(validation_must_reach, "planted", _none_planted),
        ),
        "deviations are half as large, every true tether is 10 % longer; there are four runs": both(
            replaced(validation_must_reach, "sample_uncertainty", _as_wide(0.5)),
            replaced(validation_must_reach, "true_motion", _of_a_longer_tether),
            replaced(_HERE, "_RUNS", lambda _: 4),
        ),
    },
)


_FILMED = 10
"""Filmed runs of each fault, and of none."""


def _rendered() -> Values:
    """Verdicts on runs that are filmed and go through all stages, and of those without a fault how far they are off."""
    found = {f"{fault or _RIGHT}, {what}": 0.0 for fault in validation_rendered.WANTED for what in _VERDICTS}
    right = []
    with TemporaryDirectory() as folder:
        for run in validation_rendered.rendered_runs(_FILMED, Path(folder)):
            found[f"{run.fault or _RIGHT}, {run.said}"] += 1
            if not run.fault and isinstance(run.result, Comparison):
                right.append((run.result.path_rms_m, run.result.u_val_m))
    if right:
        errors, uncertain = np.transpose(right)
        found |= {"E, median": 1e3 * float(np.median(errors)), "u_val, median": 1e3 * float(np.median(uncertain))}
        found["E over u_val, RMS"] = float(np.sqrt(np.mean((errors / uncertain) ** 2)))
    return found


_RIGHT = "as the model says"
_VERDICTS = (*(verdict.value for verdict in Verdict), "refused")


def _slippery(original: Any) -> Any:
    """What simulates, with twice the friction."""

    def wrong(scene: TowingScene, *given: Any, **keys: Any) -> Any:
        friction = replace(scene.friction, kinetic=2 * scene.friction.kinetic, static=2 * scene.friction.static)
        return original(replace(scene, friction=friction), *given, **keys)

    return wrong


def _as_the_model_says(original: Any) -> Any:
    return lambda run, _motion, *where: original(run, true_motion(run, run.truth), *where)


def _of(*faults: str) -> Any:
    """Films runs of some faults alone: the others are not touched by what is wrong."""
    return replaced(validation_rendered, "WANTED", lambda wanted: {fault: wanted[fault] for fault in faults})


RENDERED = Check(
    _rendered,
    {
        "nothing is planted": both(
            replaced(validation_rendered, "film", _as_the_model_says), _of("stripe", "centre of mass", "tether")
        ),
        "the simulated friction is twice as large": both(replaced(simulate, "simulate_selecting", _slippery), _of("")),
    },
)


_LEVEL_DRAWS, _USUAL_DRAWS, _RESAMPLED, _LEVEL_HALVINGS = 512, 256, range(11, 17), 10
_BOUND, _LARGEST, _TIMES = 0.95, SIZES.index("position_max"), 100
_FILMS = {"lab_a": "abcd", "lab_c": "gh"}
_OF_WORLDS = ("lab", "tether", "heights")
_COMPARE: Any = compare
"""With the functions of the bounds as the stage compare has them."""


def _levels() -> Values:
    """Of filmed and synthetic runs: how often the bound holds over the draws, and how it scatters with the seed [%]."""
    found: dict[str, float] = {}
    runs = [each for name, of in _FILMS.items() for each in filmed(name, of)]
    by_seed, stated = [], []
    for name, case in [*runs, *_cases_of_worlds()]:
        sampling = UncertaintySampling(case, UncertaintySettings(samples=_LEVEL_DRAWS))
        path = sampling.on_path(sampling.describe(_LEVEL_DRAWS))
        if path is None:
            continue
        halvings = np.array([_held_in_half(path, seed) for seed in range(_LEVEL_HALVINGS)])
        level, plain, at_level = halvings.mean(axis=0).tolist()
        found |= {f"{name}, level": level, f"{name}, plain": plain, f"{name}, at the level": at_level}
        found[f"{name}, at the level, scatter of the halvings"] = float(np.std(halvings[:, 2], ddof=1))
        bounds, said = zip(*(_bound(case, seed) for seed in _RESAMPLED), strict=True)
        by_seed.append(100 * float(np.std(bounds, ddof=1) / np.mean(bounds)))
        stated.append(100 * float(np.mean(said)))
        found |= {f"{name}, scatter": by_seed[-1], f"{name}, stated": stated[-1]}
    rms = {"scatter": by_seed, "stated": stated}
    return found | {f"all, {what}": float(np.sqrt(np.mean(np.square(each)))) for what, each in rms.items()}


def _cases_of_worlds() -> Iterator[tuple[str, Case]]:
    for name in _OF_WORLDS:
        number = number_of(name, _SEEDS[0])
        run = world_run(WORLDS[name], number)
        case_of = verdict_worlds.cases(run, TrueCamera(nominal_calibration(), number), name)
        yield f"world {name}", case_of(run.truth())


def _held_in_half(path: OnPath, seed: int) -> tuple[float, float, float]:
    """The level that one half of the draws gives, and in how many of the other the plain bound and that at it hold [%].

    Each draw of the other half serves as a run, whose observed error and truth are both known; the bound rests on the
    first half alone.
    """
    kept, fresh = np.split(np.random.default_rng(seed).permutation(len(path.drawn)), 2)
    every = slice(None, None, max(1, path.drawn.shape[1] // _TIMES))
    levels = _COMPARE.holding_levels(path.drawn[kept], path.off[kept], _BOUND)
    off, held = path.off[kept][:, every], []
    # Lower bounds are not asked for, and take most of the time.
    with patch.object(statistics, "_lower", lambda *_: 0.0):
        for error, own in zip(path.drawn[fresh][:, every], path.off[fresh][:, every], strict=True):
            truth = error_sizes(error + own)[_LARGEST]
            upper = [_COMPARE.bounds(error, off, _BOUND, at)[1, _LARGEST] for at in (None, levels)]
            held.append([truth <= each for each in upper])
    plain, at_level = 100 * np.mean(held, axis=0)
    return float(levels[_LARGEST]), float(plain), float(at_level)


def _bound(case: Case, seed: int) -> tuple[float, float]:
    """The first bound [m] from other draws, and its stated relative error."""
    sampling = UncertaintySampling(case, UncertaintySettings(samples=_USUAL_DRAWS, seed=seed))
    known = sampling.describe(_USUAL_DRAWS)
    path, result = sampling.on_path(known), compare.compare(case.run, case.simulated, case.object_track, known)
    return result.error_upper_m, float("nan") if path is None else upper_error(path.error, path.off, _BOUND)


def _of_few(original: Any) -> Any:
    """Bounds that rest on one in eight draws, and are a tenth too small."""
    return lambda error, draws, *given: 0.9 * original(error, draws[::8], *given)


def _of_less(original: Any) -> Any:
    return lambda drawn, draws, _confidence: original(drawn, draws, 0.8)


LEVELS = Check(
    _levels,
    {
        "levels are found with which bounds hold in 80 %; bounds rest on one in eight draws and are a tenth too small; "
        "their stated error is halved": both(
            replaced(compare, "holding_levels", _of_less),
            replaced(compare, "bounds", _of_few),
            replaced(_HERE, "upper_error", result_of(lambda error: error / 2)),
        )
    },
    needs=("footage/lab_a", "footage/lab_c"),
)


_CAMERAS = ("camera of the worlds", "camera as good as that of lab_a")
_SPEEDS_FROM = range(7000, 7010)


def _speeds() -> Values:
    """Runs whose v_s and v_k are stated 25 % too large: verdicts, bounds that hold, ranges of bound, E and u_D [mm]."""
    found: dict[str, float] = {}
    for name, scale in zip(_CAMERAS, speeds_misstated.SCALES, strict=True):
        runs = [
            speeds_misstated.judged_run(world, seed, scale, _DRAWS)
            for world in speeds_misstated.OF_WORLDS
            for seed in _SPEEDS_FROM
        ]
        found[f"{name}, agrees"] = float(sum(each.verdict == Verdict.AGREES for each in runs))
        found[f"{name}, first bound holds"] = float(sum(each.off_m <= each.upper_m for each in runs))
        parts = {"E": "path_rms_m", "u_D": "u_d_m", "first bound": "upper_m"}
        for what, part in parts.items():
            numbers = [1e3 * getattr(each, part) for each in runs]
            found |= {f"{name}, {what}, least": min(numbers), f"{name}, {what}, most": max(numbers)}
    return found


SPEEDS = Check(
    _speeds,
    {
        "the simulated tether is 30 mm longer than stated, deviations of the camera are halved": both(
            replaced(verdict_worlds, "simulate", tethered_longer(0.03)),
            replaced(speeds_misstated, "SCALES", lambda scales: tuple(scale / 2 for scale in scales)),
        )
    },
)
