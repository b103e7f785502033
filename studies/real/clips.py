"""Clips that nobody here made, tracked: how far the poses are from fits of colour, and how often a body was found.

They carry no calibration, so a camera straight above is assumed, and one pixel is called a millimetre.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

from towval.io.video import Video
from towval.model import Array, Body, Calibration, Camera, Floor, Track
from towval.model.geometry import transform, wrapped
from towval.optics.projection import project, to_plane
from towval.tracking.track import TrackSettings, track

PLATES = {
    "simple_test": [(474.5, 67.3), (538.3, 70.5), (534.0, 149.3), (469.0, 144.0)],
    "robot_parcours_1": [(493.5, 358.8), (552.0, 329.3), (589.5, 400.0), (535.5, 431.8)],
    "roated_test": [(508.5, 48.0), (570.8, 43.0), (578.5, 120.0), (514.0, 123.8)],
}
"""Corners of the robot's white plate in the first picture, by eye, from the arrow's tail on the left around it [px]."""

WRITTEN_AGAIN = 3
"""Frames at the end of each of these clips that are the one before, written again."""

PUCKS = ("target", "striker")


def from_above(width: int, height: int) -> Calibration:
    """A camera 1 m above the floor with a focal length of 1000 px."""
    matrix = np.array([[1000.0, 0, width / 2], [0, 1000.0, height / 2], [0, 0, 1]])
    camera = Camera((width, height), matrix, np.zeros(8), "none")
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[2, 3] = 1.0
    return Calibration(camera, Floor(T), np.zeros((18, 18)), 0.0)


def pixels_of(calibration: Calibration, poses: Array) -> Array:
    """Pixels (n, 2) of the origins of poses (n, 3)."""
    points = transform(poses, np.zeros(2))
    return project(calibration.camera, calibration.floor, np.column_stack([points, np.zeros(len(points))]))


def outline_from(calibration: Calibration, clicks: Array) -> Array:
    """The clicked outline about its middle, turned by nothing."""
    corners = to_plane(calibration.camera, calibration.floor, clicks, 0.0)
    return corners - corners.mean(axis=0)


@dataclass(frozen=True)
class PuckErrors:
    """A disc against its colour blob: constant ``offset_px`` (2,), the rest's RMS by coordinate and largest size [px].

    The blobs lie one pixel right of and below the centroid of the filled disc in the luma, as if they counted pixels
    from one, where ours count from zero. A disc keeps its radius: the RMS leaves out blobs whose radius is off by half
    a pixel, part of a lamp's reflection or of the other disc. ``axis_deg`` is the median error of the axis through the
    dots, which has no direction and whose blob fit scatters by some degrees; ``tracked`` is the share of frames.
    """

    offset_px: Array
    rms_px: float
    most_px: float
    axis_deg: float
    tracked: float


def puck_errors(folder: Path, first: int, method: str = "plane") -> dict[str, PuckErrors]:
    """Two discs of 17 px that look alike and collide, tracked from a frame on, against their colour blobs."""
    calibration = from_above(320, 240)
    blobs = {name: _blobs(folder, name, first) for name in PUCKS}
    bodies, clicks = [], {}
    angle = np.arange(16) * np.pi / 8
    for name, blob in blobs.items():
        ring = blob["radius_px"][0] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        clicks[name] = np.array([blob["cx"][0], blob["cy"][0]]) + ring * (1, -1)
        bodies.append(Body(name, 0.0, ring / 1000))
    last = max(int(blob["frame"][-1]) for blob in blobs.values())
    video = enumerate(Video(folder / "sliding_pucks" / "Rotation.MP4"))
    frames = (frame for i, frame in video if first <= i <= last)
    tracks = track(frames, calibration, bodies, clicks, TrackSettings(method=method))
    found = {}
    for name, blob in blobs.items():
        index = (blob["frame"] - first).astype(int)
        pose, seen = tracks[name].pose[index], tracks[name].seen[index]
        apart = pixels_of(calibration, pose) - np.column_stack([blob["cx"], blob["cy"]])
        offset = np.median(apart[seen], axis=0)
        turned = -(blob["dot_axis_rad"] - blob["dot_axis_rad"][0])
        axis = np.abs(wrapped(2 * (pose[:, 2] - turned))) / 2
        most = float(np.linalg.norm(apart - offset, axis=1)[seen].max())
        whole = seen & (np.abs(blob["radius_px"] - np.median(blob["radius_px"])) < 0.5)
        rms = float(np.sqrt(np.mean(np.square(apart - offset)[whole])))
        found[name] = PuckErrors(offset, rms, most, float(np.rad2deg(np.nanmedian(axis[seen]))), float(seen.mean()))
    return found


def _blobs(folder: Path, name: str, first: int) -> Any:
    blobs = np.genfromtxt(folder / "sliding_pucks" / f"blob_rot_{name}.csv", delimiter=",", names=True)
    # Where the fit found no radius (the lamp's reflection, or two blobs in one) its centre is off, too.
    return blobs[(blobs["frame"] >= first) & np.isfinite(blobs["radius_px"])]


def robot_distances(folder: Path, clip: str) -> tuple[Track, Array]:
    """The track of a robot that jumps 23 to 46 px a frame, and its distances from the box around its arrow [px]."""
    path, calibration = folder / "rover_overhead_4fps" / f"{clip}.avi", from_above(720, 528)
    clicks = np.array(PLATES[clip])
    body = Body("rover", 0.0, outline_from(calibration, clicks))
    found = track(Video(path), calibration, [body], {"rover": clicks})["rover"]
    return found, np.linalg.norm(pixels_of(calibration, found.pose) - _arrows(path), axis=1)[found.seen]


def _arrows(path: Path) -> Array:
    """Middle (n, 2) of the box around the red arrow of each picture [px].

    The authors' dots cut the arrow into pieces, so its centroid wanders over the plate; its tips stay.
    """
    middles = []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            blue, green, red = np.moveaxis(frame.to_ndarray(format="bgr24").astype(int), -1, 0)
            mask = ((red > 110) & (red > 1.6 * green) & (red > 1.6 * blue)).astype(np.uint8)
            _, labels, statistics, centres = cv2.connectedComponentsWithStats(mask)
            area = statistics[:, cv2.CC_STAT_AREA]
            largest = centres[1 + np.argmax(area[1:])]
            near = (np.linalg.norm(centres - largest, axis=1) < 60) & (area > 15)
            near[0] = False
            rows, columns = np.nonzero(np.isin(labels, np.flatnonzero(near)))
            middles.append(cv2.minAreaRect(np.column_stack([columns, rows]).astype(np.float32))[0])
    return np.array(middles)
