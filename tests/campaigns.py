"""A synthetic campaign: pictures of a board, a filmed run and its campaign.yaml, with the truth beside.

The object's motion is computed here by summing friction over cells with SciPy's Radau, the pictures by :mod:`scenes`:
neither shares code with the physics under test.
"""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import yaml
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from scenes import CeilingCamera, Scene, ceiling, drive, rectangle, write_video
from towval.types import Body, Camera, Floor
from towval.vision.camera import project, to_plane

RESOLUTION_PX = (800, 450)
RATE_HZ = 25
FRAMES = 80
INNER_CORNERS = (7, 5)
SQUARE_M = 0.06
THICKNESS_M = 0.003

ROVER = Body("rover", 0.40, rectangle(0.75, 0.5))
OBJECT = Body("object", 0.25, rectangle(0.5, 0.35))
HINGE, ANCHOR = np.array([-0.42, 0.0]), np.array([0.25, 0.0])
MASS, LOAD, LOAD_AT, LOAD_SIZE = 4.0, 1.5, np.array([-0.15, 0.08]), (0.1, 0.1, 0.0)
REST_LENGTH, STIFFNESS, FRICTION = 0.6, 800.0, 0.35


def _planar(heading, points):
    c, s = np.cos(heading), np.sin(heading)
    return points @ np.array([[c, s], [-s, c]])


def towed_motion(rover, start, times):
    """Poses (n, 3) of the object behind the rover's motion: 24 × 16 cells with linear pressure, μ tanh(v / v_s)."""
    x, y = np.meshgrid((np.arange(24) + 0.5) / 24 * 0.5 - 0.25, (np.arange(16) + 0.5) / 16 * 0.35 - 0.175)
    cells = np.column_stack([x.ravel(), y.ravel()])
    mass = MASS + LOAD
    centre = LOAD * LOAD_AT / mass
    moments = np.array([[len(cells), 0, 0], [0, (cells[:, 0] ** 2).sum(), 0], [0, 0, (cells[:, 1] ** 2).sum()]])
    plane = np.linalg.solve(moments, mass * 9.81 * np.array([1, *centre]))
    force = plane[0] + cells @ plane[1:]
    assert force.min() > 0
    own = MASS * (0.5**2 + 0.35**2) / 12 + MASS * centre @ centre
    inertia = own + LOAD * (0.01 + 0.01) / 12 + LOAD * (LOAD_AT - centre) @ (LOAD_AT - centre)

    def rate(t, state):
        position, heading, velocity, spin = state[:2], state[2], state[3:5], state[5]
        pose = rover(t)
        hinge = pose[:2] + _planar(pose[2], HINGE)
        arms = _planar(heading, cells - centre)
        pull_arm = _planar(heading, ANCHOR - centre)
        span = hinge - position - pull_arm
        length = np.linalg.norm(span)
        pull = max(0.0, STIFFNESS * (length - REST_LENGTH)) * span / length
        sliding = velocity + spin * np.column_stack([-arms[:, 1], arms[:, 0]])
        speed = np.linalg.norm(sliding, axis=1) + 1e-12
        drag = -(FRICTION * force * np.tanh(speed / 2e-3) / speed)[:, None] * sliding
        torque = (arms[:, 0] * drag[:, 1] - arms[:, 1] * drag[:, 0]).sum()
        torque += pull_arm[0] * pull[1] - pull_arm[1] * pull[0]
        return np.concatenate([velocity, [spin], (drag.sum(axis=0) + pull) / mass, [torque / inertia]])

    at_centre = np.asarray(start[:2]) + _planar(start[2], centre)
    solution = solve_ivp(
        rate,
        (times[0], times[-1]),
        [*at_centre, start[2], 0, 0, 0],
        "Radau",
        times,
        rtol=1e-7,
        atol=1e-9,
        max_step=0.02,
    )
    assert solution.success
    origin = np.array([p - _planar(h, centre) for p, h in zip(solution.y[:2].T, solution.y[2], strict=True)])
    return np.column_stack([origin, solution.y[2]])


def board_picture(camera, floor, T_floor_board, rng):
    """Grey picture of the board with its face at z = 0 of ``T_floor_board``.

    Three samples a pixel and axis, each at a random place of its cell: on a regular grid an edge along the pixels' rows
    would move by thirds of a pixel, which a calibration rightly takes for a board that does not fit.
    """
    width, height = RESOLUTION_PX
    sub = (np.arange(3) - 1) / 3
    T_camera_board = floor.T_camera_floor @ T_floor_board
    board = type(floor)(T_camera_board)
    total = np.zeros((height, width))
    for du in sub:
        for dv in sub:
            grid = np.stack(np.meshgrid(np.arange(width) + du, np.arange(height) + dv), axis=-1)
            grid += rng.uniform(-1 / 6, 1 / 6, grid.shape)
            xy = to_plane(camera, board, grid, 0.0) / SQUARE_M
            columns, rows = INNER_CORNERS
            dark = (np.floor(xy).sum(axis=-1) % 2 == 0) & (xy > -1).all(axis=-1) & (xy < (columns, rows)).all(axis=-1)
            sheet = (xy > -1.8).all(axis=-1) & (xy < (columns + 0.8, rows + 0.8)).all(axis=-1)
            total += np.where(dark, 30.0, np.where(sheet, 220.0, 120.0))
    picture = cv2.GaussianBlur(total / 9, (0, 0), 0.6) + rng.normal(0, 2, total.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _placed(position, rotation):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), position
    return T


def _held(rng, k):
    """A board held one to two metres under the camera, all over its view, tilted towards one side after the other."""
    tilt, towards = np.radians(rng.uniform(22, 38)), np.pi / 4 + k * 2.4
    rotation = Rotation.from_rotvec(tilt * np.array([np.cos(towards), np.sin(towards), 0]))
    rotation = rotation * Rotation.from_euler("z", rng.uniform(-0.6, 0.6))
    below = rng.uniform(1.0, 1.9)
    # Half the view at that distance is (400, 225) / 650 of it; the board's centre stays well inside.
    centre = np.array([(k % 4 - 1.5) / 1.5 * 0.36 * below, (k // 4 % 3 - 1) * 0.12 * below, 4.0 - below])
    return _placed(centre - rotation.apply([0.18, 0.12, 0]), rotation)


GIVEN = {
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


def write_campaign(folder: Path, seed: int = 0, frames: int = FRAMES) -> dict[str, np.ndarray]:
    """Write a campaign with one run ``a``; returns ``time_s`` (n,), true ``rover`` and ``object`` poses (n, 3)."""
    times = np.arange(frames) / RATE_HZ
    rover = drive((-0.15, 0.05, 0.1), speed=0.25, turn=0.5, rest_s=0.3)
    towed = towed_motion(rover, np.array([-1.2, 0.0, 0.15]), times)
    film_campaign(folder, rover, towed, GIVEN, seed)
    return {"time_s": times, "rover": np.array([rover(t) for t in times]), "object": towed}


def view() -> tuple[Camera, Floor]:
    """The camera that films the campaigns."""
    return ceiling(RESOLUTION_PX, focal_px=650.0, height_m=4.0, tilt_rad=0.05, distortion=(-0.05, 0.01))


def film_campaign(folder: Path, rover, towed, given, seed: int = 0, height_errors=(0.0, 0.0)) -> None:
    """Film a rover (pose of time) and an object (pose a frame), and write all that a lab hands in.

    ``given`` is shaped like :data:`GIVEN`; by ``height_errors`` the tops are higher than campaign.yaml says.
    """
    rng, (camera, floor) = np.random.default_rng(seed), view()
    times = np.arange(len(towed)) / RATE_HZ
    bodies = tuple(
        replace(body, tracked_plane_height_m=body.tracked_plane_height_m + error)
        for body, error in zip((ROVER, OBJECT), height_errors, strict=True)
    )
    scene = Scene(camera, floor, bodies, (rover, lambda t: towed[round(t * RATE_HZ)]), seed=seed, noise=2.0)
    write_video(folder / "a.mp4", CeilingCamera(scene).frames(times), rate=RATE_HZ, crf="16")
    _write_pictures(folder / "calibration", camera, floor, rng)
    clicks = {name: np.round(px, 1).tolist() for name, px in scene.clicks(rng).items()}
    corners = np.array([[0, 0, THICKNESS_M], [(INNER_CORNERS[0] - 1) * SQUARE_M, 0, THICKNESS_M]])
    _write_yaml(folder, clicks, project(camera, floor, corners), given)


def _write_pictures(folder, camera, floor, rng):
    folder.mkdir(parents=True)
    for k in range(16):
        cv2.imwrite(str(folder / f"board_{k:02d}.png"), board_picture(camera, floor, _held(rng, k), rng))
    flat = [(0.0, 0.0, 0.0), (-1.3, -0.7, 0.7), (1.0, 0.5, 2.1), (1.1, -0.8, -0.4), (-1.2, 0.6, 1.2), (-0.1, -0.8, 0.2)]
    for k, (x, y, heading) in enumerate(flat):
        T = _placed((x, y, THICKNESS_M), Rotation.from_euler("z", heading))
        cv2.imwrite(str(folder / ("floor.png" if k == 0 else f"floor_{k}.png")), board_picture(camera, floor, T, rng))


def _write_yaml(folder, clicks, corners_px, given):
    def body(thing):
        return {"tracked_plane_height_m": thing.tracked_plane_height_m, "top_corners_m": thing.top_corners_m.tolist()}

    document = {
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
    (folder / "campaign.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
