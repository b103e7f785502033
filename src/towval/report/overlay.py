"""Overlay video: simulated and measured outlines drawn onto the footage.

The outlines are those of the planar targets at their height. The video is H.264 for phones and browsers, scaled down,
with the presentation times of the source.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path as FilePath

import av
import cv2
import numpy as np
from av.video.reformatter import ColorRange, Colorspace

from towval.io.atomic import replacing
from towval.io.reading import is_plain_file
from towval.io.video import upright
from towval.model import Calibration
from towval.model.errors import InputError
from towval.model.run_record import RunRecord, Still
from towval.report.film import frame_times, run_times
from towval.report.overlay_painter import Painter
from towval.report.overlay_text import Picture

_JPEG_QUALITY = 75
_RATE_FACTOR = "25"  # of x264: 0 to 51; lower values are better and give larger files
_PICTURE_PX, _PICTURE_S = 960, 0.2  # width of the pictures for viewers, and time between them
_STILL_PX = 640
_MARK = "towval"
"""Comment in the film's metadata: only a film with it is replaced."""


def write_overlay(
    source: FilePath,
    target: FilePath,
    calibration: Calibration,
    run: RunRecord,
    *,
    width_px: int = 960,
    damaged: bool = False,
) -> FilePath:
    """Draw a run onto its footage: an MP4 of H.264, high profile, yuv420p, index first.

    Time 0 is the first frame of the source; what is drawn is on the clock of the run. Footage narrower than
    ``width_px`` keeps its size; of a ``damaged`` source the part before the damage is used.

    Raises `InputError` when the source is no video, is damaged, or has another size than the camera, or where a file
    that is no overlay stands at ``target``.
    """
    _check_replaceable(target)
    painter = Painter(calibration, run, width_px)
    with replacing(target) as temporary, _opened(source) as film:
        stream, clock = film.streams.video[0], _Clock(source, run)
        with av.open(temporary, "w", format="mp4", options={"movflags": "+faststart"}) as output:
            output.metadata["comment"] = _MARK
            encoder = _add_encoder(output, stream, painter.size_px)
            for frame in _drawn_frames(source, _decoded(film, damaged), stream, painter, clock):
                output.mux(encoder.encode(frame))
            output.mux(encoder.encode(None))
    return target


def drawn_pictures(
    source: FilePath, calibration: Calibration, run: RunRecord, *, damaged: bool = False
) -> Iterator[Still]:
    """Pictures of the footage with the run drawn in, five a second; otherwise as :func:`write_overlay`.

    Frames that no other is coded from are skipped: a picture is the first at or after its time that others need.
    """
    painter = Painter(calibration, run, _PICTURE_PX)
    due_s = -np.inf
    with _opened(source) as film:
        stream, clock = film.streams.video[0], _Clock(source, run)
        stream.codec_context.skip_frame = "NONREF"
        for frame in _decoded(film, damaged):
            time_s = _seconds(frame, stream)
            if time_s + 1e-6 >= due_s:
                due_s = (time_s if due_s == -np.inf else due_s) + _PICTURE_S
                yield _still(source, frame, clock.of_run(time_s), painter)


def stills(
    source: FilePath, calibration: Calibration, run: RunRecord, times_s: Sequence[float], *, damaged: bool = False
) -> tuple[Still, ...]:
    """The first pictures at or after given presentation times [s], with the run drawn in; none after the last one."""
    painter, found = Painter(calibration, run, _STILL_PX), []
    with _opened(source) as film:
        stream, clock = film.streams.video[0], _Clock(source, run)
        for wanted_s in times_s:
            wanted = int(wanted_s / _time_base(stream))
            film.seek(wanted, stream=stream)
            for frame in _decoded(film, damaged, wanted):
                time_s = _seconds(frame, stream)
                if time_s + 1e-6 >= wanted_s:
                    found.append(_still(source, frame, clock.of_run(time_s), painter))
                    break
    return tuple(found)


class _Clock:
    """The clock of a run: where a video's own times were not to be trusted, tracking has found others."""

    def __init__(self, source: FilePath, run: RunRecord):
        self.presented_s, _ = frame_times(source)
        self.own_s = run_times(run, self.presented_s)

    def of_run(self, presented_s: float) -> float:
        """Time of the frame with a presentation time [s]."""
        return float(np.interp(presented_s, self.presented_s, self.own_s))


def _still(source: FilePath, frame: av.VideoFrame, time_s: float, painter: Painter) -> Still:
    _check_size(source, frame, painter.calibration)
    picture = _as_rgb(frame, painter.size_px)
    painter.draw(picture, time_s)
    coded = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
    return Still(time_s, painter.size_px, coded.tobytes())


def _check_replaceable(path: FilePath) -> None:
    """Refuse to replace a file without our mark: it may be footage."""
    if not is_plain_file(path):
        return
    try:
        with av.open(path, metadata_errors="replace") as film:
            marked = film.metadata.get("comment") == _MARK
    except (av.FFmpegError, OSError):
        marked = False
    if not marked:
        raise InputError(
            f"{path} is not replaced",
            got="a file without the mark of an overlay, which those of earlier versions lack",
            remedy="choose another name, or delete it",
        )


@contextmanager
def _opened(path: FilePath) -> Iterator[av.container.InputContainer]:
    try:
        with av.open(path, metadata_errors="replace") as film:
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
    output: av.container.OutputContainer, stream: av.VideoStream, size_px: tuple[int, int]
) -> av.VideoStream:
    # A fixed number of threads: the bytes of x264 depend on it.
    options = {"crf": _RATE_FACTOR, "preset": "veryfast", "profile": "high", "threads": "2"}
    rate = stream.average_rate or Fraction(25)
    encoder = output.add_stream("libx264", rate=rate, options=options)
    encoder.width, encoder.height = size_px
    encoder.pix_fmt = "yuv420p"
    context = encoder.codec_context
    context.time_base = _time_base(stream)
    # A key frame per second, so that the report's time cursor seeks without delay.
    context.gop_size = max(1, round(float(rate)))
    context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
    context.color_primaries = context.color_trc = 1  # ITU-R BT.709, as the matrix
    return encoder


def _decoded(film: av.container.InputContainer, damaged: bool, wanted: int | None = None) -> Iterator[av.VideoFrame]:
    """Frames of the footage; of a damaged one, where allowed, those before the damage.

    Before the time ``wanted``, only those that others are coded from.
    """
    context = film.streams.video[0].codec_context
    try:
        for packet in film.demux(film.streams.video[0]):
            if wanted is not None:
                context.skip_frame = "NONREF" if packet.pts is not None and packet.pts < wanted - 1 else "DEFAULT"
            for frame in packet.decode():
                if frame.is_corrupt and damaged:
                    return
                yield frame
    except av.FFmpegError:
        if not damaged:
            raise


def _drawn_frames(
    source: FilePath, frames: Iterator[av.VideoFrame], stream: av.VideoStream, painter: Painter, clock: _Clock
) -> Iterator[av.VideoFrame]:
    """Frames with the run drawn in, ready to encode; times start at zero."""
    first = None
    for frame in frames:
        if first is None:
            _check_size(source, frame, painter.calibration)
            first = _ticks(frame)
        picture = _as_rgb(frame, painter.size_px)
        painter.draw(picture, clock.of_run(_seconds(frame, stream)))
        drawn = av.VideoFrame.from_ndarray(picture, format="rgb24")
        drawn = drawn.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)
        drawn.pts, drawn.time_base = _ticks(frame) - first, _time_base(stream)
        yield drawn


def _ticks(frame: av.VideoFrame) -> int:
    """Presentation time in units of the stream's time base."""
    if frame.pts is None:
        raise InputError("the video has a frame without a presentation time", remedy="remux the video")
    return frame.pts


def _seconds(frame: av.VideoFrame, stream: av.VideoStream) -> float:
    """Presentation time [s]."""
    return float(_ticks(frame) * _time_base(stream))


def _time_base(stream: av.VideoStream) -> Fraction:
    if stream.time_base is None:
        raise InputError("the video has no time base", remedy="remux the video")
    return stream.time_base


def _quarter_turns(frame: av.VideoFrame) -> int:
    return round(frame.rotation / 90) % 4


def _as_rgb(frame: av.VideoFrame, size_px: tuple[int, int]) -> Picture:
    # Where no colour matrix is stated: BT.709 for HD, BT.601 below, as is customary.
    unspecified = frame.colorspace not in (Colorspace.ITU709, Colorspace.ITU601)
    matrix = (Colorspace.ITU709 if frame.height >= 720 else Colorspace.ITU601) if unspecified else frame.colorspace
    size = size_px if _quarter_turns(frame) % 2 == 0 else size_px[::-1]
    # Scaling first, then converting to RGB, takes a third of the time of both at once.
    scaled = frame.reformat(*size, interpolation="AREA")
    picture = scaled.reformat(format="rgb24", src_colorspace=matrix).to_ndarray().astype(np.uint8, copy=False)
    # Phones store the sensor's picture and a rotation; the camera was calibrated on upright pictures.
    return np.ascontiguousarray(upright(picture, frame.rotation))
