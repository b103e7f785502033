"""Model selection for the stage uncertainty: how many draws a run needs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from towval.model import Choice, RunUncertainty
from towval.model.geometry import position_rms
from towval.selection.margin import SHARE
from towval.validation.effects import to_be_measured
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.uncertainty import UncertaintySampling

DRAWS = (256, 512, 1024, 2048)
"""What "auto" chooses from, cheapest first; with 128 a right model exceeds its limits of 1 % in 2 % of runs."""

BOUND_ERROR = 0.05
"""Standard error that the number of draws may leave of the bounds, over their values."""

_CONFIDENCE = 0.95  # of the bounds, for their error


def sample_selecting(
    case: Case,
    settings: UncertaintySettings,
    *,
    auto: bool,
    measurement_m: float,
    progress: Callable[[int], None] | None = None,
) -> RunUncertainty:
    """Sample the uncertainty of a run; under ``auto`` with as many draws as its bounds need.

    That is until the standard error of both upper bounds of the largest error, the simulation's and the model's, is
    :data:`BOUND_ERROR` of them. The choice states it.
    """
    sampling = UncertaintySampling(case, settings, progress)
    count = DRAWS[0] if auto else settings.samples
    found, error = _sampled(sampling, count)
    while auto and error > BOUND_ERROR and count < DRAWS[-1]:
        # It falls with the root of the number; the first estimate is rough, so no step is longer than four times.
        needed = min(count * (error / BOUND_ERROR) ** 2, 4 * count)
        count = next((each for each in DRAWS if count < each >= needed), DRAWS[-1])
        found, error = _sampled(sampling, count)
    what = f"bounds known to {100 * error:.1f} % (one standard error)"
    # The standard deviation of a root mean square over n normal draws.
    change = position_rms(found.validation) / np.sqrt(2 * found.samples)
    choice = Choice("draws", f"{count}: {what}", f"{2 * count}", change, "of u_val, as expected")
    found = sampling.completed(found)
    limit_m = SHARE * measurement_m
    inputs = to_be_measured(found, case.deviations, limit_m)
    return replace(found, choices=(choice, *sampling.effects(found, limit_m), *inputs))


def _sampled(sampling: UncertaintySampling, count: int) -> tuple[RunUncertainty, float]:
    """The uncertainty of so many draws, and the error that they leave of the bounds; none where there are no bounds."""
    found = sampling.describe(count)
    path = sampling.on_path(found)
    return found, 0.0 if path is None else path.bound_error(_CONFIDENCE)
