# SPDX-License-Identifier: Apache-2.0
"""One MCAP file, intact or damaged, as spans of messages that are loaded one at a time.

An intact file is opened by the index at its end. The index is trusted whole or not at all: if it is missing,
damaged or incomplete, or does not match the data, the file is scanned from its beginning to its end or to the
damage, and the index is rebuilt. Reading is the same in both cases.
"""

import os
import sys
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, cast

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment as AttachmentRecord
from mcap.records import Chunk, ChunkIndex, Metadata, Statistics
from mcap.writer import MCAP0_MAGIC

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.formats import suffixes

from .compression import ZSTD_MAGIC, expand_file, expand_message
from .large_chunks import LARGE, StoredMessage, read_sound_chunk
from .mcap_records import (
    CHUNK,
    COMPRESSIONS,
    CONTENT,
    CUT_OFF,
    DAMAGE,
    EXTRAS,
    FOOTER,
    HEAD,
    MESSAGE,
    NO_TOPIC,
    TOO_LONG,
    Damage,
    Extra,
    Index,
    Span,
    contents,
    split,
    stream,
    topic_of,
    unknown_compression,
)
from .topics import Attachment, CheckedMessage, Message, MetadataRecord

_RUN_LENGTH = 1 << 20  # messages outside of chunks are joined to spans of about this many bytes

# How files of other formats begin, what they are, and how they become MCAP.
_FORMATS = {
    b'SQLite format': ('an sqlite3 bag', 'convert it to MCAP with `ros2 bag convert`, and use the result'),
    b'#ROSBAG V': ('a bag of ROS 1', 'convert it to MCAP with `rosbags-convert`, and use the result'),
    b'\x1f\x8b': ('compressed with gzip', 'decompress it first (`gzip -d`)'),
    b'\x04\x22\x4d\x18': ('compressed with lz4', 'decompress it first (`lz4 -d`)'),
    b'BZh': ('compressed with bzip2', 'decompress it first (`bzip2 -d`)'),
    b'\xfd7zXZ': ('compressed with xz', 'decompress it first (`xz -d`)'),
    b'PK\x03\x04': ('a zip archive', 'unpack it first'),
}


class McapFile:
    """An opened MCAP file; one that is compressed as a whole with zstd is decompressed first.

    Attributes:
        path: of the file.
        channels: the topics by the numbers of their channels, by which messages refer to them.
        names: the names under which messages of a channel are read; those of the topics, unless they are changed.
        spans: in the order of the file.
        message_count: the number of messages; in a damaged file, those before the damage.
        message_counts: the same by the numbers of channels; empty where the index does not tell them apart.
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
        self.channels = {number: topic_of(channel, index.schemas) for number, channel in index.channels.items()}
        self.names = {number: topic.name for number, topic in self.channels.items()}
        self.spans = index.spans
        self.message_count = index.message_count
        self.message_counts = index.message_counts
        self.damage = index.damage
        self._extras = index.extras

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, span: Span) -> Iterator[Message]:
        """Load a span, and yield its messages in the order of the file.

        Messages that rosbag2 compressed one by one are decompressed.

        Raises:
            One of `DAMAGE`: the rest of the span cannot be read.
        """
        for head, data, checksum in self._messages(span):
            channel, sequence, log_time, publish_time = MESSAGE.unpack(head)
            if channel not in self.channels:
                raise Damage(NO_TOPIC)
            # CDR begins with a zero byte.
            if data.startswith(ZSTD_MAGIC) and self.channels[channel].encoding == 'cdr':
                data, checksum = expand_message(data), None  # noqa: PLW2901
            message = CheckedMessage(self.names[channel], data, log_time, publish_time, sequence)
            message.checksum = checksum
            yield message

    def attachments(self) -> Iterator[Attachment]:
        """Load the attachments one at a time.

        Raises:
            One of `DAMAGE`: one cannot be read.
        """
        for extra in self._extras:
            if extra.opcode == Opcode.ATTACHMENT:
                body = self._body(extra)
                if (crc := int.from_bytes(body[-4:], 'little')) and crc != zlib.crc32(body[:-4]):
                    raise Damage('the checksum of an attachment does not match')
                found = AttachmentRecord.read(stream(body))
                yield Attachment(found.name, found.media_type, found.data, found.log_time, found.create_time)

    def metadata(self) -> Iterator[MetadataRecord]:
        """Load the metadata records, without the one in which rosbag2 describes the file itself.

        Raises:
            One of `DAMAGE`: one cannot be read.
        """
        for extra in self._extras:
            if extra.opcode == Opcode.METADATA:
                record = Metadata.read(stream(self._body(extra)))
                if record.name != 'rosbag2':
                    yield MetadataRecord(record.name, record.metadata)

    def damage_sentence(self, offset: int, reason: BaseException) -> str:
        """One sentence: where the file is damaged, how this shows, and what is read."""
        why = str(reason) if isinstance(reason, Damage) else 'its bytes are invalid'
        return (
            f'{self.path} is damaged in the record that begins at byte {offset} of {self._size} ({why}): the'
            ' messages before the damage are read, those after it are lost.'
        )

    def _check_magic(self) -> None:
        start = self._file.read(16)
        if not start:
            raise RecordingError(
                f'{self.path} is empty: the recorder ended before it wrote a message; record again.'
            )
        for magic, (kind, advice) in _FORMATS.items():
            if start.startswith(magic):
                raise RecordingError(f'{self.path} is {kind}: {advice}.')
        if not start.startswith(MCAP0_MAGIC):
            raise RecordingError(
                f'{self.path} is not an MCAP file: give a .mcap file, a rosbag2 directory with one, or a'
                f' measurement file ({", ".join(suffixes(written=False))}).'
            )

    def _index(self) -> Index:
        try:
            index = self._index_from_summary()
        except DAMAGE:
            index = self._index_from_scan()
            index.damage = index.damage or (
                f'{self.path} has a damaged or cut-off index, but its data is complete: all messages are read.'
            )
        return index or self._index_from_scan()

    def _index_from_summary(self) -> Index | None:
        """Read the index at the end of the file; None if the file has no index, or an incomplete one.

        Raises:
            One of `DAMAGE`: the index is damaged, or does not match the data.
        """
        end = self._size - len(MCAP0_MAGIC) - FOOTER.size
        tail = self._read(end, self._size)
        opcode, length, start, _, crc = FOOTER.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != FOOTER.size - HEAD.size or not tail.endswith(MCAP0_MAGIC):
            raise Damage('the footer is missing')
        if start == 0:
            return None
        summary = self._read(start, end)
        if crc and crc != zlib.crc32(tail[: FOOTER.size - 4], zlib.crc32(summary)):
            raise Damage('the checksum of the index does not match')
        index = Index()
        chunks: list[ChunkIndex] = []
        statistics: Statistics | None = None
        for opcode, body in split(summary):
            if opcode == Opcode.CHUNK_INDEX:
                chunks.append(ChunkIndex.read(stream(body)))
            elif opcode == Opcode.STATISTICS:
                statistics = Statistics.read(stream(body))
            else:
                index.take(opcode, body)
        if statistics is None or not _is_complete(index, chunks, statistics):
            return None
        index.message_count = statistics.message_count
        index.message_counts = dict(statistics.channel_message_counts)
        return index if self._matches_data(index, chunks, start) else None

    def _matches_data(self, index: Index, chunks: list[ChunkIndex], end: int) -> bool:
        """Check each chunk's head, and walk over what lies between the chunks; fills `spans` and `extras`.

        Returns:
            False if there are messages or topics that the index leaves out.

        Raises:
            One of `DAMAGE`: the index does not match the data.
        """
        offset = len(MCAP0_MAGIC)
        for chunk in sorted(chunks, key=lambda chunk: chunk.chunk_start_offset):
            if not self._walk(index, offset, chunk.chunk_start_offset):
                return False
            self._check_chunk(chunk)
            offset = chunk.chunk_start_offset + chunk.chunk_length
            index.spans.append(
                Span(
                    chunk.message_start_time,
                    chunk.message_end_time,
                    chunk.chunk_start_offset,
                    chunk.chunk_length,
                    frozenset(chunk.message_index_offsets) or None,
                )
            )
        return self._walk(index, offset, end)

    def _walk(self, index: Index, offset: int, end: int) -> bool:
        """Walk over records that are no chunks; False if one of them should be in the index."""
        while offset < end:
            opcode, length = HEAD.unpack(self._read(offset, offset + HEAD.size))
            length += HEAD.size
            if opcode == Opcode.CHUNK or opcode in CONTENT:
                return False
            if opcode in EXTRAS:
                index.extras.append(Extra(opcode, offset, length))
            offset += length
        if offset > end:
            raise Damage('the index does not match the data')
        return True

    def _check_chunk(self, chunk: ChunkIndex) -> None:
        start = chunk.chunk_start_offset
        head = self._read(start, start + HEAD.size + CHUNK.size)
        begin, end, size, _, length = CHUNK.unpack_from(head, HEAD.size)
        name = self._read(start + len(head), start + len(head) + length) if length < 100 else b''
        expected = (chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size)
        if (
            HEAD.unpack_from(head) != (Opcode.CHUNK, chunk.chunk_length - HEAD.size)
            or (begin, end, size) != expected
            or name != chunk.compression.encode()
        ):
            raise Damage('the index does not match the data')
        if chunk.compression not in COMPRESSIONS:
            raise Damage(unknown_compression(chunk.compression))

    def _index_from_scan(self) -> Index:
        """Rebuild the index: read the file to its end or to the damage."""
        index = Index()
        offset = len(MCAP0_MAGIC)
        opcode = 0
        joinable = False  # whether the last span is a run of messages outside of chunks that ends at `offset`
        try:
            while opcode != Opcode.DATA_END:
                opcode, length = HEAD.unpack(self._read(offset, offset + HEAD.size))
                length += HEAD.size
                if opcode == Opcode.CHUNK:
                    self._scan_chunk(index, offset, length)
                elif opcode in CONTENT:
                    self._scan_record(index, offset, length, joinable=joinable)
                elif offset + length > self._size:
                    raise Damage(CUT_OFF)
                elif opcode in EXTRAS:
                    index.extras.append(Extra(opcode, offset, length))
                joinable = opcode in CONTENT and index.spans[-1].length < _RUN_LENGTH
                offset += length
        except DAMAGE as reason:
            index.damage = self.damage_sentence(offset, reason)
        return index

    def _scan_chunk(self, index: Index, offset: int, length: int) -> None:
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

    def _scan_record(self, index: Index, offset: int, length: int, *, joinable: bool) -> None:
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
            yield from split(self._read(offset, offset + length))
            return
        end = min(offset + length, self._size)
        self._file.seek(offset + HEAD.size)
        chunk = Chunk.read(ReadDataStream(cast('BinaryIO', _Clipped(self._file, end))))
        whole = offset + length <= self._size
        yield from split(contents(chunk, whole=whole), TOO_LONG if whole else CUT_OFF)
        if not whole:
            raise Damage(CUT_OFF)

    def _body(self, extra: Extra) -> memoryview:
        return memoryview(self._read(extra.offset, extra.offset + extra.length))[HEAD.size :]

    def _messages(self, span: Span) -> Iterator[StoredMessage]:
        """The messages of a span.

        Raises:
            One of `DAMAGE`: the rest of the span cannot be read.
        """
        if span.length >= LARGE and span.offset + span.length <= self._size:
            self._file.seek(span.offset)
            found = read_sound_chunk(self._file, span.length)
            if found is not None:
                yield from found
                return
        for opcode, body in self._records(span.offset, span.length):
            if opcode == Opcode.MESSAGE:
                yield bytes(body[: MESSAGE.size]), bytes(body[MESSAGE.size :]), None

    def _read(self, start: int, end: int) -> bytes:
        if not 0 <= start <= end <= self._size:
            raise Damage(CUT_OFF)
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


def _is_complete(index: Index, chunks: list[ChunkIndex], statistics: Statistics) -> bool:
    """Whether a summary holds as many records as its statistics say, and names all that its parts refer to."""
    counts = (len(index.schemas), len(index.channels), len(chunks))
    stated = (statistics.schema_count, statistics.channel_count, statistics.chunk_count)
    if counts != stated or not index.names_all_schemas() or (statistics.message_count and not chunks):
        return False
    messages: Mapping[int, int] = statistics.channel_message_counts
    if messages and sum(messages.values()) != statistics.message_count:
        return False
    return all(index.channels.keys() >= chunk.message_index_offsets.keys() for chunk in chunks) and (
        messages.keys() <= index.channels.keys()
    )


def _open(path: Path) -> BinaryIO:
    try:
        file = path.open('rb')
        if file.read(len(ZSTD_MAGIC)) == ZSTD_MAGIC:
            file.seek(0)
            return expand_file(file, path)
        file.seek(0)
    except FileNotFoundError:
        raise RecordingError(f'{path} does not exist: check the name of the recording.') from None
    except PermissionError:
        raise RecordingError(f'{path} may not be read: change its permissions.') from None
    except OSError as error:
        raise RecordingError(f'{path} cannot be opened: {error.strerror or error}.') from None
    return file
