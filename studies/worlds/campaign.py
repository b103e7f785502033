"""A synthetic campaign: pictures of a board, a filmed run and its campaign.yaml, with the ground truth.

The object's motion comes from :mod:`studies.worlds.reference`, the pictures from
:mod:`studies.worlds.scenes`: neither shares code with the physics that is measured against them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studies.worlds.reference import Box, planar, towed_box
from studies.worlds.scenes import CeilingCamera, FilmedScene, Motion, ceiling, drive, rectangle
from towval.model import Array, Body, Camera, Floor
from towval.optics.projection import project, to_plane

RESOLUTION_PX = (800, 450)
RATE_HZ = 25
FRAMES = 80
INNER_CORNERS = (7, 5)
SQUARE_M = 0.06
THICKNESS_M = 0.003
_MARGIN = 1.8  # [squares] Of the sheet around the inner corners.

OBJECT_SIZE_M = (0.5, 0.35)
ROVER = Body("rover", 0.40, rectangle(0.75, 0.5))
OBJECT = Body("object", 0.25, rectangle(*OBJECT_SIZE_M))
HINGE, ANCHOR = np.array([-0.42, 0.0]), np.array([0.25, 0.0])
MASS, LOAD, LOAD_AT, LOAD_SIZE = 4.0, 1.5, np.array([-0.15, 0.08]), (0.1, 0.1, 0.0)
REST_LENGTH, STIFFNESS, FRICTION, STICTION_VELOCITY = 0.6, 800.0, 0.35, 2e-3

Luma = NDArray[np.uint8]


def towed_motion(rover: Motion, start: Array, times: Array) -> Array:
    """Poses (n, 3) of the campaign's object behind the rover's motion, at rest at first; friction μ tanh(v / v_s)."""
    mass = MASS + LOAD
    centre = LOAD * LOAD_AT / mass
    own = MASS * (OBJECT_SIZE_M[0] ** 2 + OBJECT_SIZE_M[1] ** 2) / 12 + MASS * centre @ centre
    load = LOAD * (LOAD_SIZE[0] ** 2 + LOAD_SIZE[1] ** 2) / 12 + LOAD * (LOAD_AT - centre) @ (LOAD_AT - centre)
    box = Box(
        OBJECT_SIZE_M, mass, (centre[0], centre[1]), float(own + load), tuple(ANCHOR), FRICTION, STICTION_VELOCITY
    )

    def hinge(time_s: float) -> Array:
        pose = rover(time_s)
        return pose[:2] + planar(pose[2], HINGE)

    return towed_box(box, hinge, (REST_LENGTH, STIFFNESS), start, times, tolerance=1e-7)


def board_picture(
    camera: Camera, floor: Floor, T_floor_board: Array, rng: np.random.Generator, behind: Array | float = 120.0
) -> Luma:
    """Grey picture of the board with its face at z = 0 of ``T_floor_board``, before what is ``behind`` it.

    Three samples a pixel and axis, each at a random place of its cell: on a regular grid an edge along the pixels' rows
    would move by thirds of a pixel, which a calibration rightly takes for a board that does not fit.
    """
    width, height = RESOLUTION_PX
    sub = (np.arange(3) - 1) / 3
    board = Floor(floor.T_camera_floor @ T_floor_board)
    picture = np.broadcast_to(np.asarray(behind, dtype=np.float64), (height, width)).copy()
    part = _around_sheet(camera, board)
    around, total = picture[part], np.zeros_like(picture[part])
    for du in sub:
        for dv in sub:
            grid = np.stack(np.meshgrid(np.arange(width) + du, np.arange(height) + dv), axis=-1)[part]
            grid += rng.uniform(-1 / 6, 1 / 6, (height, width, 2))[part]
            xy = to_plane(camera, board, grid, 0.0) / SQUARE_M
            columns, rows = INNER_CORNERS
            dark = (np.floor(xy).sum(axis=-1) % 2 == 0) & (xy > -1).all(axis=-1) & (xy < (columns, rows)).all(axis=-1)
            sheet = (xy > -_MARGIN).all(axis=-1) & (xy < (columns + _MARGIN - 1, rows + _MARGIN - 1)).all(axis=-1)
            total += np.where(dark, 30.0, np.where(sheet, 220.0, around))
    picture[part] = total / 9
    picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0, 2, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _around_sheet(camera: Camera, board: Floor) -> tuple[slice, slice]:
    """Rows and columns of a picture in which the sheet of a board may show: all else is as costly and shows none."""
    far = np.array(INNER_CORNERS) + _MARGIN - 1
    along = np.linspace(0.0, 1.0, 50)[:, None] * (far + _MARGIN) - _MARGIN
    x, y = along.T
    edges = [(x, np.full(50, -_MARGIN)), (x, np.full(50, far[1])), (np.full(50, -_MARGIN), y), (np.full(50, far[0]), y)]
    places = np.concatenate([np.column_stack([*edge, np.zeros(50)]) for edge in edges]) * SQUARE_M
    pixels = project(camera, board, places)
    low, high = np.floor(pixels.min(axis=0)).astype(int) - 2, np.ceil(pixels.max(axis=0)).astype(int) + 3
    return slice(max(low[1], 0), max(high[1], 0)), slice(max(low[0], 0), max(high[0], 0))


def _placed(position: Array, rotation: Rotation) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), position
    return T


def _held(rng: np.random.Generator, k: int) -> Array:
    """A board held one to two metres under the camera, all over its view, tilted towards one side after the other."""
    tilt, towards = np.radians(rng.uniform(22, 38)), np.pi / 4 + k * 2.4
    rotation = Rotation.from_rotvec(tilt * np.array([np.cos(towards), np.sin(towards), 0]))
    rotation = rotation * Rotation.from_euler("z", rng.uniform(-0.6, 0.6))
    below = rng.uniform(1.0, 1.9)
    # Half the view at that distance is (400, 225) / 650 of it; the board's centre stays well inside.
    centre = np.array([(k % 4 - 1.5) / 1.5 * 0.36 * below, (k // 4 % 3 - 1) * 0.12 * below, 4.0 - below])
    return _placed(centre - rotation.apply([0.18, 0.12, 0]), rotation)


@dataclass(frozen=True)
class SyntheticCampaign:
    """All that a campaign folder holds, and the ground truth.

    ``document`` is ``campaign.yaml``; ``film`` yields times and pictures of the run ``a`` anew at each call;
    ``pictures`` of the board by file name; ``time_s`` (n,), ``rover`` and ``towed`` (n, 3) the true poses.
    """

    document: dict[str, Any]
    film: Callable[[], Iterator[tuple[float, Luma]]]
    pictures: dict[str, Luma]
    time_s: Array
    rover: Array
    towed: Array


GIVEN: dict[str, Any] = {
    "mass_kg": MASS,
    "load": {"mass_kg": LOAD, "at_m": LOAD_AT.tolist(), "size_m": list(LOAD_SIZE)},
    "tether": {"rest_length_m": REST_LENGTH, "stiffness_N_per_m": STIFFNESS},
    "friction": {
        "kinetic": FRICTION,
        "static": FRICTION,
        "stiction_velocity_m_per_s": 0.005,
        "friction_velocity_m_per_s": 0.05,
    },
}
"""What campaign.yaml says of the object, the tether and the friction."""


def view() -> tuple[Camera, Floor]:
    """The camera that films the campaigns."""
    return ceiling(RESOLUTION_PX, focal_px=650.0, height_m=4.0, tilt_rad=0.05, distortion=(-0.05, 0.01))


def bending_tow(frames: int = FRAMES) -> tuple[Motion, Array]:
    """The rover's motion and the object's poses (frames, 3) behind it: a rest, then a bend."""
    rover = drive((-0.15, 0.05, 0.1), speed=0.25, turn=0.5, rest_s=0.3)
    return rover, towed_motion(rover, np.array([-1.2, 0.0, 0.15]), np.arange(frames) / RATE_HZ)


def random_tow(seed: int, frames: int = FRAMES) -> tuple[Motion, Array]:
    """A rover's motion and the object's poses (frames, 3) behind it: after a rest an arc, the tether slack at first."""
    rng = np.random.default_rng(seed)
    start = (-0.15, rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2))
    rover = drive(start, speed=rng.uniform(0.15, 0.3), turn=rng.uniform(-0.7, 0.7), rest_s=0.3)
    behind = np.array([rng.uniform(-1.4, -1.2), rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2)])
    return rover, towed_motion(rover, behind, np.arange(frames) / RATE_HZ)


def synthetic_campaign(
    rover: Motion,
    towed: Array,
    given: dict[str, Any] | None = None,
    seed: int = 0,
    height_errors: tuple[float, float] = (0.0, 0.0),
) -> SyntheticCampaign:
    """A campaign with one run ``a``: board held and on the floor, rover and towed object.

    Parameters
    ----------
    rover : callable
        Its pose at a time.
    towed : ndarray (n, 3)
        The object's pose in each picture [m, m, rad].
    given : dict, optional
        What campaign.yaml says in place of :data:`GIVEN`.
    seed : int, optional
        Of noise and clicks.
    height_errors : (float, float), optional
        By how much the tops of rover and object are higher than campaign.yaml says [m].
    """
    rng, (camera, floor) = np.random.default_rng(seed), view()
    times = np.arange(len(towed)) / RATE_HZ
    bodies = tuple(
        replace(body, tracked_plane_height_m=body.tracked_plane_height_m + error)
        for body, error in zip((ROVER, OBJECT), height_errors, strict=True)
    )
    scene = FilmedScene(camera, floor, bodies, (rover, lambda t: towed[round(t * RATE_HZ)]), seed=seed, noise=2.0)
    pictures = _pictures(camera, floor, CeilingCamera(scene).ground, rng)
    clicks = {name: np.round(px, 1).tolist() for name, px in scene.clicks(rng).items()}
    corners = np.array([[0, 0, THICKNESS_M], [(INNER_CORNERS[0] - 1) * SQUARE_M, 0, THICKNESS_M]])
    return SyntheticCampaign(
        document=_document(clicks, project(camera, floor, corners), given or GIVEN),
        film=lambda: CeilingCamera(scene).frames(times),
        pictures=pictures,
        time_s=times,
        rover=np.array([rover(t) for t in times]),
        towed=towed,
    )


def _pictures(camera: Camera, floor: Floor, ground: Array, rng: np.random.Generator) -> dict[str, Luma]:
    """Boards held, ``board_*.png``, and lying on the ground of the film, ``floor*.png``, the first at the origin."""
    pictures = {f"board_{k:02d}.png": board_picture(camera, floor, _held(rng, k), rng) for k in range(16)}
    flat = [(0.0, 0.0, 0.0), (-1.3, -0.7, 0.7), (1.0, 0.5, 2.1), (1.1, -0.8, -0.4), (-1.2, 0.6, 1.2), (-0.1, -0.8, 0.2)]
    for k, (x, y, heading) in enumerate(flat):
        T = _placed(np.array([x, y, THICKNESS_M]), Rotation.from_euler("z", heading))
        pictures["floor.png" if k == 0 else f"floor_{k}.png"] = board_picture(camera, floor, T, rng, ground)
    return pictures


def _document(clicks: dict[str, list[list[float]]], corners_px: Array, given: dict[str, Any]) -> dict[str, Any]:
    def body(thing: Body) -> dict[str, Any]:
        return {"tracked_plane_height_m": thing.tracked_plane_height_m, "top_corners_m": thing.top_corners_m.tolist()}

    return {
        "camera": {
            "resolution_px": list(RESOLUTION_PX),
            "fps": RATE_HZ,
            "calibration_images": "calibration/board_*.png",
            "board": {"type": "chessboard", "inner_corners": list(INNER_CORNERS), "square_m": SQUARE_M},
        },
        "floor": {
            "image": "calibration/floor.png",
            "more_images": "calibration/floor_*.png",
            "board_thickness_m": THICKNESS_M,
            "origin_corner_px": [round(float(c), 1) for c in corners_px[0] + 0.8],
            "x_axis_end_corner_px": [round(float(c), 1) for c in corners_px[1] - 0.6],
        },
        "rover": {**body(ROVER), "tether_hinge_m": HINGE.tolist()},
        "object": {
            **body(OBJECT),
            "footprint_m": OBJECT.top_corners_m.tolist(),
            "mass_kg": given["mass_kg"],
            "load": given["load"],
            "tether_anchor_m": ANCHOR.tolist(),
        },
        "tether": given["tether"],
        "friction": given["friction"],
        "runs": {"a": {"video": "a.mp4", "first_frame_clicks_px": clicks}},
    }
