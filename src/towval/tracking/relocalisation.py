"""Relocalisation by features: a lost body is found anywhere in the picture.

The picture is first rectified: resampled on the tracked plane with square cells. There the body keeps its size, so a
match is a shift and a turn, and a similarity whose scale is not one is a false match.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.geometry import transform
from towval.tracking.planar_target import PlanarTarget, usable_points

Luma = NDArray[np.uint8]


@dataclass(frozen=True)
class FeatureConstants:
    """Tuned constants of the search by features."""

    cells_of_body: int = 160  # Cells along the longer side of the target.
    least_cell_px: float = 0.7  # [px] Finer cells show nothing more.
    most_cells: int = 1600  # Along the longer side of the view from above: bounds time and memory.
    tolerance_cells: float = 3.0  # Distance of a match from the similarity that it supports.
    least_matches: int = 6  # Three times what a similarity needs.
    scale_tolerance: float = 0.06  # A body keeps its size on its plane: any other scale is a false match.
    features: int = 3000  # The strongest of a picture.


CONSTANTS = FeatureConstants()

_RATIO = 0.8  # SOURCE: D. Lowe, IJCV 60 (2004): nearest over second nearest neighbour.


class Relocaliser:
    """Finds a planar target, observed at ``pose`` (3,) in ``luma``, by its features."""

    def __init__(self, target: PlanarTarget, luma: Luma, pose: Array):
        self.target = target
        corners = target.body.top_corners_m
        # Cells much finer than pixels show nothing more.
        self.cell_m = max(
            np.ptp(corners, axis=0).max() / CONSTANTS.cells_of_body,
            CONSTANTS.least_cell_px * target.metres_per_pixel(pose),
        )
        self.detector = cv2.SIFT.create(nfeatures=CONSTANTS.features, contrastThreshold=0.02)
        self.corner_m = corners.min(axis=0)
        self.own = grid(self.corner_m, corners.max(axis=0), self.cell_m)
        self.view = resampled(luma, target.picture_of(transform(pose, self.own)))

    @cached_property
    def _keyframe(self) -> tuple[Array, NDArray[np.float32] | None]:
        """Features of the target: places in the body frame (m, 2) [m] and descriptors; made when first needed."""
        mask = usable_points(self.target.body, self.own.reshape(-1, 2), 2 * self.cell_m).reshape(self.own.shape[:2])
        points, descriptors = self.detector.detectAndCompute(self.view, mask.astype(np.uint8) * 255)
        places_m: Array = self.corner_m + self.cell_m * np.array([p.pt for p in points]).reshape(-1, 2)
        return places_m, None if descriptors is None else np.asarray(descriptors, dtype=np.float32)

    @cached_property
    def _view_from_above(self) -> tuple[Array, NDArray[np.float32]]:
        """Corner of the visible part of the plane [m], and the pixel of each of its cells; made when first needed."""
        low, high = visible_part(self.target, CONSTANTS.most_cells * self.cell_m)
        return low, self.target.picture_of(grid(low, high, self.cell_m)).astype(np.float32)

    def find(self, luma: Luma) -> Array | None:
        """Pose (3,) of the body anywhere in a picture, to a few pixels; None where too few features agree."""
        points_m, own_descriptors = self._keyframe
        if own_descriptors is None or len(points_m) < CONSTANTS.least_matches:
            return None
        corner, pixels = self._view_from_above
        points, descriptors = self.detector.detectAndCompute(resampled(luma, pixels), None)
        if descriptors is None or len(points) < CONSTANTS.least_matches:
            return None
        pairs = cv2.BFMatcher().knnMatch(own_descriptors, descriptors, k=2)
        good = [p[0] for p in pairs if len(p) == 2 and p[0].distance < _RATIO * p[1].distance]
        if len(good) < CONSTANTS.least_matches:
            return None
        source = points_m[[match.queryIdx for match in good]]
        target = corner + self.cell_m * np.array([points[match.trainIdx].pt for match in good])
        similarity, inliers = cv2.estimateAffinePartial2D(
            source, target, method=cv2.RANSAC, ransacReprojThreshold=CONSTANTS.tolerance_cells * self.cell_m
        )
        if similarity is None or int(inliers.sum()) < CONSTANTS.least_matches:
            return None
        cosine, sine = similarity[0, 0], similarity[1, 0]
        if abs(np.hypot(cosine, sine) - 1) > CONSTANTS.scale_tolerance:
            return None
        return np.array([similarity[0, 2], similarity[1, 2], np.arctan2(sine, cosine)])


def visible_part(target: PlanarTarget, most_m: float) -> tuple[Array, Array]:
    """Lower and upper corner (2,) of the part of the tracked plane that the camera sees [m].

    A camera that sees the horizon sees no end of the plane: what is farther than half of ``most_m`` [m] from the
    middle is left out.
    """
    width, height = target.camera.resolution_px
    border = np.stack(np.meshgrid(np.linspace(0, width - 1, 9), np.linspace(0, height - 1, 9)), axis=-1)
    seen = target.floor_xy(border.reshape(-1, 2))
    seen = seen[np.isfinite(seen).all(axis=1)]
    middle = np.median(seen, axis=0)
    return np.maximum(seen.min(axis=0), middle - most_m / 2), np.minimum(seen.max(axis=0), middle + most_m / 2)


def grid(low: Array, high: Array, cell_m: float) -> Array:
    """Points (rows, columns, 2) [m] from ``low`` to ``high``, ``cell_m`` apart, x along the columns."""
    axes = [lo + cell_m * np.arange(int(np.ceil((hi - lo) / cell_m)) + 1) for lo, hi in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1)


def resampled(luma: Luma, pixels: NDArray[np.floating]) -> Luma:
    """Grey values of a picture at pixels (rows, columns, 2), zero outside it."""
    u, v = np.moveaxis(np.asarray(pixels, dtype=np.float32), -1, 0)
    grey = cv2.remap(luma, np.ascontiguousarray(u), np.ascontiguousarray(v), cv2.INTER_LINEAR)
    return np.asarray(grey, dtype=np.uint8)
