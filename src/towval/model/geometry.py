"""Planar geometry: poses in SE(2), rigid fits, angles, polygons.

A pose is ``(x, y, heading)``; arrays of poses carry them in the last axis. Polygons are (n, 2) arrays of corners, not
closed, in either sense of rotation unless said otherwise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model.checks import Array, locked, matching, numbers_of
from towval.model.errors import InputError


def wrapped(angle: ArrayLike) -> Array:
    """The same angle in (−π, π] [rad]."""
    angle = numbers_of(angle, "angle")
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def rotation(heading: ArrayLike) -> Array:
    """Rotation matrices (..., 2, 2) for counter-clockwise headings (...) [rad]."""
    heading = numbers_of(heading, "heading")
    turn = np.empty((*heading.shape, 2, 2))
    turn[..., 0, 0] = turn[..., 1, 1] = np.cos(heading)
    turn[..., 1, 0] = np.sin(heading)
    turn[..., 0, 1] = -turn[..., 1, 0]
    return turn


def turned_covariance(covariance: Array, heading: ArrayLike) -> Array:
    """Covariances (..., 3, 3) of poses, turned by headings (...) [rad]: from body axes to floor axes."""
    heading = np.asarray(heading, dtype=np.float64)
    turn = np.zeros((*heading.shape, 3, 3))
    turn[..., :2, :2], turn[..., 2, 2] = rotation(heading), 1.0
    return np.asarray(turn @ covariance @ np.swapaxes(turn, -1, -2))


def transform(pose: ArrayLike, points: ArrayLike) -> Array:
    """Points (..., 2) of body frames at poses (..., 3) in the floor frame [m]: ``R(heading) p + (x, y)``."""
    pose, points = _placed(pose, points)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = points[..., 0], points[..., 1]
    first = c * x - s * y + pose[..., 0]
    placed = np.empty((*np.shape(first), 2))
    placed[..., 0], placed[..., 1] = first, s * x + c * y + pose[..., 1]
    return placed


def _placed(pose: ArrayLike, points: ArrayLike) -> tuple[Array, Array]:
    """Poses (..., 3) and points (..., 2) as arrays that go together; else :class:`InputError`."""
    both = numbers_of(pose, "pose", 3), numbers_of(points, "points", 2)
    matching((both[0], "pose"), (both[1], "points"))
    return both


def inverse_transform(pose: ArrayLike, points: ArrayLike) -> Array:
    """Points of the floor frame in a body frame: the inverse of :func:`transform`, same shapes."""
    pose, points = _placed(pose, points)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = points[..., 0] - pose[..., 0], points[..., 1] - pose[..., 1]
    return np.stack([c * x + s * y, -s * x + c * y], axis=-1)


def velocity_at(twist: ArrayLike, lever: ArrayLike) -> Array:
    """Velocities (..., 2) at levers (..., 2) from the origins of bodies with twists (..., 3), all in the same axes."""
    twist, lever = numbers_of(twist, "twist", 3), numbers_of(lever, "lever", 2)
    matching((twist, "twist"), (lever, "lever"))
    turning = np.stack([-lever[..., 1], lever[..., 0]], axis=-1)
    return np.asarray(twist[..., :2] + twist[..., 2:] * turning)


def lifted(points: Array, height: float) -> Array:
    """Points (..., 2) over the floor as points (..., 3) at a height [m]."""
    return np.concatenate([points, np.full((*points.shape[:-1], 1), height)], axis=-1)


def compose(first: ArrayLike, second: ArrayLike) -> Array:
    """Pose ``T_AC = T_AB T_BC`` of two poses (..., 3); headings add and stay unwrapped."""
    first, second = numbers_of(first, "first pose", 3), numbers_of(second, "second pose", 3)
    xy = transform(first, second[..., :2])
    return np.concatenate([xy, (first[..., 2] + second[..., 2])[..., None]], axis=-1)


def inverse(pose: ArrayLike) -> Array:
    """Pose ``T_BA`` of the pose ``T_AB`` (..., 3)."""
    pose = numbers_of(pose, "pose", 3)
    xy = inverse_transform(pose, np.zeros(2))
    return np.concatenate([xy, -pose[..., 2:]], axis=-1)


def pose_difference(pose: ArrayLike, other: ArrayLike) -> Array:
    """Poses (..., 3) less others, the difference of the headings in (−π, π]; broadcast against each other."""
    pose, other = numbers_of(pose, "pose", 3), numbers_of(other, "other pose", 3)
    matching((pose, "pose"), (other, "other pose"))
    difference = np.subtract(pose, other)
    difference[..., 2] = wrapped(difference[..., 2])
    return difference


def _polyline(points: ArrayLike) -> Array:
    line = numbers_of(points, "points")
    if line.ndim != 2:
        raise InputError("points have the wrong shape", got=line.shape, allowed="(n, k)")
    return line


def rms_length(shift: ArrayLike) -> float:
    """Root mean square length of shifts (n, 2), or of those of poses (n, 3), whose headings do not count [m]."""
    return float(np.sqrt(np.mean(np.sum(_polyline(shift)[:, :2] ** 2, axis=1))))


def position_rms(covariance: Array) -> float:
    """Root mean square of the position deviations √(σ_x² + σ_y²) of covariances (n, 3, 3) or (n, 2, 2) [m]."""
    return float(np.sqrt(np.mean(np.trace(covariance[:, :2, :2], axis1=1, axis2=2))))


def rigid_fit(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """The pose that brings ``source`` closest to ``target`` in the weighted least-squares sense.

    Closed form in the plane: with both sets centred, ``tan(heading) = Σ w (s × t) / Σ w (s · t)``. Matching points
    (n, 2) [m], two or more that do not coincide, with ``weights`` (n,) of zero or more; ``transform(pose, source) ≈
    target`` with the heading in (−π, π]. `InputError` for other shapes, and for weights of which nothing is left.
    """
    source, target = numbers_of(source, "source", 2), numbers_of(target, "target", 2)
    if source.ndim != 2 or source.shape != target.shape or len(source) < 2:
        got = f"{source.shape} and {target.shape}"
        raise InputError("source and target do not match", got=got, allowed="as many points (n, 2), two or more")
    w = np.ones(len(source)) if weights is None else numbers_of(weights, "weights")
    if w.shape != source.shape[:1] or not (w.sum() > 0 and w.min() >= 0):
        raise InputError("the weights do not match", got=w.shape, allowed=f"{len(source)} of zero or more, one above")
    source_mean, target_mean = np.average(source, axis=0, weights=w), np.average(target, axis=0, weights=w)
    s, t = source - source_mean, target - target_mean
    sine = np.sum(w * (s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]))
    cosine = np.sum(w * (s * t).sum(axis=1))
    heading = np.arctan2(sine, cosine)
    shift = target_mean - rotation(heading) @ source_mean
    return np.array([shift[0], shift[1], heading])


def _corners(polygon: ArrayLike) -> Array:
    corners = numbers_of(polygon, "polygon", 2)
    if corners.ndim != 2 or len(corners) < 3:
        raise InputError("no polygon", got=corners.shape, allowed="corners (n, 2), three or more")
    return corners


def polygon_area(polygon: ArrayLike) -> float:
    """Signed area of a simple polygon (n, 2) [m²], positive when its corners run counter-clockwise."""
    x, y = _corners(polygon).T
    x, y = x - x[0], y - y[0]
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def polygon_centroid(polygon: ArrayLike) -> Array:
    """Centroid of a simple polygon (n, 2) [m] (2,)."""
    polygon = _corners(polygon)
    origin = polygon[0]
    x, y = (polygon - origin).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    moments = np.array([np.sum((x + np.roll(x, -1)) * cross), np.sum((y + np.roll(y, -1)) * cross)])
    return np.asarray(origin + moments / (3 * np.sum(cross)))


def polygon_second_moment(polygon: ArrayLike, about: ArrayLike) -> float:
    """Polar second moment of area of a simple polygon (n, 2) about a point (2,) [m⁴], signed like its area."""
    x, y = (_corners(polygon) - locked(about, "about", (2,))).T
    xn, yn = np.roll(x, -1), np.roll(y, -1)
    return float(np.sum((x * yn - xn * y) * (x * x + x * xn + xn * xn + y * y + y * yn + yn * yn)) / 12)


def inside_polygon(polygon: ArrayLike, points: ArrayLike) -> np.ndarray:
    """Whether points (..., 2) lie inside a simple polygon (n, 2), by the even-odd rule."""
    polygon, points = _corners(polygon), numbers_of(points, "points", 2)
    inside = np.zeros(points.shape[:-1], dtype=bool)
    x, y = points[..., 0], points[..., 1]
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crosses = (y0 > y) != (y1 > y)
        inside ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


def hermite_terms(time_s: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Quadratic and cubic coefficients (n - 1, k) of the C1 cubic through values (n, k) with rates (n, k).

    ``time_s`` (n,) strictly increasing; the coefficients are those of the time since the start of each piece.
    """
    length = np.diff(time_s)[:, None]
    slope = np.diff(values, axis=0) / length
    cubic = (rates[:-1] + rates[1:] - 2 * slope) / length
    return (slope - rates[:-1]) / length - cubic, cubic / length


def arc_lengths(position: ArrayLike) -> Array:
    """Lengths (n,) of a polyline (n, k) from its first point to each, in its own unit."""
    line = _polyline(position)
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])[: len(line)]


def path_length(position: ArrayLike) -> float:
    """Length of a polyline (n, 2) [m], segments with a missing end left out."""
    return float(np.nansum(np.linalg.norm(np.diff(_polyline(position), axis=0), axis=-1)))


_BLOCKS = 24
_LAGS = (1, 2, 4, 8)


@dataclass(frozen=True)
class SignatureEntry:
    """One entry of an error signature: the mean over block ``last``, less that over ``first`` if another."""

    first: int
    last: int


def signature_entries() -> tuple[SignatureEntry, ...]:
    """The entries of :func:`error_signature` in their order: 24 means, then the changes over 1, 2, 4 and 8 blocks."""
    means = [SignatureEntry(k, k) for k in range(_BLOCKS)]
    changes = [SignatureEntry(k, k + lag) for lag in _LAGS for k in range(_BLOCKS - lag)]
    return (*means, *changes)


def signature_blocks(n: int) -> list[NDArray[np.intp]]:
    """Indices of the ``n`` times in each of the 24 blocks of a signature."""
    return np.array_split(np.arange(n), _BLOCKS)


def block_means(values: ArrayLike) -> Array:
    """Means (..., 24, m) of values (..., n, m) over the blocks of a signature, of what is there; else NaN."""
    values = numbers_of(values, "values over time")
    if values.ndim < 2 or values.shape[-2] == 0:
        raise InputError("values over time have the wrong shape", got=values.shape, allowed="(..., n, m), n above zero")
    sizes = np.array([len(rows) for rows in signature_blocks(values.shape[-2])])
    starts = np.minimum(np.cumsum(sizes) - sizes, values.shape[-2] - 1)
    there = np.isfinite(values)
    sums = np.add.reduceat(np.where(there, values, 0.0), starts, axis=-2)
    counts = np.add.reduceat(there.astype(np.intp), starts, axis=-2) * (sizes > 0)[:, None]
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def about_block_means(values: ArrayLike) -> Array:
    """Values (..., n, m) less the means of their blocks: the oscillation about them."""
    values = np.asarray(values, dtype=np.float64)
    sizes = [len(rows) for rows in signature_blocks(values.shape[-2])]
    return np.asarray(values - np.repeat(block_means(values), sizes, axis=-2))


def error_signature(error: ArrayLike) -> Array:
    """Size and changes of an error over a motion: sensitive to faults of the model, insensitive to noise and phase.

    Means over 24 blocks of time, in which oscillations (stick and slip) and frame noise average out; and the changes of
    these means over 1, 2, 4 and 8 blocks, in which errors present from the start (a length, a place) cancel, so that
    an error that begins later stands out. Of errors (..., n, 3) of x, y and heading at n times, 24 or more, NaN
    where missing: (..., m, 3), the :func:`signature_entries`; NaN where a block holds no error at all.
    """
    means = block_means(error)
    changes = [means[..., lag:, :] - means[..., :-lag, :] for lag in _LAGS]
    return np.concatenate([means, *changes], axis=-2)


def normalised_signature(signature: ArrayLike, covariance: ArrayLike) -> Array:
    """Entries (..., m, 3) of an error signature in units of their deviations, the same in every frame of the floor.

    (..., m, 2): ``√(eᵀ Σ⁻¹ e)`` of the position and ``|e| / σ`` of the heading, from covariances (m, 3, 3) of the
    entries [m², m rad, rad²]. Where a motion starts at its measured pose its deviation there is nought, and anything
    would stand out: each deviation counts as at least a fifth of the root mean square of its kind (means, and changes
    of one lag).
    """
    signature, covariance = np.asarray(signature, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
    parts, start = [], 0
    for size in (_BLOCKS, *(_BLOCKS - lag for lag in _LAGS)):
        rows = slice(start, start + size)
        parts.append(_normalised(signature[..., rows, :], covariance[rows]))
        start += size
    return np.concatenate(parts, axis=-2)


_FLOOR_SHARE = 0.2


def _normalised(error: Array, covariance: Array) -> Array:
    position, heading = covariance[:, :2, :2], covariance[:, 2, 2]
    floor = _FLOOR_SHARE**2 * np.mean(np.trace(position, axis1=1, axis2=2)) / 2
    inverse_position = np.linalg.inv(position + max(floor, 1e-18) * np.eye(2))
    square = np.einsum("...ni,nij,...nj->...n", error[..., :2], inverse_position, error[..., :2])
    turn = np.sqrt(np.maximum(heading, max(_FLOOR_SHARE**2 * float(np.mean(heading)), 1e-18)))
    return np.stack([np.sqrt(square), np.abs(error[..., 2]) / turn], axis=-1)


def turned_pixels(pixels: ArrayLike, size_px: tuple[int, int], quarter_turns: int) -> Array:
    """Where pixels (..., 2) of a picture of ``size_px`` (width, height) are once it is turned.

    It is turned counter-clockwise, as it is seen.

    Examples
    --------
    >>> turned_pixels([0, 0], (640, 480), 1)
    array([  0., 639.])
    """
    at = np.asarray(pixels, dtype=np.float64)
    for _ in range(quarter_turns % 4):
        at, size_px = np.stack([at[..., 1], size_px[0] - 1 - at[..., 0]], axis=-1), size_px[::-1]
    return at
