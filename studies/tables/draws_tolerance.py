"""What the draws of the uncertainty cost and err at several tolerances, on results of a campaign.

python -m studies.tables.draws_tolerance path/to/campaign path/to/results/campaign RUN...
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from towval.commands.console import errors_reported
from towval.io.campaign import load_campaign
from towval.io.records import read_calibration, read_decimated, read_simulated, read_tracks
from towval.validation.sampler import Case, Sampler, UncertaintySettings

DRAWS = 24
REFERENCE_M = 1e-8
TOLERANCES_M = (1e-7, 1e-6, 3e-6, 1e-5)


def case_of(campaign: Path, results: Path, run: str) -> Case:
    """A run as the stage uncertainty reads it."""
    given, folder = load_campaign(campaign), results / run
    tracks, thin = read_tracks(folder / "track.mcap"), read_decimated(folder / "decimate.mcap")
    return Case(
        given.scene, given.deviations, read_calibration(results / "camera.mcap"), *given.bodies,
        rover_track=tracks["rover"], rover_decimated=thin["rover"], object_track=tracks["object"],
        object_decimated=thin["object"], simulated=read_simulated(folder / "simulate.mcap"), run=run,
    )  # fmt: skip


@dataclass(frozen=True)
class DrawnPaths:
    """What draws at a tolerance of a step [m] cost each [s], and the RMS and largest distance of their paths [m]."""

    tolerance_m: float
    cpu_s: float
    off_m: float
    most_m: float


def drawn_paths(case: Case) -> Iterator[DrawnPaths]:
    """The same draws of a run at each tolerance, against those at :data:`REFERENCE_M`."""
    sampler = Sampler(case, UncertaintySettings())
    rng = np.random.default_rng(3)
    drawn = [sampler.lay_out(i, rng.standard_normal(sum(sampler.widths.values())))[0] for i in range(DRAWS)]
    exact = [*replace(sampler.batch, tolerance_m=REFERENCE_M).simulate(drawn)]
    for tolerance in TOLERANCES_M:
        start = time.process_time()
        found = [*replace(sampler.batch, tolerance_m=tolerance).simulate(drawn)]
        spent = time.process_time() - start
        apart = np.linalg.norm(np.subtract(found, exact)[..., :2], axis=-1)
        yield DrawnPaths(tolerance, spent / DRAWS, float(np.sqrt(np.nanmean(apart**2))), float(np.nanmax(apart)))


@errors_reported()
def main() -> None:
    """Print CPU time and error of the paths at each tolerance, for each run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("runs", nargs="+")
    given = parser.parse_args()
    print(f"{DRAWS} draws against {REFERENCE_M:g} m; CPU ms a draw, RMS and largest distance of the paths in mm")
    for run in given.runs:
        for each in drawn_paths(case_of(given.campaign, given.results, run)):
            numbers = f"{1e3 * each.cpu_s:8.1f}{1e3 * each.off_m:9.4f}{1e3 * each.most_m:9.4f}"
            print(f"{run:4}{each.tolerance_m:8g}{numbers}", flush=True)


if __name__ == "__main__":
    main()
