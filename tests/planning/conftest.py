"""A rover with the paper's steering ranges."""

import numpy as np
import pytest

from towval.planning.kinematics import symmetric_rover


@pytest.fixture
def rover():
    return symmetric_rover(0.6, 0.5, 0.08, outward=np.radians(33.7), inward=np.radians(93.0))
