"""The lens of a video against that of the pictures of the floor: cameras straighten the ones and not the others.

A registration by slopes leaves out the points that another lens displaces, and takes what the rest have in common for a
zoom. So blocks are searched as wholes, and the view's motion is fitted to their places together with two coefficients.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from towval.model import CALIBRATION_PARAMETERS, Array, Camera, Floor
from towval.model.geometry import lifted
from towval.optics.moved_view import parameters_by_motion
from towval.optics.projection import project, to_plane
from towval.optics.view_motion import moved_view
from towval.tracking.floor_registration import MEDIAN_NORMAL, FloorRegistration
from towval.tracking.light import evened
from towval.tracking.template import Luma


@dataclass(frozen=True)
class LensOfVideoConstants:
    """Tuned constants of the lens of a video."""

    place_px: float = 0.05  # [px] Least deviation of a block's place: 0.01 to 0.05 in sound footage.
    significant: float = 3.0  # Deviations of both coefficients together: below 2 where the lens is the same.
    still_px: float = 2.0  # [px] Motion of the view that is taken off first: turned blocks lead astray.
    settled: float = 2.0  # Deviations of a last step: blocks found in one round and not in the next make 1 to 2.
    rounds: int = 6  # At most.


CONSTANTS = LensOfVideoConstants()

_COEFFICIENTS = [CALIBRATION_PARAMETERS.index(name) for name in ("k1", "k2")]
_MOST_UNEVEN = 1e12  # Ratio of the best to the worst known unknown: lenses have up to 1e8; beyond 1e16 is rounding.
_NOWHERE = 1e4  # Deviations: more than any picture is wide.
_GRID_PX = 16  # Lenses change slowly: between these pixels places are interpolated.


@dataclass(frozen=True)
class OtherLens:
    """The ``coefficients`` (2,), k1 and k2, that a video's lens has more than that of ``camera``.

    ``covariance`` (2, 2) of them; ``motion`` (9,): what the view moved by from the video to the pictures, and
    ``by_lens`` (9, 2) its change with each, since what they do to the floor is in part what a motion does.
    """

    camera: Camera
    coefficients: Array
    covariance: Array
    motion: Array
    by_lens: Array

    @property
    def deviations(self) -> float:
        """By how many deviations the coefficients are not zero, both together."""
        return float(np.sqrt(self.coefficients @ np.linalg.solve(self.covariance, self.coefficients)))

    def of(self, camera: Camera) -> Camera:
        """A ``camera`` with the lens of the video."""
        return _with_lens(camera, self.coefficients)

    def as_in_pictures(self, luma: Luma, floor: Floor, motion: Array | None = None) -> Luma:
        """A picture (height, width) of the video as the lens of the pictures of the ``floor`` would show it.

        From where the video was taken, or after a ``motion`` (9,) of the view.
        """
        view = (self.camera, floor) if motion is None else moved_view(self.camera, floor, motion)
        columns, rows = (np.arange(0, size + _GRID_PX, _GRID_PX) for size in luma.shape[::-1])
        grid = np.stack(np.meshgrid(columns, rows), axis=-1)
        places = to_plane(*view, grid, 0.0)
        shown = project(self.of(self.camera), floor, lifted(places, 0.0))
        pixels = np.nan_to_num(shown, nan=-1.0).astype(np.float32)
        v, u = np.indices(luma.shape, dtype=np.float32) / _GRID_PX
        x, y = (cv2.remap(np.ascontiguousarray(pixels[..., i]), u, v, cv2.INTER_LINEAR) for i in range(2))
        return np.asarray(cv2.remap(luma, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8)

    def corner_px(self) -> tuple[float, float]:
        """By how much farther out the video shows what the pictures show at a corner, and its deviation [px]."""
        middle, corner = self.camera.matrix[:2, 2], np.zeros(2)
        ray = np.append((corner - middle) / self.camera.matrix[[0, 1], [0, 1]], 1.0)

        def distance(coefficients: Array) -> float:
            pixel = project(_with_lens(self.camera, coefficients), Floor(np.eye(4)), ray)
            return float(np.linalg.norm(pixel - middle))

        usual = distance(np.zeros(2))
        by_each = np.array([distance(root) - usual for root in np.linalg.cholesky(self.covariance).T])
        return distance(self.coefficients) - usual, float(np.linalg.norm(by_each))

    def added(self, floor: Floor) -> Array:
        """Covariance (18, 18) of :data:`towval.model.CALIBRATION_PARAMETERS` by that of the coefficients."""
        by_lens = parameters_by_motion(self.camera, floor) @ self.by_lens
        by_lens[_COEFFICIENTS] += np.eye(2)
        return np.asarray(by_lens @ self.covariance @ by_lens.T, dtype=np.float64)


def lens_of_video(seen: FloorRegistration, luma: Luma, pictures: Sequence[Luma]) -> OtherLens | None:
    """The lens of a video by its first picture; None where it is that of the ``pictures`` of the floor, or unknown.

    Parameters
    ----------
    seen : FloorRegistration
        The floor of that picture in even light, by the calibration of the others.
    luma : ndarray (height, width) uint8
        The picture itself.
    pictures : sequence of ndarray (height, width) uint8
        In even light.
    """
    camera, floor = seen.camera, seen.floor
    motion, coefficients = np.zeros(len(seen.prior)), np.zeros(2)
    for _ in range(CONSTANTS.rounds):
        step = _step(seen, pictures)
        if step is None:
            return None
        has_moved = seen.shift_px(step.motion) > CONSTANTS.still_px
        motion = motion + step.motion
        if not has_moved:
            coefficients = coefficients + step.coefficients
        found = replace(step, coefficients=coefficients, motion=motion)
        if step.deviations < CONSTANTS.settled and not has_moved:
            return found if found.deviations > CONSTANTS.significant else None
        shown = evened(found.as_in_pictures(luma, floor, motion))
        seen = FloorRegistration(camera, floor, shown, (), worst_std_px=np.inf)
        if seen.template is None:
            return None
    return None


def _with_lens(camera: Camera, coefficients: Array) -> Camera:
    distortion = camera.distortion.copy()
    distortion[:2] += coefficients
    smaller = camera.lens_model in ("none", "k1")
    return replace(camera, distortion=distortion, lens_model="k1 k2" if smaller else camera.lens_model)


def _step(seen: FloorRegistration, pictures: Sequence[Luma]) -> OtherLens | None:
    """The lens to which the blocks of a picture agree; None where too few are found."""
    still = np.zeros(len(seen.prior))
    places = np.array([seen.blocks_in(picture, still) for picture in pictures])
    often = np.isfinite(places[..., 0]).sum(axis=0) >= (len(pictures) + 1) // 2
    # Motion of the view, the two coefficients, and a stretch, which else would look like a lens: no motion does that.
    size = len(still) + 3
    if often.sum() < size:
        return None
    shown, found = seen.pixels(seen.block_places[often], still), np.nanmedian(places[:, often], axis=0)
    # Not at start-up: few videos have another lens than the pictures, and each process would wait for it.
    from scipy.optimize import least_squares  # noqa: PLC0415

    camera, floor = seen.camera, seen.floor
    corner = float(np.sum((np.array(camera.resolution_px) / 2 / camera.matrix[[0, 1], [0, 1]]) ** 2))
    units = np.append(seen.prior, 0.01 / np.array([corner, corner**2, 1.0]))

    def misfit(z: Array) -> Array:
        motion, lens, stretch = np.split(z * units, [len(still), -1])
        on_floor = to_plane(_with_lens(camera, lens), floor, shown, 0.0)
        pixels = project(*moved_view(camera, floor, motion), lifted(on_floor, 0.0))
        pixels[:, 0] -= stretch * (pixels[:, 0] - camera.matrix[0, 2])
        off = (pixels - found) / CONSTANTS.place_px
        # A lens that folds the picture shows some places nowhere, and the fit must not end there.
        return np.append(np.where(np.isfinite(off), off, _NOWHERE).ravel(), z[: len(still)])

    # Bodies and boards hide some; but from far off a loss that leaves blocks out might keep the wrong ones.
    near = least_squares(misfit, np.zeros(size), loss="soft_l1")
    fit = least_squares(misfit, near.x, loss="cauchy")
    information = fit.jac.T @ fit.jac
    if np.max(np.abs(fit.fun)) >= _NOWHERE or np.linalg.cond(information) > _MOST_UNEVEN:
        return None
    scale = max(1.0, float(np.median(np.abs(fit.fun[: -len(still)]))) / MEDIAN_NORMAL)
    covariance = scale**2 * np.linalg.inv(information) * np.outer(units, units)
    values, lens = fit.x * units, slice(len(still), size - 1)
    by_lens = covariance[: len(still), lens] @ np.linalg.inv(covariance[lens, lens])
    return OtherLens(camera, values[lens], covariance[lens, lens], values[: len(still)], by_lens)
