"""What a rover may have done between two pictures: how far it may be from the curve that drives the simulation."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from towval.model import Array, DecimatedTrack, Finding
from towval.model.findings import finding

HIDDEN_M = 0.01
"""What an unobserved motion of the rover may be off its bridge, along it, from which on the run is not judged: half of
the default tolerance, since the object follows the rover."""

SPARSE_M = HIDDEN_M / 2
"""The same between any two pictures in a row, from which on a difference is held against no model."""

GAP = 1.5
"""A step between two pictures, in usual ones, from which on it is a gap."""

_LEVER_M = 0.5
"""Lever at which a turn of the rover counts as motion: the hinge swings with it, whose place is not known here."""

_LOOKED_AT = 8
"""Steps of a run in which the rover's speed changes most: one of them is the worst."""


def bridge_findings(track: DecimatedTrack, seen_s: Array) -> Iterator[Finding]:
    """Findings where the rover, which drives the simulation, may have moved otherwise than its curve between pictures.

    ``seen_s`` (n,) are the times at which it was seen [s].
    """
    if track.body != "rover" or len(seen_s) < 2:
        return
    steps = np.diff(seen_s)
    gaps = steps > GAP * np.median(steps)
    for rows, code, most_m in ((gaps, "bridge_unsure", HIDDEN_M), (~gaps, "pictures_sparse", SPARSE_M)):
        worst = _least_even(track, seen_s, np.flatnonzero(rows))
        off_m, at = max(((off_bridge_m(track, *seen_s[i : i + 2]), i) for i in worst), default=(0.0, 0))
        if off_m > most_m:
            yield finding(code, time_s=seen_s[at], gap_s=steps[at], off_mm=1000 * off_m)


def _least_even(track: DecimatedTrack, seen_s: Array, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Those of some steps in which the speed changes most, over their lengths."""
    begin, end = seen_s[rows], seen_s[rows + 1]
    first, middle, last = (_speed(track, time) for time in (begin, (begin + end) / 2, end))
    change = np.maximum(np.abs(last - first), np.abs(middle - (first + last) / 2)) * (end - begin)
    return rows[np.argsort(-change)[:_LOOKED_AT]]


def _speed(track: DecimatedTrack, time_s: Array) -> Array:
    along_x, along_y, turn = track.poses_and_rates_at(time_s)[:, 3:].T
    return np.asarray(np.hypot(along_x, along_y) + _LEVER_M * np.abs(turn))


def off_bridge_m(track: DecimatedTrack, begin_s: float, end_s: float) -> float:
    """How far along its path a body may have been from the curve between two times of an unobserved motion [m].

    Its speed is that of its origin and, at a lever of 0.5 m, that of its turn: on the spot it moves the tether's hinge.
    What was seen at both ends leaves the time open at which the speed changed in between. Compared are the two simplest
    motions: on at the first speed, then a stop; a wait, then on at the last speed. A body that keeps its speed arrives
    as the curve does: zero. Where neither is fast enough for the length, it is half of what is missing.
    """
    time = np.linspace(0.0, end_s - begin_s, 101)
    return missed_m(time, _speed(track, begin_s + time))


def missed_m(time: Array, speed: Array) -> float:
    """The same [m] of what moves with speeds (n,) [m/s] along the curve at times (n,) from zero to the end of a gap."""
    gone = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(time))])
    first, last, length = speed[0] * time, gone[-1] - speed[-1] * time[::-1], gone[-1]
    others = [np.minimum(first, length)] if first[-1] >= length else []
    others += [np.maximum(last, 0.0)] if last[0] <= 0 else []
    if not others:
        return float(min(length - first[-1], last[0]) / 2)
    return float(max(np.abs(other - gone).max() for other in others))
