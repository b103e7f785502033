"""Bodies in a frame at the middle of their top, wherever the lab put their own.

Whether places differ, and how surely a place is known, is judged at the origin of the frame. Beside the top, that would
count a heading that is a hair off as another place, and a fit that is good as unsure.
"""

from dataclasses import replace

import numpy as np

from towval.model import Array, Body, Track
from towval.model.geometry import compose, rotation

_CENTRED_M = 1e-6  # [m] Nearer to the middle than this, the frame stays as it is.


def middle_of(body: Body) -> Array:
    """Middle (2,) of a body's top in its own frame [m]; zero where the frame lies there."""
    middle: Array = body.top_corners_m.mean(axis=0)
    return middle if np.linalg.norm(middle) > _CENTRED_M else np.zeros(2)


def about_middle(body: Body) -> Body:
    """The body with its frame moved, not turned, to the middle of its top."""
    middle = middle_of(body)
    if not middle.any():
        return body
    obstructions = tuple(outline - middle for outline in body.obstructions)
    return replace(body, top_corners_m=body.top_corners_m - middle, obstructions=obstructions)


def pose_of(body: Body, pose: Array) -> Array:
    """Poses (..., 3) of a body's own frame, from those of the frame at the middle of its top."""
    return compose(pose, np.array([*-middle_of(body), 0.0]))


def registration_of(body: Body, covariance: Array) -> Array:
    """Covariance (3, 3) of a correction in the frame at the middle, for the same correction in the body's own frame."""
    return _at(covariance, -middle_of(body))


def track_of(body: Body, track: Track) -> Track:
    """The track of a body's own frame, from that of the frame at the middle of its top."""
    shift = -middle_of(body)
    if not shift.any():
        return track
    lever = rotation(track.pose[:, 2]) @ shift
    total = track.total_covariance
    return replace(
        track,
        pose=pose_of(body, track.pose),
        covariance=_at(track.covariance, lever),
        start_covariance=_at(track.start_covariance, shift),
        total_covariance=None if total is None else _at(total, lever),
    )


def _at(covariance: Array, lever: Array) -> Array:
    """Covariances (..., 3, 3) of poses, at points that lie ``lever`` (..., 2) from the origin, in the same axes."""
    by_pose = np.zeros((*lever.shape[:-1], 3, 3))
    by_pose[...] = np.eye(3)
    by_pose[..., 0, 2], by_pose[..., 1, 2] = -lever[..., 1], lever[..., 0]
    return np.asarray(by_pose @ covariance @ by_pose.swapaxes(-1, -2))
