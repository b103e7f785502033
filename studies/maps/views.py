"""Where a calibration is right: over tilt and number of the boards, and the share of the picture that they cover."""

from __future__ import annotations

import numpy as np

from studies.frame import Maps, Part, Row, Settings, Study, judged, worst
from studies.tradeoff.calibration import HEIGHTS_M, position_error_m
from studies.worlds.boards import calibration_set
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.model.errors import TowvalError

ALLOWED_M = 5e-3
"""Greatest RMS position error on the floor or on a plane at 0.35 m."""

_PREFIX = "boards over "


def view_rows(share: float, tilts_deg: list[float], views: list[int], seeds: list[int]) -> list[Row]:
    """Cells over tilt and number of views: the worst of several random cameras."""
    return [
        {"map": _name(share), "x": tilt, "y": float(count)} | worst([_cell(seed, share, tilt, count) for seed in seeds])
        for tilt in tilts_deg
        for count in views
    ]


def _name(share: float) -> str:
    return f"{_PREFIX}{100 * share:.0f} % of the picture"


def _cell(seed: int, share: float, tilt_deg: float, count: int) -> Row:
    scene = calibration_set(seed, views=count, tilt_deg=(tilt_deg, tilt_deg), share=share, floor="boards")
    try:
        calibration = calibrate_observations(scene.seen, CalibrateSettings(), {})
    except TowvalError as error:
        return judged(np.nan, ALLOWED_M, [type(error).__name__])
    flags = [finding.code for finding in calibration.findings if finding.severity != "note"]
    return judged(max(position_error_m(calibration, scene, height) for height in HEIGHTS_M.values()), ALLOWED_M, flags)


def _parts(settings: Settings) -> dict[str, Part]:
    tilts = [0.0, 30.0] if settings.quick else [0.0, 2.0, 5.0, 10.0, 20.0, 35.0]
    views = [4, 12] if settings.quick else [3, 4, 6, 8, 12, 16]
    shares = [1.0] if settings.quick else [1.0, 0.3]
    return {
        f"share_{100 * share:.0f}": {
            "share": share,
            "tilts_deg": tilts,
            "views": views,
            "seeds": [21] if settings.quick else list(range(21, 31)),
        }
        for share in shares
    }


STUDY = Study(
    parts=_parts,
    rows=view_rows,
    chart=Maps(
        title="Calibration: number, tilt and spread of the boards",
        axes={_name(share): ("tilt of the boards [deg]", "number of views") for share in (1.0, 0.3)},
        note="Right: 5 mm RMS or less on the floor and on a plane at 0.35 m, camera at 4 m. Flagged: a warning or a "
        "refusal. The worst of ten random cameras; corner noise 0.15 px, seven boards on the floor.",
        take="Film 12 boards or more, as advised, tilted by 20° to 40° and over the whole picture; what "
        "cannot fix the camera is flagged.",
        default={_name(share): {"y": 12.0} for share in (1.0, 0.3)},
    ),
)
