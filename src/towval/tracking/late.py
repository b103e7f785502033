"""What it does to poses that their pictures are early or late by an unknown time."""

from dataclasses import dataclass

import numpy as np

from towval.model import Array


@dataclass(frozen=True)
class LateConstants:
    """Tuned constant of poses of late pictures."""

    around: int = 6  # Pictures on each side whose velocity counts where one shows none.


CONSTANTS = LateConstants()


def delayed(time_s: Array, pose: Array, late_s: float) -> Array:
    """Covariance (n, 3, 3) of poses (n, 3) at times (n,) that are early or late by a deviation [s].

    Where real pictures are shown several times each, most poses show no velocity: those around count, too.
    """
    covariance = np.zeros((len(pose), 3, 3))
    seen = np.flatnonzero(np.isfinite(pose[:, 0]))
    if late_s and len(seen) > 1:
        velocity = np.gradient(pose[seen], time_s[seen], axis=0)
        squared = velocity[:, :, None] * velocity[:, None, :]
        around = np.pad(squared, ((CONSTANTS.around, CONSTANTS.around), (0, 0), (0, 0)), mode="edge")
        mean = np.lib.stride_tricks.sliding_window_view(around, 2 * CONSTANTS.around + 1, axis=0).mean(axis=-1)
        speed2, usual2 = (np.trace(each[:, :2, :2], axis1=1, axis2=2) for each in (squared, mean))
        covariance[seen] = late_s**2 * np.where((speed2 < usual2)[:, None, None], mean, squared)
    return covariance
