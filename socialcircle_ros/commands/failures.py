# SPDX-License-Identifier: Apache-2.0
"""What a machine lacks, as a sentence: room for the output, a folder for temporary files, memory, threads.

Libraries raise errors of many kinds for these. No fault of a program is among them, so no traceback helps.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO, cast

_NO_THREAD = "can't start new thread"  # Python's words
_NO_MEMORY = 'failed to map segment', 'cannot allocate memory'  # those of the loader of libraries


def sentence_of(error: Exception) -> str | None:
    """What the machine lacks, and what to do; None: the error has another cause."""
    if isinstance(error, OSError) and error.filename is None:
        return _temporary_failure()
    if isinstance(error, MemoryError):
        said = str(error).rstrip('.')
        return f'Memory is short{f" ({said})" if said else ""}: end other programs, or allow more (ulimit -v).'
    if isinstance(error, RuntimeError) and _NO_THREAD in str(error):
        return 'No further thread can be started: allow more memory or processes (ulimit -v, ulimit -u).'
    if isinstance(error, ImportError) and any(each in str(error).lower() for each in _NO_MEMORY):
        return f'Memory is short: {error.name or "a library"} cannot be loaded. Allow more (ulimit -v).'
    return None


def _temporary_failure() -> str | None:
    try:
        tempfile.gettempdir()
    except OSError:
        return 'No folder for temporary files can be written: set TMPDIR to one that can.'
    return None


class NotedOutput:
    """A stream such as stdout that notes what went wrong as it was written.

    Attributes:
        failure: the first error; None: all was written so far.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | None = None

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text, as a stream does."""
        with self._noted():
            return self._stream.write(text)

    def flush(self) -> None:
        """Write what is held, as a stream does."""
        with self._noted():
            self._stream.flush()

    @contextmanager
    def _noted(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.failure = self.failure or error
            raise

    def has_failed_by(self, error: Exception) -> bool:
        """Whether the stream raised such an error: click tries it first, and passes over an error then."""
        return isinstance(error, OSError) and self.failure is not None and self.failure.errno == error.errno

    def end(self) -> str | None:
        """Write what is held, and say what could not be written; None: all was.

        What could not be written is dropped. Python would try it again at its end, and print a traceback.
        """
        with suppress(OSError):
            self.flush()
        if self.failure is None:
            return None
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
        return f'The output cannot be written: {self.failure.strerror}.'


@contextmanager
def noted_output() -> Iterator[NotedOutput | None]:
    """Take the place of stdout meanwhile; None: the process has no stdout."""
    if sys.stdout is None:
        yield None
        return
    before, output = sys.stdout, NotedOutput(sys.stdout)
    sys.stdout = cast('TextIO', output)
    yield output
    # After an error it stays: click has wrapped it where the reader of a pipe is gone.
    sys.stdout = before
