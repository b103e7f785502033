"""The overlay video: what was simulated and what was measured, drawn onto the footage itself.

The outlines are those of the tops, at the height at which the camera sees them. The film comes out as H.264 that
phones and browsers play, scaled down, with the presentation times of the source.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path as FilePath

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, Colorspace
from numpy.typing import NDArray

from towval.errors import InputError
from towval.geometry import transform
from towval.io.atomic import replacing
from towval.io.overlay_text import TextPainter
from towval.io.run_record import RunRecord, outline_at, pose_at, seen_poses
from towval.io.video import upright
from towval.types import Array, Calibration
from towval.vision.camera import project

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

_ROVER, _SIMULATED, _MEASURED, _TETHER = (64, 150, 255), (0, 0, 0), (255, 60, 36), (255, 214, 80)
_WHITE = (255, 255, 255)
# cv2 draws at fractions of a pixel when coordinates carry this many fractional bits.
_FRACTION_BITS = 4
_PIECE_M = 0.025


@dataclass(frozen=True)
class Still:
    """One picture of an overlay video: its time in the video [s] and the picture as JPEG."""

    time_s: float
    jpeg: bytes


def write_overlay(
    source: FilePath, target: FilePath, calibration: Calibration, run: RunRecord, *, width_px: int = 960, crf: int = 27
) -> FilePath:
    """Draw a run onto its footage.

    Parameters
    ----------
    source, target : path
        The run's video, and the MP4 to write; its folder is made if it is not there.
    calibration : Calibration
        Camera and floor.
    run : RunRecord
        The run.
    width_px : int, optional
        Largest width of the film [px]; smaller footage keeps its size.
    crf : int, optional
        Constant rate factor of x264, 0 to 51; less is better and larger.

    Returns
    -------
    path
        ``target``: H.264, high profile, yuv420p, index in front. Its time 0 is the first frame of the source.

    Raises
    ------
    InputError
        When the source is no video, is damaged, or has another size than the camera.
    """
    painter = _Painter(calibration, run, width_px)
    with replacing(target) as temporary, _opened(source) as film:
        stream = film.streams.video[0]
        with av.open(temporary, "w", format="mp4", options={"movflags": "+faststart"}) as output:
            encoder = _add_encoder(output, stream, painter.size_px, crf)
            for frame in _drawn_frames(source, film, painter):
                output.mux(encoder.encode(frame))
            output.mux(encoder.encode(None))
    return target


def overlay_frames(overlay: FilePath, count: int = 3) -> tuple[Still, ...]:
    """Stills of an overlay video at equal steps, its first and last frame among them.

    Parameters
    ----------
    overlay : path
        What :func:`write_overlay` wrote.
    count : int, optional
        How many, one or more.

    Returns
    -------
    tuple of Still
        In the order of time; fewer than ``count`` where the video is shorter.

    Raises
    ------
    InputError
        When the file is no video.
    """
    with _opened(overlay) as film:
        stream = film.streams.video[0]
        wanted = set(np.linspace(0, max(stream.frames - 1, 0), count).round().astype(int).tolist())
        stills = []
        for index, frame in enumerate(film.decode(stream)):
            if index in wanted:
                picture = cv2.cvtColor(frame.to_ndarray(format="rgb24"), cv2.COLOR_RGB2BGR)
                encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 82])[1]
                stills.append(Still(float(frame.pts * stream.time_base), encoded.tobytes()))
    return tuple(stills)


@contextmanager
def _opened(path: FilePath) -> Iterator[av.container.InputContainer]:
    try:
        with av.open(path) as film:
            if not film.streams.video:
                raise InputError(f"{path.name} holds no video", remedy="name a video file")
            film.streams.video[0].thread_type = "AUTO"
            yield film
    except av.FFmpegError as error:
        raise InputError(f"the video {path.name} cannot be read or drawn on", got=error) from error


def _check_size(source: FilePath, frame: av.VideoFrame, calibration: Calibration) -> None:
    size = (frame.width, frame.height) if _quarter_turns(frame) % 2 == 0 else (frame.height, frame.width)
    if size != tuple(calibration.camera.resolution_px):
        raise InputError(
            f"{source.name} has another size than the calibrated camera",
            got=f"{size[0]} × {size[1]}",
            allowed="{} × {}".format(*calibration.camera.resolution_px),
            remedy="calibrate with pictures of the size of the video",
        )


def _add_encoder(
    output: av.container.OutputContainer, stream: av.VideoStream, size_px: tuple[int, int], crf: int
) -> av.VideoStream:
    # A fixed number of threads: x264 gives the same bytes again only for the same number.
    options = {"crf": str(crf), "preset": "medium", "profile": "high", "threads": "2"}
    rate = stream.average_rate or Fraction(25)
    encoder = output.add_stream("libx264", rate=rate, options=options)
    encoder.width, encoder.height = size_px
    encoder.pix_fmt = "yuv420p"
    context = encoder.codec_context
    context.time_base = stream.time_base
    # A key frame a second, so that the report's time cursor can seek without delay.
    context.gop_size = max(1, round(float(rate)))
    context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
    context.color_primaries = context.color_trc = 1  # ITU-R BT.709, as the matrix
    return encoder


def _drawn_frames(source: FilePath, film: av.container.InputContainer, painter: _Painter) -> Iterator[av.VideoFrame]:
    """The frames of the footage with the run drawn in, ready to be coded; their times start at zero."""
    stream = film.streams.video[0]
    first = None
    for frame in film.decode(stream):
        if first is None:
            _check_size(source, frame, painter.calibration)
            first = frame.pts
        picture = _as_rgb(frame, painter.size_px)
        painter.draw(picture, float(frame.pts * stream.time_base))
        drawn = av.VideoFrame.from_ndarray(picture, format="rgb24")
        drawn = drawn.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)
        drawn.pts, drawn.time_base = frame.pts - first, stream.time_base
        yield drawn


def _quarter_turns(frame: av.VideoFrame) -> int:
    return round(frame.rotation / 90) % 4


def _as_rgb(frame: av.VideoFrame, size_px: tuple[int, int]) -> Picture:
    # Footage that does not say which matrix it was coded with follows the custom: BT.709 for HD, BT.601 below.
    unspecified = frame.colorspace not in (Colorspace.ITU709, Colorspace.ITU601)
    matrix = (Colorspace.ITU709 if frame.height >= 720 else Colorspace.ITU601) if unspecified else frame.colorspace
    size = size_px if _quarter_turns(frame) % 2 == 0 else size_px[::-1]
    scaled = frame.reformat(*size, format="rgb24", src_colorspace=matrix, interpolation="AREA").to_ndarray()
    # Phones store the sensor's picture and a turn; the camera was calibrated on upright pictures.
    return np.ascontiguousarray(upright(scaled, frame.rotation))


class _Painter:
    """Draws the state of a run at a time onto a picture of the film's size."""

    def __init__(self, calibration: Calibration, run: RunRecord, width_px: int):
        width, height = calibration.camera.resolution_px
        self._scale = min(1.0, width_px / width)
        # H.264 with half-size colour planes wants even sizes.
        self.size_px = (2 * round(width * self._scale / 2), 2 * round(height * self._scale / 2))
        self.calibration, self._run = calibration, run
        self._rover, self._measured = seen_poses(run.rover_track), seen_poses(run.object_track)
        self._tension = np.linalg.norm(run.simulated.tether_force, axis=1)
        self._line = max(1, round(self.size_px[0] / 480))
        self._text = TextPainter(max(11, round(self.size_px[1] / 34)))

    def draw(self, picture: Picture, time_s: float) -> None:
        """Draw outlines, tether and text at ``time_s`` onto ``picture`` (height, width, 3) RGB, in place."""
        run = self._run
        rover = pose_at(run.rover_track.time_s, self._rover, time_s)
        measured = pose_at(run.object_track.time_s, self._measured, time_s)
        simulated = pose_at(run.simulated.time_s, run.simulated.pose, time_s)
        self._draw_tether(picture, rover, simulated, time_s)
        self._draw_trails(picture, time_s)
        rover_height, height = run.rover.tracked_plane_height_m, run.towed.tracked_plane_height_m
        self._polyline(picture, outline_at(run.rover, rover), rover_height, _ROVER, self._line)
        for colour, line in ((_WHITE, self._line + 3), (_SIMULATED, self._line + 1)):
            self._polyline(picture, outline_at(run.towed, simulated), height, colour, line)
        self._polyline(picture, outline_at(run.towed, measured), height, _MEASURED, self._line, dashed=True)
        self._write(picture, time_s)

    def _draw_tether(self, picture: Picture, rover: Array, towed: Array, time_s: float) -> None:
        # On the floor: the campaign gives the tether no height; the paper and its model keep it in the ground plane.
        run = self._run
        ends = np.array([transform(towed, run.anchor), transform(rover, run.hinge)])
        taut = self._tension[int(np.argmin(np.abs(run.simulated.time_s - time_s)))] > 0
        self._polyline(picture, ends, 0.0, _TETHER if taut else _WHITE, self._line if taut else 1)

    def _draw_trails(self, picture: Picture, time_s: float) -> None:
        run = self._run
        height = run.towed.tracked_plane_height_m
        simulated = run.simulated.pose[run.simulated.time_s <= time_s]
        measured = self._measured[run.object_track.time_s <= time_s]
        self._polyline(picture, simulated[:, :2], height, _SIMULATED, self._line)
        self._polyline(picture, measured[:, :2], height, _MEASURED, 1)

    def _polyline(
        self, picture: Picture, points: Array, height_m: float, colour: Colour, line: int, *, dashed: bool = False
    ) -> None:
        """Draw floor points (n, 2) [m] at a height; missing points leave gaps."""
        dense = _dense(points)
        if dashed:
            # A point less in four, the points being equally far apart: dashes as long as their gaps.
            dense[2::4] = np.nan
        lifted = np.column_stack([dense, np.full(len(dense), height_m)])
        pixels = project(self.calibration.camera, self.calibration.floor, lifted)
        # The centre of pixel (0, 0) is at 0.5 pixel from the edge, before and after scaling.
        pixels = (pixels + 0.5) * self._scale - 0.5
        known = np.isfinite(pixels).all(axis=1)
        for piece in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(known)) + 1):
            if len(piece) > 1 and known[piece[0]]:
                fixed = np.round(pixels[piece] * 2**_FRACTION_BITS).astype(np.int32)
                cv2.polylines(picture, [fixed], False, colour, line, cv2.LINE_AA, _FRACTION_BITS)

    def _write(self, picture: Picture, time_s: float) -> None:
        self._text.write(
            picture, (0, 0), [(f"run {self._run.name}   {time_s:6.2f} s   {self._error_text(time_s)}", _WHITE)]
        )
        key = [("rover  ", (140, 190, 255)), ("measured  ", (255, 130, 112)), ("simulated", _WHITE)]
        self._text.write(picture, (0, picture.shape[0] - self._text.height_px), key)

    def _error_text(self, time_s: float) -> str:
        comparison = self._run.comparison
        error = pose_at(comparison.time_s, comparison.error, time_s)
        if not np.isfinite(error).all():
            return "object not seen"
        return f"error {1e3 * np.hypot(error[0], error[1]):5.1f} mm   {np.rad2deg(error[2]):+5.2f}°"


def _dense(points: Array) -> Array:
    """Points (m, 2) along a polyline, close enough for the bend that the lens gives a straight edge."""
    pieces = [points[:1]]
    for start, end in itertools.pairwise(points):
        length = np.linalg.norm(end - start)
        steps = max(1, round(length / _PIECE_M)) if np.isfinite(length) else 1
        pieces.append(start + (end - start) * (np.arange(1, steps + 1) / steps)[:, None])
    return np.concatenate(pieces)
