"""MCAP files of profile ``ros2``: messages on topics, details as an attachment, provenance as metadata.

Written whole or not at all, byte-identical for identical content; read with every checksum verified.
"""

import json
import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.serde import SerdeError
from zstandard import ZstdError

import towval
from towval.io.atomic import replacing
from towval.io.ros import TYPESTORE
from towval.model.errors import InputError

_DETAILS = "details.json"
_PROVENANCE = "provenance"
_DAMAGE = (McapError, SerdeError, ZstdError, KeyError, ValueError, EOFError, IndexError, MemoryError, struct.error)
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


def write_mcap(path: Path, messages: Iterable[Message], details: dict[str, Any], provenance: dict[str, str]) -> None:
    """Write an MCAP file.

    Parameters
    ----------
    path : Path
        Where to. An existing file is replaced when the new one is whole.
    messages : iterable of Message
        In any order; they are stored in the order of their times.
    details : dict
        What fits no message, JSON-able; kept as the attachment ``details.json``.
    provenance : dict
        Versions, configuration, hashes: texts; kept as the metadata record ``provenance``.
    """
    ordered = sorted(messages, key=lambda message: message.time_ns)
    start = ordered[0].time_ns if ordered else 0
    with replacing(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library=f"towval {towval.__version__}")
        channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        sequence: defaultdict[str, int] = defaultdict(int)
        for message in ordered:
            kind = message.value.__msgtype__
            if kind not in schemas:
                text, _ = TYPESTORE.generate_msgdef(kind, ros_version=2)
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
                data=bytes(TYPESTORE.serialize_cdr(message.value, kind)),
            )
            sequence[message.topic] += 1
        writer.add_attachment(start, start, _DETAILS, "application/json", json.dumps(details, sort_keys=True).encode())
        writer.add_metadata(_PROVENANCE, {key: provenance[key] for key in sorted(provenance)})
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped


def read_provenance(path: Path) -> dict[str, str]:
    """The provenance of an MCAP file alone, without reading its messages; as :func:`read_mcap` raises."""
    with _readable(path) as stream:
        records = make_reader(stream).iter_metadata()
        return next((dict(record.metadata) for record in records if record.name == _PROVENANCE), {})


def read_details(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Details and provenance of an MCAP file alone, without reading its messages; as :func:`read_mcap` raises."""
    with _readable(path) as stream:
        reader = make_reader(stream)
        attached = {record.name: record.data for record in reader.iter_attachments()}
        recorded = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
        return json.loads(attached.get(_DETAILS, b"{}")), recorded.get(_PROVENANCE, {})


def read_mcap(path: Path, without: tuple[str, ...] = ()) -> McapContent:
    """Read an MCAP file, verifying its checksums; topics that end in one of ``without`` are not decoded.

    Raises `InputError` when the file is missing, damaged, or holds a message of a type that is not ROS 2's.
    """
    topics: dict[str, list[Message]] = defaultdict(list)
    details: dict[str, Any] = {}
    provenance: dict[str, str] = {}
    with _readable(path) as stream:
        reader = make_reader(stream, validate_crcs=True)
        # Sorting below takes a fraction of the time of mcap's own queue.
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if schema is None:
                raise McapError(f"the channel {channel.topic} has no schema")
            if channel.topic.endswith(without):
                continue
            value = TYPESTORE.deserialize_cdr(message.data, schema.name)
            topics[channel.topic].append(Message(channel.topic, message.log_time, value))
        for attachment in reader.iter_attachments():
            if attachment.name == _DETAILS:
                details = json.loads(attachment.data)
        for record in reader.iter_metadata():
            if record.name == _PROVENANCE:
                provenance = dict(record.metadata)
    ordered = {topic: sorted(messages, key=attrgetter("time_ns")) for topic, messages in topics.items()}
    return McapContent(ordered, details, provenance)


@contextmanager
def _readable(path: Path) -> Iterator[BinaryIO]:
    """The open file; what goes wrong while it is read becomes an error of the input."""
    try:
        with Path(path).open("rb") as stream:
            yield stream
    except FileNotFoundError:
        raise InputError(f"{path} is missing", remedy="run the stage that makes it") from None
    except _DAMAGE as error:
        raise InputError(
            f"{path} cannot be read as MCAP",
            got=f"{type(error).__name__}: {error}",
            allowed="an undamaged MCAP file of profile ros2",
            remedy="delete it and run the stage that makes it again",
        ) from None
