"""What the nine numbers of a small motion of the view do to pixels and to poses."""

import numpy as np

from towval.model import CALIBRATION_PARAMETERS, Array, Body, Camera, Floor
from towval.model.conventions import VIEW_MOTION
from towval.model.geometry import lifted, transform, velocity_at
from towval.optics.plane_uncertainty import position_sensitivity, shared_parameters
from towval.optics.projection import project, to_plane
from towval.optics.view_motion import moved_view

_ACROSS = np.linspace(0.1, 0.9, 5)
_NO_TURN = 1e-4  # [rad] Below it the next term of the series is less than rounding.


def picture_motion(camera: Camera, floor: Floor, motion: Array) -> Array:
    """What a ``motion`` (9,) of the view does to the picture of the floor (4,).

    It is the similarity that fits places all over the picture best, as :data:`towval.model.conventions.PICTURE_MOTION`.

    Examples
    --------
    >>> import numpy as np
    >>> camera = Camera((640, 480), np.array([[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]), np.zeros(8), "none")
    >>> floor = Floor(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 3], [0, 0, 0, 1]]))
    >>> (picture_motion(camera, floor, np.array([0, 0, 0, 0, 0, 0, 0.01, 2, 0])).round(3) + 0.0).tolist()
    [2.0, 0.0, 0.0, 0.01]
    """
    middle = (np.array(camera.resolution_px) - 1) / 2
    grid = np.stack(np.meshgrid(*(2 * middle[:, None] * _ACROSS)), axis=-1).reshape(-1, 2)
    places = to_plane(camera, floor, grid, 0.0)
    seen = np.isfinite(places).all(axis=1)
    points = np.column_stack([places[seen], np.zeros(seen.sum())])
    before, after = ((project(*view, points) - middle) @ [1, 1j] for view in
                     ((camera, floor), moved_view(camera, floor, motion)))  # fmt: skip
    arms = before - before.mean()
    scaled = np.sum(arms.conj() * after) / np.sum(np.abs(arms) ** 2)
    shift = after.mean() - scaled * before.mean()
    return np.array([shift.real, shift.imag, np.angle(scaled), np.log(np.abs(scaled))])


def parameters_by_motion(camera: Camera, floor: Floor) -> Array:
    """Change (18, 9) of :data:`towval.model.CALIBRATION_PARAMETERS` with a motion of the view."""
    by_motion = np.zeros((len(CALIBRATION_PARAMETERS), len(VIEW_MOTION)))
    by_motion[[0, 1], 6] = camera.matrix[[0, 1], [0, 1]]
    by_motion[2:4, 7:] = np.eye(2)
    by_motion[12:15, :3] = _vector_by_turn(shared_parameters(camera, floor)[12:15])
    by_motion[15:, :3] = -np.cross(np.eye(3), floor.T_camera_floor[:3, 3])
    by_motion[15:, 3:6] = np.eye(3)
    return by_motion


def _vector_by_turn(vector: Array) -> Array:
    """Change (3, 3) of the vector of a rotation by less than a full turn with a small turn after it.

    It is the inverse of the left Jacobian of SO(3), Barfoot, State Estimation for Robotics (2017), section 7.1.5. No
    difference of vectors gives it for a camera that looks straight down: its vector is half a turn long, where those of
    opposite sign are one rotation.
    """
    angle, across = float(np.linalg.norm(vector)), np.cross(np.eye(3), vector)
    bent = 1 / 12 if angle < _NO_TURN else (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    return np.asarray(np.eye(3) - across / 2 + bent * across @ across)


_AT_ONCE = 1024  # Poses, whose corners' derivatives take 5 kB each: the memory of a long video stays small.


def pose_sensitivity(camera: Camera, floor: Floor, body: Body, pose: Array) -> tuple[Array, Array]:
    """Change of measured poses (n, 3) with the calibration (n, 3, 18) and with the height of the body's top (n, 3).

    It is that of the corners of the top at fixed pixels, fitted by a rigid motion; the first by
    :data:`towval.model.CALIBRATION_PARAMETERS`, the second in 1, 1, rad/m.
    """
    if len(pose) > _AT_ONCE:
        parts = [pose_sensitivity(camera, floor, body, pose[i : i + _AT_ONCE]) for i in range(0, len(pose), _AT_ONCE)]
        by_calibration, by_top = (np.concatenate(each) for each in zip(*parts, strict=True))
        return by_calibration, by_top
    corners = transform(pose[:, None, :], body.top_corners_m)
    n, k = corners.shape[:2]
    height = body.tracked_plane_height_m
    points = lifted(corners, height).reshape(-1, 3)
    by_camera, by_height = position_sensitivity(camera, floor, project(camera, floor, points), height)
    moves = np.concatenate([by_camera, by_height[:, :, None]], axis=2)
    by_pose = rigid_moves(corners, pose, moves.reshape(n, k, *moves.shape[1:]))
    return by_pose[..., :-1], by_pose[..., -1]


def readout_sensitivity(camera: Camera, floor: Floor, body: Body, pose: Array, rate: Array) -> Array:
    """Change (n, 3) of measured poses (n, 3) with the camera's readout [m/s, m/s, rad/s].

    ``rate`` (n, 3) of the poses [m/s, m/s, rad/s]. The camera reads its rows one after another, the top one first, and
    a picture's time is that of its middle row: each corner of the top is seen where it is at the time of its own row.
    """
    corners = transform(pose[:, None, :], body.top_corners_m)
    rows = project(camera, floor, lifted(corners, body.tracked_plane_height_m))[..., 1]
    late = rows / (camera.resolution_px[1] - 1) - 0.5
    moving = velocity_at(rate[:, None], corners - pose[:, None, :2])
    return rigid_moves(corners, pose, (late[..., None] * moving)[..., None])[..., 0]


def rigid_moves(corners: Array, pose: Array, moves: Array) -> Array:
    """Small rigid motions (n, 3, p) of poses (n, 3) that fit moves (n, k, 2, p) of corners (n, k, 2) best."""
    # A small rigid motion (dx, dy, dφ) moves a corner at arm a by (dx, dy) + dφ k × a; least squares over the corners,
    # with the arms taken from their mean, decouples shift and turn.
    arms = corners - corners.mean(axis=1, keepdims=True)
    mean_move = moves.mean(axis=1)
    turn = np.einsum("nk,nkp->np", arms[..., 0], moves[:, :, 1]) - np.einsum("nk,nkp->np", arms[..., 1], moves[:, :, 0])
    turn /= np.sum(arms**2, axis=(1, 2))[:, None]
    lever = pose[:, :2] - corners.mean(axis=1)
    shift_x = mean_move[:, 0] - lever[:, 1, None] * turn
    shift_y = mean_move[:, 1] + lever[:, 0, None] * turn
    return np.stack([shift_x, shift_y, turn], axis=1)
