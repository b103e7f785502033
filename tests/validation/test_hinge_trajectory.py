"""The trajectory of the hinge: on the arc between the nodes, at rest in pauses, jerking where the track does alone."""

import numpy as np
import pytest

from towval.model import DecimatedTrack
from towval.model.geometry import transform
from towval.physics.splines import spline_values
from towval.validation.hinge_trajectory import hinge_trajectory, nodes_between

HINGE = np.array([-0.42, 0.05])


@pytest.fixture(scope="module")
def track():
    """Round a circle at 0.5 rad/s for 4 s, two seconds' rest, and on; kept each 0.8 s."""
    times = np.array([0.0, 0.8, 1.6, 2.4, 3.2, 4.0, 6.0, 6.8, 7.6])
    angle = 0.5 * np.where(times > 4, np.maximum(times - 2, 4), times)
    rate = np.where((times == 4) | (times == 6), 0.0, 0.5)
    return DecimatedTrack(
        body="rover",
        time_s=times,
        pose=np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), angle + np.pi / 2]),
        rate=np.column_stack([-2 * np.sin(angle), 2 * np.cos(angle), np.ones(9)]) * rate[:, None],
        covariance=np.zeros((9, 3, 3)),
        noise=np.full(3, 1e-4),
        pauses=[(4.0, 6.0)],
        frames=200,
        misfit=np.ones(3),
    )


def test_the_hinge_stands_where_the_poses_put_it(track):
    times = np.linspace(0.3, 7.0, 300)
    trajectory = hinge_trajectory(track, HINGE, times)
    assert trajectory.knots[[0, -1]].tolist() == [0.3, 7.0]
    assert spline_values(trajectory, times)[0] == pytest.approx(transform(track.poses_at(times), HINGE), abs=2e-6)
    kept = track.time_s[(track.time_s > 0.3) & (track.time_s < 7.0)]
    assert set(kept) <= set(trajectory.knots)


def test_the_hinge_rests_while_the_rover_does_and_takes_no_node_for_it(track):
    trajectory = hinge_trajectory(track, HINGE, track.time_s)
    assert not np.any((trajectory.knots > 4.0) & (trajectory.knots < 6.0))
    assert not spline_values(trajectory, np.linspace(4.0, 6.0, 9))[1].any()


def test_each_piece_has_as_many_parts_as_asked_for(track):
    nodes = nodes_between(track, 0.0, 7.6, parts=2)
    assert set(track.time_s) <= set(nodes)
    assert (np.histogram(nodes, track.time_s)[0] >= 2).all()
    assert np.any(nodes == 5.0), "the middle of the pause"


def test_rates_are_slopes_of_poses_and_nothing_is_known_outside(track):
    times, h = np.linspace(0.1, 7.5, 50), 1e-6
    slopes = (track.poses_at(times + h) - track.poses_at(times - h)) / (2 * h)
    assert track.poses_and_rates_at(times)[:, 3:] == pytest.approx(slopes, abs=1e-8)
    assert np.isnan(track.poses_and_rates_at([-0.1, 7.7])).all()
    assert np.diff(track.poses_at(nodes_between(track, 0.0, 7.6))[:, 2]).max() < 0.07  # a braking rover's fastest part
