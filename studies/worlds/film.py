"""Films written as videos: what a synthetic camera saw, as the file that a real one would have made."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.video.stream import VideoStream
from numpy.typing import NDArray


def write_video(path: Path, frames: Iterable[tuple[float, NDArray[np.uint8]]], rate: int = 25, **options: str) -> None:
    """Write luma pictures as H.264 (or another codec) with their own times; options are the encoder's.

    ``codec``, ``pixel_format`` and ``container`` choose the kind of file. The same pictures give the same bytes, but
    for a ``maxrate`` with more than one of the encoder's ``threads``.
    """
    codec = options.pop("codec", "libx264")
    if codec == "libx264":
        # The plan of x264's macroblock tree depends on memory that it never wrote: 25 files of 25 encodings differed.
        options.setdefault("x264-params", "mbtree=0")
    pixel_format = options.pop("pixel_format", "yuv420p")
    # AVI counts in frames; MPEG-4 allows no finer clock than 1/65535 s.
    base = Fraction(1, rate) if path.suffix == ".avi" else Fraction(1, 51200)
    with av.open(str(path), "w", format=options.pop("container", None)) as file:
        stream: VideoStream | None = None
        for time_s, luma in frames:
            if stream is None:
                stream = cast(VideoStream, file.add_stream(codec, rate=rate, options=options))
                stream.width, stream.height, stream.pix_fmt = luma.shape[1], luma.shape[0], pixel_format
                stream.time_base = stream.codec_context.time_base = base
            frame = av.VideoFrame.from_ndarray(luma, format="gray").reformat(
                format=pixel_format, src_color_range="JPEG", dst_color_range="JPEG"
            )
            frame.pts, frame.time_base = round(time_s / base), base
            file.mux(stream.encode(frame))
        if stream is not None:
            file.mux(stream.encode())


def cut_off(whole: Path, path: Path, share: float) -> None:
    """Write the first part of an MP4 file, its index in front, as a copy that was broken off leaves it."""
    with av.open(str(whole)) as file, av.open(str(path), "w", options={"movflags": "faststart"}) as copy:
        stream = copy.add_stream_from_template(file.streams.video[0])
        for packet in file.demux(file.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                copy.mux(packet)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
