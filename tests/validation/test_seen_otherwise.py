"""A run as it would be seen with a height or the camera off: by rays, of which the product knows nothing here."""

from dataclasses import replace

import numpy as np

from studies.worlds.campaign import OBJECT, ROVER
from towval.model import Calibration
from towval.validation.seen_otherwise import seen_otherwise


def test_a_top_that_is_higher_is_nearer_to_the_foot_of_the_camera(case):
    """By the share of its height below the camera, its rates too; the other body is where it was."""
    exact = Calibration(case.calibration.camera, case.calibration.floor, np.zeros((18, 18)), 0.05)
    bodies = replace(ROVER, height_std_m=0.01), replace(OBJECT, height_std_m=0.0)
    thin = case.rover_decimated, case.object_decimated
    (moved,) = seen_otherwise(exact, bodies, thin, case.object_track)
    foot = exact.floor.camera_position_m
    share = 0.01 / (foot[2] - ROVER.tracked_plane_height_m)
    expected = -share * (thin[0].pose[:, :2] - foot[:2])
    np.testing.assert_allclose(moved.rover.pose[:, :2] - thin[0].pose[:, :2], expected, atol=2e-5)
    np.testing.assert_allclose(moved.rover.rate[:, :2], (1 - share) * thin[0].rate[:, :2], atol=2e-5)
    np.testing.assert_array_equal(moved.towed.pose, thin[1].pose)
    np.testing.assert_array_equal(moved.object_track.pose, case.object_track.pose)


def test_every_direction_of_the_camera_counts(case, make_track):
    """One run for each unknown of the camera that is not exact; frames in which the object was not seen stay so."""
    bodies = replace(ROVER, height_std_m=0.0), replace(OBJECT, height_std_m=0.0)
    track = make_track(lambda t: np.tile([-1.2, 0.0, 0.15], (len(t), 1)), body="object", duration_s=4.0, lost=(5,))
    moved = seen_otherwise(case.calibration, bodies, (case.rover_decimated, case.object_decimated), track)
    assert len(moved) == np.count_nonzero(np.diag(case.calibration.covariance))
    assert all(np.isnan(each.object_track.pose[5]).all() for each in moved)
    shift = np.array([each.object_track.pose[0, :2] - track.pose[0, :2] for each in moved])
    assert 2e-4 < np.sqrt(np.sum(shift**2)) < 1e-2
