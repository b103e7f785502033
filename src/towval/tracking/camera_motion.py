"""Whether the camera itself moved: the floor's texture must stay where it was."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body, Camera, Finding, Floor
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.optics.projection import to_plane
from towval.tracking.alignment import align, make_template
from towval.tracking.planar_target import PlanarTarget

Luma = NDArray[np.uint8]

_EVERY_S = 0.5
_SAMPLES = 600
_INSET = 0.04  # Of the picture, left out at its border.
_MOVED_PX = 0.3
_DEVIATIONS = 6.0
_WORST_STD_PX = 0.15
_LEAST_INLIERS = 0.35
_MOST_SCALE = 40.0


class CameraMotion:
    """Watches the floor through a video and says afterwards whether it seemed to move.

    Parameters
    ----------
    camera, floor : Camera, Floor
        The calibrated camera.
    luma : ndarray (height, width) uint8
        The first picture.
    bodies, poses : sequences of Body and ndarray (3,)
        What hides the floor in it.
    """

    def __init__(self, camera: Camera, floor: Floor, luma: Luma, bodies: Sequence[Body], poses: Sequence[Array]):
        hidden = tuple(transform(p, 1.3 * b.top_corners_m) for b, p in zip(bodies, poses, strict=True))
        outline = _visible_floor(camera, floor)
        self.template = None
        if outline is not None:
            self.target = PlanarTarget(Body("floor", 0.0, outline, hidden), camera, floor)
            self.template = make_template(luma, self.target, np.zeros(3), _SAMPLES)
        self.next_s = -np.inf
        self.moved: list[tuple[float, float]] = []
        self.looks = self.known = 0

    def look(self, time_s: float, luma: Luma) -> None:
        """Take in a picture; only some are looked at."""
        if self.template is None or time_s < self.next_s:
            return
        self.next_s = time_s + _EVERY_S
        self.looks += 1
        template = self.template
        flat = np.ones(len(template.points))
        found = align(luma, template, flat, np.zeros(3), self.target, _MOST_SCALE)
        if found is None or not found.converged or found.inlier_fraction < _LEAST_INLIERS:
            return
        std_px = np.sqrt(np.diag(found.covariance)[:2].max()) / template.pixel_m
        if std_px > _WORST_STD_PX:
            return
        self.known += 1
        # The mean over the floor's points: a turn of the picture shifts them, too.
        shift = np.linalg.norm(transform(found.pose, template.points) - template.points, axis=1).mean()
        if shift / template.pixel_m > max(_MOVED_PX, _DEVIATIONS * std_px):
            self.moved.append((time_s, float(shift)))

    def findings(self) -> tuple[Finding, ...]:
        """What the watch has to say."""
        if self.moved:
            worst = 1000 * max(shift for _, shift in self.moved)
            return (finding("camera_moved", shift_mm=worst, time_s=self.moved[0][0]),)
        if self.known < max(1, self.looks // 2):
            return (finding("camera_not_watched"),)
        return ()


def _visible_floor(camera: Camera, floor: Floor) -> Array | None:
    """Outline (8, 2) of the floor in the picture [m], a little inside its border; None where the horizon is in it."""
    width, height = camera.resolution_px
    left, right, target, bottom = _INSET * width, (1 - _INSET) * width, _INSET * height, (1 - _INSET) * height
    u, v = (left + right) / 2, (target + bottom) / 2
    border = [
        (left, target),
        (u, target),
        (right, target),
        (right, v),
        (right, bottom),
        (u, bottom),
        (left, bottom),
        (left, v),
    ]
    outline = to_plane(camera, floor, np.array(border), 0.0)
    return outline if np.isfinite(outline).all() else None
