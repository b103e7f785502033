"""Outlines, paths, tether and text of a run, drawn onto one frame of its footage."""

import cv2
import numpy as np

from towval.io.film import Picture
from towval.model import Array, Calibration
from towval.model.geometry import arc_lengths
from towval.model.run_record import RunRecord, nearest_samples, pose_at
from towval.report.outlines import film_layers
from towval.report.overlay_text import Colour, TextPainter
from towval.report.wording import signed

_ROVER, _SIMULATED, _MEASURED, _TETHER = (64, 150, 255), (0, 0, 0), (255, 60, 36), (255, 214, 80)
_WHITE = (255, 255, 255)
# cv2 draws at fractions of a pixel when coordinates carry this many fractional bits.
_FRACTION_BITS = 4


class Painter:
    """Draws the state of a run at a time onto a frame of the video.

    ``width_px`` is the largest width of the video [px]; the footage is never enlarged. ``size_px`` are its width and
    height, both even; ``quarter_turns`` those by which it was turned to lie as it was calibrated.
    """

    def __init__(self, calibration: Calibration, run: RunRecord, width_px: int):
        width, height = calibration.camera.resolution_px
        self._scale = min(1.0, width_px / width)
        # H.264 with subsampled colour needs even sizes.
        self.size_px = (2 * round(width * self._scale / 2), 2 * round(height * self._scale / 2))
        self.calibration, self._run, self.quarter_turns = calibration, run, run.quarter_turns
        self._line = max(1, round(self.size_px[0] / 480))
        self._times_s = run.rover_track.time_s
        self._interval_s = float(np.median(np.diff(self._times_s))) if len(self._times_s) > 1 else np.inf
        self._layers = film_layers(run, calibration, self._times_s)
        # The centre of pixel (0, 0) is half a pixel from the edge, before and after scaling.
        self._pixels = {name: (at + 0.5) * self._scale - 0.5 for name, at in self._layers.pixels().items()}
        self._text = TextPainter(max(11, round(self.size_px[1] / 34)))

    def draw(self, picture: Picture, time_s: float) -> None:
        """Draw outlines, tether and text at ``time_s`` onto ``picture`` (height, width, 3) RGB, in place."""
        self._write(picture, time_s)
        row, line = int(nearest_samples(self._times_s, time_s)), self._line
        if abs(self._times_s[row] - time_s) > self._interval_s:
            return
        at = {name: points[row] for name, points in self._pixels.items()}
        taut = self._layers.taut[row]
        stroke(picture, at["tether"], _TETHER if taut else _WHITE, line if taut else 1)
        for name, colour, width in (("simulated path", _SIMULATED, line), ("measured path", _MEASURED, 1)):
            stroke(picture, self._pixels[name][: row + 1, 0], colour, width)
        stroke(picture, at["rover"], _ROVER, line)
        stroke(picture, at["simulated"], _WHITE, line + 3)
        stroke(picture, at["simulated"], _SIMULATED, line + 1)
        for dash in _dashes(at["measured"], 4.0 * line):
            stroke(picture, dash, _MEASURED, line)

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
            simulated = self._run.simulated
            known = np.isfinite(pose_at(simulated.time_s, simulated.pose, time_s)).all()
            return f"object not {'tracked' if known else 'simulated'}"
        turn = signed(float(np.rad2deg(error[2])))
        return f"error {1e3 * np.hypot(error[0], error[1]):5.2f} mm   {turn:>5}°"


def stroke(picture: Picture, pixels: Array, colour: Colour, line: int) -> None:
    """Draw a polyline (n, 2) [px] in place; missing points leave gaps."""
    known = np.asarray(np.isfinite(pixels).all(axis=1))
    for piece in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(known)) + 1):
        if len(piece) > 1 and known[piece[0]]:
            fixed = np.round(pixels[piece] * 2**_FRACTION_BITS).astype(np.int32)
            cv2.polylines(picture, [fixed], False, colour, line, cv2.LINE_AA, _FRACTION_BITS)


def _dashes(points: Array, length_px: float) -> list[Array]:
    """Every other piece (m, 2) of a polyline (n, 2) [px]; none where a point is missing."""
    if not np.isfinite(points).all():
        return []
    along = arc_lengths(points)
    pieces = []
    for start in np.arange(0.0, along[-1], 2 * length_px):
        end = min(start + length_px, along[-1])
        stops = np.concatenate([[start], along[(along > start) & (along < end)], [end]])
        pieces.append(np.column_stack([np.interp(stops, along, points[:, i]) for i in (0, 1)]))
    return pieces
