"""What can be stated about a run: its draws, the faults that would show, the verdict, and what explains the error."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from towval.model.checks import Array, lock, lock_whole, short_repr


def rounded_up(value: float, decimals: int) -> float:
    """A value rounded up to a number of decimals; what is not finite is returned as it is."""
    # What floating point leaves above a round number is no reason for the next one.
    return math.ceil(value * 10**decimals - 1e-6) / 10**decimals if math.isfinite(value) else value


class Verdict(enum.StrEnum):
    """What the comparison of a run allows to conclude."""

    AGREES = "agrees"
    """The simulation was off by less than what matters, and a fault that matters would have shown."""
    DISAGREES = "disagrees"
    """Not what the model does with inputs within their deviations, and it may matter."""
    CANNOT_TELL = "cannot tell"
    """Neither: the uncertainty is too large."""
    NOT_JUDGED = "not judged"
    """The measurement is at fault, too little of the motion was seen, or the object hardly moved."""


@dataclass(frozen=True)
class Draws:
    """Draws of all uncertain inputs of a run.

    ``rows`` (m,) of the run's times they are kept at; ``error`` (k, m, 3) simulated minus measured and ``measurement``
    (k, m, 3) measured minus true pose, both on the floor's axes [m, m, rad], if the model is right; ``inputs`` (k, d)
    the standard normal numbers that they come from, and ``names`` of the inputs with how many columns each has. Draw i
    of all runs of a campaign has the same value of every input that they share.
    """

    rows: NDArray[np.intp]
    error: Array
    measurement: Array
    inputs: Array
    names: Mapping[str, int]

    __repr__ = short_repr

    def __post_init__(self) -> None:
        lock_whole(self, np.intp, rows=(None,))
        k, m = len(self.error), len(self.rows)
        lock(self, error=(k, m, 3), measurement=(k, m, 3), inputs=(k, sum(self.names.values())))

    @property
    def column_names(self) -> tuple[str, ...]:
        """Name of the input of each column (d,)."""
        return tuple(name for name, width in self.names.items() for _ in range(width))


@dataclass(frozen=True)
class VisibleFault:
    """The smallest fault of a kind that the test of the run detects in nine of ten draws.

    ``kind`` with ``size`` in ``unit``; ``shift_rms_m`` and ``shift_max_m``, by how much it moves the path [m]. NaN
    where none was found up to ``searched``, the largest that could be simulated: 0 where none could, as it tips.
    """

    kind: str
    size: float
    unit: str
    shift_rms_m: float
    shift_max_m: float
    searched: float


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds of the error's sizes by name: what the simulation was off, and what can be the model's.

    [m], headings [rad]. From E with u_D, and from E with u_val; see :func:`towval.validation.statistics.bounds`.
    """

    simulation: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    model: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Explanation:
    """Which inputs, moved by how many of their deviations, would explain the error, and what would remain.

    ``moved`` by name, the most probable first: true value = stated value + so many deviations; ``explained``
    whether the remainder is what a right model leaves; ``error_rms_m`` before and ``remaining_rms_m`` after, RMS of the
    position; ``begins_m`` and ``ends_m``, between which lengths of the path the remainder begins [m], NaN
    where it does not stand out; ``assumed``, which of the named inputs have a value that nobody stated; ``instead``,
    what may be off in place of the first of ``moved``, from which this run cannot tell it; ``factor``, by which all
    stated deviations are also too small, 1 if they are not; if it is larger, ``moved`` and ``instead`` name the
    inputs that are most probably off.
    """

    moved: Mapping[str, float]
    explained: bool
    error_rms_m: float
    remaining_rms_m: float
    begins_m: float = float("nan")
    ends_m: float = float("nan")
    assumed: tuple[str, ...] = ()
    instead: Mapping[str, float] = field(default_factory=dict)
    factor: float = 1.0
