"""Finding a body again anywhere in the picture, by the features of a keyframe.

The picture is first seen from straight above: laid onto the plane of the body's top with square cells. There the body
keeps its size, so a match is a shift and a turn, and a similarity whose scale is not one is a false match.
"""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.types import Array, Body, Camera, Floor
from towval.vision.align import usable_points
from towval.vision.camera import project, to_plane

Luma = NDArray[np.uint8]

_CELLS_OF_BODY = 160  # Cells along the longer side of the top.
_MOST_CELLS = 1600  # Along the longer side of the view from above.
_RATIO = 0.8  # SOURCE: D. Lowe, IJCV 60 (2004): nearest over second nearest neighbour.
_TOLERANCE_CELLS = 3.0
_LEAST_MATCHES = 6
_SCALE_TOLERANCE = 0.06
_FEATURES = 3000


class Finder:
    """Finds one body by the features of its top.

    Parameters
    ----------
    body : Body
        The body; its obstructions are left out.
    camera, floor : Camera, Floor
        The calibrated camera.
    luma : ndarray (height, width) uint8
        The picture that serves as keyframe.
    pose : ndarray (3,)
        The body's pose in it [m, m, rad].
    """

    def __init__(self, body: Body, camera: Camera, floor: Floor, luma: Luma, pose: Array):
        self.body, self.camera, self.floor = body, camera, floor
        size = np.ptp(body.top_corners_m, axis=0).max()
        self.cell_m = size / _CELLS_OF_BODY
        self.detector = cv2.SIFT_create(nfeatures=_FEATURES, contrastThreshold=0.02)
        low, high = body.top_corners_m.min(axis=0), body.top_corners_m.max(axis=0)
        counts = np.ceil((high - low) / self.cell_m).astype(int) + 1
        own = np.stack(np.meshgrid(*(lo + self.cell_m * np.arange(n) for lo, n in zip(low, counts, strict=True))), -1)
        self.corner_m, self.own = low, own
        self.top = _look(luma, *self._pixels(_placed(pose, own)))

    @cached_property
    def _keyframe(self) -> tuple[Array, NDArray[np.float32] | None]:
        """Features of the top: places in the body frame (m, 2) [m] and descriptors; made when first needed."""
        mask = usable_points(self.body, self.own.reshape(-1, 2), 2 * self.cell_m).reshape(self.own.shape[:2])
        points, descriptors = self.detector.detectAndCompute(self.top, mask.astype(np.uint8) * 255)
        return self.corner_m + self.cell_m * np.array([p.pt for p in points]).reshape(-1, 2), descriptors

    def _pixels(self, plane_xy: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        height = np.full((*plane_xy.shape[:-1], 1), self.body.tracked_plane_height_m)
        pixels = project(self.camera, self.floor, np.concatenate([plane_xy, height], axis=-1)).astype(np.float32)
        return np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])

    @cached_property
    def _view_from_above(self) -> tuple[Array, NDArray[np.float32], NDArray[np.float32]]:
        """Corner of the seen part of the plane, and the pixel of each of its cells; made when first needed."""
        width, height = self.camera.resolution_px
        border = [(u, v) for u in np.linspace(0, width - 1, 9) for v in np.linspace(0, height - 1, 9)]
        seen = to_plane(self.camera, self.floor, np.array(border), self.body.tracked_plane_height_m)
        seen = seen[np.isfinite(seen).all(axis=1)]
        # A camera that sees the horizon sees no end of the plane: what is too far for a body is left out.
        low = np.maximum(seen.min(axis=0), np.median(seen, axis=0) - _MOST_CELLS / 2 * self.cell_m)
        high = np.minimum(seen.max(axis=0), np.median(seen, axis=0) + _MOST_CELLS / 2 * self.cell_m)
        axes = [np.arange(lo, hi, self.cell_m) for lo, hi in zip(low, high, strict=True)]
        return low, *self._pixels(np.stack(np.meshgrid(*axes), axis=-1))

    def find(self, luma: Luma) -> Array | None:
        """Pose (3,) of the body anywhere in a picture, to a few pixels; None where too few features agree."""
        points_m, own_descriptors = self._keyframe
        if own_descriptors is None or len(points_m) < _LEAST_MATCHES:
            return None
        corner, map_u, map_v = self._view_from_above
        points, descriptors = self.detector.detectAndCompute(_look(luma, map_u, map_v), None)
        if descriptors is None or len(points) < _LEAST_MATCHES:
            return None
        pairs = cv2.BFMatcher().knnMatch(own_descriptors, descriptors, k=2)
        good = [p[0] for p in pairs if len(p) == 2 and p[0].distance < _RATIO * p[1].distance]
        if len(good) < _LEAST_MATCHES:
            return None
        source = points_m[[match.queryIdx for match in good]]
        target = corner + self.cell_m * np.array([points[match.trainIdx].pt for match in good])
        similarity, inliers = cv2.estimateAffinePartial2D(
            source, target, method=cv2.RANSAC, ransacReprojThreshold=_TOLERANCE_CELLS * self.cell_m
        )
        if similarity is None or int(inliers.sum()) < _LEAST_MATCHES:
            return None
        cosine, sine = similarity[0, 0], similarity[1, 0]
        if abs(np.hypot(cosine, sine) - 1) > _SCALE_TOLERANCE:
            return None
        return np.array([similarity[0, 2], similarity[1, 2], np.arctan2(sine, cosine)])


def _placed(pose: Array, own: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return own @ np.array([[c, s], [-s, c]]) + pose[:2]


def _look(luma: Luma, map_u: NDArray[np.float32], map_v: NDArray[np.float32]) -> Luma:
    return cv2.remap(luma, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
