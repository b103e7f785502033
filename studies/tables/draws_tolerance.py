"""What the draws of the uncertainty cost and err at several tolerances, on results of a campaign.

python -m studies.tables.draws_tolerance path/to/campaign path/to/results/campaign RUN...
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

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


def main() -> None:
    """Print CPU time and error of the paths at each tolerance, for each run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("runs", nargs="+")
    given = parser.parse_args()
    print(f"{DRAWS} draws against {REFERENCE_M:g} m; CPU ms a draw, RMS and largest distance of the paths in mm")
    for run in given.runs:
        sampler = Sampler(case_of(given.campaign, given.results, run), UncertaintySettings())
        rng = np.random.default_rng(3)
        drawn = [sampler.lay_out(i, rng.standard_normal(sum(sampler.widths.values())))[0] for i in range(DRAWS)]
        found: dict[float, list[np.ndarray]] = {}
        for tolerance in (REFERENCE_M, *TOLERANCES_M):
            batch = replace(sampler.batch, tolerance_m=tolerance)
            start = time.process_time()
            found[tolerance] = [*batch.simulate(drawn)]
            spent = time.process_time() - start
            apart = np.linalg.norm(np.subtract(found[tolerance], found[REFERENCE_M])[..., :2], axis=-1)
            off, most = 1e3 * np.sqrt(np.nanmean(apart**2)), 1e3 * np.nanmax(apart)
            print(f"{run:4}{tolerance:8g}{1e3 * spent / DRAWS:8.1f}{off:9.4f}{most:9.4f}", flush=True)


if __name__ == "__main__":
    main()
