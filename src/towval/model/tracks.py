"""Bodies as the camera sees them, and their measured motion."""

import enum
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from towval.model.camera import Camera, Floor
from towval.model.checks import Array, increasing, lock, lock_whole, locked, positive
from towval.model.choices import Choice
from towval.model.errors import InputError
from towval.model.findings import Finding
from towval.model.geometry import hermite_terms, transform


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
        lock(self, top_corners_m=(None, 2))
        positive(self, "tracked_plane_height_m", "height_std_m", zero=True)
        if len(self.top_corners_m) < 3:
            raise InputError(
                f"{self.name}.top_corners_m is no outline",
                got=f"{len(self.top_corners_m)} corners",
                allowed="three corners or more",
            )
        obstructions = tuple(locked(o, f"{self.name} obstruction", (None, 2)) for o in self.obstructions)
        object.__setattr__(self, "obstructions", obstructions)

    @property
    def reach_m(self) -> float:
        """Distance of the farthest corner of the top from the origin of the body frame [m]."""
        return float(np.linalg.norm(self.top_corners_m, axis=1).max())

    @property
    def outline_m(self) -> Array:
        """The outline of the top (n + 1, 2) in the body frame, closed [m]."""
        return np.concatenate([self.top_corners_m, self.top_corners_m[:1]])


@dataclass(frozen=True)
class Tag:
    """A marker on the planar target of a body.

    ``dictionary`` is OpenCV's name without its prefix (``4X4_50``, ``APRILTAG_36h11``); ``number`` the marker's;
    ``size_m`` the side of its black square; ``pose`` (3,) its middle and heading in the body frame [m, m, rad], the
    heading that of its upper edge from left to right.
    """

    dictionary: str
    number: int
    size_m: float
    pose: Array

    def corners_m(self) -> Array:
        """Corners (4, 2) in the body frame [m], in the order OpenCV reports: upper left first, then clockwise."""
        half = self.size_m / 2
        return transform(self.pose, half * np.array([[-1.0, 1], [1, 1], [1, -1], [-1, -1]]))


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
        lock_whole(self, np.int64, frame=(None,))
        lock(self, floor_m=(len(self.frame), 3), weight=(len(self.frame),))


class Stamp(enum.IntEnum):
    """Whether the motion of the bodies agrees with the time that a picture is stamped with."""

    AS_WRITTEN = 0
    """It does, or nothing moves."""
    REPEATED = 1
    """The picture is the one before."""
    CONTRADICTED = 2
    """All bodies jump from this picture to the next."""


@dataclass(frozen=True)
class CameraTrack:
    """What a video shows about its own camera: how the view moved, which time stamps are doubtful, and the scale.

    ``camera`` and ``floor`` are the view in the first picture, ``motion`` (n, 9) what moved it since, in the order of
    :data:`towval.model.conventions.VIEW_MOTION`. ``picture`` (n, 4) is what that did to the picture, in the order of
    :data:`towval.model.conventions.PICTURE_MOTION`, and ``picture_std`` (n, 4) its deviation; NaN where the floor was
    not found. ``stamps`` (n,) of :class:`Stamp`. ``size``: lengths of the tops in the pictures over the stated ones,
    less 1, with its deviation; NaN where no edges were found. ``added`` (18, 18) is the covariance of the camera's
    parameters beyond that of the calibration: of where the view was in the first picture, of its motion since, and of
    what the size of the tops contradicts. ``quarter_turns``, counter-clockwise, by which the pictures had to be turned
    more than players turn them to lie as those of the calibration.
    """

    camera: Camera
    floor: Floor
    motion: Array
    picture: Array
    picture_std: Array
    stamps: NDArray[np.uint8]
    size: float = float("nan")
    size_std: float = float("nan")
    added: Array = field(default_factory=lambda: np.zeros((18, 18)))
    quarter_turns: int = 0

    def __post_init__(self) -> None:
        n = len(self.motion)
        lock_whole(self, np.uint8, stamps=(n,))
        lock(self, motion=(n, 9), added=(18, 18))
        lock(self, finite=False, picture=(n, 4), picture_std=(n, 4))

    def with_added(self, further: Array) -> "CameraTrack":
        """The same with a further covariance (18, 18) of the camera's parameters."""
        return replace(self, added=self.added + further)

    @property
    def registered(self) -> NDArray[np.bool_]:
        """Pictures (n,) in which the floor was found."""
        return np.asarray(np.isfinite(self.picture[:, 0]))


@dataclass(frozen=True)
class Track:
    """Measured planar poses of one body over time.

    ``time_s`` (n,) strictly increasing, the video's presentation times; ``pose`` (n, 3) x [m], y [m], heading [rad]
    unwrapped, NaN where lost; ``covariance`` (n, 3, 3) of the frame's own noise, without calibration and start, NaN
    where lost; ``status`` (n,) of :class:`TrackStatus`; ``inlier_fraction`` (n,) share of the points or samples that
    agree; ``residual`` (n,) root mean square misfit, in pixels for KLT and in grey levels for plane alignment.

    ``start_covariance`` (3, 3) is that of the body frame's registration in the first frame: one unknown shift and
    turn, in the body frame, common to all poses. ``total_covariance`` (n, 3, 3), where known, is that of each pose from
    all sources, most of them common to the poses of a run. ``choices``: what was chosen, and what the next would have
    changed. ``camera``: what the video says of its camera, the same for all bodies.
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
    choices: tuple[Choice, ...] = ()
    total_covariance: Array | None = None
    camera: CameraTrack | None = None

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lock(self, time_s=(n,), start_covariance=(3, 3))
        if self.total_covariance is not None:
            lock(self, finite=False, total_covariance=(n, 3, 3))
        lock(self, finite=False, pose=(n, 3), covariance=(n, 3, 3), inlier_fraction=(n,), residual=(n,))
        lock_whole(self, np.uint8, status=(n,))
        increasing(self.time_s, f"the times of the {self.body} track")
        seen = self.status != TrackStatus.LOST
        if not np.isfinite(self.pose[seen]).all() or np.isfinite(self.pose[~seen]).any():
            raise InputError(
                f"the {self.body} track's poses and status disagree",
                allowed="finite poses where tracked or coasting, NaN where lost",
            )

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Frames that were seen, neither lost nor coasting (n,)."""
        return np.asarray(self.status == TrackStatus.TRACKED)

    def rows_at(self, time_s: ArrayLike) -> NDArray[np.intp]:
        """Rows (m,) of the frames at times (m,) [s], which may be off by rounding; the last one for later times."""
        return np.minimum(np.searchsorted(self.time_s, np.asarray(time_s) - 1e-9), len(self.time_s) - 1)

    @property
    def std(self) -> Array:
        """Standard deviation of each pose (n, 3) [m, m, rad], of the frame's own noise."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


@dataclass(frozen=True)
class DecimatedTrack:
    """A track reduced to the points that it needs: a C1 cubic through poses and their rates.

    ``time_s`` (m,) times of kept frames; ``pose`` (m, 3) and ``rate`` (m, 3) of the smoothing spline there [m, m, rad;
    per s]; ``covariance`` (m, 3, 3) of the kept poses; ``noise`` (3,) standard deviation of one pose in motion, the
    larger of the track's own scatter and of what its tracker states; ``pauses`` (k, 2) start and end of the times
    at rest [s]; ``frames`` how many measured poses went in; ``misfit`` (3,) root mean square deviation of the measured
    poses from the spline, in units of their noise.
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
        lock(self, time_s=(m,), pose=(m, 3), rate=(m, 3), covariance=(m, 3, 3), noise=(3,), misfit=(3,))
        object.__setattr__(self, "pauses", locked(np.reshape(self.pauses, (-1, 2)), "DecimatedTrack.pauses", (None, 2)))
        increasing(self.time_s, f"the times of the decimated {self.body} track", 2)

    def poses_at(self, time_s: ArrayLike) -> Array:
        """Poses (..., 3) [m, m, rad] of the cubic at times (...,) [s], NaN outside."""
        return self.poses_and_rates_at(time_s)[..., :3]

    def poses_and_rates_at(self, time_s: ArrayLike) -> Array:
        """Poses and their rates (..., 6) [m, m, rad; per s] at times (...,) [s], NaN outside."""
        # Not scipy's CubicHermiteSpline: its import takes longer than all other imports of a simulation.
        asked = np.asarray(time_s, dtype=np.float64)
        piece = np.clip(np.searchsorted(self.time_s, asked, side="right") - 1, 0, len(self.time_s) - 2)
        quadratic, cubic = hermite_terms(self.time_s, self.pose, self.rate)
        s = (asked - self.time_s[piece])[..., None]
        poses = self.pose[piece] + self.rate[piece] * s + quadratic[piece] * (s * s) + cubic[piece] * (s * s * s)
        rates = self.rate[piece] + 2 * quadratic[piece] * s + 3 * cubic[piece] * (s * s)
        outside = (asked < self.time_s[0]) | (asked > self.time_s[-1])
        return np.where(outside[..., None], np.nan, np.concatenate([poses, rates], axis=-1))


def stretches(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """First and last index (k, 2) of each stretch of frames in which something ``holds`` (n,).

    Examples
    --------
    >>> stretches(np.array([True, True, False, True])).tolist()
    [[0, 1], [3, 3]]
    """
    turns = np.diff(np.concatenate([[False], holds, [False]]).astype(np.int8))
    return np.column_stack([np.flatnonzero(turns == 1), np.flatnonzero(turns == -1) - 1])
