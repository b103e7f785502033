"""Videos read frame by frame: the luma plane as it is stored, with the file's own presentation times."""

import itertools
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import av
import numpy as np
from numpy.typing import NDArray

from towval.io.cut_off import is_cut_off
from towval.io.reading import is_plain_file
from towval.model import Array, Finding
from towval.model.errors import InputError
from towval.model.findings import finding

Luma = NDArray[np.uint8]

# Each decoder thread holds frames of its own: more of them than this buy little and cost memory at 4K.
_MOST_THREADS = 4
_QUARTER_TURN_DEG, _FULL_TURN = 90, 4
_PACKETS_LOOKED_AT = 100
_CUT_OFF = "the file ends early"
_DEEPEST_BITS = 16  # Of whole numbers.
_LAST_STEPS = 2.5  # From the last picture to the end: its own, one that is cut in two, and half of one for rounding.
_PLAYLISTS = {"hls", "applehttp", "concat", "dash", "imf", "sdp", "rtsp", "lavfi"}
"""FFmpeg's formats that name other files or hosts."""
TEXT_AS_IT_IS: dict[str, Any] = {} if int(av.__version__.split(".")[0]) >= 19 else {"metadata_errors": "replace"}
"""For :func:`av.open`: a title in another encoding is no error. From 19 on, PyAV has no such argument and does so."""


@dataclass(frozen=True)
class VideoHeader:
    """What a video file claims about itself before anything is decoded.

    ``resolution_px`` (width, height) as stored, before ``rotation``; ``frames`` the number of frames the header
    claims, None where it does not say (MPEG-TS); ``end_s`` when the video ends [s] and ``rate_hz`` the average frame
    rate, ``length_s`` of the pictures and ``sound_s`` from the first of them to the end of the sound [s], NaN where
    unknown.
    """

    resolution_px: tuple[int, int]
    frames: int | None
    end_s: float
    rate_hz: float
    length_s: float = float("nan")
    sound_s: float = float("nan")


class Video:
    """A video file, of any container and codec of FFmpeg, as an iterable of ``(time_s, luma)``.

    ``time_s`` is the presentation time [s] exactly as stored, a start offset included; ``luma`` (height, width) uint8
    is the Y plane, turned as players turn it where the file carries a rotation, and by ``quarter_turns`` more,
    counter-clockwise. Nothing is converted or copied for 8-bit planar video, so a frame's array is read-only and only
    one frame is held at a time. Deeper video is cut to 8 bits.

    Raises `InputError` where the file is missing or no video; while iterating, where times are missing or do not
    increase, no frame is good, or the file is damaged or truncated: with ``damaged`` its good part is used instead.
    """

    def __init__(self, path: str | os.PathLike[str], *, damaged: bool = False, quarter_turns: int = 0):
        self.path = Path(path)
        self.go_on_when_damaged = damaged
        self.quarter_turns = quarter_turns
        self.decoded_frames = 0
        self.last_time_s = float("nan")
        self.findings: tuple[Finding, ...] = ()
        with self.opened() as container:
            self.header = _header(container)

    def opened(self) -> av.container.InputContainer:
        """The file, opened as a video and nothing else; raises `InputError` as the class does."""
        if not is_plain_file(self.path):
            raise InputError(
                f"the video {self.path.name} is missing", got=self.path, remedy="correct the path of the video"
            )
        try:
            # An absolute path is never taken for a protocol; and nothing but this file is opened.
            options = {"protocol_whitelist": "file"}
            container: av.container.InputContainer
            container = av.open(str(self.path.absolute()), container_options=options, **TEXT_AS_IT_IS)
        except av.error.FFmpegError as error:
            raise InputError(
                f"{self.path.name} is no video that FFmpeg can open",
                got=f"{self.path.stat().st_size} bytes; {error.strerror}",
                remedy="check that the copy is complete and plays in a video player",
            ) from error
        if _PLAYLISTS & set(container.format.name.split(",")):
            container.close()
            raise InputError(f"{self.path.name} is a playlist", remedy="give the video itself")
        if not container.streams.video:
            container.close()
            raise InputError(f"{self.path.name} holds no video stream", remedy="give a file that holds moving pictures")
        context = shown(container).codec_context
        if context is None:
            container.close()
            raise InputError(
                f"{self.path.name} is coded in a way that FFmpeg cannot decode",
                allowed="H.264, HEVC, AV1, ProRes, MJPEG and what else FFmpeg decodes",
                remedy="copy the file again, or export it anew with the camera's own program",
            )
        if not context.width:
            container.close()
            raise InputError(
                f"no picture of {self.path.name} can be decoded",
                got="neither header nor pictures tell their size, as where the beginning of a recording is missing",
                remedy="copy the file again, or cut it again so that it begins with a keyframe",
            )
        return container

    def __iter__(self) -> Iterator[tuple[float, Luma]]:
        self.decoded_frames, self.last_time_s, self.findings = 0, float("nan"), ()
        with self.opened() as container:
            stream = shown(container)
            pts = sorted(self._stored_pts()[0]) if self._pts_in_coding_order else None
            stream.thread_type = "AUTO"
            # Among several threads it is left to chance whether a picture at the end of a file is marked as corrupt.
            threads = 1 if self.go_on_when_damaged else min(_MOST_THREADS, os.cpu_count() or 1)
            stream.codec_context.thread_count = threads
            try:
                for frame in container.decode(stream):
                    if frame.is_corrupt or (frame.width, frame.height) != self.header.resolution_px:
                        self._damage("a frame is corrupt" if frame.is_corrupt else "its pictures change size")
                        return
                    time_s = self._time(frame, None if pts is None else pts[self.decoded_frames])
                    yield time_s, self._luma(frame)
                    self.decoded_frames, self.last_time_s = self.decoded_frames + 1, time_s
            except av.error.FFmpegError as error:
                self._damage(str(error.strerror))
                return
        if self.decoded_frames == 0:
            raise InputError(f"{self.path.name} holds no frame that decodes", remedy="copy the file again")
        if is_cut_off(self.path) or not self._reached_the_end(self.decoded_frames, self.last_time_s):
            self._damage(_CUT_OFF)

    def turned(self, quarter_turns: int) -> "Video":
        """The same video with its pictures turned counter-clockwise, by quarter turns more than here."""
        turns = (self.quarter_turns + quarter_turns) % _FULL_TURN
        return Video(self.path, damaged=self.go_on_when_damaged, quarter_turns=turns)

    def tagged_turns(self) -> int:
        """Quarter turns, counter-clockwise, by which players turn the stored pictures."""
        with self.opened() as container:
            for frame in container.decode(shown(container)):
                return round(frame.rotation / _QUARTER_TURN_DEG) % _FULL_TURN
        return 0

    def first_picture(self) -> Luma:
        """The first picture (height, width)."""
        return np.ascontiguousarray(next(iter(self))[1])

    def mean_of_first(self, count: int) -> Luma:
        """The mean (height, width) of the first ``count`` pictures, or of all where there are fewer."""
        pictures = [luma for _, luma in itertools.islice(self, count)]
        return np.asarray(np.rint(np.mean(pictures, axis=0, dtype=np.float32)), dtype=np.uint8)

    def late_picture(self) -> Luma:
        """A picture far from the first (height, width): the last keyframe, or where that is the first, the last one.

        The second keyframe where the header states no end; the first picture where nothing late can be decoded.
        """
        with self.opened() as container:
            stream = shown(container)
            late: Luma | None = None
            with suppress(av.error.FFmpegError):
                if np.isfinite(self.header.end_s) and stream.time_base:
                    container.seek(int(self.header.end_s / stream.time_base), stream=stream)
                for frame in container.decode(stream):
                    late = self._luma(frame)
                    if (frame.pts or 0) > (stream.start_time or 0) and frame.key_frame:
                        break
        return self.first_picture() if late is None else np.ascontiguousarray(late)

    def stored_pictures(self, most: int) -> int:
        """How many pictures are stored, counted up to ``most``; what cannot be read is left to whoever decodes."""
        with self.opened() as container:
            packets = container.demux(shown(container))
            try:
                return sum(1 for _ in itertools.islice((p for p in packets if p.size and not p.is_discard), most))
            except av.error.FFmpegError:
                return most

    def stamps_s(self) -> Array:
        """Presentation times (n,) of the stored pictures [s], in order, without decoding them.

        Raises `InputError` where not all can be found: with ``damaged`` those before the damage are used instead.
        """
        with self.opened() as container:
            base = shown(container).time_base
        pts, reason = self._stored_pts()
        # Of an MP4 file that was copied in part FFmpeg finds what is there, and raises nothing.
        if pts and not reason and not self._reached_the_end(len(pts), _seconds(max(pts), base)):
            reason = _CUT_OFF
        if reason and not self.go_on_when_damaged:
            claimed = "" if self.header.frames is None else f" of {self.header.frames}"
            raise self._damaged(reason, f"{len(pts)}{claimed} pictures can be found")
        return np.array([_seconds(each, base) for each in sorted(pts)], dtype=np.float64)

    def _reached_the_end(self, count: int, last_time_s: float) -> bool:
        """Whether all frames of the header were found, or the last is where it says the video ends.

        AVI counts repeated pictures as frames, MP4 those that an edit list cuts off. Where such a list begins within a
        picture FFmpeg leaves that out and begins with the next, so that the pictures end by less than one step earlier.
        """
        if self.header.frames is None or count >= self.header.frames:
            return True
        return last_time_s + _LAST_STEPS / self.header.rate_hz >= self.header.end_s

    def _stored_pts(self) -> tuple[list[int], str]:
        """Times of the stored pictures, and why the file cannot be read beyond them; empty where it can."""
        pts: list[int] = []
        with self.opened() as container:
            try:
                packets = container.demux(shown(container))
                # An edit list cuts pictures off that are stored all the same.
                pts.extend(packet.pts for packet in packets if packet.pts is not None and not packet.is_discard)
            except av.error.FFmpegError as error:
                return pts, str(error.strerror)
        return pts, _CUT_OFF if is_cut_off(self.path) else ""

    @cached_property
    def _pts_in_coding_order(self) -> bool:
        """Whether the times are stored in coding order although pictures are coded out of order.

        AVI does that, and some writers of MP4. All times are then present, but on the wrong pictures; sorted, they are
        right.
        """
        with self.opened() as container:
            stream = shown(container)
            ahead = set()
            with suppress(av.error.FFmpegError):  # Said where the pictures are decoded.
                for packet in itertools.islice(container.demux(stream), _PACKETS_LOOKED_AT):
                    if packet.pts is not None and packet.dts is not None:
                        ahead.add(packet.pts - packet.dts)
            return bool(stream.codec_context.has_b_frames) and len(ahead) == 1

    def _luma(self, frame: av.VideoFrame) -> Luma:
        return upright(luma_plane(frame), frame.rotation + _QUARTER_TURN_DEG * self.quarter_turns)

    def _time(self, frame: av.VideoFrame, pts: int | None) -> float:
        pts = frame.pts if pts is None else pts
        if pts is None:
            raise InputError(
                f"frame {self.decoded_frames} of {self.path.name} carries no presentation time",
                remedy="put the stream into a container that holds times, for example `ffmpeg -i IN -c copy OUT.mp4`",
            )
        time_s = _seconds(pts, frame.time_base)
        if time_s < 0:
            raise InputError(
                f"the presentation times of {self.path.name} begin below zero",
                got=f"{time_s} s",
                remedy="write the file anew with FFmpeg: `ffmpeg -i IN -c copy OUT.mp4`",
            )
        if time_s <= self.last_time_s:
            raise InputError(
                f"the presentation times of {self.path.name} do not increase at frame {self.decoded_frames}",
                got=f"{time_s} s after {self.last_time_s} s",
                remedy="write the file anew with FFmpeg",
            )
        return time_s

    def _damage(self, reason: str) -> None:
        claimed = "an unknown number of" if self.header.frames is None else str(self.header.frames)
        good = f"{self.decoded_frames} of {claimed} frames are good"
        if self.decoded_frames:
            good += f", up to {self.last_time_s:.3f} s"
        if not self.go_on_when_damaged or self.decoded_frames == 0:
            raise self._damaged(reason, good)
        self.findings = (*self.findings, finding("video_damaged", name=self.path.name, reason=reason, good=good))

    def _damaged(self, reason: str, good: str) -> InputError:
        return InputError(
            f"{self.path.name} is damaged or truncated ({reason})",
            got=good,
            remedy="copy the file again, or set damaged_video: true for this run to go on with the good part",
        )


class _Ratio(Protocol):
    """A time base or frame rate: of PyAV before 19 a fraction, from then on its own type."""

    @property
    def numerator(self) -> int: ...
    @property
    def denominator(self) -> int: ...


def fraction(ratio: _Ratio | None) -> Fraction:
    """A time base or frame rate as a fraction; zero where the file does not say."""
    return Fraction(0) if ratio is None else Fraction(ratio.numerator, ratio.denominator)


def _seconds(pts: int, time_base: _Ratio | None) -> float:
    """A time in units of a time base in seconds, with one rounding: numerator and denominator are exact."""
    base = fraction(time_base)
    return pts * base.numerator / base.denominator


def shown(container: av.container.InputContainer) -> av.VideoStream:
    """The video track that players show: not a cover picture, a preview or a second camera. There is one."""
    best = container.streams.best("video")
    return best if isinstance(best, av.VideoStream) else container.streams.video[0]


def _header(container: av.container.InputContainer) -> VideoHeader:
    stream = shown(container)
    sound = next(iter(container.streams.audio), None)
    context, base, nan = stream.codec_context, fraction(stream.time_base), float("nan")
    begin = (stream.start_time or 0) * base
    return VideoHeader(
        resolution_px=(context.width, context.height),
        frames=stream.frames or None,
        end_s=float(begin + stream.duration * base) if stream.duration else nan,
        rate_hz=float(stream.average_rate) if stream.average_rate else nan,
        length_s=float(stream.duration * base) if stream.duration else nan,
        sound_s=nan if sound is None else _end_s(sound) - float(begin),
    )


def _end_s(stream: av.AudioStream) -> float:
    """When a stream ends [s], NaN where the header does not say."""
    if not stream.duration:
        return float("nan")
    return float(((stream.start_time or 0) + stream.duration) * fraction(stream.time_base))


def luma_plane(frame: av.VideoFrame) -> Luma:
    """The Y plane of a frame (height, width) uint8, a view of the decoder's memory where the format allows it.

    Deeper formats are cut to their eight highest bits; formats without a Y plane (RGB, packed YUV) or with one of
    floating-point numbers are converted.
    """
    name, depth = frame.format.name, frame.format.components[0].bits
    if not name.startswith(("yuv", "nv", "p0", "gray")) or depth > _DEEPEST_BITS:
        return np.asarray(frame.to_ndarray(format="gray"), dtype=np.uint8)
    plane = frame.planes[0]
    memory = memoryview(plane)
    if depth == 8:
        bright: Luma = np.frombuffer(memory, dtype=np.uint8).reshape(-1, plane.line_size)
        return bright[: frame.height, : frame.width]
    rows = np.frombuffer(memory, dtype=">u2" if name.endswith("be") else "<u2").reshape(-1, plane.line_size // 2)
    # The p0xx formats keep their bits at the top of the word, all others at the bottom.
    shift = 8 if name.startswith("p0") else depth - 8
    return np.asarray(rows[: frame.height, : frame.width] >> shift, dtype=np.uint8)


def upright(luma: Luma, rotation_deg: float) -> Luma:
    """The picture turned counter-clockwise by a container's rotation, in quarter turns [deg]."""
    turns = round(rotation_deg / _QUARTER_TURN_DEG) % _FULL_TURN
    return np.rot90(luma, turns) if turns else luma
