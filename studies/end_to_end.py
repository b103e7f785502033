"""A campaign's first run through all stages, from the pictures to the verdict, with keys as in config.yaml."""

from __future__ import annotations

import hashlib
import itertools
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from studies.costs import Cost, measured_cost
from towval.calibration.calibrate import CalibrateSettings, calibrate
from towval.io.campaign import Campaign
from towval.io.images import read_gray
from towval.io.video import Video
from towval.model import Array, Calibration, Choice, Comparison, DecimatedTrack, SimulatedMotion, TowingScene, Track
from towval.selection.draws import sample_selecting
from towval.selection.lens import with_lens_choice
from towval.selection.margin import measurement_std_m, seen_places
from towval.selection.sample_points import track_selecting
from towval.selection.simulation import simulate_selecting
from towval.selection.tracking import PROBE_FRAMES, PROBE_STRIDE, neighbour_of_tracking
from towval.tracking.track import TrackSettings, track
from towval.validation.compare import compare
from towval.validation.decimate import DecimateSettings, decimate
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.simulate import SimulateSettings
from towval.validation.uncertainty import UncertaintySampling

AUTO = "auto"

STAGES = ("calibrate", "track", "decimate", "simulate", "uncertainty", "compare")
"""In their order; each depends on those before it."""

Keys = Mapping[str, Mapping[str, Any]]
"""Keys of config.yaml by stage; what is left out is the stage's default."""


@dataclass(frozen=True)
class PipelineResult:
    """What a run of the whole pipeline ends with, what each stage chose for it, and what it cost.

    ``kept`` poses of the object's and of the rover's track, after decimation; ``costs`` by stage.
    """

    measured: dict[str, Track]
    simulated: Array
    time_s: Array
    comparison: Comparison
    choices: tuple[Choice, ...] = ()
    kept: tuple[int, ...] = ()
    costs: Mapping[str, Cost] = field(default_factory=dict)

    @property
    def cpu_s(self) -> float:
        """CPU time of all stages [s]."""
        return sum(each.cpu_s for each in self.costs.values())

    @property
    def wall_s(self) -> float:
        """Wall time of all stages [s]."""
        return sum(each.wall_s for each in self.costs.values())


@dataclass(frozen=True)
class Made:
    """What a stage has made, its ``digest`` without what it says of its choices, and what it cost."""

    result: Any
    digest: str
    cost: Cost


@dataclass
class Pipeline:
    """All stages on a campaign's first run.

    What a stage has made of the same input with the same keys is not made again, whatever led to that input; its cost
    is that of the one time.
    """

    given: Campaign
    made: dict[str, Made] = field(default_factory=dict)

    def run(self, keys: Keys, *, views: int | None = None, longer_m: float = 0.0) -> PipelineResult:
        """All stages with some keys.

        Parameters
        ----------
        keys : mapping
            As in config.yaml, "auto" among them.
        views : int, optional
            Take so many of the calibration's pictures, the first, not all.
        longer_m : float, optional
            State a tether so much longer than campaign.yaml does [m]. The verdict is that of the program, without the
            search for what explains it where that cannot change it: then ``costs`` do not say what a run costs.
        """
        given, scene = self.given, stated_longer(self.given.scene, longer_m)
        costs: dict[str, Cost] = {}

        def make(stage: str, call: Callable[[dict[str, Any], tuple[str, ...]], Any], *inputs: object) -> Made:
            name = _digest([stage, dict(keys.get(stage, {})), *inputs])
            if name not in self.made:
                result, cost = measured_cost(partial(call, *_without_auto(keys, stage)))
                self.made[name] = Made(result, _digest(result), cost)
            costs[stage] = self.made[name].cost
            return self.made[name]

        camera = make("calibrate", lambda own, _: calibrated(given, own, views), views)
        entry, calibration = given.run(next(iter(given.runs))), camera.result
        seen = make("track", lambda own, auto: _tracked(given, calibration, own, auto), camera.digest)
        rover, towed = (seen.result[name] for name in ("rover", "object"))
        kept = make("decimate", lambda own, _: _thinned(seen.result, own), seen.digest)
        thin, before = kept.result, (camera.digest, seen.digest, kept.digest, longer_m)
        measured = measurement_std_m(calibration, given.object, seen_places(towed))

        def simulated(own: dict[str, Any], auto: tuple[str, ...]) -> SimulatedMotion:
            scene_and_tracks = (scene, thin["rover"], thin["object"], towed.time_s, SimulateSettings(**own))
            return simulate_selecting(*scene_and_tracks, auto=auto, measurement_m=measured)[1]

        moved = make("simulate", simulated, *before)
        motion = moved.result
        case = Case(
            scene, given.deviations, calibration, *given.bodies, rover, thin["rover"], towed, thin["object"], motion
        )
        compared = partial(compare, entry.video.stem, motion, towed)
        settings = UncertaintySettings(**keys.get("uncertainty", {}))
        if longer_m:
            alone = dict(keys.get("uncertainty", {}))
            end = make("compare", lambda *_: _verdict_alone(case, settings, compared), *before, moved.digest, alone)
            drawn: tuple[Choice, ...] = ()
        else:
            sampled = partial(sample_selecting, case, settings, measurement_m=measured)
            spread = make("uncertainty", lambda *_: sampled(), *before, moved.digest)
            end = make("compare", lambda *_: compared(spread.result), *before, moved.digest, spread.digest)
            drawn = spread.result.choices
        choices = (*calibration.choices, *towed.choices, *motion.choices, *drawn)
        counts = tuple(len(each.time_s) for each in thin.values())
        return PipelineResult(seen.result, motion.pose, motion.time_s, end.result, choices, counts, costs)


def _digest(value: object) -> str:
    """Of a result, without its choices, or of a list of keys and digests."""
    if isinstance(value, dict) and any(isinstance(each, Track) for each in value.values()):
        value = [(name, replace(each, choices=())) for name, each in value.items()]
    elif hasattr(value, "choices"):
        value = replace(value, choices=())  # type: ignore[type-var]
    return hashlib.sha256(pickle.dumps(value)).hexdigest()


def stated_longer(scene: TowingScene, by_m: float) -> TowingScene:
    """What is stated of a tow, with a tether that is so much longer [m]."""
    return replace(scene, tether=replace(scene.tether, rest_length=scene.tether.rest_length + by_m))


def calibrated(given: Campaign, keys: Mapping[str, Any], views: int | None = None) -> Calibration:
    """The camera of a campaign, found with these keys of ``config["calibrate"]`` in this process alone."""
    keys = {name: tuple(value) if isinstance(value, list) else value for name, value in keys.items()}
    settings = CalibrateSettings(**keys, threads=1)
    calibration = calibrate(
        [(path.name, read_gray(path, given.resolution_px)) for path in given.calibration_images[:views]],
        [(path.name, read_gray(path, given.resolution_px)) for path in given.floor_images],
        given.board,
        given.floor_reference,
        settings,
        heights_m=[body.tracked_plane_height_m for body in given.bodies],
    )
    return with_lens_choice(
        calibration, given.board, given.floor_reference, settings, given.object.tracked_plane_height_m
    )


def _tracked(
    given: Campaign, calibration: Calibration, keys: dict[str, Any], auto: tuple[str, ...]
) -> dict[str, Track]:
    entry = given.run(next(iter(given.runs)))
    seen = (calibration, given.bodies, entry.clicks_px, TrackSettings(**keys))
    if "samples" in auto:
        return track_selecting(Video(entry.video), *seen, given.scene)[1]
    tracks = track(Video(entry.video), *seen)
    few = list(itertools.islice(Video(entry.video), 0, PROBE_FRAMES * PROBE_STRIDE, PROBE_STRIDE))
    neighbour_of_tracking(few, *seen)
    return tracks


def _thinned(tracks: Mapping[str, Track], keys: dict[str, Any]) -> dict[str, DecimatedTrack]:
    return {name: decimate(each, DecimateSettings(**keys)) for name, each in tracks.items()}


def _verdict_alone(case: Case, settings: UncertaintySettings, compared: Callable[..., Comparison]) -> Comparison:
    """The comparison without what only explains it: beyond the tolerance no cause changes that a model is rejected."""
    sampling = UncertaintySampling(case, settings)
    known, _ = sampling.sampled()
    found = compared(known)
    if found.tested_ratio > 1 and found.error_upper_m > found.tolerance_m:
        return found
    return compared(sampling.completed(known))


def _without_auto(keys: Keys, stage: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """A stage's keys without those that are to be chosen on the campaign, and the names of these."""
    own = keys.get(stage, {})
    chosen = () if stage == "uncertainty" else tuple(name for name, value in own.items() if value == AUTO)
    # The rung's "auto" is a value of its own: the ladder is part of the stage.
    chosen = tuple(name for name in chosen if name not in ("rung", "sticking"))
    return {name: value for name, value in own.items() if name not in chosen}, chosen


def off_at_most_m(result: PipelineResult, time_s: Array, true: Array) -> float:
    """Largest distance of the simulated path from the true poses (n, 3) of the object at times (n,) [m]."""
    at = np.searchsorted(time_s, result.time_s - 1e-3)
    return float(np.hypot(*(result.simulated - true[at])[:, :2].T).max())
