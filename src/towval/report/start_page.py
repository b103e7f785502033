"""The page for correcting the start poses of runs: one file that opens offline and saves campaign.yaml."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.io.atomic import write_text
from towval.io.campaign_text import FloorCorner, RunClicks
from towval.model import Array, Body, Calibration, Camera, TowingScene
from towval.optics.projection import project_kernel, undistorted_kernel
from towval.report.inline import data_uri, script_json
from towval.report.preview import floor_grid
from towval.report.templating import template_asset

START_MARK = "<title>Starts of the runs</title>"
"""What a page that may be replaced says near its beginning."""

_QUALITY = 88
_OUTSIDE = 51  # Grey of the page around the picture.
_LARGEST = 1.5
"""Largest size of the picture without distortion over that of the camera; what a wide lens sees beyond is left out."""


@dataclass(frozen=True)
class StartOfRun:
    """The first frame of a run and the poses (3,) [m, m, rad] of its bodies by name; those not found are missing.

    ``calibration`` is that of the first frame; ``doubts``: what is uncertain, by the body's name.
    """

    luma: NDArray[np.uint8]
    calibration: Calibration
    poses: Mapping[str, Array]
    doubts: Mapping[str, str]


@dataclass(frozen=True)
class FloorBoard:
    """The board that defines the floor frame: the picture around it, and its outer corners (4, 2) [px] in cyclic order.

    ``offset_px`` is where the picture begins in that of the camera; ``origin`` and ``end`` are the corners at the
    origin and at the end of the x axis; ``depends``: keys of campaign.yaml with values in the axes of the floor.
    """

    luma: NDArray[np.uint8]
    offset_px: tuple[int, int]
    corners_px: Array
    origin: int
    end: int
    depends: Sequence[str]


def write_start_page(
    path: Path,
    name: str,
    text: Sequence[str | RunClicks | FloorCorner],
    scene: TowingScene,
    bodies: Mapping[str, Body],
    longest_m: float,
    runs: Mapping[str, StartOfRun],
    floor: FloorBoard | None,
) -> None:
    """Write the page of the campaign ``name``.

    ``text`` is campaign.yaml cut where the page writes (:func:`towval.io.campaign_text.text_in_parts`), ``longest_m``
    the largest distance of hinge and anchor [m]; ``floor`` is None where no board defines the floor frame.
    """
    hold = {"rover": scene.hinge, "object": scene.anchor}
    data = {
        "name": name,
        "text": [part if isinstance(part, str) else part._asdict() for part in text],
        "bodies": {
            name: {
                "height": body.tracked_plane_height_m,
                "corners": body.top_corners_m.tolist(),
                "hold": hold[name].tolist(),
            }
            for name, body in bodies.items()
        },
        "tether": {
            "rest_length_m": scene.tether.rest_length,
            "longest_m": longest_m,
            "heights_m": [scene.hinge_height, scene.anchor_height],
        },
        "floor": None if floor is None else _floor(floor),
        "runs": {name: _run(start) for name, start in runs.items()},
    }
    page = str(template_asset("start.html"))
    scripts = ("SCRIPT", template_asset("start.js")), ("FLOOR", template_asset("start_floor.js"))
    for mark, content in (("CSS", template_asset("start.css")), *scripts, ("DATA", script_json(data))):
        page = page.replace(f"/*{mark}*/", content)
    write_text(path, page, own=START_MARK)


def _run(start: StartOfRun) -> dict[str, object]:
    """The start of a run, with the camera that filmed it: it may have moved, or zoomed, from one run to the next."""
    camera, floor = start.calibration.camera, start.calibration.floor
    shown, size = without_distortion(camera)
    across, down = cv2.split(_filmed(camera, shown, size).astype(np.float32))
    return {
        "camera": {
            "matrix": camera.matrix.tolist(),
            "lens": camera.lens.tolist(),
            "T_camera_floor": floor.T_camera_floor.tolist(),
            "resolution_px": list(camera.resolution_px),
            "shown": {"matrix": shown.tolist(), "size_px": list(size)},
        },
        "grid": [row.tolist() for row in floor_grid(start.calibration)],
        "frame": _picture(cv2.remap(start.luma, across, down, cv2.INTER_LINEAR, borderValue=_OUTSIDE)),
        "poses": {body: pose.tolist() for body, pose in start.poses.items()},
        "told": {body: [text] for body, text in start.doubts.items()},
    }


def without_distortion(camera: Camera) -> tuple[Array, tuple[int, int]]:
    """A pinhole camera (3, 3) [px] and the size of its picture, which shows the view of ``camera`` without distortion.

    The focal lengths are kept, so that the middle of the picture keeps its sharpness; straight lines of the floor and
    straight edges of a top are straight in it.
    """
    width, height = camera.resolution_px
    u, v = np.arange(width, dtype=float), np.arange(height, dtype=float)
    sides = [(u, 0 * u), (u, 0 * u + height - 1), (0 * v, v), (0 * v + width - 1, v)]
    border = np.concatenate([np.column_stack(side) for side in sides])
    rays = undistorted_kernel(border, camera.matrix, camera.lens)
    border = rays * np.diag(camera.matrix)[:2] + camera.matrix[:2, 2]
    spare = 0.5 * (_LARGEST - 1) * np.array([width, height])
    low = np.floor(np.maximum(np.nanmin(border, axis=0), -spare))
    high = np.ceil(np.minimum(np.nanmax(border, axis=0), spare + np.array([width - 1, height - 1])))
    shown = camera.matrix.copy()
    shown[:2, 2] -= low
    across, down = (high - low + 1).astype(int)
    return shown, (int(across), int(down))


def _filmed(camera: Camera, shown: Array, size: tuple[int, int]) -> Array:
    """Pixels (height, width, 2) of the camera that the pixels of a pinhole camera ``shown`` (3, 3) show."""
    across, down = size
    grid = np.stack(np.meshgrid(np.arange(across), np.arange(down)), axis=-1).reshape(-1, 2)
    rays = np.column_stack([(grid - shown[:2, 2]) / np.diag(shown)[:2], np.ones(len(grid))])
    filmed: Array = project_kernel(rays, np.eye(4), camera.matrix, camera.lens)
    return filmed.reshape(down, across, 2)


def _floor(board: FloorBoard) -> dict[str, object]:
    return {
        "picture": _picture(board.luma),
        "width": board.luma.shape[1],
        "offset": list(board.offset_px),
        "corners": board.corners_px.tolist(),
        "origin": board.origin,
        "end": board.end,
        "depends": list(board.depends),
    }


def _picture(luma: cv2.typing.MatLike) -> str:
    jpeg = cv2.imencode(".jpg", luma, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    return data_uri("image/jpeg", jpeg.tobytes())
