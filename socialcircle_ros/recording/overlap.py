# SPDX-License-Identifier: Apache-2.0
"""Reading ahead and writing behind on threads of their own, so that two cores work on a recording.

Checksums and file access take as long as the filter. Small messages pass between the threads in bundles.
"""

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from .topics import Message
from .writer import RecordingWriter

_BUNDLE = 1 << 20
"""Least size of a bundle of messages, in bytes."""

_WAITING = 2
"""Most bundles that wait to be written, so that memory does not grow where the disk is slow."""


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


class WriterBehind:
    """Writes to a recording on a thread, in the order of the calls; a context manager that waits for the end.

    An error of writing is raised by one of the next calls, or at the end of the `with` block.

    Args:
        writer: the recording; no other code writes to it meanwhile.
    """

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._pool = ThreadPoolExecutor(1, 'write_behind')
        self._bundle: list[Message] = []
        self._size = 0
        self._waiting: deque[Future[None]] = deque()

    def write(
        self, topic: str, data: bytes, log_time: int, publish_time: int | None = None, sequence: int = 0
    ) -> None:
        """Write one message, as `RecordingWriter.write`."""
        published = log_time if publish_time is None else publish_time
        self._bundle.append(Message(topic, data, log_time, published, sequence))
        self._size += len(data)
        if self._size >= _BUNDLE:
            self._hand_over()
            while len(self._waiting) > _WAITING:
                self._waiting.popleft().result()

    def __enter__(self) -> 'WriterBehind':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._pool:
            if kind is None:
                self._hand_over()
                while self._waiting:
                    self._waiting.popleft().result()

    def _hand_over(self) -> None:
        self._waiting.append(self._pool.submit(self._write, self._bundle))
        self._bundle, self._size = [], 0

    def _write(self, bundle: list[Message]) -> None:
        for message in bundle:
            self._writer.write(*message)


def _bundle(messages: Iterator[Message]) -> tuple[list[Message], BaseException | None]:
    """Messages of `_BUNDLE` bytes in sum, or those up to the end or an error."""
    bundle, size = [], 0
    try:
        for message in messages:
            bundle.append(message)
            size += len(message.data)
            if size >= _BUNDLE:
                break
    except BaseException as error:  # noqa: BLE001 - raised where it belongs
        return bundle, error
    return bundle, None
