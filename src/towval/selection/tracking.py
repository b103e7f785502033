"""How much the next finer tracking would move poses, on some frames of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Body, Calibration, Choice, Track
from towval.model.geometry import rms_length
from towval.tracking.track import TrackSettings, track_beside

TRACK_SAMPLES = (1024, 4096)
"""Values that "auto" selects from, cheapest first.

Fewer than 1024 points are left out: 256 save 2 % of the time of decoding (docs/selection.md); their effect is small
against the measurement uncertainty but not against the noise of single frames, to which the verdict is sensitive.
"""

PROBE_FRAMES, PROBE_STRIDE = 12, 4
"""Number of frames on which a given setting is compared with its neighbour, and their stride from the first."""


def neighbour_of_tracking(
    frames: Sequence[tuple[float, NDArray[np.uint8]]],
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    settings: TrackSettings,
) -> dict[str, Choice]:
    """The effect of the next finer tracking for each body, from some frames beginning with the first.

    For the finest, the next coarser one is tried. The parameters are those of :func:`towval.tracking.track.track`.
    """
    other = _neighbour(settings)
    found, beside = track_beside(iter(frames), calibration, bodies, clicks_px, (settings, other))
    measure = f"RMS over {len(frames)} frames"
    return {
        name: Choice(
            "tracking", tracking_name(settings), tracking_name(other), apart_m(found[name], beside[name]), measure
        )
        for name in found
    }


def _neighbour(settings: TrackSettings) -> TrackSettings:
    """The plane method for the paper's points, else the next number of points, or the previous one for the largest."""
    if settings.method != "plane":
        return replace(settings, method="plane")
    following = 4 * settings.samples
    return replace(settings, samples=following if following <= TRACK_SAMPLES[-1] else settings.samples // 4)


def tracking_name(settings: TrackSettings) -> str:
    """A tracking method with its number of points, for a reader."""
    if settings.method == "plane":
        return f"plane, {settings.samples} points"
    return "KLT points" if settings.method == "klt" else settings.method


def apart_m(one: Track, other: Track) -> float:
    """RMS distance of two tracks of the same frames [m]; infinite where they never saw the body together."""
    both = one.seen & other.seen
    return rms_length(one.pose[both] - other.pose[both]) if both.any() else float("inf")
