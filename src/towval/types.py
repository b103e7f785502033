"""What the stages hand to each other: frozen dataclasses over locked float64 arrays, checked where they are built.

Units, frames and symbols are those of :mod:`towval.conventions`. NaN means "missing" and is never filled silently.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.errors import InputError

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

Array = NDArray[np.float64]

DISTORTION_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""OpenCV's order of the distortion coefficients."""

CALIBRATION_PARAMETERS = ("fx", "fy", "cx", "cy", *DISTORTION_NAMES, "rx", "ry", "rz", "tx", "ty", "tz")
"""Order of the rows of :attr:`Calibration.covariance`: intrinsics, lens, rotation vector and place of the floor."""


def locked(values: ArrayLike, name: str, shape: tuple[int | None, ...], *, finite: bool = True) -> Array:
    """Return a read-only float64 copy of ``values`` after checking its shape.

    Parameters
    ----------
    values : array_like
        What to copy.
    name : str
        What to call it in the error.
    shape : tuple of int or None
        Expected shape; None leaves an axis free.
    finite : bool, optional
        Whether NaN and infinity are refused.

    Raises
    ------
    InputError
        When the shape or a value is not as asked.
    """
    array = np.array(values, dtype=np.float64)
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = " × ".join("any" if n is None else str(n) for n in shape)
        raise InputError(f"{name} has the wrong shape", got=array.shape, allowed=wanted)
    if finite and not np.isfinite(array).all():
        raise InputError(f"{name} holds values that are not finite", allowed="finite numbers")
    array.setflags(write=False)
    return array


def _lock(self: object, **shapes: tuple[int | None, ...]) -> None:
    for name, shape in shapes.items():
        object.__setattr__(self, name, locked(getattr(self, name), f"{type(self).__name__}.{name}", shape))


def _positive(self: object, *names: str, zero: bool = False) -> None:
    for name in names:
        value = getattr(self, name)
        if not (np.isfinite(value) and (value > 0 or (zero and value == 0))):
            allowed = "a finite number, zero or more" if zero else "a finite number above zero"
            raise InputError(f"{type(self).__name__}.{name} is out of range", got=value, allowed=allowed)


class Severity(enum.StrEnum):
    """How much a :class:`Finding` should worry its reader."""

    NOTE = "note"
    WARNING = "warning"
    REFUSAL = "refusal"


@dataclass(frozen=True)
class Finding:
    """Something a stage noticed about its input or its result, in words.

    ``code`` is a short stable name for tests and tables, ``text`` a full sentence with numbers and what to do.
    """

    severity: Severity
    code: str
    text: str


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with OpenCV's lens distortion.

    ``resolution_px`` is (width, height); ``matrix`` (3, 3) [px]; ``distortion`` (8,) in the order of
    :data:`DISTORTION_NAMES`, zero where ``lens_model`` does not use a coefficient.
    """

    resolution_px: tuple[int, int]
    matrix: Array
    distortion: Array
    lens_model: str

    def __post_init__(self) -> None:
        _lock(self, matrix=(3, 3), distortion=(8,))
        if min(self.resolution_px) < 1:
            raise InputError("Camera.resolution_px is out of range", got=self.resolution_px, allowed="at least 1 × 1")


@dataclass(frozen=True)
class Floor:
    """Where the floor is: ``T_camera_floor`` (4, 4) maps floor coordinates [m] to camera coordinates [m]."""

    T_camera_floor: Array

    def __post_init__(self) -> None:
        _lock(self, T_camera_floor=(4, 4))
        rotation = self.T_camera_floor[:3, :3]
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise InputError(
                "Floor.T_camera_floor is not a rigid motion", allowed="a right-handed rotation and a shift"
            )

    @property
    def camera_position_m(self) -> Array:
        """Place of the camera in the floor frame (3,) [m]; the third is its height."""
        return -self.T_camera_floor[:3, :3].T @ self.T_camera_floor[:3, 3]


@dataclass(frozen=True)
class Board:
    """A calibration board with a flat printed pattern.

    ``kind`` is "chessboard" or "charuco"; ``inner_corners`` (columns, rows) counts the points where four squares meet;
    ``square_m`` the side of a square [m]. A ChArUco board also needs ``marker_m``, the side of its markers [m], and
    ``dictionary``, OpenCV's name of the marker set (``DICT_4X4_50``).
    """

    kind: str
    inner_corners: tuple[int, int]
    square_m: float
    marker_m: float | None = None
    dictionary: str | None = None

    def __post_init__(self) -> None:
        _positive(self, "square_m")
        if self.kind not in ("chessboard", "charuco"):
            raise InputError("Board.kind is unknown", got=self.kind, allowed="chessboard, charuco")
        if min(self.inner_corners) < 3:
            raise InputError("Board.inner_corners is out of range", got=self.inner_corners, allowed="at least 3 × 3")
        if self.kind == "charuco" and not (self.dictionary and self.marker_m and 0 < self.marker_m < self.square_m):
            raise InputError(
                "the ChArUco board is not described",
                got=f"marker_m {self.marker_m}, dictionary {self.dictionary}",
                allowed="board.marker_m above 0 and below square_m, and board.dictionary (DICT_4X4_50, ...)",
            )


@dataclass(frozen=True)
class FloorReference:
    """What fixes the floor frame: the board in the first floor picture, or surveyed marks on the floor.

    ``origin_corner_px`` (2,) and ``x_axis_end_corner_px`` (2,) point at two corners of that board [px]: the origin and
    the direction of x. ``board_thickness_m`` is the height of the printed side over the floor. ``marks_px`` (n, 2) and
    ``marks_m`` (n, 2) are the same marks in the picture and on the floor; where there are marks, they define the frame
    and the boards only help to find the plane. ``mark_std_px`` is the deviation of one coordinate of a mark [px].
    """

    origin_corner_px: Array | None = None
    x_axis_end_corner_px: Array | None = None
    board_thickness_m: float = 0.0
    marks_px: Array = field(default_factory=lambda: np.zeros((0, 2)))
    marks_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    mark_std_px: float = 0.7

    def __post_init__(self) -> None:
        _positive(self, "board_thickness_m", zero=True)
        _positive(self, "mark_std_px")
        _lock(self, marks_px=(None, 2), marks_m=(len(self.marks_px), 2))
        given = self.origin_corner_px is not None, self.x_axis_end_corner_px is not None
        if all(given):
            _lock(self, origin_corner_px=(2,), x_axis_end_corner_px=(2,))
        elif any(given) or not len(self.marks_px):
            raise InputError(
                "the floor frame is not fixed",
                allowed="both floor.origin_corner_px and floor.x_axis_end_corner_px, or surveyed marks",
            )


@dataclass(frozen=True)
class View:
    """One picture of a board: its detected corners and how well the calibration explains them.

    ``corners_px`` (n, 2) detected; ``board_m`` (n, 2) the same corners on the board; ``residuals_px`` (n, 2)
    detected minus predicted, NaN where the view was dropped; ``tilt_deg`` angle between board and image plane;
    ``dropped`` the reason why it took no part, empty where it did; ``on_floor`` True for boards lying on the floor.
    """

    name: str
    corners_px: Array
    board_m: Array
    residuals_px: Array
    tilt_deg: float
    on_floor: bool = False
    dropped: str = ""

    def __post_init__(self) -> None:
        n = len(self.corners_px)
        _lock(self, corners_px=(n, 2), board_m=(n, 2))
        residuals = locked(self.residuals_px, "View.residuals_px", (n, 2), finite=False)
        object.__setattr__(self, "residuals_px", residuals)


@dataclass(frozen=True)
class Calibration:
    """Camera and floor with their joint covariance, and what the calibration says about itself.

    ``covariance`` (18, 18) is that of :data:`CALIBRATION_PARAMETERS`, marginal over the poses of all boards; rows of
    coefficients that the lens model does not use are zero. ``corner_noise_px`` is the standard deviation of one
    corner coordinate, from the residuals. ``quality`` holds named scalars with the unit in the name.
    """

    camera: Camera
    floor: Floor
    covariance: Array
    corner_noise_px: float
    views: tuple[View, ...] = ()
    findings: tuple[Finding, ...] = ()
    quality: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(CALIBRATION_PARAMETERS)
        _lock(self, covariance=(n, n))
        _positive(self, "corner_noise_px", zero=True)


@dataclass(frozen=True)
class Body:
    """A body whose flat top the camera sees.

    ``top_corners_m`` (n, 2) is the outline of the top in the body frame, at ``tracked_plane_height_m`` above the
    floor. ``obstructions`` are regions of the top, each (m, 2) in the body frame, hidden by something that stands on
    it (the load): what is seen there is not on the plane. ``height_std_m`` is the deviation of the height.
    """

    name: str
    tracked_plane_height_m: float
    top_corners_m: Array
    obstructions: tuple[Array, ...] = ()
    height_std_m: float = 0.001

    def __post_init__(self) -> None:
        _lock(self, top_corners_m=(None, 2))
        _positive(self, "tracked_plane_height_m", "height_std_m", zero=True)
        if len(self.top_corners_m) < 3:
            raise InputError(
                f"{self.name}.top_corners_m is no outline",
                got=f"{len(self.top_corners_m)} corners",
                allowed="three corners or more",
            )
        obstructions = tuple(locked(o, f"{self.name} obstruction", (None, 2)) for o in self.obstructions)
        object.__setattr__(self, "obstructions", obstructions)


class TrackStatus(enum.IntEnum):
    """Whether a pose can be trusted."""

    LOST = 0
    """No pose: the numbers of this frame are NaN."""
    COASTING = 1
    """Predicted from the frames before, not seen."""
    TRACKED = 2
    """Seen."""


@dataclass(frozen=True)
class Features:
    """Points on a body that a track rests on, in one table over all frames.

    ``frame`` (m,) index into the track's times; ``floor_m`` (m, 3) the point in the floor frame, at the height of the
    body's top; ``weight`` (m,) in [0, 1], zero for an outlier.
    """

    frame: NDArray[np.int64]
    floor_m: Array
    weight: Array

    def __post_init__(self) -> None:
        frame = np.array(self.frame, dtype=np.int64)
        frame.setflags(write=False)
        object.__setattr__(self, "frame", frame)
        _lock(self, floor_m=(len(frame), 3), weight=(len(frame),))


@dataclass(frozen=True)
class Track:
    """Measured planar poses of one body over time.

    ``time_s`` (n,) strictly increasing, the video's presentation times; ``pose`` (n, 3) x [m], y [m], heading [rad]
    unwrapped, NaN where lost; ``covariance`` (n, 3, 3) of the frame's own noise, without calibration and start, NaN
    where lost; ``status`` (n,) of :class:`TrackStatus`; ``inlier_fraction`` (n,) share of the points or samples that
    agree; ``residual`` (n,) root mean square misfit, in pixels for KLT and in grey levels for plane alignment.

    ``start_covariance`` (3, 3) is that of the body frame's registration in the first frame: one unknown shift and
    turn, in the body frame, common to all poses.
    """

    body: str
    time_s: Array
    pose: Array
    covariance: Array
    status: NDArray[np.uint8]
    inlier_fraction: Array
    residual: Array
    start_covariance: Array
    features: Features | None = None
    findings: tuple[Finding, ...] = ()
    method: str = ""

    def __post_init__(self) -> None:
        n = len(self.time_s)
        _lock(self, time_s=(n,), start_covariance=(3, 3))
        for name, shape in (("pose", (n, 3)), ("covariance", (n, 3, 3)), ("inlier_fraction", (n,)), ("residual", (n,))):
            object.__setattr__(self, name, locked(getattr(self, name), f"Track.{name}", shape, finite=False))
        status = np.array(self.status, dtype=np.uint8)
        status.setflags(write=False)
        object.__setattr__(self, "status", status)
        if status.shape != (n,):
            raise InputError("Track.status has the wrong shape", got=status.shape, allowed=f"{n}")
        if n > 1 and not (np.diff(self.time_s) > 0).all():
            raise InputError(f"the times of the {self.body} track do not increase", allowed="strictly increasing times")
        seen = status != TrackStatus.LOST
        if not np.isfinite(self.pose[seen]).all() or np.isfinite(self.pose[~seen]).any():
            raise InputError(
                f"the {self.body} track's poses and status disagree",
                allowed="finite poses where tracked or coasting, NaN where lost",
            )

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Frames that were seen, neither lost nor coasting (n,)."""
        return self.status == TrackStatus.TRACKED

    @property
    def std(self) -> Array:
        """Standard deviation of each pose (n, 3) [m, m, rad], of the frame's own noise."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


@dataclass(frozen=True)
class DecimatedTrack:
    """A track thinned to the points that it needs: a C1 cubic through poses and their rates.

    ``time_s`` (m,) times of kept frames; ``pose`` (m, 3) and ``rate`` (m, 3) of the smoothing spline there [m, m, rad;
    per s]; ``covariance`` (m, 3, 3) of the kept poses; ``noise`` (3,) standard deviation of one measured pose, read off
    the track itself; ``pauses`` (k, 2) start and end of the times at rest [s]; ``frames`` how many measured poses went
    in; ``misfit`` (3,) root mean square deviation of the measured poses from the spline, in units of their noise.
    """

    body: str
    time_s: Array
    pose: Array
    rate: Array
    covariance: Array
    noise: Array
    pauses: Array
    frames: int
    misfit: Array
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        m = len(self.time_s)
        _lock(self, time_s=(m,), pose=(m, 3), rate=(m, 3), covariance=(m, 3, 3), noise=(3,), misfit=(3,))
        object.__setattr__(self, "pauses", locked(np.reshape(self.pauses, (-1, 2)), "DecimatedTrack.pauses", (None, 2)))
        if m < 2 or not (np.diff(self.time_s) > 0).all():
            raise InputError(
                f"the decimated {self.body} track is too short or its times do not increase",
                got=m,
                allowed="two points or more at increasing times",
            )

    def spline(self) -> CubicHermiteSpline:
        """The C1 cubic through the kept poses and rates: a callable of the time [s], with ``derivative()``."""
        # Here, because scipy.interpolate takes longer to import than everything else a simulation needs.
        from scipy.interpolate import CubicHermiteSpline  # noqa: PLC0415

        return CubicHermiteSpline(self.time_s, self.pose, self.rate, axis=0, extrapolate=False)


@dataclass(frozen=True)
class Patch:
    """The footprint of an object: a simple polygon, with holes or without, in the body frame.

    ``outline`` (n, 2) and each of ``holes`` (m, 2) in metres, in either sense of rotation.
    """

    outline: Array
    holes: tuple[Array, ...] = ()

    def __post_init__(self) -> None:
        _lock(self, outline=(None, 2))
        holes = tuple(locked(h, "Patch.holes", (None, 2)) for h in self.holes)
        object.__setattr__(self, "holes", holes)
        if min(len(ring) for ring in (self.outline, *holes)) < 3:
            raise InputError("a ring of the footprint is no polygon", allowed="three corners or more")


@dataclass(frozen=True)
class FrictionLaw:
    """Makkar's friction coefficient of the sliding speed, μ(v).

    SOURCE: eq. (3), ``μ(v) = γ1 (tanh γ2 v − tanh γ3 v) + γ4 tanh γ5 v + γ6 v``. ``gamma`` (6,): γ1, γ4 [1], γ2, γ3,
    γ5, γ6 [s/m], all zero or more.
    """

    gamma: Array

    def __post_init__(self) -> None:
        _lock(self, gamma=(6,))
        if (self.gamma < 0).any():
            raise InputError("FrictionLaw.gamma is out of range", got=self.gamma.tolist(), allowed="zero or more")


@dataclass(frozen=True)
class Tether:
    """An elastic tether that can only pull, eq. (12) of the paper.

    ``rest_length`` [m], ``stiffness`` [N/m], ``damping`` [N s/m] (zero in the paper).
    """

    rest_length: float
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        _positive(self, "rest_length", "stiffness")
        _positive(self, "damping", zero=True)


@dataclass(frozen=True)
class TowedObject:
    """The towed object as dynamics sees it, in its body frame.

    ``patch`` the footprint; ``mass`` [kg] all in all; ``centre_of_mass`` (2,) [m]; ``inertia`` [kg m²] about the
    vertical through the centre of mass; ``anchor`` (2,) [m] where the tether holds it.
    """

    patch: Patch
    mass: float
    centre_of_mass: Array
    inertia: float
    anchor: Array

    def __post_init__(self) -> None:
        _lock(self, centre_of_mass=(2,), anchor=(2,))
        _positive(self, "mass", "inertia")


@dataclass(frozen=True)
class Load:
    """A box standing on the object, its sides along the object's axes.

    ``mass`` [kg]; ``at`` (2,) its centre in the object's frame [m]; ``size`` (3,) length, width and height [m].
    """

    mass: float
    at: Array
    size: Array

    def __post_init__(self) -> None:
        _lock(self, at=(2,), size=(3,))
        _positive(self, "mass", zero=True)

    @property
    def outline(self) -> Array:
        """Corners of its bottom (4, 2) in the object's frame [m]."""
        half = 0.5 * self.size[:2]
        return self.at + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


@dataclass(frozen=True)
class FrictionWish:
    """What a lab knows of the friction: the numbers to which Makkar's law is fitted.

    ``static`` and ``kinetic`` coefficients [1], ``kinetic_std`` [1]; ``stiction_velocity`` v_s, where the law peaks,
    and ``friction_velocity`` v_k, where it has come down to the kinetic coefficient [m/s].
    """

    static: float
    kinetic: float
    stiction_velocity: float
    friction_velocity: float
    kinetic_std: float = 0.005

    def __post_init__(self) -> None:
        _positive(self, "static", "kinetic", "stiction_velocity", "friction_velocity")
        _positive(self, "kinetic_std", zero=True)


@dataclass(frozen=True)
class Scene:
    """All that the simulation is told besides the rover's track.

    ``patch``, ``load`` and ``anchor`` (2,) in the object's frame, ``hinge`` (2,) in the rover's [m]; ``body_mass`` [kg]
    of the object without its load, spread evenly over the footprint.
    """

    patch: Patch
    body_mass: float
    load: Load
    anchor: Array
    hinge: Array
    tether: Tether
    friction: FrictionWish

    def __post_init__(self) -> None:
        _lock(self, anchor=(2,), hinge=(2,))
        _positive(self, "body_mass")


@dataclass(frozen=True)
class InputDeviations:
    """Standard deviations of what the simulation is told.

    ``friction`` of the kinetic coefficient, the static one going with it in proportion [1]; ``body_mass`` and
    ``load_mass`` [kg]; ``load_at``, ``anchor``, ``hinge`` of each coordinate [m]; ``rest_length`` [m];
    ``stiffness`` [N/m].
    """

    friction: float
    body_mass: float
    load_mass: float
    load_at: float
    anchor: float
    hinge: float
    rest_length: float
    stiffness: float

    def __post_init__(self) -> None:
        _positive(self, *(f.name for f in fields(self)), zero=True)


@dataclass(frozen=True)
class RunUncertainty:
    """What is known of the error of one run before it is looked at, in the terms of ASME V&V 20.

    ``time_s`` (n,); covariances (n, 3, 3) of x, y and heading [m², m rad, rad²]: ``measurement`` of the measured pose,
    ``simulation`` of the simulated one due to all that it was given, ``validation`` of their difference, in which what
    both share (the camera) is counted once. ``signature`` (m, 3, 3) is the covariance of the error's signature (see
    :func:`towval.geometry.error_signature`), and ``signature_limit`` what the largest of its normalised entries does
    not exceed with probability ``confidence`` where the model is right. ``shares`` of the path error's variance by
    input, first order; ``samples`` how many were drawn, from ``seed``.
    """

    time_s: Array
    measurement: Array
    simulation: Array
    validation: Array
    signature: Array
    signature_limit: float
    confidence: float
    shares: dict[str, float]
    samples: int
    seed: int
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.time_s)
        _lock(self, time_s=(n,))
        for name in ("measurement", "simulation", "validation"):
            value = locked(getattr(self, name), f"RunUncertainty.{name}", (n, 3, 3), finite=False)
            object.__setattr__(self, name, value)
        _lock(self, signature=(None, 3, 3))


@dataclass(frozen=True)
class Path:
    """A point's way over the floor in time: ``time_s`` (n,) strictly increasing, ``position`` (n, 2) [m]."""

    time_s: Array
    position: Array

    def __post_init__(self) -> None:
        _lock(self, time_s=(None,), position=(len(self.time_s), 2))
        if len(self.time_s) > 1 and not (np.diff(self.time_s) > 0).all():
            raise InputError("the times of the path do not increase", allowed="strictly increasing times")


@dataclass(frozen=True)
class SimulatedMotion:
    """The simulated object on given times.

    ``time_s`` (n,); ``pose`` (n, 3) of the body frame [m, m, rad]; ``twist`` (n, 3) velocity of the body frame's
    origin and heading rate, in the floor frame [m/s, m/s, rad/s]; ``tether_force`` (n, 2) on the object, in the floor
    frame [N]; ``tether_length`` (n,) from anchor to hinge [m]; ``outcome`` a named end of the integration (see
    ``physics.dynamics``), ``advice`` what it means; ``rung`` the model that computed it; ``statistics`` named scalars
    of the integrator.
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

    def __post_init__(self) -> None:
        n = len(self.time_s)
        _lock(self, time_s=(n,), pose=(n, 3), twist=(n, 3), tether_force=(n, 2), tether_length=(n,))


class Verdict(enum.StrEnum):
    """What the comparison of a run allows to say, in the form of ASME V&V 20."""

    AGREES = "agrees"
    """The error is within the validation uncertainty, and that is small enough to mean something."""
    MODEL_ERROR = "model error"
    """The error exceeds the validation uncertainty: the model's form is wrong, and it shows."""
    TOO_UNCERTAIN = "too uncertain"
    """The validation uncertainty is too large to tell."""
    NOT_JUDGED = "not judged"
    """An uncertainty is missing, so no verdict is given."""


@dataclass(frozen=True)
class Comparison:
    """Simulated against measured object path of one run, unaligned.

    ``time_s`` (n,); ``error`` (n, 3) simulated minus measured [m, m, rad], NaN where the object was not seen;
    ``along_across`` (n, 2) the same shift along and across the measured path [m]. The scalars are those of
    ``summary.csv``; an uncertainty that was not computed is NaN and then the verdict is "not judged".
    """

    run: str
    time_s: Array
    error: Array
    along_across: Array
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
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.time_s)
        _lock(self, time_s=(n,))
        for name, shape in (("error", (n, 3)), ("along_across", (n, 2))):
            object.__setattr__(self, name, locked(getattr(self, name), f"Comparison.{name}", shape, finite=False))
