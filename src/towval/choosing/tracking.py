"""Goes with the stage track: how many points of the template the footage needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.choosing.margin import SHARE, measurement_std_m
from towval.track import TrackSettings, track
from towval.types import Body, Calibration, Choice, Track
from towval.vision.camera import to_plane

TRACK_SAMPLES = (1024, 4096)
"""What "auto" chooses from, cheapest first.

Fewer than 1024 points are left out: 256 save 2 % of the time of decoding (docs/choosing.md), and what they add is small
against the measurement uncertainty but not against the frame's own noise, which the verdict is sensitive to.
"""

PROBE_FRAMES, PROBE_STRIDE = 12, 4
"""How many frames the tracker is tried on, and at what stride from the first."""

Frames = Sequence[tuple[float, NDArray[np.uint8]]]


def choose_tracking(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    settings: TrackSettings,
    *,
    auto: bool,
) -> tuple[TrackSettings, dict[str, Choice]]:
    """Try the tracker on a few frames: the settings to take, and for each body what the next would have changed.

    Parameters
    ----------
    frames : sequence of (float, ndarray)
        Some frames from the first on.
    calibration, bodies, clicks_px
        As in :func:`towval.track.track`.
    settings : TrackSettings
        Wanted; with ``auto`` the number of points is chosen from :data:`TRACK_SAMPLES`.
    auto : bool
        Whether to choose.
    """

    def tried(one: TrackSettings) -> dict[str, Track]:
        return track(iter(frames), calibration, bodies, clicks_px, one)

    first = {body.name: np.mean(np.asarray(clicks_px[body.name], dtype=np.float64), axis=0) for body in bodies}
    limit = SHARE * min(
        measurement_std_m(
            calibration,
            body,
            to_plane(calibration.camera, calibration.floor, first[body.name][None], body.tracked_plane_height_m),
        )
        for body in bodies
    )
    candidates = [replace(settings, samples=count) for count in TRACK_SAMPLES] if auto else [settings]
    found = tried(candidates[0])
    for index, candidate in enumerate(candidates):
        following = candidates[index + 1] if index + 1 < len(candidates) else _finer_tracking(candidate)
        other = tried(following)
        changes = {name: _apart(found[name], other[name]) for name in found}
        if not auto or max(changes.values()) <= limit or index + 1 == len(candidates):
            break
        found = other
    measure = f"RMS over {len(frames)} frames"
    return candidate, {
        name: Choice("tracking", _tracking_name(candidate), _tracking_name(following), change, measure)
        for name, change in changes.items()
    }


def _finer_tracking(settings: TrackSettings) -> TrackSettings:
    """The plane method for the paper's points, else four times the points."""
    if settings.method != "plane":
        return replace(settings, method="plane")
    return replace(settings, samples=4 * settings.samples)


def _tracking_name(settings: TrackSettings) -> str:
    return f"plane, {settings.samples} points" if settings.method == "plane" else "KLT points"


def _apart(one: Track, other: Track) -> float:
    """RMS distance of two tracks of the same frames [m]; infinite where they never saw the body together."""
    both = one.seen & other.seen
    if not both.any():
        return float("inf")
    return float(np.sqrt(np.mean(np.sum((one.pose[both, :2] - other.pose[both, :2]) ** 2, axis=1))))
