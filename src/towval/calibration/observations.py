"""The observations of a calibration, as blocks for the adjustment, and a first guess of camera, floor and places."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from towval.calibration.blocks import CAMERA_END, DOUBTS, FLOOR_START, Block, Estimate, Placement, residuals
from towval.calibration.corners import BoardObservation, facing_camera
from towval.calibration.floor import floor_from_boards, place_of_pose, place_on_floor, pose_of_plane
from towval.model import Array, FloorReference
from towval.model.errors import InputError
from towval.model.geometry import lifted

MARKS_VIEW = "surveyed marks"
"""Name of the view that holds the surveyed marks, in place of that of a picture."""


_FOCAL_SHARES = (0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.3, 1.8, 2.5, 4.0)
"""Focal lengths to begin with, of the longer side of a picture."""


@dataclass(frozen=True)
class CalibrationObservations:
    """Boards held up, boards lying on the floor, and surveyed marks.

    Without marks the first floor board fixes the floor frame: its ``board_m`` are floor coordinates. ``reference`` is
    None where there is no floor at all. ``doubts_std`` (10,) are the deviations of
    :data:`towval.calibration.blocks.DOUBTS`; zero, as by default, is what is known exactly.
    """

    resolution_px: tuple[int, int]
    boards: tuple[BoardObservation, ...]
    floor_boards: tuple[BoardObservation, ...] = ()
    reference: FloorReference | None = None
    doubts_std: Array = field(default_factory=lambda: np.zeros(len(DOUBTS)))

    @property
    def observations(self) -> tuple[BoardObservation, ...]:
        """All boards, in the order of the blocks."""
        return self.boards + self.floor_boards

    @property
    def floor_reference(self) -> FloorReference:
        """What fixes the floor frame; raises `InputError` where there is no floor."""
        if self.reference is None:
            raise InputError("the observations have no floor", allowed="a floor reference")
        return self.reference

    @property
    def marks(self) -> int:
        """Number of surveyed marks."""
        return 0 if self.reference is None else len(self.reference.marks_px)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Boards, floor boards, then the marks where there are any."""
        free = [Block(lifted(s.board_m, 0.0), s.corners_px, Placement.FREE, on_board=s.on_board) for s in self.boards]
        flat = [self._floor_block(i) for i in range(len(self.floor_boards))]
        if self.marks:
            reference = self.floor_reference
            marks_m = lifted(reference.marks_m, 0.0)
            flat.append(Block(marks_m, reference.marks_px, Placement.FIXED, reference.mark_std_px))
        return (*free, *flat)

    def _floor_block(self, index: int) -> Block:
        observation = self.floor_boards[index]
        placement = Placement.FIXED if index == 0 and not self.marks else Placement.ON_FLOOR
        points_m = lifted(observation.board_m, self.floor_reference.board_thickness_m)
        return Block(points_m, observation.corners_px, placement, on_board=observation.on_board)

    def without(self, names: set[str]) -> "CalibrationObservations":
        """The observations less some boards."""
        return replace(
            self,
            boards=tuple(s for s in self.boards if s.name not in names),
            floor_boards=tuple(s for s in self.floor_boards if s.name not in names),
        )


def first_guess(observed: CalibrationObservations, *, fisheye: bool = False) -> Estimate:
    """Camera without distortion, or a ``fisheye`` of equal angles, floor and places, to start the adjustment from.

    The focal length is that with which the boards, each by itself, leave least: of their vanishing points (Zhang 2000),
    which a wide lens leads astray, and of lengths between a wide lens's and a long one's. The principal point is the
    image centre.
    """
    width, height = observed.resolution_px
    points = [lifted(s.board_m, 0.0).astype(np.float32) for s in observed.observations]
    pixels = [s.corners_px.astype(np.float32) for s in observed.observations]
    guess = cv2.initCameraMatrix2D(points, pixels, observed.resolution_px, 1.0)[0, 0]
    # Boards without tilt have no vanishing points: the guess may then be anything.
    focal = guess if np.isfinite(guess) and 0.2 * width < guess < 10 * width else float(width)
    shared = np.zeros(CAMERA_END)
    shared[2:4] = (width - 1) / 2, (height - 1) / 2
    cameras = []
    for length in (focal, *(share * max(width, height) for share in _FOCAL_SHARES)):
        shared[:2] = length
        cameras.append(Estimate(shared.copy(), (), fisheye=fisheye))
    return placed(observed, min(cameras, key=lambda camera: _left_over(observed, camera)))


def _left_over(observed: CalibrationObservations, camera: Estimate) -> float:
    """Sum of the RMS residuals of the boards, each in the likelier of its poses [px]."""
    total = 0.0
    for board in observed.observations:
        block = Block(lifted(board.board_m, 0.0), board.corners_px, Placement.FREE)
        poses = pose_of_plane(block.points_m, block.pixels, camera)
        if not poses:
            return np.inf
        total += float(np.sqrt(np.mean(residuals([block], replace(camera, places=(poses[0],)))[0] ** 2)))
    return total


def placed(observed: CalibrationObservations, estimate: Estimate) -> Estimate:
    """The same camera with the floor and all places estimated again, each board by itself."""
    poses = [pose_of_plane(lifted(s.board_m, 0.0), s.corners_px, estimate)[0] for s in observed.observations]
    free, flat = poses[: len(observed.boards)], poses[len(observed.boards) :]
    if observed.reference is None:
        return replace(estimate, places=tuple(free))
    estimate = with_floor(observed, estimate, flat)
    thickness = observed.reference.board_thickness_m
    places = [np.zeros(0) for _ in observed.blocks[len(observed.boards) :]]
    for i, observation in enumerate(observed.floor_boards):
        if observed.blocks[len(observed.boards) + i].placement is not Placement.FIXED:
            place = place_on_floor(observation.board_m, observation.corners_px, estimate, thickness)
            # Over a floor that is only guessed at, the rays of a wide lens may miss it.
            places[i] = place if np.isfinite(place).all() else place_of_pose(flat[i], estimate)
    return replace(estimate, places=(*free, *places))


def with_floor(observed: CalibrationObservations, estimate: Estimate, flat: Sequence[Array]) -> Estimate:
    """A first guess of the floor, from marks or from the poses (6,) of boards that lie ``flat`` on it.

    Raises `InputError` where neither decides, and for marks that are on one line or in left-handed coordinates.
    """
    reference, shared = observed.floor_reference, estimate.shared.copy()
    if observed.marks >= 4:
        _check_marks(reference)
        marks = lifted(reference.marks_m, 0.0)
        shared[FLOOR_START:] = pose_of_plane(marks, reference.marks_px, estimate)[0]
        return replace(estimate, shared=shared)
    if not flat:
        raise InputError(
            "the floor cannot be found",
            got=f"{observed.marks} surveyed marks and no board on the floor",
            allowed="four marks or more, or a board lying on the floor",
        )
    shared[FLOOR_START:] = floor_from_boards(flat[0], flat, reference.board_thickness_m)
    estimate = replace(estimate, shared=shared)
    return _turned_to_marks(reference, estimate) if observed.marks else estimate


def _check_marks(reference: FloorReference) -> None:
    marks_m = reference.marks_m
    spread = np.linalg.svd(marks_m - marks_m.mean(axis=0), compute_uv=False)
    if spread[1] < 0.05 * spread[0]:
        raise InputError(
            "the surveyed marks are all on one line",
            got=marks_m.tolist(),
            allowed="marks to both sides of any line, best towards the four corners of the picture",
        )
    if not np.array_equal(facing_camera(marks_m, reference.marks_px), marks_m):
        raise InputError(
            "the surveyed marks are in left-handed coordinates, or the picture is mirrored",
            got="x to y is clockwise as the camera sees the floor",
            allowed="z up: seen from above, y is a quarter turn counter-clockwise from x",
            remedy="swap the two coordinates of every at_m, or change the sign of one; do not mirror the picture",
        )


def _turned_to_marks(reference: FloorReference, estimate: Estimate) -> Estimate:
    """The floor of the boards, rotated and shifted so that the marks have their surveyed coordinates."""
    x, y, heading = place_on_floor(reference.marks_m, reference.marks_px, estimate, 0.0)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
    turn[:2, 3] = x, y
    T = estimate.T_camera_floor @ turn
    shared = estimate.shared.copy()
    shared[FLOOR_START:] = np.concatenate([cv2.Rodrigues(T[:3, :3])[0].ravel(), T[:3, 3]])
    return replace(estimate, shared=shared)


def unflipped(observed: CalibrationObservations, estimate: Estimate) -> Estimate:
    """The estimate with the better of the two poses of each free board, now that the camera is known."""
    places = list(estimate.places)
    for i, block in enumerate(observed.blocks):
        if block.placement is not Placement.FREE:
            continue
        for pose in pose_of_plane(block.points_m, block.pixels, estimate):
            other = residuals([block], replace(estimate, places=(pose,)))[0]
            own = residuals([block], replace(estimate, places=(places[i],)))[0]
            if np.sum(other**2) < np.sum(own**2):
                places[i] = pose
    return replace(estimate, places=tuple(places))
