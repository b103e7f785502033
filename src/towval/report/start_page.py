"""The page on which the starts of runs are put right: one file that opens offline and saves campaign.yaml."""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.io.atomic import write_text
from towval.model import Array, Body, Calibration, TowingScene
from towval.report.preview import floor_grid

_QUALITY = 88


@dataclass(frozen=True)
class StartOfRun:
    """The first frame of a run and where its bodies are: poses (3,) [m, m, rad] by name; those not found are missing.

    ``doubts`` says what is not certain, by the body's name.
    """

    luma: NDArray[np.uint8]
    poses: Mapping[str, Array]
    doubts: Mapping[str, str]


def write_start_page(
    path: Path,
    name: str,
    text: Sequence[str | tuple[str, str]],
    calibration: Calibration,
    scene: TowingScene,
    bodies: Mapping[str, Body],
    longest_m: float,
    runs: Mapping[str, StartOfRun],
) -> None:
    """Write the page.

    Parameters
    ----------
    name : str
        Name of the campaign.
    text : sequence
        campaign.yaml cut where clicks belong, from :func:`towval.io.campaign_text.text_without_clicks`.
    bodies : mapping
        Rover and object by name.
    longest_m : float
        How far apart hinge and anchor can be [m].
    """
    camera, hold = calibration.camera, {"rover": scene.hinge, "object": scene.anchor}
    data = {
        "name": name,
        "text": [part if isinstance(part, str) else {"run": part[0], "before": part[1]} for part in text],
        "camera": {
            "matrix": camera.matrix.tolist(),
            "distortion": camera.distortion.tolist(),
            "T_camera_floor": calibration.floor.T_camera_floor.tolist(),
            "resolution_px": list(camera.resolution_px),
        },
        "grid": [row.tolist() for row in floor_grid(calibration)],
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
            "height_m": 0.5 * (scene.hinge_height + scene.anchor_height),
        },
        "runs": {
            name: {
                "frame": _picture(start.luma),
                "poses": {body: pose.tolist() for body, pose in start.poses.items()},
                "told": {body: [text] for body, text in start.doubts.items()},
            }
            for name, start in runs.items()
        },
    }
    # Within a script element only "<" could end it.
    written = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    page = _asset("start.html")
    for mark, content in (("CSS", _asset("start.css")), ("SCRIPT", _asset("start.js")), ("DATA", written)):
        page = page.replace(f"/*{mark}*/", content)
    write_text(path, page)


def _picture(luma: NDArray[np.uint8]) -> str:
    jpeg = cv2.imencode(".jpg", luma, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    return "data:image/jpeg;base64," + base64.b64encode(jpeg.tobytes()).decode("ascii")


def _asset(name: str) -> str:
    return files("towval.report").joinpath("templates", name).read_text(encoding="utf-8")
