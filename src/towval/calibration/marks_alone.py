"""Camera and floor from surveyed marks on the floor, without any board.

Marks on one plane tell where the plane is and how the lens bends it, but hardly the focal length: the covariance says
so, and positions above the floor are as uncertain as that makes them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from towval.calibration.adequacy import floor_quality
from towval.calibration.blocks import CAMERA_END, LENS_START, Block, Estimate, Placement, residuals
from towval.calibration.bundle_adjustment import adjust, marginal_covariance
from towval.calibration.lens import LensTrial, active_parameters, choose_lens, families, may_be_fisheye
from towval.calibration.observations import MARKS_VIEW, CalibrationObservations, with_floor
from towval.calibration.single_marks import misfit_findings
from towval.calibration.stray_marks import with_sound_marks
from towval.model import Array, Calibration, Camera, Floor, FloorReference, View
from towval.model.camera import is_fisheye
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import lifted
from towval.optics.projection import to_plane, undistorted_kernel

_SPARE = 2
"""Numbers that the marks give beyond the unknowns, at least: with fewer nothing checks the fit."""


def calibrate_marks(
    resolution_px: tuple[int, int], reference: FloorReference, models: Sequence[str], *, heights_m: Sequence[float] = ()
) -> Calibration:
    """Calibrate from surveyed marks alone; of the lens models that which predicts left-out marks is taken.

    ``reference`` has the deviation of a pixel; the residuals' counts where that is clearly larger. ``models`` begin
    with the smallest; ``heights_m`` are planes for which the uncertainty of positions is stated besides the floor [m].
    `InputError` for too few marks, marks on a line, in left-handed coordinates, or marks that contradict each other.
    """
    return with_sound_marks(
        reference, resolution_px, lambda sound: _calibrated(resolution_px, sound, models, heights_m)
    )


def _calibrated(
    resolution_px: tuple[int, int], reference: FloorReference, models: Sequence[str], heights_m: Sequence[float]
) -> Calibration:
    """As :func:`calibrate_marks`, with all of the marks."""
    pinholes, fisheyes = families([model for model in models if _enough(reference, model)])
    trials = _trials(resolution_px, reference, pinholes)
    if fisheyes and (not trials or may_be_fisheye(choose_lens(trials).estimate, resolution_px)):
        trials += _trials(resolution_px, reference, fisheyes)
    if not trials:
        raise InputError(
            "too few surveyed marks to calibrate a camera without a board",
            got=f"{len(reference.marks_px)} marks",
            allowed="six marks, all over the picture; twenty are good",
            remedy="survey more marks, or film a board (camera.calibration_images and camera.board)",
        )
    chosen = choose_lens(trials)
    active, estimate = active_parameters(chosen.model, with_floor=True), chosen.estimate
    squares, freedom = float(np.sum(_residual(reference, estimate) ** 2)), 2 * len(reference.marks_px) - len(active)
    worse = squares > reference.mark_std_px**2 * chdtri(freedom, 0.001)
    std_px = np.sqrt(squares / freedom) if worse else reference.mark_std_px
    covariance, _ = marginal_covariance([_block(reference, std_px)], estimate, active)
    covariance = covariance + _of_selection(chosen, trials)
    camera = Camera(resolution_px, estimate.matrix, estimate.distortion, chosen.model)
    calibration = Calibration(camera, Floor(estimate.T_camera_floor), covariance, std_px)
    calibration = _reported(calibration, reference, chosen, (0.0, *heights_m))
    single = misfit_findings([_block(reference, std_px)], estimate, active, reference.mark_std_px)
    return replace(calibration, findings=(*calibration.findings, *single))


def _of_selection(chosen: LensTrial, trials: Sequence[LensTrial]) -> Array:
    """What may be missing in a lens model that is smaller than the one that predicts best, as a covariance.

    A few marks predict about as well with a coefficient too few. Its deviations know nothing of that coefficient: where
    the lens has it, errors in the corners of the picture are three times what they say.
    """
    alike = [trial for trial in trials if trial.determined and is_fisheye(trial.model) == is_fisheye(chosen.model)]
    best = min(alike, key=lambda trial: trial.score_px2, default=chosen)
    missing = best.estimate.shared - chosen.estimate.shared
    return np.outer(missing, missing)


def _trials(resolution_px: tuple[int, int], reference: FloorReference, models: Sequence[str]) -> list[LensTrial]:
    """Fits of the lens models of one family with how each predicts the marks, those that are determined if any is."""
    if not models:
        return []
    width, height = resolution_px
    start = np.zeros(CAMERA_END)
    start[:LENS_START] = width, width, (width - 1) / 2, (height - 1) / 2
    observed = CalibrationObservations(resolution_px, (), (), reference)
    camera = Estimate(start, (np.zeros(0),), noise_px=1.0, fisheye=is_fisheye(models[0]))
    first = with_floor(observed, camera, ())
    fits = [_fitted(reference, first, model) for model in models]
    # A model that the marks do not determine takes a hundred times as long to predict them, and is not chosen.
    fits = [fit for fit in fits if fit.determined] or fits
    fits = [fit for fit in fits if _unfolded(reference, fit.estimate)] or fits
    return [_predicting(reference, fit) for fit in fits]


def _enough(reference: FloorReference, model: str) -> bool:
    return 2 * len(reference.marks_px) >= len(active_parameters(model, with_floor=True)) + _SPARE


def _unfolded(reference: FloorReference, estimate: Estimate) -> bool:
    """Whether a lens says what it shows half-way between any two marks: coefficients that cancel may fold it there."""
    one, other = np.triu_indices(len(reference.marks_px))
    between = (reference.marks_px[one] + reference.marks_px[other]) / 2
    return bool(np.isfinite(undistorted_kernel(between, estimate.matrix, estimate.lens)).all())


def _block(reference: FloorReference, std_px: float, kept: slice | Array = np.s_[:]) -> Block:
    return Block(lifted(reference.marks_m[kept], 0.0), reference.marks_px[kept], Placement.FIXED, std_px)


def _residual(reference: FloorReference, estimate: Estimate) -> Array:
    return residuals([_block(reference, 1.0)], estimate)[0]


def _fitted(reference: FloorReference, start: Estimate, model: str) -> LensTrial:
    """A fit of a lens model, which has predicted nothing yet."""
    active, block = active_parameters(model, with_floor=True), _block(reference, reference.mark_std_px)
    estimate = adjust([block], start, active)
    return LensTrial(model, np.zeros(0), estimate, marginal_covariance([block], estimate, active)[1])


def _predicting(reference: FloorReference, trial: LensTrial) -> LensTrial:
    """A fit with how its model predicts each mark from the others."""
    active, marks = active_parameters(trial.model, with_floor=True), np.arange(len(reference.marks_px))
    left_out = []
    for mark in marks:
        others = adjust([_block(reference, reference.mark_std_px, marks != mark)], trial.estimate, active)
        left_out.append(np.sqrt(np.mean(_residual(reference, others)[mark] ** 2)))
    return replace(trial, held_out_rms_px=np.array(left_out))


def _reported(
    calibration: Calibration, reference: FloorReference, chosen: LensTrial, heights_m: Sequence[float]
) -> Calibration:
    residual = _residual(reference, chosen.estimate)
    off = to_plane(calibration.camera, calibration.floor, reference.marks_px, 0.0) - reference.marks_m
    metres_per_px = float(np.sqrt(np.mean(off**2) / np.mean(residual**2)))
    focal_std = float(np.sqrt(calibration.covariance[0, 0]))
    left_out_m = metres_per_px * np.sqrt(2 * chosen.score_px2)
    quality = {
        "marks_rms_px": float(np.sqrt(np.mean(residual**2))),
        "held_out_rms_px": float(np.sqrt(chosen.score_px2)),
        "held_out_rms_mm": 1e3 * left_out_m,
        "condition_number": chosen.condition,
        "focal_length_std_px": focal_std,
        **floor_quality(calibration, heights_m),
    }
    percent = 100 * focal_std / calibration.camera.matrix[0, 0]
    numbers = {"count": len(residual), "left_out_mm": 1e3 * left_out_m, "focal_percent": percent}
    return replace(
        calibration,
        views=(View(MARKS_VIEW, reference.marks_px, reference.marks_m, residual, np.nan, on_floor=True),),
        findings=(finding("marks-alone", **numbers),),
        quality=quality,
    )
