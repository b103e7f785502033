"""What bounds the error of a simulation whose v_s and v_k are stated 25 % too large, all else being exact.

    python -m studies.tables.speeds_misstated [--first 7000] [--runs 10] [--samples 256]

Runs of two worlds of :mod:`studies.worlds.verdict_worlds`, measured by the camera that these have and by one whose
deviations are 0.3 times as large, as in the filmed lab_a. All other inputs are stated as they are, with their
deviations.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from studies.tables.verdict_worlds import cases, judged, largest
from studies.worlds.towed_runs import ROVER, TOWED, TrueCamera, nominal_calibration
from studies.worlds.verdict_worlds import WORLDS, number_of, with_stated, world_run
from towval.commands.console import errors_reported
from towval.model import Body, Verdict
from towval.validation.sampler import UncertaintySettings
from towval.validation.uncertainty import UncertaintySampling

SCALES = (1.0, 0.3)
"""Of the camera's deviations, the heights' and those of the registration."""

TOO_LARGE = 1.25
OF_WORLDS = ("tether", "lab")


@dataclass(frozen=True)
class Judged:
    """A verdict, RMS of simulated minus measured, u_D, first bound, and by what the simulation was off at most."""

    verdict: Verdict
    path_rms_m: float
    u_d_m: float
    upper_m: float
    off_m: float


def judged_run(name: str, seed: int, scale: float, samples: int) -> Judged:
    """Judge a run of a world whose speeds are misstated, before a camera with ``scale`` times the usual deviations."""
    run = world_run(WORLDS[name], number_of(name, seed))
    exact = {number: value.copy() for number, value in run.true.items()}
    run = with_stated(run, **exact | {"friction_velocity": TOO_LARGE * exact["friction_velocity"]})
    camera, true = TrueCamera(nominal_calibration(scale), seed, scale), run.truth()
    case = cases(run, camera, f"{name} {seed}", (_scaled(ROVER, scale), _scaled(TOWED, scale)))(true)
    sampling = UncertaintySampling(case, UncertaintySettings(samples=samples))
    known = sampling.with_faults(sampling.describe(samples))
    result, path = judged(case, known), sampling.on_path(known)
    assert path is not None
    u_d = float(np.sqrt(np.mean(np.sum(path.off[..., :2] ** 2, axis=-1))))
    return Judged(result.verdict, result.path_rms_m, u_d, result.error_upper_m, largest(case.simulated.pose - true))


def _scaled(body: Body, scale: float) -> Body:
    return replace(body, height_std_m=scale * body.height_std_m)


def rows(seeds: range, samples: int) -> Iterator[str]:
    """The table in Markdown."""
    yield "| run | camera | verdict | E RMS | u_D | first bound | off at most |"
    yield "|---" * 7 + "|"
    for scale in SCALES:
        for name in OF_WORLDS:
            for seed in seeds:
                found = judged_run(name, seed, scale, samples)
                numbers = (found.path_rms_m, found.u_d_m, found.upper_m, found.off_m)
                cells = " | ".join(f"{1e3 * each:.2f}" for each in numbers)
                yield f"| {name} {seed} | {scale:g} | {found.verdict} | {cells} |"


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=7000)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--samples", type=int, default=256)
    given = parser.parse_args()
    for row in rows(range(given.first, given.first + given.runs), given.samples):
        print(row, flush=True)


if __name__ == "__main__":
    main()
