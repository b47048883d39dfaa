# SPDX-License-Identifier: Apache-2.0
"""Names for the clouds of a recording: the topic and the number of the cloud on it."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

from socialcircle_ros.arguments import OneOrSeveral
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.settings import PipelineSettings

from .any_file import is_measurement_file
from .offline import SourceCloud, source_clouds, with_found_parameters
from .reader import RecordingReader
from .topics import Message
from .units import unit_of

Item = TypeVar('Item')


class NamedCloud(NamedTuple):
    """A cloud and its name, such as `/cell1/points 3`; numbers start at 0."""

    name: str
    cloud: SourceCloud


def shown_name(recording: Path, name: str) -> str:
    """The name of a cloud for a person: that of its file, or its topic and number in a recording.

    A measurement file is read through a recording with one topic, and the name of this topic says nothing.
    """
    return recording.name if is_measurement_file(recording) else name


def named_clouds(
    reader: RecordingReader,
    settings: PipelineSettings,
    *,
    topics: OneOrSeveral[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[NamedCloud | Refusal]:
    """The clouds of `source_clouds` with their names; refusals name the parameters beside the recording.

    Args:
        reader: the recording.
        settings: how stacks become clouds.
        topics: which topics of clouds; none: those of `clouds_of`, and every stack.
        progress: called with the number of messages that are read, and the number of all.

    Raises:
        RecordingError: as `source_clouds`.
    """
    read = 0

    def seen(message: Message | None) -> None:
        nonlocal read
        read += message is not None
        if progress is not None:
            progress(read, reader.message_count)

    for event in source_clouds(reader, settings, topics=topics, seen=seen):
        if isinstance(event, Refusal):
            yield Refusal(with_found_parameters(event.reason, reader.path))
        else:
            yield NamedCloud(event.name, event)


def spread_clouds(
    reader: RecordingReader,
    settings: PipelineSettings,
    most: int,
    refused: Counter[str],
    *,
    topics: OneOrSeveral[str] = (),
) -> list[tuple[NamedCloud, str | None]]:
    """Choose clouds of a recording, spread evenly over it.

    Args:
        reader: the recording.
        settings: how stacks become clouds.
        most: clouds to choose.
        refused: counts the refused clouds and frames by reason.
        topics: as for `named_clouds`.

    Returns:
        Each cloud with the unit of its coordinates; None: not known.

    Raises:
        RecordingError: as `source_clouds`.
    """
    chosen = evenly_spread(not_refused(named_clouds(reader, settings, topics=topics), refused), most)
    return [(each, 'm' if each.cloud.image is not None else unit_of(reader, each.cloud.topic)) for each in chosen]


def not_refused(items: Iterable[Item | Refusal], refused: Counter[str]) -> Iterator[Item]:
    """Pass on all but refusals, which are counted by reason."""
    for item in items:
        if isinstance(item, Refusal):
            refused[item.reason] += 1
        else:
            yield item


def evenly_spread(items: Iterable[Item], count: int) -> list[Item]:
    """Choose at most `count` items, spread evenly; at most twice as many are in memory at a time."""
    kept: list[Item] = []
    stride = 1
    for number, item in enumerate(items):
        if number % stride == 0:
            kept.append(item)
        if len(kept) > 2 * count:
            kept, stride = kept[::2], 2 * stride
    return [kept[place * len(kept) // count] for place in range(count)] if len(kept) > count else kept
