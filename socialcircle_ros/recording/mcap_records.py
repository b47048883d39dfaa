# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file: their heads, the contents of chunks, and what an index holds."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

from .compression import ExpansionError, expand
from .topics import Topic

HEAD = struct.Struct('<BQ')  # the start of every record: opcode, length of the body
MESSAGE = struct.Struct('<HIQQ')  # the start of a message's body: channel, sequence, log time, publish time
CHUNK = struct.Struct('<QQQII')  # the start of a chunk's body: times, size, CRC, length of the compression's name
LENGTH = struct.Struct('<Q')  # of a chunk's records as they are stored
FOOTER = struct.Struct('<BQQQI')  # opcode, length, summary start, summary offset start, CRC
CONTENT = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
EXTRAS = frozenset({Opcode.ATTACHMENT, Opcode.METADATA})
COMPRESSIONS = frozenset({'', 'lz4', 'zstd'})

CUT_OFF = 'the recording was cut off'
TOO_LONG = 'a record is longer than its chunk or file'
NO_TOPIC = 'a message belongs to no topic'


class Damage(Exception):  # noqa: N818 - a finding, not an error of the program
    """A part of the file is damaged; the message says how this shows."""


# Raised while damaged bytes are read: by the checks here, the disk, the parsers and the decompressors.
DAMAGE = (
    Damage,
    OSError,
    EOFError,
    MemoryError,
    OverflowError,
    RuntimeError,
    ValueError,
    struct.error,
    McapError,
    zstandard.ZstdError,
)


class Span(NamedTuple):
    """A chunk, or a run of messages outside of chunks. A span is loaded at once.

    Attributes:
        start_time: the earliest log time, ns.
        end_time: the latest log time, ns.
        offset: of the first byte in the file.
        length: in bytes.
        channels: the numbers of the channels that occur in it; None if they are not known.
    """

    start_time: int
    end_time: int
    offset: int
    length: int
    channels: frozenset[int] | None


class Extra(NamedTuple):
    """An attachment or a metadata record in the file."""

    opcode: int
    offset: int
    length: int


@dataclass
class Index:
    """What is known of a file after it was opened."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    extras: list[Extra] = field(default_factory=list)
    message_count: int = 0
    message_counts: dict[int, int] = field(default_factory=dict)
    damage: str | None = None

    def take(self, opcode: int, body: memoryview) -> tuple[int, int] | None:
        """Take a record into the index.

        Returns:
            The log time and the channel of a message; None for another record.

        Raises:
            Damage: the message belongs to no channel, or the number of a channel has two meanings.
        """
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = MESSAGE.unpack_from(body)
            if channel not in self.channels:
                raise Damage(NO_TOPIC)
            self.message_count += 1
            self.message_counts[channel] = self.message_counts.get(channel, 0) + 1
            return log_time, channel
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream(body))
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            record = Channel.read(stream(body))
            known = self.channels.setdefault(record.id, record)
            if (known.topic, known.schema_id) != (record.topic, record.schema_id):
                raise Damage('the number of a topic has two meanings')
        return None

    def names_all_schemas(self) -> bool:
        """Whether the schema of each channel is known."""
        return all(channel.schema_id in self.schemas for channel in self.channels.values() if channel.schema_id)


def split(data: bytes, complaint: str = TOO_LONG) -> Iterator[tuple[int, memoryview]]:
    """Yield opcode and body of each record in a sequence.

    Raises:
        Damage: a record goes past the end; the message is `complaint`.
    """
    view = memoryview(data)
    position = 0
    while position < len(view):
        if position + HEAD.size > len(view):
            raise Damage(complaint)
        opcode, length = HEAD.unpack_from(view, position)
        start = position + HEAD.size
        position = start + length
        if position > len(view):
            raise Damage(complaint)
        yield opcode, view[start:position]


def contents(chunk: Chunk, *, whole: bool) -> bytes:
    """Decompress a chunk; unless it must be `whole`, as much of it as there is.

    Raises:
        Damage: the compression is unknown, the chunk is too large, or the length or checksum of a whole chunk does
            not match.
    """
    if chunk.compression not in COMPRESSIONS:
        raise Damage(unknown_compression(chunk.compression))
    data = chunk.data
    if chunk.compression:
        try:
            data = expand(chunk.data, chunk.compression, chunk.uncompressed_size)
        except ExpansionError as error:
            raise Damage(f'a chunk {error}') from None
    if (whole or len(data) > chunk.uncompressed_size) and len(data) != chunk.uncompressed_size:
        raise Damage('the length of a chunk does not match')
    if whole and chunk.uncompressed_crc and chunk.uncompressed_crc != zlib.crc32(data):
        raise Damage('the checksum of a chunk does not match')
    return data


def unknown_compression(name: str) -> str:
    """How a compression that is none of MCAP's shows."""
    return f'a chunk has the unknown compression {name[:40]!r}'


def stream(body: memoryview) -> ReadDataStream:
    """A record's body for the parsers of mcap."""
    return ReadDataStream(BytesIO(body))


def topic_of(channel: Channel, schemas: dict[int, Schema]) -> Topic:
    """The topic of a channel."""
    schema = schemas.get(channel.schema_id, Schema(id=0, name='', encoding='', data=b''))
    return Topic(
        name=channel.topic,
        type=_full_type(schema.name) if channel.message_encoding == 'cdr' else schema.name,
        schema=schema.data,
        schema_encoding=schema.encoding,
        encoding=channel.message_encoding,
        metadata=channel.metadata,
    )


def _full_type(name: str) -> str:
    """The name of a type of ROS 2; some tools leave out its `/msg/`."""
    package, slash, kind = name.partition('/')
    return f'{package}/msg/{kind}' if package and kind and slash and '/' not in kind else name
