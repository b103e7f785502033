"""Results of the simulation, the uncertainty analysis and the comparison."""

from dataclasses import dataclass, field

import numpy as np

from towval.model.checks import Array, increasing, lock, short_repr
from towval.model.choices import Choice
from towval.model.errors import InputError
from towval.model.findings import Finding
from towval.model.statement import Bounds, Draws, Explanation, Verdict, VisibleFault

STICKING = "sticking"
"""Name of the statistic of a simulation that is 1 where the model sticks, else 0."""
UNEXPLAINED = "noise and interactions"
"""Share of an error's variance that no input explains alone."""

TO_DYNAMICS = " to dynamics, m"
"""End of the names of the statistics that say how far the path of a simpler model is from that of the dynamics."""

START_OFF = "start_off_m"
"""Name of the statistic of a simulation that says how far a start from rest leads it off, if the object moved [m]."""

UNTESTED_LIMIT = 1e-6
"""Limit of a statistic that is zero for all draws, but for rounding: so without inputs that matter, or
with few draws."""


@dataclass(frozen=True)
class TimedPath:
    """The trajectory of a point over the floor: ``time_s`` (n,) strictly increasing, ``position`` (n, 2) [m]."""

    time_s: Array
    position: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        lock(self, time_s=(None,))
        lock(self, position=(len(self.time_s), 2))
        increasing(self.time_s, "the times of the path")


@dataclass(frozen=True)
class SimulatedMotion:
    """The simulated object on given times.

    ``time_s`` (n,); ``pose`` (n, 3) of the body frame [m, m, rad]; ``twist`` (n, 3) velocity of the body frame's
    origin and heading rate, in the floor frame [m/s, m/s, rad/s]; ``tether_force`` (n, 2) on the object, in the floor
    frame [N]; ``tether_length`` (n,) from anchor to hinge [m]; ``outcome`` a named end of the integration (see
    ``physics.dynamics``), ``advice`` what it means; ``rung`` the model that computed it; ``statistics`` named scalars
    of the integrator; ``choices`` what was chosen, and what the next choice would have changed.
    """

    time_s: Array
    pose: Array
    twist: Array
    tether_force: Array
    tether_length: Array
    outcome: str
    advice: str
    rung: str
    findings: tuple[Finding, ...] = ()
    statistics: dict[str, float] = field(default_factory=dict)
    choices: tuple[Choice, ...] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lock(self, time_s=(n,), pose=(n, 3), twist=(n, 3), tether_force=(n, 2), tether_length=(n,))

    def statistic(self, name: str) -> float:
        """A statistic of the stage simulate; `InputError` where the motion is not of that stage, or of an older one."""
        if name not in self.statistics:
            raise InputError(
                "the simulated motion is not of a run",
                got=f"{name} is not among its statistics",
                remedy="make it anew with towval simulate",
            )
        return self.statistics[name]

    @property
    def sticking(self) -> bool:
        """Whether the model sticks: friction may hold the object at rest."""
        return bool(self.statistics.get(STICKING, 0.0))


@dataclass(frozen=True)
class RunUncertainty:
    """What is known about the error of one run, in the terms of ASME V&V 20.

    ``time_s`` (n,); covariances (n, 3, 3) of x, y and heading [m², m rad, rad²]: ``measurement`` of the measured pose,
    ``simulation`` of the simulated one due to all that it was given, ``validation`` of their difference, in which what
    both share (the camera) is counted once. ``confidence`` of the limits that a right model keeps; ``shares`` of the
    path error's variance by input, first order; ``samples`` how many were drawn, from ``seed``; ``choices`` what that
    number was chosen against; ``upstream`` the findings of the stages before; ``draws`` what was drawn and where it
    led, None where a file was read without; ``faults`` the smallest that show; ``explanation`` what would
    explain the error, None where it is what the measurement makes.
    """

    time_s: Array
    measurement: Array
    simulation: Array
    validation: Array
    confidence: float
    shares: dict[str, float]
    samples: int
    seed: int
    findings: tuple[Finding, ...] = ()
    choices: tuple[Choice, ...] = ()
    upstream: tuple[Finding, ...] = ()
    draws: Draws | None = None
    faults: tuple[VisibleFault, ...] = ()
    explanation: Explanation | None = None

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lock(self, time_s=(n,))
        lock(self, finite=False, measurement=(n, 3, 3), simulation=(n, 3, 3), validation=(n, 3, 3))


@dataclass(frozen=True)
class Comparison:
    """Simulated against measured object path of one run, unaligned.

    ``time_s`` (n,); ``error`` (n, 3) simulated minus measured [m, m, rad], NaN where the object was not seen;
    ``along_across`` (n, 2) the same shift along and across the measured path [m]; ``ratio`` (n,) is |E| / u_val of the
    position [1]. The scalars are those of ``summary.csv``; an uncertainty that was not computed is NaN and then the
    verdict is "not judged". ``frechet_m`` and the area metrics are unaligned, too (see
    :mod:`towval.validation.metrics`); only ``aligned_rms_m`` comes after the rigid motion that brings the whole
    simulated path closest to the measured one.

    ``tolerance_m`` is the error that matters, a default unless ``tolerance_stated``. ``error_upper_m`` bounds what the
    simulation was off at most in this run (E with u_D), ``model_error_lower_m`` and ``model_error_upper_m`` what of it
    can be the model's (E with u_val), all of the largest position error; all sizes are in ``bounds``.
    ``size_statistic``, ``shape_statistic`` and ``input_statistic`` with their limits test "the model is right, inputs
    are within their deviations".
    ``drawn_tests`` (k, 2) of each draw a key that runs of a campaign share and the largest statistic over its limit.
    ``detectable_m`` is the path error, RMS, from which on half of the kinds of ``faults`` show;
    ``seen_share`` the share of the frames of the motion in which the object was seen; ``begins_m`` and ``ends_m``,
    between which lengths of the measured path the error begins [m], NaN where it is there all along; ``explanation``
    what would explain the error; ``warnings`` the codes of all findings that are no notes, separated by spaces.
    """

    run: str
    time_s: Array
    error: Array
    along_across: Array
    ratio: Array
    path_rms_m: float
    path_max_m: float
    final_error_m: float
    heading_rms_rad: float
    path_length_m: float
    u_num_m: float
    u_input_m: float
    u_measurement_m: float
    u_val_m: float
    verdict: Verdict
    tracked_frames: int
    lost_frames: int
    frechet_m: float = float("nan")
    area_along_m: float = float("nan")
    area_across_m: float = float("nan")
    aligned_rms_m: float = float("nan")
    tolerance_m: float = float("nan")
    tolerance_stated: bool = False
    error_upper_m: float = float("nan")
    model_error_lower_m: float = float("nan")
    model_error_upper_m: float = float("nan")
    detectable_m: float = float("nan")
    seen_share: float = float("nan")
    begins_m: float = float("nan")
    ends_m: float = float("nan")
    size_statistic: float = float("nan")
    size_limit: float = float("nan")
    shape_statistic: float = float("nan")
    shape_limit: float = float("nan")
    input_statistic: float = float("nan")
    input_limit: float = float("nan")
    warnings: str = ""
    drawn_tests: Array = field(default_factory=lambda: np.empty((0, 2)))
    bounds: Bounds = field(default_factory=Bounds)
    faults: tuple[VisibleFault, ...] = ()
    explanation: Explanation | None = None
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lock(self, time_s=(n,), drawn_tests=(None, 2))
        lock(self, finite=False, error=(n, 3), along_across=(n, 2), ratio=(n,))

    @property
    def tested(self) -> dict[str, tuple[float, float]]:
        """Statistics that were tested, by name (size, shape, input), each with its limit [1]."""
        pairs = {
            "size": (self.size_statistic, self.size_limit),
            "shape": (self.shape_statistic, self.shape_limit),
            "input": (self.input_statistic, self.input_limit),
        }
        return {name: (value, limit) for name, (value, limit) in pairs.items() if limit > UNTESTED_LIMIT}

    @property
    def tested_ratio(self) -> float:
        """Largest statistic over its limit [1]: above one the test rejects; NaN where there was none."""
        return max((value / limit for value, limit in self.tested.values()), default=float("nan"))

    @property
    def ratio_max(self) -> float:
        """Largest |E| / u_val of the run [1], NaN where there is none."""
        return float(np.nanmax(self.ratio)) if np.isfinite(self.ratio).any() else float("nan")
