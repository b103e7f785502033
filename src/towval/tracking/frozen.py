"""Films that freeze to their end: all bodies stand still at once, one of them out of a step as long as the one before.

A writer that gets no more pictures goes on with the last one. Bodies that do stop slow down first, or stop somewhere
between two pictures, which shortens their last step. If they happened to stop at a picture, no more than a rest at the
end is left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from towval.model import Track


@dataclass(frozen=True)
class FrozenConstants:
    """Tuned constants of frozen films."""

    still: float = 0.1  # Of a usual step, and
    still_deviations: float = 7.0  # of a pose: by less a body does not move.
    least_deviations: float = 25.0  # Of a pose, in the last step, from which on it tells whether a body slowed down.
    even: float = 0.25  # Change of the velocity in the last step, of its size, with which it did not.


CONSTANTS = FrozenConstants()


def frozen_at_the_end(tracks: Mapping[str, Track], noise_m: Mapping[str, float]) -> NDArray[np.bool_]:
    """Pictures (n,) that repeat the one in which a film freezes to its end; ``noise_m``: deviations of poses [m]."""
    c, time_s = CONSTANTS, next(iter(tracks.values())).time_s
    frozen, away, even = (np.zeros(len(time_s), dtype=bool) for _ in range(3))
    for name, track in tracks.items():
        if track.seen.sum() > 2:
            place = np.where(track.seen[:, None], track.pose[:, :2], np.nan)
            size_m = np.linalg.norm(step := np.diff(place, axis=0), axis=1)
            usual_m = np.percentile(size_m[np.isfinite(size_m)], 95)
            within_m = max(c.still_deviations * noise_m[name], c.still * usual_m)
            away |= np.linalg.norm(place - place[track.seen][-1], axis=1) > within_m
            velocity = step / np.diff(time_s)[:, None]
            change, speed = np.linalg.norm(np.diff(velocity, axis=0), axis=1), np.linalg.norm(velocity[1:], axis=1)
            even[2:] |= (size_m[1:] > c.least_deviations * noise_m[name]) & (change < c.even * speed)
    first = int(np.flatnonzero(away).max(initial=-1)) + 1
    frozen[first + 1 :] = even[min(first, len(even) - 1)]
    return frozen
