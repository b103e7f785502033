"""A textured floor painted from where a camera sees it: quick to make, with any view, noise and light."""

import cv2
import numpy as np

from studies.worlds.scenes import ceiling, rectangle
from tests.tracking.painted import texture
from towval.model import Body
from towval.optics.projection import project, to_plane
from towval.tracking.floor_registration import Registered

CAMERA, FLOOR = ceiling((480, 360), 450.0)
BODY = Body("box", 0.4, rectangle(0.8, 0.6))
POSE = np.array([0.3, -0.2, 0.4])
GREY = texture(3, finest_m=0.1)


def floor_picture(camera=CAMERA, floor=FLOOR, noise=2.0, seed=0, hidden=0.0, grey=GREY):
    """The textured floor as a camera sees it; ``hidden``: share of the picture behind something plain."""
    width, height = camera.resolution_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
    luma = grey(to_plane(camera, floor, pixels, 0.0).reshape(-1, 2)).reshape(height, width)
    luma[:, : int(hidden * width)] = 60
    luma = luma + noise * np.random.default_rng(seed).standard_normal(luma.shape)
    return np.clip(np.round(luma), 0, 255).astype(np.uint8)


FIRST = floor_picture()


def warped(luma, shift=(0.0, 0.0), turn_deg=0.0, zoom=1.0):
    height, width = luma.shape
    matrix = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), turn_deg, zoom)
    matrix[:, 2] += shift
    return cv2.warpAffine(luma, matrix, (width, height), flags=cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT)


def seen_through(view, at=((-1.0, 0.8), (0.9, -0.9), (0.0, 0.0))):
    return project(*view, np.column_stack([at, np.zeros(len(at))]))


def noisy_floor(shifts, contrast=0.12, noise=4.0, seed=5):
    """Pictures of a floor that shows less than the noise, shifted by pixels (n, 2)."""
    plain = 128 + contrast * (floor_picture(noise=0.0).astype(float) - 128)
    rng = np.random.default_rng(seed)
    pictures = [warped(plain, shift) + noise * rng.standard_normal(plain.shape) for shift in shifts]
    return [np.clip(np.round(luma), 0, 255).astype(np.uint8) for luma in pictures]


def moved_by(shift_px, std_px=1e-3):
    """A registration of a picture that is shifted sideways, known to so much."""
    return Registered(np.array([0, 0, 0, 0, 0, 0, 0, shift_px, 0.0]), 1e-9 * np.eye(9), std_px)
