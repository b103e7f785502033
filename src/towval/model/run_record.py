"""Everything known about one run, as used by the figures, the overlay video and the report."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Body, Comparison, DecimatedTrack, RunUncertainty, SimulatedMotion, Track
from towval.model.checks import lock
from towval.model.errors import InputError


@dataclass(frozen=True)
class RunRecord:
    """One run from its tracks to its comparison.

    ``rover`` and ``towed`` are the two bodies, ``hinge`` (2,) and ``anchor`` (2,) [m] the ends of the tether in their
    frames; ``rover_track``, ``object_track`` what was measured, ``decimated`` the decimated track of the rover (None
    where there is none), ``simulated`` what the model says, ``comparison`` the difference, ``uncertainty``
    how large it may be if the model is right, None where that was not computed. ``hinge_height_m`` and
    ``anchor_height_m`` are those of the tether's ends above the floor.
    """

    name: str
    rover: Body
    towed: Body
    hinge: Array
    anchor: Array
    rover_track: Track
    object_track: Track
    simulated: SimulatedMotion
    comparison: Comparison
    decimated: DecimatedTrack | None = None
    uncertainty: RunUncertainty | None = None
    hinge_height_m: float = 0.0
    anchor_height_m: float = 0.0

    def __post_init__(self) -> None:
        lock(self, hinge=(2,), anchor=(2,))
        times = self.comparison.time_s
        if self.uncertainty is not None and not np.array_equal(self.uncertainty.time_s, times):
            raise InputError(
                f"uncertainty and comparison of run {self.name} are not of the same times",
                got=f"{len(self.uncertainty.time_s)} and {len(times)} samples",
                remedy="compute both from the same simulation",
            )

    @property
    def quarter_turns(self) -> int:
        """:attr:`CameraTrack.quarter_turns` of the run's video."""
        return self.rover_track.camera.quarter_turns if self.rover_track.camera else 0


@dataclass(frozen=True)
class Still:
    """A picture of a run's footage: its time on the clock of the run [s], width and height [px], and its bytes.

    ``coding``: ``jpeg``, or that of the footage (``h264``, ``h265``), whose pictures build on those before.
    """

    time_s: float
    size_px: tuple[int, int]
    data: bytes
    coding: str = "jpeg"


def measured_poses(track: Track) -> Array:
    """Poses (n, 3) of the frames in which the body was seen, NaN in the others."""
    return np.where(track.seen[:, None], track.pose, np.nan)


def nearest_samples(time_s: Array, wanted_s: ArrayLike) -> NDArray[np.intp]:
    """Indices of the samples nearest to given times; ``time_s`` increases."""
    wanted_s = np.asarray(wanted_s, dtype=np.float64)
    after = np.clip(np.searchsorted(time_s, wanted_s), 1, max(len(time_s) - 1, 1))
    nearest = np.where(wanted_s - time_s[after - 1] <= time_s[after % len(time_s)] - wanted_s, after - 1, after)
    return np.minimum(nearest, len(time_s) - 1)


def pose_at(time_s: Array, pose: Array, wanted_s: ArrayLike) -> Array:
    """Poses (..., 3) of the samples nearest to times (...), NaN where there is none within one interval of them."""
    nearest, wanted_s = nearest_samples(time_s, wanted_s), np.asarray(wanted_s, dtype=np.float64)
    interval = float(np.median(np.diff(time_s))) if len(time_s) > 1 else np.inf
    return np.where(np.abs(time_s[nearest] - wanted_s)[..., None] <= interval, pose[nearest], np.nan)
