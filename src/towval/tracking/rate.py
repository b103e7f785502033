"""Whether the time scale of a video as a whole can be true: the rate of its pictures, and the length of its sound."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Array, Finding
from towval.model.findings import finding


@dataclass(frozen=True)
class RateConstants:
    """Tuned constants of the check of the rate."""

    many: int = 30  # Pictures over which the usual step is taken.
    rate: float = 0.003  # Difference from the camera's stated rate: television's is off by 0.001, crystals by less.
    length: float = 0.01  # Difference of the sound's length from the pictures', which may end apart,
    apart_s: float = 0.5  # [s] by so much where they are short.
    usual_hz: tuple[float, ...] = (12.5, 15, 18, 20, 24, 25, 30, 48, 50, 60, 90, 100, 120, 240)  # [Hz] of cameras,
    usual_rate: float = 0.004  # within which a rate is one of them; or a thousandth below, for television.


CONSTANTS = RateConstants()


def usual_steps_s(time_s: Array) -> Array:
    """Usual step (2,) of stamps (n,) [s]: with the pictures counted that are missing by them, and as they are.

    Over many pictures, since containers round to milliseconds. Of stamps that are rounded to most of a step some seem
    to be missing, so that the first is too short; losses make the second too long. NaN for one picture.
    """
    if len(time_s) < 2:
        return np.full(2, np.nan)
    many, steps = max(1, min(CONSTANTS.many, len(time_s) // 4)), np.diff(time_s)
    number = np.append(0, np.cumsum(np.maximum(np.round(steps / np.median(steps)), 1)))
    passed = time_s[many:] - time_s[:-many]
    return np.array([np.median(passed / (number[many:] - number[:-many])), np.median(passed / many)])


def rate_findings(steps_s: ArrayLike, stated_hz: float | None, seen_s: float, heard_s: float) -> tuple[Finding, ...]:
    """Findings about the time scale as a whole.

    ``steps_s``: usual step of the stamps [s], or several readings of it, of which the best one counts; ``stated_hz``:
    the camera's rate by the campaign; ``seen_s`` and ``heard_s``: from the first picture to the end of the pictures and
    of the sound [s], NaN where there is none.
    """
    cameras_hz = np.outer(CONSTANTS.usual_hz, [1.0, 1 / 1.001]) if stated_hz is None else np.array([stated_hz])
    off, found_hz = min((_off_cameras(rate_hz, cameras_hz), rate_hz) for rate_hz in 1 / np.atleast_1d(steps_s))
    findings = []
    if stated_hz is not None and off > CONSTANTS.rate:
        findings.append(finding("rate_contradicted", found_hz=found_hz, other=f"camera.fps is {stated_hz:g}"))
    apart_s = max(CONSTANTS.length * heard_s, CONSTANTS.apart_s)
    if heard_s < seen_s - apart_s:
        # Lost pictures leave the sound longer: this one was switched off, or the stamps stretch a rate of cameras.
        stretched = np.abs(heard_s / seen_s * np.array(CONSTANTS.usual_hz) / found_hz - 1).min() < apart_s / seen_s
        heard_s = heard_s if stretched else float("nan")
    if abs(heard_s - seen_s) > apart_s:
        other = f"the sound lasts {heard_s:.1f} s and the pictures {seen_s:.1f} s"
        findings.append(finding("rate_contradicted", found_hz=found_hz, other=other))
    times = 1 if stated_hz is None else _times(stated_hz, steps_s)
    if times > 1 and np.isnan(heard_s):
        findings.append(finding("rate_divided", stated_hz=stated_hz, found_hz=found_hz, times=times))
    if stated_hz is None and np.isnan(heard_s):
        findings.append(
            finding("rate_unusual" if off > CONSTANTS.usual_rate else "rate_unconfirmed", found_hz=found_hz)
        )
    return tuple(findings)


def _times(stated_hz: float, steps_s: ArrayLike) -> int:
    """How many times the rate of the stamps a stated one is, by the reading of the usual step that is nearest to it.

    1 where it is no whole multiple of any.
    """
    ratios = stated_hz * np.nan_to_num(np.atleast_1d(steps_s))
    wholes = np.maximum(np.round(ratios), 1)
    multiples = wholes[np.abs(ratios / wholes - 1) <= CONSTANTS.rate]
    return int(multiples.min()) if len(multiples) else 1


def _off_cameras(rate_hz: float, cameras_hz: Array) -> float:
    """Share by which a rate is off the nearest one of cameras, or of cameras of which some pictures are left out."""
    usual = cameras_hz / rate_hz
    return float(np.abs(usual / np.maximum(np.round(usual), 1) - 1).min())
