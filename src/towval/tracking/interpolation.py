"""Grey values of a picture between its pixels, and the pixels of points of a moving plane: compiled, point by point.

A cubic B-spline without prefilter weighs 4 × 4 pixels. It smooths a little (about 0.6 px), which halves the noise, and
its slope is continuous, so that an alignment does not prefer whole pixels as it does with bilinear weights.
"""

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.optics.projection import distort, is_fisheye_kernel

# Without "no NaN" and "no infinity": the checks for points behind the camera need both.
RELAXED = {"contract", "reassoc", "nsz", "arcp"}
"""How compiled loops may rearrange floating-point sums."""

_FAR_OFF_PX = -1e9


@compiled(fastmath=RELAXED, inline="always")
def _spline_weights(t: float) -> tuple[float, float, float, float]:
    """Weights of the uniform cubic B-spline for the four pixels around a place ``t`` past the second."""
    r = 1.0 - t
    first, last = r * r * r * (1.0 / 6.0), t * t * t * (1.0 / 6.0)
    second = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t)
    return first, second, 1.0 - first - second - last, last


@compiled(fastmath=RELAXED)
def spline_value(luma: NDArray[np.uint8], u: float, v: float) -> float:
    """Smoothed grey value at pixel (u, v); −1 where the 4 × 4 pixels around it are not all in the picture."""
    if not (u >= 1.0 and v >= 1.0 and u < luma.shape[1] - 2 and v < luma.shape[0] - 2):
        return -1.0
    iu, iv = int(u), int(v)
    a0, a1, a2, a3 = _spline_weights(u - iu)
    b0, b1, b2, b3 = _spline_weights(v - iv)
    # Unsigned, for a negative index would count from the end, and each reading would look which it is.
    w, x, y, z = np.uintp(iu - 1), np.uintp(iu), np.uintp(iu + 1), np.uintp(iu + 2)
    above, upper = luma[np.uintp(iv - 1)], luma[np.uintp(iv)]
    lower, below = luma[np.uintp(iv + 1)], luma[np.uintp(iv + 2)]
    value: float = (
        b0 * (a0 * above[w] + a1 * above[x] + a2 * above[y] + a3 * above[z])
        + b1 * (a0 * upper[w] + a1 * upper[x] + a2 * upper[y] + a3 * upper[z])
        + b2 * (a0 * lower[w] + a1 * lower[x] + a2 * lower[y] + a3 * lower[z])
        + b3 * (a0 * below[w] + a1 * below[x] + a2 * below[y] + a3 * below[z])
    )
    return value


@compiled()
def plane_to_camera(pose: Array, height: float, T: Array) -> Array:
    """Matrix (3, 3) from (x, y, 1) of the body frame at ``height`` [m], at ``pose`` (3,), to camera coordinates [m]."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    columns = np.empty((3, 3))
    for i in range(3):
        columns[i, 0] = T[i, 0] * c + T[i, 1] * s
        columns[i, 1] = T[i, 1] * c - T[i, 0] * s
        columns[i, 2] = T[i, 0] * pose[0] + T[i, 1] * pose[1] + T[i, 2] * height + T[i, 3]
    return columns


@compiled(fastmath=RELAXED)
def plane_pixels_kernel(points: Array, columns: Array, matrix: Array, k: Array) -> Array:
    """Pixels (n, 2) of points (n, 2) [m] of a body's plane; ``columns`` from :func:`plane_to_camera`.

    The camera model of :mod:`towval.optics.projection`, without branches and with its numbers in local variables so
    that the loop is vectorised: six times as fast. A point behind the camera comes out far off the picture.
    """
    if is_fisheye_kernel(k):
        return _fisheye_pixels(points, columns, matrix, k)
    a0, a1, a2 = columns[0, 0], columns[0, 1], columns[0, 2]
    b0, b1, b2 = columns[1, 0], columns[1, 1], columns[1, 2]
    c0, c1, c2 = columns[2, 0], columns[2, 1], columns[2, 2]
    k1, k2, p1, p2, k3, k4, k5, k6 = k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7]
    fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    pixels = np.empty((points.shape[0], 2))
    for i in range(points.shape[0]):
        px, py = points[i, 0], points[i, 1]
        scale = 1.0 / max(c0 * px + c1 * py + c2, 1e-9)
        x, y = (a0 * px + a1 * py + a2) * scale, (b0 * px + b1 * py + b2) * scale
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        xy2 = 2 * x * y
        pixels[i, 0] = fx * (x * radial + p1 * xy2 + p2 * (r2 + 2 * x * x)) + cx
        pixels[i, 1] = fy * (y * radial + p1 * (r2 + 2 * y * y) + p2 * xy2) + cy
    return pixels


@compiled()
def _fisheye_pixels(points: Array, columns: Array, matrix: Array, k: Array) -> Array:
    pixels = np.full((points.shape[0], 2), _FAR_OFF_PX)
    for i in range(points.shape[0]):
        seen = columns[:, 0] * points[i, 0] + columns[:, 1] * points[i, 1] + columns[:, 2]
        if seen[2] > 0:
            u, v = distort(seen[0] / seen[2], seen[1] / seen[2], k)
            pixels[i, 0], pixels[i, 1] = matrix[0, 0] * u + matrix[0, 2], matrix[1, 1] * v + matrix[1, 2]
    return pixels


@compiled(fastmath=RELAXED)
def sample_plane_kernel(
    luma: NDArray[np.uint8], points: Array, pose: Array, height: float, T: Array, matrix: Array, k: Array
) -> Array:
    """Grey values (n,) at points (n, 2) [m] of a body's plane; −1 outside the picture."""
    pixels = plane_pixels_kernel(points, plane_to_camera(pose, height, T), matrix, k)
    values = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        values[i] = spline_value(luma, pixels[i, 0], pixels[i, 1])
    return values
