"""Total covariances against moved calibrations, and a rolling shutter against a scene drawn row by row."""

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq, least_squares

from studies.worlds.scenes import ceiling, rectangle
from towval.model import Body, Calibration, Track, TrackStatus
from towval.model.geometry import transform
from towval.optics.projection import project
from towval.tracking.total_covariance import with_readout, with_total

CAMERA, FLOOR = ceiling((640, 480), 600.0)
BODY = Body("box", 0.4, rectangle(0.8, 0.5), height_std_m=0.002)
TIME = np.arange(40) / 20


def track(pose):
    n = len(pose)
    own = np.tile(np.diag([1e-8, 4e-8, 1e-8]), (n, 1, 1))
    start = np.diag([1e-6, 4e-6, 1e-6])
    return Track("box", TIME[:n], pose, own, np.full(n, TrackStatus.TRACKED), np.ones(n), np.ones(n), start)


def path(time_s):
    return np.stack([0.15 * time_s - 0.2, 0.9 - 0.1 * time_s, 0.5 + 0.3 * time_s], axis=-1)


def test_each_source_adds_its_part():
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    total = with_total(track(path(TIME)), calibration, BODY).total_covariance
    pose = path(TIME)
    # A top that is 2 mm higher is seen farther from the foot of the camera by that share of its distance.
    eye = FLOOR.camera_position_m
    by_height = (pose[:, :2] - eye[:2]) / (eye[2] - 0.4) * 0.002
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    expected_x = 1e-8 + by_height[:, 0] ** 2 + c**2 * 1e-6 + s**2 * 4e-6
    assert np.allclose(total[:, 0, 0], expected_x, rtol=1e-3)
    assert np.allclose(total[:, 2, 2], 1e-8 + 1e-6, rtol=1e-3)
    known = np.zeros((18, 18))
    known[2, 2] = 0.5**2  # Half a pixel of the principal point shifts all by half a pixel on the plane.
    shifted = with_total(track(pose), calibration, BODY, known).total_covariance - total
    pixel_m = (eye[2] - 0.4) / 600
    across = np.argmax([shifted[:, 0, 0].mean(), shifted[:, 1, 1].mean()])
    assert np.allclose(shifted[:, across, across], (0.5 * pixel_m) ** 2, rtol=0.03), "but for tilt and lens"


def seen_by_rows(time_s, readout_s):
    """Poses that a rigid fit finds when each corner is seen at the time of its own row."""

    def row_late(t, corner):
        at = np.append(transform(path(t), corner[None])[0], 0.4)
        return (project(CAMERA, FLOOR, at[None])[0, 1] / 479 - 0.5) * readout_s

    seen = []
    for corner in BODY.top_corners_m:
        late = brentq(lambda d, c=corner: row_late(time_s + d, c) - d, -1, 1)
        seen.append(transform(path(time_s + late), corner[None])[0])
    fit = least_squares(lambda p: (transform(p, BODY.top_corners_m) - seen).ravel(), path(time_s), xtol=1e-15)
    return fit.x


def test_a_rolling_shutter_is_taken_off_row_by_row():
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    seen = np.array([seen_by_rows(t, 0.03) for t in TIME])
    assert np.abs(seen - path(TIME))[:, :2].max() > 1e-3
    found = with_readout(with_total(track(seen), calibration, BODY), calibration, BODY, 0.03, 0.002)
    error = np.abs(found.pose - path(TIME))[1:-1]
    assert error[:, :2].max() < 5e-5
    assert error[:, 2].max() < 2e-4
    unknown = with_readout(with_total(track(seen), calibration, BODY), calibration, BODY, 0.0, 0.01)
    std = np.sqrt(np.diagonal(unknown.total_covariance, axis1=1, axis2=2))
    assert (np.abs(seen - path(TIME))[:, :2] < 3.1 * std[:, :2]).all(), "three deviations of a readout of 10 ms"


def test_a_picture_that_is_repeated_tells_no_velocity():
    """It shows the pose before and counts as not seen; what is taken off the pictures beside it stays the same."""
    calibration = Calibration(CAMERA, FLOOR, np.zeros((18, 18)), 0.1)
    even, pose = track(path(TIME)), path(TIME)
    pose[20] = pose[19]
    status = np.where(np.arange(len(TIME)) == 20, TrackStatus.COASTING, TrackStatus.TRACKED)
    repeated = replace(track(pose), status=status)
    expected, found = (
        with_readout(with_total(each, calibration, BODY), calibration, BODY, 0.03, 0.002) for each in (even, repeated)
    )
    assert np.abs(expected.pose - even.pose)[20, :2].max() > 5e-4
    beside = np.arange(len(TIME)) != 20
    np.testing.assert_allclose(found.pose[beside], expected.pose[beside], atol=1e-12)
    np.testing.assert_allclose(found.total_covariance[beside], expected.total_covariance[beside], rtol=1e-9)
    # What it shows was read from the same rows, but for a step of the body.
    np.testing.assert_allclose(found.pose[20] - pose[20], expected.pose[20] - even.pose[20], atol=1e-4)
