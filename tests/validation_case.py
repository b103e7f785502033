"""The deviations of the short run that the tests of the verdict share."""

import numpy as np

DEVIATIONS = {
    "friction": 0.005,
    "body_mass": 0.04,
    "load_mass": 0.015,
    "load_at": 0.001,
    "anchor": 0.001,
    "hinge": 0.001,
    "rest_length": 0.001,
    "stiffness": 40.0,
}
PARAMETER_STD = np.array([0.4, 0.4, 0.3, 0.3, 4e-4, 4e-4, *np.zeros(6), *[2e-4] * 3, *[4e-4] * 3])
