# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file in their order, byte for byte as `mcap.writer.Writer` writes them.

The bytes are those of `mcap` 1.2.1 to 1.6.0; the tests compare them with the version that is installed.

`mcap` copies a message three times before it is in the file, and holds the interpreter's lock meanwhile. Here the
message that completes a chunk goes from its own memory to the file, so that clouds are not copied at all. The
records other than messages and chunks are `mcap`'s.
"""

import zlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from socialcircle_ros.arguments import Compression

from .checksums import joined_checksum
from .mcap_records import CHUNK, FOOTER, HEAD, LENGTH, MESSAGE

Buffer = bytes | bytearray | memoryview


class Output(Protocol):
    """Where the bytes go."""

    @property
    def position(self) -> int:
        """The number of bytes that are written."""

    def write(self, *parts: Buffer) -> None:
        """Write all parts, one after the other."""


class _Record(Protocol):
    def write(self, stream: RecordBuilder) -> None: ...


class McapWriter:
    """Writes one MCAP file with checksums, indexes and statistics.

    Args:
        output: where to write.
        chunk_size: a chunk ends with the message that makes it larger than this, before compression.
        compression: of the chunks.
        chunked: whether there are chunks. A file without them holds no messages.
    """

    def __init__(self, output: Output, chunk_size: int, compression: Compression, *, chunked: bool = True) -> None:
        self._output = output
        self._chunk_size = chunk_size
        self._compression = compression
        self._chunked = chunked
        self._chunk = bytearray()  # the records of the chunk so far
        self._indexes: dict[int, MessageIndex] = {}  # of the messages in the chunk, by channel
        self._chunk_start, self._chunk_end = 0, 0  # log times
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = defaultdict(int)  # of messages, by channel
        self._start, self._end = 0, 0  # log times of all messages

    def start(self, profile: str, library: str) -> None:
        """Begin the file.

        Raises:
            OSError: as all methods, if it cannot be written.
        """
        self._output.write(MCAP0_MAGIC, _serialized([Header(profile, library)]))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema; returns its number."""
        schema = Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data)
        self._schemas.append(schema)
        self._put(schema)
        return schema.id

    def register_channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Add a channel for messages of the schema with this number, 0: none; returns the channel's number."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            metadata=dict(metadata),
            schema_id=schema,
        )
        self._channels.append(channel)
        self._put(channel)
        return channel.id

    def add_message(
        self,
        channel: int,
        log_time: int,
        data: Buffer,
        publish_time: int,
        sequence: int,
        checksum: int | None = None,
    ) -> None:
        """Add a message; `data` is no longer used after the call.

        Args:
            channel: its number.
            log_time: ns since 1970.
            data: the serialized message.
            publish_time: ns since 1970.
            sequence: the number that the publisher gave it.
            checksum: CRC-32 of `data`; None: it is computed here.
        """
        if isinstance(data, memoryview):
            data = data.cast('B')  # so that its length is in bytes
        at = len(self._chunk)
        first = not self._counts
        empty = not self._indexes
        self._start = log_time if first else min(log_time, self._start)
        self._end = max(log_time, self._end)
        self._chunk_start = log_time if empty else min(log_time, self._chunk_start)
        self._chunk_end = log_time if empty else max(log_time, self._chunk_end)
        self._counts[channel] += 1
        self._indexes.setdefault(channel, MessageIndex(channel, [])).records.append((log_time, at))
        self._chunk += HEAD.pack(Opcode.MESSAGE, MESSAGE.size + len(data))
        self._chunk += MESSAGE.pack(channel, sequence, log_time, publish_time)
        if len(self._chunk) + len(data) > self._chunk_size:
            self._end_chunk(data, checksum)
        else:
            self._chunk += data

    def add_attachment(self, create_time: int, log_time: int, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment, before the first message."""
        offset = self._output.position
        record = _serialized([Attachment(create_time, log_time, name, media_type, data)])
        self._output.write(record)
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=len(record),
                create_time=create_time,
                log_time=log_time,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Add a metadata record; it comes before the chunk that is not written yet."""
        offset = self._output.position
        record = _serialized([Metadata(name=name, metadata=dict(entries))])
        self._output.write(record)
        self._metadata.append(MetadataIndex(offset=offset, length=len(record), name=name))

    def finish(self) -> None:
        """Write the last chunk, and the index."""
        if self._indexes:
            self._end_chunk(b'')
        self._output.write(_serialized([DataEnd(0)]))
        start = self._output.position
        summary, offsets = b'', []
        for opcode, records in self._summary():
            group = _serialized(records)
            offsets.append(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offsets_start = start + len(summary)
        summary += _serialized(offsets)
        footer_head = FOOTER.pack(Opcode.FOOTER, FOOTER.size - HEAD.size, start, offsets_start, 0)[:-4]
        checksum = zlib.crc32(footer_head, zlib.crc32(summary))
        footer = Footer(summary_start=start, summary_offset_start=offsets_start, summary_crc=checksum)
        self._output.write(summary, _serialized([footer]), MCAP0_MAGIC)

    def _put(self, record: _Record) -> None:
        """Write a schema or a channel, which comes before the messages of the chunk that need it."""
        data = _serialized([record])
        if self._chunked:
            self._chunk += data
            if self._indexes and len(self._chunk) > self._chunk_size:
                self._end_chunk(b'')
        else:
            self._output.write(data)

    def _end_chunk(self, last: Buffer, checksum_of_last: int | None = None) -> None:
        """Write the chunk and its index.

        Args:
            last: what comes behind the records so far; it is not copied unless it is compressed.
            checksum_of_last: CRC-32 of `last`; None: it is computed here.
        """
        size = len(self._chunk) + len(last)
        checksum = zlib.crc32(self._chunk)
        if checksum_of_last is None:
            checksum = zlib.crc32(last, checksum)
        else:
            checksum = joined_checksum(checksum, checksum_of_last, len(last))
        parts: tuple[Buffer, ...] = (self._chunk, last)
        name = ''
        if self._compression != 'none':
            name = self._compression
            parts = (_COMPRESS[self._compression](b''.join(parts)),)
        stored = sum(map(len, parts))
        body = CHUNK.pack(self._chunk_start, self._chunk_end, size, checksum, len(name))
        body += name.encode() + LENGTH.pack(stored)
        head = HEAD.pack(Opcode.CHUNK, len(body) + stored) + body
        offset = self._output.position
        end = offset + len(head) + stored
        indexes, places = b'', {}
        for channel, index in self._indexes.items():
            places[channel] = end + len(indexes)
            indexes += _serialized([index])
        self._output.write(head, *parts, indexes)
        self._chunks.append(
            ChunkIndex(
                chunk_length=end - offset,
                chunk_start_offset=offset,
                compression=name,
                compressed_size=stored,
                message_end_time=self._chunk_end,
                message_index_length=len(indexes),
                message_index_offsets=places,
                message_start_time=self._chunk_start,
                uncompressed_size=size,
            )
        )
        self._chunk.clear()
        self._indexes.clear()

    def _summary(self) -> Iterable[tuple[Opcode, Iterable[_Record]]]:
        """The groups of the index."""
        yield Opcode.SCHEMA, self._schemas
        yield Opcode.CHANNEL, self._channels
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._end,
            message_start_time=self._start,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        yield Opcode.STATISTICS, [statistics]
        if self._chunked:
            yield Opcode.CHUNK_INDEX, self._chunks
        if self._attachments:  # other tools take an empty group of attachments for damage
            yield Opcode.ATTACHMENT_INDEX, self._attachments
        yield Opcode.METADATA_INDEX, self._metadata


_COMPRESS: Mapping[str, Callable[[bytes], bytes]] = {'lz4': lz4.frame.compress, 'zstd': zstandard.compress}


def _serialized(records: Iterable[_Record]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
