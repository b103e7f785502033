"""The planar target of a body under a calibrated camera: geometry that all trackers share."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Body, Camera, Floor
from towval.model.compiling import compiled
from towval.model.geometry import inside_polygon, lifted, transform
from towval.optics.projection import project, to_plane
from towval.tracking.interpolation import plane_pixels_kernel, plane_to_camera, sample_plane_kernel
from towval.tracking.pose import step_between

_POINTS_ACROSS = 12


@dataclass(eq=False)
class PlanarTarget:
    """The tracked plane of a ``body`` under a calibrated ``camera`` over a ``floor``.

    Camera and floor are those of the current picture: when the camera moves they are updated for all holders.
    ``blur_px`` says how wide the blur of that picture is by the floor [px], infinite where that is not known.
    """

    body: Body
    camera: Camera
    floor: Floor
    blur_px: Callable[[], float] = field(default=lambda: math.inf)

    @property
    def height(self) -> float:
        """Height of the plane over the floor [m]."""
        return self.body.tracked_plane_height_m

    @cached_property
    def reach_m(self) -> float:
        """As of the body, which is asked for in every picture [m]."""
        return self.body.reach_m

    def pixels(self, points: Array, pose: Array) -> Array:
        """Pixels (n, 2) of points (n, 2) [m] of the body frame at a ``pose`` (3,)."""
        columns = plane_to_camera(np.asarray(pose, dtype=np.float64), self.height, self.floor.T_camera_floor)
        return plane_pixels_kernel(np.ascontiguousarray(points), columns, self.camera.matrix, self.camera.lens)

    def grey_values(self, luma: NDArray[np.uint8], points: Array, pose: Array) -> Array:
        """Grey values (n,) of a picture at points (n, 2) [m] of the body frame at a ``pose`` (3,); NaN outside it."""
        T, camera = self.floor.T_camera_floor, self.camera
        values = sample_plane_kernel(luma, points, pose, self.height, T, camera.matrix, camera.lens)
        values[values < 0] = np.nan
        return values

    def picture_of(self, floor_xy: Array) -> Array:
        """Pixels (..., 2) of points at the plane's height over the floor (..., 2) [m]."""
        return project(self.camera, self.floor, lifted(floor_xy, self.height))

    def floor_xy(self, pixels: ArrayLike) -> Array:
        """Where the rays of pixels (..., 2) meet the tracked plane (..., 2) [m]; NaN where they miss it."""
        return to_plane(self.camera, self.floor, pixels, self.height)

    def metres_per_pixel(self, pose: Array) -> float:
        """Width of a pixel on the target at a ``pose`` [m]: the root of its area there, at the body's origin."""
        step = 1e-3
        corners = self.pixels(np.array([[0.0, 0.0], [step, 0.0], [0.0, step]]), pose)
        (a, b), (c, d) = corners[1] - corners[0], corners[2] - corners[0]
        return step / float(np.sqrt(abs(a * d - b * c)))

    def apart_m(self, pose: Array, other: Array) -> float:
        """Bound of the distance of any corner of the body from its place at another pose [m]."""
        step = step_between(pose, other)
        return math.hypot(step[0], step[1]) + self.reach_m * abs(float(step[2]))

    @cached_property
    def inner_points(self) -> Array:
        """Points spread evenly over the target (n, 2) [m]."""
        corners = self.body.top_corners_m
        low, size = corners.min(axis=0), np.ptp(corners, axis=0)
        steps = (np.arange(_POINTS_ACROSS) + 0.5) / _POINTS_ACROSS
        grid: Array = low + size * np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        inner: Array = grid[inside_polygon(corners, grid)]
        return inner

    def covered_by(self, pose: Array, outline: Array) -> float:
        """Share of the target at a ``pose`` that lies over an ``outline`` (n, 2) on the floor [m]."""
        low, high = outline.min(axis=0) - self.reach_m, outline.max(axis=0) + self.reach_m
        if (pose[:2] < low).any() or (pose[:2] > high).any():
            return 0.0
        return float((_depth(transform(pose, self.inner_points), outline) > 0).mean())


@compiled()
def _depth(points: Array, polygon: Array) -> Array:
    """Distance (n,) of points from a polygon's outline [m], positive inside."""
    depth = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        nearest, inside = np.inf, False
        for j in range(polygon.shape[0]):
            ax, ay = polygon[j - 1, 0], polygon[j - 1, 1]
            ex, ey = polygon[j, 0] - ax, polygon[j, 1] - ay
            along = min(max(((x - ax) * ex + (y - ay) * ey) / max(ex * ex + ey * ey, 1e-300), 0.0), 1.0)
            nearest = min(nearest, np.hypot(x - ax - along * ex, y - ay - along * ey))
            if (ay > y) != (polygon[j, 1] > y) and x < ax + ex * (y - ay) / ey:
                inside = not inside
        depth[i] = nearest if inside else -nearest
    return depth


def usable_points(body: Body, points: Array, margin_m: float) -> NDArray[np.bool_]:
    """Which of points (n, 2) [m] lie on the target, ``margin_m`` away from its outline and from what stands on it."""
    points = np.ascontiguousarray(points)
    usable: NDArray[np.bool_] = _depth(points, body.top_corners_m) >= margin_m
    for obstruction in body.obstructions:
        usable &= _depth(points, obstruction) <= -margin_m
    return usable
