# SPDX-License-Identifier: Apache-2.0
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
from .simulated import SURFACE
from .topics import Topic

_KEY = 'unit'


def with_unit(topic: Topic, unit: str | None) -> Topic:
    """The topic with the unit of its clouds; None: not known."""
    return topic if unit is None else replace(topic, metadata={**topic.metadata, _KEY: unit})


def unit_of(reader: RecordingReader, name: str) -> str | None:
    """The unit of the clouds on a topic; for an output of the filter, that of the clouds it comes from.

    Clouds of focus stacks are in m, and so is the true surface of a simulated one. None: the recording does not
    say.
    """
    if unit := reader.topics[name].metadata.get(_KEY):
        return unit
    if name == SURFACE or any(topic.namespace_of(name) is not None for topic in (STACK_POINTS, STACK_PREVIEW)):
        return 'm'
    for output in (FILTERED, REPAIRED, LAST_POINTS):
        namespace = output.namespace_of(name)
        if namespace is not None:
            beside = [each for each in reader.topics.values() if each.name.rpartition('/')[0] == namespace]
            units = {each.metadata[_KEY] for each in beside if _KEY in each.metadata}
            if len(units) == 1:
                return units.pop()
            # Without clouds beside them, the outputs are those of a stack.
            clouds = POINTS.within(namespace) in reader.topics
            return 'm' if not clouds and STACK_FRAMES.within(namespace) in reader.topics else None
    return None
