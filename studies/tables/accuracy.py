"""Measured and simulated paths against the ground truth of a synthetic campaign, as a table.

    python -m studies.tables.accuracy results/lab_a path/to/lab_a

The campaign folder holds `<run>_truth.csv` for the runs whose ground truth is known; the others are left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from towval.io.records import read_comparison, read_tracks
from towval.model import Array, Track
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
    print("{:4}{:8}{:>12}{:>12}{:>19}{:>10}{:>25}".format(*columns))
    for path in sorted(campaign.glob("*_truth.csv")):
        run = path.stem.removesuffix("_truth")
        truth, comparison = pd.read_csv(path), read_comparison(results / run / "compare.mcap")
        for body, track in sorted(read_tracks(results / run / "track.mcap").items()):
            position, heading, shape, lost, frames = errors(track, truth)
            simulated = f"{1e3 * comparison.path_rms_m:25.3f}" if body == "object" else ""
            print(f"{run:4}{body:8}{position:12.3f}{heading:12.4f}{shape:19.3f}{f'{lost}/{frames}':>10}{simulated}")


if __name__ == "__main__":
    main()
