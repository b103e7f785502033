"""One body followed through a video: prediction, measurement, what is trusted, and the record of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from towval.geometry import compose, transform
from towval.types import Array, Body, Camera, Features, Finding, Floor, Severity, Track, TrackStatus
from towval.vision.outline import OutlineFit, combine_fits, pose_from_clicks, see_outline
from towval.vision.pose import Measurement, Motion, Tracker
from towval.vision.sampling import metres_per_pixel

Luma = NDArray[np.uint8]
TrackerMaker = Callable[[Body, Camera, Floor, Luma, Array], Tracker]

_OUTLINE_EVERY_S = 0.5  # Between pictures whose edges are looked at, at first;
_OUTLINE_DOUBLED_AFTER = 12  # after each dozen twice as long.
_FARTHEST_CORRECTION_PX = 3.0  # Of the registration by all edges: clicks are that good.
_MISFIT_OF_CLICKS_PX = 6.0  # More than 0.7 px of noise can explain.


@dataclass
class _Record:
    time_s: list[float] = field(default_factory=list)
    pose: list[Array] = field(default_factory=list)
    covariance: list[Array] = field(default_factory=list)
    status: list[TrackStatus] = field(default_factory=list)
    inlier_fraction: list[float] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    points: list[tuple[int, Array, Array]] = field(default_factory=list)


class Follower:
    """Follows one body from clicks in the first picture and keeps what it saw.

    Parameters
    ----------
    body : Body
        The body.
    camera, floor : Camera, Floor
        The calibrated camera.
    time_s, luma : float, ndarray (height, width) uint8
        The first picture.
    clicks_px : ndarray (n, 2)
        Its corners [px].
    make_tracker : callable
        Builds the tracker from body, camera, floor, picture and pose.
    coast_s : float
        How long a body that is not seen is predicted before it counts as lost [s].
    """

    def __init__(
        self,
        body: Body,
        camera: Camera,
        floor: Floor,
        time_s: float,
        luma: Luma,
        clicks_px: Array,
        make_tracker: TrackerMaker,
        coast_s: float,
    ):
        self.body, self.camera, self.floor, self.coast_s = body, camera, floor, coast_s
        clicked, click_covariance, misfit_px = pose_from_clicks(body, clicks_px, camera, floor)
        self.findings = _judge_clicks(body, misfit_px)
        fit = see_outline(luma, body, clicked, camera, floor)
        pose = clicked if fit is None else compose(clicked, fit.correction)
        self.start_covariance = click_covariance
        self.pixel_m = metres_per_pixel(pose, body.tracked_plane_height_m, camera, floor)
        self.outline_fits: list[OutlineFit] = []
        self.next_outline_s, self.looks = time_s, 0
        self.tracker = make_tracker(body, camera, floor, luma, pose)
        self.motion = Motion(time_s, pose)
        self.record = _Record()
        self.follow(time_s, luma)

    def follow(self, time_s: float, luma: Luma) -> None:
        """Take in the next picture."""
        predicted = self.motion.predict(time_s)
        seen = self.tracker.measure(luma, predicted)
        if seen is not None:
            self._keep_sighting(time_s, luma, seen)
        elif time_s - self.motion.time_s <= self.coast_s:
            self._keep(time_s, predicted, self._coasting_covariance(time_s), TrackStatus.COASTING)
        else:
            self._keep(time_s, np.full(3, np.nan), np.full((3, 3), np.nan), TrackStatus.LOST)

    def _keep_sighting(self, time_s: float, luma: Luma, seen: Measurement) -> None:
        pose = self.motion.see(time_s, seen.pose) if time_s > self.motion.time_s else seen.pose
        record = self.record
        record.points.append((len(record.time_s), seen.points_m, seen.weights))
        self._keep(time_s, pose, seen.covariance, TrackStatus.TRACKED, seen.inlier_fraction, seen.residual)
        if time_s >= self.next_outline_s:
            fit = see_outline(luma, self.body, pose, self.camera, self.floor)
            if fit is not None:
                self.outline_fits.append(fit)
            self.looks += 1
            self.next_outline_s = time_s + _OUTLINE_EVERY_S * 2 ** (self.looks // _OUTLINE_DOUBLED_AFTER)

    def _coasting_covariance(self, time_s: float) -> Array:
        # ASSUME: while unseen the body may have stopped, or gone on twice as fast.
        gone = np.abs(self.motion.velocity) * (time_s - self.motion.time_s)
        return np.diag((np.array([gone[:2].max(), gone[:2].max(), gone[2]]) + self.pixel_m * np.array([1, 1, 5])) ** 2)

    def _keep(
        self,
        time_s: float,
        pose: Array,
        covariance: Array,
        status: TrackStatus,
        inlier_fraction: float = 0.0,
        residual: float = np.nan,
    ) -> None:
        record = self.record
        record.time_s.append(time_s)
        record.pose.append(pose)
        record.covariance.append(covariance)
        record.status.append(status)
        record.inlier_fraction.append(inlier_fraction)
        record.residual.append(residual)

    def track(self, method: str) -> Track:
        """The whole record as a track, registered to the edges of all pictures."""
        record, fit = self.record, self._registration()
        pose = np.array(record.pose)
        features = self._features()
        if fit is not None:
            pose = compose(pose, fit.correction)
        return Track(
            body=self.body.name,
            time_s=np.array(record.time_s),
            pose=pose,
            covariance=np.array(record.covariance),
            status=np.array(record.status, dtype=np.uint8),
            inlier_fraction=np.array(record.inlier_fraction),
            residual=np.array(record.residual),
            start_covariance=self.start_covariance if fit is None else fit.covariance,
            features=features,
            findings=tuple(self.findings),
            method=method,
        )

    def _registration(self) -> OutlineFit | None:
        if self.outline_fits:
            fit = combine_fits(self.outline_fits)
            if np.linalg.norm(fit.correction[:2]) < _FARTHEST_CORRECTION_PX * self.pixel_m:
                return fit
        text = (
            f"The edges of {self.body.name} could not be found around the clicks; its frame rests on the clicks "
            f"({1000 * np.sqrt(self.start_covariance[0, 0]):.1f} mm). Check the clicks and top_corners_m."
        )
        self.findings.append(Finding(Severity.WARNING, "edges_not_found", text))
        return None

    def _features(self) -> Features | None:
        points = self.record.points
        if not points:
            return None
        height = self.body.tracked_plane_height_m
        count = [len(own) for _, own, _ in points]
        frame = np.repeat([index for index, _, _ in points], count)
        floor_xy = transform(np.array(self.record.pose)[frame], np.concatenate([own for _, own, _ in points]))
        floor_m = np.column_stack([floor_xy, np.full(len(frame), height)])
        return Features(frame, floor_m, np.concatenate([weights for _, _, weights in points]))


def _judge_clicks(body: Body, misfit_px: float) -> list[Finding]:
    if misfit_px <= _MISFIT_OF_CLICKS_PX:
        return []
    text = (
        f"The clicks of {body.name} miss its corners by up to {misfit_px:.1f} px. Check their order, whether they "
        "belong to this body, its top_corners_m and tracked_plane_height_m."
    )
    return [Finding(Severity.WARNING, "clicks_misfit", text)]
