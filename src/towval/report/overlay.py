"""The overlay video: what was simulated and what was measured, drawn onto the footage itself.

The outlines are those of the tops, at the height at which the camera sees them. The film comes out as H.264 that
phones and browsers play, scaled down, with the presentation times of the source.
"""

from __future__ import annotations

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

from towval.io.atomic import replacing
from towval.io.video import upright
from towval.model import Calibration
from towval.model.errors import InputError
from towval.model.run_record import RunRecord
from towval.report.overlay_painter import Painter

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Still:
    """One picture of an overlay video: its time in the video [s] and the picture as JPEG."""

    time_s: float
    jpeg: bytes


def write_overlay(
    source: FilePath,
    target: FilePath,
    calibration: Calibration,
    run: RunRecord,
    *,
    width_px: int = 960,
    crf: int = 25,
    damaged: bool = False,
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
    damaged : bool, optional
        Draw on the good part of a damaged source instead of refusing it.

    Returns
    -------
    path
        ``target``: H.264, high profile, yuv420p, index in front. Its time 0 is the first frame of the source.

    Raises
    ------
    InputError
        When the source is no video, is damaged, or has another size than the camera.
    """
    painter = Painter(calibration, run, width_px)
    with replacing(target) as temporary, _opened(source) as film:
        stream = film.streams.video[0]
        with av.open(temporary, "w", format="mp4", options={"movflags": "+faststart"}) as output:
            encoder = _add_encoder(output, stream, painter.size_px, crf)
            for frame in _drawn_frames(source, _decoded(film, damaged), stream, painter):
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
    options = {"crf": str(crf), "preset": "veryfast", "profile": "high", "threads": "2"}
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


def _decoded(film: av.container.InputContainer, damaged: bool) -> Iterator[av.VideoFrame]:
    """The frames of the footage; of a damaged one those before the damage, where that is allowed."""
    try:
        for frame in film.decode(film.streams.video[0]):
            if frame.is_corrupt and damaged:
                return
            yield frame
    except av.FFmpegError:
        if not damaged:
            raise


def _drawn_frames(
    source: FilePath, frames: Iterator[av.VideoFrame], stream: av.VideoStream, painter: Painter
) -> Iterator[av.VideoFrame]:
    """The frames of the footage with the run drawn in, ready to be coded; their times start at zero."""
    first = None
    for frame in frames:
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
    # First smaller, then to RGB: a third of the time of both at once.
    scaled = frame.reformat(*size, interpolation="AREA")
    picture = scaled.reformat(format="rgb24", src_colorspace=matrix).to_ndarray()
    # Phones store the sensor's picture and a turn; the camera was calibrated on upright pictures.
    return np.ascontiguousarray(upright(picture, frame.rotation))
