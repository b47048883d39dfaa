"""A recording in, a recording out: the same filter as the node's, cloud by cloud, always with the same result."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.messages import diagnostics, image, point_cloud
from socialcircle_ros.pipeline import Cleaned, clean
from socialcircle_ros.settings import CircleSettings, OutputSettings

from .reader import RecordingReader, open_recording
from .topics import Message, ros_topic
from .writer import Compression, RecordingWriter

INPUT = 'points'
FILTERED, MASK, MEASUREMENT = 'points_filtered', 'outlier_mask', 'social_circle/measurement'


@dataclass
class Summary:
    """What became of a recording."""

    clouds: int = 0
    refused: dict[str, int] = field(default_factory=dict)
    """How many clouds were refused, by reason."""
    passed: int = 0
    """Messages of other topics, passed on as they were."""
    replaced: list[str] = field(default_factory=list)
    """Topics of an earlier run in the recording, whose messages give way to the new ones."""
    damage: str | None = None
    """Where the recording breaks off; None: it is sound."""


def filter_recording(
    source: str | Path,
    target: str | Path,
    circle: CircleSettings,
    output: OutputSettings,
    *,
    topics: tuple[str, ...] = (),
    compression: Compression = 'none',
    overwrite: bool = False,
    seen: Callable[[Message, Cleaned | None], None] = lambda message, cleaned: None,
) -> Summary:
    """Filter each cloud of a recording, and write a recording with the results beside all that it had.

    Beside a topic `cell/points` come `cell/points_filtered`, `cell/outlier_mask` and
    `cell/social_circle/measurement`, each with the times of its cloud; measurements hold no stage times, so
    that the same recording and settings give the same bytes. One cloud is in memory at a time.

    Args:
        source: an MCAP file or a rosbag2 directory.
        target: where to write; a name that ends in .mcap, or a directory.
        circle: how to filter.
        output: what to write beside the filtered clouds.
        topics: which topics to filter; none: `clouds_of`.
        compression: of the target's chunks.
        overwrite: whether a recording that is there may be replaced.
        seen: called after each message, with its result where it was a cloud that was filtered.

    Raises:
        RecordingError: it cannot be read or written, or it has no topic of clouds.
    """
    summary = Summary()
    with open_recording(source) as reader:
        chosen = topics or clouds_of(reader)
        for name in chosen:
            if name not in reader.topics or reader.topics[name].type != point_cloud.TYPE:
                raise RecordingError(f'{source} has no topic {name} of clouds; it has: {_listed(reader)}.')
        results = {name: _beside(name) for name in chosen}
        produced = {name for names in results.values() for name in names}
        summary.replaced = sorted(produced & reader.topics.keys())
        with RecordingWriter(target, compression=compression, overwrite=overwrite, source=source) as writer:
            for name, topic in reader.topics.items():
                if name not in produced:
                    writer.add_topic(topic)
            for filtered, mask, measurement in results.values():
                writer.add_topic(ros_topic(filtered, point_cloud.TYPE))
                if output.mask:
                    writer.add_topic(ros_topic(mask, image.TYPE))
                writer.add_topic(ros_topic(measurement, diagnostics.TYPE))
            for message in reader.messages():
                if message.topic in produced:
                    continue
                writer.write(*message)
                cleaned = None
                if message.topic in results:
                    cleaned = _cleaned(message, circle, output, summary)
                    if cleaned is not None:
                        _write(writer, message, results[message.topic], cleaned)
                else:
                    summary.passed += 1
                seen(message, cleaned)
        summary.damage = reader.damage
    return summary


def clouds_of(reader: RecordingReader) -> tuple[str, ...]:
    """The topics to filter: those named `points`, in any namespace; else the only one with clouds.

    Raises:
        RecordingError: there is none, or several and none is named so.
    """
    clouds = [name for name, topic in reader.topics.items() if topic.type == point_cloud.TYPE]
    named = tuple(name for name in clouds if name.rsplit('/', 1)[-1] == INPUT)
    if named:
        return named
    if len(clouds) == 1:
        return (clouds[0],)
    if not clouds:
        raise RecordingError(f'{reader.path} has no clouds ({point_cloud.TYPE}); it has: {_listed(reader)}.')
    raise RecordingError(f'{reader.path} has several topics of clouds; choose with --topic: {", ".join(clouds)}.')


def _beside(topic: str) -> tuple[str, str, str]:
    """Names of the results of a topic: in its namespace, as the node would publish them."""
    namespace = topic.rpartition('/')[0]
    return f'{namespace}/{FILTERED}', f'{namespace}/{MASK}', f'{namespace}/{MEASUREMENT}'


def _listed(reader: RecordingReader) -> str:
    return ', '.join(f'{name} ({topic.type})' for name, topic in sorted(reader.topics.items())) or 'no topics'


def _cleaned(message: Message, circle: CircleSettings, output: OutputSettings, summary: Summary) -> Cleaned | None:
    """Filter one cloud; a refusal is counted with its reason, and ends nothing."""
    try:
        cleaned = clean(message.data, circle, output)
    except SocialCircleError as refusal:
        summary.refused[str(refusal)] = summary.refused.get(str(refusal), 0) + 1
        return None
    summary.clouds += 1
    return cleaned


def _write(writer: RecordingWriter, message: Message, names: tuple[str, str, str], cleaned: Cleaned) -> None:
    results = (cleaned.filtered, cleaned.mask, cleaned.status.encode())
    for name, data in zip(names, results, strict=True):
        if data is not None:
            writer.write(name, data, message.log_time, message.publish_time, message.sequence)
