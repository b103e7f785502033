"""The records of an MCAP file, each checked before any is used, within bounds on size and memory.

Every byte of our own files is covered: the data section by the checksum of its end record, which the footer's checksum
does not reach, the summary by the footer's, chunks and attachments by their own. Files of others may leave checksums
out; those that are there are verified.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from zstandard import ZstdDecompressor

MAGIC = b"\x89MCAP0\r\n"
OWN_LIBRARY = "towval "
"""How the library's name begins in the header of our own files."""

MOST_BYTES = 4 * 2**30
"""Of a file: an hour of two tracked bodies with all their features, four times over."""

MOST_GROWTH = 64
"""Bytes of all chunks, uncompressed, per byte of the file; our files: 2 to 12."""

ALWAYS_ALLOWED = 16 * 2**20
"""Bytes of chunks, uncompressed, that any file may hold, however small it is."""

_MOST_WINDOW = 128 * 2**20
_HEAD = struct.Struct("<BQ")
_CRC = struct.Struct("<I")
_KINDS = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
    Opcode.CHUNK: Chunk,
}


def checked_records(data: bytes, *, messages: bool = True) -> Iterator[McapRecord]:
    """Header, schemas, channels, attachments and metadata of the data section, and with ``messages`` its messages.

    Raises `mcap.exceptions.McapError` and what reading of damaged bytes raises, before the first record where the
    file as a whole is damaged.
    """
    places = _places(data)
    _verify(data, places)
    allowed = max(ALWAYS_ALLOWED, MOST_GROWTH * len(data))
    for opcode, start, end in places:
        if opcode == Opcode.DATA_END:
            return
        stream = ReadDataStream(BytesIO(data[start:end]))
        if opcode == Opcode.MESSAGE:
            if messages:
                yield Message.read(stream, end - start)
        elif opcode in _KINDS:
            record = _KINDS[Opcode(opcode)].read(stream)  # type: ignore[attr-defined]  # every kind of record has it
            if not isinstance(record, Chunk):
                yield record
                continue
            if not messages:
                continue
            allowed -= record.uncompressed_size
            if allowed < 0:
                raise McapError("its chunks hold more than a file of its size may")
            yield from breakup_chunk(_uncompressed(record), validate_crc=True)


def _places(data: bytes) -> list[tuple[int, int, int]]:
    """Opcode, first and last byte + 1 of the content of every record from the first to the footer."""
    if not data.startswith(MAGIC):
        raise McapError("it does not begin as MCAP does")
    if len(data) < 2 * len(MAGIC) or not data.endswith(MAGIC):
        raise McapError("it is cut off: the end mark is missing")
    places, at, last = [], len(MAGIC), len(data) - len(MAGIC)
    while at < last:
        if at + _HEAD.size > last:
            raise McapError("a record is cut off")
        opcode, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size + length
        if at > last:
            raise McapError("a record is longer than the file")
        places.append((opcode, at - length, at))
    return places


def _verify(data: bytes, places: list[tuple[int, int, int]]) -> None:
    """Order of the outer records, and all checksums but those of chunks, which their readers verify."""
    ends = [place for place in places if place[0] == Opcode.DATA_END]
    if not places or places[0][0] != Opcode.HEADER or places[-1][0] != Opcode.FOOTER or len(ends) != 1:
        raise McapError("header, end of the data or footer are not where they belong")
    own = Header.read(ReadDataStream(BytesIO(data[places[0][1] : places[0][2]]))).library.startswith(OWN_LIBRARY)
    (_, start, end), (_, footer_start, footer_end) = ends[0], places[-1]
    stated = DataEnd.read(ReadDataStream(BytesIO(data[start:end]))).data_section_crc
    if (stated or own) and stated != zlib.crc32(memoryview(data)[: start - _HEAD.size]):
        raise McapError("the checksum of the data is wrong")
    footer = Footer.read(ReadDataStream(BytesIO(data[footer_start:footer_end])))
    summary = memoryview(data)[end : footer_end - _CRC.size]
    if (footer.summary_crc or own) and footer.summary_crc != zlib.crc32(summary):
        raise McapError("the checksum of the summary is wrong")
    for opcode, start, end in places:
        if opcode == Opcode.ATTACHMENT:
            (stated,) = _CRC.unpack_from(data, end - _CRC.size)
            if (stated or own) and stated != zlib.crc32(memoryview(data)[start : end - _CRC.size]):
                raise McapError("the checksum of an attachment is wrong")


def _uncompressed(chunk: Chunk) -> Chunk:
    """The same chunk without compression; never more than it says, which the caller has bounded."""
    if chunk.compression == "zstd":
        reader = ZstdDecompressor(max_window_size=_MOST_WINDOW).stream_reader(chunk.data)
        data = reader.read(chunk.uncompressed_size + 1)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise McapError(f"its compression {chunk.compression[:20]!r} is not read; write it with zstd")
    if len(data) != chunk.uncompressed_size:
        raise McapError("a chunk is not as long as it says")
    return Chunk("", data, chunk.message_end_time, chunk.message_start_time, chunk.uncompressed_crc, len(data))
