# SPDX-License-Identifier: Apache-2.0
"""Reading ahead and writing behind on threads of their own, so that two cores work on a recording.

Checksums and file access take as long as the filter, or as receiving a message. Small messages pass between the
threads in bundles.
"""

import zlib
from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from .large_chunks import LARGE
from .topics import CheckedMessage, Message, Topic
from .writer import RecordingWriter

BUNDLE = 1 << 20
"""Least size of a bundle of messages, in bytes."""

_WAITING_BYTES = 64 << 20
"""Most bytes that wait to be written, so that memory does not grow where the disk is slow."""

_ALWAYS_WAITING = 2
"""Bundles that may wait whatever their size: each can be one message that is larger than `_WAITING_BYTES`."""


def read_ahead(messages: Iterator[Message]) -> Generator[Message]:
    """The same messages; the next bundle is read while the caller works on the last.

    An error of reading is raised after the messages before it.
    """
    with ThreadPoolExecutor(1, 'read_ahead') as pool:
        coming = pool.submit(_bundle, messages)
        while True:
            bundle, error = coming.result()
            if bundle and error is None:
                coming = pool.submit(_bundle, messages)
            yield from bundle
            if error is not None:
                raise error
            if not bundle:
                return


_Checksum = Future[int] | int | None
"""CRC-32 of a message's data: still to come, known, or left to the writer."""


class WriterBehind:
    """Writes to a recording on a thread, in the order of the calls; a context manager that waits for the end.

    A second thread computes the checksums of large messages while the messages before them are written.

    An error of writing is raised by one of the next calls, or at the end of the `with` block.

    Args:
        writer: the recording; no other code uses it meanwhile.
        bundle: bytes from which messages are handed to the thread; 1: each message at once.
    """

    def __init__(self, writer: RecordingWriter, bundle: int = BUNDLE) -> None:
        self._writer = writer
        self._least = bundle
        self._pool = ThreadPoolExecutor(1, 'write_behind')
        self._checksums = ThreadPoolExecutor(1, 'checksum')
        self._bundle: list[tuple[Message, _Checksum]] = []
        self._size = 0
        self._waiting: deque[tuple[Future[None], int]] = deque()
        self._waiting_bytes = 0

    @property
    def closed(self) -> bool:
        """Whether the recording has ended, after an error."""
        return self._writer.closed

    def add_topic(self, topic: Topic) -> None:
        """Add a topic, as `RecordingWriter.add_topic`, after the messages that wait."""
        self._hand_over()
        self._pool.submit(self._writer.add_topic, topic).result()

    def check(self) -> None:
        """Raise the error of a message that could not be written, if there is one."""
        while self._waiting and self._waiting[0][0].done():
            self._await_first()

    def write(self, message: Message) -> None:
        """Write one message, as `RecordingWriter.write`."""
        checksum = message.checksum if isinstance(message, CheckedMessage) else None
        job = None
        if checksum is None and len(message.data) >= LARGE:
            job = self._checksums.submit(zlib.crc32, message.data)
        self._bundle.append((message, job or checksum))
        self._size += len(message.data)
        if self._size >= self._least:
            self._hand_over()
            self.check()
            while len(self._waiting) > _ALWAYS_WAITING and self._waiting_bytes > _WAITING_BYTES:
                self._await_first()

    def __enter__(self) -> 'WriterBehind':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._checksums, self._pool:
            if kind is None:
                self._hand_over()
                while self._waiting:
                    self._await_first()

    def _hand_over(self) -> None:
        if not self._bundle:
            return
        self._waiting.append((self._pool.submit(self._write, self._bundle), self._size))
        self._waiting_bytes += self._size
        self._bundle, self._size = [], 0

    def _await_first(self) -> None:
        """Wait until the bundle that has waited longest is written."""
        job, size = self._waiting.popleft()
        self._waiting_bytes -= size
        job.result()

    def _write(self, bundle: list[tuple[Message, _Checksum]]) -> None:
        for message, checksum in bundle:
            found = checksum.result() if isinstance(checksum, Future) else checksum
            self._writer.write(*message, checksum=found)


def _bundle(messages: Iterator[Message]) -> tuple[list[Message], BaseException | None]:
    """Messages of `BUNDLE` bytes in sum, or those up to the end or an error."""
    bundle, size = [], 0
    try:
        for message in messages:
            bundle.append(message)
            size += len(message.data)
            if size >= BUNDLE:
                break
    except BaseException as error:  # noqa: BLE001 - raised where it belongs
        return bundle, error
    return bundle, None
