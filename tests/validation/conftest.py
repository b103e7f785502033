"""A run of four seconds that the tests of the verdict share: truth by the cell sum, measured with noise."""

import numpy as np
import pytest

from studies.worlds.campaign import OBJECT, ROVER, towed_motion
from studies.worlds.scenes import ceiling, drive
from towval.model import Calibration
from towval.validation.decimate import decimate
from towval.validation.sampler import Case
from towval.validation.simulate import simulate
from validation_case import DEVIATIONS, PARAMETER_STD, SCENE


@pytest.fixture(scope="module")
def calibration():
    camera, floor = ceiling((960, 540), focal_px=780.0)
    return Calibration(camera, floor, np.diag(PARAMETER_STD**2), 0.05)


@pytest.fixture(scope="module")
def case(calibration, make_track):
    """A run of four seconds: truth by the cell sum, measured with noise."""
    rover = drive((-0.15, 0.05, 0.1), speed=0.25, turn=0.5, rest_s=0.3)
    times = np.arange(100) / 25
    towed = towed_motion(rover, (-1.2, 0.0, 0.15), times)
    rover_track = make_track(lambda t: np.array([rover(x) for x in t]), duration_s=4.0, seed=1)
    object_track = make_track(lambda t: towed, body="object", duration_s=4.0, seed=2)
    thin, thin_object = decimate(rover_track), decimate(object_track)
    simulated = simulate(SCENE, thin, thin_object, times)
    return Case(SCENE, DEVIATIONS, calibration, ROVER, OBJECT, rover_track, thin, object_track, thin_object, simulated)
