"""Check of what the tracker's corrections are worth: faults of the camera in synthetic tows, a tow a seed."""

from __future__ import annotations

import sys

import numpy as np

from studies.camera_faults.tows import filmed_tow
from studies.camera_faults.trial import Result
from studies.evidence.cameras import aside, fault_called, left_out, tried_once, uncorrected
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import replaced, result_of
from towval.commands import track

_HERE = sys.modules[__name__]
_TOWS = range(7500, 7510)

_NAMES = (
    "none", "creep", "shake", "knock", "rotation", "other zoom of video", "lens corrected in video", "focus hunting",
    "banner", "clicks shifted",
)  # fmt: skip


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
