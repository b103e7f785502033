"""Model selection for the stage track: how many points of the template the footage needs.

Apart from :mod:`towval.selection.tracking`, since it simulates: a run whose points are given does not load the physics.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from towval.model import Body, Calibration, Choice, SimulatedMotion, TowingScene, Track
from towval.model.errors import TowvalError
from towval.model.geometry import rms_length
from towval.selection.margin import SHARE, measurement_std_m, seen_places
from towval.selection.tracking import TRACK_SAMPLES, apart_m, tracking_name
from towval.tracking.track import Frames, TrackSettings, track_beside
from towval.validation.decimate import DecimateSettings, decimate
from towval.validation.simulate import SimulateSettings, simulate


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
    number is taken where it loses no body more often, and neither a measured path nor the simulated one moves by more
    than a third of the measurement uncertainty. ``decimation`` and ``simulation`` are the settings of these stages, by
    default their own; the other parameters are those of :func:`towval.tracking.track.track`.

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
    moved = {name: apart_m(tracks[name], finer[name]) for name in tracks}
    # Paths are compared where both saw the body: fewer points must see it for as long.
    seen = all(np.count_nonzero(tracks[name].seen) >= np.count_nonzero(finer[name].seen) for name in tracks)

    def simulated(found: Mapping[str, Track]) -> SimulatedMotion:
        thin = {name: decimate(found[name], decimation) for name in ("rover", "object")}
        return simulate(scene, thin["rover"], thin["object"], found["object"].time_s, simulation)

    carried = _carried(simulated, tracks, finer)
    enough = seen and all(moved[name] <= limit for name, limit in limits.items()) and not carried > limits["object"]
    taken, other = (cheap, fine) if enough else (fine, cheap)
    names = tracking_name(taken), tracking_name(other)
    choices = {name: [Choice("tracking", *names, change, "RMS of the measured path")] for name, change in moved.items()}
    choices["object"].append(Choice("tracking", *names, carried, "RMS of the simulated path"))
    return taken, {
        name: replace(one, choices=tuple(choices[name])) for name, one in (tracks if enough else finer).items()
    }


def _carried(
    simulated: Callable[[Mapping[str, Track]], SimulatedMotion], fewer: Mapping[str, Track], more: Mapping[str, Track]
) -> float:
    """RMS distance [m] of the paths simulated from two sets of tracks.

    NaN where the tracks of ``more`` points cannot be simulated, and infinite where only those of ``fewer`` cannot.
    """
    # The stages decimate and simulate raise the same error and report it with its remedy.
    try:
        second = simulated(more)
    except TowvalError:
        return float("nan")
    try:
        first = simulated(fewer)
    except TowvalError:
        return float("inf")
    _, rows, others = np.intersect1d(first.time_s, second.time_s, return_indices=True)
    return rms_length(first.pose[rows] - second.pose[others])
