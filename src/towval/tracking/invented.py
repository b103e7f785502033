"""Pictures that were invented between real ones: all bodies go straight and evenly from one real picture to the next.

Smooth playback, a converter to another rate, or a camera short of time makes pictures up from those before and after.
Texture and outline agree in them, and stamps are even, but bodies are not where they were. What shows is the rhythm:
the motion bends at every so-many-th picture and hardly at any between.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from towval.model import Array, Finding, Track
from towval.model.findings import finding
from towval.model.run_record import measured_poses
from towval.tracking.pose import RAYLEIGH_MEDIAN


@dataclass(frozen=True)
class InventedConstants:
    """Tuned constants of the search for invented pictures."""

    periods: tuple[int, ...] = (3, 4, 5, 6, 8, 10, 12)  # Pictures from one real one to the next.
    least_bends: int = 8  # Real pictures at which a body moves, for a median.
    rhythm: float = 3.0  # Bend at real pictures over that at the others: 1.3 at most where all are real, else 6.
    moving: float = 0.3  # Of a body's usual speed, from which on it moves.
    shown: float = 2.0  # Largest bend over that of noise, below which a body goes straight and tells nothing.


CONSTANTS = InventedConstants()


def check_invented(tracks: Mapping[str, Track]) -> tuple[dict[str, Track], tuple[Finding, ...]]:
    """Look for pictures that were invented.

    Returns the tracks, as uncertain as bodies may have been elsewhere between two real pictures; and the findings.
    """
    bends = [(_bends_of_moving(one), _bend_of_noise(one)) for one in tracks.values()]
    bends = [(bend, noise) for bend, noise in bends if np.isfinite(bend).any()]
    rhythms = {
        period: max(_common_rhythm(bends, period, phase) for phase in range(period)) for period in CONSTANTS.periods
    }
    period = max(rhythms, key=lambda one: rhythms[one])
    if rhythms[period] < CONSTANTS.rhythm:
        return dict(tracks), ()
    tracks = {name: replace(one, covariance=one.covariance + _between(one, period)) for name, one in tracks.items()}
    return dict(tracks), (finding("pictures_invented", period=period),)


def _bends(track: Track) -> Array:
    """By how much each step exceeds the one before (n, 3) [m, m, rad]; NaN where that is not known.

    Steps count as over equal times, since stamps may leave pictures out: a body that moves evenly bends nowhere.
    """
    before, pose, after = (measured_poses(track)[i : i + len(track.pose) - 2] for i in range(3))
    span = np.diff(track.time_s)[:, None]
    bends = np.full_like(track.pose, np.nan)
    bends[1:-1] = 2 * ((before * span[1:] + after * span[:-1]) / (span[1:] + span[:-1]) - pose)
    return bends


def _bends_of_moving(track: Track) -> Array:
    """Sizes (n,) [m] of the bends of a body's path where it moves; NaN elsewhere."""
    bend = np.asarray(np.linalg.norm(_bends(track)[:, :2], axis=1))
    speed = np.full(len(bend), np.nan)
    apart_s = track.time_s[2:] - track.time_s[:-2]
    speed[1:-1] = np.linalg.norm(track.pose[2:, :2] - track.pose[:-2, :2], axis=1) / apart_s
    known = np.isfinite(bend)
    if known.any():
        bend[known & (speed < CONSTANTS.moving * np.percentile(speed[known], 75))] = np.nan
    return bend


def _bend_of_noise(track: Track) -> float:
    """Median size of a bend that the poses' own deviations make [m]."""
    variance = np.trace(track.covariance[track.seen][:, :2, :2], axis1=1, axis2=2) / 2
    # A bend is p - 2 q + r, and its size a Rayleigh variable.
    return float(RAYLEIGH_MEDIAN * np.sqrt(6 * np.median(variance))) if len(variance) else np.inf


def _common_rhythm(bends: Sequence[tuple[Array, float]], period: int, phase: int) -> float:
    """The least rhythm of bodies, with bends (n,) and that of noise, that show any; zero where none does."""
    rhythms = [_rhythm(bend, noise, period, phase) for bend, noise in bends]
    return min((one for one in rhythms if one is not None), default=0.0)


def _rhythm(bend: Array, noise: float, period: int, phase: int) -> float | None:
    """Median of the bends (n,) at every so-many-th picture over the largest at the others; None where few show."""
    at = [bend[(phase + i) % period :: period] for i in range(period)]
    at = [one[np.isfinite(one)] for one in at]
    if min(len(one) for one in at) < CONSTANTS.least_bends:
        return 0.0 if _bends_between(at, noise) else None
    # From the last invented picture to the next real one bodies leap by what the invention was off by.
    medians = [float(np.median(one)) for one in at]
    # What is stated holds what wanders slowly, too.
    if max(medians) < CONSTANTS.shown * min(noise, *medians):
        return None
    real, *between, _ = medians
    return real / max((*between, 1e-9))


def _bends_between(at: Sequence[Array], noise: float) -> bool:
    """Whether a body that moves in few pictures bends all the same at those that would be invented, beyond its noise.

    Its bends (n,) [m] are those at real pictures, then those after; where it bends between as well, none were invented.
    """
    between = np.concatenate(at[1:-1])
    if len(between) < CONSTANTS.least_bends or np.median(between) < CONSTANTS.shown * noise:
        return False
    return not len(at[0]) or bool(np.median(at[0]) < CONSTANTS.rhythm * np.median(between))


def _between(track: Track, period: int) -> Array:
    """Covariance (n, 3, 3) of poses that lie on chords of the true path, from one real picture to the next.

    A chord of n pictures is off by at most n / 8 of the change of the step along it. That shows at its ends only, and
    may have turned back between them, so that all bends of two chords before and after count.
    """
    around = 2 * period
    bends = np.pad(np.nan_to_num(_bends(track)), ((around, around), (0, 0)))
    near = np.lib.stride_tricks.sliding_window_view(bends, 2 * around + 1, axis=0)
    return np.asarray((period / 8) ** 2 * near @ near.transpose(0, 2, 1))
