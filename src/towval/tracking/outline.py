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

from towval.model import Array, Body, Finding
from towval.model.errors import InputError
from towval.model.findings import finding
from towval.model.geometry import compose, rigid_fit, transform
from towval.tracking.interpolation import plane_to_camera
from towval.tracking.noise import beyond
from towval.tracking.outline_kernels import (
    by_pose_and_size_kernel,
    covariance_kernel,
    fit_kernel,
    side_widths_kernel,
    slopes_kernel,
    stretches_kernel,
)
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import step_between
from towval.tracking.rectified import View


@dataclass(frozen=True)
class OutlineConstants:
    """Tuned constants of the edge fit; lengths in pixels are measured on the planar target."""

    click_noise_px: float = 0.7  # [px] Standard deviation of one coordinate of a click.
    misfit_of_clicks_px: float = 6.0  # [px] Of clicks from the outline: more than their noise can explain.
    wrong_clicks: float = 0.08  # Of the body's size: the clicks belong to another body or are in another order.
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
    beside_px: float = 2.0  # [px] From a place found by a search to those beside it: its edge may be the side's foot.
    farthest_px: float = 3.0  # [px] From it, at which edges may be: the places beside it, and a pixel.
    nearly_as_sure: float = 1.5  # Times the deviation of the surest place: wrong ones have two times or more.
    apart_px: float = 1.0  # [px] Between places that differ: fits at the same edges are within 0.2 px.


CONSTANTS = OutlineConstants()

_SIZED = 1e-6  # Share of the deviation of lengths that is as good as none.
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
    ``covariance`` (3, 3) its covariance; ``size`` (2,): by how much length and width are found other than stated [m];
    ``all_sides``: whether something was found of each side. Else nothing confirms the side opposite to one that is not.
    """

    correction: Array
    covariance: Array
    size: Array = field(default_factory=lambda: np.zeros(2))
    all_sides: bool = True

    @property
    def largest_std_m(self) -> float:
        """Deviation of the place in the direction in which it is largest [m]."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))


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


def judge_clicks(body: Body, misfit_px: float, pixel_m: float) -> list[Finding]:
    """A finding where clicks miss the outline of a body by ``misfit_px`` [px]; raises `InputError` far off it."""
    size_px = float(np.linalg.norm(np.ptp(body.top_corners_m, axis=0))) / pixel_m
    if misfit_px > max(CONSTANTS.misfit_of_clicks_px, CONSTANTS.wrong_clicks * size_px):
        raise InputError(
            f"first_frame_clicks_px of {body.name} do not fit its outline",
            got=f"a corner {misfit_px:.0f} px off at the best fit",
            allowed=f"{CONSTANTS.misfit_of_clicks_px:.0f} px",
            remedy="click its corners in the order of top_corners_m (not another body's); check its height and size",
        )
    misfits = misfit_px > CONSTANTS.misfit_of_clicks_px
    return [finding("clicks_misfit", name=body.name, misfit_px=misfit_px)] if misfits else []


def stretches_of(body: Body, pixel_m: float) -> Stretches:
    """Cut the outline of a body into stretches for a picture whose pixels are ``pixel_m`` wide on the target."""
    found = stretches_kernel(body.top_corners_m, pixel_m, CONSTANTS.sharp, CONSTANTS.stretches)
    if len(found[0]) < 4:
        raise InputError(
            f"the planar target of {body.name} is too small in the picture to see its edges",
            got=f"{pixel_m * 1000:.1f} mm a pixel",
            remedy="film from nearer or with more pixels",
        )
    return Stretches(*found, CONSTANTS.step_px * pixel_m, CONSTANTS.spacing_px * pixel_m)


def _edge_slopes(luma: NDArray[np.uint8], target: PlanarTarget, s: Stretches, pose: Array) -> Array:
    """Slope (m, k) of the picture at the offsets of each stretch [grey levels per step], zero outside the picture."""
    offsets, camera = s.offsets, target.camera
    around = np.concatenate([[offsets[0] - s.step], offsets, [offsets[-1] + s.step]])
    columns = plane_to_camera(np.asarray(pose, dtype=np.float64), target.height, target.floor.T_camera_floor)
    lines = s.middle, s.along, s.normal, s.length, s.spacing
    return slopes_kernel(luma, lines, around, columns, camera.matrix, camera.lens)


def _side_widths(target: PlanarTarget, stretches: Stretches, pose: Array) -> Array:
    """Visible width of the body's side outside each stretch (m,) [px] if it reaches the floor; ≤ 0 where hidden."""
    pose, T, camera = np.asarray(pose, dtype=np.float64), target.floor.T_camera_floor, target.camera
    planes = plane_to_camera(pose, target.height, T), plane_to_camera(pose, 0.0, T)
    outward_m = stretches.step * stretches.normal
    return side_widths_kernel(stretches.middle, outward_m, planes, camera.matrix, camera.lens)


def _fit_outline(
    slopes: Array, stretches: Stretches, pixel_m: float, side_px: Array, first_px: float, *, sized: bool = False
) -> OutlineFit | None:
    """Move the outline onto the edges; see :func:`observe_outline`. ``sized``: as long and wide as stated."""
    rows = by_pose_and_size_kernel(stretches.middle, stretches.normal)
    width = np.ptp(stretches.middle, axis=0)
    reach = np.linalg.norm(stretches.middle, axis=1).max()
    known = np.array([1, 1, 1 / reach, 0, 0]) * CONSTANTS.prior_px * pixel_m
    known[3:] = (_SIZED if sized else 1.0) * CONSTANTS.length_std_m / width
    trust, thin = _trust(side_px)
    holds, correction, *_ = fit = fit_kernel(slopes, stretches.offsets, rows, trust, known, pixel_m, first_px)
    if not holds:
        return None
    clear = CONSTANTS.edge_noise_px * pixel_m * np.sqrt(CONSTANTS.noise_length_px * pixel_m / stretches.length)
    noise, shift = (clear, CONSTANTS.faint_noise_px / CONSTANTS.edge_noise_px), CONSTANTS.thin_shift_px * pixel_m
    covariance = covariance_kernel(rows, fit[1:], trust, known, noise, np.where(thin, shift, 0.0))
    # A round outline has no sides: whatever faces nearly the same way counts as one.
    alike = stretches.normal @ stretches.normal[fit[5] > 0].T > np.cos(CONSTANTS.sharp)
    return OutlineFit(correction[:3], covariance[:3, :3], correction[3:] * width, bool(alike.any(axis=1).all()))


def _trust(side_px: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Weight of each stretch, and where only a thin strip of the side is visible.

    Its far edge blurs into the target's and shifts the steepest place: such a stretch counts little, and the possible
    shift is part of the deviation.
    """
    thin = (side_px > 0) & (side_px < CONSTANTS.thin_px)
    return np.where(thin, CONSTANTS.trust_in_thin, 1.0), thin


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


def as_begun(
    luma: NDArray[np.uint8], target: PlanarTarget, pose: Array, fit: OutlineFit, begun_covariance: Array
) -> OutlineFit:
    """A ``fit`` of the outline at ``pose`` (3,), stated no surer than fits that begin near there agree with it.

    Clear edges lead to one place from all around, and a fit that knows its place as well as a clear stretch does is not
    asked. Faint ones, as of a soft picture, keep a fit near where it begins: texture beside an edge may be steeper than
    the edge, and takes the fits of all pictures the same way. They begin where the clicks led, known to
    ``begun_covariance`` (3, 3) in the body frame [m², m rad, rad²]: what that makes of the fit is the mean square of
    fits from six places that have that covariance.
    """
    if fit.largest_std_m < CONSTANTS.edge_noise_px * target.metres_per_pixel(pose):
        return fit
    steps = np.sqrt(len(pose)) * np.linalg.cholesky(begun_covariance).T
    fits = ((step, observe_outline(luma, target, compose(pose, step))) for step in (*steps, *-steps))
    most_m = CONSTANTS.nearly_as_sure * fit.largest_std_m
    ends = [compose(step, one.correction) for step, one in fits if one is not None and one.largest_std_m < most_m]
    if not ends:
        return fit
    apart = np.array([step_between(fit.correction, end) for end in ends])
    further = beyond((apart.T @ apart / len(ends))[None], fit.covariance[None], 1.0)[0]
    return replace(fit, covariance=fit.covariance + further)


def observe_size(luma: NDArray[np.uint8], target: PlanarTarget, pose: Array) -> float | None:
    """Size of the outline in a picture over the stated one, less 1; None where fewer than a third of it is found."""
    found = _fit_freely(luma, target, pose, CONSTANTS.both_px, as_one=True)
    return None if found is None else float(found[3])


def observe_sides(luma: NDArray[np.uint8], target: PlanarTarget, pose: Array) -> Array | None:
    """By how much length and width (2,) of the outline at ``pose`` (3,) are found other than stated [m].

    Nothing is taken to be known of them, so other edges may be taken for the top's: its foot, a line beside it. None
    where fewer than a third of the stretches agree, or one of the sides is not found at all.
    """
    found = _fit_freely(luma, target, pose, CONSTANTS.wide_px, as_one=False)
    if found is None or not np.isfinite(found).all():
        return None
    return np.asarray(found[3:] * np.ptp(target.body.top_corners_m, axis=0))


def _fit_freely(
    luma: NDArray[np.uint8], target: PlanarTarget, pose: Array, first_px: float, *, as_one: bool
) -> Array | None:
    """Correction (3,) of a ``pose`` with the size, ``as_one``, or the sizes along and across, less 1: (4,) or (5,).

    None where fewer than a third of the stretches agree.
    """
    pixel = target.metres_per_pixel(pose)
    stretches = stretches_of(target.body, pixel)
    slopes = _edge_slopes(luma, target, stretches, pose)
    rows = by_pose_and_size_kernel(stretches.middle, stretches.normal)
    if as_one:
        rows = np.column_stack([rows[:, :3], (stretches.middle * stretches.normal).sum(axis=1)])
    trust, _ = _trust(_side_widths(target, stretches, pose))
    reach = np.linalg.norm(stretches.middle, axis=1).max()
    known = np.append([1, 1, 1 / reach], np.full(rows.shape[1] - 3, np.inf)) * CONSTANTS.prior_px * pixel
    holds, found, *_ = fit_kernel(slopes, stretches.offsets, rows, trust, known, pixel, first_px)
    return found if holds else None


def settled(target: PlanarTarget, views: Sequence[View], pose: Array) -> tuple[Array, Array]:
    """The pose (3,) by the edges near a ``pose`` (3,) that a search found, and the spread (3, 3) of others as good.

    A search takes the foot of a side that is hardly visible for the edge above it, as long as the body goes along it in
    all ``views``; and a fit that begins there stays there. Begun at places around, fits end there or at the edges:
    at these the opposite edge is found as well, and the fit is surer.
    """
    pixel = target.metres_per_pixel(pose)
    around = CONSTANTS.beside_px * pixel * np.array([[x, y, 0.0] for x in (0, 1, -1) for y in (0, 1, -1)][1:])
    own = _end(target, views, pose, wide=False)
    beside = (_end(target, views, compose(pose, step), wide=True) for step in around)
    near_m = CONSTANTS.farthest_px * pixel
    ends = [end for end in (own, *beside) if end is not None and np.linalg.norm(end.pose[:2] - pose[:2]) <= near_m]
    most = max((end.seen for end in ends), default=0)
    ends = [end for end in ends if 2 * end.seen >= most]
    if not ends:
        return pose, np.zeros((3, 3))
    surest = min(ends, key=lambda end: end.std_m)
    as_good = [end for end in ends if end.std_m < CONSTANTS.nearly_as_sure * surest.std_m]
    # What the search found counts, unless another place is clearly surer.
    best = next((end for end in as_good if end is own), surest)
    rivals: list[Array] = []
    for end in (end for end in as_good if end.usual_std_m < CONSTANTS.nearly_as_sure * best.usual_std_m):
        places = [best.pose, *(compose(best.pose, rival) for rival in rivals)]
        if min(float(np.linalg.norm(end.pose[:2] - place[:2])) for place in places) > CONSTANTS.apart_px * pixel:
            rivals.append(step_between(best.pose, end.pose))
    spread = np.array(rivals).reshape(-1, 3)
    return best.pose, spread.T @ spread / (len(rivals) + 1)


@dataclass(frozen=True, eq=False)
class _End:
    """Where fits end: ``pose`` (3,) and views that show edges.

    ``std_m`` is the largest deviation of its place in all of them together [m], ``usual_std_m`` the geometric mean of
    each one's: where a few are sure by chance, others are not.
    """

    pose: Array
    std_m: float
    usual_std_m: float
    seen: int


def _end(target: PlanarTarget, views: Sequence[View], pose: Array, *, wide: bool) -> _End | None:
    """Where fits in all views, ``wide`` ones at first, lead from a ``pose`` (3,); None where none shows edges.

    A wide fit also takes the foot of a side for an edge that is on its place already.
    """
    end = None
    for wide_now in (wide, False):
        fits = (observe_outline(luma, target, compose(step, pose), wide=wide_now) for luma, step in views)
        seen = [fit for fit in fits if fit is not None]
        if not seen:
            return end
        together = combine_fits(seen)
        pose = compose(pose, together.correction)
        usual_m = float(np.exp(np.mean(np.log([fit.largest_std_m for fit in seen]))))
        end = _End(pose, together.largest_std_m, usual_m, len(seen))
    return end


def combine_fits(fits: Sequence[OutlineFit], further: Array | None = None) -> OutlineFit:
    """One registration from the fits of many pictures: the mean of those that agree, weighted by information.

    What shifts the edges of one body (what is printed beside them, a bevel, a shadow line) is the same in all pictures
    and does not average out. So only the share of a fit's variance that differs between the pictures is averaged; the
    errors of the rest count as fully correlated. ``further`` (n, 3, 3): covariances of the poses at which the outlines
    were fitted, which differ from picture to picture.
    """
    corrections, covariances, information, agree = _weighed(fits, further)
    corrections, covariances, information = corrections[agree], covariances[agree], information[agree]
    spread = np.linalg.inv(information.sum(axis=0))
    mean = spread @ np.einsum("nij,nj->i", information, corrections)
    off = corrections - mean
    apart = np.einsum("ni,nij,nj->", off, information, off) / (3 * max(1, len(off) - 1))
    share = min(apart, CONSTANTS.most_apart)
    together = spread @ (information @ _roots(covariances, spread)).sum(axis=0)
    covariance = (1 - share) * together @ together.T + apart * spread
    return OutlineFit(mean, covariance)


def astray(fits: Sequence[OutlineFit], further: Array, together: OutlineFit) -> Array:
    """Covariance (3, 3) of a registration ``together`` for the fits that did not count in it, as :func:`combine_fits`.

    Fits that differ cannot all be right, and how much each knows is as good a chance as any that it is: so it is the
    sum of squares of how far each one left out is off, by its share of what all know of that direction.
    """
    corrections, _, information, agree = _weighed(fits, further)
    out = ~agree
    if not out.any():
        return np.zeros((3, 3))
    off, theirs, every = corrections[out] - together.correction, information[out], information.sum(axis=0)
    share = np.einsum("ni,nij,nj->n", off, theirs, off) / np.einsum("ni,ij,nj->n", off, every, off)
    return np.asarray(np.einsum("n,ni,nj->ij", share, off, off))


def _weighed(fits: Sequence[OutlineFit], further: Array | None) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Corrections (n, 3) of fits, their covariances and what they know with ``further`` (n, 3, 3); which ones agree."""
    corrections = np.array([fit.correction for fit in fits])
    covariances = np.array([fit.covariance for fit in fits])
    information = np.linalg.inv(covariances if further is None else covariances + further)
    return corrections, covariances, information, _agreeing(corrections, np.linalg.inv(information), information)


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
    return np.asarray(scale[:, None] * root)
