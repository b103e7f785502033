"""Model selection for the stage track: how many points of the template the footage needs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model import Body, Calibration, Choice, SimulatedMotion, TowingScene, Track
from towval.model.errors import TowvalError
from towval.model.geometry import rms_length
from towval.selection.margin import SHARE, measurement_std_m, seen_places
from towval.tracking.track import Frames, TrackSettings, track_beside
from towval.validation.decimate import DecimateSettings, decimate
from towval.validation.simulate import SimulateSettings, simulate

TRACK_SAMPLES = (1024, 4096)
"""Values that "auto" selects from, cheapest first.

Fewer than 1024 points are left out: 256 save 2 % of the time of decoding (docs/selection.md); their effect is small
against the measurement uncertainty but not against the noise of single frames, to which the verdict is sensitive.
"""

PROBE_FRAMES, PROBE_STRIDE = 12, 4
"""Number of frames on which a given setting is compared with its neighbour, and their stride from the first."""


def neighbour_of_tracking(
    frames: Sequence[tuple[float, NDArray[np.uint8]]],
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    settings: TrackSettings,
) -> dict[str, Choice]:
    """The effect of the next finer tracking for each body, from some frames beginning with the first.

    For the finest, the next coarser one is tried. The parameters are those of :func:`towval.tracking.track.track`.
    """
    other = _neighbour(settings)
    found, beside = track_beside(iter(frames), calibration, bodies, clicks_px, (settings, other))
    measure = f"RMS over {len(frames)} frames"
    return {
        name: Choice(
            "tracking", _tracking_name(settings), _tracking_name(other), _apart(found[name], beside[name]), measure
        )
        for name in found
    }


def track_selecting(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    settings: TrackSettings,
    scene: TowingScene,
    *,
    decimation: DecimateSettings | None = None,
    simulation: SimulateSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[TrackSettings, dict[str, Track]]:
    """Track with as many points as the run needs; choices of the tracks state the effect of the other number.

    All of :data:`TRACK_SAMPLES` follow the bodies through the whole video, in one pass, and both tracks drive the
    simulation of ``scene``: stick and slip may amplify their difference, which no part of a run shows. The smaller
    number is taken where neither a measured path nor the simulated one moves by more than a third of the measurement
    uncertainty. ``decimation`` and ``simulation`` are the settings of these stages, by default their own; the other
    parameters are those of :func:`towval.tracking.track.track`.

    Returns the settings taken, and the tracks by body.
    """
    cheap, fine = (replace(settings, samples=count) for count in TRACK_SAMPLES)
    tracks, finer = track_beside(frames, calibration, bodies, clicks_px, (cheap, fine), progress)
    places = {body.name: seen_places(tracks[body.name]) for body in bodies}
    # No difference is small enough for a body that the smaller number of points never saw.
    limits = {
        body.name: SHARE * measurement_std_m(calibration, body, places[body.name]) if len(places[body.name]) else 0.0
        for body in bodies
    }
    moved = {name: _apart(tracks[name], finer[name]) for name in tracks}

    def simulated(found: Mapping[str, Track]) -> SimulatedMotion:
        thin = {name: decimate(found[name], decimation) for name in ("rover", "object")}
        return simulate(scene, thin["rover"], thin["object"], found["object"].time_s, simulation)

    carried = _carried(simulated, tracks, finer)
    enough = all(moved[name] <= limit for name, limit in limits.items()) and not carried > limits["object"]
    taken, other = (cheap, fine) if enough else (fine, cheap)
    names = _tracking_name(taken), _tracking_name(other)
    choices = {name: [Choice("tracking", *names, change, "RMS of the measured path")] for name, change in moved.items()}
    choices["object"].append(Choice("tracking", *names, carried, "RMS of the simulated path"))
    return taken, {
        name: replace(one, choices=tuple(choices[name])) for name, one in (tracks if enough else finer).items()
    }


def _carried(
    simulated: Callable[[Mapping[str, Track]], SimulatedMotion], one: Mapping[str, Track], other: Mapping[str, Track]
) -> float:
    """RMS distance [m] of the paths simulated from two sets of tracks; NaN where one cannot be simulated."""
    try:
        first, second = simulated(one), simulated(other)
    except TowvalError:
        # The stages decimate and simulate raise the same error and report it with its remedy.
        return float("nan")
    _, rows, others = np.intersect1d(first.time_s, second.time_s, return_indices=True)
    return rms_length(first.pose[rows] - second.pose[others])


def _neighbour(settings: TrackSettings) -> TrackSettings:
    """The plane method for the paper's points, else the next number of points, or the previous one for the largest."""
    if settings.method != "plane":
        return replace(settings, method="plane")
    following = 4 * settings.samples
    return replace(settings, samples=following if following <= TRACK_SAMPLES[-1] else settings.samples // 4)


def _tracking_name(settings: TrackSettings) -> str:
    if settings.method == "plane":
        return f"plane, {settings.samples} points"
    return "KLT points" if settings.method == "klt" else settings.method


def _apart(one: Track, other: Track) -> float:
    """RMS distance of two tracks of the same frames [m]; infinite where they never saw the body together."""
    both = one.seen & other.seen
    return rms_length(one.pose[both] - other.pose[both]) if both.any() else float("inf")
