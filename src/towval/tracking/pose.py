"""The measurement of one picture, the robust rigid fit, and the prediction of the next pose."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from towval.model import Array
from towval.model.errors import InputError
from towval.model.geometry import rigid_fit, rotation, transform

TUKEY = 4.685  # SOURCE: Tukey's biweight at 95 % efficiency for Gaussian noise.
STD_OF_MEDIAN = 1.4826  # Deviation of a normal variable over the median of its size.
RAYLEIGH_MEDIAN = 1.1774  # Deviations of one coordinate: the median size of two of them.
_FITS = 10


@dataclass(frozen=True)
class Measurement:
    """A body's pose measured in one picture.

    ``pose`` (3,) [m, m, rad]; ``covariance`` (3, 3). Optional: ``inlier_fraction``, share of points that agree;
    ``residual``, root mean square misfit (pixels for KLT, grey levels for plane alignment); ``points_m`` (k, 2) in the
    body frame with ``weights`` (k,) in [0, 1], some of the points that were used; ``learn`` takes over from the picture
    what the tracker needs and is called where the pose counts as an observation. Places are measured to be ruled out,
    too, so :meth:`Tracker.measure` itself must learn nothing.

    Raises `InputError` when an array has another shape.
    """

    pose: Array
    covariance: Array
    inlier_fraction: float = 1.0
    residual: float = math.nan
    points_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    weights: Array = field(default_factory=lambda: np.zeros(0))
    learn: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        count = len(self.weights)
        for name, shape in (("pose", (3,)), ("covariance", (3, 3)), ("points_m", (count, 2)), ("weights", (count,))):
            got = np.shape(getattr(self, name))
            if got != shape:
                raise InputError(f"Measurement.{name} of a tracker has the wrong shape", got=got, allowed=str(shape))


@runtime_checkable
class Tracker(Protocol):
    """Measures one body's pose in pictures.

    Built from the :class:`~towval.tracking.planar_target.PlanarTarget`, the first picture and the pose (3,) in it.
    Poses are those of a frame at the middle of the top, whose axes are the body's (:mod:`towval.tracking.middle`). A
    class that derives from this one has to add :meth:`measure` alone.
    """

    @property
    def exposure_s(self) -> float:
        """Measured exposure time [s]; zero where the tracker does not measure it."""
        return 0.0

    @property
    def widest_blur_px(self) -> float:
        """Deviation of the widest blur, against the first picture, that poses account for [px]; zero for none."""
        return 0.0

    def measure(self, luma: NDArray[np.uint8], predicted: Array, velocity: Array | None = None) -> Measurement | None:
        """Pose near ``predicted`` (3,), or None where it cannot be measured reliably.

        ``velocity`` (3,), where known, is the body's twist in its own frame [m/s, m/s, rad/s], which blurs the picture.
        """


def as_tracker(made: object) -> Tracker:
    """What was made for a tracker; raises `InputError` where it is none."""
    if not isinstance(made, Tracker):
        raise InputError(
            f"{type(made).__name__} is no tracker",
            allowed="a class with measure and exposure_s",
            remedy="derive it from towval.tracking.pose.Tracker",
        )
    return made


def tukey_weights(misfit: Array, scale: float) -> Array:
    """Tukey's biweight (n,) of misfits (n,) whose deviation is ``scale``."""
    return np.clip(1 - (misfit / (TUKEY * scale)) ** 2, 0, None) ** 2


@dataclass(frozen=True)
class RigidFit:
    """A robust rigid fit: ``pose`` (3,), its ``covariance`` (3, 3), ``weights`` (n,) in [0, 1] and ``rms`` [m]."""

    pose: Array
    covariance: Array
    weights: Array
    rms: float


def robust_rigid_fit(source: Array, target: Array, noise_floor_m: float) -> RigidFit:
    """Pose that maps ``source`` (n, 2) onto ``target`` (n, 2) [m], by least squares reweighted with Tukey's biweight.

    The scale is the median distance, not less than ``noise_floor_m``.
    """
    weights = np.ones(len(source))
    for _ in range(_FITS):
        pose = rigid_fit(source, target, weights)
        misfit = np.linalg.norm(transform(pose, source) - target, axis=1)
        scale = max(float(np.median(misfit)) / RAYLEIGH_MEDIAN, noise_floor_m)
        weights = tukey_weights(misfit, scale)
    freedom = max(1.0, 2 * (weights > 0.1).sum() - 3)
    variance = float(np.sum(weights * misfit**2)) / max(weights.sum(), 1e-9) * (1 + 3 / freedom)
    turned = source @ rotation(pose[2]).T
    one, zero = np.ones(len(source)), np.zeros(len(source))
    rows = np.concatenate([np.stack([one, zero, -turned[:, 1]], axis=1), np.stack([zero, one, turned[:, 0]], axis=1)])
    information = rows.T @ (np.tile(weights, 2)[:, None] * rows)
    covariance = np.linalg.inv(information) * max(variance / 2, noise_floor_m**2)
    return RigidFit(pose, covariance, weights, float(np.sqrt(variance)))


@dataclass
class Motion:
    """Prediction of a body's pose: its twist between the last two observations is carried on, undamped."""

    time_s: float
    pose: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))

    def predict(self, time_s: float) -> Array:
        """Pose (3,) expected at ``time_s``, a constant twist in the body frame carried on."""
        return moved(self.pose, self.velocity * (time_s - self.time_s))

    def observe(self, time_s: float, pose: Array) -> Array:
        """Take in an observation; returns its pose with the heading unwrapped to follow the last one."""
        step = step_between(self.pose, pose)
        self.velocity = step / (time_s - self.time_s)
        self.pose, self.time_s = np.array([pose[0], pose[1], self.pose[2] + step[2]]), time_s
        return self.pose


def moved(pose: Array, step: Array) -> Array:
    """One pose moved by a step in its own frame: ``geometry.compose`` for single poses, without its cost."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([pose[0] + c * step[0] - s * step[1], pose[1] + s * step[0] + c * step[1], pose[2] + step[2]])


def step_between(pose: Array, other: Array) -> Array:
    """The step in the frame of ``pose`` that leads to ``other``, heading in (−π, π]; :func:`moved` undoes it."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = other[0] - pose[0], other[1] - pose[1]
    return np.array([c * x + s * y, c * y - s * x, math.remainder(other[2] - pose[2], 2 * math.pi)])
