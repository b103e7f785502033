"""What was observed of one body, picture by picture."""

from array import array

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Features, TrackStatus
from towval.model.geometry import transform

_NUMBERS = 16  # A frame's row: time, pose, covariance, status, share of inliers, residual.
_LAST = 64  # Frames from which the usual misfit is computed.
_MOST_TABLED = 8192  # Frames whose points are kept: every one, then every second, fourth, ...


class Record:
    """What was observed, 128 bytes a frame, so that a video of any length fits in memory."""

    def __init__(self) -> None:
        self.numbers = array("d")
        self.points: list[tuple[int, Array, Array]] = []
        self.points_every = 1
        self.last_status: TrackStatus | None = None

    def __len__(self) -> int:
        return len(self.numbers) // _NUMBERS

    def keep(
        self, time_s: float, pose: Array, covariance: Array, status: TrackStatus, inliers: float, residual: float
    ) -> None:
        """Keep the next frame; pose (3,) and covariance (3, 3) are NaN where the body is lost."""
        self.numbers.extend((time_s, *pose, *covariance.ravel(), float(status), inliers, residual))
        self.last_status = status

    def keep_points(self, points_m: Array, weights: Array) -> None:
        """Keep points of the frame that comes next; of long videos only every second, fourth, ... frame's."""
        if len(self) % self.points_every == 0:
            self.points.append((len(self), points_m.copy(), weights))  # A view would keep the whole template.
        if len(self.points) > _MOST_TABLED:
            self.points_every *= 2
            self.points = [entry for entry in self.points if entry[0] % self.points_every == 0]

    def usual_misfit(self) -> float:
        """Median residual of the last observations; infinite where there is none but the first, which fits itself."""
        rows = np.array(self.numbers[-_LAST * _NUMBERS :]).reshape(-1, _NUMBERS)
        known = rows[(rows[:, 13] == TrackStatus.TRACKED) & (rows[:, 0] > self.numbers[0]), 15]
        known = known[np.isfinite(known)]
        return float(np.median(known)) if len(known) else np.inf

    def features(self, pose: Array, height_m: float) -> Features | None:
        """The kept points on the floor, of the frames' poses (n, 3), at the height of their plane [m]."""
        if not self.points:
            return None
        count = [len(own) for _, own, _ in self.points]
        frame = np.repeat([index for index, _, _ in self.points], count)
        floor_xy = transform(pose[frame], np.concatenate([own for _, own, _ in self.points]))
        floor_m = np.column_stack([floor_xy, np.full(len(frame), height_m)])
        return Features(frame, floor_m, np.concatenate([weights for _, _, weights in self.points]))

    def columns(self) -> tuple[Array, Array, Array, NDArray[np.uint8], Array, Array]:
        """Times, poses (n, 3), covariances (n, 3, 3), status, share of inliers and residuals."""
        rows = np.array(self.numbers).reshape(-1, _NUMBERS)
        covariance = rows[:, 4:13].reshape(-1, 3, 3).copy()
        return rows[:, 0], rows[:, 1:4].copy(), covariance, rows[:, 13].astype(np.uint8), rows[:, 14], rows[:, 15]
