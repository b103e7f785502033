"""The scene of the short run that the tests of simulation and verdict share, and its deviations."""

import numpy as np

from studies.worlds.campaign import ANCHOR, HINGE, OBJECT
from towval.model import FrictionSpecification, Load, Patch, Tether, TowingScene

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
SCENE = TowingScene(
    Patch(OBJECT.top_corners_m),
    4.0,
    Load(1.5, np.array([-0.15, 0.08]), np.array([0.1, 0.1, 0.0])),
    ANCHOR,
    HINGE,
    Tether(0.6, 800.0),
    FrictionSpecification(0.35, 0.35, 0.005, 0.05),
)
