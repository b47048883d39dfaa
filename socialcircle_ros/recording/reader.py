# SPDX-License-Identifier: Apache-2.0
"""Reading recordings: an MCAP file, or a rosbag2 directory with one or several MCAP files."""

import heapq
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from socialcircle_ros.arguments import OneOrSeveral, several
from socialcircle_ros.errors import RecordingError
from socialcircle_ros.settings.plain_yaml import PlainYamlError, load_plain_yaml

from .compression import LIMIT_VARIABLE, expansion_limit
from .mcap_file import McapFile
from .mcap_records import DAMAGE, Span
from .topics import Attachment, Message, MetadataRecord, Topic

_LARGEST_METADATA = 16 << 20  # bytes
_MOST_HELD = 4  # times what a chunk may expand to
_SUFFIXES = ('.mcap', '.mcap.zstd', '.mcap.zst')  # rosbag2 and the command zstd name compressed files so


class RecordingReader:
    """An opened recording; a context manager that closes it.

    Attributes:
        path: as given to `open_recording`.
        topics: all topics by name. If messages of several types are on one topic, the later types are there under
            the name with a number, such as `/a#2`, under which `messages` yields them.
        message_count: the number of messages; in a damaged recording, those before the damage.
        damage: one sentence that says where the recording is damaged and what is lost, else None. Damage of the
            index is known after opening, other damage when `messages` has reached it.
    """

    def __init__(self, path: Path, files: list[Path]) -> None:
        """Open the files of one recording, in their order; see `open_recording`."""
        self.path = path
        self._closing = ExitStack()
        self._closed = False
        try:
            self._files = [self._opened(file) for file in files]
            self.topics = self._collect_topics()
        except BaseException:
            self.close()
            raise
        self.message_count = sum(file.message_count for file in self._files)
        self.damage = next((file.damage for file in self._files if file.damage), None)

    def messages(self, topics: OneOrSeveral[str] | None = None, since: int = 0) -> Iterator[Message]:
        """Yield the messages in the order of their log times; messages with equal times in the order of the file.

        One chunk is in memory at a time, or as many as overlap in time. If a file is damaged, its messages before
        the damage are read, and all messages of the other files; `damage` is set then.

        Raises:
            RecordingError: the recording is closed, or chunks that overlap in time would fill the memory.

        Args:
            topics: the wanted topic or topics; None: all.
            since: the first wanted log time, ns. Chunks before it are not loaded.
        """
        self._check_open()
        names = None if topics is None else frozenset(several(topics))
        queue: list[tuple[int, int, int, int, Span | Message]] = []
        for number, file in enumerate(self._files):
            wanted = {id_ for id_, name in file.names.items() if names is None or name in names}
            for span in file.spans:
                if span.end_time >= since and (span.channels is None or span.channels & wanted):
                    queue.append((span.start_time, number, span.offset, -1, span))  # noqa: PERF401 - easier to read
        heapq.heapify(queue)
        damaged_at: dict[int, int] = {}  # file number → offset of its damage
        count = held = 0
        most = _MOST_HELD * expansion_limit()
        while queue:
            _, number, offset, _, item = heapq.heappop(queue)
            if isinstance(item, Message):
                count += 1
                held -= len(item.data)
                yield item
            elif offset < damaged_at.get(number, offset + 1):
                file = self._files[number]
                try:
                    for place, message in enumerate(file.messages(item)):
                        if message.log_time >= since and (names is None or message.topic in names):
                            heapq.heappush(queue, (message.log_time, number, offset, place, message))
                            held += len(message.data)
                            if held > most:
                                raise self._too_much_at_once(most)
                except DAMAGE as reason:
                    self._check_open()  # a file that is closed raises what a damaged one can raise
                    damaged_at[number] = offset
                    self.damage = self.damage or file.damage_sentence(offset, reason)
        if names is None and since == 0 and count != self.message_count and not self.damage:
            self.damage = (
                f'{self.path} is damaged: its index counts {self.message_count} messages, but {count} were found.'
            )

    def count(self, topics: OneOrSeveral[str]) -> int:
        """The number of messages on some topics; all those of a file if its index does not tell topics apart."""
        names = frozenset(several(topics))
        count = 0
        for file in self._files:
            if file.message_counts:
                count += sum(number for id_, number in file.message_counts.items() if file.names[id_] in names)
            else:
                count += file.message_count
        return count

    def attachments(self) -> Iterator[Attachment]:
        """Yield the attachments of all files, one at a time; `damage` is set if one cannot be read.

        Raises:
            RecordingError: the recording is closed.
        """
        for file in self._files:
            with self._told('an attachment'):
                yield from file.attachments()

    def metadata(self) -> Iterator[MetadataRecord]:
        """Yield the metadata records of all files, without that of rosbag2, which describes the file itself.

        `damage` is set if one cannot be read.

        Raises:
            RecordingError: the recording is closed.
        """
        for file in self._files:
            with self._told('a metadata record'):
                yield from file.metadata()

    def refusal(self, sentence: str) -> RecordingError:
        """An error for a recording that lacks something; it says also which damage is the likely reason."""
        return RecordingError(f'{sentence} {self.damage}' if self.damage else sentence)

    def close(self) -> None:
        """Close the files of the recording."""
        self._closed = True
        self._closing.close()

    def __enter__(self) -> 'RecordingReader':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._closed:
            raise RecordingError(
                f'{self.path} is closed, so nothing can be read from it: read within its `with` block, or open it'
                ' again.'
            )

    def _too_much_at_once(self, most: int) -> RecordingError:
        return RecordingError(
            f'{self.path} has more than {most / 1e6:.0f} MB in chunks that overlap in time, which must be in'
            f' memory together: sort it by time, or raise {LIMIT_VARIABLE}.'
        )

    def _opened(self, path: Path) -> McapFile:
        file = McapFile(path)
        self._closing.callback(file.close)
        return file

    def _collect_topics(self) -> dict[str, Topic]:
        topics: dict[str, Topic] = {}
        for file in self._files:
            for id_, topic in file.channels.items():
                name, number = topic.name, 1
                while (first := topics.setdefault(name, topic)) and not _same_kind(first, topic):
                    number += 1
                    name = f'{topic.name}#{number}'  # which no topic of ROS has
                file.names[id_] = name
        encodings = {topic.encoding for topic in topics.values()}
        if encodings and 'cdr' not in encodings:
            found = ', '.join(sorted(encodings))
            raise RecordingError(
                f'{self.path} holds no messages of ROS 2; their encoding is {found}: convert it first, for '
                'ROS 1 with `rosbags-convert`.'
            )
        return topics

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        """Set `damage` if something cannot be read."""
        self._check_open()
        try:
            yield
        except DAMAGE:
            self._check_open()
            self.damage = self.damage or f'{self.path} is damaged: {what} cannot be read, and is left out.'


def open_recording(path: str | Path) -> RecordingReader:
    """Open a recording for reading.

    A damaged file is opened as well if it begins as an MCAP file; `RecordingReader.damage` says what is lost. A
    file without an index is read once to build one. Recordings that rosbag2 compressed by file or by message with
    zstd are decompressed.

    Args:
        path: an MCAP file, or a rosbag2 directory with one or several.

    Raises:
        RecordingError: the file does not exist, is no recording, or has a format that cannot be read here.
    """
    path = Path(path)
    try:
        files = _parts(path) if path.is_dir() else [path]
    except PermissionError:
        raise RecordingError(f'{path} may not be read: change its permissions.') from None
    return RecordingReader(path, files)


def _same_kind(one: Topic, other: Topic) -> bool:
    return (one.type, one.encoding) == (other.type, other.encoding)


def _parts(folder: Path) -> list[Path]:
    """The MCAP files of a rosbag2 directory, in their order; some may be compressed as a whole."""
    information = _information(folder / 'metadata.yaml')
    mode, kind = (str(information.get(f'compression_{key}') or '') for key in ('mode', 'format'))
    if mode.upper() == 'MESSAGE' and kind != 'zstd':
        raise RecordingError(
            f'{folder} is compressed message by message with {kind or "an unknown method"}: convert it to MCAP'
            ' without compression with `ros2 bag convert`.'
        )
    found = sorted(
        (file for file in folder.iterdir() if file.is_file() and not file.name.startswith('.')),
        key=natural_order,
    )
    recorded = [file for file in found if file.name.endswith(_SUFFIXES)]
    if any('.db3' in file.suffixes for file in found) and not recorded:
        raise RecordingError(
            f'{folder} is an sqlite3 bag: convert it to MCAP with `ros2 bag convert`, and use the result.'
        )
    listed = information.get('relative_file_paths')
    if isinstance(listed, list) and listed:
        return [_present(folder / str(name)) for name in listed]
    if not recorded:
        raise RecordingError(f'{folder} holds no recording: give a directory with a .mcap file in it.')
    # Where a file is there twice, it was being decompressed; the compressed one is whole for certain.
    return [file for file in recorded if _compressed(file) not in recorded]


def _present(file: Path) -> Path:
    """The file as it is there: as it is listed, or compressed, or decompressed by hand."""
    others = (file, _compressed(file), file.with_suffix('') if file.suffix == '.zstd' else file)
    return next((other for other in others if other.is_file()), file)


def _compressed(file: Path) -> Path:
    return file.with_name(f'{file.name}.zstd')


def _information(metadata: Path) -> dict[str, object]:
    """What a metadata.yaml says of the recording; nothing if it is missing or, after a crash, invalid."""
    try:
        with metadata.open('rb') as file:
            content = load_plain_yaml(file.read(_LARGEST_METADATA))
    except (FileNotFoundError, PlainYamlError):
        return {}
    information = content.get('rosbag2_bagfile_information') if isinstance(content, dict) else None
    return information if isinstance(information, dict) else {}


def natural_order(path: Path) -> list[tuple[int, str]]:
    """A key that sorts `bag_10.mcap` after `bag_9.mcap`."""
    return [(int(part), '') if part.isdigit() else (-1, part) for part in re.split(r'(\d+)', path.name)]
