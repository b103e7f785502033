"""A tracker from outside the package: template matching at whole pixels, the heading carried on."""

import cv2
import numpy as np

from towval.tracking.pose import Measurement, Tracker
from towval.tracking.track import TRACKERS

HALF_PX = 12


class PatchTracker(Tracker):
    """Finds the patch of pixels around the body's origin again."""

    def __init__(self, target, luma, pose):
        self.target = target
        u, v = np.round(target.pixels(np.zeros((1, 2)), pose)[0]).astype(int)
        self.patch = luma[v - HALF_PX : v + HALF_PX + 1, u - HALF_PX : u + HALF_PX + 1].copy()

    def measure(self, luma, predicted, velocity=None):
        """Pose of the best match; the heading is the predicted one."""
        score = cv2.matchTemplate(luma, self.patch, cv2.TM_CCOEFF_NORMED)
        v, u = np.unravel_index(np.argmax(score), score.shape)
        x, y = self.target.floor_xy([[u + HALF_PX, v + HALF_PX]])[0]
        std_m = self.target.metres_per_pixel(predicted)
        return Measurement(np.array([x, y, predicted[2]]), np.diag([std_m**2, std_m**2, 0.1**2]))


TRACKERS.register("patch", lambda settings: PatchTracker)
