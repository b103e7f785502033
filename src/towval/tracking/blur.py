"""Motion blur: the appearance of a moving planar target through an open shutter.

While the shutter is open a point p of the picture, taken in the body frame at the middle of the exposure, shows the
points ``p − s w(p)`` of the target, ``w = τ (v + ω × p)`` the motion of the point during the exposure τ and s from −½
to ½. So a blurred picture is aligned with the mean of the sharp target over these points. Against the sharp target the
sum of squares has a flat bottom as wide as the blur, and texture and noise decide where in it an alignment ends.

The exposure is measured: of several candidates the one that explains the moving pictures best.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Camera
from towval.tracking.alignment import Alignment
from towval.tracking.light import light_misfit
from towval.tracking.planar_target import PlanarTarget, usable_points
from towval.tracking.template import Luma, Template, by_motion, clearance_m, slopes_at

_CANDIDATES_S = np.arange(17) / 240.0
"""Exposures that are considered [s]. ASSUME: none is longer than a fifteenth of a second."""
_BORDER_PX = 16  # Round a body, kept of its picture: a blur of 6 px mixes no more of its surroundings in.
_READINGS = 2  # Of the sharp target between one candidate and the next.


@dataclass(frozen=True)
class BlurConstants:
    """Tuned constants of motion blur, set on seeds 100 to 109 of studies/tables/tracking_accuracy.py."""

    learned_from: int = 400  # Points, the first of the template: an even choice.
    least_path_px: float = 3.0  # [px] During the longest candidate, so that a picture distinguishes the candidates.
    first_lessons: int = 10  # Pictures in a row that the exposure is learned from,
    lesson_every: int = 10  # then one in so many.
    blurred_px: float = 0.5  # [px] Less motion is as sharp as the smoothing of the readings.
    reading_px: float = 1.5  # [px] Between readings of the sharp target; each is smoothed over 1.4 px.
    changed_px: float = 0.5  # [px] Change of the motion beyond which the blurred template is recomputed.
    least_kept: float = 0.6  # Of the points: with fewer the blur is a large part of the body.


CONSTANTS = BlurConstants()


def paths(points: Array, sweep: Array) -> Array:
    """Displacement (n, 2) of points (n, 2) of a body [m] that moves by ``sweep`` (3,) in its own frame [m, m, rad]."""
    moved: Array = sweep[:2] + sweep[2] * np.column_stack([-points[:, 1], points[:, 0]])
    return moved


@dataclass(frozen=True, eq=False)
class SharpTarget:
    """The picture that a template was taken from, cut out around the body.

    ``luma`` (height, width); ``target`` under the camera of that part; ``pose`` (3,) of the body; ``template`` from it.
    """

    luma: Luma
    target: PlanarTarget
    pose: Array
    template: Template

    @classmethod
    def cut(cls, luma: Luma, target: PlanarTarget, pose: Array, template: Template) -> "SharpTarget":
        """Keep what is needed of the picture ``luma``, where the body is at ``pose`` (3,)."""
        corners = target.pixels(target.body.top_corners_m, pose)
        low = np.clip(np.floor(corners.min(axis=0)).astype(int) - _BORDER_PX, 0, None)
        high = np.ceil(corners.max(axis=0)).astype(int) + _BORDER_PX + 1
        part = luma[low[1] : high[1], low[0] : high[0]].copy()
        return cls(part, replace(target, camera=_shifted(target.camera, low, part)), np.array(pose), template)

    def read(self, points: Array) -> Array:
        """Grey values (n,) at points (n, 2) of the body frame [m]; NaN outside the picture."""
        return self.target.grey_values(self.luma, points, self.pose)

    def clear(self, points: Array, path: Array) -> NDArray[np.bool_]:
        """Which points (n, 2) show nothing but the target while they move by ``path`` (n, 2) [m]."""
        margin = clearance_m(self.target.body, self.template.pixel_m)
        return np.logical_and(*(usable_points(self.target.body, points + s * path, margin) for s in (-0.5, 0.5)))

    def blurred(self, sweep: Array) -> Template | None:
        """The template through a shutter that is open while the body moves by ``sweep`` (3,) [m, m, rad].

        None where the blur is negligible, or so large that most of the target is mixed with its surroundings.
        """
        sharp = self.template
        path = paths(sharp.points, sweep)
        most = np.hypot(*path.T).max() / sharp.pixel_m
        if most < CONSTANTS.blurred_px:
            return None
        count = int(np.ceil(most / CONSTANTS.reading_px)) + 1
        kept = self.clear(sharp.points, path)
        sharp, path = sharp.of(kept), path[kept]
        points = sharp.points
        values, slope = np.zeros(len(points)), np.zeros((len(points), 2))
        for s in (np.arange(count) + 0.5) / count - 0.5:
            places = points + s * path
            values += self.read(places) / count
            slope += slopes_at(self.luma, self.target, self.pose, places, sharp.pixel_m) / count
        known = np.isfinite(values) & np.isfinite(slope).all(axis=1)
        if known.sum() < CONSTANTS.least_kept * len(kept):
            return None
        return replace(sharp, values=values, slopes=by_motion(points, slope)).of(known)


def ahead_of_middle(time_s: Array, pose: Array, exposure_s: float) -> Array:
    """Difference of the mean pose over an exposure from the pose at its middle (n, 3) [m, m, rad].

    An acceleration a during the exposure τ shifts the mean by ``a τ² / 24``. It is taken from three consecutive poses;
    zero where one of them is missing (NaN).
    """
    shift = np.zeros_like(pose)
    if len(pose) < 3 or exposure_s == 0.0:
        return shift
    velocity = np.diff(pose, axis=0) / np.diff(time_s)[:, None]
    acceleration = 2 * np.diff(velocity, axis=0) / (time_s[2:] - time_s[:-2])[:, None]
    shift[1:-1] = np.nan_to_num(acceleration) * exposure_s**2 / 24
    return shift


def _noise_left(length_px: Array) -> Array:
    """Share (n,) of the variance of white noise that is left when readings are averaged over lengths (n,)."""
    # Readings are smoothed by the cubic B-spline, so the autocorrelation of their noise is the B-spline of degree 7,
    # whose variance is 8/12 px²; here the Gaussian of that variance.
    u = (np.arange(64) + 0.5) / 64
    left: Array = 2 * np.mean((1 - u) * np.exp(-(np.outer(length_px, u) ** 2) / (2 * 8 / 12)), axis=1)
    return left


def _shifted(camera: Camera, low: NDArray[np.int_], part: Luma) -> Camera:
    """The camera whose picture is a part of another's, cut at the pixel ``low`` (2,)."""
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= low
    return replace(camera, matrix=matrix, resolution_px=(part.shape[1], part.shape[0]))


class Shutter:
    """Estimates the exposure, and blurs a template accordingly. ASSUME: one exposure for all pictures.

    ``sharp`` is the target without motion: as the first picture shows it, or as far out of focus as the present ones.
    """

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array, template: Template):
        self.target = target
        self.sharp = SharpTarget.cut(luma, target, pose, template)
        self.misfit, self.own_noise = np.zeros((2, len(_CANDIDATES_S)))
        self.weight = 0.0
        self.lessons = 0
        self.swept: dict[SharpTarget, tuple[Array, Template | None]] = {}

    @property
    def exposure_s(self) -> float:
        """The exposure that explains the pictures so far best [s]; zero while none showed any motion."""
        if not self.weight:
            return 0.0
        # A mean of readings holds less noise than one, and would win for that alone. The picture is as noisy as the
        # sharp one: the misfit of the best candidate gives that noise.
        best = int(np.argmin(self.misfit))
        noise = self.misfit[best] / (self.weight + self.own_noise[best])
        misfit = self.misfit - noise * self.own_noise
        best = int(np.argmin(misfit))
        if not 0 < best < len(_CANDIDATES_S) - 1:
            return float(_CANDIDATES_S[best])
        before, at, after = misfit[best - 1 : best + 2]
        return float(_CANDIDATES_S[best] + 0.5 * (before - after) / (before - 2 * at + after) * _CANDIDATES_S[1])

    def template(self, velocity: Array) -> Template | None:
        """:meth:`SharpTarget.blurred` at a velocity (3,) and the estimated exposure, kept while that hardly changes."""
        sweep = velocity * self.exposure_s
        kept, template = self.swept.get(self.sharp, (np.zeros(3), None))
        change = np.abs(sweep - kept)
        if change[:2].sum() + self.target.reach_m * change[2] > CONSTANTS.changed_px * self.sharp.template.pixel_m:
            template = self.sharp.blurred(sweep)
            self.swept[self.sharp] = sweep, template
        return template

    def is_learning(self, velocity: Array) -> bool:
        """Whether pictures of a body at a velocity (3,) are still to teach the exposure."""
        return self.lessons < CONSTANTS.first_lessons and self._paths_px(velocity)[-1] >= CONSTANTS.least_path_px

    def _paths_px(self, velocity: Array) -> Array:
        """How far a body at a velocity (3,) gets during each candidate (k,) [px]."""
        speed = math.hypot(velocity[0], velocity[1]) + 0.5 * self.target.reach_m * abs(velocity[2])
        return np.asarray(speed * _CANDIDATES_S / self.sharp.template.pixel_m)

    def learn(self, luma: Luma, found: Alignment, template: Template, velocity: Array) -> None:
        """Compare all exposures with a picture in which ``template`` was found, the body at a velocity (3,)."""
        length_px = self._paths_px(velocity)
        if length_px[-1] < CONSTANTS.least_path_px:
            return
        self.lessons += 1
        if self.lessons > CONSTANTS.first_lessons and self.lessons % CONSTANTS.lesson_every:
            return
        points = template.points[: CONSTANTS.learned_from]
        longest = paths(points, velocity * _CANDIDATES_S[-1])
        steps = _READINGS * (len(_CANDIDATES_S) - 1)
        kept = np.flatnonzero(self.sharp.clear(points, longest))
        points, path = points[kept], longest[kept]
        places = points + (np.arange(steps + 1) / steps - 0.5)[:, None, None] * path
        readings = self.sharp.read(places.reshape(-1, 2)).reshape(steps + 1, -1)
        values = self.target.grey_values(luma, points, found.pose)
        known = np.isfinite(readings).all(axis=0) & np.isfinite(values)
        if known.sum() < CONSTANTS.least_kept * min(CONSTANTS.learned_from, len(self.sharp.template.points)):
            return
        tile, weight = template.tile[kept[known]], found.weight[kept[known]]
        self.weight += weight.sum()
        self.own_noise += weight.sum() * _noise_left(length_px)
        readings, values = readings[:, known], values[known]
        between = (readings[1:] + readings[:-1]) / 2
        swept, middle = readings[steps // 2], steps // 2
        for i in range(len(_CANDIDATES_S)):
            if i:
                swept = between[middle - i : middle + i].mean(axis=0)
            self.misfit[i] += light_misfit(values, swept, tile, template.tiles, weight, found.scale)
