"""The total covariance of measured poses, and what a rolling shutter does to them."""

from dataclasses import replace

import numpy as np

from towval.model import Array, Body, Calibration, Track
from towval.model.geometry import turned_covariance
from towval.optics.moved_view import pose_sensitivity, readout_sensitivity
from towval.tracking.noise import local_scatter


def with_total(track: Track, calibration: Calibration, body: Body, view_covariance: Array | None = None) -> Track:
    """The track with the covariance of each pose from all that is known to be uncertain.

    Added to the frame's own are the registration of the body frame, the calibration, the height of the top, and
    ``view_covariance`` (18, 18), that of the camera's own motion; these are one unknown for all poses of a run.
    """
    seen = np.isfinite(track.pose[:, 0])
    total = track.covariance.copy()
    if seen.any():
        pose = track.pose[seen]
        by_parameters, by_height = pose_sensitivity(calibration.camera, calibration.floor, body, pose)
        shared = calibration.covariance if view_covariance is None else calibration.covariance + view_covariance
        total[seen] += by_parameters @ shared @ by_parameters.transpose(0, 2, 1)
        total[seen] += body.height_std_m**2 * by_height[:, :, None] * by_height[:, None, :]
        total[seen] += turned_covariance(track.start_covariance, pose[:, 2])
    return replace(track, total_covariance=total)


def with_scatter(track: Track) -> Track:
    """The track whose total covariance holds what its poses scatter by around each picture, too.

    The frame's own covariance, by which paths are fitted, stays: in a drive that sets off within a picture, some of it
    may be motion.
    """
    assert track.total_covariance is not None
    scatter = local_scatter(track.time_s, np.where(track.seen[:, None], track.pose, np.nan), track.covariance)
    return replace(track, total_covariance=track.total_covariance + scatter)


def with_wider_start(track: Track, spread: Array) -> Track:
    """The track with a further covariance (3, 3) of its registration in the first frame."""
    total = track.total_covariance
    if total is not None and spread.any():
        total = total + turned_covariance(spread, track.pose[:, 2])
    return replace(track, start_covariance=track.start_covariance + spread, total_covariance=total)


def with_readout(track: Track, calibration: Calibration, body: Body, readout_s: float, std_s: float) -> Track:
    """The track of a camera that reads its rows one after another, the top one first, in ``readout_s`` ± ``std_s`` [s].

    The rigid motion that fits the displacements of the corners best is taken off
    (:func:`towval.optics.moved_view.readout_sensitivity`). The deviation of the readout enters the total covariance.
    """
    by_readout = _by_readout(track, calibration, body)
    pose = track.pose - readout_s * np.nan_to_num(by_readout)
    total = None
    if track.total_covariance is not None:
        total = track.total_covariance + std_s**2 * by_readout[:, :, None] * by_readout[:, None, :]
    return replace(track, pose=pose, total_covariance=total)


def _by_readout(track: Track, calibration: Calibration, body: Body) -> Array:
    """Change (n, 3) of the measured poses of a track with the readout [m/s, m/s, rad/s]; NaN as they are."""
    change = np.where(np.isfinite(track.pose), 0.0, np.nan)
    seen, known = np.flatnonzero(track.seen), np.flatnonzero(np.isfinite(track.pose[:, 0]))
    if len(seen) < 2:
        return change
    # A repeated picture shows a body where it was, so its pose tells no velocity.
    of_seen = np.gradient(track.pose[seen], track.time_s[seen], axis=0)
    pose, time_s = track.pose[known], track.time_s[known]
    rate = np.stack([np.interp(time_s, track.time_s[seen], column) for column in of_seen.T], axis=1)
    change[known] = readout_sensitivity(calibration.camera, calibration.floor, body, pose, rate)
    return change
