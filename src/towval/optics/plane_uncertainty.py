"""Uncertainty of a calibration in metres on planes parallel to the floor."""

import cv2
import numpy as np
from numpy.typing import ArrayLike

from towval.model import CALIBRATION_PARAMETERS, Array, Calibration, Camera, Floor, UncertaintyMap
from towval.model.geometry import lifted
from towval.optics.projection import project_with_derivatives, to_plane


def shared_parameters(camera: Camera, floor: Floor) -> Array:
    """Values (18,) of :data:`towval.model.CALIBRATION_PARAMETERS`."""
    K, T = camera.matrix, floor.T_camera_floor
    rotation = cv2.Rodrigues(T[:3, :3])[0].ravel()
    return np.concatenate([[K[0, 0], K[1, 1], K[0, 2], K[1, 2]], camera.distortion, rotation, T[:3, 3]])


def position_sensitivity(camera: Camera, floor: Floor, pixels: ArrayLike, height_m: float) -> tuple[Array, Array]:
    """Derivatives of the places of pixels (n, 2) on a plane by the calibration (n, 2, 18) and by its height (n, 2).

    The pixel of a point X on the plane is π(X, θ). At a fixed pixel ``dX/dθ = −(∂π/∂X)⁻¹ ∂π/∂θ`` within the plane; NaN
    where a ray misses it. θ are :data:`towval.model.CALIBRATION_PARAMETERS`.
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    position = to_plane(camera, floor, pixels, height_m)
    hit = np.isfinite(position).all(axis=1)
    by_parameters = np.full((len(pixels), 2, len(CALIBRATION_PARAMETERS)), np.nan)
    by_height = np.full((len(pixels), 2), np.nan)
    if not hit.any():
        return by_parameters, by_height
    points = lifted(position[hit], height_m)
    pose = shared_parameters(camera, floor)[12:]
    _, jacobian = project_with_derivatives(points, pose[:3], pose[3:], camera.matrix, camera.lens)
    by_point = jacobian[:, :, 3:6] @ floor.T_camera_floor[:3, :3]
    ordered = np.concatenate([jacobian[:, :, 6:18], jacobian[:, :, :6]], axis=2)
    by_parameters[hit] = -np.linalg.solve(by_point[:, :, :2], ordered)
    by_height[hit] = -np.linalg.solve(by_point[:, :, :2], by_point[:, :, 2:])[:, :, 0]
    return by_parameters, by_height


def position_covariance(
    calibration: Calibration, pixels: ArrayLike, height_m: float, *, height_std_m: float = 0.0
) -> Array:
    """Covariance (..., 2, 2) of x and y [m²] on a plane, of pixels (..., 2), NaN where a ray misses the plane.

    It includes what scatters from view to view, propagated through the whole calibration, and the deviation of the
    plane's height over the floor, but no error that all views share: of the lens model's form where no corner was, of
    the board's size.
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    A, h = position_sensitivity(calibration.camera, calibration.floor, pixels.reshape(-1, 2), height_m)
    covariance = A @ calibration.covariance @ A.transpose(0, 2, 1)
    covariance += height_std_m**2 * h[:, :, None] * h[:, None, :]
    return covariance.reshape(*pixels.shape[:-1], 2, 2)


def pixel_grid(resolution_px: tuple[int, int], columns: int) -> Array:
    """Pixels (rows, columns, 2) in a grid of nearly square cells over the image, from corner to corner."""
    width, height = resolution_px
    rows = max(2, round(columns * height / width))
    return np.stack(np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows)), axis=-1)


def uncertainty_map(
    calibration: Calibration, height_m: float, *, height_std_m: float = 0.0, columns: int = 32
) -> UncertaintyMap:
    """Position uncertainty over the whole image, on the floor or on a body's plane; see :func:`position_covariance`."""
    pixels = pixel_grid(calibration.camera.resolution_px, columns)
    covariance = position_covariance(calibration, pixels, height_m, height_std_m=height_std_m)
    return UncertaintyMap(height_m, pixels, covariance)


def camera_position_covariance(calibration: Calibration) -> Array:
    """Covariance (3, 3) of the camera's place in the floor frame [m²]; the last element is that of its height."""
    rotation_vector = shared_parameters(calibration.camera, calibration.floor)[12:15]
    shift = calibration.floor.T_camera_floor[:3, 3]
    rotation, derivative = cv2.Rodrigues(rotation_vector)
    # The place is −Rᵀt; OpenCV gives the derivative (3, 9) of the elements of R, row by row.
    by_rotation = -np.einsum("kij,i->jk", derivative.reshape(3, 3, 3), shift)
    jacobian = np.hstack([by_rotation, -rotation.T])
    covariance: Array = jacobian @ calibration.covariance[12:, 12:] @ jacobian.T
    return covariance
