"""The default tracker: a body's whole top aligned with its template, gated, and refreshed without drift."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Camera
from towval.model.errors import InputError
from towval.tracking.alignment import Alignment, Template, align, by_motion, make_template, slopes_at
from towval.tracking.blur import Shutter
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import Measurement, Tracker

Luma = NDArray[np.uint8]

_LEAST_INLIERS = 0.3
_LEAST_CORRELATION = 0.35  # Where the top is not, its better tiles reach 0.3 by chance.
_CORRELATION_KEPT = 0.6  # Of what it usually is.
_WORST_STD_PX = 0.35
_JUMP_PX = 3.0  # A pose farther than this from the prediction is looked at from afar as well.
_COARSE_BODY_PX = 90
_COARSE_SAMPLES = 400
_REFRESH_INLIERS = 0.8
_REFRESH_EVERY = 5  # Pictures, after the first ten.
_SLOWEST_REFRESH = 0.05
_FIRST_LESSONS, _LESSON_EVERY = 10, 25  # Pictures that the response is learned from.
_LEAST_SHARE = 0.1**3  # Of a determinant: a tenth of each motion.
_MOST_SCALE = 0.5  # Of the template's own deviation.
_TABLE_POINTS = 60


class PlaneTracker(Tracker):
    """Follows a ``top``, seen at ``pose`` (3,) in ``luma``, as a whole: by some ``samples`` points of it.

    Raises
    ------
    InputError
        When too little of the top is in the picture.
    """

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array, samples: int = 1024):
        self.target = target
        self.pixel_m = target.metres_per_pixel(pose)
        template = make_template(luma, target, pose, samples)
        if template is None:
            raise InputError(
                f"too little of the tracked plane of {target.body.name} can be seen in the first picture",
                remedy="check its clicks and obstructions, or start where the body is in full view",
            )
        self.template = template
        self.factor = max(1, round(2 * target.reach_m / self.pixel_m / _COARSE_BODY_PX))
        small, small_camera = self._shrunk(luma, pose)
        self.coarse = make_template(small, replace(target, camera=small_camera), pose, _COARSE_SAMPLES)
        self.shutter = Shutter(target, luma, pose, template)
        self.free_slopes = _without_light(template)
        self.motion_like = np.linalg.pinv(self.free_slopes)
        self.response, self.blurred_response = _Response(), _Response()
        self.usual_correlation, self.seen, self.refreshed = 1.0, 0, 0
        self.most_scale = max(2.0, _MOST_SCALE * float(np.std(template.values)))

    @property
    def exposure_s(self) -> float:
        """How long the shutter seems to be open [s]."""
        return self.shutter.exposure_s

    def measure(self, luma: Luma, predicted: Array, velocity: Array | None = None) -> Measurement | None:
        """Pose near ``predicted`` (3,), or None where the picture does not vouch for one."""
        blurred = None if velocity is None else self.shutter.template(velocity)
        template = self.template if blurred is None else blurred
        response = self.response if blurred is None else self.blurred_response
        found = self._align(luma, predicted, template, response)
        if found is None or self.target.apart_m(predicted, found.pose) > _JUMP_PX * self.pixel_m:
            from_afar = self._align_coarsely(luma, predicted, template, response)
            if from_afar is not None and (found is None or from_afar.correlation > found.correlation):
                found = from_afar
        if found is None:
            return None
        if blurred is None:
            self._learn(found)
        if found.inlier_fraction >= _REFRESH_INLIERS and response.is_due():
            slopes = slopes_at(luma, self.target, found.pose, template.points, self.pixel_m)
            free = self.free_slopes if blurred is None else _without_light(template)
            response.learn(free, by_motion(template.points, slopes), found.weight)
        if velocity is not None:
            self.shutter.learn(luma, found, template, velocity)
        step = max(1, len(template.points) // _TABLE_POINTS)
        return Measurement(
            pose=found.pose,
            covariance=found.covariance,
            inlier_fraction=found.inlier_fraction,
            residual=found.scale,
            points_m=template.points[::step][:_TABLE_POINTS],
            weights=np.clip(found.weight[::step][:_TABLE_POINTS], 0, 1),
        )

    def _align(self, luma: Luma, start: Array, template: Template, response: _Response) -> Alignment | None:
        found = align(luma, template, np.ones(len(template.points)), start, self.target, self.most_scale)
        if found is None or response.whole is None:
            return None
        found = replace(found, covariance=response.whole @ found.covariance @ response.whole.T)
        return found if self._trusted(found) else None

    def _align_coarsely(self, luma: Luma, start: Array, template: Template, response: _Response) -> Alignment | None:
        if self.coarse is None:
            return None
        small, camera = self._shrunk(luma, start)
        flat = np.ones(len(self.coarse.points))
        found = align(small, self.coarse, flat, start, replace(self.target, camera=camera), self.most_scale)
        return None if found is None else self._align(luma, found.pose, template, response)

    def _shrunk(self, luma: Luma, pose: Array) -> tuple[Luma, Camera]:
        """The surroundings of the body at the coarse scale, and the camera that would have taken them."""
        centre = self.target.pixels(np.zeros((1, 2)), pose)[0]
        reach = 2.0 * self.target.reach_m / self.pixel_m
        low = np.clip(np.nan_to_num(centre) - reach, 0, None).astype(int)
        high = np.minimum(np.nan_to_num(centre) + reach, [luma.shape[1], luma.shape[0]]).astype(int)
        size = np.maximum((high - low) // self.factor, 8)
        crop = luma[low[1] : low[1] + size[1] * self.factor, low[0] : low[0] + size[0] * self.factor]
        if min(crop.shape) < 8 * self.factor:
            crop, low, size = luma, np.zeros(2, dtype=int), np.array(luma.shape[::-1]) // self.factor
        small = cv2.resize(crop, (int(size[0]), int(size[1])), interpolation=cv2.INTER_AREA)
        scale = np.array([size[0] / crop.shape[1], size[1] / crop.shape[0]])
        matrix = self.target.camera.matrix.copy()
        matrix[0, 0] *= scale[0]
        matrix[1, 1] *= scale[1]
        # Pixel centres are whole numbers at both scales, so half a pixel goes in and out.
        matrix[:2, 2] = (matrix[:2, 2] - low + 0.5) * scale - 0.5
        return small, replace(self.target.camera, matrix=matrix, resolution_px=(int(size[0]), int(size[1])))

    def _trusted(self, found: Alignment) -> bool:
        worst = _WORST_STD_PX * self.pixel_m
        std = np.sqrt(np.diag(found.covariance))
        return (
            found.converged
            and found.inlier_fraction >= _LEAST_INLIERS
            and found.correlation >= max(_LEAST_CORRELATION, _CORRELATION_KEPT * self.usual_correlation)
            and max(std[0], std[1], std[2] * self.target.reach_m) <= worst
        )

    def _learn(self, found: Alignment) -> None:
        """Take in what a good alignment says about noise and looks; the template's place stays."""
        self.seen += 1
        if found.inlier_fraction < _REFRESH_INLIERS or (self.refreshed > 10 and self.seen % _REFRESH_EVERY):
            return
        self.refreshed += 1
        rate = max(1 / (self.refreshed + 1), _SLOWEST_REFRESH)
        self.usual_correlation += rate * (found.correlation - self.usual_correlation)
        change = rate * np.where(found.weight > 0, found.residual, 0.0)
        # Only what does not look like a motion is taken over: the aligned pose cannot creep.
        change -= self.free_slopes @ (self.motion_like @ change)
        self.template = replace(self.template, values=self.template.values + change)


class _Response:
    """How much of a small motion alignments with a template see: ``share`` (3, 3), one where nothing is lost.

    The template's slopes J hold noise, and the steepest places were chosen. A later picture's slopes J' at the same
    points hold noise of their own, so ``(JᵀJ)⁻¹JᵀJ'`` is free of what JᵀJ counts as texture and is none. The
    alignment solves ``JᵀJ' ε = Jᵀ(noise)``: its covariance is that of ``(JᵀJ)⁻¹Jᵀ(noise)`` over this share.
    """

    def __init__(self) -> None:
        self.share = np.eye(3)
        self.whole: Array | None = np.eye(3)  # Inverse of the share; None where next to nothing of a motion is seen.
        self.asked, self.learned = 0, 0

    def is_due(self) -> bool:
        """Whether the picture at hand should be learned from: each of the first, later one now and then."""
        self.asked += 1
        return self.learned < _FIRST_LESSONS or self.asked % _LESSON_EVERY == 0

    def learn(self, slopes: Array, seen: Array, weight: Array) -> None:
        """Compare slopes (n, 3) of the template, freed of the light's, with those of a picture; ``weight`` (n,)."""
        known = np.isfinite(seen).all(axis=1) & (weight > 0)
        share = np.linalg.lstsq(slopes[known], seen[known], rcond=None)[0]
        self.learned += 1
        self.share += max(1 / self.learned, _SLOWEST_REFRESH) * (share - self.share)
        self.whole = np.linalg.inv(self.share) if np.linalg.det(self.share) > _LEAST_SHARE else None


def _without_light(template: Template) -> Array:
    """Slopes (n, 3) less what gain and bias of the tiles can explain."""
    slopes = template.slopes.copy()
    for row in range(template.tiles):
        own = template.tile == row
        light = np.column_stack([np.ones(own.sum()), template.values[own]])
        slopes[own] -= light @ np.linalg.lstsq(light, slopes[own], rcond=None)[0]
    return slopes
