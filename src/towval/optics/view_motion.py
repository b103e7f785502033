"""A calibrated view that moved a little, and the one before; not compiled, so that drawing need not wait for it."""

from dataclasses import replace

import cv2
import numpy as np

from towval.model import Array, Camera, Floor


def moved_view(camera: Camera, floor: Floor, motion: Array) -> tuple[Camera, Floor]:
    """Camera and floor after a ``motion`` (9,) of the calibrated view.

    Its order is that of :data:`towval.model.conventions.VIEW_MOTION`.

    Examples
    --------
    >>> import numpy as np
    >>> camera = Camera((640, 480), np.array([[500, 0, 320], [0, 500, 240], [0, 0, 1.0]]), np.zeros(8), "none")
    >>> nearer, _ = moved_view(camera, Floor(np.eye(4)), np.array([0, 0, 0, 0, 0, 0, 0.01, 2, 0]))
    >>> nearer.matrix[0].round(2).tolist()
    [505.03, 0.0, 322.0]
    """
    T, matrix = floor.T_camera_floor.copy(), camera.matrix.copy()
    T[:3] = cv2.Rodrigues(np.asarray(motion[:3], dtype=np.float64))[0] @ T[:3]
    T[:3, 3] += motion[3:6]
    matrix[[0, 1], [0, 1]] *= np.exp(motion[6])
    matrix[:2, 2] += motion[7:]
    return replace(camera, matrix=matrix), replace(floor, T_camera_floor=T)


def view_before(camera: Camera, floor: Floor, motion: Array) -> tuple[Camera, Floor]:
    """The view that :func:`moved_view` leads to ``camera`` and ``floor`` from, by a ``motion`` (9,)."""
    T, matrix = floor.T_camera_floor.copy(), camera.matrix.copy()
    T[:3, 3] -= motion[3:6]
    T[:3] = cv2.Rodrigues(-np.asarray(motion[:3], dtype=np.float64))[0] @ T[:3]
    matrix[[0, 1], [0, 1]] *= np.exp(-motion[6])
    matrix[:2, 2] -= motion[7:]
    return replace(camera, matrix=matrix), replace(floor, T_camera_floor=T)
