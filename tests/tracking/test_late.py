"""How uncertain poses are whose pictures are early or late."""

import numpy as np
import pytest

from towval.tracking.late import delayed


@pytest.mark.parametrize("times", [2, 3, 4, 6])
def test_pictures_that_are_shown_several_times_are_as_uncertain_as_they_are_late(times):
    """A body goes at 0.1 m/s: most poses show no velocity, those beside a leap up to half of all of it at once."""
    pose = np.outer(np.arange(120) // times * times / 60, [0.06, 0.08, 0.0])
    std = np.sqrt(np.trace(delayed(np.arange(120) / 60, pose, 0.01)[10:-10], axis1=1, axis2=2))
    assert std.min() > 0.9 * 0.001
    assert std.max() < 1.01 * 0.001 * max(1, times / 2)


def test_no_picture_that_is_shown_ten_times_is_certain():
    """The six poses on each side of one without a velocity reach a leap of one picture in ten, three would not."""
    pose = np.outer(np.arange(120) // 10 * 10 / 60, [0.1, 0.0, 0.0])
    assert (delayed(np.arange(120) / 60, pose, 0.01)[10:-10, 0, 0] > 0).all()


def test_a_body_is_as_uncertain_as_it_is_fast_in_a_slip_of_three_pictures():
    pose = np.outer(np.cumsum([0.0] * 20 + [0.01] * 3 + [0.0] * 20), [1.0, 0.0, 0.0])
    std = np.sqrt(delayed(np.arange(43) / 25, pose, 0.01)[:, 0, 0])
    assert std[21] == pytest.approx(0.25 * 0.01)
    assert std[[10, 35]] == pytest.approx(0.0, abs=1e-12)
