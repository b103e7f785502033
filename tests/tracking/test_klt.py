import numpy as np
import pytest

from studies.worlds.scenes import CeilingCamera, rectangle, small_camera, standard_scene
from towval.model import Body
from towval.model.geometry import compose, wrapped
from towval.tracking.klt import KltTracker


@pytest.fixture(scope="module")
def filmed():
    scene = standard_scene(32, **small_camera())
    film = CeilingCamera(scene)
    return scene, film, film.picture(0.0)


def tracker(filmed):
    scene, _, first = filmed
    return KltTracker(scene.target(0), first, scene.motions[0](0.0))


def test_points_give_the_pose_from_a_prediction_some_pixels_off(filmed):
    scene, film, _ = filmed
    true = scene.motions[0](1.0)
    found = tracker(filmed).measure(film.picture(1.0), compose(true, np.array([0.01, -0.01, 0.01])))
    assert np.linalg.norm(found.pose[:2] - true[:2]) < 1e-3
    assert abs(wrapped(found.pose[2] - true[2])) < np.deg2rad(0.3)
    assert found.inlier_fraction > 0.6
    assert len(found.points_m) == len(found.weights) <= 60


def test_a_new_heading_gets_a_keyframe_and_an_old_one_does_not(filmed):
    scene, film, _ = filmed
    klt = tracker(filmed)
    for time_s in np.arange(0, 8, 0.25):
        klt.measure(film.picture(time_s), scene.motions[0](time_s)).learn()
    turned = abs(scene.motions[0](8.0)[2] - scene.motions[0](0.0)[2])
    assert len(klt.keyframes) <= 2 + turned / np.deg2rad(10)
    count = len(klt.keyframes)
    klt.measure(film.picture(0.5), scene.motions[0](0.5)).learn()
    assert len(klt.keyframes) == count


def test_a_picture_of_something_else_gives_none(filmed):
    scene, _, _ = filmed
    other = np.random.default_rng(0).integers(0, 255, (540, 960), dtype=np.uint8)
    assert tracker(filmed).measure(other, scene.motions[0](0.0)) is None


def test_a_body_smaller_than_a_window_is_followed():
    bodies = Body("rover", 0.42, rectangle(0.09, 0.07)), Body("object", 0.25, rectangle(0.5, 0.35))
    scene = standard_scene(32, **small_camera(), bodies=bodies)
    film, motion, target = CeilingCamera(scene), scene.motions[0], scene.target(0)
    klt = KltTracker(target, film.picture(0.0), motion(0.0))
    pixel = target.metres_per_pixel(motion(0.0))
    assert np.ptp(target.pixels(target.body.top_corners_m, motion(0.0)), axis=0).max() < 24
    pose = motion(0.0)
    for time_s in np.arange(1, 25) / 25:
        found = klt.measure(film.picture(time_s), pose)
        found.learn()
        pose = found.pose
        assert np.linalg.norm(pose[:2] - motion(time_s)[:2]) < 0.5 * pixel
