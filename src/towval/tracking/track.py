"""Stage ``track``: from pictures to planar poses of the bodies, with their uncertainty."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Body, Calibration, Finding, Stamp, Track
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.plugins import Registry
from towval.tracking.camera_motion import CameraMotion, ViewMotion
from towval.tracking.echoes import echo_findings, lateness
from towval.tracking.fields import field_findings, field_lateness
from towval.tracking.finished_track import finished
from towval.tracking.follow import Follower, TrackerMaker
from towval.tracking.invented import check_invented
from towval.tracking.klt import KltTracker
from towval.tracking.known_lengths import OutlineSizes, as_lengths_show, length_findings, scale_findings, size_of_tops
from towval.tracking.middle import about_middle, track_of
from towval.tracking.moved_floor import moved_floor_findings
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import CONSTANTS as PLANE
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.stamps import check_stamps
from towval.tracking.template import Luma
from towval.tracking.total_covariance import with_scatter, with_total


@dataclass(frozen=True)
class TrackSettings:
    """How to track: the keys of ``config["track"]``.

    ``method``: name in :data:`TRACKERS`, ``plane`` (alignment of the whole planar target with a template), ``klt`` (the
    paper's points) or one that a plugin registers; ``samples``: points of the template, tracks with fewer than 1024
    carry a warning; ``coast_s``: how long a body that is not observed is predicted, and marked so, before it counts as
    lost [s]; ``forward_backward_px``: largest distance between a KLT point and where it comes back to [px].
    """

    method: str = "plane"
    samples: int = 1024
    coast_s: float = 0.2
    forward_backward_px: float = 0.5

    def __post_init__(self) -> None:
        TRACKERS.require(self.method, "track.method")


TRACKERS: Registry[Callable[[TrackSettings], TrackerMaker]] = Registry("tracker")
"""Trackers by the name that ``track.method`` gives: functions from the settings to what builds a :class:`Tracker`."""

TRACKERS.register("plane", lambda settings: partial(PlaneTracker, samples=settings.samples))
TRACKERS.register("klt", lambda settings: partial(KltTracker, forward_backward_px=settings.forward_backward_px))

Frames = Iterable[tuple[float, Luma]]
Clicks = Mapping[str, ArrayLike]


def track(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Clicks,
    settings: TrackSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[str, Track]:
    """Track bodies through a video, in one pass over its pictures; returns their tracks by name.

    ``frames`` are the presentation time [s], strictly increasing, and luma (height, width) uint8 of each picture;
    ``clicks_px`` (n, 2) for each body the pixels of ``top_corners_m`` in the first; ``progress`` is called with the
    number of pictures done after each. Poses are those of the body frame on the floor.

    `InputError` where there is no picture or no body, the picture's size is not the calibration's, or clicks are
    missing.
    """
    return track_beside(frames, calibration, bodies, clicks_px, (settings or TrackSettings(),), progress)[0]


def track_beside(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Clicks,
    several: Sequence[TrackSettings],
    progress: Callable[[int], None] | None = None,
) -> list[dict[str, Track]]:
    """As :func:`track`, with ``several`` settings in the same pass, which decodes the video once."""
    if not bodies:
        raise InputError("there is no body to track", got="none", allowed="one body or more")
    missing = [body.name for body in bodies if body.name not in clicks_px]
    if missing:
        raise InputError(f"first_frame_clicks_px of {', '.join(missing)} is missing", got=sorted(clicks_px))
    groups: list[_Group] = []
    done = 0
    for time_s, picture in frames:
        luma = np.ascontiguousarray(picture)
        if done == 0:
            _check_size(luma, calibration)
            centred = [about_middle(body) for body in bodies]
            targets = [PlanarTarget(body, calibration.camera, calibration.floor) for body in centred]
            groups = [_Group(settings, targets, time_s, luma, clicks_px) for settings in several]
            poses = [follower.first_pose for follower in groups[0].followers]
            camera_motion = CameraMotion(calibration.camera, calibration.floor, luma, centred, poses)
            camera_motion.register(time_s, luma, poses)
            for target in targets:
                target.blur_px = camera_motion.blur_px
        else:
            poses = [follower.motion.predict(time_s) for follower in groups[0].followers]
            view = camera_motion.register(time_s, luma, poses)
            for target in targets:
                target.camera, target.floor = view
            for group in groups:
                group.follow(time_s, luma)
        done += 1
        if progress is not None:
            progress(done)
    if not done:
        raise InputError("the video holds no picture")
    view_motion = camera_motion.estimate()
    camera_findings = camera_motion.findings(view_motion)
    found = [group.tracks(view_motion, camera_findings, calibration) for group in groups]
    return [{body.name: track_of(body, tracks[body.name]) for body in bodies} for tracks in found]


class _Group:
    """All bodies of a scene, followed with the same settings; none may take another's place."""

    def __init__(
        self, settings: TrackSettings, targets: Sequence[PlanarTarget], time_s: float, luma: Luma, clicks_px: Clicks
    ):
        self.settings = settings
        make_tracker = TRACKERS[settings.method](settings)
        self.followers = []
        for target in targets:
            clicks = np.asarray(clicks_px[target.body.name], dtype=np.float64)
            self.followers.append(Follower(target, time_s, luma, clicks, make_tracker, settings.coast_s))

    def follow(self, time_s: float, luma: Luma) -> None:
        for follower in self.followers:
            follower.follow(time_s, luma, [other for other in self.followers if other is not follower])

    def tracks(
        self, view: ViewMotion, camera_findings: tuple[Finding, ...], calibration: Calibration
    ) -> dict[str, Track]:
        """The tracks by name, with the findings that they share and the total covariance."""
        tops = [
            OutlineSizes(one.target, one.first_pose, one.sizes, one.edge_watch.usual_size()) for one in self.followers
        ]
        size, size_std = size_of_tops(calibration, tops)
        of_lengths = (*length_findings(tops, size, size_std), *scale_findings(calibration, tops))
        findings = (*camera_findings, *_sample_findings(self.settings), *of_lengths)
        bodies, method = [one.followed() for one in self.followers], self.settings.method
        tracks = {one.target.body.name: finished(one, method, findings, view) for one in bodies}
        as_tracked = tracks
        tracks, in_time, stamps = check_stamps(tracks)
        tracks, of_rhythm = check_invented(tracks)
        of_floor = moved_floor_findings(tracks, {one.target.body.name: one.target for one in self.followers}, view)
        kept = max(one.echoes.kept(one.tracker.widest_blur_px) for one in self.followers)
        apart = max(one.fields.apart() for one in self.followers)
        doubted, of_view = as_lengths_show(calibration, size, size_std), view.common_of_parameters
        added = doubted.covariance - calibration.covariance + of_view
        camera = replace(view.track(), stamps=stamps, size=size, size_std=size_std, added=added)
        found = {}
        for follower in self.followers:
            body = follower.target.body
            one = tracks[body.name]
            of_pictures = (*echo_findings(one.time_s, kept), *field_findings(one.time_s, apart))
            of_pictures += follower.warp.findings(one.time_s)
            # A body seems to stand in a repeated picture, and to leap out of it.
            of_jumps = follower.jumps(as_tracked[body.name], stamps != Stamp.REPEATED)
            late = lateness(one.time_s, one.pose, kept) + field_lateness(one.time_s, one.pose, apart)
            warped, at_start = follower.warp.widened(one.time_s)
            one = replace(
                one,
                findings=(*one.findings, *of_jumps, *in_time, *of_rhythm, *of_pictures, *of_floor),
                covariance=one.covariance + late + warped,
                start_covariance=one.start_covariance + at_start,
                camera=camera,
            )
            found[body.name] = with_scatter(with_total(one, doubted, body, of_view))
        return found


def _sample_findings(settings: TrackSettings) -> tuple[Finding, ...]:
    if settings.method != "plane" or settings.samples >= PLANE.enough_samples:
        return ()
    return (finding("few_points", samples=settings.samples, enough=PLANE.enough_samples),)


def _check_size(luma: Luma, calibration: Calibration) -> None:
    (height, width), (allowed_width, allowed_height) = luma.shape, calibration.camera.resolution_px
    if (width, height) != (allowed_width, allowed_height):
        raise InputError(
            "the video's pictures do not have the size of the calibration's",
            got=f"{width} × {height} px",
            allowed=f"{allowed_width} × {allowed_height} px",
            remedy="calibrate with pictures of the same camera mode as the video, turned as it is",
        )
