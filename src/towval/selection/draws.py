"""Model selection for the stage uncertainty: how many draws a run took, and which inputs and effects count."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from towval.model import Choice, RunUncertainty
from towval.model.geometry import position_rms
from towval.selection.margin import SHARE
from towval.validation.effects import to_be_measured
from towval.validation.sampler import Case, UncertaintySettings
from towval.validation.uncertainty import UncertaintySampling


def sample_selecting(
    case: Case, settings: UncertaintySettings, *, measurement_m: float, progress: Callable[[int], None] | None = None
) -> RunUncertainty:
    """Sample the uncertainty of a run; the choices say what its draws leave open, and what each effect would move."""
    sampling = UncertaintySampling(case, settings, progress)
    found, error = sampling.sampled()
    # A few draws may have been left out; what was asked for is a power of two.
    count = 1 << (found.samples - 1).bit_length()
    what = f"bounds known to {100 * error:.1f} % (one standard error)"
    # The standard deviation of a root mean square over n normal draws.
    change = position_rms(found.validation) / np.sqrt(2 * found.samples)
    choice = Choice("draws", f"{count}: {what}", f"{2 * count}", change, "of u_val, as expected")
    found = sampling.completed(found)
    limit_m = SHARE * measurement_m
    inputs = to_be_measured(found, case.deviations, limit_m)
    return replace(found, choices=(choice, *sampling.effects(found, limit_m), *inputs))
