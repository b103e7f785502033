from dataclasses import replace

import numpy as np
import pytest

from studies.worlds.scenes import CeilingCamera, small_camera, standard_scene
from towval.tracking.alignment import align
from towval.tracking.blur import SharpTarget, Shutter, ahead_of_middle
from towval.tracking.plane_tracker import PlaneTracker
from towval.tracking.template import make_template

TWIST = np.array([0.8, 0.1, 0.3])
EXPOSURE_S = 0.05  # 8 px of 4.7 mm


def moving(time_s):
    """Pose of a body that goes straight on and turns about its origin."""
    return np.array([-0.8 + 0.8 * time_s, 0.2 + 0.1 * time_s, 0.3 * time_s])


def own(twist, pose):
    """A twist of the floor's axes in those of a body."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([c * twist[0] + s * twist[1], c * twist[1] - s * twist[0], twist[2]])


@pytest.fixture(scope="module")
def filmed():
    """A sharp picture of the rover, its template, and pictures of it moving before an open shutter."""
    scene = standard_scene(4, **small_camera())
    scene = replace(scene, motions=(moving, scene.motions[1]))
    first = CeilingCamera(scene).picture(0.0)
    template = make_template(first, scene.target(0), moving(0.0))
    blurred = CeilingCamera(replace(scene, exposure_s=EXPOSURE_S))
    times = np.arange(1, 13) / 6
    return scene, first, template, list(zip(times, map(blurred.picture, times), strict=True))


def test_the_blurred_template_is_what_an_open_shutter_sees(filmed):
    scene, first, template, pictures = filmed
    target, (time_s, luma) = scene.target(0), pictures[0]
    pose = moving(time_s)
    seen = SharpTarget.cut(first, target, moving(0.0), template).blurred(own(TWIST, pose) * EXPOSURE_S)
    sharp = target.grey_values(first, seen.points, moving(0.0))
    values = target.grey_values(luma, seen.points, pose)
    # Noise of 3 grey levels, less by the smoothing of the readings and by their mean.
    assert np.std(values - seen.values) < 2.5
    assert np.std(values - sharp) > 7.5
    for axis in range(2):
        step = 5e-4 * np.eye(2)[axis]
        slope = (
            target.grey_values(luma, seen.points + step, pose) - target.grey_values(luma, seen.points - step, pose)
        ) / 1e-3
        assert slope @ seen.slopes[:, axis] / (seen.slopes[:, axis] @ seen.slopes[:, axis]) == pytest.approx(1, abs=0.1)


def test_points_that_see_the_surroundings_through_the_blur_are_left_out(filmed):
    scene, first, template, _ = filmed
    sharp = SharpTarget.cut(first, scene.target(0), moving(0.0), template)
    along = sharp.blurred(np.array([0.05, 0.0, 0.0]))
    inner = 0.75 / 2 - 3 * template.pixel_m
    assert np.abs(template.points[:, 0]).max() > inner - 0.01
    assert np.abs(along.points[:, 0]).max() <= inner - 0.025 + 1e-9
    assert np.abs(along.points[:, 1]).max() > 0.25 - 3 * template.pixel_m - 0.01
    # Half the rover's length: most points would see the floor.
    assert sharp.blurred(np.array([0.375, 0.0, 0.0])) is None
    assert sharp.blurred(np.array([0.3 * template.pixel_m, 0.0, 0.0])) is None


def learned(scene, first, template, pictures):
    shutter, target = Shutter(scene.target(0), first, moving(0.0), template), scene.target(0)
    for time_s, luma in pictures:
        found = align(luma, template, np.ones(len(template.points)), moving(time_s), target, 20.0)
        shutter.learn(luma, found, template, own(TWIST, moving(time_s)))
    return shutter


def test_the_exposure_is_found_in_the_pictures(filmed):
    scene, first, template, pictures = filmed
    shutter = Shutter(scene.target(0), first, moving(0.0), template)
    assert shutter.exposure_s == 0.0
    assert shutter.template(own(TWIST, moving(0.0))) is None
    shutter = learned(scene, first, template, pictures)
    assert shutter.exposure_s == pytest.approx(EXPOSURE_S, rel=0.1)
    assert shutter.template(own(TWIST, moving(0.0))) is not None


def test_sharp_pictures_have_no_exposure_though_a_mean_of_readings_holds_less_noise(filmed):
    scene, first, template, pictures = filmed
    film = CeilingCamera(scene)
    shutter = learned(scene, first, template, [(time_s, film.picture(time_s)) for time_s, _ in pictures])
    assert shutter.exposure_s < EXPOSURE_S / 10


def test_the_mean_over_an_exposure_is_ahead_by_the_acceleration():
    time_s, exposure_s, acceleration = np.arange(6) / 25, 0.03, np.array([2.0, -1.0, 0.5])

    def pose(t):
        return np.multiply.outer(np.square(t), acceleration) / 2 + np.multiply.outer(t, [0.1, 0.2, 0.3])

    moments = exposure_s * ((np.arange(2000) + 0.5) / 2000 - 0.5)
    mean = pose(time_s[:, None] + moments).mean(axis=1)
    assert mean - pose(time_s) == pytest.approx(np.tile(acceleration * exposure_s**2 / 24, (6, 1)), rel=1e-5)
    shift = ahead_of_middle(time_s, mean, exposure_s)
    assert (mean - shift)[1:-1] == pytest.approx(pose(time_s)[1:-1], abs=1e-9)
    gap = mean.copy()
    gap[3] = np.nan
    assert (ahead_of_middle(time_s, gap, exposure_s)[2:5] == 0).all()


def test_under_motion_blur_errors_are_what_the_deviation_says():
    """Monte-Carlo over prints and noise; against a sharp template errors are three times what is said, and more."""
    predicted, actual = [], []
    for seed in range(5):
        scene = standard_scene(seed, **(small_camera() | {"grain_m": 0.012}))
        scene = replace(scene, motions=(moving, scene.motions[1]))
        tracker = PlaneTracker(scene.target(0), CeilingCamera(scene).picture(0.0), moving(0.0))
        film = CeilingCamera(replace(scene, exposure_s=EXPOSURE_S))
        for i, time_s in enumerate(np.arange(1, 9) / 4.5):
            true = moving(time_s)
            found = tracker.measure(film.picture(time_s), true, own(TWIST, true))
            found.learn()
            # The first pictures teach the exposure.
            if i > 1:
                predicted.append(np.diag(found.covariance))
                actual.append(np.square(found.pose - true))
    share = np.sqrt(np.mean(predicted, axis=0) / np.mean(actual, axis=0))
    assert (share > 0.5).all()
    assert (share < 2.0).all()
    assert np.sqrt(np.max(np.array(actual)[:, :2].sum(axis=1))) < 0.5e-3
