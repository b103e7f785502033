"""Check on filmed runs with faults of the camera: what becomes of the poses and of the verdict."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies.camera_faults.faults import FAULTS, Fault
from studies.camera_faults.trial import Footage, footage, tried
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from towval.commands import calibrate, simulate, track
from towval.model import Track

LONGER_M = 0.034

_HERE = sys.modules[__name__]
_CAMPAIGN, _RUN, _SECONDS = Path("data_samples/lab_small"), "a", 8.0
_NAMES = (
    "none", "creep", "shake", "other zoom of video", "rolling shutter", "defocus", "focus hunting", "motion blur",
    "noise", "flicker", "fine flicker", "glint in the way", "person", "dropped", "wrong rate, none stated", "frozen",
    "H.264, capped", "board smaller", "deinterlaced", "pointer", "insect", "hood slips", "twin standing by",
    "board kicked", "warm air", "clips overlap", "clock set", "slower in low light", "fields swapped",
    "pictures invented", "pulsing groups of pictures",
)  # fmt: skip


def fault_called(name: str) -> Fault:
    """The fault of a name."""
    return next(fault for fault in FAULTS if fault.name == name)


def _verdicts() -> Values:
    """Of each fault: what became of the poses, how far they are off, and the verdicts on a right and a wrong model."""
    found: dict[str, float | str] = {}
    with TemporaryDirectory() as scratch:
        camera = Path(scratch) / "camera.mcap"
        calibrate.run(_CAMPAIGN, camera)
        source = footage(_CAMPAIGN, _RUN, _SECONDS, camera)
        for name in _NAMES:
            found |= _of_fault(source, fault_called(name), camera)
    return found


def _of_fault(source: Footage, fault: Fault, camera: Path) -> dict[str, float | str]:
    results = []
    for longer_m in (0.0, LONGER_M):
        with TemporaryDirectory() as folder:
            results.append(tried(source, fault, fault.strengths[1], Path(folder), camera, longer_m=longer_m))
    right, longer = results
    return {
        f"{fault.name}, poses": right.poses,
        f"{fault.name}, poses off": right.rms_mm,
        f"{fault.name}, right model": right.said.split(":")[0],
        f"{fault.name}, tether stated too long": longer.said.split(":")[0],
        f"{fault.name}, findings": ", ".join(right.codes),
    }


def _shorter(original: Any) -> Any:
    """What simulates, with a tether that is as much shorter than stated."""

    def wrong(scene: Any, *args: Any, **keys: Any) -> Any:
        tether = replace(scene.tether, rest_length=scene.tether.rest_length - LONGER_M)
        return original(replace(scene, tether=tether), *args, **keys)

    return wrong


def _aside(tracks: dict[str, Track]) -> dict[str, Track]:
    return {name: replace(each, pose=each.pose + np.array([0.0, 0.02, 0.0])) for name, each in tracks.items()}


def _left_out(fault: Fault) -> Fault:
    return Fault(fault.name, fault.strengths, fault.unit, fault.named_by)


CAMERA_VERDICTS = Check(
    _verdicts,
    {
        "the simulated tether is 34 mm shorter than stated, poses are 20 mm to one side": both(
            replaced(simulate, "simulate_selecting", _shorter), replaced(track, "track", result_of(_aside))
        ),
        "the faults are left out": replaced(_HERE, "fault_called", result_of(_left_out)),
    },
)
