"""One MCAP file, intact or damaged, as spans of messages that are loaded one at a time.

An intact file is opened by the index at its end. If the index is missing or damaged, the file is scanned from its
beginning to its end or to the damage, and the index is rebuilt. Reading is the same in both cases.
"""

import os
import struct
import sys
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, cast

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from socialcircle_ros.errors import RecordingError

from .topics import Message, Topic

_HEAD = struct.Struct('<BQ')  # the start of every record: opcode, length of the body
_MESSAGE = struct.Struct('<HIQQ')  # the start of a message's body: channel, sequence, log time, publish time
_FOOTER = struct.Struct('<BQQQI')  # opcode, length, summary start, summary offset start, CRC
_CONTENT = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
_RUN_LENGTH = 1 << 20  # messages outside of chunks are joined to spans of about this many bytes


class Damage(Exception):  # noqa: N818 - a finding, not an error of the program
    """A part of the file is damaged; the message says how this shows."""


_CUT_OFF = 'the recording was cut off'
_TOO_LONG = 'a record is longer than its chunk or file'
_NO_TOPIC = 'a message belongs to no topic'

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


@dataclass
class _Index:
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    message_count: int = 0
    damage: str | None = None

    def take(self, opcode: int, body: memoryview) -> tuple[int, int] | None:
        """Take a record into the index.

        Returns:
            The log time and the channel of a message; None for another record.

        Raises:
            Damage: the message belongs to no channel.
        """
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = _MESSAGE.unpack_from(body)
            if channel not in self.channels:
                raise Damage(_NO_TOPIC)
            self.message_count += 1
            return log_time, channel
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(body))
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            record = Channel.read(_stream(body))
            self.channels[record.id] = record
        return None


class McapFile:
    """An opened MCAP file.

    Attributes:
        path: of the file.
        channels: the topics by the numbers of their channels, by which messages refer to them.
        spans: in the order of the file.
        message_count: the number of messages; in a damaged file, those before the damage.
        damage: one sentence if damage was found on opening, else None.
    """

    def __init__(self, path: Path) -> None:
        """Open the file and read or rebuild its index.

        Raises:
            RecordingError: the file cannot be opened, or is not an MCAP file.
        """
        self.path = path
        self._file = _open(path)
        try:
            self._size = os.fstat(self._file.fileno()).st_size
            self._check_magic()
            index = self._index()
        except BaseException:
            self._file.close()
            raise
        self.channels = {number: _topic(channel, index.schemas) for number, channel in index.channels.items()}
        self.spans = index.spans
        self.message_count = index.message_count
        self.damage = index.damage

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, span: Span) -> Iterator[Message]:
        """Load a span, and yield its messages in the order of the file.

        Raises:
            One of `DAMAGE`: the rest of the span cannot be read.
        """
        for opcode, body in self._records(span.offset, span.length):
            if opcode == Opcode.MESSAGE:
                channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
                if channel not in self.channels:
                    raise Damage(_NO_TOPIC)
                data = bytes(body[_MESSAGE.size :])
                yield Message(self.channels[channel].name, data, log_time, publish_time, sequence)

    def damage_sentence(self, offset: int, reason: BaseException) -> str:
        """One sentence: where the file is damaged, how this shows, and what is read."""
        why = str(reason) if isinstance(reason, Damage) else 'its bytes are invalid'
        return (
            f'{self.path} is damaged after byte {offset} of {self._size} ({why}): the messages before the '
            'damage are read, those after it are lost.'
        )

    def _check_magic(self) -> None:
        start = self._file.read(16)
        if not start:
            raise RecordingError(
                f'{self.path} is empty: the recorder ended before it wrote a message; record again.'
            )
        if start.startswith(b'SQLite format'):
            raise RecordingError(
                f'{self.path} is an sqlite3 bag: convert it to MCAP with `ros2 bag convert`, and use the result.'
            )
        if not start.startswith(MCAP0_MAGIC):
            raise RecordingError(
                f'{self.path} is not an MCAP file: give a .mcap file or a rosbag2 directory with one.'
            )

    def _index(self) -> _Index:
        try:
            index = self._index_from_summary()
        except DAMAGE:
            index = self._index_from_scan()
            index.damage = index.damage or (
                f'{self.path} has a damaged or cut-off index, but its data is complete: all messages are read.'
            )
        return index or self._index_from_scan()

    def _index_from_summary(self) -> _Index | None:
        """Read the index at the end of the file; None if the file has no index, or an incomplete one."""
        end = self._size - len(MCAP0_MAGIC) - _FOOTER.size
        tail = self._read(end, self._size)
        opcode, length, start, _, crc = _FOOTER.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size or not tail.endswith(MCAP0_MAGIC):
            raise Damage('the footer is missing')
        if start == 0:
            return None
        summary = self._read(start, end)
        if crc and crc != zlib.crc32(tail[: _FOOTER.size - 4], zlib.crc32(summary)):
            raise Damage('the checksum of the index does not match')
        index = _Index()
        chunks: list[ChunkIndex] = []
        statistics: Statistics | None = None
        for opcode, body in _split(summary):
            if opcode == Opcode.CHUNK_INDEX:
                chunks.append(ChunkIndex.read(_stream(body)))
            elif opcode == Opcode.STATISTICS:
                statistics = Statistics.read(_stream(body))
            else:
                index.take(opcode, body)
        if statistics is None or len(index.channels) < statistics.channel_count:
            return None
        if len(chunks) != statistics.chunk_count or (statistics.message_count and not chunks):
            return None
        for chunk in sorted(chunks, key=lambda chunk: chunk.chunk_start_offset):
            head = self._read(chunk.chunk_start_offset, chunk.chunk_start_offset + _HEAD.size)
            if _HEAD.unpack(head) != (Opcode.CHUNK, chunk.chunk_length - _HEAD.size):
                raise Damage('the index does not match the data')
            index.spans.append(
                Span(
                    chunk.message_start_time,
                    chunk.message_end_time,
                    chunk.chunk_start_offset,
                    chunk.chunk_length,
                    frozenset(chunk.message_index_offsets) or None,
                )
            )
        index.message_count = statistics.message_count
        return index

    def _index_from_scan(self) -> _Index:
        """Rebuild the index: read the file to its end or to the damage."""
        index = _Index()
        offset = len(MCAP0_MAGIC)
        opcode = 0
        joinable = False  # whether the last span is a run of messages outside of chunks that ends at `offset`
        try:
            while opcode != Opcode.DATA_END:
                opcode, length = _HEAD.unpack(self._read(offset, offset + _HEAD.size))
                length += _HEAD.size
                if opcode == Opcode.CHUNK:
                    self._scan_chunk(index, offset, length)
                elif opcode in _CONTENT:
                    self._scan_record(index, offset, length, joinable=joinable)
                elif offset + length > self._size:
                    raise Damage(_CUT_OFF)
                joinable = opcode in _CONTENT and index.spans[-1].length < _RUN_LENGTH
                offset += length
        except DAMAGE as reason:
            index.damage = self.damage_sentence(offset, reason)
        return index

    def _scan_chunk(self, index: _Index, offset: int, length: int) -> None:
        times = []
        channels = set()
        try:
            for opcode, body in self._records(offset, length):
                if found := index.take(opcode, body):
                    times.append(found[0])
                    channels.add(found[1])
        finally:  # the messages before the damage of a chunk count
            index.spans.append(
                Span(min(times, default=0), max(times, default=0), offset, length, frozenset(channels))
            )

    def _scan_record(self, index: _Index, offset: int, length: int, *, joinable: bool) -> None:
        """Take a record outside of chunks into the index, and into the last span if that is `joinable`."""
        start_time, end_time, start, channels = sys.maxsize, 0, offset, frozenset[int]()
        for opcode, body in self._records(offset, length):
            if found := index.take(opcode, body):
                start_time, end_time, channels = found[0], found[0], frozenset([found[1]])
        if joinable:
            last = index.spans.pop()
            start_time, start = min(start_time, last.start_time), last.offset
            end_time = max(end_time, last.end_time)
            channels |= last.channels or frozenset()
        index.spans.append(Span(start_time, end_time, start, offset + length - start, channels))

    def _records(self, offset: int, length: int) -> Iterator[tuple[int, memoryview]]:
        """Yield opcode and body of each record in a chunk, or in a run of records outside of chunks."""
        if self._read(offset, offset + 1)[0] != Opcode.CHUNK:
            yield from _split(self._read(offset, offset + length))
            return
        end = min(offset + length, self._size)
        self._file.seek(offset + _HEAD.size)
        chunk = Chunk.read(ReadDataStream(cast('BinaryIO', _Clipped(self._file, end))))
        whole = offset + length <= self._size
        yield from _split(_contents(chunk, whole=whole), _TOO_LONG if whole else _CUT_OFF)
        if not whole:
            raise Damage(_CUT_OFF)

    def _read(self, start: int, end: int) -> bytes:
        if not 0 <= start <= end <= self._size:
            raise Damage(_CUT_OFF)
        self._file.seek(start)
        data = self._file.read(end - start)
        if len(data) < end - start:
            raise Damage('the file has become shorter while it was read')
        return data


class _Clipped:
    """A file that ends at `end`, so that a damaged length cannot allocate more memory than the file has bytes.

    A read may return fewer bytes than requested. `ReadDataStream` accepts this, so that the beginning of a chunk
    that is cut off is read.
    """

    def __init__(self, file: BinaryIO, end: int) -> None:
        self._file = file
        self._end = end

    def read(self, length: int) -> bytes:
        return self._file.read(max(0, min(length, self._end - self._file.tell())))


def _open(path: Path) -> BinaryIO:
    try:
        return path.open('rb')
    except FileNotFoundError:
        raise RecordingError(f'{path} does not exist: check the name of the recording.') from None
    except PermissionError:
        raise RecordingError(f'{path} may not be read: change its permissions.') from None
    except OSError as error:
        raise RecordingError(f'{path} cannot be opened: {error.strerror}.') from None


def _split(data: bytes, complaint: str = _TOO_LONG) -> Iterator[tuple[int, memoryview]]:
    """Yield opcode and body of each record in a sequence.

    Raises:
        Damage: a record goes past the end; the message is `complaint`.
    """
    view = memoryview(data)
    position = 0
    while position < len(view):
        if position + _HEAD.size > len(view):
            raise Damage(complaint)
        opcode, length = _HEAD.unpack_from(view, position)
        start = position + _HEAD.size
        position = start + length
        if position > len(view):
            raise Damage(complaint)
        yield opcode, view[start:position]


def _contents(chunk: Chunk, *, whole: bool) -> bytes:
    """Decompress a chunk; unless it must be `whole`, as much of it as there is.

    Raises:
        Damage: the compression is unknown, or the length or checksum of a whole chunk does not match.
    """
    if chunk.compression == 'lz4':
        data = bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data))
    elif chunk.compression == 'zstd':
        data = zstandard.ZstdDecompressor().decompressobj().decompress(chunk.data)
    elif chunk.compression == '':
        data = chunk.data
    else:
        raise Damage(f'a chunk has the unknown compression {chunk.compression!r}')
    if whole and len(data) != chunk.uncompressed_size:
        raise Damage('the length of a chunk does not match')
    if whole and chunk.uncompressed_crc and chunk.uncompressed_crc != zlib.crc32(data):
        raise Damage('the checksum of a chunk does not match')
    return data


def _stream(body: memoryview) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))


def _topic(channel: Channel, schemas: dict[int, Schema]) -> Topic:
    schema = schemas.get(channel.schema_id, Schema(id=0, name='', encoding='', data=b''))
    return Topic(
        name=channel.topic,
        type=schema.name,
        schema=schema.data,
        schema_encoding=schema.encoding,
        encoding=channel.message_encoding,
        metadata=channel.metadata,
    )
