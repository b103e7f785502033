"""Whether the stamps of a video's pictures can be true: bodies do not jump together at one picture.

A picture that was lost under evenly written stamps doubles the step of every body at once, a repeated picture makes it
vanish, and wrong stamps stretch it, while the motion before and after goes on as it was; one that is frozen for a while
shows a rest, and a leap at its end. One body may do that (a wheel slips, friction sticks); all that move at the same
picture, by the same share, do not.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Finding, Stamp, Track, TrackStatus
from towval.model.findings import finding
from towval.model.tracks import stretches
from towval.tracking.frozen import frozen_at_the_end
from towval.tracking.late import delayed
from towval.tracking.near_losses import SIDE, lost_in_two, misfit
from towval.tracking.noise import about_quadratics


@dataclass(frozen=True)
class StampConstants:
    """Tuned constants of the check of the stamps."""

    beside: int = 3  # Steps on each side that say how fast a body moves.
    steady: float = 0.25  # Change of the velocity from one side to the other, of its size, where a jump can be told.
    least_deviations: float = 25.0  # Of a pose, in a step: smaller ones are not compared.
    least_noise: float = 0.1  # Of the stated deviation of a pose: a still picture shows none.
    jump: float = 0.3  # Of a step, beyond which it is a jump; shaking stamps reach 0.25.
    agree: float = 0.2  # Difference of this share between bodies.
    evenly: float = 3.0  # Deviations by which a slow body misses the jumps of another one that it goes on through.
    creeps: float = 5.0  # Deviations of a pose by which a slow body is sure to have moved.
    repeated: float = 0.1  # Of a step, below which the picture was repeated.
    leap: float = 3.0  # Of a body's usual speed, at which it leaves a rest only where the picture had been frozen.
    dropped: float = 10.0  # Times as well that all bodies fit a smooth curve with a step more: 7 is the most by chance,
    unlike: float = 25.0  # where without it they miss it by so many times their usual misfit, squared.
    goes_on: float = 0.4  # Of the way of three steps after two losses, before them: a start from rest makes 0.1 to 0.3.
    odd: float = 0.1  # Of a step, by which its stamps miss a whole number of usual ones: bodies are asked
    dropped_odd: float = 5.0  # whether that whole number fits them so many times as well,
    unlike_odd: float = 6.0  # at less of a misfit: of all steps it is this one, and of all lengths this.
    least_alone: int = 3  # Jumps where a single body moves: fewer can be its own.
    smoother: float = 3.0  # Times as well that a cubic fits it with a jump taken for a step of another length.
    jitter_s: float = 0.002  # [s] Deviation of a stamp that is reported.
    least_steps: int = 30  # In which two bodies move, for the deviation of stamps to be known.
    least_step: float = 3.0  # Deviations of a pose, in a step, from which on it tells how late its picture is.
    correlated: float = 0.5  # Lateness of the two bodies: 0.7 and more where stamps shake, 0.3 at most where not.
    gap_s: float = 1.0  # [s] Without a picture: longer than any motion is carried on.


CONSTANTS = StampConstants()

_TENTH = 3.490  # Tenth of chi-squared with the eight degrees of freedom that such a cubic leaves of two coordinates.
_TENTH_ACROSS = 1.064  # The same with four, of one of the two.
_ALTERNATION = 48 / 35  # Share of it by which each picture is beside the quadratic through five.
_LEFT = 18 / 35  # Share of a picture's variance by which it is beside the quadratic through five.
_OTHER_STEPS = np.setdiff1d(np.arange(-12, 2.5, 0.5), [0.0])  # That a step may be longer by, in usual ones.
_Bodies = list[tuple[Array, float]]  # Places (n, 2) of each body, and its usual misfit.
_ROUNDS = 4  # Of looking for repeated pictures: several of them side by side hide each other.


def check_stamps(tracks: Mapping[str, Track]) -> tuple[dict[str, Track], tuple[Finding, ...], NDArray[np.uint8]]:
    """Compare the stamps of a video with the motion of all its bodies.

    Returns the tracks with repeated pictures marked as not seen, as uncertain as uneven stamps leave them; findings;
    and (n,) of :class:`towval.model.Stamp`.
    """
    time_s = next(iter(tracks.values())).time_s
    findings = list(_gaps(time_s))
    noise_m = {name: _noise_m(track, np.full(len(time_s), True)) for name, track in tracks.items()}
    repeated = frozen_at_the_end(tracks, noise_m)
    share, moving = _shares(tracks, repeated)
    for _ in range(_ROUNDS):
        still = _common(share, moving) & (np.nanmax(np.abs(1 + share), axis=0, initial=0.0) < CONSTANTS.repeated)
        still |= _made_up_for(tracks, ~repeated)
        if not still.any():
            break
        repeated[np.flatnonzero(~repeated)[1:][still]] = True
        share, moving = _shares(tracks, repeated)
    if repeated.any():
        findings.append(finding("pictures_repeated", count=int(repeated.sum()), time_s=time_s[repeated][0]))
    stamps = np.where(repeated, Stamp.REPEATED, Stamp.AS_WRITTEN).astype(np.uint8)
    leaps, jumps = _leaps(tracks, ~repeated) | _dropped(tracks, ~repeated), _common(share, moving)
    alone = jumps & (moving.sum(axis=0) == 1)
    due = np.where(moving, share, 0.0).sum(axis=0)
    for track, own in zip(tracks.values(), moving, strict=True):
        jumps &= ~(alone & own) | _smoother(track, ~repeated, alone & own, due)
    alone &= jumps
    others = zip(tracks.values(), alone & ~moving, strict=True)
    if alone.any() and any(_goes_on(other, ~repeated, at, due) for other, at in others):
        jumps &= ~alone
    if _enough(jumps, moving) or leaps.any():
        jumps |= leaps
        at = np.flatnonzero(~repeated)[:-1][jumps]
        stamps[at] = Stamp.CONTRADICTED
        findings.append(finding("stamps_contradicted", count=len(at), first_s=time_s[at[0]], last_s=time_s[at[-1]]))
    else:
        jitter_s = _jitter_s(tracks, ~repeated)
        if jitter_s > CONSTANTS.jitter_s:
            findings.append(finding("stamps_uneven", jitter_ms=1000 * jitter_s))
            tracks = {name: replace(track, covariance=track.covariance + delayed(time_s, track.pose, jitter_s))
                      for name, track in tracks.items()}  # fmt: skip
    if repeated.any():
        tracks = {name: _without(track, repeated) for name, track in tracks.items()}
    return dict(tracks), tuple(findings), stamps


def _gaps(time_s: Array) -> list[Finding]:
    steps = np.diff(time_s)
    if not len(steps):
        return []
    usual = float(np.median(steps))
    if steps.max() > max(CONSTANTS.gap_s, 2 * usual):
        worst = int(np.argmax(steps))
        return [finding("time_gap", gap_s=steps[worst], time_s=time_s[worst])]
    missing = int(np.sum(np.maximum(np.round(steps / usual) - 1, 0)))
    if missing:
        return [finding("pictures_missing", count=missing, gap_s=steps.max())]
    return []


def _shares(tracks: Mapping[str, Track], left_out: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    """By how much each body's steps (bodies, n) exceed those beside, as a share; and where that can be told."""
    rows = [_share(track, ~left_out) for track in tracks.values()]
    share = np.array([one for one, _ in rows])
    return share, np.array([steady for _, steady in rows])


def _share(track: Track, kept: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    c = CONSTANTS
    velocity, before, after = _velocities(track, kept)
    share, steady = np.full(len(velocity), np.nan), np.zeros(len(velocity), dtype=bool)
    if not np.isfinite(before).any():
        return share, steady
    mean, change = (before + after) / 2, np.linalg.norm(after - before, axis=1)
    speed = np.linalg.norm(mean, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.sum(velocity * mean, axis=1) / speed**2 - 1
        enough = speed * np.median(np.diff(track.time_s[kept])) > c.least_deviations * _noise_m(track, kept)
        steady = enough & (change < c.steady * speed) & np.isfinite(share)
    return share, steady


def _velocities(track: Track, kept: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Velocity [m/s] in each step (n, 2), before it and after it, by medians: one of those beside may jump, too."""
    beside = CONSTANTS.beside
    place = np.where(track.seen[kept, None], track.pose[kept, :2], np.nan)
    velocity = np.diff(place, axis=0) / np.diff(track.time_s[kept])[:, None]
    before, after = np.full_like(velocity, np.nan), np.full_like(velocity, np.nan)
    n = len(velocity)
    if n > 2 * beside:
        medians = np.median(np.lib.stride_tricks.sliding_window_view(velocity, beside, axis=0), axis=2)
        before[beside : n - beside], after[beside : n - beside] = medians[: -beside - 1], medians[beside + 1 :]
    return velocity, before, after


def _noise_m(track: Track, kept: NDArray[np.bool_]) -> float:
    """Deviation from one picture to the next [m]: as stated, or less where the motion shows less.

    What is stated holds what wanders slowly, too. The motion is known where no step about it jumps, which where many
    pictures are lost is seldom, and where every fourth is lost is nowhere: by the tenth of the cubics that fit best, of
    those where the body moves. But no stamp, however wrong, displaces a body across its way.
    """
    if not track.seen.any():
        return np.inf
    stated = float(np.sqrt(np.median(track.covariance[track.seen, 0, 0])))
    place = np.where(track.seen[:, None], track.pose[:, :2], np.nan)[kept]
    if len(place) < 2 * SIDE + CONSTANTS.least_steps:
        return stated
    index = np.arange(len(place) - 2 * SIDE + 1)[:, None] + np.arange(2 * SIDE)
    way = place[index[:, -1]] - place[index[:, 0]]
    moved = np.linalg.norm(way, axis=1)
    normal = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(moved, 1e-12)[:, None]
    across = np.einsum("mkj,mj->mk", place[index], normal)[..., None]
    leftover, beside = (misfit(track.time_s[kept][index], each, 0) for each in (place[index], across))
    known = np.isfinite(leftover) & np.isfinite(moved)
    if known.sum() < CONSTANTS.least_steps:
        return stated
    known &= moved >= 0.5 * np.percentile(moved[known], 75)
    variances = np.percentile(leftover[known], 10) / _TENTH, np.percentile(beside[known], 10) / _TENTH_ACROSS
    return float(np.clip(np.sqrt(min(variances)), CONSTANTS.least_noise * stated, stated))


def _common(share: Array, moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Steps (n,) that are jumps of all bodies that move, by the same share."""
    known = np.where(moving, share, np.nan)
    some = moving.any(axis=0)
    low, high = (np.full(share.shape[1], np.nan) for _ in range(2))
    low[some], high[some] = np.nanmin(known[:, some], axis=0), np.nanmax(known[:, some], axis=0)
    # Bodies agree to a share of the step itself, which may be several.
    alike = high - low < CONSTANTS.agree * np.maximum(1.0, np.abs(high))
    return np.asarray(some & alike & (np.minimum(np.abs(low), np.abs(high)) > CONSTANTS.jump))


def _made_up_for(tracks: Mapping[str, Track], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Steps (n,) in which no body is seen to move, and which the next step makes up for.

    A body that stood for so short a time goes on from where it is, but after a repeated picture it is where it would
    have been: a cubic fits the pictures around it, however the velocity changes, and neither this one nor a halt. Other
    bodies may rest all the time.
    """
    time_s, bodies = next(iter(tracks.values())).time_s[kept], []
    at_rest = np.ones(max(len(time_s) - 1, 0), dtype=np.bool_)
    for track in tracks.values():
        place, noise_m = np.where(track.seen[kept, None], track.pose[kept, :2], np.nan), _noise_m(track, kept)
        at_rest &= ~(np.linalg.norm(np.diff(place, axis=0), axis=1) > CONSTANTS.creeps * np.sqrt(2) * noise_m)
        bodies.append((place, 2 * SIDE * noise_m**2))
    made_up, runs = np.zeros(len(at_rest), dtype=bool), stretches(at_rest) + 1
    runs = runs[runs[:, 1] - runs[:, 0] < _ROUNDS]
    short = np.zeros(len(time_s) + 1, dtype=np.int8)
    short[runs[:, 0]], short[runs[:, 1] + 1] = 1, -1
    left = np.flatnonzero(np.cumsum(short[:-1]) == 0)
    if not len(runs) or len(left) < 2 * SIDE:
        return made_up
    first, last = runs.T[:, :, None]
    around, without = (
        np.clip(at - SIDE, 0, n - 2 * SIDE) + np.arange(2 * SIDE)
        for at, n in ((first, len(time_s)), (np.searchsorted(left, first), len(left)))
    )
    rows = np.array([around, left[without], left[without]])
    times_s = time_s[rows]
    times_s[2] -= np.where(rows[2] > last, time_s[last] - time_s[first - 1], 0.0)
    rows, times_s = rows.reshape(-1, 2 * SIDE), times_s.reshape(-1, 2 * SIDE)
    unlike = sum((np.nan_to_num(misfit(times_s, place[rows], 0) / noise) for place, noise in bodies), np.zeros(1))
    as_seen, repeated, halted = unlike.reshape(3, -1)
    told = np.minimum(as_seen, halted) > np.maximum(CONSTANTS.unlike, CONSTANTS.dropped * repeated)
    for begin, end in runs[told]:
        made_up[begin - 1 : end] = True
    return made_up


def _goes_on(track: Track, kept: NDArray[np.bool_], jumps: NDArray[np.bool_], due: Array) -> bool:
    """Whether a body goes on evenly through jumps (n,) of another one, by shares ``due`` (n,) of its steps.

    It may be too slow to show any one of them, but not to show all together.
    """
    velocity, before, after = _velocities(track, kept)
    usual, std = (before + after) / 2, _noise_m(track, kept) / np.median(np.diff(track.time_s[kept]))
    at = jumps & (np.linalg.norm(usual, axis=1) > CONSTANTS.creeps * std)
    if not at.any():
        return False
    jump = due[at, None] * usual[at]
    size = np.sum(jump**2)
    shown = np.sum((velocity[at] - usual[at]) * jump) / size
    # Of two poses, and of what is taken for the usual step.
    std_of_shown = 2 * std / np.sqrt(size)
    return bool(shown < 0.5 and 1 - shown > CONSTANTS.evenly * std_of_shown)


def _smoother(track: Track, kept: NDArray[np.bool_], jumps: NDArray[np.bool_], due: Array) -> NDArray[np.bool_]:
    """Jumps (n,) by shares ``due`` (n,) of a step without which a body's path is smoother.

    A short slip is fastest in its middle, as if a picture had been lost there, but smooth as it is.
    """
    smoother, place = jumps.copy(), np.where(track.seen[kept, None], track.pose[kept, :2], np.nan)
    smoother[: SIDE - 1] = smoother[len(place) - SIDE :] = False
    at = np.flatnonzero(smoother)
    index = at[:, None] + np.arange(1 - SIDE, SIDE + 1)
    noise = 2 * SIDE * _noise_m(track, kept) ** 2
    as_stamped, otherwise = (noise + misfit(track.time_s[kept][index], place[index], by) for by in (0, due[at]))
    smoother[at] = as_stamped > CONSTANTS.smoother * otherwise
    return smoother


def _leaps(tracks: Mapping[str, Track], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Steps (n,) at which all bodies that move at all leave a rest faster than any of them moves.

    A picture that is frozen for a while shows a rest, and then where the bodies have come to meanwhile: in it none goes
    on, be it as slowly as a rover that tows what sticks. What is hidden or lost in between counts with the pose before.
    """
    c, found, stds = CONSTANTS, [], [_noise_m(track, kept) for track in tracks.values()]
    for track, std in zip(tracks.values(), stds, strict=True):
        seen = np.flatnonzero(track.seen[kept])
        time_s, place = track.time_s[kept][seen], track.pose[kept][seen, :2]
        size_m = np.zeros(kept.sum() - 1)
        leap, moves, awake = (np.zeros(len(size_m), dtype=bool) for _ in range(3))
        if len(seen) > 2 * c.beside:
            step = np.linalg.norm(np.diff(place, axis=0), axis=1)
            speed = step / np.diff(time_s)
            rested = np.linalg.norm(place[c.beside : -1] - place[: -c.beside - 1], axis=1)
            large = step[c.beside :] > c.least_deviations * std
            # It goes on as usual after a leap; a body that is at rest for nearly all of a film goes on as it begins.
            after = np.lib.stride_tricks.sliding_window_view(np.append(speed, np.full(c.beside, np.inf)), c.beside)
            usual = np.maximum(np.percentile(speed, 95), np.median(after[c.beside + 1 :], axis=1))
            fast = speed[c.beside :] > c.leap * usual
            moves[seen[c.beside : -1]], size_m[seen[c.beside : -1]] = large, step[c.beside :]
            leap[seen[c.beside : -1]] = large & fast & (rested < c.repeated * step[c.beside :])
            awake[seen[c.beside : -1]] = ~large & (rested > c.creeps * np.sqrt(2) * std)
        found.append((leap, moves, awake, size_m))
    leaps, moving, awake, size_m = (np.array(rows) for rows in zip(*found, strict=True))
    frozen = np.asarray(leaps.any(axis=0) & (leaps == moving).all(axis=0) & ~awake.any(axis=0))
    noise_m = c.creeps * np.sqrt(2) * np.array(stds)
    for at in np.flatnonzero(frozen).tolist():
        within_m = np.maximum(noise_m, c.repeated * size_m[:, at] * leaps[:, at])
        stood = np.array([_stood(track, kept, at, by) for track, by in zip(tracks.values(), within_m, strict=True)])
        frozen[at] = stood.min() >= stood[leaps[:, at]].max() / 2
    return frozen


def _stood(track: Track, kept: NDArray[np.bool_], at: int, within_m: float) -> int:
    """Number of pictures up to one in which a body is as near as that to where it is in that one."""
    place = np.where(track.seen[kept, None], track.pose[kept, :2], np.nan)[at::-1]
    away = np.linalg.norm(place - place[0], axis=1) > within_m
    return int(np.argmax(away)) if away.any() else len(away)


def _dropped(tracks: Mapping[str, Track], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Steps (n,) that took another time than their stamps say, while the motion changes, too.

    Pictures were lost under even stamps, a second clip begins before the first one ends, or a clock was set. A cubic
    through the eight pictures around a step follows any motion, but no leap ahead or back. All bodies have to fit it
    better, together, where the step is taken for another one, and one to move on both sides: a rest ends at any time.
    """
    time_s = next(iter(tracks.values())).time_s[kept]
    count = len(time_s) - 2 * SIDE + 1
    dropped = np.zeros(max(len(time_s) - 1, 0), dtype=bool)
    if count < CONSTANTS.least_steps:
        return dropped
    index = np.arange(count)[:, None] + np.arange(2 * SIDE)
    leftover, moves, bodies = np.zeros(count), np.zeros((2, count), dtype=bool), []
    for track in tracks.values():
        place = np.where(track.seen[:, None], track.pose[:, :2], np.nan)[kept]
        own = misfit(time_s[index], place[index], 0)
        if np.isfinite(own).any():
            # Eight pictures leave four degrees of freedom in each coordinate.
            usual = float(np.nanmedian(own)) + 2 * SIDE * (std := _noise_m(track, kept)) ** 2
            leftover += np.nan_to_num(own / usual)
            bodies.append((place, usual))
            gone = [np.linalg.norm(place[index[:, k + SIDE - 1]] - place[index[:, k]], axis=1) for k in (0, SIDE)]
            moves |= np.array(gone) > CONSTANTS.creeps * np.sqrt(2) * std
    at = np.flatnonzero((leftover > CONSTANTS.unlike) & moves.all(axis=0))
    rows = index[at]
    others = [
        [np.nan_to_num(misfit(time_s[rows], place[rows], extra) / usual) for place, usual in bodies]
        for extra in _OTHER_STEPS
    ]
    there = [(place[rows], usual) for place, usual in bodies]
    by_two = lost_in_two(time_s[rows], there, CONSTANTS.dropped, CONSTANTS.smoother, CONSTANTS.goes_on)
    dropped[SIDE - 1 + at] = by_two | (leftover[at] > CONSTANTS.dropped * np.sum(others, axis=1).min(axis=0))
    return dropped | _odd(time_s, index, leftover, bodies)


def _odd(time_s: Array, index: NDArray[np.int64], leftover: Array, bodies: _Bodies) -> NDArray[np.bool_]:
    """Steps (n,) that are no whole number of usual ones by their stamps, and are one by the motion of the ``bodies``.

    A clock that was set leaves such a step. ``index`` (m, 8): pictures around the steps; ``leftover`` (m,) as they are.
    """
    odd = np.zeros(len(time_s) - 1, dtype=bool)
    steps = np.diff(time_s)[index[:, :-1]]
    length = steps[:, SIDE - 1] / np.median(steps, axis=1)
    extra = np.maximum(np.round(length), 1) - length
    at = np.flatnonzero((np.abs(extra) > CONSTANTS.odd) & (leftover > CONSTANTS.unlike_odd))
    rows = index[at]
    whole = sum((np.nan_to_num(misfit(time_s[rows], place[rows], extra[at]) / usual) for place, usual in bodies), 0.0)
    odd[SIDE - 1 + at] = leftover[at] > CONSTANTS.dropped_odd * whole
    return odd


def _enough(jumps: NDArray[np.bool_], moving: NDArray[np.bool_]) -> bool:
    together = jumps & (moving.sum(axis=0) > 1)
    return bool(together.any() or jumps.sum() >= CONSTANTS.least_alone)


def _jitter_s(tracks: Mapping[str, Track], kept: NDArray[np.bool_]) -> float:
    """Deviation of a stamp [s] that the motion common to two bodies shows; zero where it shows none.

    What a body does by itself, and noise, are not common to two: the mean of the product of their lateness is the
    variance of the stamps. Of pictures that are early and late in turn more of it is left beside a quadratic.
    """
    if len(tracks) < 2:
        return 0.0
    in_turn_s = _fields_s(tracks, kept)
    one, other = [_lateness_s(track, kept) for track in tracks.values()][:2]
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < CONSTANTS.least_steps:
        return in_turn_s
    one, other = (_bounded(late[both]) for late in (one, other))
    common = float(np.mean(one * other))
    correlated = common > CONSTANTS.correlated * np.sqrt(np.mean(one**2) * np.mean(other**2))
    else_s2 = max(common - (_ALTERNATION * in_turn_s) ** 2, 0.0) / _LEFT
    return float(np.hypot(in_turn_s, np.sqrt(else_s2))) if correlated else in_turn_s


def _lateness_s(track: Track, kept: NDArray[np.bool_]) -> Array:
    """By how much each picture (n,) is ahead of smooth motion [s]; NaN where a body is too slow to tell."""
    time_s, pose = track.time_s[kept], np.where(track.seen[kept, None], track.pose[kept], np.nan)
    ahead, rows, _ = about_quadratics(time_s, pose, 5)
    late = np.full(len(time_s), np.nan)
    if len(rows):
        velocity = (pose[rows + 2, :2] - pose[rows - 2, :2]) / (time_s[rows + 2] - time_s[rows - 2])[:, None]
        squared = np.sum(velocity**2, axis=1)
        tells = np.sqrt(squared) * np.median(np.diff(time_s)) > CONSTANTS.least_step * _noise_m(track, kept)
        late[rows[tells]] = np.sum(velocity * ahead[:, :2], axis=1)[tells] / squared[tells]
    return late


def _bounded(values: Array) -> Array:
    """Values (n,) of which none counts for more than three usual ones: a body starts, or slips."""
    most = 3 * np.median(np.abs(values))
    return np.clip(values, -most, most)


def _fields_s(tracks: Mapping[str, Track], kept: NDArray[np.bool_]) -> float:
    """Deviation of a picture's time [s] where pictures are early and late in turn in the motion of two bodies, or zero.

    Two fields that are made into pictures are so, by too little to show in any one step.
    """
    one, other = [_late_in_turn_s(track, kept) for track in tracks.values()][:2]
    # Noise of the two bodies is not common to them.
    return float(np.sqrt(max(one * other, 0.0)))


def _late_in_turn_s(track: Track, kept: NDArray[np.bool_]) -> float:
    """By how much [s] every second picture is ahead of smooth motion, and the others behind; zero where few show."""
    time_s, pose = track.time_s[kept], np.where(track.seen[kept, None], track.pose[kept], np.nan)
    ahead, rows, _ = about_quadratics(time_s, pose, 5)
    if len(rows) < CONSTANTS.least_steps:
        return 0.0
    velocity = np.gradient(pose[:, :2], time_s, axis=0)[rows]
    along = np.sum(velocity * ahead[:, :2], axis=1) * (1 - 2 * (rows % 2))
    return float(along.sum() / max(np.sum(velocity**2), 1e-12) / _ALTERNATION)


def _without(track: Track, repeated: NDArray[np.bool_]) -> Track:
    status = track.status.copy()
    status[repeated & track.seen] = TrackStatus.COASTING
    return replace(track, status=status)
