# SPDX-License-Identifier: Apache-2.0
"""Writing recordings as rosbag2 of Jazzy does: an MCAP file, or a directory with several and a metadata.yaml."""

import errno
import os
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from types import TracebackType
from typing import cast

from socialcircle_ros.arguments import Compression, check_compression
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.messages.header import FIRST_DATE, stamp_text
from socialcircle_ros.storage import Reserve, Unfinished, is_full, kind_of_target, lies_in, remove_leftovers

from .mcap_output import LAST_TIME, McapOutput
from .metadata import FileContents, bag_information, to_yaml
from .names import is_mcap_name
from .topics import Attachment, CheckedMessage, MetadataRecord, Topic

_LAST_SEQUENCE = 2**32 - 1
_NEW_FILE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW


class RecordingWriter:
    """Writes a recording; a context manager.

    The recording gets its name when the `with` block ends. Until then another name stands beside the target, and
    no file looks complete. What becomes of the recording after an error, Ctrl-C, SIGTERM or SIGHUP depends on
    `keep`: by default it is removed; with `keep`, what was written is completed and gets its name.

    Attributes:
        path: of the recording, as given.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        compression: Compression = 'none',
        overwrite: bool = False,
        source: str | Path | None = None,
        keep: bool = False,
        max_bytes: int = 0,
        max_duration_s: float = 0.0,
        direct: bool = False,
    ) -> None:
        """Begin a recording.

        Args:
            path: a file if the name ends in `.mcap`, else a rosbag2 directory; its name has no suffix of a file.
            compression: of the chunks.
            overwrite: whether to replace an existing recording. Other files and folders are never replaced.
            source: the recording that is read at the same time; it is protected from being written into.
            keep: whether an error leaves a recording with all messages before it, also on a full disk: space for
                the index and the pending messages is reserved.
            max_bytes: in a directory, begin the next file when a file has this size; 0: one file.
            max_duration_s: in a directory, begin the next file after this time by the log times; 0: one file.
            direct: whether large messages go past the system's cache, where the file system can: for recordings
                of gigabytes that nobody reads at once.

        Raises:
            SettingError: there is no such compression.
            RecordingError: the path exists already, cannot be written, has the suffix of another file, or is a
                file that would have to be split.
        """
        check_compression(compression)
        self.path = Path(path)
        self._is_file = is_mcap_name(self.path)
        if self._is_file and (max_bytes or max_duration_s):
            raise RecordingError(f'{self.path} is one file and cannot be split: give a name without .mcap.')
        self._overwrite = overwrite
        self._compression = compression
        self._keep = keep
        self._direct = direct
        self._max_bytes = max_bytes or float('inf')
        self._max_duration = max_duration_s * 1e9 or float('inf')
        self._topics: dict[str, Topic] = {}
        self._waiting: dict[str, Topic] = {}  # to be written before the next message
        self._finished: list[FileContents] = []
        self._closed = False
        self._reserve: Reserve | None = None
        self._descriptor = -1  # of the current file in a directory
        remove_leftovers(self.path.absolute())
        self._check_target(source)
        try:
            self._unfinished = Unfinished(self.path, folder=not self._is_file, kept=keep)
            self._reserve = Reserve(self._unfinished.path.parent) if keep else None
            self._file = self._begin_file()
        except OSError as error:
            self.discard()
            raise self._error(error) from error
        except SocialCircleError as error:
            raise RecordingError(str(error)) from None

    @property
    def closed(self) -> bool:
        """Whether the recording has ended, after `close` or an error."""
        return self._closed

    @property
    def message_count(self) -> int:
        """The number of messages that have been written so far."""
        return self._file.message_count + sum(file.message_count for file in self._finished)

    def add_topic(self, topic: Topic, name: str | None = None) -> None:
        """Add a topic, made by `ros_topic` or taken from a reader.

        The topic is written as it is, with one exception: QoS policies that an older rosbag2 wrote as numbers
        become words, because rosbag2 of Jazzy reads only words.

        Args:
            topic: the topic.
            name: the name under which `write` gets its messages, if a reader has it under another name.

        Raises:
            RecordingError: the recording is closed, a different topic with this name was added before, or the disk
                is full.
        """
        self._check_open()
        name = name or topic.name
        if name in self._topics:
            if topic != self._topics[name]:
                raise RecordingError(f'{self.path} cannot hold two different topics named {name}: rename one.')
            return
        try:
            self._file.expect({name: topic})
        except OSError as error:
            raise self._failure(error) from error
        self._waiting[name] = self._topics[name] = topic

    def add_attachment(self, attachment: Attachment) -> None:
        """Add an attachment, before the first message.

        Raises:
            RecordingError: the recording is closed, or a message was written before.
        """
        self._check_open()
        if self.message_count:
            raise RecordingError(f'{self.path} takes no attachment after a message: add attachments first.')
        self._file.add(attachment)

    def add_metadata(self, record: MetadataRecord) -> None:
        """Add a metadata record. The one with the name `rosbag2` is written by `close`.

        Raises:
            RecordingError: the recording is closed, or the disk is full.
        """
        self._check_open()
        try:
            self._file.add(record)
        except OSError as error:
            raise self._failure(error) from error

    def write(
        self,
        topic: str,
        data: bytes | bytearray | memoryview,
        log_time: int,
        publish_time: int | None = None,
        sequence: int = 0,
        checksum: int | None = None,
    ) -> None:
        """Write one message.

        Args:
            topic: name of a topic that was added.
            data: the serialized message.
            log_time: when it was recorded, ns since 1970.
            publish_time: when it was published, ns since 1970; None: as `log_time`.
            sequence: the number that the publisher gave it; 0 if unknown.
            checksum: CRC-32 of `data`, as zlib computes it; None: it is computed here.

        Raises:
            RecordingError: the recording is closed, the topic was not added, a number is out of range, or the
                disk is full. With `keep`, a full disk ends the recording: it is complete then, and the message
                says what it holds.
        """
        publish_time = log_time if publish_time is None else publish_time
        self._check_open()
        if topic not in self._topics:
            raise RecordingError(f'{self.path} has no topic {topic}: add the topic before its messages.')
        if not (0 <= log_time <= LAST_TIME and 0 <= publish_time <= LAST_TIME):
            raise RecordingError(
                f'{self.path} cannot hold the times {log_time} and {publish_time} of a message on {topic}: '
                'they must be ns since 1970.'
            )
        if not 0 <= sequence <= _LAST_SEQUENCE:
            raise RecordingError(f'{self.path} cannot hold the sequence number {sequence}: it must fit 32 bits.')
        try:
            if self._is_file_full(log_time):
                self._begin_next_file()
            # A chunk at the end without a message is not written, but the index would name its topics. So topics
            # are written just before a message; one that is added after the last is in the metadata only.
            waiting, self._waiting = self._waiting, {}
            # The annotation of a message says bytes, as readers give it; any buffer is written.
            payload = cast('bytes', data)
            message = CheckedMessage(topic, payload, log_time, publish_time, sequence)
            message.checksum = checksum
            self._file.write(message, waiting)
        except OSError as error:
            raise self._failure(error) from error
        if self._reserve is not None and self._reserve.used:
            raise self._failure(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))

    def contents(self) -> str:
        """One sentence: how many messages there are, and until when."""
        files = [file for file in (*self._finished, self._file.contents) if file.message_count]
        if not files:
            return 'It holds no message.'
        end = max(file.end for file in files)
        last = f'the time {stamp_text(end)} s'
        if end >= FIRST_DATE:
            last = f'{datetime.fromtimestamp(end / 1e9, timezone.utc).astimezone():%Y-%m-%d %H:%M:%S}'
        count = self.message_count
        return f'It holds {count} message{"s" if count > 1 else ""}, the last of {last}.'

    def close(self) -> None:
        """Complete the recording and give it its name; nothing if that was done.

        Raises:
            RecordingError: the recording cannot be completed. It is removed then; with `keep`, what is on the
                disk gets its name.
        """
        if self._closed:
            return
        try:
            self._complete()
        except OSError as error:
            raise self._failure(error) from error

    def discard(self) -> None:
        """Remove the unfinished recording."""
        self._closed = True
        self._release()
        if hasattr(self, '_unfinished'):
            self._unfinished.discard()

    def __enter__(self) -> 'RecordingWriter':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None or (self._keep and self.message_count):
            self.close()
        else:
            self.discard()

    def _check_open(self) -> None:
        if self._closed:
            raise RecordingError(f'{self.path} is closed: nothing can be written any more.')

    def _check_target(self, source: str | Path | None) -> None:
        target = self.path.resolve()
        if source is not None and lies_in(self.path, Path(source)):
            raise RecordingError(
                f'{self.path} would be written into the recording that is read, {source}: give another name.'
            )
        if not target.parent.is_dir():
            raise RecordingError(f'{self.path} cannot be written: make the directory {self.path.parent} first.')
        if not os.path.lexists(self.path):
            return
        kind = kind_of_target(self.path)
        if kind not in ('a file', 'a directory'):
            raise RecordingError(f'{self.path} is {kind}, and is not overwritten: give another name.')
        if self._is_file != (kind == 'a file') or not (self._is_file or _is_only_a_recording(self.path)):
            raise RecordingError(f'{self.path} is not a recording, and is not overwritten: give another name.')
        if not self._overwrite:
            raise RecordingError(
                f'{self.path} exists already: give another name, or overwrite it with --overwrite.'
            )

    def _begin_file(self) -> McapOutput:
        """Begin a file of the recording.

        Raises:
            OSError: it cannot be made.
        """
        name = self.path.absolute().name
        if self._is_file:
            descriptor = self._unfinished.descriptor
        else:
            name = self._name_of(len(self._finished))
            descriptor = self._descriptor = os.open(self._unfinished.path / name, _NEW_FILE, 0o666)
        count = len(self._finished)
        return McapOutput(
            name, descriptor, self._compression, self._reserve, self._topics, count, direct=self._direct
        )

    def _is_file_full(self, log_time: int) -> bool:
        """Whether a message belongs to the next file."""
        return self._file.message_count > 0 and (
            self._file.size >= self._max_bytes or log_time - self._file.start >= self._max_duration
        )

    def _begin_next_file(self) -> None:
        self._file.finish(self._topics)
        self._file.release()
        if self._reserve is not None and self._reserve.used:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.close(self._descriptor)
        self._descriptor = -1
        self._finished.append(self._file.contents)
        try:
            self._file = self._begin_file()
        except BaseException:
            # The last file is still the current one.
            with suppress(OSError):
                (self._unfinished.path / self._name_of(len(self._finished))).unlink()
            self._finished.pop()
            raise
        self._waiting = dict(self._topics)

    def _name_of(self, number: int) -> str:
        """The name of a file in a directory, from 0."""
        return f'{self.path.absolute().name}_{number}.mcap'

    def _complete(self) -> None:
        """Write the index and the metadata, and give the recording its name.

        Raises:
            OSError: this cannot be done.
            RecordingError: the name is taken; with `keep`, the recording has another name.
        """
        self._file.finish(self._topics)
        self._release()
        if not self._is_file:
            self._write_metadata()
        self._give_name()
        self._closed = True

    def _write_metadata(self) -> None:
        """Write the metadata of a directory, and all its files to the disk."""
        files = [*self._finished, self._file.contents]
        if self._finished and not self._file.message_count:
            files.pop()  # the disk was full when this file had begun
            (self._unfinished.path / self._file.name).unlink()
        information = bag_information(self._topics, files)
        text = to_yaml({'rosbag2_bagfile_information': information})
        with os.fdopen(os.open(self._unfinished.path / 'metadata.yaml', _NEW_FILE, 0o666), 'wb') as stream:
            stream.write(text.encode())
        for path in self._unfinished.path.iterdir():
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)

    def _give_name(self) -> None:
        try:
            self._unfinished.complete(replace=self._overwrite)
        except (FileExistsError, SocialCircleError) as error:
            if not self._keep:
                self.discard()
                raise RecordingError(
                    f'{self.path} has been made by another program meanwhile: give another name.'
                ) from error
            self._closed = True
            raise RecordingError(
                f'{self.path} has been made by another program meanwhile: the recording is '
                f'{self._unfinished.keep()}. {self.contents()}'
            ) from error

    def _failure(self, error: OSError) -> RecordingError:
        """End the recording after an error: keep what is written, or remove it.

        Returns:
            The error to raise.
        """
        if not (self._keep and self.message_count):
            self.discard()
            return self._error(error)
        lost = ''
        try:
            self._complete()
        except OSError:
            lost = self._save_what_is_written()
        except RecordingError as taken:
            return taken
        why = 'the disk is full' if is_full(error) else error.strerror
        return RecordingError(
            f'{self.path} has ended early, because {why}. {self.contents()} All later messages are missing{lost}.'
        )

    def _save_what_is_written(self) -> str:
        """Give the recording its name, without the index and the metadata that cannot be written.

        Returns:
            What is missing and where the recording is, for the end of a sentence.
        """
        lost = 0
        with suppress(OSError):
            lost = self._file.cut()
        self._release()
        with suppress(OSError):
            if not self._is_file:
                self._write_metadata()
        self._closed = True
        missing = f', and so are the index and {lost} that had come' if lost else ', and so is the index'
        try:
            self._unfinished.complete(replace=self._overwrite)
        except (OSError, SocialCircleError):
            return f'{missing}; it is {self._unfinished.leave()}'
        return missing

    def _release(self) -> None:
        """Close what is open, except the unfinished recording itself."""
        if self._reserve is not None:
            self._reserve.close()
        if hasattr(self, '_file'):
            self._file.release()
        with suppress(OSError):
            os.close(self._descriptor)
        self._descriptor = -1

    def _error(self, error: OSError) -> RecordingError:
        return RecordingError(
            f'{self.path} cannot be written ({error.strerror}): check the space and the permissions there.'
        )


def _is_only_a_recording(folder: Path) -> bool:
    """Whether a folder holds nothing but the files of a recording."""
    return all(
        entry.is_file() and (entry.suffix == '.mcap' or entry.name == 'metadata.yaml')
        for entry in folder.iterdir()
    )
