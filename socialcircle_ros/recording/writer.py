"""Writing recordings as rosbag2 of Jazzy does: an MCAP file, or a directory with one and a metadata.yaml."""

import os
import shutil
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Literal, cast

import yaml
from mcap.writer import CompressionType, IndexType, Writer

from socialcircle_ros.errors import RecordingError

from .topics import Topic

Compression = Literal['none', 'lz4', 'zstd']

QosProfile = dict[str, object]
"""One profile of `offered_qos_profiles`."""

# The default of rosbag2. A larger message is a chunk of its own.
_CHUNK_SIZE = 768 * 1024
# Other tools take an empty attachment index for damage, and rosbag2 writes no attachments.
_INDEXES = IndexType.ALL & ~IndexType.ATTACHMENT
_LAST_TIME = 2**63 - 1  # rosbag2 holds times in signed 64 bits
_LAST_SEQUENCE = 2**32 - 1

# Metadata before version 9 (Jazzy) holds QoS policies as numbers: the places of these words.
_POLICY_NAMES = {
    'history': ['system_default', 'keep_last', 'keep_all', 'unknown'],
    'reliability': ['system_default', 'reliable', 'best_effort', 'unknown', 'best_available'],
    'durability': ['system_default', 'transient_local', 'volatile', 'unknown', 'best_available'],
    'liveliness': [
        'system_default',
        'automatic',
        'manual_by_node',
        'manual_by_topic',
        'unknown',
        'best_available',
    ],
}


class RecordingWriter:
    """Writes a recording; a context manager.

    The recording gets its name when the `with` block ends without an error. Until then its name ends in
    `.partial`. An error or Ctrl-C removes it, and after a crash no file looks complete.

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
    ) -> None:
        """Begin a recording.

        Args:
            path: a file if the name ends in `.mcap`, else a rosbag2 directory.
            compression: of the chunks.
            overwrite: whether to replace an existing recording. Other files and folders are never replaced.
            source: the recording that is read at the same time; it is protected from being written into.

        Raises:
            RecordingError: the path exists already, or cannot be written.
        """
        self.path = Path(path)
        self._is_file = self.path.suffix == '.mcap'
        self._overwrite = overwrite
        self._compression = compression
        self._check_target(source)
        # Absolute, because the working directory may change while a long recording is written.
        target = self.path.absolute()
        self._target = target
        self._partial = target.with_name(f'{target.name}.{os.getpid()}.partial')
        self._replaced = target.with_name(f'{target.name}.{os.getpid()}.replaced')
        self._file_name = target.name if self._is_file else f'{target.name}_0.mcap'
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._topics: dict[str, Topic] = {}
        self._waiting: list[Topic] = []  # to be written before the next message
        self._counts: dict[str, int] = {}
        self._start = _LAST_TIME
        self._end = 0
        self._closing = ExitStack()
        try:
            if not self._is_file:
                self._partial.mkdir()
            self._stream = (self._partial if self._is_file else self._partial / self._file_name).open('wb')
            self._closing.callback(self._stream.close)
            self._writer = self._begin(chunked=True)
        except OSError as error:
            raise self._failure(error) from error

    def add_topic(self, topic: Topic) -> None:
        """Add a topic, made by `ros_topic` or taken from a reader.

        The topic is written as it is, with one exception: QoS policies that an older rosbag2 wrote as numbers
        become words, because rosbag2 of Jazzy reads only words.

        Raises:
            RecordingError: a different topic with this name was added before.
        """
        if topic.name in self._topics:
            if topic != self._topics[topic.name]:
                raise RecordingError(
                    f'{self.path} cannot hold two different topics named {topic.name}: rename one.'
                )
            return
        self._waiting.append(topic)
        self._topics[topic.name] = topic
        self._counts[topic.name] = 0

    def write(
        self,
        topic: str,
        data: bytes | bytearray | memoryview,
        log_time: int,
        publish_time: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Write one message.

        Args:
            topic: name of a topic that was added.
            data: the serialized message.
            log_time: when it was recorded, ns since 1970.
            publish_time: when it was published, ns since 1970; None: as `log_time`.
            sequence: the number that the publisher gave it; 0 if unknown.

        Raises:
            RecordingError: the topic was not added, a number is out of range, or the disk is full.
        """
        publish_time = log_time if publish_time is None else publish_time
        if topic not in self._topics:
            raise RecordingError(f'{self.path} has no topic {topic}: add the topic before its messages.')
        if not (0 <= log_time <= _LAST_TIME and 0 <= publish_time <= _LAST_TIME):
            raise RecordingError(
                f'{self.path} cannot hold the times {log_time} and {publish_time} of a message on {topic}: '
                'they must be ns since 1970.'
            )
        if not 0 <= sequence <= _LAST_SEQUENCE:
            raise RecordingError(f'{self.path} cannot hold the sequence number {sequence}: it must fit 32 bits.')
        try:
            self._register_waiting()
            # mcap's annotation says bytes, but it copies any buffer.
            payload = cast('bytes', data)
            self._writer.add_message(self._channels[topic], log_time, payload, publish_time, sequence)
        except OSError as error:
            raise self._failure(error) from error
        self._counts[topic] += 1
        self._start = min(self._start, log_time)
        self._end = max(self._end, log_time)

    def close(self) -> None:
        """Complete the recording and give it its name.

        Raises:
            RecordingError: the recording cannot be completed; it is removed then.
        """
        information = self._information()
        try:
            if information['message_count'] == 0:
                # mcap writes topics into chunks. Without a message it writes no chunk, and the topics would be
                # lost.
                self._stream.seek(0)
                self._stream.truncate()
                self._writer = self._begin(chunked=False)
                self._register_waiting()
            self._writer.add_metadata(
                'rosbag2', {'serialized_metadata': yaml.safe_dump(information, sort_keys=False)}
            )
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
            if not self._is_file:
                text = yaml.safe_dump({'rosbag2_bagfile_information': information}, sort_keys=False)
                (self._partial / 'metadata.yaml').write_text(text, encoding='utf-8')
                if self._target.exists():
                    self._target.rename(self._replaced)
            self._partial.replace(self._target)
            shutil.rmtree(self._replaced, ignore_errors=True)
        except OSError as error:
            raise self._failure(error) from error

    def discard(self) -> None:
        """Remove the unfinished recording."""
        with suppress(OSError):  # on a full disk the last buffer cannot be written
            self._closing.close()
        with suppress(OSError):
            if self._is_file:
                self._partial.unlink()
            else:
                shutil.rmtree(self._partial)

    def __enter__(self) -> 'RecordingWriter':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def _check_target(self, source: str | Path | None) -> None:
        target = self.path.resolve()
        if source is not None:
            read = Path(source).resolve()
            if target == read or target in read.parents or (read.is_dir() and read in target.parents):
                raise RecordingError(
                    f'{self.path} would be written into the recording that is read, {source}: give another name.'
                )
        if not target.parent.is_dir():
            raise RecordingError(f'{self.path} cannot be written: make the directory {self.path.parent} first.')
        if not os.path.lexists(self.path):
            return
        if not self._overwrite:
            raise RecordingError(
                f'{self.path} exists already: give another name, or overwrite it with --overwrite.'
            )
        if self._is_file != self.path.is_file() or not (self._is_file or _is_only_a_recording(self.path)):
            raise RecordingError(f'{self.path} is not a recording, and is not overwritten: give another name.')

    def _begin(self, *, chunked: bool) -> Writer:
        writer = Writer(
            self._stream,
            chunk_size=_CHUNK_SIZE,
            compression=CompressionType[self._compression.upper()],
            index_types=_INDEXES if chunked else IndexType.METADATA,
            use_chunking=chunked,
        )
        writer.start(profile='ros2', library='socialcircle_ros')
        return writer

    def _register_waiting(self) -> None:
        """Write the topics that were added since the last message.

        mcap drops topics at the end of a file that no message follows, but its index still names them. So topics
        are written just before a message, and a topic that is added after the last message is in metadata.yaml
        only.
        """
        for topic in self._waiting:
            schema = (topic.type, topic.schema_encoding, topic.schema)
            metadata = dict(topic.metadata)
            if (profiles := _qos_in_words(topic.qos)) != _load_qos(topic.qos):
                metadata['offered_qos_profiles'] = yaml.safe_dump(profiles, sort_keys=False)
            if topic.type and schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(*schema)
            self._channels[topic.name] = self._writer.register_channel(
                topic.name, topic.encoding, self._schemas.get(schema, 0), metadata
            )
        self._waiting.clear()

    def _failure(self, error: OSError) -> RecordingError:
        """Remove the recording; the error to raise."""
        self.discard()
        return RecordingError(
            f'{self.path} cannot be written ({error.strerror}): check the space and the permissions there.'
        )

    def _information(self) -> dict[str, object]:
        """The metadata of rosbag2, version 9, with its keys in its order."""
        count = sum(self._counts.values())
        start = self._start if count else 0
        starting_time = {'nanoseconds_since_epoch': start}
        duration = {'nanoseconds': self._end - start}
        # Copies, because YAML would write an alias for the second use of an object.
        return {
            'version': 9,
            'storage_identifier': 'mcap',
            'duration': dict(duration),
            'starting_time': dict(starting_time),
            'message_count': count,
            'topics_with_message_count': [
                {'topic_metadata': _topic_metadata(topic), 'message_count': self._counts[topic.name]}
                for topic in self._topics.values()
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [self._file_name],
            'files': [
                {
                    'path': self._file_name,
                    'starting_time': dict(starting_time),
                    'duration': dict(duration),
                    'message_count': count,
                }
            ],
            'custom_data': None,
            'ros_distro': 'jazzy',
        }


def _topic_metadata(topic: Topic) -> dict[str, object]:
    return {
        'name': topic.name,
        'type': topic.type,
        'serialization_format': topic.encoding,
        'offered_qos_profiles': _qos_in_words(topic.qos),
        'type_description_hash': topic.type_hash,
    }


def _is_only_a_recording(folder: Path) -> bool:
    """Whether a folder holds nothing but the files of a recording."""
    return all(
        entry.is_file() and (entry.suffix == '.mcap' or entry.name == 'metadata.yaml')
        for entry in folder.iterdir()
    )


def _load_qos(text: str) -> list[QosProfile]:
    """Parse QoS profiles from the YAML of rosbag2; none if it is invalid."""
    try:
        profiles = yaml.safe_load(text)
    except yaml.YAMLError:
        return []
    return [profile for profile in profiles if isinstance(profile, dict)] if isinstance(profiles, list) else []


def _qos_in_words(text: str) -> list[QosProfile]:
    """Parse QoS profiles, and replace the numbers of policies by words."""
    return [{key: _policy_name(key, value) for key, value in profile.items()} for profile in _load_qos(text)]


def _policy_name(key: str, value: object) -> object:
    names = _POLICY_NAMES.get(key, [])
    return names[value] if isinstance(value, int) and 0 <= value < len(names) else value
