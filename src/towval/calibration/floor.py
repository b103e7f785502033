"""The floor frame: which corner of which board is the origin, and a first guess that the adjustment can start from."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from towval.calibration.blocks import Estimate
from towval.calibration.corners import BoardObservation
from towval.model import Array, FloorReference
from towval.model.errors import InputError
from towval.model.geometry import rigid_fit
from towval.optics.projection import to_plane_kernel, undistorted_kernel

_ROUNDING_M = 1e-6


def in_floor_axes(observation: BoardObservation, reference: FloorReference) -> BoardObservation:
    """The first floor board in floor coordinates: origin at the corner pointed at, x along the row pointed along.

    Raises `InputError` when a point is further than one square from the nearest corner, or both mean the same corner or
    corners neither in one row nor in one column.
    """
    origin = _nearest(observation, reference.origin_corner_px, "floor.origin_corner_px")
    end = _nearest(observation, reference.x_axis_end_corner_px, "floor.x_axis_end_corner_px")
    if origin == end:
        raise InputError(
            "floor.x_axis_end_corner_px is the corner of floor.origin_corner_px",
            got=np.round(observation.corners_px[origin], 1).tolist(),
            remedy="give another corner of the same row of the board",
        )
    axis = observation.board_m[end] - observation.board_m[origin]
    if np.abs(axis).min() > _ROUNDING_M:
        raise InputError(
            "floor.x_axis_end_corner_px is neither in the row nor in the column of floor.origin_corner_px",
            got=np.round(observation.corners_px[[origin, end]], 1).tolist(),
            remedy="give the corner at the end of the origin's row, not one across the board",
        )
    c, s = axis / np.linalg.norm(axis)
    turned = (observation.board_m - observation.board_m[origin]) @ np.array([[c, -s], [s, c]])
    return replace(observation, board_m=turned)


def _nearest(observation: BoardObservation, pixel: Array | None, key: str) -> int:
    if pixel is None:
        raise InputError(f"{key} is missing", allowed="a pixel of the first floor image")
    distance = np.linalg.norm(observation.corners_px - pixel, axis=1)
    nearest = int(np.argmin(distance))
    between = np.linalg.norm(observation.corners_px - observation.corners_px[nearest], axis=1)
    square_px = np.min(between[between > 0])
    if distance[nearest] > square_px:
        raise InputError(
            f"{key} is not at a corner of the board in {observation.name}",
            got=np.asarray(pixel).tolist(),
            allowed=f"within {square_px:.0f} px of a corner; the nearest is {observation.corners_px[nearest].round(1)}",
            remedy="give the pixel of an inner corner of the board in the first floor image, as stored: viewers turn a "
            "picture by its tag for orientation (EXIF)",
        )
    return nearest


def pose_of_plane(points_m: Array, pixels: Array, estimate: Estimate) -> list[Array]:
    """Poses (6,) of a flat set of points in the camera frame, the likelier of the two solutions first.

    A distant flat target has two nearly equivalent poses, tilted to either side (Collins and Bartoli 2014). None where
    a fisheye of this focal length would see pixels at more than a right angle to its axis.
    """
    matrix, distortion = estimate.matrix, estimate.distortion
    if estimate.fisheye:
        pixels = undistorted_kernel(np.ascontiguousarray(pixels), matrix, estimate.lens)
        matrix, distortion = np.eye(3), np.zeros(8)
        if not np.isfinite(pixels).all():
            return []
    _, rotations, shifts, _ = cv2.solvePnPGeneric(points_m, pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    return [np.concatenate([r.ravel(), t.ravel()]) for r, t in zip(rotations, shifts, strict=True)]


def floor_from_boards(origin_pose: Array, all_poses: Sequence[Array], thickness_m: float) -> Array:
    """First guess (6,) of the floor in the camera frame: mean normal of all boards, origin and x axis of one."""
    normal = np.mean([cv2.Rodrigues(pose[:3])[0][:, 2] for pose in all_poses], axis=0)
    normal /= np.linalg.norm(normal)
    x = cv2.Rodrigues(origin_pose[:3])[0][:, 0]
    x = x - (x @ normal) * normal
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(normal, x), normal])
    return np.concatenate([cv2.Rodrigues(rotation)[0].ravel(), origin_pose[3:] - thickness_m * normal])


def place_on_floor(points_m: Array, pixels: Array, estimate: Estimate, height_m: float) -> Array:
    """Where a flat set of points (n, 2) [m], seen at ``pixels`` (n, 2), lies in the floor frame (3,) [m, m, rad]."""
    camera = estimate.T_camera_floor, estimate.matrix, np.ascontiguousarray(estimate.lens)
    return rigid_fit(points_m, to_plane_kernel(np.ascontiguousarray(pixels), height_m, *camera))


def place_of_pose(pose: Array, estimate: Estimate) -> Array:
    """Where a board at a pose (6,) in the camera frame lies in the floor frame, nearly flat on it (3,) [m, m, rad]."""
    T = estimate.T_camera_floor
    x_axis, origin = T[:3, :3].T @ cv2.Rodrigues(pose[:3])[0][:, 0], T[:3, :3].T @ (pose[3:] - T[:3, 3])
    return np.array([*origin[:2], np.arctan2(x_axis[1], x_axis[0])])
