"""A measured run as it would have been seen with camera or heights one deviation off, which all runs share."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array, Body, Calibration, DecimatedTrack, Track
from towval.optics.moved_view import pose_sensitivity

_STEP_S = 1e-4
_NEGLIGIBLE = 1e-9
"""Share of the largest variance of the camera below which a direction of its covariance is rounding."""


@dataclass(frozen=True)
class SeenOtherwise:
    """Tracks of a run with one unknown that all runs share one deviation off."""

    rover: DecimatedTrack
    towed: DecimatedTrack
    object_track: Track


def seen_otherwise(
    calibration: Calibration,
    bodies: tuple[Body, Body],
    decimated: tuple[DecimatedTrack, DecimatedTrack],
    object_track: Track,
) -> tuple[SeenOtherwise, ...]:
    """The run once for each principal direction of the camera's covariance, and for each height that is not exact.

    ``bodies`` and ``decimated``: rover and object. The order is the same for all runs of a campaign.
    """
    values, vectors = np.linalg.eigh(calibration.covariance)
    known = values > _NEGLIGIBLE * values[-1]
    camera = vectors[:, known] * np.sqrt(values[known])
    heights = np.diag([body.height_std_m for body in bodies])
    heights = heights[:, heights.any(axis=0)]
    moves = [
        np.concatenate([camera, np.zeros((len(camera), heights.shape[1]))], axis=1),
        np.concatenate([np.zeros((2, camera.shape[1])), heights], axis=1),
    ]

    def shifts(k: int, pose: Array) -> Array:
        """Changes (d, n, 3) of poses (n, 3) of one of the bodies."""
        by_camera, by_height = pose_sensitivity(calibration.camera, calibration.floor, bodies[k], pose)
        return np.moveaxis(by_camera @ moves[0] + by_height[..., None] * moves[1][k], -1, 0)

    def of_curve(k: int) -> Iterator[DecimatedTrack]:
        thin = decimated[k]
        ahead = _STEP_S * thin.rate
        rates = (shifts(k, thin.pose + ahead) - shifts(k, thin.pose - ahead)) / (2 * _STEP_S)
        for shift, rate in zip(shifts(k, thin.pose), rates, strict=True):
            yield replace(thin, pose=thin.pose + shift, rate=thin.rate + rate)

    seen = np.isfinite(object_track.pose).all(axis=1)
    moved = np.zeros((moves[0].shape[1], *object_track.pose.shape))
    moved[:, seen] = shifts(1, object_track.pose[seen])
    tracks = [replace(object_track, pose=object_track.pose + shift) for shift in moved]
    return tuple(SeenOtherwise(*each) for each in zip(of_curve(0), of_curve(1), tracks, strict=True))
