"""A candidate tracker: KLT from each picture to the next, without a keyframe to hold on to."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.tracking.klt import KltTracker
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import Measurement, Tracker
from towval.tracking.track import TRACKERS, TrackSettings

Luma = NDArray[np.uint8]


class FrameToFrameKlt(Tracker):
    """Follows one body by points that are new in every picture; its errors add up.

    The arguments are those of :class:`towval.tracking.klt.KltTracker`, of which it makes one a picture.
    """

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array):
        self.target = target
        self.last = KltTracker(target, luma, pose)

    def measure(self, luma: Luma, predicted: Array, velocity: Array | None = None) -> Measurement | None:
        """Pose near ``predicted`` (3,) from the points of the picture before."""
        found = self.last.measure(luma, predicted, velocity)
        return None if found is None else replace(found, learn=partial(self._start_again, luma, found.pose))

    def _start_again(self, luma: Luma, pose: Array) -> None:
        self.last = KltTracker(self.target, luma, pose)


TRACKERS.register("klt frame to frame", lambda settings: FrameToFrameKlt)

FRAME_TO_FRAME = TrackSettings(method="klt frame to frame")
"""Settings of the stage ``track`` with this tracker."""
