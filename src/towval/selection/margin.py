"""The limit for the effect of a setting: a third of the measurement uncertainty."""

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Body, Calibration, Track
from towval.model.geometry import lifted, position_rms
from towval.optics.plane_uncertainty import position_covariance
from towval.optics.projection import project

SHARE = 1 / 3
"""Share of the measurement uncertainty that the error of a setting may reach."""


def measurement_std_m(calibration: Calibration, body: Body, places: ArrayLike) -> float:
    """Standard uncertainty √(σ_x² + σ_y²) of a body's measured position [m], root mean square over places (n, 2) [m].

    It contains the calibration and the height of the top, which all poses of a run share.
    """
    places = np.asarray(places, dtype=np.float64)[:, :2]
    height = body.tracked_plane_height_m
    pixels = project(calibration.camera, calibration.floor, lifted(places, height))
    return position_rms(position_covariance(calibration, pixels, height, height_std_m=body.height_std_m))


def seen_places(tracked: Track) -> Array:
    """Places (n, 2) of a track's frames in which the body was seen [m], fewer than a hundred of them."""
    places = tracked.pose[tracked.seen, :2]
    return places[:: max(1, len(places) // 50)]
