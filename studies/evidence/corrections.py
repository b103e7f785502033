"""Check of what the tracker's corrections are worth: faults of the camera in synthetic tows, a tow a seed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from studies.camera_faults.trial import Footage, Result, footage
from studies.evidence.cameras import aside, fault_called, left_out, tried_once, uncorrected
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced, result_of
from studies.worlds.campaign import FRAMES, random_tow
from studies.worlds.folder import film_campaign
from towval.commands import calibrate, track
from towval.model import Array

_HERE = sys.modules[__name__]
_TOWS = range(7500, 7510)

_NAMES = (
    "none", "creep", "shake", "knock", "rotation", "other zoom of video", "lens corrected in video", "focus hunting",
    "banner", "clicks shifted",
)  # fmt: skip


@contextmanager
def filmed_tow(seed: int) -> Iterator[tuple[Footage, Path]]:
    """The footage of a random tow whose truth is known, and the calibration of its camera."""
    with TemporaryDirectory() as scratch:
        folder, camera = Path(scratch) / "synthetic", Path(scratch) / "camera.mcap"
        folder.mkdir()
        truth = film_campaign(folder, *random_tow(seed, FRAMES), seed=seed)
        _truth_table(truth).to_csv(folder / "a_truth.csv", index=False)
        calibrate.run(folder, camera)
        yield footage(folder, "a", float(truth["time_s"][-1]), camera), camera


def _truth_table(truth: dict[str, Array]) -> pd.DataFrame:
    """Poses as in the table of truth beside filmed runs."""
    columns = {"t_s": truth["time_s"]}
    for body in ("rover", "object"):
        for part, values in zip(("x_m", "y_m", "heading_rad"), truth[body].T, strict=True):
            columns[f"{body}_{part}"] = values
    return pd.DataFrame(columns)


def _corrections() -> Values:
    """By fault: how far poses are off [mm, RMS] with and without corrections, and of how many tows what became."""
    results: dict[str, list[Result]] = {}
    for seed in _TOWS:
        with filmed_tow(seed) as (source, camera):
            for name in _NAMES:
                fault = fault_called(name)
                results.setdefault(name, []).append(tried_once(source, fault, camera, judged=False))
                with uncorrected():
                    bare = tried_once(source, fault, camera, judged=False)
                results.setdefault(f"{name}, without corrections", []).append(bare)
    found: dict[str, float] = {}
    for what, tows in results.items():
        found[f"{what}, median"] = float(np.nanmedian([each.rms_mm for each in tows]))
        found[f"{what}, corrected"] = float(sum(each.poses == "corrected" for each in tows))
        found[f"{what}, silently wrong"] = float(sum(each.poses == "silently wrong" for each in tows))
    return found


CORRECTIONS = Check(
    _corrections,
    {
        "nothing is corrected": uncorrected,
        "poses are 20 mm to one side": replaced(track, "track", result_of(aside)),
        "the faults are left out": replaced(_HERE, "fault_called", result_of(left_out)),
    },
)
