"""What the stages hand to each other: frozen dataclasses over locked float64 arrays, checked where they are built.

Units, frames and symbols are those of :mod:`towval.conventions`. NaN means "missing" and is never filled silently.
"""

from towval.types.camera import (
    CALIBRATION_PARAMETERS,
    DISTORTION_NAMES,
    Board,
    Calibration,
    Camera,
    Floor,
    FloorReference,
    UncertaintyMap,
    View,
)
from towval.types.checks import Array, locked
from towval.types.choices import Choice
from towval.types.findings import Finding, Severity
from towval.types.identification import Identification, Prediction
from towval.types.results import Comparison, Path, RunUncertainty, SimulatedMotion, Verdict
from towval.types.scene import FrictionLaw, FrictionWish, InputDeviations, Load, Patch, Scene, Tether, TowedObject
from towval.types.tracks import Body, DecimatedTrack, Features, Track, TrackStatus

__all__ = [
    "CALIBRATION_PARAMETERS",
    "DISTORTION_NAMES",
    "Array",
    "Board",
    "Body",
    "Calibration",
    "Camera",
    "Choice",
    "Comparison",
    "DecimatedTrack",
    "Features",
    "Finding",
    "Floor",
    "FloorReference",
    "FrictionLaw",
    "FrictionWish",
    "Identification",
    "InputDeviations",
    "Load",
    "Patch",
    "Path",
    "Prediction",
    "RunUncertainty",
    "Scene",
    "Severity",
    "SimulatedMotion",
    "Tether",
    "TowedObject",
    "Track",
    "TrackStatus",
    "UncertaintyMap",
    "Verdict",
    "View",
    "locked",
]
