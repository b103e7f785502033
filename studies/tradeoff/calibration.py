"""Cost and error of a calibration: number of views and lens model, in mm on the floor and on a planar target.

Boards are observed by a random camera (:mod:`studies.worlds.boards`), so that true positions are known everywhere.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from studies.costs import take_turns
from studies.frame import Part, Row, Scatter, Settings, Study, point
from studies.worlds.boards import CornerScene, calibration_set
from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.lens import LENS_MODELS
from towval.model import Calibration
from towval.model.errors import RefusedError
from towval.optics.plane_uncertainty import pixel_grid
from towval.optics.projection import to_plane

HEIGHTS_M = {"floor": 0.0, "top at 0.35 m": 0.35}
SELECTED = "selected by the stage"


def position_error_m(calibration: Calibration, scene: CornerScene, height_m: float) -> float:
    """RMS distance between estimated and true positions of the image's pixels on a plane [m]."""
    pixels = pixel_grid(scene.camera.resolution_px, 24).reshape(-1, 2)
    estimated = to_plane(calibration.camera, calibration.floor, pixels, height_m)
    true = to_plane(scene.camera, scene.floor, pixels, height_m)
    return float(np.sqrt(np.mean(np.sum((estimated - true) ** 2, axis=1))))


def calibration_rows(seed: int, views: list[int], models: list[str]) -> list[Row]:
    """A row a number of views, lens model and plane: CPU seconds without the search for corners, error in mm."""
    scenes = {count: calibration_set(seed, views=count, floor="boards") for count in views}
    calls = {
        f"{count}|{model}": lambda c=count, m=model: _calibrated(scenes[c], m) for count in views for model in models
    }
    rows = []
    for name, timed in take_turns(calls, 2).items():
        count, model = name.split("|")
        for panel, height in HEIGHTS_M.items():
            calibration = timed.result
            error = np.nan if calibration is None else 1e3 * position_error_m(calibration, scenes[int(count)], height)
            rows.append(
                {
                    "panel": panel,
                    "series": model,
                    "setting": f"{count} views",
                    "cost": timed.cpu_s,
                    "cost_most": timed.cpu_most_s,
                    "error": error,
                    "default": model == SELECTED and int(count) == 12,
                    "seed": seed,
                    "lens_model": "" if calibration is None else calibration.camera.lens_model,
                }
            )
    return rows


def _calibrated(scene: CornerScene, model: str) -> Calibration | None:
    models = tuple(LENS_MODELS) if model == SELECTED else (model,)
    try:
        return calibrate_observations(scene.seen, CalibrateSettings(lens_models=models), {})
    except RefusedError:
        return None


def _parts(settings: Settings) -> dict[str, Part]:
    models = ["none", "k1", "k1 k2", "rational", SELECTED]
    if settings.quick:
        return {f"seed_{seed}": {"seed": seed, "views": [6, 12], "models": ["k1 k2", SELECTED]} for seed in range(1, 5)}
    return {f"seed_{seed}": {"seed": seed, "views": [4, 6, 12, 20], "models": models} for seed in range(27100, 27110)}


def _why(rows: pd.DataFrame) -> str:
    def errors(model: str, views: int = 12) -> str:
        return " and ".join(f"{point(rows, model, f'{views} views', panel).error:.2g}" for panel in HEIGHTS_M)

    return (
        f"Floor and top are then {errors(SELECTED)} mm off; with 4 views {errors(SELECTED, 4)}, with 20 "
        f"{errors(SELECTED, 20)}. With 12 views of k1 k2, the true lens, which in a lab nobody knows, they are "
        f"{errors('k1 k2')} mm off; of k1, which is too small, {errors('k1')}; of rational, too large, "
        f"{errors('rational')}."
    )


STUDY = Study(
    parts=_parts,
    rows=calibration_rows,
    chart=Scatter(
        title="Calibration: lens models and numbers of views",
        cost="CPU time without the search for corners [s]",
        error="RMS position error [mm]",
        note="Random cameras. Labels: views, tilted 20° to 40°, corner noise 0.15 px; "
        "the floor frame from seven boards. The true lens has k1 and k2.",
        take="Take 12 views, as advised, and let the stage select the lens, the default.",
        why=_why,
        truth="The truth shares the camera model with the calibration.",
    ),
)
