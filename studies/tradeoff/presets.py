"""Cost and error of the whole pipeline by preset, on a synthetic campaign with ground truth."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from studies.costs import take_turns
from studies.frame import Part, Row, Scatter, Settings, Study
from studies.worlds.folder import write_campaign
from towval.calibration.calibrate import CalibrateSettings, calibrate
from towval.io.campaign import Campaign, load_campaign
from towval.io.images import read_gray
from towval.io.video import Video
from towval.model import Array, Calibration, Choice, Comparison, Track
from towval.model.presets import PRESETS, STANDARD, settings_of
from towval.selection.draws import sample_selecting
from towval.selection.lens import with_lens_choice
from towval.selection.margin import measurement_std_m, seen_places
from towval.selection.sample_points import track_selecting
from towval.selection.simulation import simulate_selecting
from towval.selection.tracking import PROBE_FRAMES, PROBE_STRIDE, neighbour_of_tracking
from towval.tracking.track import TrackSettings, track
from towval.validation.compare import compare
from towval.validation.decimate import decimate
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.simulate import SimulateSettings

AUTO = "auto"


@dataclass(frozen=True)
class PipelineResult:
    """What a run of the whole pipeline ends with, what each stage chose for it, and the wall time that it took [s].

    ``kept`` poses of the object's and of the rover's track, after decimation.
    """

    measured: dict[str, Track]
    simulated: Array
    time_s: Array
    comparison: Comparison
    wall_s: float
    choices: tuple[Choice, ...] = ()
    kept: tuple[int, ...] = ()


def preset_rows(presets: list[str], frames: int, rounds: int, seed: int) -> list[Row]:
    """A row a preset and path: CPU seconds of all stages but the pictures of the report, error in mm, u_val, wall time.

    The error is the RMS distance of the measured and of the simulated path from ground truth, and from each other: the
    model is exact here, so their difference is the pipeline's own error. Beside it the largest distance of the
    simulated path from ground truth, and the bound that the verdict states of it.
    """
    with TemporaryDirectory() as folder:
        place = Path(folder) / "synthetic"
        place.mkdir()
        truth = write_campaign(place, seed, frames)
        given = load_campaign(place)
        timed = take_turns({name: partial(run_pipeline, given, name) for name in presets}, rounds)
    rows = []
    for name, one in timed.items():
        result = one.result
        at = np.searchsorted(truth["time_s"], result.time_s - 1e-3)
        tracked = result.measured["object"]
        gaps = {
            "measured path": tracked.pose[tracked.seen] - truth["object"][tracked.seen],
            "simulated path": result.simulated - truth["object"][at],
        }
        errors = {path: float(np.sqrt(np.mean(np.sum(gap[:, :2] ** 2, axis=1)))) for path, gap in gaps.items()}
        errors["simulated - measured"] = result.comparison.path_rms_m
        errors["stated u_val"] = result.comparison.u_val_m
        errors["largest error"] = float(np.hypot(*gaps["simulated path"][:, :2].T).max())
        errors["bound of it"] = result.comparison.error_upper_m
        rows += [
            {
                "panel": quantity,
                "series": name,
                "setting": name,
                "cost": one.cpu_s,
                "cost_most": one.cpu_most_s,
                "wall_s": result.wall_s,
                "error": 1e3 * error,
                "verdict": str(result.comparison.verdict),
                "default": name == STANDARD,
            }
            for quantity, error in errors.items()
        ]
    return rows


def run_pipeline(given: Campaign, preset: str) -> PipelineResult:
    """All stages of a campaign's first run under a preset, from the pictures to the verdict."""
    began = time.perf_counter()
    calibration = calibrated(given, _keys(preset, "calibrate")[0])
    entry = given.run(next(iter(given.runs)))
    keys, auto = _keys(preset, "track")
    seen = (calibration, given.bodies, entry.clicks_px, TrackSettings(**keys))
    if "samples" in auto:
        _, tracks = track_selecting(Video(entry.video), *seen, given.scene)
    else:
        tracks = track(Video(entry.video), *seen)
        few = list(itertools.islice(Video(entry.video), 0, PROBE_FRAMES * PROBE_STRIDE, PROBE_STRIDE))
        neighbour_of_tracking(few, *seen)
    thin = {name: decimate(body) for name, body in tracks.items()}
    measured = measurement_std_m(calibration, given.object, seen_places(tracks["object"]))
    keys, auto = _keys(preset, "simulate")
    times = tracks["object"].time_s
    _, motion = simulate_selecting(
        given.scene, thin["rover"], thin["object"], times, SimulateSettings(**keys), auto=auto, measurement_m=measured
    )
    rover, towed = tracks["rover"], tracks["object"]
    case = Case(
        given.scene, given.deviations, calibration, *given.bodies, rover, thin["rover"], towed, thin["object"], motion
    )
    settings = UncertaintySettings(**settings_of(preset, "uncertainty"))
    uncertainty = sample_selecting(case, settings, measurement_m=measured)
    comparison = compare(entry.video.stem, motion, tracks["object"], uncertainty)
    choices = (*calibration.choices, *tracks["object"].choices, *motion.choices, *uncertainty.choices)
    kept = tuple(len(each.time_s) for each in thin.values())
    return PipelineResult(tracks, motion.pose, motion.time_s, comparison, time.perf_counter() - began, choices, kept)


def _keys(preset: str, stage: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """A stage's keys under a preset without those that are to be chosen, and the names of these."""
    keys = settings_of(preset, stage)
    auto = tuple(name for name, value in keys.items() if value == AUTO)
    return {name: value for name, value in keys.items() if name not in auto}, auto


def calibrated(given: Campaign, keys: dict[str, Any]) -> Calibration:
    """The camera of a campaign, found with these keys of ``config["calibrate"]`` in this process alone."""
    keys = {name: tuple(value) if isinstance(value, list) else value for name, value in keys.items()}
    settings = CalibrateSettings(**keys, threads=1)
    calibration = calibrate(
        [(path.name, read_gray(path, given.resolution_px)) for path in given.calibration_images],
        [(path.name, read_gray(path, given.resolution_px)) for path in given.floor_images],
        given.board,
        given.floor_reference,
        settings,
        heights_m=[body.tracked_plane_height_m for body in given.bodies],
    )
    return with_lens_choice(
        calibration, given.board, given.floor_reference, settings, given.object.tracked_plane_height_m
    )


def _parts(settings: Settings) -> dict[str, Part]:
    if settings.quick:
        return {"all": {"presets": ["draft", "standard", "auto"], "frames": 50, "rounds": 1, "seed": 0}}
    given = {"presets": list(PRESETS), "frames": 80, "rounds": 2}
    return {f"seed_{seed}": {**given, "seed": seed} for seed in range(7100, 7110)}


def _why(rows: pd.DataFrame) -> str:
    path = rows[rows["panel"] == "measured path"].set_index("setting")
    times = path["cost"] / path["cost"][STANDARD]
    errors = ", ".join(f"{name} {path['error'][name]:.2g} mm" for name in PRESETS)
    return (
        f"Draft takes {times['draft']:.0%} of its time, fine {times['fine']:.0%}, auto {times[AUTO]:.0%}. Measured "
        f"paths are off by: {errors}; frames of floor and body make most of it, which no preset changes. Draft's draws "
        "are too coarse for a verdict; auto is not the default, so that campaigns have the same settings and can be "
        "compared."
    )


STUDY = Study(
    parts=_parts,
    rows=preset_rows,
    chart=Scatter(
        title="The whole pipeline, preset by preset",
        cost="CPU time [s]",
        error="error [mm]",
        note="Synthetic campaigns, 800 × 450 pixels of 6 mm. CPU time of all stages, without figures and overlay; RMS "
        "errors but for the last two panels. Labels: presets. Stated u_val is what the errors are to "
        "stay below: less of it is no merit in itself. The bound is to be above the largest error, and no more than "
        "it must.",
        take="Take standard, the default.",
        why=_why,
        truth="The films share the camera model with calibration and tracking; the motion shares no code.",
    ),
)
