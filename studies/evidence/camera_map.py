"""Checks of the map of camera faults: all strengths on a filmed run, middle strengths on synthetic tows, boards."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import towval.calibration.calibrate as calibrating
from studies.camera_faults.faults import FAULTS
from studies.camera_faults.tows import filmed_tow
from studies.evidence.cameras import uncorrected
from studies.evidence.compute import shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced
from studies.tables.calibration_faults import cells
from studies.tables.camera_faults import OUTCOMES, filmed, rows
from towval.commands import track
from towval.model.errors import RefusedError

_CAMPAIGN = Path("data_samples/lab_small")
_TOWS = range(7710, 7720)
_ALL, _MIDDLE = (0, 1, 2), (1,)


def _refused(_track: Any) -> Any:
    """A tracker that takes no film."""

    def refuse(*_given: Any, **_options: Any) -> None:
        raise RefusedError("the film is refused")

    return refuse


def _name(cell: pd.Series) -> str:
    return f"{cell.fault}, {cell.strength:g} {cell.unit}".strip()


def _totals(table: pd.DataFrame) -> dict[str, float | str]:
    """How many cells ended in each way, which are silently wrong, and their largest error over what is allowed."""
    counts = Counter(table.poses)
    found: dict[str, float | str] = {f"all, {outcome}": float(counts[outcome]) for outcome in OUTCOMES}
    silent: dict[str, float] = {}
    for _, cell in table[table.poses == "silently wrong"].iterrows():
        silent[_name(cell)] = max(silent.get(_name(cell), 0.0), cell.worst)
    found["silently wrong"] = ", ".join(silent) or "none"
    return found | {f"{name}, error over what is allowed": worst for name, worst in silent.items()}


def _of_run() -> Values:
    """What becomes of the poses in each cell, and how far they are off [mm]; findings of each fault."""
    with filmed(f"{_CAMPAIGN}:b:8") as (source, camera):
        table = pd.DataFrame(rows(source, camera, FAULTS, _ALL, judged=False))
    found = _totals(table)
    for fault, own in table.groupby("fault", sort=False):
        for _, cell in own.iterrows():
            refused = cell.said.startswith("refused")
            found[_name(cell)] = "refused" if refused else cell.poses
            if not refused:
                found[f"{_name(cell)}, off"] = cell.rms_mm
        found[f"{fault}, findings"] = ", ".join(dict.fromkeys(code for codes in own.codes for code in codes)) or "none"
    return found


def _of_tows() -> Values:
    """How the tows ended by fault, how far their poses are off [mm, median], and findings of half of them or more."""
    cells: list[dict[str, object]] = []
    for seed in _TOWS:
        with filmed_tow(seed) as (source, camera):
            cells += ({"seed": seed} | cell for cell in rows(source, camera, FAULTS, _MIDDLE, judged=False))
    table = pd.DataFrame(cells)
    found = _totals(table)
    for _, own in table.groupby("fault", sort=False):
        name, counts = _name(own.iloc[0]), Counter(own.poses)
        found[name] = ", ".join(f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome])
        if own.rms_mm.notna().any():
            found[f"{name}, off"] = float(np.nanmedian(own.rms_mm))
        often = Counter(code for codes in own.codes for code in codes)
        found[f"{name}, findings"] = (
            ", ".join(code for code, count in often.most_common() if 2 * count >= len(own)) or "none"
        )
    return found


def _of_boards() -> Values:
    """Difference of positions that faults of the calibration make, what is stated there [mm], and findings."""
    found: dict[str, float | str] = {}
    codes: dict[str, dict[str, None]] = {}
    for cell in cells(_CAMPAIGN):
        name = f"{cell.fault}, {cell.strength}"
        found |= {name: "refused"} if cell.refused else {name: cell.off_mm, f"{name}, stated": cell.stated_mm}
        codes.setdefault(cell.fault, {}).update(dict.fromkeys(cell.codes))
    return found | {f"{fault}, findings": ", ".join(sorted(each)) or "none" for fault, each in codes.items()}


def _of_lab_c() -> Values:
    """How many faults at their middle strength ended in each way on another program's footage; which are silent."""
    with filmed(f"{shared_folder() / 'footage' / 'lab_c'}:g:8") as (source, camera):
        table = pd.DataFrame(rows(source, camera, FAULTS, _MIDDLE, judged=False))
    silent = table[table.poses == "silently wrong"]
    found = _totals(table) | {f"{_name(cell)}, error over what is allowed": cell.worst for _, cell in silent.iterrows()}
    return found | {"silently wrong": ", ".join(silent.fault) or "none"}


_REFUSES = {"the tracker refuses every film": replaced(track, "run", _refused)}

OF_RUN = Check(_of_run, {"nothing is corrected": uncorrected} | _REFUSES)
OF_TOWS = Check(_of_tows, _REFUSES)
OF_BOARDS = Check(
    _of_boards,
    {
        "the floor behind held boards is not looked at": replaced(
            calibrating, "as_floor_shows", lambda _: lambda observed, *_given: (observed, {}, ())
        )
    },
)
OF_LAB_C = Check(_of_lab_c, _REFUSES, needs=("footage/lab_c",))
