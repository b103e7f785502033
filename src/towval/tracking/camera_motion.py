"""The camera's own motion through a video: registered in every picture, smoothed where it is noise, and corrected."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body, Camera, CameraTrack, Finding, Floor, Stamp
from towval.model.conventions import PICTURE_MOTION, VIEW_MOTION
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.optics.moved_view import parameters_by_motion, picture_motion, pose_sensitivity
from towval.optics.view_motion import moved_view
from towval.tracking.floor_registration import CONSTANTS as REGISTRATION
from towval.tracking.floor_registration import Hidden, Registered
from towval.tracking.pose import STD_OF_MEDIAN
from towval.tracking.template import Luma
from towval.tracking.watched_floor import CONSTANTS as WATCHED
from towval.tracking.watched_floor import WatchedFloor


@dataclass(frozen=True)
class CameraMotionConstants:
    """Tuned constants of the camera's motion."""

    hidden_scale: float = 1.3  # Of a body's outline: its sides and shadow hide the floor, too.
    followed_px: float = 0.25  # [px] From the view that bodies are tracked through, from which on it follows the floor.
    smoothed_s: float = 0.5  # [s] Mounts creep, floors settle: slower than this.
    judged_s: float = 2.0  # [s] Window in which shaking is distinguished from noise.
    significant: float = 3.0  # Deviations of one picture: less is the template's own noise.
    corrected_px: float = 0.05  # [px] Of the floor, the largest over the run: less is not corrected.
    noise_margin: float = 2.0  # Times its variance that noise is taken for: what is left of shaking is that small.
    jump: float = 8.0  # Robust deviations of the change from picture to picture: a knock, a zoom step.
    reported_px: float = 0.3  # [px] Mean shift of the floor that is reported.
    least_known: float = 0.5  # Of the pictures; with fewer registered the floor shows too little.
    averaged: int = 12  # First pictures whose mean shows a noisy floor: in one of them most slopes are noise;
    enough_sure: int = 6  # unless so many of these are sure: pictures of 4K are not kept for nothing.
    textured_slope: float = (
        2.2  # [grey levels/px] Median of the points: codecs leave 1.5 of a plain floor, labs have 3.
    )
    lost_s: float = 0.25  # [s] Longest time without registration; beyond, the camera's place is not known.
    scattered_px: float = 0.15  # [px] Of places against each other: 0.03 to 0.07 in sound footage.
    most_unknown: float = 0.05  # Of the pictures, bridged one by one.


CONSTANTS = CameraMotionConstants()

_SIZE = len(VIEW_MOTION)
_ROW = 2 * _SIZE + 2  # Numbers of a picture: its time, the motion found, the one used, and the deviation [px].
_STEP = 1e-6  # Of each number of a motion, for derivatives.


@dataclass(frozen=True)
class ViewMotion:
    """How the view of ``camera`` and ``floor`` moved against the first picture.

    ``time_s`` (n,); ``motion`` (n, 9) in the order of :data:`towval.model.conventions.VIEW_MOTION`, the estimate for
    each picture, and ``used`` (n, 9) what bodies were tracked through; ``known`` (n,) whether the picture was
    registered, or shows too little of the floor for that, but none of it elsewhere; ``common`` (9, 9) the covariance
    that all pictures share, ``own`` (n, 9) and ``modes`` (9, 9): that of a picture by itself is ``modes diag(own)
    modesᵀ``; ``scattered_px``: deviation of places of the floor against each other, which no motion explains, where it
    counts.
    """

    camera: Camera
    floor: Floor
    time_s: Array
    motion: Array
    used: Array
    known: NDArray[np.bool_]
    common: Array
    own: Array
    modes: Array
    scattered_px: float = 0.0

    @cached_property
    def _by_motion(self) -> Array:
        return parameters_by_motion(self.camera, self.floor)

    @property
    def common_of_parameters(self) -> Array:
        """:attr:`common` as the covariance (18, 18) of :data:`towval.model.CALIBRATION_PARAMETERS`."""
        return self._by_motion @ self.common @ self._by_motion.T

    def of_poses(self, body: Body, pose: Array) -> tuple[Array, Array]:
        """What is left to add to a body's tracked poses (n, 3), and the covariance (n, 3, 3) of that by itself."""
        shift, covariance = np.zeros_like(pose), np.zeros((len(pose), 3, 3))
        left = self.motion - self.used
        rows = np.isfinite(pose[:, 0]) & (left.any(axis=1) | self.own.any(axis=1) | (self.scattered_px > 0))
        if rows.any():
            by_motion = pose_sensitivity(self.camera, self.floor, body, pose[rows])[0] @ self._by_motion
            shift[rows] = np.einsum("nap,np->na", by_motion, left[rows])
            root = by_motion @ self.modes * np.sqrt(self.own[rows])[:, None, :]
            covariance[rows] = root @ root.transpose(0, 2, 1)
            # A body is displaced as a piece of the floor is that is as large.
            std = self.scattered_px * np.linalg.norm(by_motion[:, :2, 7], axis=1)
            covariance[rows] += std[:, None, None] ** 2 * np.diag([1.0, 1.0, (1 / body.reach_m) ** 2])
        return shift, covariance

    def track(self) -> CameraTrack:
        """The motion as a record, with what it does to the picture."""
        picture, std = (np.full((len(self.time_s), len(PICTURE_MOTION)), np.nan) for _ in range(2))
        if self.modes.any():
            view = self.camera, self.floor
            steps = _STEP * np.eye(_SIZE)
            by_motion = np.array([picture_motion(*view, step) - picture_motion(*view, -step) for step in steps]).T
            by_motion /= 2 * _STEP
            different, which = np.unique(self.motion, axis=0, return_inverse=True)
            shown = np.array([picture_motion(*view, motion) for motion in different])[which.ravel()]
            common = np.einsum("pj,jk,pk->p", by_motion, self.common, by_motion)
            variance = common + self.own @ np.square(by_motion @ self.modes).T
            picture[self.known], std[self.known] = shown[self.known], np.sqrt(variance[self.known])
        stamps = np.full(len(self.time_s), Stamp.AS_WRITTEN, dtype=np.uint8)
        return CameraTrack(self.camera, self.floor, self.motion, picture, std, stamps)


class CameraMotion:
    """Registers the floor in each picture of a video.

    ``luma`` (height, width) is the first picture, in which ``bodies`` at their ``poses`` (3,) hide the floor.
    """

    def __init__(self, camera: Camera, floor: Floor, luma: Luma, bodies: Sequence[Body], poses: Sequence[Array]):
        self.camera, self.floor, self.bodies = camera, floor, bodies
        self.hiding = [(CONSTANTS.hidden_scale * body.reach_m, body.tracked_plane_height_m) for body in bodies]
        self.view = camera, floor
        self.opening: list[tuple[Luma, Sequence[Array]]] = [(luma, poses)]
        self.sure = 0
        self.watch = WatchedFloor(camera, floor, luma, self._outlines(poses))
        self.raw, self.used, self.at_first = np.zeros(_SIZE), np.zeros(_SIZE), np.zeros(_SIZE)
        self.numbers, self.covariance, self.registered = array("d"), np.zeros((_SIZE, _SIZE)), 0
        self.begun = False

    @property
    def watched(self) -> bool:
        """Whether the floor shows enough to be registered at all."""
        return self.watch.shows_texture

    def blur_px(self) -> float:
        """As :meth:`WatchedFloor.blur_px`, of the present picture."""
        return self.watch.blur_px()

    def register(self, time_s: float, luma: Luma, poses: Sequence[Array]) -> tuple[Camera, Floor]:
        """The view of the next picture, in which the bodies are near ``poses`` (3,)."""
        found, std_px = None, 0.0
        if not self.begun:
            self.begun = True
            self.numbers.extend((time_s, *np.zeros(2 * _SIZE), np.nan))
            return self.view
        if self.watched:
            found, std_px = self._found(luma, self.raw + self.at_first, poses)
        if found is not None:
            self._count(found)
            # What is hardly ever found may be found in a wrong place.
            watched = self.registered >= CONSTANTS.least_known * len(self.numbers) / _ROW
            if watched and self.watch.as_it_is.shift_px(self.raw - self.used) > CONSTANTS.followed_px:
                self.used = self.raw
                self.view = moved_view(self.camera, self.floor, self.used)
        raw = np.full(_SIZE, np.nan) if found is None else self.raw
        self.numbers.extend((time_s, *raw, *self.used, std_px))
        if self.opening:
            self.opening.append((luma, poses))
            self.sure += found is not None and found.std_px < WATCHED.sure_px
            if self.sure == CONSTANTS.enough_sure:
                self.opening = []
            elif len(self.opening) == CONSTANTS.averaged:
                self._average()
                self.opening = []
        return self.view

    def _found(self, luma: Luma, start: Array, poses: Sequence[Array]) -> tuple[Registered | None, float]:
        """The view in a picture with its deviation [px]; where it is not found that is zero, or infinite if the floor
        is too faint for it, but is not displaced."""
        hidden = self.hidden_discs(poses)
        found = self.watch.register(luma, start, hidden)
        if found is not None:
            return found, found.std_px
        return None, 0.0 if self.watch.as_it_is.hardly_moved(luma, hidden) is None else np.inf

    def _average(self) -> None:
        """Watch the floor as the mean of the first pictures shows it, where one alone shows little beside its noise.

        Only if the floor stands still in these, as far as they can tell.
        """
        if not self.watched:
            return
        rows = np.frombuffer(self.numbers).reshape(-1, _ROW)
        total = np.zeros(self.opening[0][0].shape, dtype=np.float32)
        for luma, _ in self.opening:
            total += luma
        mean = np.rint(total / len(self.opening)).astype(np.uint8)
        outlines = [outline for _, poses in self.opening for outline in self._outlines(poses)]
        watch = WatchedFloor(self.camera, self.floor, mean, outlines)
        if not watch.shows_texture:
            return
        start = np.zeros(_SIZE)
        before, self.watch = self.watch, watch
        again = [self._found(luma, start, poses) for luma, poses in self.opening]
        found = [one for one, _ in again if one is not None]
        still = [watch.as_it_is.shift_px(one.motion) < np.sqrt(2) * CONSTANTS.significant * one.std_px for one in found]
        if len(found) < max(2, CONSTANTS.least_known * len(again)) or not all(still):
            self.watch = before
            return
        # The mean shows a camera that creeps where it was halfway; a straight line leads back to the first picture.
        after_s = rows[:, 0] - rows[:, 0].mean()
        known = np.array([one is not None for one, _ in again])
        slope = np.polyfit(after_s[known], [one.motion for one in found], 1)[0]
        self.registered, self.at_first = 0, after_s[0] * slope
        for row, (one, std_px) in zip(rows[1:], again[1:], strict=True):
            row[1 : _SIZE + 1], row[-1] = np.nan, std_px
            if one is not None:
                self._count(one)
                row[1 : _SIZE + 1] = self.raw

    def _count(self, found: Registered) -> None:
        self.raw = found.motion - self.at_first
        self.registered += 1
        self.covariance += (found.covariance - self.covariance) / self.registered

    def _outlines(self, poses: Sequence[Array]) -> tuple[Array, ...]:
        """Outlines (n, 2) on the floor [m] that bodies at ``poses`` (3,) hide."""
        return tuple(
            transform(p, CONSTANTS.hidden_scale * b.top_corners_m) for b, p in zip(self.bodies, poses, strict=True)
        )

    def hidden_discs(self, poses: Sequence[Array]) -> Hidden:
        """Discs of the floor that bodies hide: where they stand, and behind their tops."""
        eye = self.floor.camera_position_m
        discs = []
        for (radius, height), pose in zip(self.hiding, poses, strict=True):
            behind = eye[:2] + (pose[:2] - eye[:2]) * eye[2] / max(eye[2] - height, 0.1 * eye[2])
            discs += [(pose[:2], radius), (behind, radius)]
        return discs

    def estimate(self) -> ViewMotion:
        """The motion over all pictures, after the last."""
        rows = np.array(self.numbers).reshape(-1, _ROW)
        time_s, raw, used, known = rows[:, 0], rows[:, 1 : _SIZE + 1], rows[:, _SIZE + 1 : -1], rows[:, -1] != 0
        registered = np.isfinite(raw[:, 0])
        zero, flat = np.zeros_like(raw), np.zeros((_SIZE, _SIZE))
        if self.registered < max(1, CONSTANTS.least_known * (len(rows) - 1)):
            # A floor with texture that was surely found at first, and later neither found nor near, was lost. What a
            # codec leaves of a plain one looks the same whether the camera stood or crept.
            known |= self.sure < CONSTANTS.enough_sure or self._slope() < CONSTANTS.textured_slope
            return ViewMotion(self.camera, self.floor, time_s, zero, used, known, flat, zero, flat)
        modes: Array = np.asarray(np.linalg.cholesky(self.covariance), dtype=np.float64)
        z: Array = np.asarray(np.linalg.solve(modes, raw[registered].T).T, dtype=np.float64)
        # A picture is as uncertain as its own light and what hides its floor make it; the first is where all begins.
        noise = rows[registered, -1] / self.watch.as_it_is.std_px(self.covariance)
        slow, common, fast, own = _separated(time_s[registered], z, np.nan_to_num(noise, nan=1.0))
        seen = (slow + fast) @ modes.T

        def in_all(columns: Array) -> Array:
            return np.stack([np.interp(time_s, time_s[registered], column) for column in columns.T], axis=1)

        motion, own_all = in_all(seen), in_all(own)
        # A floor too faint to be registered is near where it was first: what lies between larger motions is not known.
        known &= registered | (np.abs(motion / self.watch.as_it_is.prior).max(axis=1) <= REGISTRATION.small)
        if max(map(self.watch.as_it_is.shift_px, motion)) < CONSTANTS.corrected_px:
            motion, own_all = zero, zero
        common = modes @ np.diag(common) @ modes.T
        scattered_px = self.watch.scattered_px
        scattered_px *= scattered_px > CONSTANTS.scattered_px
        return ViewMotion(self.camera, self.floor, time_s, motion, used, known, common, own_all, modes, scattered_px)

    def _slope(self) -> float:
        """Median slope of the floor's points [grey levels/px]; zero where it shows nothing."""
        template = self.watch.as_it_is.template
        if template is None:
            return 0.0
        return float(np.median(np.linalg.norm(template.slopes[:, :2], axis=1)) * template.pixel_m)

    def findings(self, found: ViewMotion) -> tuple[Finding, ...]:
        """Findings about an estimate."""
        time_s = found.time_s
        findings = []
        gap_s, at_s = _longest_gap(time_s, found.known)
        if gap_s > CONSTANTS.lost_s or found.known.mean() < 1 - CONSTANTS.most_unknown:
            share = 100 * (1 - found.known.mean())
            findings.append(finding("camera_not_registered", percent=share, gap_s=gap_s, time_s=at_s))
        if self.registered < max(1, CONSTANTS.least_known * (len(time_s) - 1)):
            return tuple(findings) or (finding("camera_not_watched"),)
        if found.scattered_px:
            findings.append(finding("picture_warped", place="of the still floor", scattered_px=found.scattered_px))
        shifts = np.array([self.watch.as_it_is.shift_px(motion) for motion in found.motion])
        if shifts.max(initial=0.0) > CONSTANTS.reported_px:
            first = float(time_s[np.argmax(shifts > CONSTANTS.reported_px)])
            std = self.watch.as_it_is.std_px(found.common)
            findings.append(finding("camera_moved", shift_px=float(shifts.max()), time_s=first, std_px=std))
        return tuple(findings)


def _separated(time_s: Array, z: Array, noise: Array) -> tuple[Array, Array, Array, Array]:
    """Slow and fast part (n, 9) of whitened motions, variances common to all (9,) and of each by itself (n, 9).

    ``noise`` (n,): deviation of each picture's motion over the usual one, by which ``z`` (n, 9) is whitened. Each part
    counts from where it exceeds noise: the slow one against the template's, which all pictures share, the fast one
    against a picture's.
    """
    c, n = CONSTANTS, len(z)
    change = np.diff(z, axis=0, prepend=z[:1])
    usual = np.maximum(STD_OF_MEDIAN * np.median(np.abs(change), axis=0), np.sqrt(2))
    jumps = np.flatnonzero((np.abs(change) > c.jump * usual).any(axis=1))
    starts = np.concatenate([[0], jumps, [n]])
    segment = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    first, last = starts[:-1][segment], starts[1:][segment]

    def mean(values: Array, width_s: float) -> tuple[Array, Array]:
        low = np.maximum(np.searchsorted(time_s, time_s - width_s / 2), first)
        high = np.minimum(np.searchsorted(time_s, time_s + width_s / 2, side="right"), last)
        total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        count = (high - low)[:, None]
        return np.asarray((total[high] - total[low]) / count), count

    slow, count = mean(z, c.smoothed_s)
    fast = z - slow
    variance = noise[:, None] ** 2
    shaking = mean(fast**2 / variance, c.judged_s)[0] * count / np.maximum(count - 1, 1)
    of_fast = np.clip(1 - (c.noise_margin / np.maximum(shaking, 1e-9)) ** 2, 0.0, 1.0)
    power = mean(slow**2, np.inf)[0]
    of_slow = np.clip(1 - (c.significant**2 / np.maximum(power, 1e-9)) ** 2, 0.0, 1.0)
    common = of_slow + (1 - of_slow) * np.minimum(power, c.significant**2)
    own = variance * (of_fast**2 + (1 - of_fast) * np.maximum(shaking - 1, 0.0)) + of_slow**2 / count
    return of_slow * slow, common.mean(axis=0), of_fast * fast, own


def _longest_gap(time_s: Array, known: NDArray[np.bool_]) -> tuple[float, float]:
    """Longest time between registered pictures [s], and when it begins [s]; zero where none is missing."""
    at = time_s[known]
    if known.all() or len(at) < 2:
        return 0.0, 0.0
    gaps = np.diff(np.append(at, time_s[-1]))
    missing = np.diff(np.append(np.flatnonzero(known), len(known))) > 1
    if not missing.any():
        return 0.0, 0.0
    worst = int(np.argmax(np.where(missing, gaps, 0.0)))
    return float(gaps[worst]), float(at[worst])
