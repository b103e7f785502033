"""Model no more than a scene needs: probes on the scene that choose a setting, or say what the next would change.

Each function goes with a stage. What was chosen, what would have been next and how far that moves positions becomes a
:class:`~towval.types.Choice` in the stage's file. Under "auto" the cheapest setting is taken whose difference to the
next finer one is below a third of the measurement uncertainty: then it adds less than 6 % to that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.calibrate import CalibrateSettings, calibrate_sightings
from towval.errors import RefusedError
from towval.physics.ladder import DYNAMICS, RUNGS
from towval.simulate import SimulateSettings, simulate
from towval.track import TrackSettings, track
from towval.types import (
    Array,
    Body,
    Calibration,
    Choice,
    DecimatedTrack,
    FloorReference,
    RunUncertainty,
    Scene,
    SimulatedMotion,
    Track,
)
from towval.uncertainty import Case, UncertaintySettings, sample_uncertainty
from towval.vision.camera import project, to_plane
from towval.vision.corners import Sighting
from towval.vision.lens import LENS_MODELS
from towval.vision.sightings import Sightings
from towval.vision.uncertainty import pixel_grid, position_covariance

SHARE = 1 / 3
"""Of the measurement uncertainty that the error of a setting may reach."""

TRACK_SAMPLES = (1024, 4096)
TOLERANCES_M = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
DRAWS = (128, 256, 512, 1024, 2048)
"""What "auto" chooses from, cheapest first.

Fewer than 1024 points are left out: 256 save 2 % of the time of decoding (docs/choosing.md), and what they add is small
against the measurement uncertainty but not against the frame's own noise, which the verdict is sensitive to.
"""

PROBE_FRAMES, PROBE_STRIDE = 12, 4
"""How many frames the tracker is tried on, and at what stride from the first."""

_SETTLED = 0.1  # Limits of the verdict may change by this share when the draws are doubled.

Frames = Sequence[tuple[float, NDArray[np.uint8]]]


def measurement_std_m(calibration: Calibration, body: Body, places: ArrayLike) -> float:
    """Standard uncertainty of a body's measured place [m], root mean square over places (n, 2) on the floor [m].

    It holds calibration and the height of the top, what all poses of a run share. √(σ_x² + σ_y²).
    """
    places = np.asarray(places, dtype=np.float64)[:, :2]
    height = body.tracked_plane_height_m
    pixels = project(calibration.camera, calibration.floor, np.column_stack([places, np.full(len(places), height)]))
    covariance = position_covariance(calibration, pixels, height, height_std_m=body.height_std_m)
    return float(np.sqrt(np.mean(np.trace(covariance, axis1=1, axis2=2))))


def with_lens_choice(
    calibration: Calibration, reference: FloorReference, settings: CalibrateSettings, height_m: float
) -> Calibration:
    """The calibration with what the next larger lens model would have changed on the plane of a top."""
    models, chosen = list(LENS_MODELS), calibration.camera.lens_model
    place = models.index(chosen)
    following = models[place + 1] if place + 1 < len(models) else models[place - 1]
    used = [view for view in calibration.views if not view.dropped and len(view.corners_px) and len(view.board_m)]
    boards = [Sighting(view.name, view.corners_px, view.board_m) for view in used if not view.on_floor]
    flat = [Sighting(view.name, view.corners_px, view.board_m) for view in used if view.on_floor]
    flat = [sighting for sighting in flat if len(sighting.corners_px) != len(reference.marks_px)]
    seen = Sightings(calibration.camera.resolution_px, tuple(boards), tuple(flat), reference)
    try:
        other = calibrate_sightings(seen, replace(settings, lens_models=(following,)), {})
        pixels = pixel_grid(calibration.camera.resolution_px, 16).reshape(-1, 2)
        there = [to_plane(each.camera, each.floor, pixels, height_m) for each in (calibration, other)]
        change = float(np.sqrt(np.mean(np.sum((there[0] - there[1]) ** 2, axis=1))))
    except RefusedError:
        change = float("nan")
    measure = f"RMS over the picture at {height_m:g} m"
    return replace(calibration, choices=(Choice("lens model", chosen, following, change, measure),))


def choose_tracking(
    frames: Frames,
    calibration: Calibration,
    bodies: Sequence[Body],
    clicks_px: Mapping[str, ArrayLike],
    settings: TrackSettings,
    *,
    auto: bool,
) -> tuple[TrackSettings, dict[str, Choice]]:
    """Try the tracker on a few frames: the settings to take, and for each body what the next would have changed.

    Parameters
    ----------
    frames : sequence of (float, ndarray)
        Some frames from the first on.
    calibration, bodies, clicks_px
        As in :func:`towval.track.track`.
    settings : TrackSettings
        Wanted; with ``auto`` the number of points is chosen from :data:`TRACK_SAMPLES`.
    auto : bool
        Whether to choose.
    """

    def tried(one: TrackSettings) -> dict[str, Track]:
        return track(iter(frames), calibration, bodies, clicks_px, one)

    first = {body.name: np.mean(np.asarray(clicks_px[body.name], dtype=np.float64), axis=0) for body in bodies}
    limit = SHARE * min(
        measurement_std_m(
            calibration,
            body,
            to_plane(calibration.camera, calibration.floor, first[body.name][None], body.tracked_plane_height_m),
        )
        for body in bodies
    )
    candidates = [replace(settings, samples=count) for count in TRACK_SAMPLES] if auto else [settings]
    found = tried(candidates[0])
    for index, candidate in enumerate(candidates):
        following = candidates[index + 1] if index + 1 < len(candidates) else _finer_tracking(candidate)
        other = tried(following)
        changes = {name: _apart(found[name], other[name]) for name in found}
        if not auto or max(changes.values()) <= limit or index + 1 == len(candidates):
            break
        found = other
    measure = f"RMS over {len(frames)} frames"
    return candidate, {
        name: Choice("tracking", _tracking_name(candidate), _tracking_name(following), change, measure)
        for name, change in changes.items()
    }


def _finer_tracking(settings: TrackSettings) -> TrackSettings:
    """The plane method for the paper's points, else four times the points."""
    if settings.method != "plane":
        return replace(settings, method="plane")
    return replace(settings, samples=4 * settings.samples)


def _tracking_name(settings: TrackSettings) -> str:
    return f"plane, {settings.samples} points" if settings.method == "plane" else "KLT points"


def _apart(one: Track, other: Track) -> float:
    """RMS distance of two tracks of the same frames [m]; infinite where they never saw the body together."""
    both = one.seen & other.seen
    if not both.any():
        return float("inf")
    return float(np.sqrt(np.mean(np.sum((one.pose[both, :2] - other.pose[both, :2]) ** 2, axis=1))))


def simulate_choosing(
    scene: Scene,
    rover: DecimatedTrack,
    towed: DecimatedTrack,
    times: ArrayLike,
    settings: SimulateSettings,
    *,
    auto: Sequence[str],
    measurement_m: float,
) -> tuple[SimulateSettings, SimulatedMotion]:
    """Simulate a run with what it needs; the motion says what the next model and tolerance would have changed.

    ``auto`` holds the names of the settings to be chosen, "rung_tolerance_m" and "tolerance_m", against the measurement
    uncertainty ``measurement_m`` [m]; the rest is as in :func:`towval.simulate.simulate`.
    """
    limit = SHARE * measurement_m
    if "rung_tolerance_m" in auto:
        settings = replace(settings, rung_tolerance_m=float(np.clip(limit, 1e-9, 1.0)))
    tolerances = TOLERANCES_M if "tolerance_m" in auto else (settings.tolerance_m,)
    motion, change, finer = None, np.inf, 0.0
    for tolerance in tolerances:
        settings = replace(settings, tolerance_m=tolerance)
        motion = simulate(scene, rover, towed, times, settings)
        finer = max(tolerance / 10, 1e-12)
        # The same rung again: what is asked is the tolerance alone.
        again = simulate(scene, rover, towed, times, replace(settings, tolerance_m=finer, rung=motion.rung))
        change = float(np.linalg.norm(motion.pose[:, :2] - again.pose[:, :2], axis=1).max())
        if change <= limit:
            break
    names = (f"{value:.0e} m" for value in (settings.tolerance_m, finer))
    choices = (_rung_choice(motion), Choice("tolerance of a step", *names, change, "at most over the path"))
    return settings, replace(motion, choices=choices)


def _rung_choice(motion: SimulatedMotion) -> Choice:
    """Against the full dynamics or, for these, the quasi-static patch."""
    simpler = RUNGS[RUNGS.index(DYNAMICS) - 1]
    following, lower = (simpler, simpler) if motion.rung == DYNAMICS else (DYNAMICS, motion.rung)
    change = motion.statistics[f"{lower} to dynamics, m"]
    return Choice("model of the object", motion.rung, following, change, "at most over the path")


def sample_choosing(
    case: Case,
    settings: UncertaintySettings,
    *,
    auto: bool,
    measurement_m: float,
    progress: Callable[[int], None] | None = None,
) -> RunUncertainty:
    """Sample the uncertainty of a run; under ``auto`` with draws doubled until the result has settled.

    Settled: the validation uncertainty changes by less than a third of the measurement uncertainty, and the limit of
    the verdict by less than a tenth.
    """
    if not auto:
        found = sample_uncertainty(case, settings, progress)
        # The standard deviation of a root mean square over n normal draws.
        change = _validation_m(found) / np.sqrt(2 * found.samples)
        choice = Choice("draws", f"{settings.samples}", f"{2 * settings.samples}", change, "of u_val, as expected")
        return replace(found, choices=(choice,))
    found = sample_uncertainty(case, replace(settings, samples=DRAWS[0]))
    for count in DRAWS[1:]:
        more = sample_uncertainty(case, replace(settings, samples=count), progress)
        change = abs(_validation_m(more) - _validation_m(found))
        limits = more.signature_limit, found.signature_limit
        settled = change <= SHARE * measurement_m and abs(limits[0] / limits[1] - 1) <= _SETTLED
        choice = Choice("draws", f"{count}", f"{count // 2}", change, "of u_val")
        found = replace(more, choices=(choice,))
        if settled:
            break
    return found


def _validation_m(uncertainty: RunUncertainty) -> float:
    """Root mean square over time of the validation uncertainty of the position [m]."""
    return float(np.sqrt(np.mean(np.trace(uncertainty.validation[:, :2, :2], axis1=1, axis2=2))))


def seen_places(tracked: Track) -> Array:
    """Places (n, 2) of a track's frames in which the body was seen [m], at most fifty of them."""
    places = tracked.pose[tracked.seen, :2]
    return places[:: max(1, len(places) // 50)]
