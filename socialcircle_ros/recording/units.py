"""The unit of the clouds of a topic, which a recording keeps in the metadata of the topic's channel."""

from dataclasses import replace

from socialcircle_ros.interface import (
    FILTERED,
    LAST_POINTS,
    POINTS,
    REPAIRED,
    STACK_FRAMES,
    STACK_POINTS,
    STACK_PREVIEW,
)

from .reader import RecordingReader
from .topics import Topic

_KEY = 'unit'


def with_unit(topic: Topic, unit: str | None) -> Topic:
    """The topic with the unit of its clouds; None: not known."""
    return topic if unit is None else replace(topic, metadata={**topic.metadata, _KEY: unit})


def unit_of(reader: RecordingReader, name: str) -> str | None:
    """The unit of the clouds on a topic; for an output of the filter, that of the clouds it comes from.

    Clouds of focus stacks are in m. None: the recording does not say.
    """
    if unit := reader.topics[name].metadata.get(_KEY):
        return unit
    if any(topic.namespace_of(name) is not None for topic in (STACK_POINTS, STACK_PREVIEW)):
        return 'm'
    for output in (FILTERED, REPAIRED, LAST_POINTS):
        namespace = output.namespace_of(name)
        if namespace is not None:
            source = reader.topics.get(POINTS.within(namespace))
            # Without clouds beside them, the outputs are those of a stack.
            return 'm' if source is None and STACK_FRAMES.within(namespace) in reader.topics else _unit(source)
    return None


def _unit(topic: Topic | None) -> str | None:
    return None if topic is None else topic.metadata.get(_KEY)
