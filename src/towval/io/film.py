"""Footage as colour frames to draw on, and films for phones and browsers that are made of such frames."""

import errno
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.reformatter import ColorRange, Colorspace
from numpy.typing import NDArray

from towval.io.atomic import replacing
from towval.io.reading import is_plain_file
from towval.io.video import TEXT_AS_IT_IS, fraction, shown, upright
from towval.model import Array
from towval.model.errors import InputError

Picture = NDArray[np.uint8]
"""Colours (height, width, 3): red, green and blue in this module."""

_RATE_FACTOR = "25"  # of x264: 0 to 51; lower values are better and give larger files
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_MARK = "towval"
"""Comment in a film's metadata: only a film with it is replaced."""


def _opened(path: Path) -> av.container.InputContainer:
    # An absolute path is never taken for a protocol, as one is that begins with 10:30/.
    film: av.container.InputContainer = av.open(path.absolute(), **TEXT_AS_IT_IS)
    return film


def frame_times(path: Path) -> tuple[Array, str]:
    """Presentation times (m,) of the frames that a film shows [s], and the name of its coding; nothing is decoded.

    Raises `InputError` when the file is no video.
    """
    try:
        with _opened(path) as film:
            stream = shown(film)
            base = fraction(stream.time_base)
            stored = [p.pts for p in film.demux(stream) if p.pts is not None and p.size and not p.is_discard]
            coding = stream.codec_context.codec.long_name
    except (av.FFmpegError, OSError, IndexError) as error:
        raise InputError(f"the video {path.name} cannot be shown in the report", got=error) from error
    return np.array([float(pts * base) for pts in sorted(stored)]), coding


@contextmanager
def opened_film(path: Path) -> Iterator[av.container.InputContainer]:
    """Footage to be decoded; raises `InputError` where it is no video, or FFmpeg fails within the block."""
    try:
        with _opened(path) as film:
            if not film.streams.video:
                raise InputError(f"{path.name} holds no video", remedy="name a video file")
            shown(film).thread_type = "AUTO"
            yield film
    except av.FFmpegError as error:
        if error.errno in _NO_ROOM:
            raise  # Of the film that is written meanwhile.
        raise InputError(f"the video {path.name} cannot be read or drawn on", got=error) from error


def decoded(film: av.container.InputContainer, damaged: bool, wanted: int | None = None) -> Iterator[av.VideoFrame]:
    """Frames of the footage; of a damaged one, where allowed, those before the damage.

    Before the time ``wanted``, in units of the stream's time base, only those that others are coded from.
    """
    stream = shown(film)
    context = stream.codec_context
    try:
        for packet in film.demux(stream):
            if wanted is not None:
                context.skip_frame = "NONREF" if packet.pts is not None and packet.pts < wanted - 1 else "DEFAULT"
            for frame in packet.decode():
                if frame.is_corrupt and damaged:
                    return
                yield frame
    except av.FFmpegError:
        if not damaged:
            raise


def ticks(frame: av.VideoFrame) -> int:
    """Presentation time in units of the stream's time base."""
    if frame.pts is None:
        raise InputError("the video has a frame without a presentation time", remedy="remux the video")
    return frame.pts


def time_base(stream: av.VideoStream) -> Fraction:
    """Unit of the stream's times [s]."""
    if stream.time_base is None:
        raise InputError("the video has no time base", remedy="remux the video")
    return fraction(stream.time_base)


def seconds(frame: av.VideoFrame, stream: av.VideoStream) -> float:
    """Presentation time [s]."""
    return float(ticks(frame) * time_base(stream))


def upright_size(frame: av.VideoFrame, quarter_turns: int = 0) -> tuple[int, int]:
    """Width and height [px] of a frame once it is turned as players turn it, and by ``quarter_turns`` more."""
    return (frame.height, frame.width) if _is_lying(frame, quarter_turns) else (frame.width, frame.height)


def as_rgb(frame: av.VideoFrame, size_px: tuple[int, int], quarter_turns: int = 0) -> Picture:
    """A frame turned as players turn it, and by ``quarter_turns`` more, and scaled to a width and height."""
    # Where no colour matrix is stated: BT.709 for HD, BT.601 below, as is customary.
    unspecified = frame.colorspace not in (Colorspace.ITU709, Colorspace.ITU601)
    matrix = (Colorspace.ITU709 if frame.height >= 720 else Colorspace.ITU601) if unspecified else frame.colorspace
    size = size_px[::-1] if _is_lying(frame, quarter_turns) else size_px
    # Scaling first, then converting to RGB, takes a third of the time of both at once.
    scaled = frame.reformat(*size, interpolation="AREA")
    picture = scaled.reformat(format="rgb24", src_colorspace=matrix).to_ndarray().astype(np.uint8, copy=False)
    # Phones store the sensor's picture and a rotation.
    return np.ascontiguousarray(upright(picture, _turn_deg(frame, quarter_turns)))


def _turn_deg(frame: av.VideoFrame, quarter_turns: int) -> float:
    return frame.rotation + 90 * quarter_turns


def _is_lying(frame: av.VideoFrame, quarter_turns: int) -> bool:
    """Whether width and height change places when the frame is turned."""
    return round(_turn_deg(frame, quarter_turns) / 90) % 2 == 1


def check_film_replaceable(path: Path) -> None:
    """Refuse to replace a file that :func:`write_film` did not write: it may be footage."""
    if not is_plain_file(path):
        return
    try:
        with _opened(path) as film:
            marked = film.metadata.get("comment") == _MARK
    except (av.FFmpegError, OSError):
        marked = False
    if not marked:
        raise InputError(
            f"{path} is not replaced",
            got="a file without the mark of an overlay, which those of earlier versions lack",
            remedy="choose another name, or delete it",
        )


def write_film(
    path: Path, stream: av.VideoStream, size_px: tuple[int, int], pictures: Iterable[tuple[int, Picture]]
) -> None:
    """Write pictures as an MP4 of H.264, high profile, yuv420p, index first, whole or not at all.

    ``stream`` is the footage that the pictures are of; each comes with its time in units of that stream's time base.
    """
    with replacing(path) as temporary, av.open(temporary, "w", format="mp4", options=_INDEX_FIRST) as output:
        output.metadata["comment"] = _MARK
        encoder = _add_encoder(output, stream, size_px)
        for time, picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame = frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)
            frame.pts, frame.time_base = time, time_base(stream)
            output.mux(encoder.encode(frame))
        output.mux(encoder.encode(None))


_INDEX_FIRST = {"movflags": "+faststart"}


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
    context.time_base = time_base(stream)
    # A key frame per second, so that the report's time cursor seeks without delay.
    context.gop_size = max(1, round(float(rate)))
    context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
    context.color_primaries = context.color_trc = 1  # ITU-R BT.709, as the matrix
    return encoder
