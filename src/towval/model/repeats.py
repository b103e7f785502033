"""The common error of runs that repeat the same drive."""

import math
from dataclasses import dataclass

from towval.model.checks import Array, lock
from towval.model.geometry import rms_length


@dataclass(frozen=True)
class Corridor:
    """Errors of runs that repeat one drive, over the length of the measured path.

    ``runs`` (r,) by name; ``length_m`` (k,); ``errors`` (r, k, 2) simulated minus measured along and across the path,
    interpolated where a run was not seen; ``mean`` (k, 2) over the runs and ``half_width`` (k, 2) of the interval in
    which the error common to all lies at one place with 95 %, by Student's t; ``std`` (k, 2) of one run about the
    mean [m]. ``apart_m``: by how much the measured paths differ at most. ``u_val_m``: what the deviations state of the
    error of a run, RMS.
    """

    runs: tuple[str, ...]
    length_m: Array
    errors: Array
    mean: Array
    half_width: Array
    std: Array
    apart_m: float
    u_val_m: float

    def __post_init__(self) -> None:
        k = len(self.length_m)
        lock(self, length_m=(k,))
        lock(self, finite=False, errors=(len(self.runs), k, 2), mean=(k, 2), half_width=(k, 2), std=(k, 2))

    @property
    def common_m(self) -> float:
        """RMS over the path of the error that all runs have in common: of the mean, less what scatter leaves in it."""
        return math.sqrt(max(0.0, rms_length(self.mean) ** 2 - self.scatter_m**2 / len(self.runs)))

    @property
    def scatter_m(self) -> float:
        """RMS over the path of one run about that error."""
        return rms_length(self.std)
