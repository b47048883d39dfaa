# SPDX-License-Identifier: Apache-2.0
"""One MCAP file that is being written, and what remains of it on a full disk."""

import errno
import os
from collections.abc import Mapping
from types import MappingProxyType

from socialcircle_ros.arguments import Compression
from socialcircle_ros.storage import ALIGNMENT, DirectFile, Reserve, is_full

from .mcap_writer import Buffer, McapWriter
from .metadata import FileContents, bag_information, channel_metadata, to_yaml
from .topics import Attachment, CheckedMessage, MetadataRecord, Topic

LAST_TIME = 2**63 - 1
"""The last log time that rosbag2 can hold: ns in signed 64 bits."""

# The default of rosbag2. A larger message is a chunk of its own.
_CHUNK_SIZE = 768 * 1024

# From this size on, in bytes, a part of the file may go past the system's cache.
_LARGE = 1 << 20

# Bounds of what ends a file, in bytes. They are generous: a reserve that is too small loses messages.
_MESSAGE_OVERHEAD = 64  # head and index entry of a message
_CHUNK_OVERHEAD = 200  # head of a chunk, and its entry in the summary
_CHANNEL_OVERHEAD = 32  # a channel in the index of a chunk
_TOPIC_OVERHEAD = 2048  # a topic in the metadata, twice, without its QoS
_FILE_OVERHEAD = 1024  # a file of a recording of several, in metadata.yaml
_SLACK = 64 * 1024  # the rest of the summary, and what the file system needs for itself


class McapOutput:
    """Writes the messages of one file.

    With a reserve, `finish` is possible on a disk that is full: a message is only taken while the reserve holds
    the space for all that must still be written.

    Attributes:
        name: of the file.
    """

    def __init__(
        self,
        name: str,
        descriptor: int,
        compression: Compression,
        reserve: Reserve | None,
        topics: Mapping[str, Topic] = MappingProxyType({}),
        files: int = 0,
        *,
        direct: bool = False,
    ) -> None:
        """Begin the file.

        Args:
            name: of the file, for the metadata.
            descriptor: of the file, empty and open for writing. It is not closed here.
            compression: of the chunks.
            reserve: space for the end of the file; None: no space is reserved.
            topics: the topics of the recording that are known so far, by the names that messages use; see
                `expect`.
            files: how many files of the recording come before it.
            direct: whether large messages go past the system's cache, where the file system can.

        Raises:
            OSError: the file cannot be written.
        """
        self.name = name
        self._compression = compression
        self._reserve = reserve
        self._stream = _Stream(descriptor, reserve, direct=direct)
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._counts: dict[str, int] = {}
        self._start, self._end = LAST_TIME, 0
        self._pending = 0  # messages that are not in the file yet
        self._pending_bytes = 0
        # What the end of the recording takes, without the pending chunk.
        self._ending_bytes = _SLACK + files * _FILE_OVERHEAD
        self._torn = False  # whether the writer was interrupted, so that its index cannot be trusted
        self._finished = False
        self._attachments: list[Attachment] = []  # to be written before the first message
        self._metadata: list[MetadataRecord] = []
        self.expect(topics)
        self._writer = self._begin(chunked=True)
        self._whole = self._stream.position, self.contents

    @property
    def contents(self) -> FileContents:
        """What has been written so far."""
        return FileContents(self.name, dict(self._counts), self._start, self._end)

    @property
    def message_count(self) -> int:
        """The number of messages that have been written so far."""
        return sum(self._counts.values())

    @property
    def size(self) -> int:
        """The bytes written so far, and those of the chunk in memory before compression."""
        return self._stream.position + self._pending_bytes

    @property
    def start(self) -> int:
        """The earliest log time so far, ns."""
        return self._start

    def add(self, extra: Attachment | MetadataRecord) -> None:
        """Add an attachment, before the first message, or a metadata record.

        Raises:
            OSError: it cannot be written.
            ValueError: an attachment comes after a message.
        """
        if isinstance(extra, Attachment):
            if self.message_count:
                raise ValueError('an attachment comes after a message')
            self._attachments.append(extra)
        elif self.message_count == 0:
            self._metadata.append(extra)
        else:
            self._writer.add_metadata(extra.name, extra.entries)
            self._whole = self._stream.position, self._whole[1]  # no chunk was written

    def expect(self, topics: Mapping[str, Topic]) -> None:
        """Reserve the space that topics take in the index and in the metadata, whether they get messages or not.

        Raises:
            OSError: the disk is full.
        """
        for topic in topics.values():
            metadata = sum(len(key) + len(value) for key, value in topic.metadata.items())
            self._ending_bytes += _TOPIC_OVERHEAD + 2 * len(topic.schema) + 8 * metadata
        self._hold(0)

    def write(self, message: CheckedMessage, topics: Mapping[str, Topic]) -> None:
        """Write one message.

        Args:
            message: on one of the topics that were registered, or on one of `topics`.
            topics: to register before it.

        Raises:
            OSError: it cannot be written; with a reserve, because the disk is full or fails. The messages before
                it are in the file after `finish`, or if the disk fails, those of the chunks that are written.
        """
        self._hold(len(message.data))
        self._torn = True
        if self._attachments or self._metadata:
            self._begin_again(chunked=True)
            self._attachments, self._metadata = [], []
        for name, topic in topics.items():
            self._register(name, topic)
        if self._stream.position > self._whole[0]:  # the schemas filled a chunk
            self._chunk_is_written()
        channel = self._channels[message.topic]
        self._writer.add_message(
            channel, message.log_time, message.data, message.publish_time, message.sequence, message.checksum
        )
        self._torn = False
        self._counts[message.topic] = self._counts.get(message.topic, 0) + 1
        self._start = min(self._start, message.log_time)
        self._end = max(self._end, message.log_time)
        self._pending += 1
        self._pending_bytes += len(message.data)
        if self._stream.position > self._whole[0]:
            self._chunk_is_written()

    def finish(self, topics: Mapping[str, Topic]) -> None:
        """Write what is pending, and the index; nothing if that was done.

        It does not wait for the disk, which would take seconds in the middle of a recording.

        Args:
            topics: all topics of the recording. Those without messages are in the metadata only, unless the file
                has no message.

        Raises:
            OSError: it cannot be written.
        """
        if self._finished:
            return
        if self._torn:
            raise OSError(errno.EIO, 'a message was interrupted while it was written')
        self._torn = True
        if not self.message_count:
            # Topics are written into chunks. Without a message there is no chunk, and the topics would be lost.
            self._begin_again(chunked=False)
            for name, topic in topics.items():
                self._register(name, topic)
        information = bag_information(topics, [self.contents])
        self._writer.add_metadata('rosbag2', {'serialized_metadata': to_yaml(information)})
        self._writer.finish()
        self._finished = True

    def cut(self) -> int:
        """End the file after its last whole chunk, without an index, where it cannot be finished.

        Returns:
            The number of messages that are lost.
        """
        if self._finished:
            return 0
        position, contents = self._whole
        lost = self.message_count - contents.message_count
        self._stream.cut(position)
        self._counts, self._start, self._end = dict(contents.counts), contents.start, contents.end
        return lost

    def release(self) -> None:
        """Close what was opened here; nothing can be written then."""
        self._stream.release()

    def _begin_again(self, *, chunked: bool) -> None:
        self._stream.cut(0)
        self._writer = self._begin(chunked=chunked)
        self._whole = self._stream.position, self.contents

    def _begin(self, *, chunked: bool) -> McapWriter:
        """Begin the file, with the attachments and the metadata that wait."""
        writer = McapWriter(self._stream, _CHUNK_SIZE, self._compression, chunked=chunked)
        writer.start(profile='ros2', library='socialcircle_ros')
        for name, media_type, data, log_time, create_time in self._attachments:
            writer.add_attachment(create_time, log_time, name, media_type, data)
        for record in self._metadata:
            writer.add_metadata(record.name, record.entries)
        return writer

    def _register(self, name: str, topic: Topic) -> None:
        schema = (topic.type, topic.schema_encoding, topic.schema)
        if topic.type and schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(*schema)
        self._channels[name] = self._writer.register_channel(
            topic.name, topic.encoding, self._schemas.get(schema, 0), channel_metadata(topic)
        )

    def _chunk_is_written(self) -> None:
        self._whole = self._stream.position, self.contents
        self._ending_bytes += _CHUNK_OVERHEAD + _CHANNEL_OVERHEAD * len(self._channels)
        self._pending = self._pending_bytes = 0

    def _hold(self, size: int) -> None:
        """Hold the space for everything that must be written after a message of `size` bytes is taken.

        Raises:
            OSError: the disk is full.
        """
        if self._reserve is None:
            return
        chunk = (
            _CHUNK_SIZE + size + _MESSAGE_OVERHEAD * (self._pending + 1) + _CHANNEL_OVERHEAD * len(self._channels)
        )
        needed = self._ending_bytes + chunk + chunk // 64
        if needed <= self._reserve.size:
            return
        try:
            self._reserve.hold(needed + needed // 4)  # more, so that it need not grow with every message
        except OSError:
            self._reserve.hold(needed)


class _Stream:
    """What the records are written to: without a buffer, so that an error comes where it belongs.

    Attributes:
        position: the number of bytes that are written.
    """

    def __init__(self, descriptor: int, reserve: Reserve | None, *, direct: bool) -> None:
        self._descriptor = descriptor
        self._reserve = reserve
        self._is_direct = direct
        self._direct: DirectFile | None = None  # from the first large part on
        self.position = 0

    def write(self, *parts: Buffer) -> None:
        position = self.position
        small: list[memoryview] = []  # what comes before the next large part
        for part in (memoryview(part) for part in parts if part):
            small.append(part)
            if self._is_direct and len(part) >= _LARGE:
                self._direct = self._direct or DirectFile(self._descriptor)
                # What comes before the next whole unit of the file goes the usual way, and so does the end.
                before = -(position + sum(map(len, small[:-1]))) % ALIGNMENT
                small[-1] = part[:before]
                position = self._write(small, position)
                written = self._direct.write(part[before:], position)
                position += written
                small = [part[before + written :]]
        self.position = self._write(small, position)
        if self._direct is not None:
            self._direct.flush()

    def cut(self, position: int) -> None:
        os.ftruncate(self._descriptor, position)
        self.position = position

    def release(self) -> None:
        if self._direct is not None:
            self._direct.close()
            self._is_direct = False

    def _write(self, parts: list[memoryview], position: int) -> int:
        """Write parts from a position on; returns the position behind them."""
        views = [part for part in parts if part]
        while views:
            try:
                written = os.pwritev(self._descriptor, views, position)
            except OSError as error:
                if self._reserve is None or not is_full(error) or not self._reserve.give_back():
                    raise
                continue
            position += written
            while views and written >= len(views[0]):
                written -= len(views.pop(0))
            if written:
                views[0] = views[0][written:]
        return position
