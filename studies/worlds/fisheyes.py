"""Calibration sets of a fisheye with ground truth: corners as OpenCV's own fisheye model projects them.

That shares no code with the package's, and has a coefficient more.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from towval.calibration.corners import BoardObservation
from towval.calibration.doubts import doubts_std
from towval.calibration.observations import CalibrationObservations
from towval.model import Array, Board, Camera, Floor, FloorReference
from towval.optics.projection import to_plane

SIZE = (1280, 960)
BOARD = Board("chessboard", (9, 6), 0.04)
NOISE_PX = 0.06
_CORNERS: Array = BOARD.square_m * np.array([[column, row] for row in range(6) for column in range(9)], dtype=float)
_HELD, _LYING = 18, 7


@dataclass(frozen=True)
class FisheyeLab:
    """A fisheye 2.5 m over a floor; ``bend`` are OpenCV's four coefficients, and corners have ``noise_px``."""

    focal_px: float
    bend: tuple[float, ...]
    noise_px: float
    rng: np.random.Generator

    @property
    def matrix(self) -> Array:
        """Camera matrix (3, 3) [px]."""
        return np.array([[self.focal_px, 0, 635.0], [0, 1.002 * self.focal_px, 486.0], [0, 0, 1]])

    @property
    def floor(self) -> Floor:
        """The floor, which the camera sees from 2.5 m, 3° off the vertical."""
        T = np.eye(4)
        T[:3, :3] = cv2.Rodrigues(np.array([np.pi, 0, 0]))[0] @ cv2.Rodrigues(np.array([0.04, -0.03, 0.1]))[0]
        T[:3, 3] = 0.05, -0.1, 2.5
        return Floor(T)

    def views(self) -> CalibrationObservations:
        """Boards held in all directions of the view, and boards on the floor, the first of which is its frame."""
        first = self._observed("floor 0", self.on_floor(_CORNERS, 0.003))
        flat = (first, *(self._lying(f"floor {i}") for i in range(1, _LYING)))
        reference = FloorReference(first.corners_px[0], first.corners_px[8], board_thickness_m=0.003)
        held = tuple(self._held(f"board {i}") for i in range(_HELD))
        return CalibrationObservations(SIZE, held, flat, reference, doubts_std(BOARD, reference))

    def on_floor(self, places: Array, height_m: float = 0.0) -> Array:
        """Pixels (n, 2) of places (n, 2) [m] at a height over the floor."""
        T = self.floor.T_camera_floor
        return self._seen(np.column_stack([places, np.full(len(places), height_m)]) @ T[:3, :3].T + T[:3, 3])

    def error_m(self, camera: Camera, floor: Floor, height_m: float) -> Array:
        """Errors (n, 2) of places over the picture, up to 2.5 m from the origin, by a camera and a floor [m]."""
        places = np.random.default_rng(5).uniform(-2.5, 2.5, (2000, 2))
        pixels = self.on_floor(places, height_m)
        shown = ((pixels > 0) & (pixels < np.array(SIZE) - 1)).all(axis=1)
        return to_plane(camera, floor, pixels[shown], height_m) - places[shown]

    def _seen(self, in_camera: Array) -> Array:
        nowhere, bend = np.zeros(3), np.array(self.bend, dtype=float)
        pixels = cv2.fisheye.projectPoints(in_camera[:, None], nowhere, nowhere, self.matrix, bend)[0]
        return np.asarray(pixels, dtype=np.float64)[:, 0]

    def _observed(self, name: str, pixels: Array) -> BoardObservation:
        return BoardObservation(name, pixels + self.rng.normal(0, self.noise_px, pixels.shape), _CORNERS)

    def _held(self, name: str) -> BoardObservation:
        """A board in some direction of the view, turned and tilted about it."""
        widest = 0.95 * np.hypot(*SIZE) / 2 / self.focal_px
        while True:
            angle, around = self.rng.uniform(0, widest), self.rng.uniform(-np.pi, np.pi)
            axis = np.array([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)])
            across = np.cross([0, 1, 0.1], axis)
            across /= np.linalg.norm(across)
            facing = np.column_stack([across, np.cross(axis, across), axis])
            turned = facing @ cv2.Rodrigues(self.rng.normal(0, [0.4, 0.4, 0.8]))[0]
            points = np.column_stack([_CORNERS - _CORNERS.mean(axis=0), np.zeros(len(_CORNERS))]) @ turned.T
            points = points + self.rng.uniform(0.35, 0.8) * axis
            pixels = self._seen(points)
            if points[:, 2].min() > 0.08 and _inside(pixels):
                return self._observed(name, pixels)

    def _lying(self, name: str) -> BoardObservation:
        while True:
            heading, place = self.rng.uniform(-3, 3), self.rng.uniform(-2.2, 2.2, 2)
            c, s = np.cos(heading), np.sin(heading)
            pixels = self.on_floor(_CORNERS @ np.array([[c, s], [-s, c]]) + place, 0.003)
            if _inside(pixels):
                return self._observed(name, pixels)


def _inside(pixels: Array) -> bool:
    return bool((pixels > 5).all() and (pixels < np.array(SIZE) - 6).all())


def fisheye_lab(
    seed: int, focal_px: float, bend: tuple[float, ...] = (0.0,) * 4, *, noise_px: float = NOISE_PX
) -> FisheyeLab:
    """A fisheye whose boards and noise follow from a seed; without ``bend`` equal angles are equal distances."""
    return FisheyeLab(focal_px, bend, noise_px, np.random.default_rng(seed))
