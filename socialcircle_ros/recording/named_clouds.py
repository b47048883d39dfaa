# SPDX-License-Identifier: Apache-2.0
"""Names for the clouds of a recording: the topic and the number of the cloud on it."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeVar

from socialcircle_ros.pipeline.stacks import Refusal

from .offline import SourceCloud

Item = TypeVar('Item')


class NamedCloud(NamedTuple):
    """A cloud and its name, such as `/cell1/points 3`; numbers start at 0."""

    name: str
    cloud: SourceCloud


def named_clouds(events: Iterable[SourceCloud | Refusal]) -> Iterator[NamedCloud | Refusal]:
    """Give each cloud its name; refusals pass unchanged."""
    counts: Counter[str] = Counter()
    for event in events:
        if isinstance(event, Refusal):
            yield event
        else:
            yield NamedCloud(f'{event.topic} {counts[event.topic]}', event)
            counts[event.topic] += 1


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
