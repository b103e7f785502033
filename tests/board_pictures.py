"""Rendered pictures of calibration boards, with the true place of every corner."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array

_OVERSAMPLING = 4


def chessboard_pattern(columns: int, rows: int, square_px: int) -> NDArray[np.uint8]:
    """A chessboard of columns × rows inner corners with a white margin of one square."""
    row, column = np.mgrid[0 : rows + 1, 0 : columns + 1]
    squares = np.where((row + column) % 2 == 0, 25, 235).astype(np.uint8)
    return np.pad(np.kron(squares, np.ones((square_px, square_px), np.uint8)), square_px, constant_values=235)


def pattern_to_image(pattern: NDArray[np.uint8], quad_px: Array) -> Array:
    """Homography (3, 3) that brings the corners of a pattern to four pixels, clockwise from its top left."""
    height, width = pattern.shape
    edges = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32) - 0.5
    return cv2.getPerspectiveTransform(edges, np.asarray(quad_px, dtype=np.float32))


def picture(
    pattern: NDArray[np.uint8], homography: Array, size: tuple[int, int], noise: float = 2.0
) -> NDArray[np.uint8]:
    """The pattern seen through a homography over a grey wall, area-sampled, with noise in grey levels."""
    width, height = size
    n = _OVERSAMPLING
    shift = (n - 1) / 2
    fine = np.array([[n, 0, shift], [0, n, shift], [0, 0, 1]]) @ homography
    canvas = cv2.warpPerspective(
        pattern, fine, (width * n, height * n), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=120
    )
    image = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA).astype(np.float64)
    image += np.random.default_rng(0).normal(0, noise, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def true_corners(columns: int, rows: int, square_px: int, homography: Array) -> Array:
    """Pixels (columns · rows, 2) of the inner corners of :func:`chessboard_pattern`, row by row."""
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    at = square_px * (np.stack([column, row], axis=-1).reshape(-1, 1, 2) + 2.0) - 0.5
    return cv2.perspectiveTransform(at, homography).reshape(-1, 2)
