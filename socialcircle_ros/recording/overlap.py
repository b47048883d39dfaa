"""Reading ahead and writing behind on threads of their own, so that both cores work on a recording.

Checksums and files take as long as the filter. Small messages go from thread to thread in bundles.
"""

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from .topics import Message
from .writer import RecordingWriter

_BUNDLE = 1 << 20
"""Bytes of messages that are handed over at once, at least."""

_WAITING = 2
"""Bundles that may wait to be written, so that memory does not grow where the disk is slow."""


def read_ahead(messages: Iterator[Message]) -> Generator[Message]:
    """The same messages, the next bundle of them read while the last is worked on.

    What reading raises comes where the messages before it have been given.
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
    """Writes to a recording in the order of the calls, later; a context manager that waits for the last.

    What writing raises comes from one of the next calls, or at the end of the `with` block.
    """

    def __init__(self, writer: RecordingWriter) -> None:
        """Write to `writer`, to which nobody else writes meanwhile."""
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
    """Messages of together `_BUNDLE` bytes, or those up to the end or an error."""
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
