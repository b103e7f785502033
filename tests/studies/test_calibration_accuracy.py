"""What the table of calibrations says of many sets."""

import numpy as np
import pytest

from studies.tables.calibration_table import Accuracy

ONE = np.ones((20, 2))


def test_the_bound_is_compared_with_a_root_mean_square():
    """Errors of a heavy tail have a median below a bound that their root mean square keeps."""
    errors = np.concatenate([0.5 * ONE[:15], 2.0 * ONE[:5]])
    found = Accuracy(errors, errors, ONE, ONE)
    assert found.median_mm[0] == pytest.approx(0.5)
    assert found.rms_mm == pytest.approx(np.sqrt((15 * 0.25 + 5 * 4) / 20))
    ratio, low, high = found.over_bound
    assert ratio == pytest.approx(found.rms_mm)
    assert (low < ratio).all()
    assert (ratio < high).all()


def test_the_interval_of_a_ratio_covers_it_in_about_95_percent():
    rng = np.random.default_rng(1)
    covered = []
    for _ in range(100):
        errors = np.abs(rng.normal(size=(40, 2)))
        _, low, high = Accuracy(errors, errors, errors, ONE[:1].repeat(40, axis=0)).over_bound
        covered.append((low < 1) & (high > 1))
    assert 0.85 < np.mean(covered) < 0.99
