"""Registration: the body frame, from the known outline of the planar target and the edges in the picture.

The outline is projected at an approximate pose. Across each stretch of each edge a profile of grey values is read along
the normal, in the plane of the target; its slope peaks at the edge. The pose that brings the outline onto the peaks is
a robust point-to-line fit. Other edges (a visible side, the shadow, a printed border) lie elsewhere on the profile and
move relative to the target as the body moves; so the fits of many pictures agree on the target's edge and scatter where
something else was taken for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Array, Body
from towval.model.compiling import compiled
from towval.model.errors import InputError
from towval.model.geometry import polygon_area, rigid_fit, transform
from towval.optics.projection import project
from towval.tracking.interpolation import RELAXED, plane_pixels_kernel, plane_to_camera, spline_value
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import TUKEY


@dataclass(frozen=True)
class OutlineConstants:
    """Tuned constants of the edge fit; lengths in pixels are measured on the planar target."""

    click_noise_px: float = 0.7  # [px] Standard deviation of one coordinate of a click.
    reach_px: float = 4.0  # [px] From the outline in which an edge is searched; clicks are within 3 px.
    step_px: float = 1 / 3  # [px] Between readings along a profile.
    spacing_px: float = 1.5  # [px] Between profiles that are averaged to one.
    stretches: int = 10  # Averaged profiles an edge of the outline, at least three pixels each.
    astray: float = 3.0  # Times the usual distance of a fit from the others, beyond which it does not count.
    most_apart: float = 0.75  # Of a fit's variance: no more is believed to average out.
    sharp: float = np.deg2rad(35.0)  # [rad] Turn of a corner at which a profile meets two edges.
    thin_px: float = 3.5  # [px] Strips of side thinner than this blur into the target's edge,
    thin_shift_px: float = 0.25  # [px] and shift it: 0.11 measured at a blur of 0.6, more when softer.
    trust_in_thin: float = 0.1  # Weight of such a stretch.
    edge_noise_px: float = 0.05  # [px] Of a stretch of the length below: 0.06 measured on a clear edge,
    faint_noise_px: float = 0.07  # [px] over its contrast, added to that: 0.2 measured on a faint one.
    noise_length_px: float = 12.0  # [px] Length of the stretches on which these were measured.
    prior_px: float = 3.0  # [px] What is known without edges, so that the turn of a disc stays where it is.
    length_std_m: float = 0.001  # [m] Of a measured length of a top: a tape measure.
    other_size_px: float = (
        0.35  # [px] Beyond it a length is not the stated one: edges stand off by 0.06 each, thin sides more.
    )
    wide_px: float = 1.0  # [px] The same, where some edges are on their places and others three pixels off.
    both_px: float = 0.25  # [px] Scale of misfits at first, for edges 1.5 mm too far apart in pixels of 2.3 to 2.9 mm.


CONSTANTS = OutlineConstants()

_LEAST_SCALE_PX = 0.05  # [px] Of misfits.
_SIZED = 1e-6  # Share of the deviation of lengths that is as good as none.
_FITS = 8  # Rounds of the robust fit, in which the search narrows from 2 px to 0.5 px.
_MEDIAN_CHI_3 = 1.538  # Median distance of three normal deviates from their mean.


@dataclass(frozen=True)
class Stretches:
    """Short pieces of a body's outline, each with its place and outward normal.

    ``middle`` (m, 2) [m]; ``along`` (m, 2) and ``normal`` (m, 2) unit vectors; ``length`` (m,) [m]; ``step`` [m]
    between readings along the normal; ``spacing`` [m] between profiles of one stretch.
    """

    middle: Array
    along: Array
    normal: Array
    length: Array
    step: float
    spacing: float

    @property
    def offsets(self) -> Array:
        """Distances along the normal where the slope is known (k,) [m], outward positive."""
        half = round(CONSTANTS.reach_px / CONSTANTS.step_px)
        return self.step * np.arange(-half, half + 1, dtype=np.float64)


@dataclass(frozen=True)
class OutlineFit:
    """Correction of a pose that moves the outline onto the edges.

    ``correction`` (3,) is a pose in the body frame: the true body frame is ``compose(pose, correction)``;
    ``covariance`` (3, 3) its covariance; ``size`` (2,): by how much length and width are found other than stated [m].
    """

    correction: Array
    covariance: Array
    size: Array = field(default_factory=lambda: np.zeros(2))


def pose_from_clicks(target: PlanarTarget, clicks_px: ArrayLike) -> tuple[Array, Array, float]:
    """Pose from clicks (n, 2) [px] on the corners of a target, in the order of ``top_corners_m``.

    Returns
    -------
    pose : ndarray (3,)
        Least-squares pose [m, m, rad].
    covariance : ndarray (3, 3)
        Of the registration in the body frame, from the noise of a click [m², m rad, rad²].
    misfit_px : float
        Largest distance between a click and its corner at that pose [px].

    Raises
    ------
    InputError
        When the number of clicks is not that of the corners, or a click's ray misses the plane.
    """
    body, clicks_px = target.body, np.asarray(clicks_px, dtype=np.float64)
    if clicks_px.shape != body.top_corners_m.shape:
        raise InputError(
            f"the clicks of {body.name} do not match its corners",
            got=f"{len(clicks_px)} clicks",
            allowed=f"{len(body.top_corners_m)} clicks, in the order of top_corners_m",
        )
    clicked = target.floor_xy(clicks_px)
    if not np.isfinite(clicked).all():
        raise InputError(f"a click of {body.name} is not on its plane", got=clicks_px.tolist())
    pose = rigid_fit(body.top_corners_m, clicked)
    pixel = target.metres_per_pixel(pose)
    misfit = np.linalg.norm(transform(pose, body.top_corners_m) - clicked, axis=1).max() / pixel
    x, y = body.top_corners_m.T
    rows = np.concatenate([np.stack([np.ones_like(x), 0 * x, -y], 1), np.stack([0 * x, np.ones_like(x), x], 1)])
    return pose, np.linalg.inv(rows.T @ rows) * (CONSTANTS.click_noise_px * pixel) ** 2, float(misfit)


def stretches_of(body: Body, pixel_m: float) -> Stretches:
    """Cut the outline of a body into stretches for a picture whose pixels are ``pixel_m`` wide on the target."""
    corners = body.top_corners_m
    if polygon_area(corners) < 0:
        corners = corners[::-1]
    edges = np.roll(corners, -1, axis=0) - corners
    sizes = np.linalg.norm(edges, axis=1)
    directions = edges / sizes[:, None]
    turns = np.arccos(np.clip((directions * np.roll(directions, 1, axis=0)).sum(axis=1), -1, 1))
    # Two pixels at a sharp corner are left out: there a profile sees two edges. A round outline has none.
    cut = np.where(turns > CONSTANTS.sharp, 2 * pixel_m, 0.0)
    whole = sizes - np.roll(cut, -1) - cut
    count = np.minimum(CONSTANTS.stretches, np.maximum(whole // (3 * pixel_m), whole > pixel_m)).astype(int)
    edge = np.repeat(np.arange(len(corners)), count)
    if len(edge) < 4:
        raise InputError(
            f"the planar target of {body.name} is too small in the picture to see its edges",
            got=f"{pixel_m * 1000:.1f} mm a pixel",
            remedy="film from nearer or with more pixels",
        )
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    tangent, length = directions[edge], whole[edge] / count[edge]
    middle = corners[edge] + tangent * (cut[edge] + whole[edge] * (number + 0.5) / count[edge])[:, None]
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    step_m, spacing_m = CONSTANTS.step_px * pixel_m, CONSTANTS.spacing_px * pixel_m
    return Stretches(middle, tangent, normal, length, step_m, spacing_m)


@compiled(fastmath=RELAXED)
def _profiles_kernel(
    luma: NDArray[np.uint8],
    lines: tuple[Array, Array, Array, Array, float],
    offsets: Array,
    columns: Array,
    matrix: Array,
    k: Array,
) -> Array:
    """Mean grey value of each stretch at each offset (m, k); NaN where it leaves the picture."""
    middle, along, normal, length, spacing = lines
    profiles = np.zeros((middle.shape[0], offsets.shape[0]))
    for m in range(middle.shape[0]):
        count = max(1, int(length[m] / spacing))
        points = np.empty((count, 2))
        for j in range(offsets.shape[0]):
            for i in range(count):
                place = length[m] * ((i + 0.5) / count - 0.5)
                points[i, 0] = middle[m, 0] + place * along[m, 0] + offsets[j] * normal[m, 0]
                points[i, 1] = middle[m, 1] + place * along[m, 1] + offsets[j] * normal[m, 1]
            pixels = plane_pixels_kernel(points, columns, matrix, k)
            for i in range(count):
                value = spline_value(luma, pixels[i, 0], pixels[i, 1])
                profiles[m, j] += value / count if value >= 0 else np.nan
    return profiles


def _edge_slopes(luma: NDArray[np.uint8], target: PlanarTarget, s: Stretches, pose: Array) -> Array:
    """Slope (m, k) of the picture at the offsets of each stretch [grey levels per step], zero outside the picture."""
    offsets, camera = s.offsets, target.camera
    around = np.concatenate([[offsets[0] - s.step], offsets, [offsets[-1] + s.step]])
    columns = plane_to_camera(np.asarray(pose, dtype=np.float64), target.height, target.floor.T_camera_floor)
    lines = s.middle, s.along, s.normal, s.length, s.spacing
    profiles = _profiles_kernel(luma, lines, around, columns, camera.matrix, camera.distortion)
    slopes: Array = np.nan_to_num(np.abs(profiles[:, 2:] - profiles[:, :-2]) / 2)
    return slopes


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


def _side_widths(target: PlanarTarget, stretches: Stretches, pose: Array) -> Array:
    """Visible width of the body's side outside each stretch (m,) [px] if it reaches the floor; ≤ 0 where hidden."""
    beyond = stretches.middle + stretches.step * stretches.normal
    on_edge, outside = (transform(pose, points) for points in (stretches.middle, beyond))
    edge, out = target.picture_of(on_edge), target.picture_of(outside)
    foot = project(target.camera, target.floor, np.column_stack([on_edge, np.zeros(len(on_edge))]))
    outward = (out - edge) / np.linalg.norm(out - edge, axis=1, keepdims=True)
    widths: Array = ((foot - edge) * outward).sum(axis=1)
    return widths


@compiled()
def _fit_kernel(
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
        place, contrast = _peaks(slopes, ordinary, offsets, rows @ found, spread)
        misfit = place - rows @ found
        seen = contrast > 0
        if seen.sum() < max(4, len(found)):
            return False, found, place, contrast, inner, weight, scale
        # Both of two opposite edges count at first where the size is free: a redescending weight would keep the nearer
        # one and drop the other.
        scale = max(1.4826 * np.median(np.abs(misfit[seen])), pixel_m * max(_LEAST_SCALE_PX, first_px * 0.7**round_))
        inner = np.maximum(1 - (misfit / (TUKEY * scale)) ** 2, 0.0)
        weight = trust * contrast * inner**2
        if 3 * (weight > 0).sum() < m:
            return False, found, place, contrast, inner, weight, scale
        weighted = np.ascontiguousarray(rows.T * weight)
        found[:] = np.linalg.solve(weighted @ rows + np.diag(scale**2 / known**2), weighted @ place)
    return True, found, place, contrast, inner, weight, scale


def _fit_outline(
    slopes: Array, stretches: Stretches, pixel_m: float, side_px: Array, first_px: float, *, sized: bool = False
) -> OutlineFit | None:
    """Move the outline onto the edges; see :func:`observe_outline`. ``sized``: as long and wide as stated."""
    rows, width = _by_pose_and_size(stretches), np.ptp(stretches.middle, axis=0)
    reach = np.linalg.norm(stretches.middle, axis=1).max()
    known = np.array([1, 1, 1 / reach, 0, 0]) * CONSTANTS.prior_px * pixel_m
    known[3:] = (_SIZED if sized else 1.0) * CONSTANTS.length_std_m / width
    trust, thin = _trust(side_px)
    fit = _fit_kernel(slopes, stretches.offsets, rows, trust, known, pixel_m, first_px)
    holds, correction, place, contrast, inner, weight, scale = fit
    if not holds:
        return None
    misfit, prior = place - rows @ correction, scale**2 / known**2
    # The slope of Tukey's influence function: less than its weight, so that outlying edges constrain the fit less.
    steadiness = trust * contrast * inner * np.maximum(5 * inner - 4, 0.0)
    inverse = np.linalg.inv(rows.T @ (steadiness[:, None] * rows) + np.diag(prior))
    averaged = np.sqrt(CONSTANTS.noise_length_px * pixel_m / stretches.length)
    noise = pixel_m * averaged * (CONSTANTS.edge_noise_px + CONSTANTS.faint_noise_px / np.maximum(contrast, 0.1))
    scores = rows * (weight * np.maximum(np.abs(misfit), noise))[:, None]
    used = weight > 0
    freedom = len(rows) / max(1, used.sum() - 3)
    shifted = inverse @ rows.T @ (weight * thin * CONSTANTS.thin_shift_px * pixel_m)
    sampled = inverse @ (scores.T @ scores * freedom + np.diag(prior) * scale**2) @ inverse
    return OutlineFit(correction[:3], (sampled + np.outer(shifted, shifted))[:3, :3], correction[3:] * width)


def _trust(side_px: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Weight of each stretch, and where only a thin strip of the side is visible.

    Its far edge blurs into the target's and shifts the steepest place: such a stretch counts little, and the possible
    shift is part of the deviation.
    """
    thin = (side_px > 0) & (side_px < CONSTANTS.thin_px)
    return np.where(thin, CONSTANTS.trust_in_thin, 1.0), thin


def _by_pose_and_size(stretches: Stretches) -> Array:
    """Change (m, 5) of the stretches' places along their normals with the pose, and with length and width [share].

    A top that was measured a millimetre too wide cannot lie on both of its edges; with the width held, the fit settles
    on either one.
    """
    middle, normal = stretches.middle, stretches.normal
    turned = middle[:, 0] * normal[:, 1] - middle[:, 1] * normal[:, 0]
    centre = (middle.min(axis=0) + middle.max(axis=0)) / 2
    return np.column_stack([normal, turned, (middle - centre) * normal])


def observe_outline(
    luma: NDArray[np.uint8], target: PlanarTarget, pose: Array, *, wide: bool = False
) -> OutlineFit | None:
    """Correction that moves the outline at ``pose`` (3,) onto the edges of a picture.

    ``wide``: of edges up to three pixels off, where others are on their places already. None where fewer than a third
    of the stretches agree. A direction that the edges leave open (the turn of a disc) is not corrected and has a
    standard deviation of three pixels.
    """
    pixel = target.metres_per_pixel(pose)
    stretches = stretches_of(target.body, pixel)
    slopes = _edge_slopes(luma, target, stretches, pose)
    seen = slopes, stretches, pixel, _side_widths(target, stretches, pose)
    first_px = CONSTANTS.wide_px if wide else 0.0
    free = _fit_outline(*seen, max(first_px, CONSTANTS.both_px))
    # With the size held, all edges say where the middle is; where it is free, opposite ones count the same, however
    # doubtful one of them. And faint edges may not fix the size, too.
    if free is not None and np.abs(free.size).max() >= CONSTANTS.other_size_px * pixel:
        return free
    held = _fit_outline(*seen, first_px, sized=True) or free
    return held if held is None or free is None else replace(held, size=free.size)


def observe_size(luma: NDArray[np.uint8], target: PlanarTarget, pose: Array) -> float | None:
    """Size of the outline in a picture over the stated one, less 1; None where fewer than a third of it is found."""
    pixel = target.metres_per_pixel(pose)
    stretches = stretches_of(target.body, pixel)
    slopes, middle, normal = _edge_slopes(luma, target, stretches, pose), stretches.middle, stretches.normal
    rows = np.column_stack([_by_pose_and_size(stretches)[:, :3], (middle * normal).sum(axis=1)])
    trust, _ = _trust(_side_widths(target, stretches, pose))
    reach = np.linalg.norm(middle, axis=1).max()
    known = np.array([1, 1, 1 / reach, np.inf]) * CONSTANTS.prior_px * pixel
    holds, found, *_ = _fit_kernel(slopes, stretches.offsets, rows, trust, known, pixel, CONSTANTS.both_px)
    return float(found[3]) if holds else None


def combine_fits(fits: Sequence[OutlineFit], further: Array | None = None) -> OutlineFit:
    """One registration from the fits of many pictures: the mean of those that agree, weighted by information.

    What shifts the edges of one body (what is printed beside them, a bevel, a shadow line) is the same in all pictures
    and does not average out. So only the share of a fit's variance that differs between the pictures is averaged; the
    errors of the rest count as fully correlated. ``further`` (n, 3, 3): covariances of the poses at which the outlines
    were fitted, which differ from picture to picture.
    """
    corrections = np.array([fit.correction for fit in fits])
    covariances = np.array([fit.covariance for fit in fits])
    information = np.linalg.inv(covariances if further is None else covariances + further)
    agree = _agreeing(corrections, np.linalg.inv(information), information)
    corrections, covariances, information = corrections[agree], covariances[agree], information[agree]
    spread = np.linalg.inv(information.sum(axis=0))
    mean = spread @ np.einsum("nij,nj->i", information, corrections)
    off = corrections - mean
    apart = np.einsum("ni,nij,nj->", off, information, off) / (3 * max(1, len(off) - 1))
    share = min(apart, CONSTANTS.most_apart)
    together = spread @ (information @ _roots(covariances, spread)).sum(axis=0)
    covariance = (1 - share) * together @ together.T + apart * spread
    return OutlineFit(mean, covariance)


def _agreeing(corrections: Array, covariances: Array, information: Array) -> NDArray[np.bool_]:
    """Which corrections (n, 3) are no farther from their middle than chance, or most of them, by what each knows."""
    weight = 1 / np.diagonal(covariances, axis1=1, axis2=2)
    middle = np.array([_weighted_median(corrections[:, j], weight[:, j]) for j in range(3)])
    off = corrections - middle
    distance = np.sqrt(np.einsum("ni,nij,nj->n", off, information, off))
    agreeing: NDArray[np.bool_] = distance <= CONSTANTS.astray * max(_MEDIAN_CHI_3, float(np.median(distance)))
    return agreeing


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, 0.5 * below[-1])])


def _roots(covariances: Array, unit: Array) -> Array:
    """Symmetric roots (n, 3, 3), taken in the units in which ``unit`` (3, 3) has a diagonal of ones."""
    scale = np.sqrt(np.diag(unit))
    size, axes = np.linalg.eigh(covariances / np.outer(scale, scale))
    root = (axes * np.sqrt(size)[:, None, :]) @ axes.transpose(0, 2, 1)
    roots: Array = scale[:, None] * root
    return roots
