"""Pictures of a rover that drives beside an object that rests, in five steps of the time from one to the next."""

import functools
from dataclasses import replace

import numpy as np

from studies.worlds.scenes import CeilingCamera, drive, small_camera, standard_scene
from towval.tracking.track import track

STEP_S = 0.04
MOTION = drive((-0.6, 0.2, 0.1), 0.25, 0.1)  # 2 px a picture
PICTURES = 20


@functools.cache
def filmed():
    """The scene, and sharp pictures without noise, five in each step of the time."""
    scene = replace(standard_scene(6, **small_camera()), noise=0.0)
    scene = replace(scene, motions=(MOTION, drive((-1.2, -0.6, 0.0), 0.0)))
    camera = CeilingCamera(scene)
    return scene, [camera.render(i * STEP_S / 5).astype(float) for i in range(5 * PICTURES)]


def tracked(pictures):
    """Tracks of such pictures, one in each step of the time, with noise of two grey levels."""
    scene, _ = filmed()
    rng = np.random.default_rng(1)
    noisy = [np.clip(np.rint(each + rng.normal(0, 2.0, each.shape)), 0, 255).astype(np.uint8) for each in pictures]
    clicks = scene.clicks(np.random.default_rng(2))
    return track([(i * STEP_S, luma) for i, luma in enumerate(noisy)], scene.calibration, scene.bodies, clicks)
