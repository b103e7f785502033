"""OpenCV as its users use it: a camera by ``calibrateCamera``, a floor by ``solvePnP``, a track by Lucas and Kanade."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from studies.worlds.boards import CornerScene, board_corners
from towval.model import Array, Body, Calibration, Camera, Floor
from towval.model.geometry import rigid_fit, transform
from towval.optics.projection import to_plane

POINTS, QUALITY, APART_PX = 200, 0.01, 7
"""Of ``goodFeaturesToTrack``, as in OpenCV's tutorial but for the number."""

FEWEST = 3
"""Points of a rigid fit: two determine it."""

BACK_PX = 1.0
"""A point that does not come back to within this from the next picture is dropped."""


def opencv_calibration(scene: CornerScene) -> tuple[Camera, Floor]:
    """Camera from all boards with OpenCV's default lens (k1 k2 p1 p2 k3), floor from the board at the origin."""
    seen = scene.seen
    boards = [*seen.boards, *seen.floor_boards]
    held = [np.column_stack([board.board_m, np.zeros(len(board.board_m))]).astype(np.float32) for board in boards]
    corners = [board.corners_px.astype(np.float32) for board in boards]
    _, matrix, lens, _, _ = cv2.calibrateCamera(held, corners, seen.resolution_px, np.eye(3), np.zeros(5))
    flat = seen.floor_boards[0]
    thickness = 0.0 if seen.reference is None else seen.reference.board_thickness_m
    corners_m = board_corners()
    places = np.column_stack([corners_m, np.full(len(corners_m), thickness)])
    _, turn, shift = cv2.solvePnP(places, flat.corners_px, matrix, lens)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
    distortion = np.zeros(8)
    distortion[:5] = np.ravel(lens)
    return Camera(seen.resolution_px, np.array(matrix, dtype=np.float64), distortion, "rational"), Floor(T)


def clicked_pose(calibration: Calibration, body: Body, clicks_px: Array) -> Array:
    """The pose (3,) in the first picture that fits clicks on the corners of the top."""
    camera, floor, height = calibration.camera, calibration.floor, body.tracked_plane_height_m
    return rigid_fit(body.top_corners_m, to_plane(camera, floor, np.asarray(clicks_px), height))


def klt_motions(
    frames: Iterable[tuple[float, NDArray[np.uint8]]], calibration: Calibration, body: Body, clicks_px: Array
) -> Array:
    """Motions (n, 3) of a body since the first picture by Lucas-Kanade, pyramidal, with OpenCV's defaults.

    Points are chosen once, within the clicked outline, and followed from picture to picture; those that do not come
    back are dropped. Their places on the body's plane now and in the first picture give the motion, by a rigid fit. NaN
    where fewer than three are left. Poses are these motions after a first one (:func:`clicked_pose`).
    """
    height = body.tracked_plane_height_m

    def on_plane(pixels: Any) -> Array:
        return to_plane(calibration.camera, calibration.floor, np.reshape(pixels, (-1, 2)).astype(np.float64), height)

    flow: Any = cv2.calcOpticalFlowPyrLK  # its stub does not take the None that it documents
    motions: list[Array] = []
    last: Any = None
    points: Any = None
    first = np.empty((0, 2))
    for _, luma in frames:
        if last is None:
            inside = cv2.fillConvexPoly(np.zeros_like(luma), np.round(clicks_px).astype(np.int32), 255)
            points = cv2.goodFeaturesToTrack(luma, POINTS, QUALITY, APART_PX, mask=inside)
            first = on_plane(points)
        else:
            there, found, _ = flow(last, luma, points, None)
            back, again, _ = flow(luma, last, there, None)
            kept = (found & again)[:, 0].astype(bool) & (np.linalg.norm(back - points, axis=2)[:, 0] < BACK_PX)
            points, first = there[kept], first[kept]
        last = luma
        if len(points) < FEWEST:
            motions.append(np.full(3, np.nan))
            continue
        motions.append(rigid_fit(first, on_plane(points)))
    return np.array(motions)


def rms_error_m(poses: Array, truth: Array) -> float:
    """RMS distance of places over the frames with a pose [m]."""
    apart = np.linalg.norm(transform(poses, np.zeros(2)) - truth[:, :2], axis=1)
    return float(np.sqrt(np.nanmean(apart**2)))
