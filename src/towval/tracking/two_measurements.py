"""Texture and outline of a top measure the same pose: compared, they show errors that neither can see by itself.

A codec that quantises the texture away, or a lens that goes out of focus, moves a fit to the texture by more than its
residuals show: whatever is left of the texture agrees with some pose. The long edges of the top survive both. So the
outline is measured beside the texture, in every fifth picture, and in all while the two disagree. Their disagreement
over a second, beyond what the covariances of both explain, is added to the covariance of the texture's poses; no model
of the codec is needed. It may also be the outline that is wrong, where an edge of something else is taken for the
top's. So the texture's poses are kept unless those of the outline are smoother; the covariance is added in either case.
"""

import itertools
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array
from towval.model.compiling import compiled
from towval.model.geometry import compose, turned_covariance
from towval.model.tracks import stretches
from towval.tracking.noise import CONSTANTS as NOISE
from towval.tracking.noise import MEDIAN_CHI_SQUARED_3, about_quadratics, beyond
from towval.tracking.outline import OutlineFit, observe_outline
from towval.tracking.planar_target import PlanarTarget
from towval.tracking.pose import Measurement, Tracker, moved, step_between
from towval.tracking.template import Luma


@dataclass(frozen=True)
class TwoMeasurementsConstants:
    """Tuned constants of the comparison; lengths in pixels are measured on the planar target."""

    every: int = 5  # Pictures between looks at the outline while it agrees; all looks cost 2 % of the decoding.
    disagree: float = 3.0  # Deviations beyond which every picture is looked at,
    closely_s: float = 5.0  # [s] for so long: a codec that distorts one motion distorts the next,
    alone: float = 4.0  # Deviations of a single picture that disagrees: one in a thousand does by chance.
    moved_px: float = 0.5  # [px] and as long once the body has moved by so much.
    edge_std_px: float = 0.05  # [px] By which an edge may stand off the top's: 0.02 to 0.06 measured.
    worse: float = 2.0  # Times what the texture left where it was found first: right places leave half, wrong ones 6.
    led: float = 5.0  # Times the step between two outlines, for which they lead to where the next must be.
    sure_px: float = 0.15  # [px] Deviation of an outline that has found its edges: sharp ones give up to 0.1.
    window_s: float = 1.0  # [s] Over which the disagreement is averaged: bodies stop and go, focus hunts.
    least: int = 6  # Looks in a window, for a second moment to be known to a quarter.
    curve: int = 15  # Pictures through which the curve goes by which one of the two is told to be off,
    apart: float = 1.5  # Deviations from which on the two have parted,
    smoother: float = 2.0  # where the mean square of its distances is so many times the other's.


CONSTANTS = TwoMeasurementsConstants()

_NUMBERS = 15  # A look's row: picture, correction, covariance, size.
_LAST = 512  # Looks that say how large the outline usually is: the cost of a look does not grow with the video.


@dataclass(frozen=True)
class Looks:
    """Looks at an outline.

    ``picture`` (m,) numbers, ``correction`` (m, 3) from the texture's pose to the outline's, and its ``covariance``
    (m, 3, 3), both in the body frame; ``size`` (m, 2): length and width of the outline over the stated ones [m].
    """

    picture: Array
    correction: Array
    covariance: Array
    size: Array

    @property
    def spread(self) -> Array:
        """The covariance (m, 3, 3) with what the outline's size says of it."""
        # What the top was measured wrong by is the same in all pictures.
        return self.covariance + by_size(self.size - np.median(self.size, axis=0))


class EdgeWatch:
    """Looks at the outline of one body beside its texture."""

    def __init__(self, target: PlanarTarget):
        self.target, self.rows, self.observed, self.closely_until_s = target, array("d"), 0, -np.inf
        self.rests_at: Array | None = None
        self.seen_at: list[tuple[float, Array]] = []

    def look(
        self, picture: int, time_s: float, luma: Luma, found: Measurement, predicted: Array, tracker: Tracker, due: bool
    ) -> tuple[Measurement, OutlineFit | None, bool]:
        """Look at the outline of a body that the texture ``found``, and that was ``predicted`` (3,), where it is due.

        Returns what the texture says, sought again at the outline where the two disagreed; the outline, None where it
        was not looked at or is not found; and whether the two disagree still.
        """
        self.observed += 1
        if self.observed == 1:
            self.rests_at = found.pose
        elif self.rests_at is not None and self._moved(found.pose):
            # Coded pictures of a body at rest repeat each other: that they agree says nothing of those that follow.
            self.rests_at, self.closely_until_s = None, time_s + CONSTANTS.closely_s
        if not due and self.observed % CONSTANTS.every and time_s > self.closely_until_s:
            return found, None, False
        fit = self._outline(luma, found.pose, (found.pose, predicted)) or self._where_it_goes(time_s, luma, found.pose)
        if fit is None:
            return found, None, False
        apart = self._apart(found, fit)
        if apart > CONSTANTS.disagree:
            self.closely_until_s = time_s + CONSTANTS.closely_s
            place = compose(found.pose, fit.correction)
            again = tracker.measure(luma, place)
            # At an outline that is something else's, the texture is found with far more left over.
            if again is not None and again.residual > CONSTANTS.worse * found.residual:
                again = None
            nearer = None if again is None else self._outline(luma, again.pose, (place,))
            if again is not None and nearer is not None and self._apart(again, nearer) < apart:
                found, fit, apart = again, nearer, self._apart(again, nearer)
        self.rows.extend((picture, *fit.correction, *fit.covariance.ravel(), *fit.size))
        self.seen_at = [*self.seen_at[-1:], (time_s, compose(found.pose, fit.correction))]
        return found, fit, apart > CONSTANTS.disagree

    def _outline(self, luma: Luma, pose: Array, places: Sequence[Array]) -> OutlineFit | None:
        """The outline near the first of some places where its edges are sure, or else the surest, against a pose."""
        least_m = CONSTANTS.sure_px * self.target.metres_per_pixel(pose)
        surest, least = None, np.inf
        for wide, place in itertools.product((False, True), places):
            fit = observe_outline(luma, self.target, place, wide=wide)
            std_m = np.inf if fit is None else fit.largest_std_m
            if fit is not None and std_m < least:
                surest = replace(fit, correction=step_between(pose, compose(place, fit.correction)))
                least = std_m
            if least < least_m:
                break
        return surest

    def _where_it_goes(self, time_s: float, luma: Luma, pose: Array) -> OutlineFit | None:
        """The outline where the last two lead, against a pose: a texture far astray takes the prediction with it."""
        if len(self.seen_at) < 2:
            return None
        (before_s, before), (last_s, last) = self.seen_at
        if time_s - last_s > CONSTANTS.led * (last_s - before_s):
            return None
        step = step_between(before, last) * (time_s - last_s) / (last_s - before_s)
        return self._outline(luma, pose, (moved(last, step),))

    def _moved(self, pose: Array) -> bool:
        least_m = CONSTANTS.moved_px * self.target.metres_per_pixel(pose)
        return self.rests_at is not None and self.target.apart_m(pose, self.rests_at) > least_m

    def _apart(self, found: Measurement, fit: OutlineFit) -> float:
        """Distance of texture and outline, in deviations."""
        sizes = np.array(self.rows[-_LAST * _NUMBERS :]).reshape(-1, _NUMBERS)[:, 13:]
        other = by_size(fit.size - _medians(sizes)) if len(sizes) else np.zeros((3, 3))
        # The first picture's outline, from which both are counted, is as uncertain as this one.
        of_outline = 2 * fit.covariance + other + edges(self.target, found.pose)
        expected = turned_covariance(found.covariance, -found.pose[2]) + of_outline
        return float(np.sqrt(fit.correction @ np.linalg.solve(expected, fit.correction) / 3))

    def looks(self) -> Looks:
        """All looks so far."""
        rows = np.array(self.rows).reshape(-1, _NUMBERS)
        return Looks(rows[:, 0].astype(int), rows[:, 1:4], rows[:, 4:13].reshape(-1, 3, 3), rows[:, 13:])

    def usual_size(self) -> Array:
        """By how much length and width (2,) of the outline are usually found other than stated [m]; zero if never."""
        sizes = self.looks().size
        return np.asarray(np.median(sizes, axis=0)) if len(sizes) else np.zeros(2)


@compiled()
def _medians(columns: Array) -> Array:
    """Medians (2,) of two columns (n, 2)."""
    return np.array([np.median(columns[:, 0].copy()), np.median(columns[:, 1].copy())])


def by_size(off: Array) -> Array:
    """Covariance (..., 3, 3) of outlines that are longer and wider than usual by ``off`` (..., 2) [m].

    Where something else is taken for one of two opposite edges, the outline is off by half as much as it is too long.
    """
    covariance = np.zeros((*off.shape[:-1], 3, 3))
    covariance[..., [0, 1], [0, 1]] = (off / 2) ** 2
    return covariance


def edges(target: PlanarTarget, pose: Array) -> Array:
    """Covariance (3, 3) of an outline, of edges that stand off the top's."""
    std_m = CONSTANTS.edge_std_px * target.metres_per_pixel(pose)
    return np.diag(np.square([std_m, std_m, std_m / target.reach_m]))


def jumps(time_s: Array, pose: Array, looks: Looks) -> tuple[Array, Array, Array]:
    """How far the texture's and the outline's poses are from smooth curves through five pictures (n, 3) each.

    The last (n,) is the variance that independent noise leaves in them; NaN where not all five were looked at.
    """
    of_outline = np.full_like(pose, np.nan)
    of_outline[looks.picture] = compose(pose[looks.picture], looks.correction)
    by_texture, by_outline, gain = np.full_like(pose, np.nan), np.full_like(pose, np.nan), np.full(len(pose), np.nan)
    by, rows, left = about_quadratics(time_s, np.where(np.isfinite(of_outline), pose, np.nan), 5)
    by_texture[rows], gain[rows] = by, left
    by_outline[rows] = about_quadratics(time_s, of_outline, 5)[0]
    return by_texture, by_outline, gain


def outline_noise(pose: Array, looks: Looks, by_texture: Array, by_outline: Array, gain: Array) -> float:
    """Variance of the outline's pose from picture to picture over the stated one, from :func:`jumps`.

    What the motion does is the same in both and cancels in the product of the outline's jumps with the difference of
    the two (three-cornered hat). One where not enough successive pictures were looked at.
    """
    rows = looks.picture[np.isfinite(gain[looks.picture])]
    if len(rows) < NOISE.least_windows:
        return 1.0
    stated = np.zeros((len(pose), 3, 3))
    stated[looks.picture] = turned_covariance(looks.spread, pose[looks.picture, 2])
    weighed = np.linalg.solve(stated[rows] * gain[rows, None, None], (by_outline - by_texture)[rows, :, None])[..., 0]
    product = np.einsum("nj,nj->n", by_outline[rows], weighed)
    return float(max(np.median(product) / MEDIAN_CHI_SQUARED_3, 1.0))


def texture_excess(time_s: Array, apart: Array, expected: Array, looks: Looks) -> Array:
    """Covariance (n, 3, 3) in the body frame by which the texture's exceeds what is stated, around each time (n,).

    ``apart`` (m, 3): differences of outline and texture; ``expected`` (m, 3, 3): what both state for them.
    """
    if len(apart) < CONSTANTS.least:
        return np.zeros((len(time_s), 3, 3))
    around = _around(time_s, time_s[looks.picture])
    bounded = _bounded(apart, expected)
    squares = bounded[:, :, None] * bounded[:, None, :]
    # What shifts an outline (a strip of its side, a line of the floor beside it) stays for a while: many looks are one.
    return beyond(_means(squares, *around), _means(expected, *around), CONSTANTS.disagree**2)


def outline_excess(time_s: Array, pose: Array, apart: Array, expected: Array, of_outline: Array, looks: Looks) -> Array:
    """Covariance (n, 3, 3) in the body frame by which the outline's exceeds what is stated, around each time (n,).

    An outline that hops between two edges is rough where the texture, on the same motion, is smooth: then it is the
    one that is off, by what the two disagree by from picture to picture. ``of_outline`` (m, 3, 3) is its share of
    ``expected``; the rest is as in :func:`texture_excess`.
    """
    at, bounded = looks.picture, replace(looks, correction=_bounded(apart, expected))
    by_texture, by_outline, gain = jumps(time_s, pose, bounded)
    known = np.isfinite(gain[at])
    if known.sum() < CONSTANTS.least:
        return np.zeros((len(time_s), 3, 3))
    rows, squares = at[known], of_outline.copy()
    hop = (by_outline - by_texture)[rows] / np.sqrt(gain[rows])[:, None]
    squares[known] = turned_covariance(hop[:, :, None] * hop[:, None, :], -pose[rows, 2])
    low, high = _around(time_s, time_s[at])
    excess = beyond(_means(squares, low, high), _means(of_outline, low, high), CONSTANTS.smoother)
    rough = np.column_stack([np.sum(np.nan_to_num(each[at, :2]) ** 2, axis=1) for each in (by_texture, by_outline)])
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(rough, axis=0)])
    of_texture, of_edges = (total[high] - total[low]).T
    return np.where((of_edges > CONSTANTS.smoother * of_texture)[:, None, None], excess, 0.0)


def _around(time_s: Array, at_s: Array) -> tuple[Array, Array]:
    """First and past-the-last look of those at times (m,) in a window about each of other times (n,)."""
    middle, half_s, half = np.searchsorted(at_s, time_s), CONSTANTS.window_s / 2, CONSTANTS.least // 2
    low = np.minimum(np.searchsorted(at_s, time_s - half_s), middle - half)
    high = np.maximum(np.searchsorted(at_s, time_s + half_s), middle + half)
    low = np.clip(low, 0, len(at_s) - CONSTANTS.least)
    return low, np.clip(high, low + CONSTANTS.least, len(at_s))


def _bounded(apart: Array, expected: Array) -> Array:
    """Differences (m, 3) of which a single picture counts for those around it no more than they do."""
    size = _sizes(apart, expected)
    beside = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(size, 2, mode="edge"), 5), axis=1)
    return np.asarray(apart * np.minimum(1.0, 2 * beside / np.maximum(size, 1e-12))[:, None])


def alone(apart: Array, expected: Array) -> Array:
    """The same (m, 3, 3) for single pictures, in which either the texture or the outline is wrong."""
    return beyond(apart[:, :, None] * apart[:, None, :], expected, CONSTANTS.alone**2)


def _sizes(apart: Array, expected: Array) -> Array:
    """Sizes (m,) of differences (m, 3) in their deviations."""
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", apart, np.linalg.solve(expected, apart[..., None])[..., 0])))


def _means(values: Array, low: Array, high: Array) -> Array:
    total = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(values, axis=0)])
    return np.asarray((total[high] - total[low]) / (high - low)[:, None, None])


def steps_to_smoother(
    time_s: Array, pose: Array, looks: Looks, apart: Array, of_outline: Array, far: Array
) -> tuple[Array, Array]:
    """Steps (n, 3) from the texture's poses to the outline's, while the texture is what is off; covariance (n, 3, 3).

    Whatever a body does is in both measurements: of two that disagree for a while the one is off whose poses are
    farther from smooth curves, from before they part until they meet again. ``apart`` (m, 3) are the differences,
    ``of_outline`` (m, 3, 3) their covariance by the outline, ``far`` (m,) their size in deviations.
    """
    at = looks.picture
    by_outline = np.full_like(pose, np.nan)
    by_outline[at] = compose(pose[at], apart)
    both = np.where(np.isfinite(by_outline), pose, np.nan), by_outline
    (texture, rows, _), (outline, _, _) = (about_quadratics(time_s, each, CONSTANTS.curve) for each in both)
    squares = np.column_stack([np.sum(off[:, :2] ** 2, axis=1) for off in (texture, outline)])
    total, steps = np.concatenate([np.zeros((1, 2)), np.cumsum(squares, axis=0)]), np.zeros_like(pose)
    spread, (known, of_known) = np.zeros((len(pose), 3, 3)), steps_to_outline(apart, of_outline)
    for first, last in stretches(far > CONSTANTS.apart):
        ends = np.searchsorted(rows, [at[first] - CONSTANTS.curve // 2, at[last] + CONSTANTS.curve // 2 + 1])
        of_texture, of_edges = total[ends[1]] - total[ends[0]]
        if of_texture > CONSTANTS.smoother * of_edges:
            pictures, seen = np.arange(at[first], at[last] + 1), at[first : last + 1]
            steps[pictures] = np.column_stack([np.interp(pictures, seen, one) for one in known[first : last + 1].T])
            spread[pictures] = of_known[first + np.searchsorted(seen, pictures)]
    return steps, spread


def steps_to_outline(apart: Array, of_outline: Array) -> tuple[Array, Array]:
    """Steps (m, 3) from the texture's poses to the outline's: the part of ``apart`` (m, 3) that the outline can know.

    With the covariance (m, 3, 3) that the outline's brings into them.

    ``of_outline`` (m, 3, 3): covariance of the outline. In a direction that it leaves open (the turn of a disc) the
    texture's pose stays.
    """
    look, half = np.arange(len(apart)), CONSTANTS.curve // 2
    around = np.maximum(look - half, 0), np.minimum(look + half + 1, len(apart))
    seen = _means((apart**2)[:, :, None] * np.eye(3), *around)
    gain = seen @ np.linalg.inv(seen + of_outline)
    return np.einsum("nij,nj->ni", gain, apart), gain @ of_outline @ gain.transpose(0, 2, 1)


@dataclass(frozen=True)
class Compared:
    """What the outline says of the texture.

    ``excess`` (n, 3, 3): covariance of the texture's poses beyond what it states; ``lone`` (n, 3, 3) that of pictures
    which disagree by themselves, where it is not known what is off; ``steps`` (n, 3) to poses that are the outline's
    where the texture's are off, and ``of_steps`` (n, 3, 3) their covariance; ``strayed`` (3, 3): mean square by which
    the outline stood elsewhere while the texture was kept; ``hops`` (n, 3, 3): covariance of the outline beyond what it
    states, where it hops. All are in the body frame.
    """

    excess: Array
    lone: Array
    steps: Array
    of_steps: Array
    strayed: Array
    hops: Array

    def widened(self, pose: Array, covariance: Array) -> Array:
        """Covariances (n, 3, 3) of the texture's poses (n, 3) in the floor frame, with what the outline adds."""
        return covariance + turned_covariance(self.excess + self.lone + self.of_steps, pose[:, 2])


def compared(time_s: Array, pose: Array, covariance: Array, looks: Looks, of_edges: Array) -> Compared:
    """Compare the texture's poses (n, 3) and covariances (n, 3, 3) with looks at the outline.

    ``of_edges`` (3, 3): covariance of an outline whose edges stand off the top's.
    """
    at = looks.picture
    by_texture, by_outline, gain = jumps(time_s, pose, looks)
    of_outline = outline_noise(pose, looks, by_texture, by_outline, gain) * looks.spread + of_edges
    expected = turned_covariance(covariance[at], -pose[at, 2]) + of_outline
    apart = looks.correction - np.median(looks.correction, axis=0)
    for_a_while = texture_excess(time_s, apart, expected, looks)
    far = _sizes(apart, expected)
    hops = outline_excess(time_s, pose, apart, expected, of_outline, looks)
    of_outline, expected = of_outline + hops[at], expected + hops[at]
    excess = texture_excess(time_s, apart, expected, looks) if hops.any() else for_a_while.copy()
    single = alone(apart, expected + excess[at])
    # What jumps in a picture that disagrees by itself is off; it shows where the pictures beside were looked at, too.
    of_texture, of_edge = (np.linalg.norm(one[at, :2], axis=1)[:, None, None] for one in (by_texture, by_outline))
    excess[at] += np.where(of_texture > of_edge, single, 0.0)
    lone = np.zeros_like(excess)
    lone[at] = np.where(np.isfinite(gain[at])[:, None, None], 0.0, single)
    steps, of_steps = steps_to_smoother(time_s, pose, looks, apart, of_outline, far)
    kept = (far > CONSTANTS.apart) & ~steps[at].any(axis=1)
    # An outline that takes other edges for the top's for a while may have done so in the first picture.
    strayed = np.sum(for_a_while[at[kept]], axis=0) / len(at)
    return Compared(excess, lone, steps, of_steps, strayed, hops)
