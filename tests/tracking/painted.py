"""A planar target painted into a small picture: a known texture without noise, quick to make."""

import cv2
import numpy as np

from studies.worlds.scenes import ceiling, rectangle
from towval.model import Body
from towval.model.geometry import inverse_transform
from towval.tracking.planar_target import PlanarTarget

CAMERA, FLOOR = ceiling((320, 240), 300.0)
POSE = np.array([0.05, -0.1, 0.3])


def target(length=1.2, width=0.9, **changes):
    """A rectangle under a camera whose pixels are 12 mm wide on it."""
    return PlanarTarget(Body("box", 0.3, rectangle(length, width), **changes), CAMERA, FLOOR)


def texture(seed=0, contrast=30.0, mean=120.0, finest_m=0.06):
    """A sum of forty waves between ``finest_m`` and four times that, of a given deviation [grey levels]."""
    rng = np.random.default_rng(seed)
    waves = 2 * np.pi / rng.uniform(finest_m, 4 * finest_m, 40)
    heading, phase = rng.uniform(0, 2 * np.pi, (2, 40))
    vectors = np.stack([waves * np.cos(heading), waves * np.sin(heading)], axis=1)

    def grey(xy):
        # One wave at a time in single precision: a tenth of the time, and 3e-4 of a grey level off.
        angles = ((xy @ vector + shift).astype(np.float32) for vector, shift in zip(vectors, phase, strict=True))
        return mean + contrast * np.sqrt(2 / 40) * sum(map(np.cos, angles))

    return grey


def picture(own, pose=POSE, grey=None, around=90.0, noise=0.0, seed=0):
    """The target at a pose on a plain floor, painted by ``grey`` of body coordinates."""
    width, height = CAMERA.resolution_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
    xy = inverse_transform(pose, own.floor_xy(pixels).reshape(-1, 2))
    low, high = own.body.top_corners_m.min(axis=0), own.body.top_corners_m.max(axis=0)
    inside = ((xy >= low) & (xy <= high)).all(axis=1)
    luma = np.full(len(xy), around)
    luma[inside] = (grey or texture())(xy[inside])
    luma += noise * np.random.default_rng(seed).standard_normal(len(luma))
    return np.clip(np.round(luma), 0, 255).astype(np.uint8).reshape(height, width)


def out_of_focus(luma, radius_px, rng):
    """A picture whose points are discs, which no Gaussian is, with a sensor's noise of 2 grey levels."""
    away_px = np.hypot(np.arange(-9, 10), np.arange(-9, 10)[:, None])
    # A disc of half a pixel's radius is the pixel itself.
    disc = np.clip(max(radius_px, 0.5) + 0.5 - away_px, 0, 1)
    soft = cv2.filter2D(luma.astype(np.float32), -1, disc / disc.sum(), borderType=cv2.BORDER_REFLECT)
    return np.clip(np.rint(soft + rng.normal(0, 2, luma.shape)), 0, 255).astype(np.uint8)
