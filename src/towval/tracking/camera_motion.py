"""Whether the camera itself moved: the floor's texture must stay where it was."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from towval.model import Array, Body, Camera, Finding, Floor
from towval.model.findings import finding
from towval.model.geometry import transform
from towval.optics.projection import to_plane
from towval.tracking.alignment import align
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.template import Luma, make_template


@dataclass(frozen=True)
class CameraMotionConstants:
    """Tuned constants of the check on the camera's motion."""

    every_s: float = 0.5  # [s] Between checks: a move is dated to half a second.
    samples: int = 600  # Points of the floor's template.
    inset: float = 0.04  # Of the picture, left out at its border, where lens models extrapolate.
    hidden_scale: float = 1.3  # Of a body's outline: its sides and shadow hide the floor, too.
    moved_px: float = 0.3  # [px] Mean shift of the floor that is reported: 1 mm at 3.3 mm a pixel,
    deviations: float = 6.0  # or so many of its standard deviations, where these are larger.
    worst_std_px: float = 0.15  # [px] Deviation of the shift beyond which the check is inconclusive.
    least_inliers: float = 0.35  # Of the points: bodies and people may hide the rest.
    most_scale: float = 40.0  # [grey levels] Of the residuals of inliers.


CONSTANTS = CameraMotionConstants()


class CameraMotion:
    """Checks the floor's texture through a video for motion of the camera.

    ``luma`` (height, width) is the first picture, in which ``bodies`` at their ``poses`` (3,) hide the floor.
    """

    def __init__(self, camera: Camera, floor: Floor, luma: Luma, bodies: Sequence[Body], poses: Sequence[Array]):
        hidden = tuple(
            transform(p, CONSTANTS.hidden_scale * b.top_corners_m) for b, p in zip(bodies, poses, strict=True)
        )
        outline = _visible_floor(camera, floor)
        self.template = None
        if outline is not None:
            self.target = PlanarTarget(Body("floor", 0.0, outline, hidden), camera, floor)
            self.template = make_template(luma, self.target, np.zeros(3), CONSTANTS.samples)
        self.next_s = -np.inf
        self.moved: list[tuple[float, float]] = []
        self.checked = self.known = 0

    def check(self, time_s: float, luma: Luma) -> None:
        """Take in a picture; one in ``every_s`` is checked."""
        if self.template is None or time_s < self.next_s:
            return
        self.next_s = time_s + CONSTANTS.every_s
        self.checked += 1
        template = self.template
        flat = np.ones(len(template.points))
        found = align(luma, template, flat, np.zeros(3), self.target, CONSTANTS.most_scale)
        if found is None or not found.converged or found.inlier_fraction < CONSTANTS.least_inliers:
            return
        std_px = np.sqrt(np.diag(found.covariance)[:2].max()) / template.pixel_m
        if std_px > CONSTANTS.worst_std_px:
            return
        self.known += 1
        # The mean over the floor's points: a turn of the picture shifts them, too.
        shift = np.linalg.norm(transform(found.pose, template.points) - template.points, axis=1).mean()
        if shift / template.pixel_m > max(CONSTANTS.moved_px, CONSTANTS.deviations * std_px):
            self.moved.append((time_s, float(shift)))

    def findings(self) -> tuple[Finding, ...]:
        """Findings, after the last picture."""
        if self.moved:
            worst = 1000 * max(shift for _, shift in self.moved)
            return (finding("camera_moved", shift_mm=worst, time_s=self.moved[0][0]),)
        if self.known < max(1, self.checked // 2):
            return (finding("camera_not_watched"),)
        return ()


def _visible_floor(camera: Camera, floor: Floor) -> Array | None:
    """Outline (8, 2) of the floor in the picture [m], a little inside its border; None where the horizon is in it."""
    (left, top), (right, bottom) = np.outer([CONSTANTS.inset, 1 - CONSTANTS.inset], camera.resolution_px)
    u, v = (left + right) / 2, (top + bottom) / 2
    border_u, border_v = [left, u, right, right, right, u, left, left], [top, top, top, v, bottom, bottom, bottom, v]
    outline = to_plane(camera, floor, np.column_stack([border_u, border_v]), 0.0)
    return outline if np.isfinite(outline).all() else None
