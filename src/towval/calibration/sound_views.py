"""The views that fit, and the camera adjusted to them: pinhole, or a fisheye where only this describes them."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from towval.calibration.adequacy import marks_std_px
from towval.calibration.alike import square_px
from towval.calibration.blocks import Estimate, Placement, residuals
from towval.calibration.bundle_adjustment import RAYLEIGH_MEDIAN, adjust
from towval.calibration.corners import BoardObservation
from towval.calibration.doubts import Settled, settle, without_prejudice
from towval.calibration.lens import LensTrial, active_parameters, choose_lens, families, may_be_fisheye
from towval.calibration.observations import CalibrationObservations, first_guess, unflipped
from towval.model import CALIBRATION_PARAMETERS, Array
from towval.model.errors import RefusedError

_FIRST_MODELS = ("k1", "k1 k2"), ("fisheye k1", "fisheye k1 k2")
"""Lens models of each family fitted in turn about the image centre: with a free principal point the fit to a wide lens
may end at a focal length that differs by the axis, from which no larger model comes back."""
_CENTRE = [CALIBRATION_PARAMETERS.index(name) for name in ("cx", "cy")]
_JUDGING_MODELS = ("k1 k2", "k1 k2 p1 p2 k3", "rational"), ("fisheye k1 k2", "fisheye k1 k2 k3")
"""Lens models of each family fitted in turn before any view is judged: a misfit that remains with the largest is the
view's, and smaller ones than these fit all views equally badly."""


@dataclass(frozen=True)
class SoundViewConstants:
    """Tuned constants of the choice of views."""

    smallest_misfit_px: float = 0.1  # [px] RMS of a view that is never a reason to drop it.
    fewest_views: int = 3  # With two, nothing checks the fit.
    poor_px: float = 0.5
    # [px] Noise beyond which the lens may be a fisheye's, however it bends. Sound sets leave 0.05 to 0.4, pinhole
    # models of a fisheye of 60° 0.7 to 1.4.
    clearly: float = 1.5  # Ratio of the noise that pinhole models leave to that of a fisheye's: then it is one.


CONSTANTS = SoundViewConstants()


class _Sound(NamedTuple):
    """Views that fit, a fit of them, and the other views with the reason why they do not."""

    kept: CalibrationObservations
    start: Estimate
    dropped: dict[str, str]


class Adjusted(NamedTuple):
    """Views that fit, the others with the reason why they do not, and the calibration.

    ``fisheye`` is None, or what was not chosen although it predicts views that are held out better.
    """

    kept: CalibrationObservations
    dropped: dict[str, str]
    settled: Settled
    fisheye: LensTrial | None = None

    @property
    def held_out_px(self) -> dict[str, float]:
        """Error of each view as predicted by the others (RMS)."""
        boards = zip(self.kept.observations, self.kept.blocks, strict=False)
        names = [board.name for board, block in boards if block.placement is not Placement.FIXED]
        return dict(zip(names, self.settled.chosen.held_out_rms_px.tolist(), strict=True))


def adjust_sound_views(
    observed: CalibrationObservations, models: Sequence[str], folds: int, misfit_ratio: float
) -> Adjusted:
    """The calibration with a pinhole camera, or a fisheye where the lens may be one and this predicts the views better.

    Without a floor a pinhole camera that fits is kept: such a calibration is for other programs, which know it.
    ``models`` to choose the lens from, with ``folds`` of the cross-validation; ``misfit_ratio``: a view with residuals
    this many times those of the median view, or the noise of its own smaller squares, is dropped. `RefusedError` where
    too few views are left, or the board that fixes the floor frame does not fit.
    """
    pinholes, fisheyes = families(models)
    try:
        pinhole = _sound(observed, misfit_ratio, fisheye=False) if pinholes else None
    except RefusedError:
        if not fisheyes:
            raise
        pinhole = None
    if pinhole is None:
        return _settled(_sound(observed, misfit_ratio, fisheye=True), fisheyes, folds)
    wide = may_be_fisheye(pinhole.start, observed.resolution_px)
    poor = pinhole.start.noise_px > CONSTANTS.poor_px
    if fisheyes and (wide or poor):
        with suppress(RefusedError):
            fisheye = _sound(observed, misfit_ratio, fisheye=True)
            if poor and _clearly_less(fisheye.start, pinhole.start):
                return _settled(fisheye, fisheyes, folds)
            if wide:
                return _better(_settled(pinhole, pinholes, folds), _settled(fisheye, fisheyes, folds))
    return _settled(pinhole, pinholes, folds)


def _better(pinhole: Adjusted, fisheye: Adjusted) -> Adjusted:
    """The more predictive one; of a camera alone the pinhole, beside the other, unless that leaves clearly less."""
    better = _more_predictive(pinhole, fisheye)
    with_floor = pinhole.kept.reference is not None
    clearly = _clearly_less(fisheye.settled.chosen.estimate, pinhole.settled.chosen.estimate)
    return fisheye if clearly or (with_floor and better) else pinhole._replace(fisheye=better)


def _clearly_less(fisheye: Estimate, pinhole: Estimate) -> bool:
    return CONSTANTS.clearly * fisheye.noise_px < pinhole.noise_px


def _settled(sound: _Sound, models: Sequence[str], folds: int) -> Adjusted:
    kept, start = _with_honest_marks(sound.kept, sound.start)
    return Adjusted(kept, sound.dropped, settle(kept, start, models, folds))


def _more_predictive(pinhole: Adjusted, fisheye: Adjusted) -> LensTrial | None:
    """The fisheye, if it would be chosen by the views that both keep; None otherwise."""
    errors = fisheye.held_out_px, pinhole.held_out_px
    common = sorted(errors[0].keys() & errors[1].keys())
    trials = [
        replace(each.settled.chosen, held_out_rms_px=np.array([of[name] for name in common]))
        for each, of in zip((fisheye, pinhole), errors, strict=True)
    ]
    return trials[0] if choose_lens(trials) is trials[0] else None


def _sound(observed: CalibrationObservations, misfit_ratio: float, *, fisheye: bool) -> _Sound:
    """Drop the views that do not fit, worst first."""
    dropped: dict[str, str] = {}
    while True:
        if len(observed.observations) < CONSTANTS.fewest_views:
            raise RefusedError(
                "too few views of the board",
                got=f"{len(observed.observations)} usable",
                allowed=f"{CONSTANTS.fewest_views} at the very least, 12 to do well",
                remedy="film the board tilted by 20° to 40° to all sides, all over the picture",
            )
        estimate, misfit = _fit_to_judge(observed, misfit_ratio, fisheye=fisheye)
        if misfit is None:
            return _Sound(observed, estimate, dropped)
        dropped[misfit[0]] = misfit[1]
        observed = _less(observed, *misfit)


def _fit_to_judge(
    observed: CalibrationObservations, misfit_ratio: float, *, fisheye: bool
) -> tuple[Estimate, tuple[str, str] | None]:
    """Fit larger and larger lens models until all views fit; if none does, the worst view and the reason."""
    estimate = first_guess(observed, fisheye=fisheye)
    for model in _FIRST_MODELS[fisheye]:
        active = active_parameters(model, with_floor=observed.reference is not None)
        about_centre = active[~np.isin(active, _CENTRE)]
        estimate = unflipped(observed, adjust(observed.blocks, estimate, about_centre))
    for model in _JUDGING_MODELS[fisheye]:
        active = active_parameters(model, with_floor=observed.reference is not None)
        estimate = unflipped(observed, adjust(observed.blocks, estimate, active))
        found = residuals(observed.blocks, estimate)[: len(observed.observations)]
        rms_px = [float(np.sqrt(np.mean(r**2))) for r in found]
        usual = float(np.median(rms_px))
        expected_px = np.maximum(usual, _scatter_px(observed.observations, found, usual))
        worst = int(np.argmax(rms_px / expected_px))
        if rms_px[worst] <= max(misfit_ratio * expected_px[worst], CONSTANTS.smallest_misfit_px):
            return estimate, None
    reason = f"does not fit: {rms_px[worst]:.2f} px RMS where half of the views have {usual:.2f} px or less"
    return estimate, (observed.observations[worst].name, reason)


def _scatter_px(boards: Sequence[BoardObservation], found: Sequence[Array], usual_px: float) -> Array:
    """Noise (n,) of the corners of each board beside what displaces neighbours alike, in its residuals (k, 2) [px].

    The smaller its squares the fewer pixels tell a corner: no more counts than so much smaller squares explain of the
    usual noise.
    """
    squares_px = np.array([square_px(board) for board in boards])
    noise_px = [_beside_surface(board.on_board, residual) for board, residual in zip(boards, found, strict=True)]
    return np.asarray(np.minimum(noise_px, usual_px * np.median(squares_px) / squares_px))


def _beside_surface(places: Array, residual: Array) -> float:
    """Robust deviation of a coordinate of residuals (k, 2) from a surface of second order over places (k, 2)."""
    x, y = places.T
    surface = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    spare = len(places) - surface.shape[1]
    if spare <= 0:
        return 0.0
    off = residual - surface @ np.linalg.lstsq(surface, residual, rcond=None)[0]
    return float(np.median(np.linalg.norm(off, axis=1)) / RAYLEIGH_MEDIAN * np.sqrt(len(places) / spare))


def _with_honest_marks(
    observed: CalibrationObservations, estimate: Estimate
) -> tuple[CalibrationObservations, Estimate]:
    """Surveyed marks with the standard deviation of their residuals, where that is clearly more than stated.

    Residuals that a board of another size than stated explains do not count.
    """
    std_px, worse = marks_std_px(observed, estimate) if observed.marks else (np.nan, False)
    if worse:
        std_px, worse = marks_std_px(observed, without_prejudice(observed, estimate, "k1 k2"))
    if not worse:
        return observed, estimate
    observed = replace(observed, reference=replace(observed.floor_reference, mark_std_px=std_px))
    return observed, adjust(observed.blocks, estimate, active_parameters("k1 k2", with_floor=True))


def _less(observed: CalibrationObservations, name: str, reason: str) -> CalibrationObservations:
    if observed.floor_boards and not observed.marks and observed.floor_boards[0].name == name:
        raise RefusedError(
            "the board that fixes the floor frame does not fit",
            got=f"{name} {reason}",
            remedy="check that it lies flat, is sharp and is the same board; or take another picture as floor.image",
        )
    return observed.without({name})
