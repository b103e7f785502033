"""Measured and simulated paths against the ground truth of a synthetic campaign, as a table.

    python -m studies.tables.accuracy results/lab_a path/to/lab_a

The campaign folder holds `<run>_truth.csv` for the runs whose ground truth is known; the others are left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from towval.commands.console import errors_reported
from towval.io.records import read_comparison, read_simulated, read_tracks
from towval.model import Array, SimulatedMotion, Track
from towval.model.geometry import wrapped


def errors(track: Track, truth: pd.DataFrame) -> tuple[float, float, float, int, int]:
    """Position RMS [mm], heading RMS [deg], the same position RMS without its mean, frames lost, frames."""
    names = [f"{track.body}_x_m", f"{track.body}_y_m", f"{track.body}_heading_rad"]
    true = np.column_stack([np.interp(track.time_s, truth.t_s, truth[name]) for name in names])
    error = (track.pose - true)[track.seen]
    error[:, 2] = wrapped(error[:, 2])
    shape = error[:, :2] - error[:, :2].mean(axis=0)

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(np.sum(np.square(values), axis=-1))))

    lost = int(np.count_nonzero(~track.seen))
    return 1e3 * rms(error[:, :2]), float(np.degrees(rms(error[:, 2:]))), 1e3 * rms(shape), lost, len(track.time_s)


def off_at_most(simulated: SimulatedMotion, truth: pd.DataFrame) -> float:
    """Largest distance of the simulated from the true object [mm]: no honest bound of it is lower."""
    true = [np.interp(simulated.time_s, truth.t_s, truth[f"object_{axis}_m"]) for axis in "xy"]
    return 1e3 * float(np.linalg.norm(simulated.pose[:, :2] - np.column_stack(true), axis=1).max())


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="results of the campaign")
    parser.add_argument("campaign", type=Path, help="folder of the campaign")
    given = parser.parse_args()
    print_errors(given.results, given.campaign)


def print_errors(results: Path, campaign: Path) -> None:
    """Print a line for each run and body."""
    columns = ("run", "body", "position mm", "heading deg", "offset removed mm", "lost", "simulated - measured mm")
    bounds = ("simulated - true at most", "bound")
    print("{:4}{:8}{:>12}{:>12}{:>19}{:>10}{:>25}{:>26}{:>8}".format(*columns, *bounds))
    for path in sorted(campaign.glob("*_truth.csv")):
        run = path.stem.removesuffix("_truth")
        truth, comparison = pd.read_csv(path), read_comparison(results / run / "compare.mcap")
        for body, track in sorted(read_tracks(results / run / "track.mcap").items()):
            position, heading, shape, lost, frames = errors(track, truth)
            off = off_at_most(read_simulated(results / run / "simulate.mcap"), truth)
            found = f"{1e3 * comparison.path_rms_m:25.3f}{off:26.2f}{1e3 * comparison.error_upper_m:8.2f}"
            simulated = found if body == "object" else ""
            print(f"{run:4}{body:8}{position:12.3f}{heading:12.4f}{shape:19.3f}{f'{lost}/{frames}':>10}{simulated}")


if __name__ == "__main__":
    main()
