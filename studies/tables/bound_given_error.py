"""Whether the first bound could be shorter: what the error of a run tells of the measurement's own.

    python -m studies.tables.bound_given_error [--first 6200] [--runs 10] [--samples 512]

If the model is right, E is made by the same inputs as what the measurement is off, d, so E tells something of d: each
draw is moved to what it would be, given E, by the draws' linear regression on their inputs. For runs of
:mod:`studies.worlds.verdict_worlds`: u_D before and after that, the bound by each, and what the simulation was off.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from studies.tables.verdict_worlds import cases, largest
from studies.worlds.towed_runs import TrueCamera, nominal_calibration
from studies.worlds.verdict_worlds import WORLDS, number_of, world_run
from towval.commands.console import errors_reported
from towval.model import Array
from towval.model.geometry import block_means, signature_blocks
from towval.validation.path_frame import OnPath
from towval.validation.sampler import UncertaintySettings
from towval.validation.statistics import SIZES, bounds
from towval.validation.uncertainty import UncertaintySampling

TRIED = ("level", "heights", "lab", "tether", "engine")
_CONFIDENCE = 0.95
_FLOOR = 0.1
"""Of the root mean square of the block means, what the regression leaves at least."""


def given_error(path: OnPath, inputs: Array) -> tuple[float, float, Array]:
    """u_D as drawn and given E [m], by their parts that are linear in the inputs (k, d); and draws (k, n, 3) of d."""
    basis = np.column_stack([np.ones(len(inputs)), inputs])
    error, drawn, off = (_blocks(each) for each in (path.error, path.drawn, path.off))
    by_error, by_off = (np.linalg.lstsq(basis, each, rcond=None)[0] for each in (drawn, off))
    rest = drawn - basis @ by_error
    floor = np.tile(np.mean(drawn.reshape(len(drawn), -1, 3) ** 2, axis=(0, 1)), drawn.shape[1] // 3)
    noise = rest.T @ rest / (len(inputs) - basis.shape[1]) + _FLOOR**2 * np.diag(floor)
    effects, moves = by_error[1:], by_off[1:]
    left = np.linalg.inv(np.eye(len(effects)) + effects @ np.linalg.solve(noise, effects.T))
    gain = left @ effects @ np.linalg.inv(noise)
    shift = ((error - drawn) @ gain.T @ moves).reshape(len(inputs), -1, 3)
    widths = [len(rows) for rows in signature_blocks(len(path.error))]
    place = np.arange(moves.shape[1]) % 3 < 2
    before, after = (
        float(np.sqrt(np.trace((moves.T @ spread @ moves)[np.ix_(place, place)]) / len(widths)))
        for spread in (np.eye(len(moves)), left)
    )
    return before, after, path.off + np.repeat(shift, widths, axis=1)


def _blocks(error: Array) -> Array:
    means = block_means(error)
    return means.reshape(*means.shape[:-2], -1)


@dataclass(frozen=True)
class Known:
    """What is known of a run's error [mm]: u_D and the first bound as drawn, and both given E; what it is at most."""

    world: str
    seed: int
    u_d: float
    u_d_given: float
    bound: float
    bound_given: float
    off: float


def known_errors(seeds: range, samples: int) -> Iterator[Known]:
    """Each world's runs."""
    for name in TRIED:
        for seed in seeds:
            number = number_of(name, seed)
            run = world_run(WORLDS[name], number)
            true = run.truth()
            case = cases(run, TrueCamera(nominal_calibration(), number), f"{name} {seed}")(true)
            sampling = UncertaintySampling(case, UncertaintySettings(samples=samples))
            known = sampling.describe(samples)
            path = sampling.on_path(known)
            assert path is not None
            assert known.draws is not None
            before, after, off = given_error(path, known.draws.inputs)
            upper = (bounds(path.error, each, _CONFIDENCE)[1, SIZES.index("position_max")] for each in (path.off, off))
            found = (before, after, *upper, largest(case.simulated.pose - true))
            yield Known(name, seed, *(1e3 * float(each) for each in found))


@errors_reported()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=6200)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--samples", type=int, default=512)
    given = parser.parse_args()
    print("| run | u_D | given E | first bound | given E | off at most |")
    print("|---" * 6 + "|")
    for each in known_errors(range(given.first, given.first + given.runs), given.samples):
        numbers = (each.u_d, each.u_d_given, each.bound, each.bound_given, each.off)
        print(f"| {each.world} {each.seed} | " + " | ".join(f"{number:.2f}" for number in numbers) + " |", flush=True)


if __name__ == "__main__":
    main()
