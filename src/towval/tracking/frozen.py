"""Films that freeze to their end: all bodies stand still at once, one of them out of a step as long as those before.

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
    beside: int = 3  # Steps before the last one that say how fast a body went,
    least_deviations: float = 25.0  # each longer than this, of a pose.
    slower: float = 0.25  # Of their mean, by which the last step of a body is shorter that slowed down.


CONSTANTS = FrozenConstants()


def frozen_at_the_end(tracks: Mapping[str, Track], noise_m: Mapping[str, float]) -> NDArray[np.bool_]:
    """Pictures (n,) that repeat the one in which a film freezes to its end; ``noise_m``: deviations of poses [m]."""
    c, time_s = CONSTANTS, next(iter(tracks.values())).time_s
    frozen, away = (np.zeros(len(time_s), dtype=bool) for _ in range(2))
    places = {name: np.where(track.seen[:, None], track.pose[:, :2], np.nan) for name, track in tracks.items()}
    for name, place in places.items():
        size_m = np.linalg.norm(np.diff(place, axis=0), axis=1)
        known_m = size_m[np.isfinite(size_m)]
        if len(known_m):
            within_m = max(c.still_deviations * noise_m[name], c.still * np.percentile(known_m, 95))
            away |= np.linalg.norm(place - place[tracks[name].seen][-1], axis=1) > within_m
    first = int(np.flatnonzero(away).max(initial=-1)) + 1
    for name, place in places.items() if first > c.beside else ():
        around = slice(first - c.beside - 1, first + 1)
        step = np.diff(place[around], axis=0)
        velocity = step / np.diff(time_s[around])[:, None]
        mean = velocity[:-1].mean(axis=0)
        moved = np.linalg.norm(step, axis=1).min() > c.least_deviations * noise_m[name]
        # What drives out of the picture was seen no more.
        stands = tracks[name].seen[first + 1 :].any()
        frozen[first + 1 :] |= stands and moved and velocity[-1] @ mean > (1 - c.slower) * (mean @ mean)
    return frozen
