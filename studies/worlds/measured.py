"""Tracks without a film: poses as the stage track hands them on, with a noise that is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Track, TrackStatus


def measured_track(
    body: str, time_s: Array, pose: Array, frame_std: ArrayLike, start_std: ArrayLike = (0.0, 0.0, 0.0)
) -> Track:
    """A track that saw its body in every frame.

    Parameters
    ----------
    body : str
        Name of the body.
    time_s, pose : ndarray (n,), (n, 3)
        Times [s] and measured poses [m, m, rad], whose noise is already in them.
    frame_std : array_like (3,)
        Standard deviation of that noise [m, m, rad].
    start_std : array_like (3,), optional
        That of the registration in the first frame, none if not given.
    """
    n = len(time_s)
    return Track(
        body=body,
        time_s=time_s,
        pose=pose,
        covariance=np.tile(np.diag(np.square(frame_std)), (n, 1, 1)),
        status=np.full(n, TrackStatus.TRACKED, dtype=np.uint8),
        inlier_fraction=np.ones(n),
        residual=np.full(n, 0.1),
        start_covariance=np.diag(np.square(start_std)),
    )
