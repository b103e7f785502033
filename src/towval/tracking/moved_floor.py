"""Whether it was the floor that moved, and not the camera: a mat that slips, a carpet that is pulled, moving light.

Poses are corrected by what the picture of the floor shows as motion of the camera. Where the camera moved, bodies go on
smoothly once they are corrected, and jerk before. Where the floor moved under them, it is the other way round.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from towval.model import Finding, Track
from towval.model.findings import finding
from towval.optics.moved_view import parameters_by_motion, pose_sensitivity
from towval.tracking.camera_motion import CONSTANTS, ViewMotion
from towval.tracking.planar_target import PlanarTarget

_STEP_S = 0.1
"""Time over which a jerk is sought [s]: bodies hardly change their speed in it, a knock or a pull is about as fast."""
_FEWEST = 2
"""Pictures in which the floor jerks, for one that is misread not to tell."""
_HALF = 0.5
"""Share of the floor's jerks in a body's corrected path from which on the floor moved: none has, or all."""


def moved_floor_findings(
    tracks: Mapping[str, Track], targets: Mapping[str, PlanarTarget], view: ViewMotion
) -> tuple[Finding, ...]:
    """A warning where all bodies jerk in the floor's frame as the floor does in the picture, and not in the picture.

    A body that jerks far more by itself, as one that swings on its tether, does not tell.
    """
    least, jerks = [], []
    for name, track in tracks.items():
        found = _share_of_body(track, targets[name], view)
        if found is None:
            return ()
        share, std, *jerk = found
        if 1 - CONSTANTS.significant * std > _HALF:
            least.append(share - CONSTANTS.significant * std)
            jerks.append(jerk)
    if not least or min(least) < _HALF:
        return ()
    largest_m, at_s = max(jerks)
    return (finding("floor_moved", by_mm=1e3 * largest_m, time_s=at_s),)


def _share_of_body(track: Track, target: PlanarTarget, view: ViewMotion) -> tuple[float, float, float, float] | None:
    """How much of the floor's jerks a body's corrected path has, and the deviation of that by its own jerks.

    Then the largest correction [m], and when jerks begin [s]. The share is about zero where the camera moved and one
    where the floor did. None where nothing tells.
    """
    rows = np.flatnonzero(track.seen)
    if len(rows) < 2 * _FEWEST or not view.motion.any():
        return None
    time_s = track.time_s[rows]
    corrected = track.pose[rows, :2]
    by_parameters, _ = pose_sensitivity(view.camera, view.floor, target.body, track.pose[rows])
    by_motion = by_parameters[:, :2] @ parameters_by_motion(view.camera, view.floor)
    by_camera = np.einsum("nap,np->na", by_motion, view.motion[rows])
    lag = max(1, round(_STEP_S / float(np.median(np.diff(time_s)))))
    floor, body = (x[2 * lag :] - 2 * x[lag:-lag] + x[: -2 * lag] for x in (by_camera, corrected))
    regular = time_s[2 * lag :] - time_s[: -2 * lag] < 3 * _STEP_S + 1e-9
    # Places that are displaced against each other may be those of a mat beside the floor around it.
    of_picture = replace(view, scattered_px=0.0).of_poses(target.body, track.pose)[1][rows, :2, :2]
    variance = np.trace(of_picture, axis1=1, axis2=2)
    # A codec that copies the floor for some pictures displaces it where nothing moved.
    unsure_m = np.sqrt(variance[2 * lag :] + 4 * variance[lag:-lag] + variance[: -2 * lag])
    least_m = CONSTANTS.reported_px * target.metres_per_pixel(track.pose[rows[0]])
    jerking = regular & (np.hypot(*floor.T) > np.maximum(least_m, CONSTANTS.significant * unsure_m))
    if jerking.sum() < _FEWEST:
        return None
    square = float(np.sum(floor[jerking] ** 2))
    share = float(np.sum(floor[jerking] * body[jerking])) / square
    # What a body does by itself. Where the floor jerks all the time, that shows beside its share alone.
    own = np.where(jerking[:, None], body - share * floor, body)[regular]
    # Of one direction, and of the few jerks that do not overlap.
    std = float(np.sqrt(np.sum(own**2) / len(own) * lag / square))
    return share, std, float(np.hypot(*by_camera.T).max()), float(time_s[lag:-lag][jerking][0])
