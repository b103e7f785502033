"""The measured path as a frame for errors: directions along and across it, and its length."""

from dataclasses import dataclass

import numpy as np

from towval.model import Array, SimulatedMotion, Track
from towval.model.geometry import pose_difference, rotation
from towval.model.run_record import measured_poses
from towval.model.statement import Draws
from towval.validation.statistics import upper_error

_LEAST_TIMES = 24  # number of blocks of a signature

_STEP_M = 0.01
"""Distance after which direction and length of the path are updated [m]: long against noise, short against bends."""


class PathFrame:
    """The measured path at given times (n,) [s].

    ``pose`` (n, 3) is NaN where the object was not ``seen`` (n,); ``length`` (n,) is that of the path so far [m].
    """

    def __init__(self, measured: Track, times: Array):
        self.rows = measured.rows_at(times)
        self.pose = measured_poses(measured)[self.rows]
        self.seen = np.isfinite(self.pose[:, 0])
        self.length = _arc_length(self.pose)
        self._turn = rotation(np.nan_to_num(_directions(self.pose)))

    def error(self, pose: Array) -> Array:
        """Poses (n, 3) minus the measured ones, on the floor's axes; NaN where not seen."""
        return pose_difference(pose, self.pose)

    def along_across(self, error: Array) -> Array:
        """Errors (..., n, 3) on the floor's axes turned to along, across (to the left) and heading."""
        shift = np.einsum("nji,...nj->...ni", self._turn, error[..., :2])
        return np.concatenate([shift, error[..., 2:]], axis=-1)

    def covariance(self, floor: Array) -> Array:
        """Covariances (n, 2, 2) of positions on the floor's axes turned in the same way."""
        return np.asarray(self._turn.transpose(0, 2, 1) @ floor @ self._turn)


@dataclass(frozen=True)
class OnPath:
    """Error and draws of a run along and across the measured path, at the n times at which the object was seen.

    ``error`` (n, 3) simulated minus measured; ``drawn`` (k, n, 3) draws of a right model's error; ``off`` (k, n, 3)
    draws of measured minus true; [m, m, rad].
    """

    frame: PathFrame
    error: Array
    drawn: Array
    off: Array

    @classmethod
    def of(cls, measured: Track, simulated: SimulatedMotion, draws: Draws) -> "OnPath | None":
        """Error and draws of a run; None where it was seen at fewer times than a signature needs."""
        frame = PathFrame(measured, simulated.time_s[draws.rows])
        if np.count_nonzero(frame.seen) < _LEAST_TIMES:
            return None
        parts = frame.error(simulated.pose[draws.rows]), draws.error, draws.measurement
        return cls(frame, *(frame.along_across(each)[..., frame.seen, :] for each in parts))

    def bound_error(self, confidence: float) -> float:
        """Relative standard error [1] of the upper bound of the largest error due to the number of draws: the larger of
        the simulation's and the model's."""
        model = upper_error(self.error, self.drawn, 0.5 * (1 + confidence))
        return max(upper_error(self.error, self.off, confidence), model)

    @property
    def length(self) -> Array:
        """Length of the path (n,) so far [m]."""
        return self.frame.length[self.frame.seen]


def _directions(pose: Array) -> Array:
    """Direction (n,) of the measured path [rad]: that of the next step, at the end of the last; NaN if none is."""
    direction = np.full(len(pose), np.nan)
    seen = np.flatnonzero(np.isfinite(pose[:, 0]))
    if not len(seen):
        return direction
    anchor = pose[seen[0], :2]
    for i in seen:
        step = pose[i, :2] - anchor
        if step @ step > _STEP_M**2:
            direction[i], anchor = np.arctan2(step[1], step[0]), pose[i, :2]
    known = np.flatnonzero(np.isfinite(direction))
    if len(known) == 0:
        return direction
    return direction[known[np.clip(np.searchsorted(known, np.arange(len(pose))), 0, len(known) - 1)]]


def _arc_length(pose: Array) -> Array:
    """Arc length (n,) of the measured path [m], summed in steps longer than the noise, so that a rest adds nothing."""
    length, total, corner = np.zeros(len(pose)), 0.0, None
    for i, position in enumerate(pose[:, :2]):
        if np.isfinite(position[0]):
            if corner is None:
                corner = position
            path = float(np.linalg.norm(position - corner))
            if path > _STEP_M:
                total, corner = total + path, position
        length[i] = total
    return length
