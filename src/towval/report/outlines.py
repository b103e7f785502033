"""What the page draws over the footage: outlines, tether and paths in pixels of each frame.

The page does no camera mathematics: everything is projected here, with the distortion of the lens and the camera's own
motion.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Body, Calibration, Camera, Floor
from towval.model.camera import is_fisheye
from towval.model.geometry import lifted, transform, turned_pixels
from towval.model.run_record import RunRecord, measured_poses, nearest_samples, pose_at
from towval.optics.view_motion import moved_view

MISSING = -(2**15)
"""Coordinate of a point that is not known or far outside the picture."""
_LARGEST = 2**15 - 1
# Edges are drawn as chords at most this far from their picture, which the lens bends.
_BOW_PX = 0.2
_MOST_PIECES = 16


@dataclass(frozen=True)
class FilmLayers:
    """Points of each frame of a film.

    ``counts``: points per frame by layer: outlines of ``rover``, ``measured`` and ``simulated``, the ``tether`` from
    the simulated object to the measured rover, and one point each of the paths ``rover path``, ``measured path`` and
    ``simulated path``; ``places`` (frames, sum of counts, 2): pixels in units of ``unit_px``,
    `MISSING` where there is no point; ``taut`` (frames,): whether the tether pulls.
    """

    counts: dict[str, int]
    unit_px: float
    places: NDArray[np.int16]
    taut: NDArray[np.bool_]

    def pixels(self) -> dict[str, Array]:
        """Pixels (frames, points, 2) by layer, NaN where there is no point."""
        values = np.where(self.places == MISSING, np.nan, self.places * self.unit_px)
        ends = np.cumsum(list(self.counts.values()))
        return dict(zip(self.counts, np.split(values, ends[:-1], axis=1), strict=True))

    def turned(self, size_px: tuple[int, int], quarter_turns: int) -> "FilmLayers":
        """The same on pictures of ``size_px`` once they are turned counter-clockwise."""
        at = np.rint(turned_pixels(self.places * self.unit_px, size_px, quarter_turns) / self.unit_px)
        return replace(self, places=np.where(self.places == MISSING, MISSING, at).astype(np.int16))


class _View:
    """The view of each frame (m,) of a film: that of the calibration, moved with the camera."""

    def __init__(self, calibration: Calibration, run: RunRecord, time_s: Array):
        watched = run.rover_track.camera
        if watched is None:
            self.views, self.which = [(calibration.camera, calibration.floor)], np.zeros(len(time_s), dtype=int)
            return
        rows = watched.motion[nearest_samples(run.rover_track.time_s, time_s)]
        different, which = np.unique(rows, axis=0, return_inverse=True)
        self.views = [moved_view(watched.camera, watched.floor, motion) for motion in different]
        self.which = which.ravel()

    def project(self, points: Array) -> Array:
        """Pixels (m, k, 2) of points (m, k, 3) [m], each row in its frame."""
        pixels = np.empty((*points.shape[:-1], 2))
        for i, view in enumerate(self.views):
            pixels[self.which == i] = _projected(*view, points[self.which == i])
        return pixels


def _projected(camera: Camera, floor: Floor, points: Array) -> Array:
    """Pixels (..., 2) of points (..., 3) [m], NaN behind the camera, by OpenCV where the lens is not a fisheye."""
    if is_fisheye(camera.lens_model):
        # Imported here, because it imports the compiler, which takes longer than all the drawing.
        from towval.optics.projection import project  # noqa: PLC0415

        return project(camera, floor, points)
    T = floor.T_camera_floor
    seen = points @ T[:3, :3].T + T[:3, 3]
    flat = np.where(seen[..., 2:] > 0, seen, np.nan).reshape(-1, 1, 3)
    pixels = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion)[0]
    return np.asarray(pixels, dtype=np.float64).reshape(*points.shape[:-1], 2)


def film_layers(run: RunRecord, calibration: Calibration, time_s: Array) -> FilmLayers:
    """Layers of a run at the times (m,) of the frames, on the clock of the run [s]."""
    rover = pose_at(run.rover_track.time_s, measured_poses(run.rover_track), time_s)
    measured = pose_at(run.object_track.time_s, measured_poses(run.object_track), time_s)
    simulated = pose_at(run.simulated.time_s, run.simulated.pose, time_s)
    tension = np.linalg.norm(run.simulated.tether_force, axis=1)[:, None]
    at_rest = pose_at(run.simulated.time_s, tension, time_s)[..., 0]
    hinge, anchor = transform(rover, run.hinge), transform(simulated, run.anchor)
    ends = np.stack([lifted(anchor, run.anchor_height_m), lifted(hinge, run.hinge_height_m)], axis=1)
    lines = {
        "rover": _outline(run.rover, rover),
        "measured": _outline(run.towed, measured),
        "simulated": _outline(run.towed, simulated),
        "tether": ends,
    }
    view = _View(calibration, run, time_s)
    pixels = {name: _bent(view, line) for name, line in lines.items()}
    bodies = (("rover", run.rover, rover), ("measured", run.towed, measured), ("simulated", run.towed, simulated))
    for name, body, pose in bodies:
        origin = lifted(pose[:, None, :2], body.tracked_plane_height_m)
        pixels[f"{name} path"] = view.project(origin)
    counts = {name: points.shape[1] for name, points in pixels.items()}
    unit_px, places = _as_integers(np.concatenate(list(pixels.values()), axis=1), calibration.camera.resolution_px)
    return FilmLayers(counts, unit_px, places, np.asarray(at_rest > 0))


def _outline(body: Body, poses: Array) -> Array:
    """Closed outlines (m, n + 1, 3) [m] of a body's top at poses (m, 3)."""
    return lifted(transform(poses[:, None], body.outline_m), body.tracked_plane_height_m)


def _bent(view: _View, lines: Array) -> Array:
    """Pixels (m, k, 2) along lines (m, n, 3) [m], with as many points as the lens's bending of the edges requires."""
    middle = view.project(0.5 * (lines[:, 1:] + lines[:, :-1]))
    corners = view.project(lines)
    edge = corners[:, 1:] - corners[:, :-1]
    away = middle - corners[:, :-1]
    length = np.maximum(np.hypot(edge[..., 0], edge[..., 1]), 1e-9)
    bow = np.abs(edge[..., 0] * away[..., 1] - edge[..., 1] * away[..., 0]) / length
    largest = float(np.max(np.nan_to_num(bow), initial=0.0))
    # The bow of a piece falls with the square of the number of pieces.
    pieces = min(_MOST_PIECES, max(1, math.ceil(math.sqrt(largest / _BOW_PX))))
    share = (np.arange(pieces) / pieces)[:, None]
    steps = lines[:, :-1, None] + share * (lines[:, 1:, None] - lines[:, :-1, None])
    dense = np.concatenate([steps.reshape(len(lines), -1, 3), lines[:, -1:]], axis=1)
    return view.project(dense)


def _as_integers(pixels: Array, resolution_px: tuple[int, int]) -> tuple[float, NDArray[np.int16]]:
    """Unit [px], a power of two, and pixels in it; points farther outside than half a picture are missing."""
    reach = 1.5 * max(resolution_px)
    unit_px = 2.0 ** math.ceil(math.log2(reach / _LARGEST))
    known = np.isfinite(pixels).all(axis=-1, keepdims=True) & (np.abs(pixels) <= reach).all(axis=-1, keepdims=True)
    return unit_px, np.where(known, np.round(np.nan_to_num(pixels) / unit_px), MISSING).astype(np.int16)
