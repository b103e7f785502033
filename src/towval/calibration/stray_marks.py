"""Surveyed marks that are grossly wrong: a slipped decimal point, two rows exchanged, the pixel of another mark.

One of them among twenty bends every lens, so that in the end most marks misfit. They are found before anything is
adjusted, with a camera of few unknowns: a plane seen through a lens that draws a tangent ``t`` in to ``atan(w t) / w``
(Devernay and Faugeras 2001), or out to ``atanh(w t) / w``. It is a pinhole camera at ``w = 0``, a fisheye of equal
angles where ``1 / w`` is its focal length, and within a few pixels of other lenses. Lengths here are in units of half
of the picture's diagonal.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from towval.calibration.single_marks import CONSTANTS as SINGLE
from towval.calibration.single_marks import FEWEST_TO_TELL
from towval.model import Array, Calibration, FloorReference
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import lifted
from towval.optics.projection import project


@dataclass(frozen=True)
class StrayMarksConstants:
    """Tuned constants of the search for marks that are grossly wrong."""

    far: float = 50.0  # Times as far off as half of the marks: 300 sound sets, fisheyes to 82° among them, reach 31.
    most: float = 0.25  # Share of the marks that may be set aside: beyond it nobody knows which are the wrong ones.


CONSTANTS = StrayMarksConstants()

_LENSES = (-0.5, -0.3, 0.02, 0.4, 0.7, 1.0, 1.2, 1.35, 1.45)
"""Lenses ``w`` to begin with, negative where they draw out: with equal angles, the angle to the axis of a corner."""

_STEEPEST = 1.55  # [rad] Nothing is drawn in from beyond this angle to the axis.
_FARTHEST = 0.999  # Nor out from beyond this share of what is drawn out to infinity.


def sound_marks(reference: FloorReference, resolution_px: tuple[int, int]) -> NDArray[np.bool_]:
    """Which surveyed marks (n,) to calibrate with: all but those that are far from where most of them put them.

    All of fewer than nine, since these leave too little to tell which is wrong. `InputError` where more than a quarter
    are far off.
    """
    count = len(reference.marks_px)
    if count < FEWEST_TO_TELL:
        return np.ones(count, dtype=bool)
    off_px = _off_px(reference, resolution_px)
    sound: NDArray[np.bool_] = off_px <= CONSTANTS.far * max(float(np.median(off_px)), reference.mark_std_px)
    strays = np.flatnonzero(~sound)
    if len(strays) > CONSTANTS.most * count:
        worst = strays[np.argsort(-off_px[strays])][:3]
        named = "; ".join(f"{reference.marks_m[i].tolist()} m by {off_px[i]:.0f} px" for i in worst)
        raise InputError(
            "the surveyed marks contradict each other",
            got=f"{len(strays)} of {count} are far from where the others put them, the farthest {named}",
            allowed="places on one floor [m] and their pixels in one picture of the camera",
            remedy="check these marks in floor.surveyed_marks: units, order, and the pixels of each",
        )
    return sound


def with_sound_marks(
    reference: FloorReference, resolution_px: tuple[int, int], calibrated: Callable[[FloorReference], Calibration]
) -> Calibration:
    """Calibrate without the marks that are grossly wrong, each of which is a finding; the farthest is the first.

    A mark that was set aside and is where the calibration puts it after all takes part in another one. `InputError` as
    :func:`sound_marks`, and for two marks with one pixel.
    """
    _check_distinct(reference)
    sound = sound_marks(reference, resolution_px)
    while True:
        calibration = calibrated(_marks_where(reference, sound))
        off_px = _off_calibrated_px(calibration, reference)
        agreeing = ~sound & (off_px <= SINGLE.misfit * reference.mark_std_px)
        if not agreeing.any():
            break
        sound |= agreeing
    strays = sorted(np.flatnonzero(~sound), key=lambda i: -off_px[i])
    found = [finding("mark-left-out", at_m=reference.marks_m[i].tolist(), distance_px=off_px[i]) for i in strays]
    return replace(calibration, findings=(*found, *calibration.findings))


def _check_distinct(reference: FloorReference) -> None:
    marks_m, marks_px = reference.marks_m, reference.marks_px
    for i, at_px in enumerate(marks_px):
        same = (marks_px[:i] == at_px).all(axis=1) & (marks_m[:i] != marks_m[i]).any(axis=1)
        if same.any():
            raise InputError(
                "two surveyed marks have the same pixel",
                got=f"{at_px.tolist()} for {marks_m[:i][same][0].tolist()} and {marks_m[i].tolist()}",
                remedy="correct floor.surveyed_marks",
            )


def _marks_where(reference: FloorReference, kept: NDArray[np.bool_]) -> FloorReference:
    return replace(reference, marks_px=reference.marks_px[kept], marks_m=reference.marks_m[kept])


def _off_calibrated_px(calibration: Calibration, reference: FloorReference) -> Array:
    """Distance (n,) of each mark from where a calibration puts it [px]."""
    seen = project(calibration.camera, calibration.floor, lifted(reference.marks_m, 0.0))
    return np.asarray(np.linalg.norm(seen - reference.marks_px, axis=1))


def _off_px(reference: FloorReference, resolution_px: tuple[int, int]) -> Array:
    """Distance (n,) of each mark from where the camera puts it that agrees best with most of them [px]."""
    half, middle = np.hypot(*resolution_px) / 2, (np.array(resolution_px) - 1) / 2
    at = (reference.marks_px - middle) / half
    places = (reference.marks_m - reference.marks_m.mean(axis=0)) / max(float(reference.marks_m.std()), 1e-9)

    def off(unknowns: Array) -> Array:
        return np.asarray(half * (_drawn(places, unknowns) - at)).ravel()

    fitted = [_lengths(off(_settled(off, unknowns))) for unknowns in _begun(places, at)]
    scale = max(reference.mark_std_px, 1e-3)
    nearest: Array = min(fitted, key=lambda lengths: float(np.sum(np.log1p((lengths / scale) ** 2))))
    return nearest


def _begun(places: Array, at: Array) -> Iterator[Array]:
    """Homography and lens (10,) of places (n, 2) seen ``at`` (n, 2), for each lens with which there is one."""
    radius = np.maximum(np.linalg.norm(at, axis=1, keepdims=True), 1e-9)
    for lens in _LENSES:
        w = abs(lens)
        tangent = np.tan(np.minimum(w * radius, _STEEPEST)) / w if lens > 0 else np.tanh(w * radius) / w
        homography, _ = cv2.findHomography(places, at * tangent / radius, cv2.LMEDS)
        if homography is not None:
            in_front = np.median(places @ homography[2, :2] + homography[2, 2])
            yield np.append(homography.ravel() * np.sign(in_front) / np.linalg.norm(homography), lens)


def _drawn(places: Array, unknowns: Array) -> Array:
    """Where a homography and lens (10,) draw places (n, 2)."""
    x, y, depth = unknowns[:9].reshape(3, 3) @ np.vstack([places.T, np.ones(len(places))])
    aside, lens = np.maximum(np.hypot(x, y), 1e-12), unknowns[9]
    w = max(abs(lens), 1e-3)
    if lens > 0:
        radius = np.arctan2(w * aside, depth) / w
    else:
        radius = np.arctanh(np.minimum(w * aside / np.maximum(depth, 1e-12), _FARTHEST)) / w
    return np.asarray(np.column_stack([x, y]) * (radius / aside)[:, None])


def _settled(off: Callable[[Array], Array], unknowns: Array) -> Array:
    """Unknowns that fit most marks: Cauchy's loss, with a width of the usual distance, twice."""
    for _ in range(2):
        width = max(1.5 * float(np.median(_lengths(off(unknowns)))), 0.5)
        unknowns = least_squares(off, unknowns, loss="cauchy", f_scale=width, x_scale="jac", max_nfev=100).x
    return unknowns


def _lengths(off: Array) -> Array:
    return np.asarray(np.linalg.norm(off.reshape(-1, 2), axis=1))
