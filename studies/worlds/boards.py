"""Synthetic calibration sets with ground truth: corners of boards observed by a random ceiling camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from towval.calibration.corners import BoardObservation, facing_camera
from towval.calibration.observations import CalibrationObservations
from towval.model import Array, Camera, Floor, FloorReference
from towval.model.geometry import lifted, transform
from towval.optics.projection import project, project_kernel, to_plane


@dataclass(frozen=True)
class CornerScene:
    """Observations of boards by a ceiling camera, and the ground truth: camera and floor."""

    camera: Camera
    floor: Floor
    seen: CalibrationObservations


def ceiling_camera(rng: np.random.Generator) -> tuple[Camera, Floor]:
    """A camera of random focal length and lens, 3.5 to 4.5 m over the floor, up to 6° off the vertical."""
    focal, distortion = rng.uniform(1250, 1700), np.zeros(8)
    distortion[:2] = rng.uniform(-0.12, 0.0), rng.uniform(0.0, 0.03)
    centre = np.array([959.5, 539.5]) + rng.uniform(-15, 15, 2)
    matrix = np.array([[focal, 0, centre[0]], [0, focal * rng.uniform(0.998, 1.002), centre[1]], [0, 0, 1]])
    tilt, about, heading = np.radians(rng.uniform(0, 6)), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    T = np.eye(4)
    T[:3, :3] = axis_rotation(tilt, about) @ np.diag([1.0, -1.0, -1.0]) @ cv2.Rodrigues(np.array([0, 0, heading]))[0]
    T[:3, 3] = *rng.uniform(-0.3, 0.3, 2), rng.uniform(3.5, 4.5)
    return Camera((1920, 1080), matrix, distortion, "k1 k2"), Floor(T)


def axis_rotation(angle: float, about: float) -> Array:
    """Rotation (3, 3) by an angle about an axis in the image plane, itself at the angle ``about`` [rad]."""
    return np.asarray(cv2.Rodrigues(angle * np.array([np.cos(about), np.sin(about), 0.0]))[0], dtype=np.float64)


def board_corners(columns: int = 9, rows: int = 6, square_m: float = 0.04) -> Array:
    """Corners (n, 2) of a chessboard about its centre [m]."""
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    return square_m * (grid - grid.mean(axis=0))


@dataclass(frozen=True)
class BoardFaults:
    """How the filmed board and the held pictures are not what the calibration is told.

    ``size`` of the board over the stated one; ``bow_m`` between its middle and its shorter sides, a circular arc of the
    sheet's own length; ``thicker_m`` than stated; ``zoom`` of the held pictures over that of the others, about the
    picture's middle; ``stretch`` of the print along its longer side.
    """

    size: float = 1.0
    bow_m: float = 0.0
    thicker_m: float = 0.0
    zoom: float = 1.0
    stretch: float = 0.0

    def surface(self, corners: Array) -> Array:
        """Where corners (n, 2) of a flat board of the stated size are on the real one (n, 3) [m]."""
        corners = self.size * corners * [1 + self.stretch, 1.0]
        if not self.bow_m:
            return lifted(corners, 0.0)
        half = float(corners[:, 0].max())
        radius = (half**2 + self.bow_m**2) / (2 * self.bow_m)
        angle = corners[:, 0] / radius
        return np.column_stack([radius * np.sin(angle), corners[:, 1], radius * (np.cos(angle) - 1)])

    def held_camera(self, camera: Camera) -> Camera:
        """The camera of the held pictures."""
        middle = (np.array(camera.resolution_px) - 1) / 2
        matrix = camera.matrix.copy()
        matrix[:2, :2] *= self.zoom
        matrix[:2, 2] = middle + self.zoom * (camera.matrix[:2, 2] - middle)
        return replace(camera, matrix=matrix)


SOUND = BoardFaults()


def held_board(
    rng: np.random.Generator,
    camera: Camera,
    name: str,
    *,
    faults: BoardFaults = SOUND,
    tilt_deg: tuple[float, float],
    where_px: Array,
    noise_px: float,
    distance_m: tuple[float, float] = (0.8, 1.8),
) -> BoardObservation:
    """A board held with its centre near a pixel, moved towards the image centre until all of it is in view."""
    corners = board_corners()
    turn = cv2.Rodrigues(np.array([0, 0, rng.uniform(0, 2 * np.pi)]))[0]
    tilt = axis_rotation(np.radians(rng.uniform(*tilt_deg)), rng.uniform(0, 2 * np.pi))
    distance, centre = rng.uniform(*distance_m), np.array(camera.resolution_px) / 2
    T = np.eye(4)
    T[:3, :3] = tilt @ np.diag([1.0, -1.0, -1.0]) @ turn
    for share in np.linspace(1, 0, 21):
        pixel = centre + share * (where_px - centre)
        ray = np.array([*((pixel - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2]), 1.0])
        T[:3, 3] = distance * ray
        pixels = project_kernel(faults.surface(corners), T, camera.matrix, camera.distortion)
        if ((pixels > 5) & (pixels < np.array(camera.resolution_px) - 6)).all():
            break
    seen = pixels + rng.normal(0, noise_px, pixels.shape)
    return BoardObservation(name, seen, facing_camera(corners, seen))


def spread_pixels(rng: np.random.Generator, count: int, resolution_px: tuple[int, int], share: float = 1.0) -> Array:
    """Pixels (count, 2) spread over the image, or over the middle of it, one in each cell of a grid in random order."""
    cells = np.array([(c, r) for r in range(3) for c in range(4)])
    order = np.concatenate([rng.permutation(12) for _ in range(-(-count // 12))])[:count]
    unit = (cells[order] + rng.uniform(0, 1, (count, 2))) / [4, 3]
    return np.array(resolution_px) * (0.5 + share * (unit - 0.5))


def floor_marks(rng: np.random.Generator, camera: Camera, floor: Floor, noise_px: float) -> FloorReference:
    """Nine surveyed marks, three by three over the visible floor."""
    unit = np.stack(np.meshgrid([0.1, 0.5, 0.9], [0.1, 0.5, 0.9]), axis=-1).reshape(-1, 2)
    marks = to_plane(camera, floor, unit * camera.resolution_px, 0.0)
    pixels = project(camera, floor, lifted(marks, 0.0))
    return FloorReference(
        marks_px=pixels + rng.normal(0, noise_px, pixels.shape), marks_m=marks, mark_std_px=max(noise_px, 0.01)
    )


def floor_boards(
    rng: np.random.Generator,
    camera: Camera,
    floor: Floor,
    count: int,
    noise_px: float,
    thickness_m: float = 0.003,
    faults: BoardFaults = SOUND,
) -> list[BoardObservation]:
    """Boards lying on the floor, the first at the origin of the floor frame along x, the others over the image."""
    corners, observations = board_corners(), []
    surface = faults.surface(corners)
    # A bent board rests on its lowest points.
    heights = thickness_m + faults.thicker_m + surface[:, 2] - surface[:, 2].min()
    unit = np.array([(0.15, 0.15), (0.85, 0.85), (0.85, 0.15), (0.15, 0.85), (0.5, 0.85), (0.5, 0.15)])[: count - 1]
    unit = unit + rng.uniform(-0.05, 0.05, unit.shape)
    places = np.column_stack(
        [to_plane(camera, floor, unit * camera.resolution_px, 0.0), rng.uniform(0, 2 * np.pi, count - 1)]
    )
    for i, place in enumerate([np.zeros(3), *places]):
        pixels = project(camera, floor, np.column_stack([transform(place, surface[:, :2]), heights]))
        seen = pixels + rng.normal(0, noise_px, pixels.shape)
        observations.append(BoardObservation(f"floor {i}", seen, facing_camera(corners, seen)))
    return observations


def calibration_set(
    seed: int,
    *,
    views: int = 12,
    tilt_deg: tuple[float, float] = (20.0, 40.0),
    noise_px: float = 0.15,
    share: float = 1.0,
    floor: str = "marks",
    faults: BoardFaults = SOUND,
) -> CornerScene:
    """A random set: ``views`` boards over ``share`` of the image, and a floor.

    The floor comes from nine surveyed "marks", from seven "boards", or from seven boards and four marks ("both").
    """
    rng = np.random.default_rng(seed)
    camera, true_floor = ceiling_camera(rng)
    where, held = spread_pixels(rng, views, camera.resolution_px, share), faults.held_camera(camera)
    boards = tuple(
        held_board(rng, held, f"board {i}", tilt_deg=tilt_deg, where_px=where[i], noise_px=noise_px, faults=faults)
        for i in range(views)
    )
    if floor == "marks":
        seen = CalibrationObservations(camera.resolution_px, boards, (), floor_marks(rng, camera, true_floor, noise_px))
    else:
        flat = floor_boards(rng, camera, true_floor, 7, noise_px, faults=faults)
        reference = FloorReference(flat[0].corners_px[0], flat[0].corners_px[8], board_thickness_m=0.003)
        if floor == "both":
            marks = floor_marks(rng, camera, true_floor, noise_px)
            reference = replace(
                marks,
                marks_px=marks.marks_px[[0, 2, 6, 8]],
                marks_m=marks.marks_m[[0, 2, 6, 8]],
                board_thickness_m=0.003,
            )
        seen = CalibrationObservations(camera.resolution_px, boards, tuple(flat), reference)
    return CornerScene(camera, true_floor, seen)
