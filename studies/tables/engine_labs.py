"""Laboratories that MuJoCo renders, through all stages: errors of tracks and simulations beside what is stated.

Neither pictures nor lens nor the motion of the object come from code of the package. Each row is a campaign of its own.

python -m studies.tables.engine_labs [--seeds 1 2 3] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from studies.camera_faults.trial import pose_errors
from studies.frame import Row
from studies.tables.validation_rendered import judged
from studies.worlds.engine_campaign import write_engine_campaign
from studies.worlds.engine_lab import can_render
from towval.commands.console import errors_reported
from towval.io.records import read_simulated, read_tracks
from towval.model import Comparison, Track
from towval.model.errors import TowvalError
from towval.model.geometry import wrapped

_WORLDS = ("level", "heights", "floor", "tether", "lab", "engine")
"""Worlds of the runs, one after the other."""


def engine_lab_rows(seeds: Iterable[int], folder: Path) -> Iterator[Row]:
    """Render, judge and measure a campaign for each seed; campaigns and results are left in a folder.

    Yields
    ------
    dict
        ``seed``, ``world``, ``verdict``, ``warnings`` (codes) and by body ``rms_mm``, ``worst`` (error of a pose over
        three stated deviations and 0.5 mm, at most) and ``within_2_std`` (share of coordinates); ``off_mm``, by which
        the simulation was off at most, and its ``bound_mm``. Of a run that was refused only the reason, in
        ``warnings``.
    """
    for seed in seeds:
        row: Row = {"seed": seed, "world": _WORLDS[seed % len(_WORLDS)]}
        campaign, results = folder / f"lab_{seed}", folder / "results" / f"lab_{seed}"
        truth = write_engine_campaign(campaign, str(row["world"]), seed)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                result = judged(campaign, results)
        except TowvalError as error:
            yield row | {"verdict": "refused", "warnings": str(error).splitlines()[0]}
            continue
        for name, track in read_tracks(results / "a" / "track.mcap").items():
            row |= {f"{name}_{what}": value for what, value in _off(track, truth).items()}
        yield row | _simulated(result, results / "a" / "simulate.mcap", truth)


def _off(track: Track, truth: pd.DataFrame) -> dict[str, float]:
    """How far the poses are off that were seen, picture by picture of the truth."""
    assert track.total_covariance is not None
    names = [f"{track.body}_{what}" for what in ("x_m", "y_m", "heading_rad")]
    off = (track.pose - truth[names].to_numpy())[track.seen]
    off[:, 2] = wrapped(off[:, 2])
    std = np.sqrt(np.diagonal(track.total_covariance[track.seen], axis1=1, axis2=2))
    over, distance = pose_errors(track, truth)
    return {
        "rms_mm": 1e3 * float(np.sqrt(np.mean(distance**2))),
        "worst": float(over.max()),
        "within_2_std": float(np.mean(np.abs(off) <= 2 * std)),
    }


def _simulated(result: Comparison, file: Path, truth: pd.DataFrame) -> Row:
    """What was said of a run, and how far its simulation, which ends with the object's track, was from the truth."""
    simulated = read_simulated(file)
    there = [np.interp(simulated.time_s, truth.t_s, truth[f"object_{axis}_m"]) for axis in "xy"]
    off = np.linalg.norm(simulated.pose[:, :2] - np.column_stack(there), axis=1)
    said = {"verdict": result.verdict.value, "warnings": result.warnings}
    return said | {"off_mm": 1e3 * float(off.max()), "bound_mm": 1e3 * result.error_upper_m}


@errors_reported()
def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(1, 13)))
    parser.add_argument("--keep", type=Path, help="folder for campaigns and results, which must be new")
    given = parser.parse_args()
    if not can_render():
        sys.exit("MuJoCo is not there or cannot render: install the extra bench, and a system with EGL")
    with tempfile.TemporaryDirectory() as scratch:
        rows = list(engine_lab_rows(given.seeds, given.keep or Path(scratch)))
    print(pd.DataFrame(rows).round(3).to_string(index=False))


if __name__ == "__main__":
    main()
