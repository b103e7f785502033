"""The default tracker: the whole planar target aligned with its template, gated, and refreshed without drift."""

import math
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from towval.model import Array, Camera
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.geometry import turned_covariance
from towval.tracking.alignment import CONSTANTS as ALIGNMENT
from towval.tracking.alignment import Alignment, align
from towval.tracking.blur import Shutter
from towval.tracking.focus import CONSTANTS as FOCUS
from towval.tracking.focus import Focus, misfit, width_px
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import TUKEY, Measurement, Tracker
from towval.tracking.template import Luma, Template, by_motion, make_template, slopes_at, without_light


@dataclass(frozen=True)
class PlaneTrackerConstants:
    """Tuned constants of the plane tracker; lengths in pixels are measured on the planar target."""

    least_inliers: float = 0.3  # Of the points: fewer can be matched by accident.
    least_correlation: float = 0.35  # Where the target is not, its better tiles reach 0.3 by chance.
    correlation_kept: float = 0.6  # Of what it usually is.
    worst_std_px: float = 0.35  # [px] Deviation of a corner: a plain or mostly hidden target.
    least_information: float = 0.75  # Of the template's, in the inliers: with less, another place may fit better,
    other_place_px: float = 0.45  # [px] which is so far away,
    fits_better: float = 0.9  # and leaves less than that of what was left: parts above a top leave more, edges less.
    least_shown: float = 0.1  # Of the information: less is hardly more than what is plain, which fits anywhere.
    jump_px: float = 3.0  # [px] From the prediction: a pose that ends farther is tried from the coarse scale, too.
    coarse_body_px: int = 90  # [px] Length of the body at the coarse scale.
    coarse_samples: int = 400  # Points of the coarse template: more than one in 15 px² of the shrunk body.
    refresh_inliers: float = 0.8  # Of the points: only a body in full view refreshes its template.
    refresh_every: int = 5  # Pictures, after the first ten.
    slowest_refresh: float = 0.05  # Rate of the running means, once they are long: a memory of 20 updates.
    first_lessons: int = 10  # Consecutive pictures from which the response is estimated,
    lesson_every: int = 25  # then one in so many.
    least_share: float = 0.1**3  # Of a determinant: a tenth of each motion.
    noisy_share: float = 0.8  # Of a motion; with less, slopes are averaged: sound film has 0.89 and more.
    most_scale: float = 0.5  # Of the template's own deviation: residuals of an inlier.
    enough_samples: int = 1024  # Points below which a track is flagged: docs/limits.md.


CONSTANTS = PlaneTrackerConstants()

_TABLE_POINTS = 60


@dataclass(frozen=True)
class _Found:
    """An ``alignment``, and the ``template`` that it is of."""

    alignment: Alignment
    template: Template


class PlaneTracker(Tracker):
    """Follows a planar target, observed at ``pose`` (3,) in ``luma``, by some ``samples`` points of it.

    Raises `InputError` when too little of the target is in the picture.
    """

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array, samples: int = 1024):
        self.target = target
        self.pixel_m = target.metres_per_pixel(pose)
        template = make_template(luma, target, pose, samples)
        if template is None:
            raise InputError(
                f"too little of the planar target of {target.body.name} is visible in the first picture",
                remedy="check its clicks and obstructions, or start where the body is in full view",
            )
        self.template = template
        self.factor = max(1, round(2 * target.reach_m / self.pixel_m / CONSTANTS.coarse_body_px))
        small, small_camera = self._shrunk(luma, pose)
        self.coarse = make_template(small, replace(target, camera=small_camera), pose, CONSTANTS.coarse_samples)
        self.shutter = Shutter(target, luma, pose, template)
        self.focus = Focus(self.shutter.sharp)
        self.slopes_seen = _MeanSlopes(len(template.points))
        self._set_slopes(template.slopes)
        self.response, self.blurred_response = _Response(), _Response()
        self.usual_correlation, self.aligned, self.refreshed = 1.0, 0, 0
        self.most_scale = max(2.0, CONSTANTS.most_scale * float(np.std(template.values)))

    @property
    def exposure_s(self) -> float:
        """Estimated exposure time [s]."""
        return self.shutter.exposure_s

    @property
    def widest_blur_px(self) -> float:
        """Widest blur against the first picture [px]."""
        return width_px(self.focus.widest)

    def measure(self, luma: Luma, predicted: Array, velocity: Array | None = None) -> Measurement | None:
        """Pose near ``predicted`` (3,), or None where no alignment passes the gates."""
        there, misfits = self._found(luma, predicted, velocity, self.focus.level), dict[int, float]()
        if there is None:
            return None
        # Until its exposure is known, a moving body's blur may be that of its motion.
        known = velocity is not None and not self.shutter.is_learning(velocity)
        if velocity is not None and known and self.focus.is_due(there.alignment.scale):
            there, misfits = self._in_focus(luma, predicted, velocity, there)
        found, template = there.alignment, there.template
        step = max(1, len(template.points) // _TABLE_POINTS)
        return Measurement(
            pose=found.pose,
            covariance=turned_covariance(found.covariance, found.pose[2]),
            inlier_fraction=found.inlier_fraction,
            residual=found.scale,
            points_m=template.points[::step][:_TABLE_POINTS],
            weights=np.clip(found.weight[::step][:_TABLE_POINTS], 0, 1),
            learn=partial(self._learn, luma, found, template, velocity, misfits),
        )

    def _found(self, luma: Luma, predicted: Array, velocity: Array | None, level: int) -> "_Found | None":
        """The target at a level of blur near ``predicted`` (3,), or None where no alignment passes the gates."""
        self.shutter.sharp = self.focus.at(level)
        swept = None if velocity is None else self.shutter.template(velocity)
        if swept is not None:
            template, response = swept, self.blurred_response
        elif level:
            soft = self.focus.at(level).template
            learned = (self.template.values - self.focus.at(0).template.values)[soft.number]
            template, response = replace(soft, values=soft.values + learned), self.blurred_response
        else:
            template, response = self.template, self.response
        found = self._align(luma, predicted, template, response)
        if found is None or self.target.apart_m(predicted, found.pose) > CONSTANTS.jump_px * self.pixel_m:
            coarse = self._align_coarsely(luma, predicted, template, response)
            if coarse is not None and (found is None or coarse.correlation > found.correlation):
                found = coarse
        if found is not None and information_of_inliers(found, template) < CONSTANTS.least_information:
            found = self._at_its_edges(luma, predicted, found, template, response)
        return None if found is None else _Found(found, template)

    def _in_focus(
        self, luma: Luma, predicted: Array, velocity: Array, there: "_Found"
    ) -> tuple["_Found", dict[int, float]]:
        """What was found, or what is found through another blur that leaves less; and what the levels tried leave.

        Through a wrong blur the pose is off, so that no other one fits there: each is aligned by itself. Where the
        floor is sharp the body is.
        """
        level = self.focus.level
        tried, misfits = {level: there}, {level: self._misfit(luma, there)}
        widest = self.focus.allowed(self.target.blur_px())
        if not level and not widest:
            return there, misfits
        for by in (1, -1):
            other, left = level + by, misfits[level]
            while 0 <= other <= self.focus.last:
                found = self._found(luma, predicted, velocity, other)
                if found is None:
                    break
                tried[other], misfits[other] = found, self._misfit(luma, found)
                if misfits[other] > left:
                    break
                other, left = other + by, misfits[other]
        if self.focus.best(misfits):
            sharp = None if 0 in tried or widest >= max(misfits) else self._found(luma, predicted, velocity, 0)
            if sharp is not None:
                tried[0], misfits[0] = sharp, self._misfit(luma, sharp)
            misfits = {each: left for each, left in misfits.items() if each <= widest} or {level: misfits[level]}
        return tried[self.focus.best(misfits)], misfits

    def _misfit(self, luma: Luma, there: "_Found") -> float:
        points = there.template.points[: FOCUS.learned_from]
        return misfit(self.target.grey_values(luma, points, there.alignment.pose), there.alignment, there.template)

    def _align(
        self, luma: Luma, start: Array, template: Template, response: "_Response", *, wide: bool = False
    ) -> Alignment | None:
        found = align(luma, template, np.ones(len(template.points)), start, self.target, self.most_scale, wide=wide)
        if found is None or response.whole is None:
            return None
        found = replace(found, covariance=response.whole @ found.covariance @ response.whole.T)
        # The rest of a plain top fits anywhere: without its marks it is nowhere.
        shown = not template.is_concentrated or information_of_inliers(found, template) >= CONSTANTS.least_information
        return found if shown and self._trusted(found) else None

    def _at_its_edges(
        self, luma: Luma, start: Array, found: Alignment, template: Template, response: "_Response"
    ) -> Alignment | None:
        """An alignment, or a better one at some distance, for which the edges that looked hidden are the target's.

        None where they fit nowhere and the alignment is hardly of more than what is plain, which fits anywhere.
        """
        other = self._align(luma, start, template, response, wide=True)
        plain = information_of_inliers(found, template) < CONSTANTS.least_shown
        if other is None:
            return None if plain else found
        if not plain and self.target.apart_m(found.pose, other.pose) < CONSTANTS.other_place_px * self.pixel_m:
            return found
        return other if left_over(other, found) < CONSTANTS.fits_better * left_over(found, other) else found

    def _align_coarsely(self, luma: Luma, start: Array, template: Template, response: "_Response") -> Alignment | None:
        if self.coarse is None:
            return None
        small, camera = self._shrunk(luma, start)
        flat = np.ones(len(self.coarse.points))
        found = align(small, self.coarse, flat, start, replace(self.target, camera=camera), self.most_scale)
        return None if found is None else self._align(luma, found.pose, template, response)

    def _shrunk(self, luma: Luma, pose: Array) -> tuple[Luma, Camera]:
        """The surroundings of the body at the coarse scale, and the camera of that picture."""
        centre = self.target.pixels(np.zeros((1, 2)), pose)[0]
        reach = 2.0 * self.target.reach_m / self.pixel_m
        low = np.clip(np.nan_to_num(centre) - reach, 0, None).astype(int)
        high = np.minimum(np.nan_to_num(centre) + reach, [luma.shape[1], luma.shape[0]]).astype(int)
        size = np.maximum((high - low) // self.factor, 8)
        crop = luma[low[1] : low[1] + size[1] * self.factor, low[0] : low[0] + size[0] * self.factor]
        if min(crop.shape) < 8 * self.factor:
            crop, low, size = luma, np.zeros(2, dtype=int), np.array(luma.shape[::-1]) // self.factor
        small = np.asarray(cv2.resize(crop, (int(size[0]), int(size[1])), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        scale = np.array([size[0] / crop.shape[1], size[1] / crop.shape[0]])
        matrix = self.target.camera.matrix.copy()
        matrix[0, 0] *= scale[0]
        matrix[1, 1] *= scale[1]
        # Pixel centres are whole numbers at both scales, so half a pixel goes in and out.
        matrix[:2, 2] = (matrix[:2, 2] - low + 0.5) * scale - 0.5
        return small, replace(self.target.camera, matrix=matrix, resolution_px=(int(size[0]), int(size[1])))

    def _trusted(self, found: Alignment) -> bool:
        x, y, turn = (math.sqrt(max(found.covariance[i, i], 0.0)) for i in range(3))
        worst_m = max(x, y, turn * self.target.reach_m)
        least = max(CONSTANTS.least_correlation, CONSTANTS.correlation_kept * self.usual_correlation)
        matched = found.inlier_fraction >= CONSTANTS.least_inliers and found.correlation >= least
        return bool(found.converged and matched and worst_m <= CONSTANTS.worst_std_px * self.pixel_m)

    def _learn(
        self, luma: Luma, found: Alignment, template: Template, velocity: Array | None, misfits: dict[int, float]
    ) -> None:
        """Learn from a picture in which ``template``, the sharp or a blurred one, was found."""
        sharp = template is self.template
        self.focus.settle(misfits)
        self.shutter.sharp = self.focus.at(self.focus.level)
        response = self.response if sharp else self.blurred_response
        if found.inlier_fraction >= CONSTANTS.refresh_inliers and response.is_due():
            slopes = slopes_at(luma, self.target, found.pose, template.points, self.pixel_m)
            slopes = by_motion(template.points, slopes)
            free = self.free_slopes if sharp else without_light(template.slopes, template)
            response.learn(free, slopes, found.weight)
            if sharp:
                self._average(slopes, found.weight)
        if velocity is not None:
            self.shutter.learn(luma, found, template, velocity)
        if sharp:
            self._refresh(found)

    def _average(self, slopes: Array, weight: Array) -> None:
        """Take the mean slopes of the lessons for those of the template, where it is much noise that made these steep.

        Steps along noise are too short, and end where the noise of two pictures happens to agree.
        """
        self.slopes_seen.add(slopes, weight)
        share, learned = self.response.share, self.response.learned
        if learned < CONSTANTS.first_lessons or self.response.whole is None:
            return
        if np.linalg.eigvals(share).real.min() > CONSTANTS.noisy_share:
            return
        self._set_slopes(self.slopes_seen.mean(self.template.slopes))
        # Of the noise in the old slopes the mean of so many holds one in ``learned``.
        left = share + (np.eye(3) - share) / learned
        self.response = _Response(np.asarray(np.linalg.solve(left, share), dtype=np.float64))

    def _set_slopes(self, slopes: Array) -> None:
        self.template = replace(self.template, slopes=slopes)
        self.free_slopes = without_light(slopes, self.template)
        self.motion_like = np.linalg.pinv(self.free_slopes)

    def _refresh(self, found: Alignment) -> None:
        """Refresh the template's grey values and the usual correlation; the template's place stays."""
        self.aligned += 1
        skipped = self.refreshed > 10 and self.aligned % CONSTANTS.refresh_every
        if found.inlier_fraction < CONSTANTS.refresh_inliers or skipped:
            return
        self.refreshed += 1
        rate = max(1 / (self.refreshed + 1), CONSTANTS.slowest_refresh)
        self.usual_correlation += rate * (found.correlation - self.usual_correlation)
        change = rate * np.where(found.weight > 0, found.residual, 0.0)
        # Only the part that no motion explains is kept: the aligned pose cannot creep.
        change -= self.free_slopes @ (self.motion_like @ change)
        self.template = replace(self.template, values=self.template.values + change)


def information_of_inliers(found: Alignment, template: Template) -> float:
    """Share of a template's information that its inliers hold, in the direction of motion where it is smallest."""
    return _least_share(template.leverage, found.weight, ALIGNMENT.inlier_weight)


@compiled()
def _least_share(leverage: Array, weight: Array, least: float) -> float:
    """Smallest column sum of the rows (n, 3) whose weight (n,) is more than ``least``."""
    x = y = turn = 0.0
    for i in range(len(weight)):
        if weight[i] > least:
            x, y, turn = x + leverage[i, 0], y + leverage[i, 1], turn + leverage[i, 2]
    return float(min(x, y, turn))


def left_over(one: Alignment, other: Alignment) -> float:
    """Share of a target that does not fit in one alignment, counted with the smaller scale of that and another."""
    return _left_over(one.residual, TUKEY * min(one.scale, other.scale))


@compiled()
def _left_over(residual: Array, limit: float) -> float:
    total = 0.0
    for each in residual:
        fits = max(1 - (each / limit) ** 2, 0.0)
        total += 1 - fits * fits * fits
    return float(total / len(residual))


class _Response:
    """Share (3, 3) of a small motion that alignments with a template observe: one where nothing is lost.

    The template's slopes J hold noise, and the steepest places were chosen. A later picture's slopes J' at the same
    points hold independent noise, so ``(JᵀJ)⁻¹JᵀJ'`` is not biased by noise that JᵀJ counts as texture. The alignment
    solves ``JᵀJ' ε = Jᵀ(noise)``: its covariance is that of ``(JᵀJ)⁻¹Jᵀ(noise)`` over this share.
    """

    def __init__(self, share: Array | None = None) -> None:
        self.share: Array = np.eye(3) if share is None else share
        # Inverse of the share; None where hardly any of a motion is observed.
        self.whole: Array | None = np.asarray(np.linalg.inv(self.share), dtype=np.float64)
        self.asked, self.learned = 0, 0

    def is_due(self) -> bool:
        """Whether to learn from the present picture: from each of the first, then from one in ``lesson_every``."""
        self.asked += 1
        return self.learned < CONSTANTS.first_lessons or self.asked % CONSTANTS.lesson_every == 0

    def learn(self, slopes: Array, in_picture: Array, weight: Array) -> None:
        """Compare slopes (n, 3) of the template, freed of the light's, with those of a picture; ``weight`` (n,)."""
        known = np.isfinite(in_picture).all(axis=1) & (weight > 0)
        share: Array = np.asarray(np.linalg.lstsq(slopes[known], in_picture[known], rcond=None)[0], dtype=np.float64)
        self.learned += 1
        self.share += max(1 / self.learned, CONSTANTS.slowest_refresh) * (share - self.share)
        determined = np.linalg.det(self.share) > CONSTANTS.least_share
        self.whole = np.asarray(np.linalg.inv(self.share), dtype=np.float64) if determined else None


class _MeanSlopes:
    """Running mean of the slopes (n, 3) of pictures at the points of a template, where these are seen."""

    def __init__(self, points: int):
        self.total, self.count = np.zeros((points, 3)), np.zeros((points, 1))

    def add(self, slopes: Array, weight: Array) -> None:
        seen = (np.isfinite(slopes).all(axis=1) & (weight > 0))[:, None]
        self.total += np.where(seen, slopes, 0.0)
        self.count += seen

    def mean(self, unseen: Array) -> Array:
        """The mean; ``unseen`` (n, 3) where no picture showed a point."""
        return np.asarray(np.where(self.count > 0, self.total / np.maximum(self.count, 1), unseen))
