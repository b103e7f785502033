"""Grey values of a picture between its pixels, and where points of a moving plane are seen: compiled, point by point.

A cubic B-spline without prefilter weighs 4 × 4 pixels. It smooths a little (about 0.6 px), which halves the noise, and
its slope is continuous, so that an alignment does not prefer whole pixels as it does with bilinear weights.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from towval.types import Array, Camera, Floor
from towval.vision.camera import distort

# Without "no NaN" and "no infinity": the checks for points behind the camera need both.
RELAXED = {"contract", "reassoc", "nsz", "arcp"}
"""How compiled loops may rearrange floating-point sums."""


@njit(cache=True, fastmath=RELAXED)
def spline_value(luma: NDArray[np.uint8], u: float, v: float) -> float:
    """Smoothed grey value at pixel (u, v); −1 where the 4 × 4 pixels around it are not all in the picture."""
    if not (u >= 1.0 and v >= 1.0 and u < luma.shape[1] - 2 and v < luma.shape[0] - 2):
        return -1.0
    iu, iv = int(u), int(v)
    t, s = u - iu, v - iv
    t2, s2 = t * t, s * s
    a0 = (1 - t) ** 3 / 6
    a1 = (3 * t2 * t - 6 * t2 + 4) / 6
    a3 = t2 * t / 6
    a2 = 1 - a0 - a1 - a3
    b0 = (1 - s) ** 3 / 6
    b1 = (3 * s2 * s - 6 * s2 + 4) / 6
    b3 = s2 * s / 6
    b2 = 1 - b0 - b1 - b3
    value = 0.0
    for row, b in ((iv - 1, b0), (iv, b1), (iv + 1, b2), (iv + 2, b3)):
        value += b * (a0 * luma[row, iu - 1] + a1 * luma[row, iu] + a2 * luma[row, iu + 1] + a3 * luma[row, iu + 2])
    return value


@njit(cache=True)
def plane_to_camera(pose: Array, height: float, T: Array) -> Array:
    """Columns (3, 3) that take (x, y, 1) of a body's plane at ``height`` [m] to camera coordinates [m].

    ``pose`` (3,) of the body on the floor; ``T`` (4, 4) is T_camera_floor.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    columns = np.empty((3, 3))
    for i in range(3):
        columns[i, 0] = T[i, 0] * c + T[i, 1] * s
        columns[i, 1] = T[i, 1] * c - T[i, 0] * s
        columns[i, 2] = T[i, 0] * pose[0] + T[i, 1] * pose[1] + T[i, 2] * height + T[i, 3]
    return columns


@njit(cache=True)
def plane_pixel(x: float, y: float, columns: Array, matrix: Array, k: Array) -> tuple[float, float]:
    """Pixel of a point (x, y) [m] of a body's plane; ``columns`` from :func:`plane_to_camera`."""
    z = columns[2, 0] * x + columns[2, 1] * y + columns[2, 2]
    if z <= 0:
        return np.nan, np.nan
    u, v = distort(
        (columns[0, 0] * x + columns[0, 1] * y + columns[0, 2]) / z,
        (columns[1, 0] * x + columns[1, 1] * y + columns[1, 2]) / z,
        k,
    )
    return matrix[0, 0] * u + matrix[0, 2], matrix[1, 1] * v + matrix[1, 2]


@njit(cache=True)
def sample_plane_kernel(
    luma: NDArray[np.uint8], points: Array, pose: Array, height: float, T: Array, matrix: Array, k: Array
) -> Array:
    """Grey values (n,) seen at points (n, 2) [m] of a body's plane; −1 outside the picture."""
    columns = plane_to_camera(pose, height, T)
    values = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        u, v = plane_pixel(points[i, 0], points[i, 1], columns, matrix, k)
        values[i] = spline_value(luma, u, v)
    return values


def sample_plane(
    luma: NDArray[np.uint8], points: Array, pose: Array, height: float, camera: Camera, floor: Floor
) -> Array:
    """Grey values seen at points of a body's plane.

    Parameters
    ----------
    luma : ndarray (height, width) uint8
        The picture, C-contiguous.
    points : ndarray (n, 2)
        Points in the body frame [m].
    pose : ndarray (3,)
        Pose of the body [m, m, rad].
    height : float
        Height of the plane over the floor [m].
    camera, floor : Camera, Floor
        The calibrated camera.

    Returns
    -------
    ndarray (n,)
        Grey values, NaN outside the picture.
    """
    values = sample_plane_kernel(luma, points, pose, height, floor.T_camera_floor, camera.matrix, camera.distortion)
    values[values < 0] = np.nan
    return values


def plane_pixels(points: Array, pose: Array, height: float, camera: Camera, floor: Floor) -> Array:
    """Pixels (n, 2) of points (n, 2) [m] of a body's plane at ``height`` [m]."""
    columns = plane_to_camera(np.asarray(pose, dtype=np.float64), height, floor.T_camera_floor)
    return np.array([plane_pixel(x, y, columns, camera.matrix, camera.distortion) for x, y in points]).reshape(-1, 2)


def metres_per_pixel(pose: Array, height: float, camera: Camera, floor: Floor) -> float:
    """Width of a pixel on a body's plane [m], the root of the area one pixel covers at the body's origin."""
    step = 1e-3
    corners = plane_pixels(np.array([[0.0, 0.0], [step, 0.0], [0.0, step]]), pose, height, camera, floor)
    (a, b), (c, d) = corners[1] - corners[0], corners[2] - corners[0]
    return step / float(np.sqrt(abs(a * d - b * c)))
