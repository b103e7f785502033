"""Outlines, trails, tether and text of a run, drawn onto one frame of its footage."""

import itertools

import cv2
import numpy as np
from numpy.typing import NDArray

from towval.model import Array, Calibration
from towval.model.geometry import transform
from towval.model.run_record import RunRecord, measured_poses, outline_at, pose_at
from towval.optics.projection import project
from towval.report.overlay_text import TextPainter

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

_ROVER, _SIMULATED, _MEASURED, _TETHER = (64, 150, 255), (0, 0, 0), (255, 60, 36), (255, 214, 80)
_WHITE = (255, 255, 255)
# cv2 draws at fractions of a pixel when coordinates carry this many fractional bits.
_FRACTION_BITS = 4
_PIECE_M = 0.025


class Painter:
    """Draws the state of a run at a time onto a frame of the video.

    ``width_px``: largest width of the video [px]; the footage is never scaled up.

    Attributes
    ----------
    size_px : tuple of int
        Width and height of the video, both even [px].
    """

    def __init__(self, calibration: Calibration, run: RunRecord, width_px: int):
        width, height = calibration.camera.resolution_px
        self._scale = min(1.0, width_px / width)
        # H.264 with subsampled colour needs even sizes.
        self.size_px = (2 * round(width * self._scale / 2), 2 * round(height * self._scale / 2))
        self.calibration, self._run = calibration, run
        self._line = max(1, round(self.size_px[0] / 480))
        self._rover, self._measured = measured_poses(run.rover_track), measured_poses(run.object_track)
        height_m = run.towed.tracked_plane_height_m
        self._trails = (
            (run.simulated.time_s, self._pixels(run.simulated.pose[:, :2], height_m), _SIMULATED, self._line),
            (run.object_track.time_s, self._pixels(self._measured[:, :2], height_m), _MEASURED, 1),
        )
        self._tension = np.linalg.norm(run.simulated.tether_force, axis=1)
        self._text = TextPainter(max(11, round(self.size_px[1] / 34)))

    def draw(self, picture: Picture, time_s: float) -> None:
        """Draw outlines, tether and text at ``time_s`` onto ``picture`` (height, width, 3) RGB, in place."""
        run = self._run
        rover = pose_at(run.rover_track.time_s, self._rover, time_s)
        measured = pose_at(run.object_track.time_s, self._measured, time_s)
        simulated = pose_at(run.simulated.time_s, run.simulated.pose, time_s)
        self._draw_tether(picture, rover, simulated, time_s)
        for times_s, pixels, colour, line in self._trails:
            stroke(picture, pixels[: np.searchsorted(times_s, time_s, side="right")], colour, line)
        rover_height, height = run.rover.tracked_plane_height_m, run.towed.tracked_plane_height_m
        self._polyline(picture, outline_at(run.rover, rover), rover_height, _ROVER, self._line)
        for colour, line in ((_WHITE, self._line + 3), (_SIMULATED, self._line + 1)):
            self._polyline(picture, outline_at(run.towed, simulated), height, colour, line)
        self._polyline(picture, outline_at(run.towed, measured), height, _MEASURED, self._line, dashed=True)
        self._write(picture, time_s)

    def _draw_tether(self, picture: Picture, rover: Array, towed: Array, time_s: float) -> None:
        # On the floor: the model has the tether in the ground plane, and the campaign gives it no height.
        run = self._run
        ends = np.array([transform(towed, run.anchor), transform(rover, run.hinge)])
        taut = self._tension[int(np.argmin(np.abs(run.simulated.time_s - time_s)))] > 0
        self._polyline(picture, ends, 0.0, _TETHER if taut else _WHITE, self._line if taut else 1)

    def _polyline(
        self, picture: Picture, points: Array, height_m: float, colour: Colour, line: int, *, dashed: bool = False
    ) -> None:
        """Draw floor points (n, 2) [m] at a height; missing points leave gaps."""
        pieces = dense(points)
        if dashed:
            # Every fourth of the equidistant points missing: dashes as long as their gaps.
            pieces[2::4] = np.nan
        stroke(picture, self._pixels(pieces, height_m), colour, line)

    def _pixels(self, points: Array, height_m: float) -> Array:
        """Pixels of the video (n, 2) of floor points (n, 2) [m] lifted to a height."""
        lifted = np.column_stack([points, np.full(len(points), height_m)])
        pixels = project(self.calibration.camera, self.calibration.floor, lifted)
        # The centre of pixel (0, 0) is half a pixel from the edge, before and after scaling.
        return (pixels + 0.5) * self._scale - 0.5

    def _write(self, picture: Picture, time_s: float) -> None:
        self._text.write(
            picture, (0, 0), [(f"run {self._run.name}   {time_s:6.2f} s   {self._error_text(time_s)}", _WHITE)]
        )
        key = [("rover   ", (140, 190, 255)), ("object measured   ", (255, 130, 112)), ("simulated (black)", _WHITE)]
        self._text.write(picture, (0, picture.shape[0] - self._text.height_px), key)

    def _error_text(self, time_s: float) -> str:
        comparison = self._run.comparison
        error = pose_at(comparison.time_s, comparison.error, time_s)
        if not np.isfinite(error).all():
            return "object not tracked"
        # Adding zero removes the sign of -0.
        turn = f"{round(float(np.rad2deg(error[2])), 2) + 0.0:+5.2f}".replace("-", "−")
        return f"error {1e3 * np.hypot(error[0], error[1]):5.2f} mm   {turn}°"


def stroke(picture: Picture, pixels: Array, colour: Colour, line: int) -> None:
    """Draw a polyline (n, 2) [px] in place; missing points leave gaps."""
    known = np.asarray(np.isfinite(pixels).all(axis=1))
    for piece in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(known)) + 1):
        if len(piece) > 1 and known[piece[0]]:
            fixed = np.round(pixels[piece] * 2**_FRACTION_BITS).astype(np.int32)
            cv2.polylines(picture, [fixed], False, colour, line, cv2.LINE_AA, _FRACTION_BITS)


def dense(points: Array) -> Array:
    """Points (m, 2) along a polyline, dense enough for the curvature that the lens gives a straight edge."""
    pieces = [points[:1]]
    for start, end in itertools.pairwise(points):
        length = np.linalg.norm(end - start)
        steps = max(1, round(length / _PIECE_M)) if np.isfinite(length) else 1
        pieces.append(start + (end - start) * (np.arange(1, steps + 1) / steps)[:, None])
    return np.concatenate(pieces)
