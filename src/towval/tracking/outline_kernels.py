"""The compiled parts of the edge fit: stretches of an outline, their profiles in a picture, and the robust fit."""

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.compiling import compiled
from towval.tracking.equations import inverse_of, product_of, root_of, solved
from towval.tracking.interpolation import RELAXED, plane_pixels_kernel, spline_value
from towval.tracking.pose import STD_OF_MEDIAN, TUKEY

_LEAST_SCALE_PX = 0.05  # [px] Of misfits.
_FITS = 8  # Rounds of the robust fit, in which the search narrows from 2 px to 0.5 px.


@compiled()
def stretches_kernel(corners: Array, pixel_m: float, sharp: float, most: int) -> tuple[Array, Array, Array, Array]:
    """Middle, direction and outward normal (m, 2), and length (m,) of the stretches of an outline.

    ``corners`` run in either sense. An edge has at most ``most`` stretches of at least three pixels each. At corners
    that turn by more than ``sharp`` [rad], two pixels of both edges are left out: there a profile sees two edges. A
    round outline has no such corners.
    """
    n = corners.shape[0]
    area = 0.0
    for i in range(n):
        area += corners[i - 1, 0] * corners[i, 1] - corners[i - 1, 1] * corners[i, 0]
    # Counter-clockwise, so that normals point outward.
    ahead = np.empty((n, 2))
    for i in range(n):
        own = i if area >= 0 else n - 1 - i
        ahead[i, 0], ahead[i, 1] = corners[own, 0], corners[own, 1]
    tangent, size, cut = np.empty((n, 2)), np.empty(n), np.zeros(n)
    for i in range(n):
        after = (i + 1) % n
        x, y = ahead[after, 0] - ahead[i, 0], ahead[after, 1] - ahead[i, 1]
        size[i] = np.sqrt(x * x + y * y)
        tangent[i, 0], tangent[i, 1] = x / size[i], y / size[i]
    for i in range(n):
        across = tangent[i, 0] * tangent[i - 1, 0] + tangent[i, 1] * tangent[i - 1, 1]
        if np.arccos(min(max(across, -1.0), 1.0)) > sharp:
            cut[i] = 2 * pixel_m
    whole, count, m = np.empty(n), np.empty(n, np.int64), 0
    for i in range(n):
        whole[i] = size[i] - cut[(i + 1) % n] - cut[i]
        count[i] = min(most, max(int(whole[i] // (3 * pixel_m)), int(whole[i] > pixel_m)))
        m += count[i]
    middle, along, normal, length = np.empty((m, 2)), np.empty((m, 2)), np.empty((m, 2)), np.empty(m)
    k = 0
    for i in range(n):
        for number in range(count[i]):
            place = cut[i] + whole[i] * (number + 0.5) / count[i]
            for j in range(2):
                middle[k, j], along[k, j] = ahead[i, j] + tangent[i, j] * place, tangent[i, j]
            normal[k, 0], normal[k, 1] = tangent[i, 1], -tangent[i, 0]
            length[k] = whole[i] / count[i]
            k += 1
    return middle, along, normal, length


@compiled(fastmath=RELAXED)
def slopes_kernel(
    luma: NDArray[np.uint8],
    lines: tuple[Array, Array, Array, Array, float],
    offsets: Array,
    columns: Array,
    matrix: Array,
    k: Array,
) -> Array:
    """Steepness (m, n − 2) of the mean grey value of each stretch, between the neighbours of each of n offsets.

    ``lines``: middle, direction, normal and length of the stretches, and the distance between the profiles of one
    [m]. Zero where a profile leaves the picture.
    """
    middle, along, normal, length, spacing = lines
    profile = np.empty(offsets.shape[0])
    slopes = np.zeros((middle.shape[0], offsets.shape[0] - 2))
    for m in range(middle.shape[0]):
        count = max(1, int(length[m] / spacing))
        points = np.empty((offsets.shape[0] * count, 2))
        for j in range(offsets.shape[0]):
            for i in range(count):
                place = length[m] * ((i + 0.5) / count - 0.5)
                points[j * count + i, 0] = middle[m, 0] + place * along[m, 0] + offsets[j] * normal[m, 0]
                points[j * count + i, 1] = middle[m, 1] + place * along[m, 1] + offsets[j] * normal[m, 1]
        pixels = plane_pixels_kernel(points, columns, matrix, k)
        for j in range(offsets.shape[0]):
            profile[j] = 0.0
            for i in range(j * count, (j + 1) * count):
                value = spline_value(luma, pixels[i, 0], pixels[i, 1])
                profile[j] += value / count if value >= 0 else np.nan
        for j in range(slopes.shape[1]):
            slope = abs(profile[j + 2] - profile[j]) / 2
            slopes[m, j] = slope if slope >= 0 else 0.0
    return slopes


@compiled()
def by_pose_and_size_kernel(middle: Array, normal: Array) -> Array:
    """Change (m, 5) of places (m, 2) along their normals (m, 2) with the pose, and with length and width [share].

    A top that was measured a millimetre too wide cannot lie on both of its edges; with the width held, the fit settles
    on either one.
    """
    m = len(middle)
    left, right, lower, upper = np.inf, -np.inf, np.inf, -np.inf
    for i in range(m):
        left, right = min(left, middle[i, 0]), max(right, middle[i, 0])
        lower, upper = min(lower, middle[i, 1]), max(upper, middle[i, 1])
    x, y = (left + right) / 2, (lower + upper) / 2
    rows = np.empty((m, 5))
    for i in range(m):
        rows[i, 0], rows[i, 1] = normal[i, 0], normal[i, 1]
        rows[i, 2] = middle[i, 0] * normal[i, 1] - middle[i, 1] * normal[i, 0]
        rows[i, 3], rows[i, 4] = (middle[i, 0] - x) * normal[i, 0], (middle[i, 1] - y) * normal[i, 1]
    return rows


@compiled()
def side_widths_kernel(middle: Array, outward_m: Array, planes: tuple[Array, Array], matrix: Array, k: Array) -> Array:
    """Distance (m,) [px] from edges (m, 2) to their feet, outward; ``planes``: of the edges and of the feet."""
    outer, widths = np.empty(middle.shape), np.empty(len(middle))
    for i in range(len(middle)):
        outer[i, 0], outer[i, 1] = middle[i, 0] + outward_m[i, 0], middle[i, 1] + outward_m[i, 1]
    edge, foot = plane_pixels_kernel(middle, planes[0], matrix, k), plane_pixels_kernel(middle, planes[1], matrix, k)
    outer = plane_pixels_kernel(outer, planes[0], matrix, k)
    for i in range(len(middle)):
        x, y = outer[i, 0] - edge[i, 0], outer[i, 1] - edge[i, 1]
        widths[i] = ((foot[i, 0] - edge[i, 0]) * x + (foot[i, 1] - edge[i, 1]) * y) / np.hypot(x, y)
    return widths


@compiled()
def _peaks(slopes: Array, ordinary: Array, offsets: Array, expected: Array, spread: float) -> tuple[Array, Array]:
    """Offset of the steepest place of each stretch near where it is expected, and how far it stands out.

    ``ordinary`` (m,) is the usual steepness along each profile. A place that is steepest only because the profile ends
    there is no peak and does not stand out.
    """
    place, contrast = np.zeros(len(slopes)), np.zeros(len(slopes))
    for m in range(len(slopes)):
        best, at = -1.0, 1
        for j in range(1, slopes.shape[1] - 1):
            if slopes[m, j] <= best:
                continue
            score = slopes[m, j] * np.exp(-0.5 * ((offsets[j] - expected[m]) / spread) ** 2)
            if score > best:
                best, at = score, j
        left, peak, right = slopes[m, at - 1], slopes[m, at], slopes[m, at + 1]
        bend = left - 2 * peak + right
        if bend < 0 and peak >= left and peak >= right:
            place[m] = offsets[at] + 0.5 * (left - right) / bend * (offsets[1] - offsets[0])
            contrast[m] = min(max(peak / (ordinary[m] + 0.5) - 1, 0.0), 5.0)
    return place, contrast


@compiled()
def _places(rows: Array, found: Array) -> Array:
    """Places (m,) along the normals of what was found (p,)."""
    places = np.zeros(len(rows))
    for i in range(len(rows)):
        for j in range(len(found)):
            places[i] += rows[i, j] * found[j]
    return places


@compiled()
def _information(rows: Array, weight: Array, scale: float, known: Array) -> Array:
    """Information (p, p) of weighted rows (m, p), with what was known beforehand."""
    p = rows.shape[1]
    information = np.zeros((p, p))
    for i in range(len(rows)):
        for j in range(p):
            for k in range(p):
                information[j, k] += weight[i] * rows[i, j] * rows[i, k]
    for j in range(p):
        information[j, j] += (scale / known[j]) ** 2
    return information


@compiled()
def _right(rows: Array, weight: Array, place: Array) -> Array:
    """Right side (p,) of the least squares."""
    right = np.zeros(rows.shape[1])
    for i in range(len(rows)):
        for j in range(rows.shape[1]):
            right[j] += weight[i] * rows[i, j] * place[i]
    return right


@compiled()
def fit_kernel(
    slopes: Array, offsets: Array, rows: Array, trust: Array, known: Array, pixel_m: float, first_px: float
) -> tuple[bool, Array, Array, Array, Array, Array, float]:
    """Rounds of the robust fit: whether it holds, correction, places, contrasts, inner, weights and scale.

    ``rows`` (m, p) are the changes of the places with what is fitted, ``known`` (p,) the deviations known beforehand,
    ``first_px`` the least scale of misfits in the first round.
    """
    m = len(rows)
    ordinary, found = np.empty(m), np.zeros(rows.shape[1])
    for i in range(m):
        ordinary[i] = np.median(slopes[i])
    place, contrast, inner, weight = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    scale = 0.0
    for round_ in range(_FITS):
        # The search narrows: wide enough for a click at first, then for the blur of an edge.
        spread = pixel_m * max(0.5, 2.0 * 0.7**round_)
        expected = _places(rows, found)
        place, contrast = _peaks(slopes, ordinary, offsets, expected, spread)
        misfit = place - expected
        seen = contrast > 0
        if seen.sum() < max(4, len(found)):
            return False, found, place, contrast, inner, weight, scale
        # Both of two opposite edges count at first where the size is free: a redescending weight would keep the nearer
        # one and drop the other.
        scale = max(
            STD_OF_MEDIAN * np.median(np.abs(misfit[seen])), pixel_m * max(_LEAST_SCALE_PX, first_px * 0.7**round_)
        )
        inner = np.maximum(1 - (misfit / (TUKEY * scale)) ** 2, 0.0)
        weight = trust * contrast * inner**2
        if 3 * (weight > 0).sum() < m:
            return False, found, place, contrast, inner, weight, scale
        found = solved(root_of(_information(rows, weight, scale, known)), _right(rows, weight, place))
    return True, found, place, contrast, inner, weight, scale


@compiled()
def covariance_kernel(
    rows: Array,
    fitted: tuple[Array, Array, Array, Array, Array, float],
    trust: Array,
    known: Array,
    noise: tuple[Array, float],
    shift: Array,
) -> Array:
    """Covariance (p, p) of a correction, from the misfits of the edges.

    ``fitted``: correction, places, contrasts, inner, weights and scale of :func:`fit_kernel`; ``noise``: deviation of
    each stretch on a clear edge [m], and by how much more it is at a contrast of one [share]; ``shift`` (m,): by how
    much all the edges may be shifted together [m].
    """
    correction, place, contrast, inner, weight, scale = fitted
    clear, faint = noise
    m, p = rows.shape
    misfit = place - _places(rows, correction)
    # The slope of Tukey's influence function: less than its weight, so that outlying edges constrain the fit less.
    steadiness = trust * contrast * inner * np.maximum(5 * inner - 4, 0.0)
    scores, together, middle = np.empty(p), np.zeros(p), np.zeros((p, p))
    used = 0
    for i in range(m):
        used += weight[i] > 0
        least = clear[i] * (1 + faint / max(contrast[i], 0.1))
        for j in range(p):
            scores[j] = rows[i, j] * weight[i] * max(abs(misfit[i]), least)
            together[j] += rows[i, j] * weight[i] * shift[i]
        for j in range(p):
            for k in range(p):
                middle[j, k] += scores[j] * scores[k]
    root = root_of(_information(rows, steadiness, scale, known))
    inverse, freedom, shifted = inverse_of(root), m / max(1, used - 3), solved(root, together)
    for j in range(p):
        for k in range(p):
            middle[j, k] *= freedom
        middle[j, j] += scale**4 / known[j] ** 2
    covariance: Array = product_of(inverse, product_of(middle, inverse))
    for j in range(p):
        for k in range(p):
            covariance[j, k] += shifted[j] * shifted[k]
    return covariance
