import numpy as np
import pytest

from report_scenes import LOST, TOWED, towed_run, uncertainty_of
from towval.model.errors import InputError
from towval.model.geometry import transform
from towval.model.run_record import measured_poses, nearest_samples, pose_at


def test_nearest_samples_are_those_of_the_definition():
    rng = np.random.default_rng(0)
    time_s = np.sort(rng.uniform(0, 10, 50))
    wanted = rng.uniform(-1, 11, 200)
    definition = np.abs(time_s[:, None] - wanted).argmin(axis=0)
    np.testing.assert_array_equal(nearest_samples(time_s, wanted), definition)


def test_a_single_sample_is_nearest_to_everything():
    np.testing.assert_array_equal(nearest_samples(np.array([2.0]), np.array([0.0, 2.0, 9.0])), [0, 0, 0])


def test_pose_beyond_the_samples_is_missing():
    time_s = np.array([0.0, 0.04, 0.08])
    pose = np.arange(9.0).reshape(3, 3)
    np.testing.assert_array_equal(pose_at(time_s, pose, 0.05), pose[1])
    assert np.isnan(pose_at(time_s, pose, 0.2)).all()


def test_seen_poses_leave_out_lost_frames():
    track = towed_run().object_track
    assert np.isnan(measured_poses(track)[LOST]).all()
    np.testing.assert_array_equal(measured_poses(track)[: LOST.start], track.pose[: LOST.start])


def test_outline_is_closed_and_turned():
    outline = transform(np.array([1.0, 2.0, np.pi / 2]), TOWED.outline_m)
    np.testing.assert_array_equal(outline[0], outline[-1])
    # The corner (-0.25, -0.175) a quarter turn on: (0.175, -0.25).
    np.testing.assert_allclose(outline[0], [1.175, 1.75], atol=1e-12)


def test_an_uncertainty_of_other_times_is_refused():
    with pytest.raises(InputError, match="same times"):
        towed_run(n=100, uncertainty=uncertainty_of(towed_run(n=80)))
