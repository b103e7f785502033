"""Synthetic films, encoded as footage is, scaled down or thinned out; errors of tracks against ground truth."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from studies.worlds.film import write_video
from studies.worlds.scenes import CeilingCamera, FilmedScene
from towval.io.video import Video
from towval.model import Array, Calibration, Track

Luma = NDArray[np.uint8]
Frames = Iterable[tuple[float, Luma]]


@contextmanager
def filmed(scene: FilmedScene, times: Array, **options: str) -> Iterator[Callable[[], Video]]:
    """A film of a scene on disk for the length of a ``with`` block; calling what it yields opens it.

    Options are those of the encoder, see :func:`studies.worlds.film.write_video`.
    """
    settings = {"crf": "18", "preset": "veryfast"} | options
    with TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        write_video(path, CeilingCamera(scene).frames(times), rate=25, **settings)
        yield lambda: Video(path)


def thinned(frames: Frames, stride: int) -> Frames:
    """Every so many frames."""
    return itertools.islice(iter(frames), 0, None, stride)


def shrunk(frames: Frames, scale: float) -> Frames:
    """Frames at a smaller scale, by area averaging."""
    if scale == 1:
        return frames
    return (
        (time_s, np.asarray(cv2.resize(luma, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), dtype=np.uint8))
        for time_s, luma in frames
    )


def shrunk_calibration(calibration: Calibration, scale: float) -> Calibration:
    """The calibration of a camera that takes pictures at a smaller scale."""
    camera = calibration.camera
    matrix = camera.matrix.copy()
    matrix[0, 0] *= scale
    matrix[1, 1] *= scale
    # Pixel centres are whole numbers at both scales, so half a pixel goes in and out.
    matrix[:2, 2] = (matrix[:2, 2] + 0.5) * scale - 0.5
    width, height = (round(scale * side) for side in camera.resolution_px)
    return replace(calibration, camera=replace(camera, matrix=matrix, resolution_px=(width, height)))


STATED_DEVIATIONS = 4.0
"""An error of fewer deviations than this counts as stated by the track: the worst of eighty frames has about three."""


@dataclass(frozen=True)
class TrackErrors:
    """Position errors of a track over the frames with status tracked, and the share of these.

    ``rms_m`` and ``most_m`` root mean square and greatest [m]; ``most_unstated_m`` the greatest of those that exceed
    :data:`STATED_DEVIATIONS` of the pose's own deviation, registration in the first frame included [m].
    """

    rms_m: float
    most_m: float
    most_unstated_m: float
    tracked: float


def track_errors(track: Track, truth: Callable[[float], Array]) -> TrackErrors:
    """Errors of a track against the true pose at its times."""
    seen = np.flatnonzero(track.seen)
    if not len(seen):
        return TrackErrors(np.nan, np.nan, np.nan, 0.0)
    true = np.array([truth(t) for t in track.time_s[seen]])
    distance = np.linalg.norm(track.pose[seen, :2] - true[:, :2], axis=1)
    # The trace of a covariance is the mean square distance, whichever way the body is turned.
    stated = np.trace(track.covariance[seen][:, :2, :2], axis1=1, axis2=2) + np.trace(track.start_covariance[:2, :2])
    unstated = distance[distance > STATED_DEVIATIONS * np.sqrt(stated)]
    return TrackErrors(
        rms_m=float(np.sqrt(np.mean(distance**2))),
        most_m=float(distance.max()),
        most_unstated_m=float(unstated.max(initial=0.0)),
        tracked=len(seen) / len(track.time_s),
    )
