"""Model selection for the stage uncertainty: the number of draws of a run, and which inputs and effects matter."""

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
    """Sample the uncertainty of a run; its choices state the error left by the draws, and the shift by each effect."""
    sampling = UncertaintySampling(case, settings, progress)
    found, error = sampling.sampled()
    # A few draws may have been left out; the number requested is a power of two.
    count = 1 << (found.samples - 1).bit_length()
    what = f"bounds known to {100 * error:.1f} % (one standard error)"
    # Standard deviation of a root mean square over n normal draws.
    change = position_rms(found.validation) / np.sqrt(2 * found.samples)
    choice = Choice("draws", f"{count}: {what}", f"{2 * count}", change, "of u_val, as expected")
    found = sampling.completed(found)
    limit_m = SHARE * measurement_m
    inputs = to_be_measured(found, case.scene, case.deviations, limit_m)
    return replace(found, choices=(choice, *sampling.effects(found, limit_m), *inputs))
