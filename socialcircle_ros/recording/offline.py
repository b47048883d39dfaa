# SPDX-License-Identifier: Apache-2.0
"""A recording in, a recording out: the node's filter, cloud by cloud, with the same result each time."""

import shlex
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from socialcircle_ros.arguments import Compression, OneOrSeveral, settings_of, several
from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.focus import Registered, count_reasons
from socialcircle_ros.interface import (
    CLOUD_OUTPUTS,
    FILTERED,
    MEASUREMENT,
    POINTS,
    REPAIRED,
    STACK_FRAMES,
    STACK_IMAGE,
    STACK_JOINT_STATES,
    STACK_OUTPUTS,
    STACK_POINTS,
    NodeTopic,
    outputs_of,
)
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.pipeline.clouds import CloudOutputs, filter_cloud
from socialcircle_ros.pipeline.stacks import NOT_SET, Refusal, StackAssembler, StackEvent
from socialcircle_ros.settings import PipelineSettings
from socialcircle_ros.storage import folder_of_results

from .any_file import open_recording
from .names import found_parameters
from .overlap import WriterBehind, read_ahead
from .reader import RecordingReader
from .topics import Message, ros_topic
from .writer import RecordingWriter

Seen = Callable[[Message | None], None]
"""Called after each message, and with None at the end."""

KeptPoints = tuple[Cloud, Mask]
"""A cloud (H, W, 3), and which of its points (H, W) are kept."""

Filtered = Callable[['SourceCloud', 'CloudOutputs | Refusal', KeptPoints | None], None]
"""Called after each cloud with what came of it, and with its kept points; None: refused."""


@dataclass
class Summary:
    """What was done with a recording.

    Attributes:
        clouds: clouds that were filtered, those of stacks included.
        stacks: stacks that became clouds.
        refused: number of refused clouds and frames by reason.
        first_refused: name of the first refused cloud by reason, as `SourceCloud` has it.
        warnings: number of stacks by warning.
        kept: messages of the recording, which were copied.
        replaced: topics of an earlier run in the recording; the new messages replace theirs.
        damage: where the recording breaks off; None: it is sound.
    """

    clouds: int = 0
    stacks: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    first_refused: dict[str, str] = field(default_factory=dict)
    warnings: dict[str, int] = field(default_factory=dict)
    kept: int = 0
    replaced: list[str] = field(default_factory=list)
    damage: str | None = None

    def refuse(self, reason: str) -> None:
        """Count a refusal."""
        self.refused[reason] = self.refused.get(reason, 0) + 1

    def warn(self, warning: str) -> None:
        """Count a warning."""
        self.warnings[warning] = self.warnings.get(warning, 0) + 1


@dataclass(frozen=True)
class SourceCloud:
    """A cloud of a recording before it is filtered.

    Attributes:
        namespace: of its cell, such as `/cell1`; '': the root.
        topic: `/cell1/points`; for a stack `/cell1/stack/points`.
        points: the serialized PointCloud2.
        number: of the cloud on its topic, from 0.
        message: the outputs are recorded with the times of this message: the cloud itself, or the frame that ended
            the stack.
        image: the serialized image in focus of a stack; None for a cloud.
        warning: why a stack's cloud may be wrong; '': there is no sign of it.
        depth_of_field: of a stack in m, where its focus curves show it.
        frames: how many frames of a stack were measured; 0 for a cloud.
        reasons: number of pixels of a stack by objection to their depth.
        focus_step: step of the focus measure of a stack, pixels; 0 for a cloud.
        drift: how far the frames of a stack moved sideways, pixels; None: unknown, or a cloud.
        registered: what was corrected of it; None: nothing was asked for, or a cloud.
    """

    namespace: str
    topic: str
    points: bytes
    number: int
    message: Message
    image: bytes | None = None
    warning: str = ''
    depth_of_field: float | None = None
    frames: int = 0
    reasons: Mapping[str, int] = field(default_factory=dict)
    focus_step: int = 0
    drift: float | None = None
    registered: Registered | None = None

    @property
    def name(self) -> str:
        """The topic and the number, such as `/cell1/points 3`."""
        return f'{self.topic} {self.number}'


def filter_recording(
    source: str | Path,
    target: str | Path,
    settings: PipelineSettings,
    *,
    topics: OneOrSeveral[str] = (),
    compression: Compression = 'none',
    overwrite: bool = False,
    seen: Seen = lambda message: None,
    filtered: Filtered | None = None,
) -> Summary:
    """Filter each cloud of a recording; write a recording with the outputs beside everything that it held.

    The outputs of `cell/points` are on the topics of the node in that namespace, such as `cell/points_filtered`,
    each with the times of its cloud. Frames on `cell/stack/image` become clouds on `cell/stack/points` first.
    Measurements hold no stage times, so the same recording and settings give the same bytes. Few clouds, or one
    stack, are in memory at a time; the next messages are read and the last ones written while a cloud is filtered.
    Nothing is written if no cloud can be filtered.

    Args:
        source: an MCAP file, a rosbag2 directory, or a measurement file.
        target: where to write; a name that ends in .mcap, or a directory. Its folder is created.
        settings: how to filter, and which outputs are wanted.
        topics: which topics of clouds to filter; none: those of `clouds_of`.
        compression: of the target's chunks.
        overwrite: whether an existing recording may be replaced.
        seen: called after each message, and with None at the end.
        filtered: called after each cloud with what came of it.

    Raises:
        SettingError: the settings are not `PipelineSettings`, or there is no such compression.
        RecordingError: it cannot be read or written, or it holds neither clouds nor frames of a stack.
        SocialCircleError: the folder of the target cannot be created.
    """
    summary = Summary()
    with open_recording(source) as reader:
        cells = _cells(reader, topics, settings)
        produced = {name for cell in cells for name in cell.replaced}
        summary.replaced = sorted(produced & reader.topics.keys())
        with (
            folder_of_results(Path(target).parent),
            RecordingWriter(target, compression=compression, overwrite=overwrite, source=source) as writer,
        ):
            for attachment in reader.attachments():
                writer.add_attachment(attachment)
            for record in reader.metadata():
                writer.add_metadata(record)
            for name, topic in reader.topics.items():
                if name not in produced:
                    writer.add_topic(topic, name)
            for cell in cells:
                for name, kind in cell.outputs.items():
                    writer.add_topic(ros_topic(name, kind))
            with closing(read_ahead(reader.messages())) as messages, WriterBehind(writer) as behind:
                for message, events in _walk(messages, cells):
                    if message is not None:
                        behind.write(message)
                        summary.kept += 1
                    for event in events:
                        if isinstance(event, Refusal):
                            summary.refuse(event.reason)
                        else:
                            _filter(event, settings, summary, behind, filtered)
                    seen(message)
            if not summary.clouds:
                writer.discard()
        summary.damage = reader.damage
    return summary


def with_found_parameters(reason: str, recording: Path) -> str:
    """The reason of a refusal; if a parameter of the stack is not set, with the file beside the recording."""
    found = found_parameters(recording) if NOT_SET in reason else None
    if found is None:
        return reason
    given = shlex.quote(str(found))
    return f'{reason.rstrip(".")}; {found} beside it has the parameters: --params-file {given}'


def measure_recording(
    source: str | Path, settings: PipelineSettings, filtered: Filtered, *, topics: OneOrSeveral[str] = ()
) -> Summary:
    """Filter each cloud of a recording as `filter_recording` does, but write nothing.

    Args:
        source: an MCAP file, a rosbag2 directory, or a measurement file.
        settings: how to filter.
        filtered: called after each cloud with what came of it.
        topics: which topics of clouds to filter; none: those of `clouds_of`.

    Raises:
        RecordingError: as `filter_recording`.
    """
    summary = Summary()
    with open_recording(source) as reader:
        for event in source_clouds(reader, settings, topics=topics):
            if isinstance(event, Refusal):
                summary.refuse(event.reason)
            else:
                _filter(event, settings, summary, None, filtered)
        summary.damage = reader.damage
    return summary


def source_clouds(
    reader: RecordingReader,
    settings: PipelineSettings,
    *,
    topics: OneOrSeveral[str] = (),
    seen: Seen = lambda message: None,
) -> Iterator[SourceCloud | Refusal]:
    """The clouds that `filter_recording` would filter, in their order; stacks become clouds first.

    Args:
        reader: the recording.
        settings: how stacks become clouds.
        topics: which topics of clouds; none: those of `clouds_of`, and every stack.
        seen: called after each message, and with None at the end.

    Raises:
        RecordingError: as `filter_recording`.
    """
    for message, events in _walk(reader.messages(), _cells(reader, topics, settings)):
        yield from events
        seen(message)


def measurements_of(reader: RecordingReader) -> dict[tuple[str, str], diagnostics.Status]:
    """The measurements that a node, or an earlier run, recorded: by namespace and stamp."""
    names = [name for name in reader.topics if MEASUREMENT.namespace_of(name) is not None]
    found = {}
    for message in reader.messages(names):
        status = diagnostics.Status.decode(message.data)
        found[MEASUREMENT.namespace_of(message.topic) or '', status.values.get('stamp', '')] = status
    return found


def clouds_of(reader: RecordingReader) -> tuple[str, ...]:
    """The topics of clouds to filter: those named `points` in any namespace.

    A recording without such a topic and without stacks may hold one topic of clouds under any name.

    Raises:
        RecordingError: there are several, and none is named so.
    """
    clouds = [
        name
        for name, topic in reader.topics.items()
        if topic.type == POINTS.type and STACK_POINTS.namespace_of(name) is None
    ]
    named = tuple(name for name in clouds if POINTS.namespace_of(name) is not None)
    if named or stacks_of(reader):
        return named
    if len(clouds) < 2:
        return tuple(clouds)
    raise reader.refusal(
        f'{reader.path} has several topics of clouds; choose with --topic: {", ".join(sorted(clouds))}.'
    )


def stacks_of(reader: RecordingReader) -> tuple[str, ...]:
    """The namespaces that hold frames of focus stacks."""
    namespaces = [
        STACK_FRAMES.namespace_of(name) for name, topic in reader.topics.items() if topic.type == STACK_FRAMES.type
    ]
    return tuple(namespace for namespace in namespaces if namespace is not None)


class _RecordedCell:
    """One namespace of the recording: its inputs, and the outputs beside them."""

    def __init__(self, namespace: str, clouds: Iterable[str], stack: bool, settings: PipelineSettings) -> None:
        self._namespace = namespace
        self._timeout_s = settings.stack.timeout
        self._clouds = set(clouds)
        self._joint_states = STACK_JOINT_STATES.within(namespace)
        self._assembler = StackAssembler()
        self._assembler.configure(settings.focus, settings.stack)
        self._last_frame: Message | None = None
        self._numbers: defaultdict[str, count[int]] = defaultdict(count)
        stack_inputs = (STACK_FRAMES.within(namespace), self._joint_states)
        self.inputs = {*self._clouds, *(stack_inputs if stack else ())}
        of_stacks = STACK_OUTPUTS if stack else ()
        wanted = (*of_stacks, *outputs_of(settings.circle.mode, settings.output))
        self.outputs = {topic.within(namespace): topic.type for topic in wanted}
        self.replaced = {topic.within(namespace) for topic in (*of_stacks, *CLOUD_OUTPUTS)}

    def take(self, message: Message) -> Iterator[SourceCloud | Refusal]:
        """Take in a message of this cell; yields the clouds that come of it."""
        if message.topic in self._clouds:
            yield SourceCloud(
                self._namespace, message.topic, message.data, next(self._numbers[message.topic]), message
            )
            return
        if message.topic == self._joint_states:
            yield from self._handle(self._assembler.add_joint_state(message.data), message)
            return
        before = self._last_frame
        if before is not None and 0 < self._timeout_s < (message.log_time - before.log_time) / 1e9:
            yield from self._handle(self._assembler.finish(), before)
        self._last_frame = message
        yield from self._handle(self._assembler.add_frame(message.data), message)

    def finish(self, last: Message) -> Iterator[SourceCloud | Refusal]:
        """Close the running stack at the end of the recording."""
        if self._assembler.running:
            yield from self._handle(self._assembler.finish(), last)

    def _handle(self, events: Iterator[StackEvent], message: Message) -> Iterator[SourceCloud | Refusal]:
        for event in events:
            if isinstance(event, Refusal):
                yield event
            elif not event.preview:
                topic = STACK_POINTS.within(self._namespace)
                yield SourceCloud(
                    self._namespace,
                    topic,
                    event.points,
                    next(self._numbers[topic]),
                    message,
                    event.image,
                    event.warning,
                    event.depth_of_field,
                    event.frames,
                    count_reasons(event.reasons),
                    event.focus_step,
                    event.drift,
                    event.registered,
                )


def _walk(
    messages: Iterable[Message], cells: Sequence[_RecordedCell]
) -> Iterator[tuple[Message | None, Iterator[SourceCloud | Refusal]]]:
    """Each message that is no output of an earlier run, with what comes of it; None at the end."""
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
    cloud: SourceCloud,
    settings: PipelineSettings,
    summary: Summary,
    writer: WriterBehind | None,
    filtered: Filtered | None,
) -> None:
    """Filter one cloud and write its outputs, if there is a writer; a refusal is counted with its reason."""
    messages: dict[NodeTopic, bytes] = {}
    if cloud.image is not None:
        summary.stacks += 1
        if cloud.warning:
            summary.warn(cloud.warning)
        messages = {STACK_POINTS: cloud.points, STACK_IMAGE: cloud.image}
    kept_points: KeptPoints | None = None

    def take_kept(xyz: Cloud, kept: Mask) -> None:
        nonlocal kept_points
        kept_points = xyz, kept

    try:
        outputs = filter_cloud(cloud.points, settings, cloud.depth_of_field, take_kept)
    except SocialCircleError as refusal:
        summary.first_refused.setdefault(str(refusal), cloud.name)
        summary.refuse(str(refusal))
        if filtered is not None:
            filtered(cloud, Refusal(str(refusal)), None)
    else:
        summary.clouds += 1
        messages |= outputs.messages
        if filtered is not None:
            filtered(cloud, outputs, kept_points)
    times = cloud.message
    for topic, data in messages.items():
        name = topic.within(cloud.namespace)
        if writer is not None:
            writer.write(Message(name, data, times.log_time, times.publish_time, times.sequence))


def _cells(reader: RecordingReader, topics: OneOrSeveral[str], settings: PipelineSettings) -> list[_RecordedCell]:
    """The namespaces that hold clouds or stacks to filter.

    Raises:
        SettingError: the settings are of another class.
        RecordingError: there is none, or a topic that was asked for holds no clouds.
    """
    settings_of(PipelineSettings, settings)
    wanted = several(topics)
    stacks = () if wanted else stacks_of(reader)
    clouds = wanted or clouds_of(reader)
    for name in clouds:
        if name not in reader.topics or reader.topics[name].type != POINTS.type:
            raise reader.refusal(f'{reader.path} has no topic {name} of clouds; it has: {_listed(reader)}.')
        if any(topic.namespace_of(name) is not None for topic in (FILTERED, REPAIRED)):
            raise RecordingError(f'{name} is an output of this filter; filter the clouds that it came from.')
    if not clouds and not stacks:
        raise reader.refusal(
            f'{reader.path} has neither clouds ({POINTS.type}) nor frames ({STACK_FRAMES.name}); it has:'
            f' {_listed(reader)}.'
        )
    by_namespace: dict[str, list[str]] = {namespace: [] for namespace in stacks}
    for name in clouds:
        by_namespace.setdefault(name.rpartition('/')[0], []).append(name)
    for names in by_namespace.values():
        if len(names) > 1:
            raise RecordingError(
                f'{" and ".join(names)} are in one namespace, so their outputs would mix; filter one at a time.'
            )
    return [
        _RecordedCell(namespace, names, namespace in stacks, settings) for namespace, names in by_namespace.items()
    ]


def _listed(reader: RecordingReader) -> str:
    return ', '.join(f'{name} ({topic.type})' for name, topic in sorted(reader.topics.items())) or 'no topics'
