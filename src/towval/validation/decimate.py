"""Stage decimate: reduce densely packed poses to those that the measurement noise can distinguish.

Where a rover stands or creeps, its track collects poses that differ by noise alone. A pause becomes one pose with two
ends; elsewhere a C1 cubic through as few kept times as possible replaces the poses. The rule, its bound and its limits
are in docs/decimation.md.
"""

import itertools
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

from towval.model import Array, DecimatedTrack, Finding, Track
from towval.model.conventions import FEWEST_FRAMES
from towval.model.errors import InputError, RefusedError
from towval.model.findings import finding
from towval.validation.bridges import bridge_findings

_MAD_TO_STD = 1.4826
_THIRD_DIFFERENCE_GAIN = np.sqrt(20.0)
"""Standard deviation of the third difference (1, −3, 3, −1) of white noise of deviation one."""

_REST_FRAMES = 27
"""Frames of the shortest rest: 3 deviations of its slope then are 3 √(12/27) = 2 deviations of one pose over its
length, which is the largest creep that can hide in it."""

_SHORTEST_STRETCH = 3
"""Frames between two kept times below which a stretch is not cut further."""

_WEAK = 1e-6
"""Weight of a slope over three frames, as a share of what it is worth: it counts where the curve says nothing."""

_WANDERING = 5.0
"""Largest deviation that counts, as a multiple of that of white noise: on real encoders both differ by 1.7 to 2.6."""

_LEAST_STATED = 0.03
"""Share of the stated deviation that counts at least: poses that were computed have no noise to be read off."""

_MOST_STATED = 6.0
"""White noise that counts at most, in stated deviations: what sticks and slips between few frames a second scatters as
noise does, by a hundred; no track of the camera faults scatters by more than three."""

_RUN = 4
_RUN_BOUND = 2.0
"""The mean misfit of any 4 frames in a row may be 2 deviations of one frame, which is 4 deviations of the mean."""


@dataclass(frozen=True)
class DecimateSettings:
    """Keys of ``config["decimate"]``.

    The mean squared misfit of a stretch between two kept times may exceed one by ``excess`` standard deviations of its
    own scatter. ``pause_s`` is the shortest rest that counts as a pause [s], and never less than 27 frames.
    """

    excess: float = 3.0
    pause_s: float = 0.3

    def __post_init__(self) -> None:
        if not self.excess > 0:
            raise InputError("decimate.excess is out of range", got=self.excess, allowed="above 0")
        if not self.pause_s > 0:
            raise InputError("decimate.pause_s is out of range", got=self.pause_s, allowed="above 0 s")


def decimate(track: Track, settings: DecimateSettings | None = None) -> DecimatedTrack:
    """Reduce a track to the poses that it needs.

    Lost and coasting frames are left out, and the curve bridges them. Kept times are those of measured frames, with
    smoothed poses and their rates. Between two of them the mean squared deviation of the measured poses, in units of
    their noise, is at most ``1 + excess √(2/m)``, with m the number of measured coordinates there, and the mean
    deviation of any four poses in a row at most 2. A stretch of three frames is not cut further.

    `RefusedError` where fewer than 8 frames were seen: too few to estimate the noise.
    """
    settings = settings or DecimateSettings()
    seen = np.flatnonzero(track.seen)
    if len(seen) < FEWEST_FRAMES:
        raise RefusedError(
            f"the {track.body} track is too short to decimate",
            got=f"{len(seen)} tracked frames",
            allowed=f"at least {FEWEST_FRAMES}",
            remedy="look at the stage track's findings for this run",
        )
    time, pose = track.time_s[seen], track.pose[seen]
    reported = track.std[seen]
    stated = np.median(reported, axis=0)
    # A deviation of zero states nothing: then what the track scatters by counts.
    white = np.minimum(noise_of(time, pose, reported), np.where(stated > 0, _MOST_STATED * stated, np.inf))
    pauses = _surely(find_pauses(time, pose, frame_sigma(reported, white), settings.pause_s), len(time))
    moving = np.ones(len(time), dtype=bool)
    for first, last in pauses:
        moving[first : last + 1] = False
    if np.count_nonzero(moving) < FEWEST_FRAMES:
        moving[:] = True
    noise = np.maximum(white, noise_in_motion(time[moving], pose[moving], reported[moving]))
    sigma = frame_sigma(reported, noise)
    fit, kept = _fewest_knots(time, pose, sigma, pauses, settings.excess)
    residual = (pose - fit.values(time)) / sigma
    thin = DecimatedTrack(
        body=track.body,
        time_s=time[kept],
        pose=fit.nodes[:, 0],
        rate=fit.nodes[:, 1],
        covariance=fit.covariance,
        noise=noise,
        pauses=np.array([[time[i], time[j]] for i, j in pauses]).reshape(-1, 2),
        frames=len(seen),
        misfit=np.sqrt(np.mean(residual**2, axis=0)),
        findings=_findings(track, seen, kept, residual),
    )
    return replace(thin, findings=(*thin.findings, *bridge_findings(thin, time)))


def noise_of(time: Array, pose: Array, reported: Array) -> Array:
    """Standard deviation of one pose (3,) [m, m, rad] apart from what neighbours share, estimated from the track.

    Smooth motion nearly cancels in third differences, noise does not: their median absolute value, scaled for white
    noise, is the estimate. Where this median is zero (a track without noise), the smallest reported deviation is used,
    so that no division by zero follows. Differences over gaps longer than 1.5 typical steps are left out.
    """
    step = np.diff(time)
    even = np.abs(step - np.median(step)) < 0.5 * np.median(step)
    usable = even[:-2] & even[1:-1] & even[2:]
    third = np.diff(pose, n=3, axis=0)[usable if usable.any() else slice(None)]
    white = _MAD_TO_STD * np.median(np.abs(third), axis=0) / _THIRD_DIFFERENCE_GAIN
    floor = np.maximum(np.nanmin(reported, axis=0), 1e-9)
    return np.asarray(np.where(white > 0, white, floor))


def noise_in_motion(time: Array, pose: Array, reported: Array) -> Array:
    """Standard deviation of one pose (3,) [m, m, rad] of a moving body, from poses (n, 3) and those reported (n, 3).

    Errors of a tracker also wander as a body moves over the pixels: neighbours share them, so differences do not show
    them, and a curve that follows them has accelerations that never were. The tracker states them; but what it states
    may also hold what is no noise, such as doubtful times: so it counts up to some times the white noise, and no
    tracker is thirty times better than it states.
    """
    stated = np.median(reported, axis=0)
    return np.minimum(stated, np.maximum(_WANDERING * noise_of(time, pose, reported), _LEAST_STATED * stated))


def frame_sigma(reported: Array, noise: Array) -> Array:
    """Deviation of each pose (n, 3): ``noise`` (3,), larger where the tracker reports that a frame was worse."""
    typical = np.median(reported, axis=0)
    relative = np.where(typical > 0, reported / np.where(typical > 0, typical, 1.0), 1.0)
    return noise * np.maximum(relative, 1.0)


def find_pauses(time: Array, pose: Array, sigma: Array, shortest: float) -> list[tuple[int, int]]:
    """Stretches in which the body stands still: index pairs (first, last), in order and without overlap.

    A stretch rests when one constant pose explains it: its mean squared misfit is within 3 deviations of one, and a
    straight line explains it no better (slope within 3 deviations of zero, in each coordinate). A stretch of the
    shortest length that passes is grown while both tests hold.
    """
    n = len(time)
    pauses: list[tuple[int, int]] = []
    first = 0
    while first < n - 1:
        last = int(np.searchsorted(time, time[first] + shortest - 1e-9))
        last = max(last, first + _REST_FRAMES - 1)
        if last >= n:
            break
        if not _rests(time, pose, sigma, first, last):
            first += 1
            continue
        last = _farthest(partial(_rests, time, pose, sigma, first), last, last - first, n - 1)
        pauses.append((first, last))
        first = last + 1
    return _without_creep(pauses)


def _without_creep(pauses: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Rests that follow each other without a break are one slow motion: only the longest of such a chain is kept."""
    chains: list[list[tuple[int, int]]] = []
    for pause in pauses:
        if chains and pause[0] - chains[-1][-1][1] <= _SHORTEST_STRETCH:
            chains[-1].append(pause)
        else:
            chains.append([pause])
    return [max(chain, key=lambda pause: pause[1] - pause[0]) for chain in chains]


def _surely(pauses: list[tuple[int, int]], frames: int) -> list[tuple[int, int]]:
    """Rests without the frames at their ends in which the body may move already: four must disagree to end a rest.

    A curve that rests too long has to catch up at once, with rates several times as wrong. A rest at the beginning or
    the end of the track keeps that end.
    """
    return [
        (first + _RUN if first > 0 else first, last - _RUN if last < frames - 1 else last) for first, last in pauses
    ]


def _farthest(holds: Callable[[int], bool], last: int, step: int, limit: int) -> int:
    """The last index, up to a limit, at which something holds that does at ``last``: doubling steps, then halving."""
    while step >= 1:
        if last + step <= limit and holds(last + step):
            last, step = last + step, 2 * step
        else:
            step //= 2
    return last


def _rests(time: Array, pose: Array, sigma: Array, first: int, last: int) -> bool:
    t, p = time[first : last + 1], pose[first : last + 1]
    weight = sigma[first : last + 1] ** -2.0
    mean = np.sum(weight * p, axis=0) / weight.sum(axis=0)
    deviation = p - mean
    m = deviation.size
    if np.mean(weight * deviation**2) > 1 + 3 * np.sqrt(2 / m):
        return False
    # The newest poses must agree too: the start of a motion is diluted in the mean of a long rest.
    tail = slice(-_RUN, None)
    if np.any(np.abs(deviation[tail].mean(axis=0)) > 4 / np.sqrt(weight[tail].sum(axis=0))):
        return False
    centred = t[:, None] - np.sum(weight * t[:, None], axis=0) / weight.sum(axis=0)
    information = np.sum(weight * centred**2, axis=0)
    slope = np.sum(weight * centred * deviation, axis=0) / information
    return bool(np.all(np.abs(slope) * np.sqrt(information) <= 3))


@dataclass(frozen=True)
class _Fit:
    """A C1 cubic by weighted least squares: knots (m,), nodes (m, 2, 3) of value and rate.

    ``unknowns`` (m,): index of each value's unknown; ``factors`` (3, 4, u): banded Cholesky factors of the equations.
    """

    knots: Array
    nodes: Array
    unknowns: NDArray[np.intp]
    factors: Array

    @property
    def covariance(self) -> Array:
        """Covariances (m, 3, 3) of the values."""
        variance = np.array([_diagonal_of_inverse(factor)[self.unknowns] for factor in self.factors])
        return np.asarray(variance.T[:, :, None] * np.eye(3))

    def values(self, time: Array) -> Array:
        cell, shares = hermite_shares(self.knots, time)
        around = np.concatenate([self.nodes[cell], self.nodes[cell + 1]], axis=1)
        return np.asarray(np.einsum("nk,nkc->nc", shares, around))


def hermite_shares(knots: Array, time: Array) -> tuple[NDArray[np.intp], Array]:
    """The cell (n,) of each time, and the weights (n, 4) of value and rate at its first and last knot in the cubic."""
    cell = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    width = knots[cell + 1] - knots[cell]
    s = (time - knots[cell]) / width
    shares = [(1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2 * width, s**2 * (3 - 2 * s), s**2 * (s - 1) * width]
    return cell, np.stack(shares, axis=1)


def _unknowns(kept: list[int], pauses: list[tuple[int, int]]) -> tuple[NDArray[np.intp], Array]:
    """Indices (m, 2) of the unknowns of value and rate of each knot, and factors on them (m, 2), 0 for a rate at rest.

    Both ends of a pause share one value.
    """
    resting = {index for pause in pauses for index in pause}
    shared = {last for _, last in pauses}
    own = np.array([(index not in shared, index not in resting) for index in kept])
    return np.cumsum(own).reshape(-1, 2) - 1, np.stack([np.ones(len(kept)), own[:, 1]], axis=1)


def _fit(time: Array, pose: Array, sigma: Array, kept: list[int], pauses: list[tuple[int, int]]) -> _Fit:
    """Fit all knots jointly. A pose depends on four successive unknowns: the equations are banded, the cost linear."""
    knots = time[kept]
    unknowns, has = _unknowns(kept, pauses)
    cell, shares = hermite_shares(knots, time)
    concerned = np.concatenate([unknowns[cell], unknowns[cell + 1]], axis=1)
    shares *= np.concatenate([has[cell], has[cell + 1]], axis=1)
    nodes = np.empty((len(kept), 2, 3))
    factors = []
    free = has[:, 1] > 0
    rates, slopes = unknowns[free, 1], np.gradient(pose, time, axis=0)[kept][free]
    weak = 2 * _WEAK * (np.median(np.diff(time)) / sigma[kept][free]) ** 2
    for c in range(3):
        weighted = shares / sigma[:, c : c + 1]
        band, right = normal_band(concerned, weighted, concerned.max() + 1), np.zeros(concerned.max() + 1)
        np.add.at(right, concerned, weighted * (pose[:, c] / sigma[:, c])[:, None])
        # Stretches with fewer poses than unknowns leave rates undetermined, which swing from one to the next; a weak
        # pull to what three frames say fixes them.
        band[0, rates] += weak[:, c]
        right[rates] += weak[:, c] * slopes[:, c]
        factor = cholesky_banded(band, lower=True)
        nodes[:, :, c] = cho_solve_banded((factor, True), right)[unknowns] * has
        factors.append(factor)
    return _Fit(knots, nodes, unknowns[:, 0], np.array(factors))


def normal_band(concerned: NDArray[np.intp], weights: Array, count: int) -> Array:
    """Lower band (k, count) of the normal equations of rows that depend on k successive unknowns.

    ``concerned`` (n, k): the unknowns of each row; ``weights`` (n, k) on them; ``count`` of all unknowns.
    """
    width = weights.shape[1]
    band = np.zeros((width, count))
    for one, other in itertools.product(range(width), repeat=2):
        below = concerned[:, one] - concerned[:, other]
        lower = below >= 0
        np.add.at(band, (below[lower], concerned[lower, other]), (weights[:, one] * weights[:, other])[lower])
    return band


def _diagonal_of_inverse(factor: Array) -> Array:
    """Diagonal (n,) of the inverse of a matrix from the band (width, n) of its lower Cholesky factor.

    SOURCE: K. Takahashi, J. Fagan, M. Chen, *Formation of a sparse bus impedance matrix*, PICA (1973): within the band
    the inverse follows from the factor alone, from the last column to the first.
    """
    # Python's own numbers, which are fastest for single operations: importing a compiler would take longer.
    (width, n), columns = factor.shape, factor.T.tolist()
    inverse = [[0.0] * width for _ in range(n + width)]  # by column, each downwards from the diagonal
    for column in range(n - 1, -1, -1):
        own = columns[column]
        for below in range(width - 1, -1, -1):
            total = 1.0 / own[0] if below == 0 else 0.0
            for k in range(1, min(width, n - column)):
                total -= own[k] * inverse[column + min(below, k)][abs(below - k)]
            inverse[column][below] = total / own[0]
    return np.array([column[0] for column in inverse[:n]])


def _fewest_knots(
    time: Array, pose: Array, sigma: Array, pauses: list[tuple[int, int]], excess: float
) -> tuple[_Fit, NDArray[np.int64]]:
    """Kept frames, as few as a greedy search finds, with which one C1 cubic keeps the bound in every stretch.

    From the left, stretches are made as long as a separate cubic allows; the joint fit, whose pieces must also meet
    with the same rate, is then cut where it exceeds the bound.
    """
    kept = _longest_stretches(time, pose, sigma, pauses, excess)
    resting = {first for first, _ in pauses}
    while True:
        fit = _fit(time, pose, sigma, kept, pauses)
        misfit = (pose - fit.values(time)) / sigma
        cuts = [
            (i + j) // 2
            for i, j in pairwise(kept)
            if i not in resting and j - i >= _SHORTEST_STRETCH and not _within_bound(misfit[i : j + 1], excess)
        ]
        if not cuts:
            return fit, np.array(kept)
        kept = sorted({*kept, *cuts})


def _longest_stretches(
    time: Array, pose: Array, sigma: Array, pauses: list[tuple[int, int]], excess: float
) -> list[int]:
    """Frames between which one cubic, free at both ends, explains the poses; each pause is one such stretch."""
    ends = dict(pauses)
    starts = [*sorted(ends), len(time) - 1]
    kept = [0]
    while kept[-1] < len(time) - 1:
        first = kept[-1]
        if first in ends:
            kept.append(ends[first])
            continue
        limit = starts[bisect_right(starts, first)]
        holds = partial(_is_one_cubic, time, pose, sigma, excess, first)
        kept.append(_farthest(holds, min(first + _SHORTEST_STRETCH, limit), _SHORTEST_STRETCH, limit))
    return kept


def _is_one_cubic(time: Array, pose: Array, sigma: Array, excess: float, first: int, last: int) -> bool:
    """Whether one cubic explains the poses from the first frame to the last."""
    stretch = slice(first, last + 1)
    return _within_bound(_cubic_misfit(time[stretch], pose[stretch], sigma[stretch]), excess)


def _cubic_misfit(time: Array, pose: Array, sigma: Array) -> Array:
    """Deviations (n, 3) of poses from their own least-squares cubic, in units of their noise."""
    basis = np.vander((time - time[0]) / (time[-1] - time[0]), 4)
    misfit = np.empty_like(pose)
    for c in range(3):
        weighted = basis / sigma[:, c : c + 1]
        target = pose[:, c] / sigma[:, c]
        misfit[:, c] = target - weighted @ np.linalg.lstsq(weighted, target, rcond=None)[0]
    return misfit


def _within_bound(misfit: Array, excess: float) -> bool:
    """Whether a stretch's misfits (n, 3), in units of noise, keep the bounds over all and over each run of frames."""
    if np.mean(misfit**2) > 1 + excess * np.sqrt(2 / misfit.size):
        return False
    if len(misfit) < _RUN:
        return True
    total = np.cumsum(np.vstack([np.zeros(3), misfit]), axis=0)
    return bool(np.abs(total[_RUN:] - total[:-_RUN]).max() / _RUN <= _RUN_BOUND)


def _findings(track: Track, seen: NDArray[np.int64], kept: NDArray[np.int64], residual: Array) -> tuple[Finding, ...]:
    findings = [finding("decimated", body=track.body, kept=len(kept), frames=len(seen))]
    worst = float(np.abs(residual).max())
    if worst > 6:
        t = track.time_s[seen][np.abs(residual).max(axis=1).argmax()]
        findings.append(finding("decimate_outlier", body=track.body, time_s=t, deviations=worst))
    missing = np.ptp(seen) + 1 - len(seen)
    if missing:
        longest = np.diff(track.time_s[seen]).max()
        findings.append(finding("decimate_bridged", body=track.body, count=missing, gap_s=longest))
    return tuple(findings)
