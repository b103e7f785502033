"""MCAP files of profile ``ros2``: messages on topics, details as an attachment, provenance as metadata.

Written whole or not at all, byte-identical for identical content. Every byte of our own files is covered by a checksum,
and every checksum is verified before anything of a file is used.
"""

import heapq
import json
import math
import shlex
import struct
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from mcap import records
from mcap.exceptions import McapError
from mcap.writer import Writer
from rosbags.serde import SerdeError
from zstandard import ZstdError

import towval
from towval.io.atomic import check_plain, not_ours, replacing
from towval.io.mcap_records import MAGIC, MOST_BYTES, OWN_LIBRARY, checked_records
from towval.io.reading import is_plain_file, read_bytes
from towval.io.ros import typestore
from towval.model.errors import InputError

_DETAILS = "details.json"
_PROVENANCE = "provenance"
_STAGE = "stage"
_LONGEST_HEADER = 64
_DAMAGE = (
    McapError, SerdeError, ZstdError, ArithmeticError, AttributeError, EOFError, LookupError, MemoryError,
    RecursionError, TypeError, ValueError, struct.error,
)  # fmt: skip
"""What the readers of records, chunks and messages raise over bytes that are not what they should be."""


@dataclass(frozen=True)
class Message:
    """One message: topic, time [ns] and the ROS message itself."""

    topic: str
    time_ns: int
    value: Any


@dataclass(frozen=True)
class McapContent:
    """What an MCAP file holds: messages by topic in the order of time, the details and the provenance."""

    topics: dict[str, list[Message]]
    details: dict[str, Any]
    provenance: dict[str, str]

    def values(self, topic: str) -> list[Any]:
        """Messages of a topic, without their times; empty where the topic is not there."""
        return [message.value for message in self.topics.get(topic, [])]

    def times_s(self, topic: str) -> np.ndarray:
        """Times of a topic's messages (n,) [s]."""
        return np.array([message.time_ns for message in self.topics.get(topic, [])], dtype=np.float64) / 1e9


def write_mcap(
    path: Path,
    messages: Iterable[Message],
    details: dict[str, Any],
    provenance: dict[str, str],
    *,
    in_order: Iterable[Message] = (),
) -> None:
    """Write an MCAP file; an existing one is replaced when the new one is whole.

    Messages are stored in the order of their times. ``details``, what fits no message, is kept as the attachment
    ``details.json``, arrays as lists and numbers that are not finite as null; ``provenance``, versions, configuration
    and hashes as texts, as the metadata record of that name. ``in_order``: further messages, more than fit into memory,
    in the order of their times.
    """
    ordered = sorted(messages, key=attrgetter("time_ns"))
    start = ordered[0].time_ns if ordered else 0
    check_replaceable(path, provenance.get(_STAGE, ""))
    with replacing(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, enable_data_crcs=True)
        writer.start(profile="ros2", library=f"{OWN_LIBRARY}{towval.__version__}")
        channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        sequence: defaultdict[str, int] = defaultdict(int)
        for message in heapq.merge(ordered, in_order, key=attrgetter("time_ns")):
            kind = message.value.__msgtype__
            if kind not in schemas:
                text, _ = typestore().generate_msgdef(kind, ros_version=2)
                schemas[kind] = writer.register_schema(name=kind, encoding="ros2msg", data=text.encode())
            if message.topic not in channels:
                channels[message.topic] = writer.register_channel(
                    topic=message.topic,
                    message_encoding="cdr",
                    schema_id=schemas[kind],
                    metadata={"offered_qos_profiles": ""},
                )
            writer.add_message(
                channel_id=channels[message.topic],
                log_time=message.time_ns,
                publish_time=message.time_ns,
                sequence=sequence[message.topic],
                data=bytes(typestore().serialize_cdr(message.value, kind)),
            )
            sequence[message.topic] += 1
        # The order counts: of inputs that explain an error the first is blamed, and columns go by their names.
        text = json.dumps(json_value(details))
        writer.add_attachment(start, start, _DETAILS, "application/json", text.encode())
        writer.add_metadata(_PROVENANCE, {key: provenance[key] for key in sorted(provenance)})
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped


def json_value(value: Any) -> Any:
    """A JSON value, of an array lists: NaN and infinity, which JSON does not know, become null.

    Examples
    --------
    >>> json_value({"std": np.array([0.5, np.nan])})
    {'std': [0.5, None]}
    """
    if isinstance(value, dict):
        return {name: json_value(item) for name, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [json_value(item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def is_own(path: Path) -> bool:
    """Whether a file begins as an MCAP file of ours, damaged or not."""
    with path.open("rb") as stream:
        begin = stream.read(_LONGEST_HEADER)
    return begin.startswith(MAGIC) and OWN_LIBRARY.encode() in begin


def check_replaceable(path: Path, stage: str) -> None:
    """Refuse to write a result over anything but an earlier result of the same stage or a damaged result of any.

    What a stage reads was made by another stage, or is no result at all: no call destroys its own input.

    Raises `InputError`; nothing is checked where there is no file.
    """
    check_plain(path)
    if not is_plain_file(path):
        return
    if not is_own(path):
        raise not_ours(path)
    try:
        found = read_provenance(path).get(_STAGE, "")
    except InputError:
        return  # ours, but damaged: nothing is lost
    if found != stage:
        made_by = f"the stage {found}" if found else "hand, or an older version"
        raise InputError(
            f"{path} is not replaced",
            got=f"a result of {made_by}, where the stage {stage or '(none)'} writes",
            remedy="choose another name, or delete it yourself",
        )


def read_provenance(path: Path) -> dict[str, str]:
    """The provenance of an MCAP file alone, without decoding its messages; as :func:`read_mcap` raises."""
    return read_details(path)[1]


def read_details(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Details and provenance of an MCAP file alone, without decoding its messages; as :func:`read_mcap` raises."""
    content = read_mcap(path, messages=False)
    return content.details, content.provenance


def read_mcap(
    path: Path, without: tuple[str, ...] = (), *, only: Collection[str] | None = None, messages: bool = True
) -> McapContent:
    """Read an MCAP file, verifying its checksums; topics that end in one of ``without`` are not decoded.

    Of a recording of somebody else's ``only`` some topics may be of types that are known here; the others are listed
    without messages. Without ``messages`` none is read, and no chunk unpacked.

    Raises `InputError` when the file is missing, damaged, too large for its kind, or holds a message, of the topics
    that are decoded, of a type that is not ROS 2's.
    """
    topics: dict[str, list[Message]] = defaultdict(list)
    details: dict[str, Any] = {}
    provenance: dict[str, str] = {}
    names: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    data = read_bytes(path, MOST_BYTES, _REMEDY)
    _check_no_other_bag(path, data)
    with _damage_reported(path):
        for record in checked_records(data, messages=messages):
            if isinstance(record, records.Message):
                topic, kind = channels[record.channel_id]
                if topic.endswith(without):
                    continue
                if only is not None and topic not in only:
                    topics[topic] = []
                    continue
                topics[topic].append(Message(topic, record.log_time, typestore().deserialize_cdr(record.data, kind)))
            elif isinstance(record, records.Schema):
                names[record.id] = record.name
            elif isinstance(record, records.Channel):
                channels[record.id] = record.topic, names.get(record.schema_id, "")
            elif isinstance(record, records.Attachment) and record.name == _DETAILS:
                details = dict(json.loads(record.data))
            elif isinstance(record, records.Metadata) and record.name == _PROVENANCE:
                provenance = record.metadata
    ordered = {topic: sorted(messages, key=attrgetter("time_ns")) for topic, messages in topics.items()}
    return McapContent(ordered, details, provenance)


_REMEDY = "run the stage that makes it"
_OTHER_BAGS = {b"SQLite format 3": "SQLite, as ROS 2 records it in a folder", b"#ROSBAG": "a bag of ROS 1"}


def _check_no_other_bag(path: Path, data: bytes) -> None:
    """Refuse recordings of ROS in its other formats, which no stage makes again."""
    for begin, kind in _OTHER_BAGS.items():
        if data.startswith(begin):
            source = path if kind.endswith("1") else path.parent
            convert = f"rosbags-convert --src {shlex.quote(str(source))} --dst NEW_FOLDER --dst-storage mcap"
            raise InputError(f"{path} is no MCAP file", got=kind, remedy=f"convert it: {convert}")


@contextmanager
def _damage_reported(path: Path) -> Iterator[None]:
    """Turn what goes wrong while a file is read into an `InputError`."""
    try:
        yield
    except _DAMAGE as error:
        raise InputError(
            f"{path} cannot be read as MCAP",
            got=f"{type(error).__name__}: {error}"[:300],
            allowed="an undamaged MCAP file of profile ros2",
            remedy="run the stage that makes it again",
        ) from None
