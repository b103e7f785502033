"""Model selection for the stage calibrate: the effect of the next larger lens model."""

from dataclasses import replace

import numpy as np

from towval.calibration.calibrate import CalibrateSettings, calibrate_observations
from towval.calibration.corners import BoardObservation
from towval.calibration.doubts import doubts_std
from towval.calibration.lens import LENS_MODELS, families
from towval.calibration.observations import MARKS_VIEW, CalibrationObservations
from towval.model import Board, Calibration, Choice, FloorReference
from towval.model.camera import is_fisheye
from towval.model.errors import RefusedError
from towval.model.geometry import rms_length
from towval.optics.plane_uncertainty import pixel_grid
from towval.optics.projection import to_plane


def with_lens_choice(
    calibration: Calibration, board: Board, reference: FloorReference, settings: CalibrateSettings, height_m: float
) -> Calibration:
    """The calibration with the effect of the next larger lens model (if any, else smaller) on a target's plane."""
    chosen = calibration.camera.lens_model
    models = families(tuple(LENS_MODELS))[is_fisheye(chosen)]
    place = models.index(chosen)
    following = models[place + 1] if place + 1 < len(models) else models[place - 1]
    used = [view for view in calibration.views if not view.dropped and view.name != MARKS_VIEW]
    held, flat = (
        tuple(BoardObservation(view.name, view.corners_px, view.board_m) for view in used if view.on_floor == lying)
        for lying in (False, True)
    )
    resolution_px, doubts = calibration.camera.resolution_px, doubts_std(board, reference)
    seen = CalibrationObservations(resolution_px, held, flat, reference, doubts)
    # With one model there is nothing to select: no views are held out.
    alone = replace(settings, lens_models=(following,), folds=0)
    try:
        other = calibrate_observations(seen, alone, {})
        pixels = pixel_grid(resolution_px, 16).reshape(-1, 2)
        there = [to_plane(each.camera, each.floor, pixels, height_m) for each in (calibration, other)]
        apart = there[0] - there[1]
        # A pixel above the horizon does not see the plane.
        change = rms_length(apart[np.isfinite(apart).all(axis=1)])
    except RefusedError:
        change = float("nan")
    measure = f"RMS over the picture at {height_m:g} m"
    return replace(calibration, choices=(Choice("lens model", chosen, following, change, measure),))
