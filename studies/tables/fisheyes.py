"""Calibration of fisheyes: by the lens that is chosen, by a fisheye's models alone, and by those of a pinhole camera.

    python -m studies.tables.fisheyes [--seeds 10] [--first-seed 9400]

Errors are root mean squares over the picture on a plane 0.2 m over the floor, up to 2.5 m from its origin; corners have
a noise of 0.06 px. Pixels that a calibration shows nowhere on the plane do not count. Lenses are chosen with three
folds, which is quicker than the six by default.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from tqdm import tqdm

from studies.worlds.fisheyes import FisheyeLab, fisheye_lab
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.lens import LENS_MODELS, families
from towval.calibration.observations import CalibrationObservations
from towval.commands.console import errors_reported
from towval.model import Severity
from towval.model.errors import RefusedError

FOCALS_PX = (780.0, 560.0)
"""Focal lengths: corners of the picture are seen at 59° and at 82° to the axis."""
HEIGHT_M = 0.2
PINHOLES, FISHEYES = families(tuple(LENS_MODELS))


def error_mm(lab: FisheyeLab, views: CalibrationObservations, models: tuple[str, ...]) -> float:
    """RMS error over the picture of a calibration that may choose among lens models [mm]; NaN where it is refused."""
    settings = CalibrateSettings(lens_models=models, folds=3, accept_refused=True)
    try:
        found = calibrate_observations(views, settings, {})
    except RefusedError:
        return float("nan")
    if any(finding.severity is Severity.REFUSAL for finding in found.findings):
        return float("nan")
    squares = np.sum(lab.error_m(found.camera, found.floor, HEIGHT_M) ** 2, axis=1)
    return 1e3 * float(np.sqrt(np.nanmean(squares)))


def errors_mm(seeds: range, focal_px: float) -> dict[str, list[float]]:
    """Errors over some sets with all lens models, and with those of one family [mm]."""
    choices = {"all models": tuple(LENS_MODELS), "models of a fisheye": FISHEYES, "models of a pinhole": PINHOLES}
    found: dict[str, list[float]] = {name: [] for name in choices}
    for seed in tqdm(seeds, desc=f"{focal_px:g} px", unit="set", leave=False, file=sys.stderr):
        lab = fisheye_lab(seed, focal_px)
        views = lab.views()
        for name, models in choices.items():
            found[name].append(error_mm(lab, views, models))
    return found


def summary(errors: list[float]) -> dict[str, float]:
    """How many calibrations are refused, and median and worst error of the others [mm]."""
    found = {"refused": float(np.isnan(errors).sum())}
    return found if np.isnan(errors).all() else found | {
        "median": float(np.nanmedian(errors)), "worst": float(np.nanmax(errors))
    }  # fmt: skip


@errors_reported()
def main() -> None:
    """Print how many calibrations of each focal length are refused, and median and worst error of the others."""
    parser = argparse.ArgumentParser(description="Calibration of fisheyes.")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=9400)
    given = parser.parse_args()
    for focal_px in FOCALS_PX:
        for name, errors in errors_mm(range(given.first_seed, given.first_seed + given.seeds), focal_px).items():
            print(f"{focal_px:g} px, {name}: {summary(errors)}")


if __name__ == "__main__":
    main()
