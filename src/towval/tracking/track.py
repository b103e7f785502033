"""Stage ``track``: from pictures to planar poses of the bodies, with their uncertainty."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Body, Calibration, Finding, Track
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.plugins import Registry
from towval.tracking.camera_motion import CameraMotion
from towval.tracking.follow import Follower, TrackerMaker
from towval.tracking.klt import KltTracker
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.plane_tracker import CONSTANTS as PLANE
from towval.tracking.plane_tracker import PlaneTracker


@dataclass(frozen=True)
class TrackSettings:
    """How to track: the keys of ``config["track"]``.

    Parameters
    ----------
    method : str
        Name in :data:`TRACKERS`: ``plane``, alignment of the whole planar target with a template; ``klt``, the
        paper's points; or one that a plugin registers.
    samples : int
        Points of the template; with fewer than 1024 the tracks carry a warning.
    coast_s : float
        How long a body that is not observed is predicted, and marked so, before it counts as lost [s].
    forward_backward_px : float
        Largest distance between a KLT point and where it comes back to [px].
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


Frames = Iterable[tuple[float, NDArray[np.uint8]]]


def track(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    settings: TrackSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[str, Track]:
    """Track bodies through a video, in one pass over its pictures.

    Parameters
    ----------
    frames : iterable of (float, ndarray (height, width) uint8)
        Presentation time [s], strictly increasing, and luma of each picture.
    clicks_px : mapping of str to array_like (n, 2)
        For each body the pixels of ``top_corners_m`` in the first picture.
    progress : callable, optional
        Called with the number of pictures done after each.

    Returns
    -------
    dict of str to Track
        A track for each body, by name. Poses are those of the body frame on the floor.

    Raises
    ------
    InputError
        When there is no picture, the picture's size is not the calibration's, or clicks are missing.
    """
    return track_beside(frames, calibration, bodies, clicks_px, (settings or TrackSettings(),), progress)[0]


def track_beside(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    several: Sequence[TrackSettings],
    progress: Callable[[int], None] | None = None,
) -> list[dict[str, Track]]:
    """Track with several settings beside one another in the same pass, which decodes the video once.

    The tracks come in the order of ``several``, each as :func:`track` would give it; the rest is as there.
    """
    missing = [body.name for body in bodies if body.name not in clicks_px]
    if missing:
        raise InputError(f"first_frame_clicks_px of {', '.join(missing)} is missing", got=sorted(clicks_px))
    groups: list[_Group] = []
    done = 0
    for time_s, picture in frames:
        luma = np.ascontiguousarray(picture)
        if done == 0:
            _check_size(luma, calibration)
            groups = [_Group(settings, calibration, bodies, time_s, luma, clicks_px) for settings in several]
            poses = [follower.first_pose for follower in groups[0].followers]
            camera_motion = CameraMotion(calibration.camera, calibration.floor, luma, bodies, poses)
        else:
            for group in groups:
                group.follow(time_s, luma)
        camera_motion.check(time_s, luma)
        done += 1
        if progress is not None:
            progress(done)
    if not done:
        raise InputError("the video holds no picture")
    return [group.tracks(camera_motion.findings()) for group in groups]


class _Group:
    """All bodies of a scene, followed with the same settings; none may take another's place."""

    def __init__(
        self,
        settings: TrackSettings,
        calibration: Calibration,
        bodies: Sequence[Body],
        time_s: float,
        luma: NDArray[np.uint8],
        clicks_px: Mapping[str, ArrayLike],
    ):
        self.settings = settings
        self.followers = [
            Follower(
                PlanarTarget(body, calibration.camera, calibration.floor),
                time_s,
                luma,
                np.asarray(clicks_px[body.name], dtype=np.float64),
                TRACKERS[settings.method](settings),
                settings.coast_s,
            )
            for body in bodies
        ]

    def follow(self, time_s: float, luma: NDArray[np.uint8]) -> None:
        for follower in self.followers:
            others = [other.place for other in self.followers if other is not follower]
            follower.follow(time_s, luma, [outline for outline in others if outline is not None])

    def tracks(self, camera_findings: tuple[Finding, ...]) -> dict[str, Track]:
        findings = (*camera_findings, *_judge_samples(self.settings))
        return {one.target.body.name: one.track(self.settings.method, findings) for one in self.followers}


def _judge_samples(settings: TrackSettings) -> tuple[Finding, ...]:
    if settings.method != "plane" or settings.samples >= PLANE.enough_samples:
        return ()
    return (finding("few_points", samples=settings.samples, enough=PLANE.enough_samples),)


def _check_size(luma: NDArray[np.uint8], calibration: Calibration) -> None:
    height, width = luma.shape
    if (width, height) != tuple(calibration.camera.resolution_px):
        raise InputError(
            "the video's pictures do not have the size of the calibration's",
            got=f"{width} × {height} px",
            allowed=f"{calibration.camera.resolution_px[0]} × {calibration.camera.resolution_px[1]} px",
            remedy="calibrate with pictures of the same camera mode as the video",
        )
