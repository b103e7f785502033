"""Registration of the floor: how the view moved against the first picture, from the floor's texture.

The floor stands still, so every displacement of its texture is the camera's: it turned, shifted, zoomed, or a
stabiliser moved the picture. The nine numbers of :data:`towval.model.conventions.VIEW_MOTION` describe all of these;
weak priors hold those that the floor does not determine. As in :mod:`towval.tracking.alignment` the template is
that of the first picture, gain and bias are those of tiles, and what hides the floor is distinguished by its misfit.
Where the floor is farther off than the slopes of its texture reach, blocks are searched first.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body, Camera, Floor
from towval.optics.moved_view import parameters_by_motion
from towval.optics.plane_uncertainty import position_sensitivity
from towval.optics.projection import project, to_plane
from towval.optics.view_motion import moved_view
from towval.tracking.floor_kernels import outside, register_kernel, shares, sums_of_clusters
from towval.tracking.light import CONSTANTS as LIGHT
from towval.tracking.light import without_dead
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.template import Luma, Template, make_template, shrunk, slopes_at, without_light


@dataclass(frozen=True)
class RegistrationConstants:
    """Tuned constants of the registration of the floor."""

    samples: int = 600  # Points of the floor's template.
    inset: float = 0.04  # Of the picture, left out at its border, where lens models extrapolate.
    least_slope: float = 4.0  # [grey levels/px] Less is no texture: compression leaves 1 to 3 on a plain floor,
    noise_slope: float = 2.0  # [1/px] Times the noise, which leaves 1.2 at the steepest of a cell.
    prior_rad: float = 0.1  # [rad] ASSUME: turns; 150 px at a focal length of 1500 px.
    prior_m: float = 0.03  # [m] ASSUME: shifts of the mount.
    prior_zoom: float = 0.05  # ASSUME: the focus hunts by less.
    prior_px: float = 60.0  # [px] ASSUME: what a stabiliser shifts.
    rounds: int = 12  # Most rounds; one that needs more has not converged.
    tolerance_px: float = 0.01  # [px] Of the last step, over the picture.
    least_scale: float = 0.5  # [grey levels] Smallest scale of the residuals: rounding alone gives 0.3.
    most_scale: float = 40.0  # [grey levels] Of the residuals of inliers.
    least_inliers: float = 0.35  # Of the points in view: bodies and people may hide the rest.
    kept_correlation: float = 0.6  # Of the first pictures': less is another place.
    least_correlation: float = 0.35  # As of bodies: wrong places reach 0.3.
    worst_std_px: float = 0.3  # [px] Deviation of the floor's shift beyond which it is not known.
    blocks: int = 32  # Searched in a picture that is far off.
    block_px: int = 16  # [px] Half-width of a block, at half the resolution.
    reach_px: int = 40  # [px] Search from the block's place, at half the resolution.
    block_fit: float = 0.45  # Least correlation of a block.
    block_agrees_px: float = 4.0  # [px] From the motion common to the blocks.
    least_blocks: int = 8  # That agree.
    alike: float = 0.9  # Of the best fit of all blocks: a floor that repeats fits there, too,
    fits_better: float = 0.8  # of what is left over at the place found first: 0.6 where grain tells the right one.
    small: float = 0.02  # Of the prior: a motion of a pixel or two, which a floor too faint for others excludes.
    least_in_view: float = 0.3  # Of the points, neither hidden nor outside the picture.
    inflated_every: int = 10  # Pictures between estimates of how much residuals of neighbours go together,
    least_shared: float = 0.3  # Of the template's information: less is no texture, and is refused by correlation.
    clusters_across: int = 10  # in so many clusters along the longer side.
    least_of_cluster: int = 6  # Points of a cluster whose own place is compared with the others',
    least_clusters: int = 8  # and clusters, for their scatter to be known to a third,
    beyond_noise: float = 2.0  # which counts beyond so many deviations of noise: slopes are noisy, too.


CONSTANTS = RegistrationConstants()

MEDIAN_NORMAL = 0.6745  # Median distance of a normal deviate from its mean, in deviations.

_ROUGH = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
"""Zero on edges and slopes (Immerkær 1996): what it leaves of a picture is noise."""

Hidden = list[tuple[Array, float]]


@dataclass(frozen=True)
class Registered:
    """The view's ``motion`` (9,) in one picture, its ``covariance`` (9, 9), and ``std_px``: that of the floor."""

    motion: Array
    covariance: Array
    std_px: float


@dataclass(frozen=True)
class Learned:
    """What registrations teach: their usual correlation and number, how much residuals of neighbours go together,
    variances of displaced places and those of their noise [px²], and the last one's weights, residuals and scale."""

    correlation: float = 1.0
    registered: int = 0
    variance_factor: float = 1.0
    scatter: tuple[tuple[float, float], ...] = ()
    last: tuple[Array, Array, float] = (np.zeros(0), np.zeros(0), np.inf)


class FloorRegistration:
    """The floor as the first picture ``luma`` shows it, and where it is in others.

    ``hidden``: outlines (n, 2) [m] on the floor within which bodies hide it there. ``worst_std_px`` is the deviation of
    the floor's shift beyond which it is not known, None for that of the constants. :attr:`template` is None where there
    is too little texture, or the horizon is in the picture.
    """

    def __init__(
        self, camera: Camera, floor: Floor, luma: Luma, hidden: tuple[Array, ...], worst_std_px: float | None = None
    ):
        self.camera, self.floor = camera, floor
        self.worst_std_px = CONSTANTS.worst_std_px if worst_std_px is None else worst_std_px
        self.template: Template | None = None
        outline = _visible_floor(camera, floor)
        if outline is None:
            return
        target = PlanarTarget(Body("floor", 0.0, outline, hidden), camera, floor)
        luma = without_dead(luma)
        self.template = make_template(luma, target, np.zeros(3), CONSTANTS.samples)
        if self.template is None:
            return
        c = CONSTANTS
        self.prior = np.repeat([c.prior_rad, c.prior_m, c.prior_zoom, c.prior_px], [3, 3, 1, 2])
        self.learned = Learned()
        self._set_slopes(target, self.template)
        self.trust = _trust(luma, self.template)
        self._set_blocks(luma, target)

    def _set_slopes(self, target: PlanarTarget, template: Template) -> None:
        """Change of each grey value with the view's motion in units of its prior, light taken off; and of its pixel."""
        B = parameters_by_motion(self.camera, self.floor) * self.prior
        pixels = target.pixels(template.points, np.zeros(3))
        on_floor = -position_sensitivity(self.camera, self.floor, pixels, 0.0)[0] @ B
        self.target, self.on_floor = target, on_floor
        self.slopes = self._by_motion_of_view(template.slopes[:, :2], template)
        by_motion = on_floor / template.pixel_m
        self.in_pixels = np.einsum("nap,naq->pq", by_motion, by_motion) / len(by_motion)
        self.by_motion = self.in_pixels / np.outer(self.prior, self.prior)
        self.by_stretch = self.slopes[:, 7] / CONSTANTS.prior_px * (pixels[:, 0] / self.camera.matrix[0, 2] - 1)
        # Residuals of neighbours go together (compression, blur): those of a cluster count as one.
        cell = np.ptp(template.points, axis=0).max() / CONSTANTS.clusters_across
        place = np.floor((template.points - template.points.min(axis=0)) / cell).astype(int)
        self.cluster = np.unique(place[:, 0] * 1000 + place[:, 1], return_inverse=True)[1].ravel()

    def _by_motion_of_view(self, slopes: Array, template: Template) -> Array:
        return without_light(np.einsum("na,nap->np", slopes, self.on_floor), template)

    def shift_px(self, motion: Array) -> float:
        """Root mean square displacement of the floor's points by a small ``motion`` (9,) of the view [px]."""
        return float(np.sqrt((motion / self.prior) @ self.in_pixels @ (motion / self.prior)))

    def std_px(self, covariance: Array) -> float:
        """Deviation of one coordinate of the floor's points by a ``covariance`` (9, 9) of the motion [px]."""
        return float(np.sqrt(np.vdot(self.by_motion, covariance) / 2))

    def no_larger_than_seen(self, motion: Array, covariance: Array) -> tuple[Array, Array]:
        """A motion (9,) and its covariance (9, 9) where no part of it moves the floor farther than all of it did.

        A turn and a shift of the mount may cancel each other on the floor, but not at a body's top. The prior allows
        any of them up to a large bump; behind a small displacement of the floor a small bump is far more likely.
        """
        seen_px = np.hypot(self.shift_px(motion), np.sqrt(2) * self.std_px(covariance))
        share = np.minimum(1.0, seen_px / np.sqrt(np.diagonal(self.in_pixels)))
        by_prior = np.outer(self.prior, self.prior)
        precision = np.linalg.inv(covariance / by_prior)
        posterior = np.linalg.inv(precision + np.diag(share**-2 - 1))
        return posterior @ precision @ (motion / self.prior) * self.prior, posterior * by_prior

    def register(self, luma: Luma, start: Array, hidden: Hidden) -> Registered | None:
        """The view's motion in a picture, near ``start`` (9,) or up to some 80 px from it; None where it is not found.

        ``hidden``: places (2,) on the floor and radii [m] within which bodies hide it.
        """
        found = self.near(luma, start, hidden)
        if found is None:
            place = self._by_blocks(luma, start)
            found = None if place is None else self.near(luma, place, hidden)
        return found

    def anywhere(self, luma: Luma) -> Registered | None:
        """The view's motion in a picture taken at another time, up to some 80 px off.

        Tiles and printed mats repeat: a period off they fit, too, but for their grain and wear.
        """
        before, here = self.learned, np.zeros(len(self.prior))
        best = self.register(luma, here, []) or self.unmoved(luma)
        if best is None:
            return None
        learned, scale = self.learned, CONSTANTS.fits_better * self.learned.last[2]
        for place in self._places_alike(luma):
            self.learned = before
            other = self.near(luma, place, [])
            if other is not None and self.learned.last[2] < scale:
                best, learned, scale = other, self.learned, self.learned.last[2]
        self.learned = learned
        return best

    def unmoved(self, luma: Luma) -> Registered | None:
        """That the view did not move, where a pixel or two explain a picture; None where it takes more.

        What is found then is no more than a deviation.
        """
        found = self.hardly_moved(luma, [])
        if found is None:
            return None
        covariance = found.covariance + np.outer(found.motion, found.motion)
        return Registered(np.zeros(len(self.prior)), covariance, self.std_px(covariance))

    def hardly_moved(self, luma: Luma, hidden: Hidden) -> Registered | None:
        """As :meth:`register`, where the view is expected within a pixel or two; None where it is not found there.

        A floor too faint to settle a large motion may exclude one: noise in the slopes carries the fit along what the
        floor hardly shows, so that it does not end, or ends no closer than is allowed.
        """
        before, found = self.learned, self.near(luma, np.zeros(len(self.prior)), hidden, CONSTANTS.small)
        if found is None or np.abs(found.motion / self.prior).max() > CONSTANTS.small:
            self.learned = before
            return None
        return found

    def _places_alike(self, luma: Luma) -> list[Array]:
        """Motions (9,) to which all blocks together fit about as well, where there are several."""
        small, reach = shrunk(luma, 2), CONSTANTS.reach_px
        fit: Array = np.zeros((2 * reach + 1, 2 * reach + 1))
        count = 0
        for block, at in zip(self.blocks, self.pixels(self.block_places, np.zeros(len(self.prior))), strict=True):
            found = _correlations(small, block, (at - 0.5) / 2)
            if found is not None and found[0].shape == fit.shape:
                fit, count = fit + found[0], count + 1
        if count < CONSTANTS.least_blocks:
            return []
        peaks = (fit == cv2.dilate(fit, np.ones((5, 5)))) & (fit > CONSTANTS.alike * fit.max())
        shifts = 2.0 * (np.argwhere(peaks)[:, ::-1] - reach)
        return [np.append(np.zeros(7), shift) for shift in shifts] if len(shifts) > 1 else []

    def near(self, luma: Luma, start: Array, hidden: Hidden, small: float = 1.0) -> Registered | None:
        """As :meth:`register`, from ``start`` (9,) as far as the slopes of the texture reach.

        The motion is expected to be ``small`` times as large as usual; below one its deviation has no limit.
        """
        template, learned, c = self.template, self.learned, CONSTANTS
        assert template is not None
        discs = np.array([(*place, radius) for place, radius in hidden]).reshape(-1, 3)
        precision = outside(template.points, discs)
        motion, information, values, gain, weight, residual, scale, correlation, converged = register_kernel(
            luma,
            (template.points, template.values, self.slopes, template.tile, template.tiles, self.trust),
            precision,
            start,
            (self.floor.T_camera_floor, self.camera.matrix, self.camera.lens),
            (self.prior, self.in_pixels),
            (c.least_scale, c.most_scale, c.tolerance_px, c.rounds),
            learned.variance_factor / small**2,
            (LIGHT.gain_spread, LIGHT.least_gain, LIGHT.most_gain),
        )
        if not converged or not np.isfinite(motion).all():
            return None
        in_view, inliers = shares(values, precision, weight / self.trust)
        least_correlation = max(c.least_correlation, c.kept_correlation * learned.correlation)
        if in_view < c.least_in_view or inliers < c.least_inliers or correlation < least_correlation:
            return None
        factor, scatter, registered = learned.variance_factor, learned.scatter, learned.registered + 1
        if learned.registered % c.inflated_every == 0:
            factor = self._variance_factor(information, weight, residual, scale)
            factor /= self._shared_texture(luma, motion, information, gain, weight, scale) ** 2
            scatter += self._scatter_px2((precision > 0) & (values >= 0), residual)
        usual = learned.correlation + (correlation - learned.correlation) / min(registered, 20)
        self.learned = Learned(usual, registered, factor, scatter, (weight, residual, scale))
        variance = scale * scale * factor
        whitened = np.linalg.inv(information / variance + np.eye(len(self.prior)))
        covariance: Array = np.asarray(whitened * np.outer(self.prior, self.prior), dtype=np.float64)
        std_px = self.std_px(covariance)
        too_faint = std_px > self.worst_std_px and small == 1
        return None if too_faint else Registered(motion, covariance, std_px)

    def _variance_factor(self, information: Array, weight: Array, residual: Array, scale: float) -> float:
        """Variance of the scores of clusters over that of independent residuals of this scale."""
        used = weight > 0
        count = int(self.cluster.max()) + 1
        _, scores = sums_of_clusters(self.cluster[used], count, self.slopes[used], (weight * residual)[used])
        inverse = np.linalg.inv(information + scale * scale * np.eye(len(information)))
        return float(max(np.sum(inverse * (scores.T @ scores)) / np.sum(inverse * information) / scale**2, 1.0))

    def _shared_texture(
        self, luma: Luma, motion: Array, information: Array, gain: Array, weight: Array, scale: float
    ) -> float:
        """Share of the template's information that the picture's own slopes confirm.

        The rest is noise of the first picture, whose slopes look like texture and hold nothing. The picture's slopes
        count as in the template's light: what less light takes from them is in the weights already.
        """
        assert self.template is not None
        camera, floor = moved_view(self.camera, self.floor, motion)
        target = replace(self.target, camera=camera, floor=floor)
        slopes = slopes_at(luma, target, np.zeros(3), self.template.points, self.template.pixel_m)
        used = (weight > 0) & np.isfinite(slopes).all(axis=1)
        seen = self._by_motion_of_view(np.where(used[:, None], slopes / gain[:, None], 0.0), self.template)[used]
        weighed = (self.slopes * weight[:, None])[used].T
        inverse = np.linalg.inv(information + scale * scale * np.eye(len(information)))
        shared = np.sum(inverse * (weighed @ seen)) / np.sum(inverse * (weighed @ self.slopes[used]))
        return float(np.clip(shared, CONSTANTS.least_shared, 1.0))

    @property
    def scattered_px(self) -> float:
        """Deviation by which places are displaced against the motion of all [px]; zero where noise may have done it."""
        displaced, noise = np.mean(self.learned.scatter or [(0.0, 0.0)], axis=0)
        return float(np.sqrt(displaced)) if displaced > CONSTANTS.beyond_noise**2 * noise else 0.0

    def _scatter_px2(self, seen: NDArray[np.bool_], residual: Array) -> tuple[tuple[float, float], ...]:
        """Variance by which clusters of points are displaced against the motion of all [px²]; none where too few show.

        It is that along the worse axis of the picture, without that of noise, which is given beside it. Points count by
        their slopes alone: a weight by residuals would keep those that fit.
        """
        # Their own light is fitted as well: the edge of a shadow leaves half a tile too bright, half too dark.
        assert self.template is not None
        by_light = np.column_stack([np.ones(len(residual)), self.template.values - self.template.values.mean()])
        slopes = np.hstack([self.slopes[:, 7:] / CONSTANTS.prior_px, by_light])[seen]
        count = np.bincount(self.cluster[seen], minlength=self.cluster.max() + 1)
        enough = count >= CONSTANTS.least_of_cluster
        if enough.sum() < CONSTANTS.least_clusters:
            return ()
        information, right = sums_of_clusters(self.cluster[seen], len(count), slopes, residual[seen])
        inverse = np.linalg.pinv(information[enough], hermitian=True)
        fitted = np.einsum("nij,nj->ni", inverse, right[enough])
        # Of what is left: what displaces a cluster is none of its noise.
        left = np.bincount(self.cluster[seen], residual[seen] ** 2, len(count))[enough]
        noise = (left - np.einsum("ni,ni->n", right[enough], fitted)) / (count[enough] - 4)
        by_noise = np.median(np.diagonal(inverse, axis1=1, axis2=2)[:, :2] * noise[:, None], axis=0)
        excess = np.median(fitted[:, :2] ** 2, axis=0) / MEDIAN_NORMAL**2 - by_noise
        return ((float(excess.max()), float(by_noise[excess.argmax()])),)

    def stretch_px(self) -> tuple[float, float]:
        """By how much the picture registered last is wider than the first, at its sides, and its deviation [px].

        No motion of the view does that.
        """
        weight, residual, scale = self.learned.last
        columns = np.column_stack([self.slopes, self.by_stretch])
        prior = np.diag([1.0] * len(self.prior) + [0.0])
        inverse = np.linalg.inv((columns * weight[:, None]).T @ columns + scale * scale * prior)
        stretch = -float(inverse[-1] @ (columns.T @ (weight * residual)))
        return stretch, scale * float(np.sqrt(self.learned.variance_factor * inverse[-1, -1]))

    def _set_blocks(self, luma: Luma, target: PlanarTarget) -> None:
        """Blocks of the first picture at half the resolution, round its corners on the floor."""
        small, reach = shrunk(luma, 2), CONSTANTS.block_px
        mask = np.zeros_like(small)
        for outline, value in ((target.body.top_corners_m, 255), *((o, 0) for o in target.body.obstructions)):
            pixels = (target.pixels(outline, np.zeros(3)) - 0.5) / 2
            cv2.fillPoly(mask, [np.round(pixels).astype(np.int32)], value)
        mask[:reach], mask[-reach - 1 :], mask[:, :reach], mask[:, -reach - 1 :] = 0, 0, 0, 0
        apart = np.sqrt(mask.size / CONSTANTS.blocks) / 1.5
        corners = cv2.goodFeaturesToTrack(small, CONSTANTS.blocks, 0.01, apart, mask=mask, blockSize=7)
        at = np.zeros((0, 2), dtype=int) if corners is None else np.round(corners.reshape(-1, 2)).astype(int)
        self.blocks = [small[v - reach : v + reach + 1, u - reach : u + reach + 1].copy() for u, v in at]
        self.block_places = to_plane(self.camera, self.floor, 2.0 * at + 0.5, 0.0)

    def blocks_in(self, luma: Luma, start: Array) -> Array:
        """Pixels (n, 2) of the blocks in a picture, near a motion ``start`` (9,); NaN where nothing looks like one."""
        small, expected = shrunk(luma, 2), self.pixels(self.block_places, start)
        found = [_search(small, block, (at - 0.5) / 2) for block, at in zip(self.blocks, expected, strict=True)]
        nowhere = np.full(2, np.nan)
        return np.array([nowhere if place is None else 2 * place + 0.5 for place in found]).reshape(-1, 2)

    def _by_blocks(self, luma: Luma, start: Array) -> Array | None:
        """A motion (9,) to which most blocks agree; None where too few do."""
        if len(self.blocks) < CONSTANTS.least_blocks:
            return None
        found = self.blocks_in(luma, start)
        seen = np.isfinite(found[:, 0])
        if seen.sum() < CONSTANTS.least_blocks:
            return None
        pixels, places = found[seen], self.block_places[seen]
        expected = self.pixels(places, start)
        _, inliers = cv2.estimateAffinePartial2D(expected, pixels, ransacReprojThreshold=CONSTANTS.block_agrees_px)
        agree = np.asarray(inliers).ravel() > 0
        if agree.sum() < max(CONSTANTS.least_blocks, 0.4 * len(agree)):
            return None
        motion = start.copy()
        for _ in range(4):
            misfit = (self.pixels(places[agree], motion) - pixels[agree]).ravel()
            steps = 1e-4 * np.diag(self.prior)
            J = np.stack([(self.pixels(places[agree], motion + s) - self.pixels(places[agree], motion - s)).ravel()
                          for s in steps], axis=1) / 2e-4  # fmt: skip
            motion -= self.prior * np.linalg.solve(J.T @ J + np.eye(len(steps)), J.T @ misfit + motion / self.prior)
        return motion

    def pixels(self, places: Array, motion: Array) -> Array:
        """Pixels (n, 2) of places (n, 2) on the floor after a ``motion`` (9,) of the view."""
        points = np.column_stack([places, np.zeros(len(places))])
        return project(*moved_view(self.camera, self.floor, motion), points)


def _correlations(small: Luma, block: Luma, at: Array) -> tuple[Array, tuple[int, int]] | None:
    """Correlations of a block with the places within reach of ``at`` (2,) in a halved picture, and the first of these.

    As far as the picture goes; None where it hardly goes that far.
    """
    reach = CONSTANTS.reach_px + CONSTANTS.block_px
    if not np.isfinite(at).all():
        return None
    u, v = np.round(at).astype(int)
    left, top = max(0, u - reach), max(0, v - reach)
    window = small[top : max(0, v + reach + 1), left : max(0, u + reach + 1)]
    if min(window.shape) <= 2 * CONSTANTS.block_px + 1:
        return None
    return np.asarray(cv2.matchTemplate(window, block, cv2.TM_CCOEFF_NORMED)), (left, top)


def _search(small: Luma, block: Luma, at: Array) -> Array | None:
    """Where a block is in a halved picture near ``at`` (2,); None where nothing looks like it."""
    found = _correlations(small, block, at)
    if found is None:
        return None
    fit, (left, top) = found
    _, best, _, (column, row) = cv2.minMaxLoc(fit)
    if best < CONSTANTS.block_fit:
        return None
    place = np.array([left + column, top + row], dtype=np.float64) + CONSTANTS.block_px
    if 0 < row < fit.shape[0] - 1 and 0 < column < fit.shape[1] - 1:
        # The top of the parabola through the best place and its neighbours.
        around = np.array([fit[row, column - 1 : column + 2], fit[row - 1 : row + 2, column]], dtype=np.float64)
        before, at, after = around.T
        place += 0.5 * (before - after) / np.minimum(before - 2 * at + after, -1e-9)
    return place


def _trust(luma: Luma, template: Template) -> Array:
    """Weights (n,) of a template's points: what is steeper than the floor's texture counts as if it were that steep.

    What a camera or an editor writes into all pictures, and black bars, have edges ten times as steep as a floor, and
    stand still while the view moves: squared, a few hold it. Marks on a floor without texture keep their weight.
    """
    steepness = np.linalg.norm(template.slopes[:, :2], axis=1) * template.pixel_m
    noise = float(np.median(np.abs(cv2.filter2D(luma, cv2.CV_16S, _ROUGH)))) / (MEDIAN_NORMAL * np.linalg.norm(_ROUGH))
    textured = steepness > max(CONSTANTS.least_slope, CONSTANTS.noise_slope * noise)
    if not textured.any():
        return np.ones(len(steepness))
    return np.asarray(np.minimum(1.0, np.median(steepness[textured]) / np.maximum(steepness, 1e-9)) ** 2)


def _visible_floor(camera: Camera, floor: Floor) -> Array | None:
    """Outline (8, 2) of the floor in the picture [m], a little inside its border; None where the horizon is in it."""
    (left, top), (right, bottom) = np.outer([CONSTANTS.inset, 1 - CONSTANTS.inset], camera.resolution_px)
    u, v = (left + right) / 2, (top + bottom) / 2
    border_u, border_v = [left, u, right, right, right, u, left, left], [top, top, top, v, bottom, bottom, bottom, v]
    outline = to_plane(camera, floor, np.column_stack([border_u, border_v]), 0.0)
    return outline if np.isfinite(outline).all() else None
