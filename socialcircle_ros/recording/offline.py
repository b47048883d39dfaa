"""A recording in, a recording out: the node's filter, cloud by cloud, always with the same result."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.messages import diagnostics, image, point_cloud
from socialcircle_ros.pipeline.clouds import CloudOutputs, filter_cloud
from socialcircle_ros.pipeline.stacks import Refusal, StackAssembler, StackEvent
from socialcircle_ros.settings import PipelineSettings

from .overlap import WriterBehind, read_ahead
from .reader import RecordingReader, open_recording
from .topics import Message, ros_topic
from .writer import Compression, RecordingWriter

INPUT, FRAMES, JOINT_STATES = 'points', 'stack/image', 'stack/joint_states'
FILTERED, MASK, SCORE, MEASUREMENT = (
    'points_filtered',
    'outlier_mask',
    'outlier_score',
    'social_circle/measurement',
)
REPAIRED = 'points_repaired'
STACK_POINTS, STACK_IMAGE = 'stack/points', 'stack/image_in_focus'


@dataclass
class Summary:
    """What became of a recording."""

    clouds: int = 0
    """Clouds that were filtered, of stacks too."""
    stacks: int = 0
    """Stacks that became clouds."""
    refused: dict[str, int] = field(default_factory=dict)
    """How many clouds or frames were refused, by reason."""
    warnings: dict[str, int] = field(default_factory=dict)
    """Of how many stacks there is something to tell, by what."""
    passed: int = 0
    """Messages of other topics, passed on as they were."""
    replaced: list[str] = field(default_factory=list)
    """Topics of an earlier run in the recording, whose messages give way to the new ones."""
    damage: str | None = None
    """Where the recording breaks off; None: it is sound."""

    def refuse(self, reason: str) -> None:
        """Count a refusal."""
        self.refused[reason] = self.refused.get(reason, 0) + 1


@dataclass(frozen=True)
class SourceCloud:
    """A cloud of a recording, as the filter meets it.

    Attributes:
        namespace: of its cell, such as `/cell1`; empty: none.
        topic: `/cell1/points`; of a stack `/cell1/stack/points`.
        points: the serialized PointCloud2.
        message: with whose times its results are recorded: the cloud's own, or the one that ended the stack.
        image: of a stack, the serialized image in focus; None for a cloud.
        warning: why a stack's cloud may not be what was meant; empty: nothing speaks against it.
        depth_of_field: of a stack, in metres, where its focus curves tell it.
    """

    namespace: str
    topic: str
    points: bytes
    message: Message
    image: bytes | None = None
    warning: str = ''
    depth_of_field: float | None = None


def filter_recording(
    source: str | Path,
    target: str | Path,
    job: PipelineSettings,
    *,
    topics: tuple[str, ...] = (),
    compression: Compression = 'none',
    overwrite: bool = False,
    seen: Callable[[Message | None, list[CloudOutputs]], None] = lambda message, cleaned: None,
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
        seen: called after each message, None at the end, with the results that it led to.

    Raises:
        RecordingError: it cannot be read or written, or it has neither clouds nor frames of a stack.
    """
    summary = Summary()
    with open_recording(source) as reader:
        cells = _cells(reader, topics, job)
        produced = {name for cell in cells for name in cell.replaced}
        summary.replaced = sorted(produced & reader.topics.keys())
        with RecordingWriter(target, compression=compression, overwrite=overwrite, source=source) as writer:
            for name, topic in reader.topics.items():
                if name not in produced:
                    writer.add_topic(topic)
            for cell in cells:
                for name, kind in cell.results.items():
                    writer.add_topic(ros_topic(name, kind))
            with closing(read_ahead(reader.messages())) as messages, WriterBehind(writer) as behind:
                for message, events in _walk(messages, cells):
                    if message is not None:
                        behind.write(*message)
                        summary.passed += all(message.topic not in cell.inputs for cell in cells)
                    cleaned: list[CloudOutputs] = []
                    for event in events:
                        if isinstance(event, Refusal):
                            summary.refuse(event.reason)
                        else:
                            cleaned += _filter(event, job, summary, behind)
                    seen(message, cleaned)
        summary.damage = reader.damage
    return summary


def source_clouds(
    reader: RecordingReader,
    job: PipelineSettings,
    *,
    topics: tuple[str, ...] = (),
    seen: Callable[[Message | None], None] = lambda message: None,
) -> Iterator[SourceCloud | Refusal]:
    """The clouds that `filter_recording` would filter, in their order; those of stacks are made first.

    Args:
        reader: the recording.
        job: how stacks become clouds.
        topics: which topics of clouds; none: `clouds_of`, and every stack.
        seen: called after each message, None at the end.

    Raises:
        RecordingError: as `filter_recording`.
    """
    for message, events in _walk(reader.messages(), _cells(reader, topics, job)):
        yield from events
        seen(message)


def measurements_of(reader: RecordingReader) -> dict[tuple[str, str], diagnostics.Status]:
    """What a node, or an earlier run, said of each cloud: by namespace and stamp, as the measurement has it."""
    found = {}
    for message in reader.messages([name for name in reader.topics if _namespace(name, MEASUREMENT) is not None]):
        status = diagnostics.Status.decode(message.data)
        found[_namespace(message.topic, MEASUREMENT) or '', status.values.get('stamp', '')] = status
    return found


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

    def __init__(self, namespace: str, clouds: Iterable[str], stack: bool, job: PipelineSettings) -> None:
        self._namespace = namespace
        self._timeout = job.stack.timeout
        self._clouds = set(clouds)
        self._frames, self._joints = f'{namespace}/{FRAMES}', f'{namespace}/{JOINT_STATES}'
        self._assembler = StackAssembler()
        self._assembler.configure(job.focus, job.stack)
        self._last_frame: Message | None = None
        self.inputs = {*self._clouds, *((self._frames, self._joints) if stack else ())}
        kinds = {FILTERED: point_cloud.TYPE, MEASUREMENT: diagnostics.TYPE}
        if job.output.mask:
            kinds[MASK] = image.TYPE
        if job.output.score and job.circle.mode == 'adaptive':
            kinds[SCORE] = image.TYPE
        if job.output.repaired:
            kinds[REPAIRED] = point_cloud.TYPE
        replaced = {FILTERED, MASK, SCORE, MEASUREMENT, REPAIRED}
        if stack:
            kinds |= {STACK_POINTS: point_cloud.TYPE, STACK_IMAGE: image.TYPE}
            replaced |= {STACK_POINTS, STACK_IMAGE}
        self.results = {f'{namespace}/{name}': kind for name, kind in kinds.items()}
        self.replaced = {f'{namespace}/{name}' for name in replaced}

    def take(self, message: Message) -> Iterator[SourceCloud | Refusal]:
        """Take in a message of this cell; the clouds that came of it."""
        if message.topic in self._clouds:
            yield SourceCloud(self._namespace, message.topic, message.data, message)
            return
        if message.topic == self._joints:
            yield from self._handle(self._assembler.add_joint_state(message.data), message)
            return
        before = self._last_frame
        if before is not None and 0 < self._timeout < (message.log_time - before.log_time) / 1e9:
            yield from self._handle(self._assembler.finish(), before)
        self._last_frame = message
        yield from self._handle(self._assembler.add_frame(message.data), message)

    def finish(self, last: Message) -> Iterator[SourceCloud | Refusal]:
        """Close the stack that runs at the end of the recording."""
        if self._assembler.running:
            yield from self._handle(self._assembler.finish(), last)

    def _handle(self, events: Iterator[StackEvent], message: Message) -> Iterator[SourceCloud | Refusal]:
        for event in events:
            if isinstance(event, Refusal):
                yield event
            elif not event.preview:
                yield SourceCloud(
                    self._namespace,
                    f'{self._namespace}/{STACK_POINTS}',
                    event.points,
                    message,
                    event.image,
                    event.warning,
                    event.depth_of_field,
                )


def _walk(
    messages: Iterable[Message], cells: Sequence[_Cell]
) -> Iterator[tuple[Message | None, Iterator[SourceCloud | Refusal]]]:
    """Each message that is no result of an earlier run, with what comes of it; None at the end."""
    produced = {name for cell in cells for name in cell.replaced}
    by_input = {name: cell for cell in cells for name in cell.inputs}
    last = None
    for message in messages:
        if message.topic not in produced:
            cell = by_input.get(message.topic)
            yield message, cell.take(message) if cell is not None else iter(())
            last = message
    if last is not None:
        for cell in cells:
            yield None, cell.finish(last)


def _filter(
    arrival: SourceCloud, job: PipelineSettings, summary: Summary, writer: WriterBehind
) -> list[CloudOutputs]:
    """Filter one cloud and write what it gives; a refusal is counted with its reason, and ends nothing."""
    results: dict[str, bytes] = {}
    if arrival.image is not None:
        summary.stacks += 1
        if arrival.warning:
            summary.warnings[arrival.warning] = summary.warnings.get(arrival.warning, 0) + 1
        results = {STACK_POINTS: arrival.points, STACK_IMAGE: arrival.image}
    cleaned: list[CloudOutputs] = []
    try:
        cleaned = [filter_cloud(arrival.points, job.circle, job.output, job.repair, arrival.depth_of_field)]
    except SocialCircleError as refusal:
        summary.refuse(str(refusal))
    for result in cleaned:
        summary.clouds += 1
        results |= {FILTERED: result.filtered, MEASUREMENT: result.status.encode()}
        if result.mask is not None:
            results[MASK] = result.mask
        if result.score is not None:
            results[SCORE] = result.score
        if result.repaired is not None:
            results[REPAIRED] = result.repaired
    of = arrival.message
    for name, data in results.items():
        writer.write(f'{arrival.namespace}/{name}', data, of.log_time, of.publish_time, of.sequence)
    return cleaned


def _cells(reader: RecordingReader, topics: tuple[str, ...], job: PipelineSettings) -> list[_Cell]:
    """The namespaces that have clouds or stacks to filter.

    Raises:
        RecordingError: none has, or a topic that was asked for is not one of clouds.
    """
    stacks = () if topics else stacks_of(reader)
    clouds = topics or clouds_of(reader)
    for name in clouds:
        if name not in reader.topics or reader.topics[name].type != point_cloud.TYPE:
            raise RecordingError(f'{reader.path} has no topic {name} of clouds; it has: {_listed(reader)}.')
        if name.rpartition('/')[2] in (FILTERED, REPAIRED):
            raise RecordingError(f'{name} is a result of this filter; filter the clouds that it came from.')
    if not clouds and not stacks:
        raise RecordingError(
            f'{reader.path} has neither clouds ({point_cloud.TYPE}) nor frames (stack/image); it has:'
            f' {_listed(reader)}.'
        )
    by_namespace: dict[str, list[str]] = {namespace: [] for namespace in stacks}
    for name in clouds:
        by_namespace.setdefault(name.rpartition('/')[0], []).append(name)
    for names in by_namespace.values():
        if len(names) > 1:
            raise RecordingError(
                f'{" and ".join(names)} are in one namespace, so that their results would mix; filter one'
                ' at a time.'
            )
    return [_Cell(namespace, names, namespace in stacks, job) for namespace, names in by_namespace.items()]


def _namespace(topic: str, name: str) -> str | None:
    """The namespace of a topic that is named `name` in it; None where it is not."""
    return topic[: -len(name) - 1] if topic.endswith(f'/{name}') else None


def _listed(reader: RecordingReader) -> str:
    return ', '.join(f'{name} ({topic.type})' for name, topic in sorted(reader.topics.items())) or 'no topics'
