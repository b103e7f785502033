"""A campaign that MuJoCo renders, as a lab hands it in, with the ground truth.

Runs of :mod:`studies.worlds.verdict_worlds` before the camera of :mod:`studies.worlds.engine_lab`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studies.worlds.engine_lab import (
    INNER_CORNERS,
    OBJECT_SIZE_M,
    RESOLUTION_PX,
    ROVER_SIZE_M,
    SQUARE_M,
    THICKNESS_M,
    EngineLab,
    Look,
    rendering_engine,
)
from studies.worlds.engine_textures import Picture
from studies.worlds.film import write_video
from studies.worlds.lab_tows import rectangle
from studies.worlds.verdict_worlds import RATE_HZ, WORLDS, WorldRun, feet, number_of, world_run
from towval.io.atomic import write_text
from towval.model import Array
from towval.model.geometry import lifted, rotation, transform

_HELD = 14
_CORNER_CLICK_PX = 1.0
_TETHER_Z_M = 0.12  # Where the world is a plane.


def write_engine_campaign(folder: Path, world: str, seed: int, look: Look | None = None) -> pd.DataFrame:
    """Film a run of a world and write all that a lab hands in: ``campaign.yaml``, ``calibration/``, ``a.mp4``.

    Beside them stands ``a_truth.csv``, as campaigns of known truth have it.

    Parameters
    ----------
    folder : Path
        Made, with its parents.
    world : str
        One of :data:`studies.worlds.verdict_worlds.WORLDS`, without a region; its tether does not stiffen.
    seed : int
        Of the run, of the laboratory and of all noise.
    look : Look, optional
        How the laboratory looks, at random by default.

    Returns
    -------
    DataFrame
        That truth in the floor frame: ``t_s``, ``rover_x_m``, ``rover_y_m``, ``rover_heading_rad`` and the object's.
    """
    rendering_engine()  # Before a run in the engine's own world imports it.
    rng = np.random.default_rng([seed, 77])
    run = world_run(WORLDS[world], number_of(world, seed))
    still = {"stiffening": np.array(0.0)}
    run = replace(run, true=run.true | still, stated=run.stated | still)
    poses = {"rover": np.array([run.drive(t) for t in run.time_s]), "object": run.truth()}
    seen = np.vstack([transform(pose, outline) for name, outline in _outlines().items() for pose in poses[name][::5]])
    lab = EngineLab(rng, look or Look.of(rng), (seen.min(axis=0) + seen.max(axis=0)) / 2, _longest(seen))
    (folder / "calibration").mkdir(parents=True)
    for i, picture in enumerate(_held_boards(lab)):
        _write_picture(folder / "calibration" / f"board_{i:02d}.jpg", picture)
    corners: list[Array] = []
    for i, (ends, picture) in enumerate(_lying_boards(lab)):
        _write_picture(folder / "calibration" / (f"floor_{i}.jpg" if i else "floor.jpg"), picture)
        corners.append(ends)
    origin, end = corners[0]
    write_video(folder / "a.mp4", _film(lab, run, poses), rate=RATE_HZ, crf=str(rng.integers(19, 28)))
    heights = {"rover": ROVER_SIZE_M[2], "object": OBJECT_SIZE_M[2]}
    clicks = {
        name: lab.project(lifted(transform(poses[name][0], outline), heights[name]))
        for name, outline in _outlines().items()
    }
    clicks |= {"origin": lab.project(origin), "end": lab.project(end)}
    clicks = {name: px + rng.normal(0, _CORNER_CLICK_PX, px.shape) for name, px in clicks.items()}
    x, y = end[:2] - origin[:2]
    turn = float(np.arctan2(y, x))
    write_text(folder / "campaign.yaml", yaml.safe_dump(_document(run, clicks, turn), sort_keys=False))
    truth = pd.DataFrame({"t_s": run.time_s})
    for name, pose in poses.items():
        truth[[f"{name}_x_m", f"{name}_y_m"]] = (pose[:, :2] - origin[:2]) @ rotation(turn)
        truth[f"{name}_heading_rad"] = pose[:, 2] - turn
    truth.to_csv(folder / "a_truth.csv", index=False)
    return truth


def _outlines() -> dict[str, Array]:
    return {"rover": rectangle(*ROVER_SIZE_M[:2]), "object": rectangle(*OBJECT_SIZE_M[:2])}


def _longest(points: Array) -> float:
    """Direction [rad] in which points (n, 2) extend farthest."""
    x, y = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return float(np.arctan2(y, x))


def _held_boards(lab: EngineLab) -> Iterator[Picture]:
    """Boards in the hand, whole in the picture, tilted by 10° to 40°."""
    rng, size = lab.rng, np.array(RESOLUTION_PX)
    sheet = SQUARE_M * (np.array(INNER_CORNERS) + 2.4) / 2
    around = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)]) * [*sheet, 0.0]
    lab.hide("rover", "object", "tether")
    taken = 0
    while taken < _HELD:
        u, v, far, tilt, towards, turn = rng.uniform(size=6)
        pixel = size * [0.18 + 0.64 * u, 0.2 + 0.6 * v]
        middle = lab.place + lab.ray(pixel) * (0.9 + 0.9 * far)
        axis = np.array([np.cos(2 * np.pi * towards), np.sin(2 * np.pi * towards), 0.0])
        turned = Rotation.from_matrix(lab.axes) * Rotation.from_rotvec(np.radians(10 + 30 * tilt) * axis)
        turned = turned * Rotation.from_euler("z", 1.4 * turn - 0.7)
        corners = lab.project(turned.apply(around) + middle)
        if corners.min() > 8 and (corners < size - 8).all():
            lab.put("board", middle, turned)
            yield lab.picture()
            taken += 1


def _lying_boards(lab: EngineLab) -> Iterator[tuple[Array, Picture]]:
    """Boards on the floor, one near the middle and the others towards the corners, with the places (2, 3) [m] of the
    ends of their first row of inner corners."""
    rng = lab.rng
    lab.hide("rover", "object", "tether")
    middle = lab.place[:2] - lab.axes[:2, 2] / lab.axes[2, 2] * lab.place[2]
    aside = [(0.0, 0.0), (-0.8, -0.35), (0.8, 0.3), (-0.6, 0.4), (0.7, -0.4)]
    row = (np.array(INNER_CORNERS) - 1) * SQUARE_M / 2 * np.array([[-1, -1], [1, -1]])
    for along, across in aside:
        at = middle + lab.axes[:2, 0] * along + lab.axes[:2, 1] * across + rng.uniform(-0.1, 0.1, 2)
        turn = rng.uniform(-3, 3)
        lab.put("board", np.array([*at, THICKNESS_M]), Rotation.from_euler("z", turn))
        yield lifted(transform(np.array([*at, turn]), row), THICKNESS_M), lab.picture()
    lab.hide("board")


def _film(lab: EngineLab, run: WorldRun, poses: dict[str, Array]) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Times [s] and luma of the frames."""
    ends = {"hinge": ("rover", "hinge_height"), "anchor": ("object", "anchor_height")}
    for i in range(len(run.time_s)):
        for name, pose in poses.items():
            lab.put(name, np.array([*pose[i, :2], 0.0]), Rotation.from_euler("z", pose[i, 2]))
        hinge, anchor = (
            np.array([*transform(poses[body][i], run.true[end]), float(run.true[height]) or _TETHER_Z_M])
            for end, (body, height) in ends.items()
        )
        lab.stretch_tether(hinge, anchor)
        yield float(run.time_s[i]), np.asarray(cv2.cvtColor(lab.picture(), cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _write_picture(path: Path, picture: Picture) -> None:
    cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 93])


def _document(run: WorldRun, clicks: dict[str, Array], turn: float) -> dict[str, Any]:
    """What campaign.yaml says: the stated numbers, and the clicks (n, 2) [px]; ``turn`` [rad] is the floor frame's."""
    n = {name: np.round(value, 6).tolist() for name, value in run.stated.items()}
    px = {name: np.round(value, 1).tolist() for name, value in clicks.items()}
    outlines, world = _outlines(), run.world
    ends = {"tether_hinge_height_m": n["hinge_height"]}, {"tether_anchor_height_m": n["anchor_height"],
            "centre_of_mass_height_m": n["centre_height"]}  # fmt: skip
    rover = {"tracked_plane_height_m": ROVER_SIZE_M[2], "top_corners_m": outlines["rover"].tolist(),
             "tether_hinge_m": n["hinge"]}  # fmt: skip
    towed = {
        "tracked_plane_height_m": OBJECT_SIZE_M[2], "top_corners_m": outlines["object"].tolist(),
        "footprint_m": [ring.tolist() for ring in feet()] if world.feet else outlines["object"].tolist(),
        "mass_kg": n["mass"], "load": {"mass_kg": n["load"], "at_m": n["load_at"], "size_m": [0.1, 0.1, 0.08]},
        "tether_anchor_m": n["anchor"],
    }  # fmt: skip
    floor = {
        "image": "calibration/floor.jpg", "more_images": "calibration/floor_*.jpg", "board_thickness_m": THICKNESS_M,
        "origin_corner_px": px["origin"][0], "x_axis_end_corner_px": px["end"][0],
    }  # fmt: skip
    friction = {
        "kinetic": n["kinetic"], "static": n["static"], "friction_velocity_m_per_s": n["friction_velocity"],
        "stiction_velocity_m_per_s": round(0.1 * n["friction_velocity"], 6),
    }  # fmt: skip
    tether = {"rest_length_m": n["rest"], "stiffness_N_per_m": n["stiffness"]}
    if world.heights:
        rover, towed = rover | ends[0], towed | ends[1]
    if world.floor:
        rise = 1e3 * run.stated["slope"] @ rotation(turn)
        floor |= {"slope_mm_per_m": rise.round(3).tolist(), "slope_std_mm_per_m": 0.3}
        friction["across_over_along"] = n["across"]
    if world.tether:
        tether["damping_Ns_per_m"] = n["damping"]
    camera = {
        "resolution_px": list(RESOLUTION_PX), "fps": RATE_HZ, "calibration_images": "calibration/board_*.jpg",
        "board": {"type": "chessboard", "inner_corners": list(INNER_CORNERS), "square_m": SQUARE_M},
    }  # fmt: skip
    first = {name: px[name] for name in outlines}
    runs = {"a": {"video": "a.mp4", "first_frame_clicks_px": first}}
    return {"gravity_m_per_s2": 9.81, "camera": camera, "floor": floor, "rover": rover, "object": towed,
            "tether": tether, "friction": friction, "runs": runs}  # fmt: skip
