"""Checks of the map of camera faults: all strengths on a filmed run, middle strengths on synthetic tows, boards."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import towval.calibration.calibrate as calibrating
from studies.camera_faults.faults import FAULTS
from studies.camera_faults.tows import filmed_tow
from studies.camera_faults.trial import Footage
from studies.evidence.cameras import aside, left_out
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from studies.tables import calibration_faults
from studies.tables.camera_faults import OUTCOMES, filmed, rows
from towval.commands import track
from towval.model import UncertaintyMap

_HERE = sys.modules[__name__]
_CAMPAIGN = Path("data_samples/lab_small")
_TOWS = range(7710, 7720)
_ALL, _MIDDLE = (0, 1, 2), (1,)


def _table(source: Footage, camera: Path, strengths: Sequence[int]) -> pd.DataFrame:
    """A row a cell; all where nothing is planted are the same, and run once."""
    cells: list[dict[str, object]] = []
    of_none: dict[str, object] = {}
    for fault in FAULTS:
        for i in strengths:
            if not (fault.is_none and of_none):
                (cell,) = rows(source, camera, [fault], [i], judged=False)
                of_none = cell if fault.is_none else of_none
            else:
                cell = of_none | {"fault": fault.name, "strength": fault.strengths[i], "unit": fault.unit}
            cells.append(cell)
    return pd.DataFrame(cells)


def _name(cell: pd.Series) -> str:
    return f"{cell.fault}, {cell.strength:g} {cell.unit}".strip()


def _joined(words: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(words)) or "none"


def _totals(table: pd.DataFrame) -> dict[str, float | str]:
    """How many cells ended in each way, which are silently wrong, and the largest error of those over the allowed, 0
    where there are none."""
    counts = Counter(table.poses)
    found: dict[str, float | str] = {f"all, {outcome}": float(counts[outcome]) for outcome in OUTCOMES}
    worst = dict.fromkeys((_name(cell) for _, cell in table.iterrows()), 0.0)
    for _, cell in table[table.poses == "silently wrong"].iterrows():
        worst[_name(cell)] = max(worst[_name(cell)], cell.worst)
    found["silently wrong"] = _joined(name for name, over in worst.items() if over > 0)
    return found | {f"{name}, error over the allowed": over for name, over in worst.items()}


def _of_run() -> Values:
    """What becomes of the poses in each cell, and how far they are off [mm]; findings of each fault."""
    with filmed(f"{_CAMPAIGN}:b:8") as (source, camera):
        table = _table(source, camera, _ALL)
    found = _totals(table)
    for fault, own in table.groupby("fault", sort=False):
        for _, cell in own.iterrows():
            refused = cell.said.startswith("refused")
            found[_name(cell)] = "refused" if refused else cell.poses
            if not refused:
                found[f"{_name(cell)}, off"] = cell.rms_mm
        found[f"{fault}, findings"] = _joined(code for codes in own.codes for code in codes)
    return found


def _of_tows() -> Values:
    """How the tows ended by fault, how far their poses are off [mm, median], and findings of half of them or more."""
    of_each = []
    for seed in _TOWS:
        with filmed_tow(seed) as (source, camera):
            of_each.append(_table(source, camera, _MIDDLE))
    table = pd.concat(of_each)
    found = _totals(table)
    for _, own in table.groupby("fault", sort=False):
        name, counts = _name(own.iloc[0]), Counter(own.poses)
        found[name] = ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome])
        if own.rms_mm.notna().any():
            found[f"{name}, off"] = float(np.nanmedian(own.rms_mm))
        often = Counter(code for codes in own.codes for code in codes)
        found[f"{name}, findings"] = _joined(code for code, count in often.most_common() if 2 * count >= len(own))
    return found


def _of_boards() -> Values:
    """Difference of positions that faults of the calibration make, what is stated there [mm], and findings."""
    found: dict[str, float | str] = {}
    codes: dict[str, dict[str, None]] = {}
    for cell in calibration_faults.cells(_CAMPAIGN):
        name = f"{cell.fault}, {cell.strength}"
        found |= {name: "refused"} if cell.refused else {name: cell.off_mm, f"{name}, stated": cell.stated_mm}
        codes.setdefault(cell.fault, {}).update(dict.fromkeys(cell.codes))
    return found | {f"{fault}, findings": _joined(sorted(each)) for fault, each in codes.items()}


_LEFT_OUT = replaced(_HERE, "FAULTS", lambda faults: [left_out(each) for each in faults])
_CONTROLS = {
    "the faults are left out": _LEFT_OUT,
    "the faults are left out, and poses are 20 mm to one side": both(
        _LEFT_OUT, replaced(track, "track", result_of(aside))
    ),
}

OF_RUN = Check(_of_run, _CONTROLS)
OF_TOWS = Check(_of_tows, _CONTROLS)


def _halved(found: UncertaintyMap) -> UncertaintyMap:
    return replace(found, covariance_m2=found.covariance_m2 / 4)


OF_BOARDS = Check(
    _of_boards,
    {
        "the floor behind held boards is not looked at": replaced(
            calibrating, "as_floor_shows", lambda _: lambda observed, *_given: (observed, {}, ())
        ),
        "the faults are left out, and what is stated is half as much": both(
            replaced(calibration_faults, "calibrated", lambda right: lambda folder, *_: right(folder, FAULTS[0], 1)),
            replaced(calibration_faults, "uncertainty_map", result_of(_halved)),
        ),
    },
)
