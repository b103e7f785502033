"""Planar geometry: poses in SE(2), rigid fits, angles, polygons.

A pose is ``(x, y, heading)``; arrays of poses carry them in the last axis. Polygons are (n, 2) arrays of corners, not
closed, in either sense of rotation unless said otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from towval.types import Array


def wrapped(angle: ArrayLike) -> Array:
    """The same angle in (−π, π] [rad]."""
    angle = np.asarray(angle, dtype=np.float64)
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def rotation(heading: ArrayLike) -> Array:
    """Rotation matrices (..., 2, 2) for counter-clockwise headings (...) [rad]."""
    heading = np.asarray(heading, dtype=np.float64)
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def transform(pose: ArrayLike, points: ArrayLike) -> Array:
    """Points of a body frame in the floor frame.

    Parameters
    ----------
    pose : array_like (..., 3)
        Pose of the body frame [m, m, rad].
    points : array_like (..., 2)
        Points in the body frame [m], broadcast against the poses.

    Returns
    -------
    ndarray (..., 2)
        ``R(heading) p + (x, y)`` [m].
    """
    pose, points = np.asarray(pose, dtype=np.float64), np.asarray(points, dtype=np.float64)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y + pose[..., 0], s * x + c * y + pose[..., 1]], axis=-1)


def inverse_transform(pose: ArrayLike, points: ArrayLike) -> Array:
    """Points of the floor frame in a body frame: the inverse of :func:`transform`, same shapes."""
    pose, points = np.asarray(pose, dtype=np.float64), np.asarray(points, dtype=np.float64)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = points[..., 0] - pose[..., 0], points[..., 1] - pose[..., 1]
    return np.stack([c * x + s * y, -s * x + c * y], axis=-1)


def compose(first: ArrayLike, second: ArrayLike) -> Array:
    """Pose ``T_AC = T_AB T_BC`` of two poses (..., 3); headings add and stay unwrapped."""
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    xy = transform(first, second[..., :2])
    return np.concatenate([xy, (first[..., 2] + second[..., 2])[..., None]], axis=-1)


def inverse(pose: ArrayLike) -> Array:
    """Pose ``T_BA`` of the pose ``T_AB`` (..., 3)."""
    pose = np.asarray(pose, dtype=np.float64)
    xy = inverse_transform(pose, np.zeros(2))
    return np.concatenate([xy, -pose[..., 2:]], axis=-1)


def rigid_fit(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """The pose that brings ``source`` closest to ``target`` in the weighted least-squares sense.

    Closed form in the plane: with both sets centred, ``tan(heading) = Σ w (s × t) / Σ w (s · t)``.

    Parameters
    ----------
    source, target : array_like (n, 2)
        Matching points [m], two or more that do not coincide.
    weights : array_like (n,), optional
        Weight of each pair, zero or more.

    Returns
    -------
    ndarray (3,)
        Pose with ``transform(pose, source) ≈ target``, heading in (−π, π].
    """
    source, target = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    w = np.ones(len(source)) if weights is None else np.asarray(weights, dtype=np.float64)
    source_mean, target_mean = np.average(source, axis=0, weights=w), np.average(target, axis=0, weights=w)
    s, t = source - source_mean, target - target_mean
    sine = np.sum(w * (s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]))
    cosine = np.sum(w * (s * t).sum(axis=1))
    heading = np.arctan2(sine, cosine)
    shift = target_mean - rotation(heading) @ source_mean
    return np.array([shift[0], shift[1], heading])


def polygon_area(polygon: ArrayLike) -> float:
    """Signed area of a simple polygon (n, 2) [m²], positive when its corners run counter-clockwise."""
    x, y = np.asarray(polygon, dtype=np.float64).T
    x, y = x - x[0], y - y[0]
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def polygon_centroid(polygon: ArrayLike) -> Array:
    """Centroid of a simple polygon (n, 2) [m] (2,)."""
    polygon = np.asarray(polygon, dtype=np.float64)
    origin = polygon[0]
    x, y = (polygon - origin).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    return origin + np.array([np.sum((x + np.roll(x, -1)) * cross), np.sum((y + np.roll(y, -1)) * cross)]) / (
        3 * np.sum(cross)
    )


def polygon_second_moment(polygon: ArrayLike, about: ArrayLike) -> float:
    """Polar second moment of area of a simple polygon (n, 2) about a point (2,) [m⁴], signed like its area."""
    x, y = (np.asarray(polygon, dtype=np.float64) - np.asarray(about, dtype=np.float64)).T
    xn, yn = np.roll(x, -1), np.roll(y, -1)
    return float(np.sum((x * yn - xn * y) * (x * x + x * xn + xn * xn + y * y + y * yn + yn * yn)) / 12)


def inside_polygon(polygon: ArrayLike, points: ArrayLike) -> np.ndarray:
    """Whether points (..., 2) lie inside a simple polygon (n, 2), by the even-odd rule."""
    polygon, points = np.asarray(polygon, dtype=np.float64), np.asarray(points, dtype=np.float64)
    inside = np.zeros(points.shape[:-1], dtype=bool)
    x, y = points[..., 0], points[..., 1]
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crosses = (y0 > y) != (y1 > y)
        inside ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


def path_length(position: ArrayLike) -> float:
    """Length of a polyline (n, 2) [m], segments with a missing end left out."""
    return float(np.nansum(np.linalg.norm(np.diff(np.asarray(position, dtype=np.float64), axis=0), axis=-1)))
