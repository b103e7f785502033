"""What the stages hand to each other: frozen dataclasses over locked float64 arrays, checked where they are built.

Units, frames and symbols are those of :mod:`towval.model.conventions`. NaN means "missing" and is never filled.
"""

import towval.model.findings_of_plans
import towval.model.findings_of_simulation
import towval.model.findings_of_video  # noqa: F401 - its rows enter the table
from towval.model.camera import (
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
from towval.model.checks import Array, locked
from towval.model.choices import Choice
from towval.model.findings import Finding, Severity
from towval.model.friction import FrictionLaw, check_friction_law
from towval.model.identification import Identification, Prediction
from towval.model.results import Comparison, RunUncertainty, SimulatedMotion, TimedPath
from towval.model.statement import Bounds, Draws, Explanation, Verdict, VisibleFault
from towval.model.towing import (
    FloorRegion,
    FrictionSpecification,
    Ground,
    Load,
    MassSpread,
    Patch,
    Sliding,
    Tether,
    TowedObject,
    TowingScene,
)
from towval.model.tracks import Body, CameraTrack, DecimatedTrack, Features, Stamp, Tag, Track, TrackStatus

__all__ = [
    "CALIBRATION_PARAMETERS", "DISTORTION_NAMES", "Array", "Board", "Body", "Bounds", "Calibration", "Camera",
    "CameraTrack", "Choice", "Comparison", "DecimatedTrack", "Draws", "Explanation", "Features", "Finding", "Floor",
    "FloorReference", "FloorRegion", "FrictionLaw", "FrictionSpecification", "Ground", "Identification", "Load",
    "MassSpread", "Patch", "Prediction", "RunUncertainty", "Severity", "SimulatedMotion", "Sliding", "Stamp", "Tag",
    "Tether", "TimedPath", "TowedObject", "TowingScene", "Track", "TrackStatus", "UncertaintyMap", "Verdict", "View",
    "VisibleFault", "check_friction_law", "locked",
]  # fmt: skip
