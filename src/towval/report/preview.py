"""The start of a run: tops, body axes, hinge, anchor, tether and a floor grid drawn over the first frame."""

import itertools
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.io.film import Picture
from towval.model import Array, Body, Calibration, TowingScene
from towval.model.geometry import lifted, transform
from towval.optics.projection import project, to_plane
from towval.report.overlay_painter import stroke
from towval.report.overlay_text import Colour

GRID_M = 0.5
"""Spacing of the floor grid [m]."""
_PIECE_M = 0.025

_GRID, _TETHER = (150, 150, 150), (80, 214, 255)
_BODIES = {"rover": (255, 150, 64), "object": (36, 60, 255)}
_AXES = ((40, 40, 230), (60, 190, 60))


def draw_start(
    luma: NDArray[np.uint8], calibration: Calibration, scene: TowingScene, bodies: Mapping[str, tuple[Body, Array]]
) -> Picture:
    """The first frame as a blue, green and red picture, with the start poses of the bodies drawn in.

    ``bodies`` are rover and object by name with their poses (3,) [m, m, rad]; unknown ones are left out.
    """
    picture = np.asarray(cv2.cvtColor(luma, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    line = max(1, round(luma.shape[1] / 700))

    def draw(points: Array, colour: Colour, width: int) -> None:
        stroke(picture, project(calibration.camera, calibration.floor, _dense(points)), colour, width)

    for row in floor_grid(calibration):
        draw(lifted(row, 0.0), _GRID, 1)
    for end, colour in zip(np.eye(2) * GRID_M, _AXES, strict=True):
        draw(lifted(np.array([[0.0, 0.0], end]), 0.0), colour, 2 * line)
    for name, (body, pose) in bodies.items():
        height, outline = body.tracked_plane_height_m, body.outline_m
        draw(lifted(transform(pose, outline), height), _BODIES[name], line)
        length = 0.5 * float(np.abs(outline).max())
        for end, colour in zip(np.eye(2) * length, _AXES, strict=True):
            draw(lifted(transform(pose, np.array([[0.0, 0.0], end])), height), colour, line)
    if len(bodies) == len(_BODIES):
        hinge, anchor = transform(bodies["rover"][1], scene.hinge), transform(bodies["object"][1], scene.anchor)
        draw(np.array([[*hinge, scene.hinge_height], [*anchor, scene.anchor_height]]), _TETHER, line)
    return picture


def floor_grid(calibration: Calibration) -> list[Array]:
    """Lines (2, 2) [m] of a square grid over the part of the floor in the picture."""
    width, height = calibration.camera.resolution_px
    border = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], dtype=float)
    seen = to_plane(calibration.camera, calibration.floor, border, 0.0)
    if not np.isfinite(seen).all():
        return []
    low, high = np.floor(seen.min(axis=0) / GRID_M), np.ceil(seen.max(axis=0) / GRID_M)
    (x0, y0), (x1, y1) = GRID_M * low, GRID_M * high
    along = [np.array([[x, y0], [x, y1]]) for x in GRID_M * np.arange(low[0], high[0] + 1)]
    return along + [np.array([[x0, y], [x1, y]]) for y in GRID_M * np.arange(low[1], high[1] + 1)]


def _dense(points: Array) -> Array:
    """Points (m, 3) along a polyline (n, 3), dense enough for the curvature that the lens gives a straight edge."""
    pieces = [points[:1]]
    for start, end in itertools.pairwise(points):
        length = np.linalg.norm(end - start)
        steps = max(1, round(length / _PIECE_M)) if np.isfinite(length) else 1
        pieces.append(start + (end - start) * (np.arange(1, steps + 1) / steps)[:, None])
    return np.concatenate(pieces)
