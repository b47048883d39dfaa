"""A recording in, a recording out: the node's filter, cloud by cloud, always with the same result."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.messages import diagnostics, image, point_cloud
from socialcircle_ros.pipeline import Cleaned, clean
from socialcircle_ros.settings import CircleSettings, FocusSettings, OutputSettings, RepairSettings, StackSettings
from socialcircle_ros.stacking import Event, Refusal, StackAssembler

from .overlap import WriterBehind, read_ahead
from .reader import RecordingReader, open_recording
from .topics import Message, ros_topic
from .writer import Compression, RecordingWriter

INPUT, FRAMES, JOINT_STATES = 'points', 'stack/image', 'stack/joint_states'
FILTERED, MASK, MEASUREMENT = 'points_filtered', 'outlier_mask', 'social_circle/measurement'
REPAIRED = 'points_repaired'
STACK_POINTS, STACK_IMAGE = 'stack/points', 'stack/image_in_focus'


@dataclass(frozen=True)
class Job:
    """With what a recording is filtered: the node's settings."""

    circle: CircleSettings = field(default_factory=CircleSettings)
    focus: FocusSettings = field(default_factory=FocusSettings)
    stack: StackSettings = field(default_factory=StackSettings)
    repair: RepairSettings = field(default_factory=RepairSettings)
    output: OutputSettings = field(default_factory=OutputSettings)


@dataclass
class Summary:
    """What became of a recording."""

    clouds: int = 0
    """Clouds that were filtered, of stacks too."""
    stacks: int = 0
    """Stacks that became clouds."""
    refused: dict[str, int] = field(default_factory=dict)
    """How many clouds or frames were refused, by reason."""
    passed: int = 0
    """Messages of other topics, passed on as they were."""
    replaced: list[str] = field(default_factory=list)
    """Topics of an earlier run in the recording, whose messages give way to the new ones."""
    damage: str | None = None
    """Where the recording breaks off; None: it is sound."""

    def refuse(self, reason: str) -> None:
        """Count a refusal."""
        self.refused[reason] = self.refused.get(reason, 0) + 1


def filter_recording(
    source: str | Path,
    target: str | Path,
    job: Job,
    *,
    topics: tuple[str, ...] = (),
    compression: Compression = 'none',
    overwrite: bool = False,
    seen: Callable[[Message, list[Cleaned]], None] = lambda message, cleaned: None,
) -> Summary:
    """Filter each cloud of a recording, and write a recording with the results beside all that it had.

    Beside a topic `cell/points` come `cell/points_filtered`, `cell/outlier_mask` and
    `cell/social_circle/measurement`, each with the times of its cloud; measurements hold no stage times, so
    that the same recording and settings give the same bytes. Frames on `cell/stack/image` become clouds on
    `cell/stack/points` first. A few clouds, or one stack, are in memory at a time: what comes next is read, and
    what is done is written, while a cloud is filtered.

    Args:
        source: an MCAP file or a rosbag2 directory.
        target: where to write; a name that ends in .mcap, or a directory.
        job: the settings.
        topics: which topics of clouds to filter; none: `clouds_of`.
        compression: of the target's chunks.
        overwrite: whether a recording that is there may be replaced.
        seen: called after each message, with the results that it led to.

    Raises:
        RecordingError: it cannot be read or written, or it has neither clouds nor frames of a stack.
    """
    summary = Summary()
    with open_recording(source) as reader:
        cells = _cells(reader, topics, job, summary)
        produced = {name for cell in cells for name in cell.replaced}
        summary.replaced = sorted(produced & reader.topics.keys())
        by_input = {name: cell for cell in cells for name in cell.inputs}
        with RecordingWriter(target, compression=compression, overwrite=overwrite, source=source) as writer:
            for name, topic in reader.topics.items():
                if name not in produced:
                    writer.add_topic(topic)
            for cell in cells:
                for name, kind in cell.results.items():
                    writer.add_topic(ros_topic(name, kind))
            last = None
            with closing(read_ahead(reader.messages())) as messages, WriterBehind(writer) as behind:
                for message in messages:
                    if message.topic in produced:
                        continue
                    behind.write(*message)
                    cleaned: list[Cleaned] = []
                    if message.topic in by_input:
                        cleaned = by_input[message.topic].take(message, behind)
                    else:
                        summary.passed += 1
                    seen(message, cleaned)
                    last = message
                for cell in cells:
                    if last is not None:
                        seen(last, cell.finish(last, behind))
        summary.damage = reader.damage
    return summary


def clouds_of(reader: RecordingReader) -> tuple[str, ...]:
    """The topics of clouds to filter: those named `points`, in any namespace.

    Where there is none, and no stack either, it is the only one with clouds.

    Raises:
        RecordingError: there are several, and none is named so.
    """
    clouds = [
        name
        for name, topic in reader.topics.items()
        if topic.type == point_cloud.TYPE and _namespace(name, STACK_POINTS) is None
    ]
    named = tuple(name for name in clouds if _namespace(name, INPUT) is not None)
    if named or stacks_of(reader):
        return named
    if len(clouds) < 2:
        return tuple(clouds)
    raise RecordingError(
        f'{reader.path} has several topics of clouds; choose with --topic: {", ".join(sorted(clouds))}.'
    )


def stacks_of(reader: RecordingReader) -> tuple[str, ...]:
    """The namespaces in which there are frames of focus stacks."""
    namespaces = [_namespace(name, FRAMES) for name, topic in reader.topics.items() if topic.type == image.TYPE]
    return tuple(namespace for namespace in namespaces if namespace is not None)


class _Cell:
    """One namespace of the recording: what comes in, and what goes out beside it."""

    def __init__(self, namespace: str, clouds: Iterable[str], stack: bool, job: Job, summary: Summary) -> None:
        self._job, self._summary = job, summary
        self._clouds = set(clouds)
        self._filtered, self._mask, self._measurement = (
            f'{namespace}/{name}' for name in (FILTERED, MASK, MEASUREMENT)
        )
        self._repaired = f'{namespace}/{REPAIRED}'
        self._frames, self._joints = f'{namespace}/{FRAMES}', f'{namespace}/{JOINT_STATES}'
        self._points, self._image = f'{namespace}/{STACK_POINTS}', f'{namespace}/{STACK_IMAGE}'
        self._assembler = StackAssembler()
        self._assembler.configure(job.focus, job.stack)
        self._last_frame: Message | None = None
        self.inputs = {*self._clouds, *((self._frames, self._joints) if stack else ())}
        self.replaced = {self._filtered, self._mask, self._measurement, self._repaired}
        self.results = {self._filtered: point_cloud.TYPE, self._measurement: diagnostics.TYPE}
        if job.output.mask:
            self.results[self._mask] = image.TYPE
        if job.output.repaired:
            self.results[self._repaired] = point_cloud.TYPE
        if stack:
            self.results |= {self._points: point_cloud.TYPE, self._image: image.TYPE}
            self.replaced |= {self._points, self._image}

    def take(self, message: Message, writer: WriterBehind) -> list[Cleaned]:
        """Take in a message of this cell; what was filtered because of it."""
        if message.topic in self._clouds:
            return self._clean(message.data, message, writer)
        cleaned: list[Cleaned] = []
        timeout = self._job.stack.timeout
        if message.topic == self._joints:
            return self._handle(self._assembler.add_joint_state(message.data), message, writer)
        before = self._last_frame
        if before is not None and 0 < timeout < (message.log_time - before.log_time) / 1e9:
            cleaned += self._handle(self._assembler.finish(), before, writer)
        self._last_frame = message
        return cleaned + self._handle(self._assembler.add_frame(message.data), message, writer)

    def finish(self, last: Message, writer: WriterBehind) -> list[Cleaned]:
        """Close the stack that runs at the end of the recording."""
        return self._handle(self._assembler.finish(), last, writer) if self._assembler.running else []

    def _handle(self, events: Iterator[Event], message: Message, writer: WriterBehind) -> list[Cleaned]:
        cleaned: list[Cleaned] = []
        for event in events:
            if isinstance(event, Refusal):
                self._summary.refuse(event.reason)
            elif not event.preview:
                self._summary.stacks += 1
                self._write(writer, message, {self._points: event.points, self._image: event.image})
                cleaned += self._clean(event.points, message, writer)
        return cleaned

    def _clean(self, cloud: bytes, message: Message, writer: WriterBehind) -> list[Cleaned]:
        """Filter one cloud; a refusal is counted with its reason, and ends nothing."""
        try:
            cleaned = clean(cloud, self._job.circle, self._job.output, self._job.repair)
        except SocialCircleError as refusal:
            self._summary.refuse(str(refusal))
            return []
        self._summary.clouds += 1
        results = {self._filtered: cleaned.filtered, self._measurement: cleaned.status.encode()}
        if cleaned.mask is not None:
            results[self._mask] = cleaned.mask
        if cleaned.repaired is not None:
            results[self._repaired] = cleaned.repaired
        self._write(writer, message, results)
        return [cleaned]

    @staticmethod
    def _write(writer: WriterBehind, message: Message, results: dict[str, bytes]) -> None:
        for name, data in results.items():
            writer.write(name, data, message.log_time, message.publish_time, message.sequence)


def _cells(reader: RecordingReader, topics: tuple[str, ...], job: Job, summary: Summary) -> list[_Cell]:
    """The namespaces that have clouds or stacks to filter.

    Raises:
        RecordingError: none has, or a topic that was asked for is not one of clouds.
    """
    stacks = () if topics else stacks_of(reader)
    clouds = topics or clouds_of(reader)
    for name in clouds:
        if name not in reader.topics or reader.topics[name].type != point_cloud.TYPE:
            raise RecordingError(f'{reader.path} has no topic {name} of clouds; it has: {_listed(reader)}.')
    if not clouds and not stacks:
        raise RecordingError(
            f'{reader.path} has neither clouds ({point_cloud.TYPE}) nor frames (stack/image); it has:'
            f' {_listed(reader)}.'
        )
        if name.rpartition('/')[2] in (FILTERED, REPAIRED):
            raise RecordingError(f'{name} is a result of this filter; filter the clouds that it came from.')
    by_namespace: dict[str, list[str]] = {namespace: [] for namespace in stacks}
    for name in clouds:
        by_namespace.setdefault(name.rpartition('/')[0], []).append(name)
    for names in by_namespace.values():
        if len(names) > 1:
            raise RecordingError(
                f'{" and ".join(names)} are in one namespace, so that their results would mix; filter one'
                ' at a time.'
            )
    return [
        _Cell(namespace, names, namespace in stacks, job, summary) for namespace, names in by_namespace.items()
    ]


def _namespace(topic: str, name: str) -> str | None:
    """The namespace of a topic that is named `name` in it; None where it is not."""
    return topic[: -len(name) - 1] if topic.endswith(f'/{name}') else None


def _listed(reader: RecordingReader) -> str:
    return ', '.join(f'{name} ({topic.type})' for name, topic in sorted(reader.topics.items())) or 'no topics'
