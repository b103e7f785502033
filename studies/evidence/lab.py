"""Checks on filmed campaigns whose truth other programs made, lab_a and lab_c, with all stages as the workflow has."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pandas as pd

from studies.evidence.compute import REPOSITORY, shared_folder
from studies.evidence.ledger import Check, Values
from studies.evidence.planting import Planting, both, flawed, replaced, result_of, tethered_longer
from studies.tables.accuracy import errors, off_at_most
from studies.tables.validation_must_reach import place_reported
from studies.tables.validation_rendered import judged
from towval.commands import calibrate, compare, simulate, track
from towval.io.campaign import load_campaign
from towval.io.records import read_simulated, read_tracks
from towval.model import Array, RunUncertainty, TowingScene, Track
from towval.validation import compare as validation_compare
from towval.validation import decimate
from towval.validation import simulate as validation_simulate

_HERE = sys.modules[__name__]


def stated(campaign: Path) -> str:
    """What campaign.yaml says."""
    return (campaign / "campaign.yaml").read_text(encoding="utf-8")


def restated(source: Path, campaign: Path, text: str) -> None:
    """A campaign with the pictures and videos of another, whose campaign.yaml says something else."""
    campaign.mkdir(parents=True)
    for entry in source.iterdir():
        if entry.name != "campaign.yaml":
            os.symlink(entry, campaign / entry.name)
    (campaign / "campaign.yaml").write_text(text, encoding="utf-8")


def _campaign(name: str) -> Callable[[], Values]:
    """Errors of the tracks against the truth, and what is said of each run."""

    def measure() -> Values:
        source = shared_folder() / "footage" / name
        found: dict[str, float | str] = {}
        with TemporaryDirectory() as folder:
            campaign, results = Path(folder) / name, Path(folder) / "results"
            restated(source, campaign, stated(source))
            for run in re.findall(r"(?m)^  (\w+):\n    video:", stated(source)):
                found |= _run(campaign, results, run)
        return found

    return measure


def _run(campaign: Path, results: Path, run: str) -> dict[str, float | str]:
    result = judged(campaign, results, run)
    found: dict[str, float | str] = {
        f"run {run}, verdict": str(result.verdict),
        f"run {run}, simulated − measured": 1e3 * result.path_rms_m,
        f"run {run}, bound": 1e3 * result.error_upper_m,
        f"run {run}, largest error": 1e3 * result.path_max_m,
        f"run {run}, visible from": 1e3 * result.detectable_m,
        f"run {run}, u_val": 1e3 * result.u_val_m,
    }
    place = place_reported(result)
    if place:
        found |= {f"run {run}, begins after": place[0], f"run {run}, begins before": place[1]}
    if (campaign / f"{run}_truth.csv").is_file():
        truth = pd.read_csv(campaign / f"{run}_truth.csv")
        for body, found_track in read_tracks(results / run / "track.mcap").items():
            position, heading, _, lost, _ = errors(found_track, truth)
            found |= {f"run {run}, {body}, position": position, f"run {run}, {body}, heading": heading}
            found[f"run {run}, {body}, frames lost"] = float(lost)
        simulated = read_simulated(results / run / "simulate.mcap")
        off_mm = off_at_most(simulated, truth)
        found |= {
            f"run {run}, simulated − true, at most": off_mm,
            f"run {run}, bound over simulated − true": 1e3 * result.error_upper_m / off_mm,
        }
    return found


def _decimated() -> Values:
    """Poses of the rover that are kept, errors of their rates, and of the tow behind them, with two rules of noise."""
    found: dict[str, float | str] = {}
    sources = {"lab_small": REPOSITORY / "data_samples/lab_small", "lab_a": shared_folder() / "footage/lab_a"}
    for name, source in sources.items():
        with TemporaryDirectory() as folder:
            camera = Path(folder) / "camera.mcap"
            calibrate.run(source, camera)
            for run in "ab":
                track.run(source, run, camera, Path(folder) / "track.mcap")
                tracks, truth = read_tracks(Path(folder) / "track.mcap"), pd.read_csv(source / f"{run}_truth.csv")
                scene = load_campaign(source).scene
                found |= {f"{name} {run}, {what}": value for what, value in _thinned(scene, tracks, truth).items()}
                with patch.object(decimate, "noise_in_motion", without_noise_in_motion(decimate.noise_in_motion)):
                    followed = _thinned(scene, tracks, truth)
                found |= {f"{name} {run}, noise by differences, {what}": value for what, value in followed.items()}
    return found


def without_noise_in_motion(_: Callable[..., Array]) -> Callable[..., Array]:
    """The rule that is compared: differences alone tell the noise."""
    return lambda *_: np.zeros(3)


def _thinned(scene: TowingScene, tracks: Mapping[str, Track], truth: pd.DataFrame) -> dict[str, float]:
    """Poses kept of the rover, RMS errors of its rates between frames [mm/s] and of the simulated path [mm]."""
    rover, towed = (decimate.decimate(tracks[body]) for body in ("rover", "object"))
    time_s, clock = tracks["rover"].time_s, truth["t_s"]
    half_way = (time_s[1:] + time_s[:-1]) / 2
    rates = [np.interp(half_way, clock, np.gradient(truth[f"rover_{axis}_m"], clock)) for axis in "xy"]
    off = rover.poses_and_rates_at(half_way)[:, 3:5] - np.column_stack(rates)
    motion = validation_simulate.simulate(scene, rover, towed, time_s)
    path = np.column_stack([np.interp(motion.time_s, clock, truth[f"object_{axis}_m"]) for axis in "xy"])
    return {
        "kept": float(len(rover.time_s)),
        "rates": 1e3 * float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
        "path": 1e3 * float(np.sqrt(np.mean(np.sum((motion.pose[:, :2] - path) ** 2, axis=1)))),
    }


def stating(**instead: str) -> Planting:
    """The campaign states other values of some keys, the first of each name."""

    def changed(text: str) -> str:
        for key, value in instead.items():
            text = re.sub(rf"{key}: [\d.]+", f"{key}: {value}", text, count=1)
        return text

    return replaced(_HERE, "stated", result_of(changed))


def _halved(found: RunUncertainty) -> RunUncertainty:
    return replace(found, validation=found.validation / 4)


def _late(tracks: Mapping[str, Track]) -> dict[str, Track]:
    rover = tracks["rover"]
    return {**tracks, "rover": replace(rover, pose=np.concatenate([rover.pose[:1], rover.pose[:-1]]))}


_BOUNDS_HALVED = replaced(validation_compare, "bounds", result_of(lambda found: found / 2))

LAB_A = Check(
    _campaign("lab_a"),
    {
        "board stated 0.3 % too large, the rover's poses are a frame late": both(
            stating(square_m="0.04012"), replaced(track, "track", result_of(_late))
        ),
        "the tether is 5 mm too long in the simulation alone, u_val and the tolerance are halved": both(
            replaced(simulate, "simulate_selecting", tethered_longer(5e-3)),
            replaced(compare, "read_uncertainty", result_of(_halved)),
            replaced(validation_compare, "TOLERANCE_M", lambda tolerance: tolerance / 2),
        ),
        "poses scatter by 1 mm and 0.1°, some are lost; friction is 20 times as unsure; bounds are halved": both(
            replaced(track, "track", flawed(1e-3, 2e-3)), stating(kinetic_std="0.1"), _BOUNDS_HALVED
        ),
    },
    needs=("footage/lab_a",),
)

LAB_C = Check(
    _campaign("lab_c"),
    {
        "board stated 1 % too large, tether 3 cm too long": stating(square_m="0.0404", rest_length_m="0.63"),
        "poses scatter by 1 mm and 0.1°, some are lost; stiffness and mass are 7 times as unsure; bounds halved": both(
            replaced(track, "track", flawed(1e-3, 2e-3)),
            stating(stiffness_std_N_per_m="200", mass_std_kg="0.3"),
            _BOUNDS_HALVED,
        ),
    },
    needs=("footage/lab_c",),
)

DECIMATED_RATES = Check(
    _decimated,
    {
        "differences alone tell the noise, in both": replaced(decimate, "noise_in_motion", without_noise_in_motion),
        "the stage's noise is taken, in both": replaced(
            _HERE, "without_noise_in_motion", lambda _: lambda original: original
        ),
        "the rover's poses are a frame late": replaced(track, "track", result_of(_late)),
    },
    needs=("footage/lab_a",),
)
