"""Checks of the calibration on synthetic sets of boards whose camera is known."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, given, replaced
from studies.evidence.real import DEVIATIONS_WRONG
from studies.real import jackknife
from studies.tables import calibration_table, fisheyes
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
        each = calibration_table.accuracy(range(26000, 26020), floor)
        for j, plane in enumerate(_PLANES):
            at = f"{floor}, {plane}"
            found |= {at: each.rms_mm[j], f"{at}, bound": each.bound_rms_mm[j]}
            found[f"{at}, without the frame"] = each.aligned_rms_mm[j]
            for name, medians in zip(("", ", without the frame", ", bound"), each.median_mm, strict=True):
                found[f"{at}{name}, median"] = medians[j]
            ratios = {"over the bound": each.over_bound, "predicted / actual": each.predicted_over_actual}
            for name, (ratio, low, high) in ratios.items():
                found |= {f"{at}, {name}": ratio[j], f"{at}, {name}, from": low[j], f"{at}, {name}, to": high[j]}
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


def _fisheyes() -> Values:
    """Errors of fisheyes by the lens that is chosen, and by pinhole models alone."""
    found: dict[str, float] = {}
    for focal_px in fisheyes.FOCALS_PX:
        for name, errors in fisheyes.errors_mm(range(9400, 9410), focal_px).items():
            found |= {f"{focal_px:g} px, {name}, {key}": value for key, value in fisheyes.summary(errors).items()}
    return found


def _pinholes_only(original: Callable[..., Any]) -> Callable[..., Any]:
    return lambda views, settings, *rest: original(views, replace(settings, lens_models=fisheyes.PINHOLES), *rest)


FISHEYES = Check(
    _fisheyes,
    {
        "no model of a fisheye is tried": replaced(fisheyes, "calibrate_observations", _pinholes_only),
        "the lens is three times as long, so that it bends little": replaced(
            fisheyes, "fisheye_lab", lambda original: lambda seed, focal_px: original(seed, 3 * focal_px)
        ),
    },
)


def doubted(scene: CornerScene) -> CornerScene:
    """A set whose board is doubted within its stated deviations, as the stage does it."""
    reference = scene.seen.reference
    if reference is None:
        return scene
    return replace(scene, seen=replace(scene.seen, doubts_std=doubts_std(_BOARD, reference)))


@dataclass(frozen=True)
class _NotAsStated:
    """Two sizes of a fault, the floor that shows it, and the finding that names it; empty where none is to be given."""

    faults: tuple[BoardFaults, BoardFaults]
    floor: str
    named: str


_NOT_AS_STATED = {
    "bow of 1 and 2 mm": _NotAsStated((BoardFaults(bow_m=0.001), BoardFaults(bow_m=-0.002)), "boards", "board-bent"),
    "board at 99.7 and 99 %, marks": _NotAsStated(
        (BoardFaults(size=0.997), BoardFaults(size=0.99)), "both", "board-size"
    ),
    "board 3 mm thicker and 2 mm thinner, marks": _NotAsStated(
        (BoardFaults(thicker_m=0.003), BoardFaults(thicker_m=-0.002)), "both", ""
    ),
    "held pictures magnified by 3 and −5 %": _NotAsStated(
        (BoardFaults(zoom=1.03), BoardFaults(zoom=0.95)), "boards", "held-differ"
    ),
}


def _filmed(seed: int, fault: BoardFaults, floor: str) -> CornerScene:
    scene = calibration_set(seed, floor=floor, faults=fault, noise_px=0.04, views=14)
    if floor != "both" or scene.seen.reference is None:
        return scene
    reference = replace(scene.seen.reference, mark_std_px=0.1)
    return replace(scene, seen=replace(scene.seen, reference=reference))


def _calibrated(scene: CornerScene) -> tuple[float, list[str]]:
    """Position error over the picture on the plane at 0.35 m [mm], and the codes of warnings and refusals."""
    calibration: Calibration = calibrate_observations(scene.seen, _QUICK, {}, heights_m=(0.35,))
    codes = [finding.code for finding in calibration.findings if finding.severity != "note"]
    return 1e3 * calibration_table.position_errors_m(calibration, scene, 0.35)[0], codes


_BOARD_SEEDS = range(8200, 8210)


def _boards() -> Values:
    """Errors over seeds with boards that are not as stated, believed and doubted, and how often they are named."""
    found: dict[str, float] = {}
    for name, each in _NOT_AS_STATED.items():
        scenes = [_filmed(seed, fault, each.floor) for seed in _BOARD_SEEDS for fault in each.faults]
        errors, codes = zip(*(_calibrated(doubted(scene)) for scene in scenes), strict=True)
        named = sum(each.named in given if each.named else bool(given) for given in codes)
        found |= {f"{name}, believed": max(_calibrated(scene)[0] for scene in scenes), f"{name}, worst": max(errors)}
        found[f"{name}, median"] = float(np.median(errors))
        found[f"{name}, {each.named or 'any warning'}, of 20"] = float(named)
    return found


def _half_as_far(original: Callable[..., Any]) -> Callable[..., Any]:
    """The faults of boards and pictures are half as large as they are said to be."""

    def halved(*args: Any, faults: BoardFaults, **kwargs: Any) -> Any:
        half = BoardFaults((1 + faults.size) / 2, faults.bow_m / 2, faults.thicker_m / 2, (1 + faults.zoom) / 2)
        return original(*args, faults=half, **kwargs)

    return halved


BOARDS = Check(
    _boards,
    {
        "the board is believed": replaced(_HERE, "doubted", lambda _: lambda scene: scene),
        "findings are dropped, and faults are half as large": both(
            replaced(_HERE, "calibrate_observations", _silent), replaced(_HERE, "calibration_set", _half_as_far)
        ),
    },
)
