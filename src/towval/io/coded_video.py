"""Pictures of a video as they are stored, for viewers that decode them themselves."""

from collections.abc import Iterator

import av
import numpy as np

from towval.io.video import Video, shown
from towval.model import Array

_PASSED_ON = {"h264": ("h264", "h264_mp4toannexb"), "hevc": ("h265", "hevc_mp4toannexb")}
"""Names of codings in ROS messages, and FFmpeg's filters that put the parameter sets before each keyframe."""


class CodedVideo:
    """The stored pictures of an MP4, MOV or Matroska file of H.264 or H.265, as an iterable of their bytes.

    ``coding`` is its name in ROS messages, ``time_s`` (n,) are the presentation times [s]. The bytes of a picture are
    an access unit in Annex B form, with the parameter sets before each keyframe.
    """

    def __init__(self, video: Video, coding: str, time_s: Array):
        self.video, self.coding, self.time_s = video, coding, time_s

    def __iter__(self) -> Iterator[bytes]:
        with self.video.opened() as film:
            stream = shown(film)
            annex_b = av.BitStreamFilterContext(_PASSED_ON[stream.codec_context.name][1], stream)
            for packet in film.demux(stream):
                if packet.size:
                    yield from (bytes(each) for each in annex_b.filter(packet))


def coded_video(video: Video) -> CodedVideo | None:
    """A video whose pictures viewers take one by one; None where they would show it wrongly or not at all.

    They take H.264 and H.265 whose pictures are coded in the order in which they are shown (no B frames), from a
    keyframe on, turned as they are stored, and with nothing cut off.
    """
    try:
        with video.opened() as film:
            stream = shown(film)
            context, base = stream.codec_context, stream.time_base
            # A configuration record begins with its version; a stream that has none is in Annex B form already.
            stored = context.name in _PASSED_ON and (context.extradata or b"")[:1] == b"\x01"
            # Times may be stored in coding order although pictures are coded out of it: some writers of MP4 do that.
            if not stored or base is None or context.has_b_frames:
                return None
            packets = [(p.pts, p.is_keyframe, p.is_discard, p.is_corrupt) for p in film.demux(stream) if p.size]
            as_stored = (video.tagged_turns() + video.quarter_turns) % 4 == 0
    except (av.FFmpegError, LookupError, StopIteration):
        return None
    pts = [each[0] for each in packets]
    if not as_stored or None in pts or not packets[0][1] or any(discard or corrupt for *_, discard, corrupt in packets):
        return None
    time_s = np.array([float(each * base) for each in pts if each is not None])
    return CodedVideo(video, _PASSED_ON[context.name][0], time_s) if (np.diff(time_s) > 0).all() else None
