"""Model selection for the stage uncertainty: how many draws a run needs."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from towval.model import Body, Calibration, Choice, DecimatedTrack, RunUncertainty, SimulatedMotion, TowingScene, Track
from towval.selection.margin import SHARE
from towval.validation.effects import to_be_measured
from towval.validation.metrics import position_rms
from towval.validation.statistics import error_sizes
from towval.validation.uncertainty import Case, UncertaintySampling, UncertaintySettings

DRAWS = (128, 256, 512, 1024, 2048)
"""What "auto" chooses from, cheapest first."""

_SETTLED = 0.1  # Limits of the verdict may change by this share when the draws are doubled.


def gather(
    scene: TowingScene,
    deviations: Mapping[str, float],
    calibration: Calibration,
    bodies: tuple[Body, Body],
    tracks: Mapping[str, Track],
    decimated: Mapping[str, DecimatedTrack],
    simulated: SimulatedMotion,
    run: str = "",
    assumed: tuple[str, ...] = (),
) -> Case:
    """A run as the sampling sees it, from what the campaign gave and the stages found.

    ``bodies`` are rover and object; ``tracks`` and ``decimated`` hold theirs under these names; ``run`` its name;
    ``assumed`` the inputs of which nothing was stated.
    """
    rover, towed = bodies
    return Case(
        scene=scene,
        deviations=deviations,
        calibration=calibration,
        rover=rover,
        towed=towed,
        rover_track=tracks[rover.name],
        rover_decimated=decimated[rover.name],
        object_track=tracks[towed.name],
        object_decimated=decimated[towed.name],
        simulated=simulated,
        run=run,
        assumed=assumed,
    )


def sample_selecting(
    case: Case,
    settings: UncertaintySettings,
    *,
    auto: bool,
    measurement_m: float,
    progress: Callable[[int], None] | None = None,
) -> RunUncertainty:
    """Sample the uncertainty of a run; under ``auto`` with draws doubled until the result has settled.

    Settled: the validation uncertainty changes by less than a third of the measurement uncertainty, and the largest
    error that 95 % of the draws keep by less than a tenth.
    """
    sampling = UncertaintySampling(case, settings, progress)
    if auto:
        found, choice = _settled(sampling, measurement_m)
    else:
        found = sampling.describe(settings.samples)
        # The standard deviation of a root mean square over n normal draws.
        change = position_rms(found.validation) / np.sqrt(2 * found.samples)
        choice = Choice("draws", f"{settings.samples}", f"{2 * settings.samples}", change, "of u_val, as expected")
    found = sampling.completed(found)
    inputs = to_be_measured(found, case.deviations, SHARE * measurement_m)
    return replace(found, choices=(choice, *sampling.effects(found), *inputs))


def _settled(sampling: UncertaintySampling, measurement_m: float) -> tuple[RunUncertainty, Choice]:
    """The first number of draws whose result the next one hardly changes, and that choice."""
    found = sampling.describe(DRAWS[0])
    for count in DRAWS[1:]:
        more = sampling.describe(count)
        change = abs(position_rms(more.validation) - position_rms(found.validation))
        spread = [np.quantile(error_sizes(each.draws.error)[:, 1], 0.95) for each in (more, found) if each.draws]
        settled = change <= SHARE * measurement_m and abs(spread[0] / spread[1] - 1) <= _SETTLED
        choice = Choice("draws", f"{count}", f"{count // 2}", change, "of u_val")
        found = more
        if settled:
            break
    return found, choice
