"""The camera model: floor points to pixels, pixels to a plane at a given height, both with OpenCV's lens.

The compiled kernels take plain arrays, so that other compiled code can call them sample by sample. Their ``k`` is a
lens as :func:`towval.model.camera.lens_array` makes it: k1 k2 p1 p2 k3 k4 k5 k6, and a ninth where it is a fisheye.
"""

import cv2
import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Camera, Floor
from towval.model.compiling import compiled

_NEWTON_STEPS = 20
_NEWTON_TOLERANCE = 1e-13


_NEAR_AXIS = 1e-4
"""Tangent below which the series of the angle is exact to rounding."""


@compiled()
def is_fisheye_kernel(k: Array) -> bool:
    """Whether a lens has the ninth coefficient, with which the others act on the angle of a ray."""
    return bool(k.shape[0] == 9)


@compiled()
def _angle_over_tangent(tangent: float) -> tuple[float, float]:
    """θ / tan θ, and its derivative by tan θ over tan θ, which is finite on the axis."""
    if tangent < _NEAR_AXIS:
        return 1 - tangent * tangent / 3, -2 / 3
    ratio = np.arctan(tangent) / tangent
    return ratio, (1 / (1 + tangent * tangent) - ratio) / (tangent * tangent)


@compiled()
def distort(x: float, y: float, k: Array) -> tuple[float, float]:
    """Distorted normalised coordinates of undistorted ones, by OpenCV's model; of a fisheye after their angle is taken.

    Examples
    --------
    >>> import numpy as np
    >>> distort(1.0, 0.0, np.zeros(8)), round(distort(1.0, 0.0, np.array([0, 0, 0, 0, 0, 0, 0, 0, 1.0]))[0], 4)
    ((1.0, 0.0), 0.7854)
    """
    if is_fisheye_kernel(k):
        ratio, _ = _angle_over_tangent(np.sqrt(x * x + y * y))
        x, y = ratio * x, ratio * y
    return _bent(x, y, k)


@compiled()
def undistort(u: float, v: float, k: Array) -> tuple[float, float]:
    """Inverse of :func:`distort` by Newton's method; NaN where it does not converge or comes upon a fold of the lens.

    Beyond what a folding lens can show it may also land on a branch past the fold. Of a fisheye NaN, too, for rays at a
    right angle to the axis and beyond, which no plane in front of the camera meets.
    """
    x, y = _straightened(u, v, k)
    if is_fisheye_kernel(k):
        angle = np.sqrt(x * x + y * y)
        if not angle < np.pi / 2:
            return np.nan, np.nan
        stretch = np.tan(angle) / angle if angle > _NEAR_AXIS else 1 + angle * angle / 3
        return stretch * x, stretch * y
    return x, y


@compiled()
def _bent(x: float, y: float, k: Array) -> tuple[float, float]:
    r2 = x * x + y * y
    radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])))
    xy2 = 2 * x * y
    return x * radial + k[2] * xy2 + k[3] * (r2 + 2 * x * x), y * radial + k[2] * (r2 + 2 * y * y) + k[3] * xy2


@compiled()
def _bent_jacobian(x: float, y: float, k: Array) -> tuple[float, float, float, float]:
    r2 = x * x + y * y
    numerator = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    denominator = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    radial = numerator / denominator
    slope = (k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]) - radial * (k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]))) / denominator
    mixed = 2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y
    return (
        radial + 2 * x * x * slope + 2 * k[2] * y + 6 * k[3] * x,
        mixed,
        mixed,
        radial + 2 * y * y * slope + 6 * k[2] * y + 2 * k[3] * x,
    )


@compiled()
def _straightened(u: float, v: float, k: Array) -> tuple[float, float]:
    x, y = u, v
    for _ in range(_NEWTON_STEPS):
        du, dv = _bent(x, y, k)
        a, b, c, d = _bent_jacobian(x, y, k)
        det = a * d - b * c
        if not det > 0.0:
            return np.nan, np.nan
        du, dv = u - du, v - dv
        x, y = x + (d * du - b * dv) / det, y + (a * dv - c * du) / det
        if abs(du) + abs(dv) < _NEWTON_TOLERANCE:
            return x, y
    return np.nan, np.nan


@compiled()
def project_kernel(points: Array, T: Array, matrix: Array, k: Array) -> Array:
    """Pixels (n, 2) of points (n, 3) [m] for ``T`` = T_camera_floor; NaN behind the camera."""
    out = np.empty((points.shape[0], 2))
    for i in range(points.shape[0]):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        z = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz + T[2, 3]
        if z <= 0:
            out[i, 0] = out[i, 1] = np.nan
            continue
        x = (T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz + T[0, 3]) / z
        y = (T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz + T[1, 3]) / z
        u, v = distort(x, y, k)
        out[i, 0] = matrix[0, 0] * u + matrix[0, 2]
        out[i, 1] = matrix[1, 1] * v + matrix[1, 2]
    return out


@compiled()
def undistorted_kernel(pixels: Array, matrix: Array, k: Array) -> Array:
    """Undistorted normalised coordinates (n, 2) of pixels (n, 2); NaN where the lens has no inverse."""
    out = np.empty((pixels.shape[0], 2))
    for i in range(pixels.shape[0]):
        u, v = (pixels[i, 0] - matrix[0, 2]) / matrix[0, 0], (pixels[i, 1] - matrix[1, 2]) / matrix[1, 1]
        out[i, 0], out[i, 1] = undistort(u, v, k)
    return out


@compiled()
def to_plane_kernel(pixels: Array, height: float, T: Array, matrix: Array, k: Array) -> Array:
    """Floor coordinates (n, 2) [m] of pixels (n, 2) on the plane z = height; NaN where the ray misses it."""
    out = np.empty((pixels.shape[0], 2))
    # Columns of the rotation dotted with the ray and the shift: the ray in the floor frame, no inverse needed.
    for i in range(pixels.shape[0]):
        x, y = undistort((pixels[i, 0] - matrix[0, 2]) / matrix[0, 0], (pixels[i, 1] - matrix[1, 2]) / matrix[1, 1], k)
        ray_z = T[0, 2] * x + T[1, 2] * y + T[2, 2]
        camera_z = -(T[0, 2] * T[0, 3] + T[1, 2] * T[1, 3] + T[2, 2] * T[2, 3])
        depth = (height - camera_z) / ray_z
        if not depth > 0:
            out[i, 0] = out[i, 1] = np.nan
            continue
        dx, dy, dz = x * depth - T[0, 3], y * depth - T[1, 3], depth - T[2, 3]
        out[i, 0] = T[0, 0] * dx + T[1, 0] * dy + T[2, 0] * dz
        out[i, 1] = T[0, 1] * dx + T[1, 1] * dy + T[2, 1] * dz
    return out


def project(camera: Camera, floor: Floor, points: ArrayLike) -> Array:
    """Pixels (..., 2) of points (..., 3) in the floor frame [m]; NaN for points behind the camera."""
    points = np.asarray(points, dtype=np.float64)
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    pixels: Array = project_kernel(flat, floor.T_camera_floor, camera.matrix, camera.lens)
    return pixels.reshape(*points.shape[:-1], 2)


def to_plane(camera: Camera, floor: Floor, pixels: ArrayLike, height: float) -> Array:
    """Points (..., 2) in which the rays of pixels (..., 2) meet the plane at ``height`` over the floor [m].

    The inverse of :func:`project` there; NaN where a ray misses the plane or the lens model has no inverse.
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    flat = np.ascontiguousarray(pixels.reshape(-1, 2))
    xy: Array = to_plane_kernel(flat, height, floor.T_camera_floor, camera.matrix, camera.lens)
    return xy.reshape(pixels.shape)


def project_with_derivatives(
    points: Array, rotation_vector: Array, shift_m: Array, matrix: Array, lens: Array
) -> tuple[Array, Array]:
    """Pixels (n, 2) of points (n, 3) [m] and their derivatives (n, 2, 18), in OpenCV's order.

    That is by ``rotation_vector`` (3,) and ``shift_m`` (3,) into the camera's frame, by fx, fy, cx, cy and by the eight
    coefficients of the ``lens``; those by the shift are those by points in the camera's frame.
    """
    if not is_fisheye_kernel(lens):
        return _by_opencv(points, rotation_vector, shift_m, matrix, lens)
    rotation, by_vector = cv2.Rodrigues(rotation_vector)
    seen = points @ rotation.T + shift_m
    at_angle, by_point = _at_angle(seen)
    pixels, derivatives = _by_opencv(at_angle, np.zeros(3), np.zeros(3), matrix, lens[:-1])
    by_seen = derivatives[..., 3:5] @ by_point
    turned = np.einsum("kij,nj->nik", np.reshape(by_vector, (3, 3, 3)), points)
    derivatives[..., :6] = np.concatenate([by_seen @ turned, by_seen], axis=2)
    return pixels, derivatives


def _by_opencv(
    points: Array, rotation_vector: Array, shift_m: Array, matrix: Array, lens: Array
) -> tuple[Array, Array]:
    found = cv2.projectPoints(points, rotation_vector, shift_m, matrix, lens)
    pixels, derivatives = (np.asarray(each, dtype=np.float64) for each in found)
    return pixels.reshape(-1, 2), derivatives.reshape(len(points), 2, -1)


def _at_angle(seen: Array) -> tuple[Array, Array]:
    """Points (n, 3) in the camera's frame moved to where a pinhole would see a fisheye's picture of them.

    They are on the plane z = 1; with the derivatives (n, 2, 3) of their x and y by the points.
    """
    xy, z = seen[:, :2] / seen[:, 2:], seen[:, 2, None, None]
    ratio, slope = np.array([_angle_over_tangent(each) for each in np.hypot(*xy.T)]).reshape(-1, 2).T
    by_xy = ratio[:, None, None] * np.eye(2) + slope[:, None, None] * xy[:, :, None] * xy[:, None, :]
    xy_by_point = np.concatenate([np.tile(np.eye(2), (len(seen), 1, 1)), -xy[:, :, None]], axis=2) / z
    return np.column_stack([ratio[:, None] * xy, np.ones(len(seen))]), by_xy @ xy_by_point
