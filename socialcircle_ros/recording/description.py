# SPDX-License-Identifier: Apache-2.0
"""What a recording, a measurement file or a focus stack holds."""

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

import numpy as np

from socialcircle_ros.cloud import measured_points
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import CloudError, SocialCircleError
from socialcircle_ros.formats import format_of, surface_of
from socialcircle_ros.interface import POINTS
from socialcircle_ros.lengths import NOT_KNOWN, range_text, unit_name
from socialcircle_ros.messages import image
from socialcircle_ros.messages.header import FIRST_DATE
from socialcircle_ros.messages.image import Image
from socialcircle_ros.messages.point_cloud import PointCloud

from . import reader
from .any_file import is_measurement_file
from .importers import ImportedCloud, import_cloud
from .origins import OWN_RECORDS, FileOrigin, origins_of
from .stacks import ImportedStack, import_stack, is_stack
from .topics import Message, Topic
from .units import unit_of

_FILES_LISTED = 8


class TopicDescription(NamedTuple):
    """What a recording has on one topic.

    Attributes:
        name: of the topic.
        type: of its messages.
        messages: their number.
        size: of the first message, for clouds and images, in rows and columns, with the type; else ''.
        unit: of the coordinates of clouds; None: not known, or no cloud.
    """

    name: str
    type: str
    messages: int
    size: str
    unit: str | None

    def text(self) -> str:
        """All of it in one line."""
        unit = f'in {unit_name(self.unit)}' if self.unit else NOT_KNOWN
        parts = [self.size] * bool(self.size) + [unit] * (self.type == POINTS.type)
        return '  '.join((self.name, self.type, ', '.join((str(self.messages), *parts))))


@dataclass(frozen=True)
class Description:
    """What a file holds.

    Attributes:
        path: of the file or folder.
        kind: what it is, such as `MCAP file`.
        facts: texts by name, in the order in which they are read.
        topics: those of a recording.
        damage: where a recording is damaged; None: it is sound, or no recording.
    """

    path: Path
    kind: str
    facts: Mapping[str, str]
    topics: Sequence[TopicDescription] = ()
    damage: str | None = None


@dataclass
class _TopicTally:
    counts: Counter[str] = field(default_factory=Counter)
    sizes: dict[str, str] = field(default_factory=dict)
    first: int | None = None
    last: int = 0

    def take(self, message: Message, topic: Topic) -> None:
        self.counts[message.topic] += 1
        self.first = message.log_time if self.first is None else min(self.first, message.log_time)
        self.last = max(self.last, message.log_time)
        if message.topic not in self.sizes:
            self.sizes[message.topic] = _size(message.data, topic.type)


def describe(path: str | Path) -> Description:
    """Describe a recording, a measurement file, or a focus stack. A recording is read whole, to find its damage.

    Raises:
        SocialCircleError: the file cannot be read; the message says why and what to do.
    """
    path = Path(path)
    recorded = (path.is_dir() and any(path.glob('*.mcap*'))) or (path / 'metadata.yaml').exists()
    if not recorded and is_stack(path):
        return _stack(path)
    return _measurement_file(path) if is_measurement_file(path) else _recording(path)


def _recording(path: Path) -> Description:
    seen = _TopicTally()
    with reader.open_recording(path) as opened:
        for message in opened.messages():
            seen.take(message, opened.topics[message.topic])
        rows = [
            TopicDescription(
                name,
                topic.type,
                seen.counts[name],
                seen.sizes.get(name, ''),
                unit_of(opened, name) if topic.type == POINTS.type else None,
            )
            for name, topic in sorted(opened.topics.items())
        ]
        origins = list(origins_of(opened).values())
        extras = [f'attachment {each.name}' for each in opened.attachments()]
        extras += [f'metadata {each.name}' for each in opened.metadata() if each.name not in OWN_RECORDS]
        damage = opened.damage
    files = [path] if path.is_file() else [each for each in path.iterdir() if each.is_file()]
    facts = {
        'size': _bytes_text(sum(each.stat().st_size for each in files)),
        'messages': str(sum(seen.counts.values())),
        'duration': f'{(seen.last - (seen.first or 0)) / 1e9:.3f} s',
    }
    if seen.first is not None:
        start = datetime.fromtimestamp(seen.first / 1e9, tz=timezone.utc)
        facts['start'] = f'{start:%Y-%m-%d %H:%M:%S} UTC' if seen.first >= FIRST_DATE else 'no time'
    facts |= _imported(origins)
    if extras:
        facts['also'] = ', '.join(extras)
    return Description(path, 'MCAP file' if path.is_file() else 'rosbag2 directory', facts, rows, damage)


def _imported(origins: Sequence[FileOrigin]) -> dict[str, str]:
    """The files that the clouds come from, with their units; the first few of many."""
    if not origins:
        return {}
    listed = '; '.join(f'{each.file} ({each.unit_text()})' for each in origins[:_FILES_LISTED])
    more = len(origins) - _FILES_LISTED
    return {'imported': f'{listed}; and {more} more' if more > 0 else listed}


def _measurement_file(path: Path) -> Description:
    cloud = import_cloud(path)
    measured = measured_points(cloud.points)
    heights = cloud.points[..., 2][measured].astype(np.float64)
    form = format_of(path)
    rows, columns = measured.shape
    facts = {
        'size': _bytes_text(path.stat().st_size),
        'points': f'{size_text(rows, columns)}, {cloud.points.dtype}',
        'measured': f'{np.count_nonzero(measured)} of {measured.size}',
        'unit': _unit_text(cloud),
    }
    try:
        dx, dy = surface_of(cloud.organized()).surface.pitch
        facts['pitch'] = f'{range_text(dx, dy, cloud.unit, separator=" × ")} (x × y)'
    except CloudError as reason:
        facts['pitch'] = f'none: {reason}'
    facts['heights'] = range_text(float(heights.min()), float(heights.max()), cloud.unit)
    if cloud.fields:
        facts['fields'] = ', '.join(f'{name} ({values.dtype})' for name, values in cloud.fields.items())
    return Description(path, cloud.kind or f'{form.title if form else "measurement"} file', facts)


def _unit_text(cloud: ImportedCloud) -> str:
    if cloud.unit is None:
        return 'not known: the file does not state it'
    unit = unit_name(cloud.unit)
    return f'{unit}, taken, because the file does not state it' if cloud.unit_note else unit


def _stack(path: Path) -> Description:
    stack = import_stack(path)
    first = next(stack.frames())
    facts = {
        'frames': str(len(stack.z)),
        'z': _z_text(stack),
        'image': f'{size_text(*first.shape[:2])}, {first.dtype}',
    }
    return Description(path, 'focus stack', facts)


def _z_text(stack: ImportedStack) -> str:
    low, high = float(stack.z.min()), float(stack.z.max())
    if stack.in_metres:
        return range_text(low, high, 'm')
    return f'{low:g} to {high:g} in its own unit, which is not stated'.replace('-', '−')


def _size(data: bytes, type_name: str) -> str:
    """The size of a cloud or an image; '' for other messages, and for one that cannot be read."""
    with suppress(SocialCircleError):
        if type_name == POINTS.type:
            cloud = PointCloud.decode(data)
            kinds = ', '.join(each.name for each in cloud.fields)
            return f'{size_text(cloud.height, cloud.width)} ({kinds})'
        if type_name == image.TYPE:
            found = Image.decode(data)
            return f'{size_text(found.height, found.width)} {found.encoding}'
    return ''


def _bytes_text(count: int) -> str:
    for unit in ('bytes', 'kB', 'MB'):
        if count < 1000:
            return f'{count:.4g} {unit}'
        count /= 1000  # type: ignore[assignment]
    return f'{count:.4g} GB'
