"""Checks on filmed runs with faults of the camera: what becomes of the poses, and of the verdict."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies.camera_faults.faults import FAULTS, Fault
from studies.camera_faults.trial import Footage, Result, tried
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import both, replaced, result_of
from studies.tables.camera_faults import filmed
from towval.commands import simulate, track
from towval.model import Track
from towval.tracking import alignment, finished_track
from towval.tracking import track as tracking
from towval.tracking.blur import Shutter
from towval.tracking.clicks import Clicked
from towval.tracking.focus import Focus
from towval.tracking.light import LightConstants
from towval.tracking.two_measurements import Compared
from towval.tracking.watched_floor import WatchedFloor

LONGER_M = 0.034
"""Twice the smallest rest length that shows in run a without a fault."""

_HERE = sys.modules[__name__]
_CAMPAIGN, _SECONDS = Path("data_samples/lab_small"), 8.0
_SETTLED_ON, _OTHER = "a", "b"
"""The run on which the methods were settled, and the other one."""

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


def _of_each(run: str, measure: Callable[[Footage, Fault, Path], dict[str, float | str]]) -> Values:
    """What is measured of each fault at its middle strength; once of all where nothing is planted."""
    found: dict[str, float | str] = {}
    of_none: dict[str, float | str] | None = None
    with filmed(f"{_CAMPAIGN}:{run}:{_SECONDS:g}") as (source, camera):
        for name in _NAMES:
            fault = fault_called(name)
            values = of_none if fault.is_none and of_none is not None else measure(source, fault, camera)
            of_none = values if fault.is_none else of_none
            found |= {f"{name}, {what}": value for what, value in values.items()}
    return found


def tried_once(source: Footage, fault: Fault, camera: Path, **how: Any) -> Result:
    """How a fault ends at its middle strength; ``how`` as :func:`tried` takes it."""
    with TemporaryDirectory() as folder:
        return tried(source, fault, fault.strengths[1], Path(folder), camera, **how)


def _poses(source: Footage, fault: Fault, camera: Path) -> dict[str, float | str]:
    """What became of the poses, how far they are off [mm], also where nothing is corrected, and findings.

    "Harmless": they are as good without the corrections.
    """
    found = tried_once(source, fault, camera, judged=False)
    with uncorrected():
        bare = tried_once(source, fault, camera, judged=False)
    harmless = found.poses == bare.poses == "corrected"
    return {
        "poses": "harmless" if harmless else found.poses,
        "poses off": found.rms_mm,
        "without corrections": bare.rms_mm,
        "findings": ", ".join(found.codes),
    }


def _verdicts(source: Footage, fault: Fault, camera: Path) -> dict[str, float | str]:
    """The verdicts on a right model, and on one whose tether is stated too long."""
    right, longer = (tried_once(source, fault, camera, longer_m=longer_m).said for longer_m in (0.0, LONGER_M))
    return {"right model": right.split(":")[0], "tether stated too long": longer.split(":")[0]}


def _as_clicked(
    _pictures: Any, _calibration: Any, _bodies: Any, clicks_px: dict[str, Any], _tow: Any
) -> dict[str, Clicked]:
    return {name: Clicked(np.asarray(clicks, dtype=float), np.zeros((3, 3))) for name, clicks in clicks_px.items()}


def _without_steps(found: Compared) -> Compared:
    return replace(found, steps=np.zeros_like(found.steps))


uncorrected = both(
    # The camera stands still, and stands where the pictures of the floor were taken.
    replaced(WatchedFloor, "shows_texture", lambda _: property(lambda _self: False)),
    replaced(track, "calibration_at_start", lambda _: lambda calibration, *_given: (calibration, ())),
    # Bodies are as sharp as in the first picture, do not blur as they move, and light changes its level alone.
    replaced(Focus, "allowed", lambda _: lambda *_given: 0),
    replaced(Shutter, "template", lambda _: lambda *_given: None),
    replaced(Shutter, "exposure_s", lambda _: property(lambda _self: 0.0)),
    replaced(alignment, "LIGHT", lambda _: LightConstants(gain_spread=1e-3)),
    # The texture is right where the outline contradicts it, clicks are right, and nothing covers a top at the start.
    replaced(finished_track, "compared", result_of(_without_steps)),
    replaced(track, "check_clicks", lambda _: _as_clicked),
    replaced(track, "standing_still", lambda _: lambda *_given: []),
    # All rows are read at once; each picture was taken.
    replaced(track, "_readout", result_of(lambda _: (0.0, 0.0))),
    replaced(tracking, "field_lateness", result_of(np.zeros_like)),
    replaced(tracking, "check_invented", lambda _: lambda tracks: (dict(tracks), ())),
)
"""Plants that the tracker corrects nothing, and allows for nothing, that the faults of the table change."""


def aside(tracks: dict[str, Track]) -> dict[str, Track]:
    """The tracks, 20 mm to one side."""
    return {name: replace(each, pose=each.pose + np.array([0.0, 0.02, 0.0])) for name, each in tracks.items()}


def left_out(fault: Fault) -> Fault:
    """The fault by name, which does nothing."""
    return Fault(fault.name, fault.strengths, fault.unit, fault.named_by)


_LEFT_OUT = replaced(_HERE, "fault_called", result_of(left_out))

CAMERA_POSES = Check(
    lambda: _of_each(_OTHER, _poses),
    {
        "poses are 20 mm to one side": replaced(track, "track", result_of(aside)),
        "nothing is corrected": uncorrected,
        "the faults are left out": _LEFT_OUT,
    },
)


def _shorter(original: Any) -> Any:
    """What simulates, with a tether that is as much shorter than stated."""

    def wrong(scene: Any, *args: Any, **keys: Any) -> Any:
        tether = replace(scene.tether, rest_length=scene.tether.rest_length - LONGER_M)
        return original(replace(scene, tether=tether), *args, **keys)

    return wrong


CAMERA_VERDICTS = Check(
    lambda: _of_each(_SETTLED_ON, _verdicts),
    {
        "the simulated tether is 34 mm shorter than stated": replaced(simulate, "simulate_selecting", _shorter),
        "the faults are left out": _LEFT_OUT,
    },
)
