"""Whether a video file was cut off, where FFmpeg takes it for one that ends there: Matroska, WebM and MPEG-TS."""

from pathlib import Path

_EBML, _SEGMENT = 0x1A45DFA3, 0x18538067
"""Identifiers of Matroska's header and of the element that holds everything else."""

_LONGEST_HEAD = 12
"""Bytes of an identifier and a length."""

_SYNC = 0x47
_PACKETS = ((188, 0), (192, 4), (204, 0))
"""Bytes of a packet of a transport stream, and where its sync byte stands: broadcast, AVCHD, with error correction."""


def is_cut_off(path: Path) -> bool:
    """Whether the file ends before its own structure does.

    A Matroska file says how many bytes it holds, unless its recorder was stopped hard; a transport stream is made of
    whole packets. False where it cannot be told, and for files of other kinds, whose headers FFmpeg obeys.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        begin = stream.read(2 * max(length for length, _ in _PACKETS))
        for length, at in _PACKETS:
            if len(begin) > at + length and begin[at] == begin[at + length] == _SYNC:
                return size % length != 0
        end = 0
        for identifier in (_EBML, _SEGMENT):
            stream.seek(end)
            head = stream.read(_LONGEST_HEAD)
            if len(head) < _LONGEST_HEAD or int.from_bytes(head[:4], "big") != identifier or not head[4]:
                return False
            # The leading zero bits of a length tell how many bytes follow its first; all other bits set: not known.
            width = 9 - head[4].bit_length()
            most = (1 << 7 * width) - 1
            length = int.from_bytes(head[4 : 4 + width], "big") & most
            if length == most:
                return False
            end += 4 + width + length
    return end > size
