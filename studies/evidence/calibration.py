"""Checks of the calibration on synthetic sets of boards whose camera is known."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, replaced
from studies.evidence.real import DEVIATIONS_WRONG
from studies.real import jackknife
from studies.tables import calibration_table
from studies.worlds.boards import BoardFaults, CornerScene, calibration_set
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.doubts import doubts_std
from towval.model import Board, Calibration

_HERE = sys.modules[__name__]
_BOARD = Board("chessboard", (9, 6), 0.04)
_QUICK = CalibrateSettings(lens_models=("k1", "k1 k2"), folds=3)
_PLANES = ("floor", "0.35 m")


def _sets() -> Values:
    """Accuracy over twenty random sets for each kind of floor, and how many degenerate and good sets are flagged."""
    found: dict[str, float] = {}
    for floor in calibration_table.FLOORS:
        each = calibration_table.accuracy(range(6000, 6020), floor)
        for j, plane in enumerate(_PLANES):
            found |= {f"{floor}, {plane}": each.median_mm[j], f"{floor}, {plane}, bound": each.bound_mm[j]}
            found |= {f"{floor}, {plane}, without the frame": each.aligned_mm[j]}
            found |= {f"{floor}, {plane}, predicted / actual": each.predicted_over_actual[j]}
    return {name: float(value) for name, value in found.items()}


def _stretched(original: Callable[..., Any]) -> Callable[..., Any]:
    """The lens is left out: corners are taken for those of a pinhole."""
    return lambda seen, settings, *rest, **kwargs: original(
        seen, replace(settings, lens_models=("none",)), *rest, **kwargs
    )


SETS = Check(
    _sets,
    {
        "the lens is left out": replaced(calibration_table, "calibrate_observations", _stretched),
        "corners are taken to be a tenth less noisy": replaced(
            calibration_table, "NOISE_PX", lambda noise: 0.9 * noise
        ),
    },
)


def _flags() -> Values:
    """How many degenerate and how many good sets are flagged, and how many of each there are."""
    found: dict[str, float] = {}
    for name, kinds in (("degenerate", calibration_table.DEGENERATE), ("good", calibration_table.GOOD)):
        flagged = [bool(calibration_table.flagged(seed, keys)) for keys in kinds.values() for seed in range(5000, 5010)]
        found |= {f"{name} sets": float(len(flagged)), f"{name} sets flagged": float(sum(flagged))}
    return found


def _silent(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *args, **kwargs: replace(original(*args, **kwargs), findings=())


FLAGS = Check(
    _flags,
    {
        "findings are dropped, and sets of three views are left out": both(
            replaced(calibration_table, "calibrate_observations", _silent),
            replaced(calibration_table, "DEGENERATE", lambda kinds: {k: v for k, v in kinds.items() if k != "3 views"}),
        ),
        "boards are held level, and sets of 20 views are left out": both(
            replaced(calibration_table, "calibration_set", given(tilt_deg=(0.0, 0.0))),
            replaced(
                calibration_table, "GOOD", lambda kinds: {k: v for k, v in kinds.items() if not k.startswith("20")}
            ),
        ),
    },
)


def _normalised() -> Values:
    found: dict[str, float] = {}
    for name, size in (("independent noise", 0.0), ("smooth errors of 0.3 px", 0.3)):
        pairs = [jackknife.normalised_errors(range(9000, 9024), size, floor) for floor in ("marks", "boards")]
        by_view, by_corner = np.sqrt(np.mean(np.square(pairs), axis=0))
        found |= {name: float(by_view), f"{name}, corners independent": float(by_corner)}
    return found


NORMALISED = Check(_normalised, DEVIATIONS_WRONG)


def believed(scene: CornerScene) -> CornerScene:
    """A set whose board is doubted within its stated deviations."""
    reference = scene.seen.reference
    if reference is None:
        return scene
    return replace(scene, seen=replace(scene.seen, doubts_std=doubts_std(_BOARD, reference)))


def _boards() -> Values:
    """Worst error at 0.35 m over seeds with boards that are not as stated, and the findings."""
    faults = {
        "bow of 1 and 2 mm": (BoardFaults(bow_m=0.001), BoardFaults(bow_m=-0.002), "boards"),
        "board at 99.7 and 99 %, marks": (BoardFaults(size=0.997), BoardFaults(size=0.99), "both"),
        "board 3 mm thicker, marks": (BoardFaults(thicker_m=0.003), BoardFaults(thicker_m=0.003), "both"),
        "held pictures magnified by 3 and −5 %": (BoardFaults(zoom=1.03), BoardFaults(zoom=0.95), "boards"),
    }
    found: dict[str, float] = {}
    for name, (first, second, floor) in faults.items():
        errors, flagged = [], 0
        for seed in (8100, 8101, 8102):
            for fault in (first, second):
                scene = calibration_set(seed, floor=floor, faults=fault, noise_px=0.04, views=14)
                if floor == "both" and scene.seen.reference:
                    reference = replace(scene.seen.reference, mark_std_px=0.1)
                    scene = replace(scene, seen=replace(scene.seen, reference=reference))
                calibration: Calibration = calibrate_observations(believed(scene).seen, _QUICK, {}, heights_m=(0.35,))
                errors.append(1e3 * calibration_table.position_errors_m(calibration, scene, 0.35)[0])
                flagged += any(finding.severity != "note" for finding in calibration.findings)
        found |= {f"{name}, worst": max(errors), f"{name}, flagged of 6": float(flagged)}
    return found


BOARDS = Check(
    _boards,
    {
        "the board is believed": replaced(_HERE, "believed", lambda _: lambda scene: scene),
        "findings are dropped": replaced(_HERE, "calibrate_observations", _silent),
    },
)
