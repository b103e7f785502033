"""The camera, the boards and the floor, and the calibration that ties them together."""

from dataclasses import dataclass, field

import numpy as np

from towval.model.checks import Array, lock, positive
from towval.model.choices import Choice
from towval.model.errors import InputError
from towval.model.findings import Finding

DISTORTION_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""OpenCV's order of the distortion coefficients."""

CALIBRATION_PARAMETERS = ("fx", "fy", "cx", "cy", *DISTORTION_NAMES, "rx", "ry", "rz", "tx", "ty", "tz")
"""Order of the rows of :attr:`Calibration.covariance`: intrinsics, lens, rotation vector and place of the floor."""


FISHEYE = "fisheye"
"""With it begins the name of a lens model whose coefficients act on the angle between a ray and the axis."""


def is_fisheye(lens_model: str) -> bool:
    """Whether the coefficients of a lens model act on the angle of a ray instead of its tangent, by its name."""
    return lens_model.startswith(FISHEYE)


def lens_array(distortion: Array, fisheye: bool) -> Array:
    """Lens coefficients as the kernels take them: (8,), and of a fisheye (9,), the ninth being 1."""
    return np.append(distortion, 1.0) if fisheye else distortion


@dataclass(frozen=True)
class Camera:
    """A pinhole or fisheye camera with OpenCV's lens distortion.

    ``resolution_px`` is (width, height); ``matrix`` (3, 3) [px]; ``distortion`` (8,) in the order of
    :data:`DISTORTION_NAMES`, zero where ``lens_model`` does not use a coefficient. They act on the tangent of the angle
    between ray and axis; where the name of ``lens_model`` begins with ``fisheye``, on the angle itself, which with k1,
    k2 and k3 is the model of Kannala and Brandt (2006) and ROS's ``equidistant``.

    Examples
    --------
    >>> import numpy as np
    >>> Camera((640, 480), np.diag([300.0, 300.0, 1.0]), np.zeros(8), "fisheye").lens.tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    """

    resolution_px: tuple[int, int]
    matrix: Array
    distortion: Array
    lens_model: str

    def __post_init__(self) -> None:
        lock(self, matrix=(3, 3), distortion=(8,))
        if min(self.resolution_px) < 1:
            raise InputError("Camera.resolution_px is out of range", got=self.resolution_px, allowed="at least 1 × 1")
        if is_fisheye(self.lens_model) and self.distortion[[2, 3, 5, 6, 7]].any():
            raise InputError(
                "Camera.distortion has coefficients that a fisheye does not have",
                got=self.distortion.tolist(),
                allowed="k1, k2 and k3; the others zero",
            )

    @property
    def lens(self) -> Array:
        """The coefficients as the kernels take them; see :func:`lens_array`."""
        return lens_array(self.distortion, is_fisheye(self.lens_model))


@dataclass(frozen=True)
class Floor:
    """Where the floor is: ``T_camera_floor`` (4, 4) maps floor coordinates [m] to camera coordinates [m]."""

    T_camera_floor: Array

    def __post_init__(self) -> None:
        lock(self, T_camera_floor=(4, 4))
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
    ``dictionary``, OpenCV's name of the marker set (``DICT_4X4_50``). ``size_std`` is the relative deviation of the
    whole board's size, ``bow_std_m`` how far its middle may stand off its ends [m].
    """

    kind: str
    inner_corners: tuple[int, int]
    square_m: float
    marker_m: float | None = None
    dictionary: str | None = None
    size_std: float = 0.0005
    bow_std_m: float = 0.001

    def __post_init__(self) -> None:
        positive(self, "square_m")
        positive(self, "size_std", "bow_std_m", zero=True)
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
    and the boards only help to find the plane. ``mark_std_px`` is the deviation of one coordinate of a mark [px],
    ``board_thickness_std_m`` that of the thickness [m].
    """

    origin_corner_px: Array | None = None
    x_axis_end_corner_px: Array | None = None
    board_thickness_m: float = 0.0
    marks_px: Array = field(default_factory=lambda: np.zeros((0, 2)))
    marks_m: Array = field(default_factory=lambda: np.zeros((0, 2)))
    mark_std_px: float = 0.7
    board_thickness_std_m: float = 0.0005

    def __post_init__(self) -> None:
        positive(self, "board_thickness_m", "board_thickness_std_m", zero=True)
        positive(self, "mark_std_px")
        lock(self, marks_px=(None, 2), marks_m=(len(self.marks_px), 2))
        given = self.origin_corner_px is not None, self.x_axis_end_corner_px is not None
        if all(given):
            lock(self, origin_corner_px=(2,), x_axis_end_corner_px=(2,))
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
        lock(self, corners_px=(n, 2), board_m=(n, 2))
        lock(self, finite=False, residuals_px=(n, 2))


@dataclass(frozen=True)
class Calibration:
    """Camera and floor with their joint covariance, and what the calibration says about itself.

    ``covariance`` (18, 18) is that of :data:`CALIBRATION_PARAMETERS`, marginal over the poses of all boards; rows of
    coefficients that the lens model does not use are zero. ``corner_noise_px`` is the standard deviation of one
    corner coordinate, from the residuals. ``quality`` holds named scalars with the unit in the name; ``choices`` what
    was chosen and what the next choice would have changed.
    """

    camera: Camera
    floor: Floor
    covariance: Array
    corner_noise_px: float
    views: tuple[View, ...] = ()
    findings: tuple[Finding, ...] = ()
    quality: dict[str, float] = field(default_factory=dict)
    choices: tuple[Choice, ...] = ()

    def __post_init__(self) -> None:
        n = len(CALIBRATION_PARAMETERS)
        lock(self, covariance=(n, n))
        positive(self, "corner_noise_px", zero=True)


@dataclass(frozen=True)
class UncertaintyMap:
    """Position uncertainty on a plane over a grid of pixels.

    ``height_m`` of the plane over the floor; ``pixels`` (rows, columns, 2); ``covariance_m2`` (rows, columns, 2, 2) of
    the positions where their rays meet the plane, NaN where they miss it.
    """

    height_m: float
    pixels: Array
    covariance_m2: Array

    def __post_init__(self) -> None:
        lock(self, pixels=(None, None, 2))
        rows, columns = self.pixels.shape[:2]
        lock(self, finite=False, covariance_m2=(rows, columns, 2, 2))

    @property
    def std_m(self) -> Array:
        """Root mean square position error to expect (rows, columns) [m]: the root of the covariance's trace."""
        return np.asarray(np.sqrt(np.trace(self.covariance_m2, axis1=-2, axis2=-1)))

    @property
    def rms_m(self) -> float:
        """Root mean square of :attr:`std_m` over the grid [m]; NaN where no ray meets the plane."""
        std_m = self.std_m[np.isfinite(self.std_m)]
        return float(np.sqrt(np.mean(std_m**2))) if len(std_m) else float("nan")
