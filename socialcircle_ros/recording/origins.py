# SPDX-License-Identifier: Apache-2.0
"""Where imported clouds come from: file, unit, and the digits that metres cannot hold, as metadata of a recording.

Each imported cloud has a metadata record `socialcircle_import`. Converting float32 to metres rounds, and where
metres have the coarser grid, two neighbouring numbers become one. A record `socialcircle_rounding` says then by
which steps the numbers of the file are found again, so that `export` writes them as they were.
"""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from socialcircle_ros.cloud import Cloud
from socialcircle_ros.lengths import from_metres, known_unit, to_metres, unit_name

from .importers import ImportedCloud
from .reader import RecordingReader
from .topics import MetadataRecord

_IMPORT, _ROUNDING = 'socialcircle_import', 'socialcircle_rounding'
_STATED, _GIVEN, _TAKEN = 'stated in the file', 'given', 'taken, because the file does not state it'

OWN_RECORDS = (_IMPORT, _ROUNDING)
"""The names of the metadata records."""

Steps = NDArray[np.int8]
"""(rows, columns, 3): −1, 0 or 1 unit in the last place, from the converted number to that of the file."""


@dataclass(frozen=True)
class FileOrigin:
    """What an imported cloud comes from.

    Attributes:
        topic: of the cloud.
        stamp: of the cloud, ns.
        file: the name of the file.
        unit: of the file; None: not known.
        unit_from: how the unit is known, in words.
        converted: whether the cloud is in m and the file is not.
        rounding: the steps of `_stepped`, compressed; empty: there are none.
        measured_ns: when the cloud was measured, as the file states it, ns since 1970; None: it does not.
        changed_ns: when the file was last changed, ns since 1970; None: not kept.
    """

    topic: str
    stamp: int
    file: str
    unit: str | None
    unit_from: str
    converted: bool
    rounding: bytes = b''
    measured_ns: int | None = None
    changed_ns: int | None = None

    @property
    def time_ns(self) -> int | None:
        """When the cloud was measured, or else its file changed, ns since 1970; None: not known."""
        return self.changed_ns if self.measured_ns is None else self.measured_ns

    def records(self) -> list[MetadataRecord]:
        """The metadata records that hold it."""
        place = {'topic': self.topic, 'stamp_ns': str(self.stamp)}
        found = {
            **place,
            'file': self.file,
            'unit_of_file': self.unit or '',
            'unit_from': self.unit_from,
            'converted_to_m': str(self.converted).lower(),
        }
        times = {'measured_ns': self.measured_ns, 'changed_ns': self.changed_ns}
        found |= {name: str(time) for name, time in times.items() if time is not None}
        steps = {**place, 'steps': base64.b64encode(self.rounding).decode()}
        return [MetadataRecord(_IMPORT, found), *([MetadataRecord(_ROUNDING, steps)] if self.rounding else [])]

    def unit_text(self) -> str:
        """The unit of the file for a person."""
        return f'{unit_name(self.unit)}, {self.unit_from}' if self.unit else 'unit not known'

    def in_unit_of_file(self, points: Cloud) -> Cloud:
        """The points in the unit of the file; those that are as imported have the numbers of the file.

        Args:
            points: (rows, columns, 3) in m.
        """
        if self.unit is None:
            return points
        near = from_metres(points, self.unit)
        if not self.rounding:
            return near
        steps = np.frombuffer(zlib.decompress(self.rounding), np.int8)
        if steps.size != points.size:
            return near
        exact = _stepped(near, steps.reshape(points.shape))
        return cast('Cloud', np.where(to_metres(exact, self.unit) == points, exact, near))


def in_metres(cloud: ImportedCloud) -> tuple[ImportedCloud, bytes]:
    """A cloud in m, and the steps from its numbers back to those of the file; unchanged without a known unit."""
    unit = known_unit(cloud.unit)
    if unit is None and cloud.unit:
        note = f'the unit {cloud.unit} is no known length: its numbers are kept'
        return replace(cloud, notes=(*cloud.notes, note)), b''
    if unit in (None, 'm'):
        return cloud, b''
    points = to_metres(cloud.points, unit)
    steps = _steps(from_metres(points, unit), cloud.points)
    lost = ~np.isnan(cloud.points) & (_stepped(from_metres(points, unit), steps) != cloud.points)
    notes = cloud.notes
    if lost.any():
        notes += (
            f'{np.count_nonzero(lost.any(axis=-1))} points lose digits in metres; --keep-unit keeps them all',
        )
    found = replace(cloud, points=points, unit='m', notes=notes, pitch=None)
    return found, zlib.compress(steps.tobytes(), 9) if steps.any() else b''


def origin_of(cloud: ImportedCloud, topic: str, stamp: int, file: str, *, given: bool) -> FileOrigin:
    """Where a cloud as it is in the file comes from; `given`: the caller gave its unit."""
    unit_from = '' if cloud.unit is None else (_TAKEN if cloud.unit_note else _GIVEN if given else _STATED)
    return FileOrigin(topic, stamp, file, cloud.unit, unit_from, converted=False, measured_ns=cloud.measured_ns)


def origins_of(reader: RecordingReader) -> dict[tuple[str, int], FileOrigin]:
    """The origins of the imported clouds of a recording, by the namespace of their topic and their stamp."""
    found: dict[tuple[str, int], FileOrigin] = {}
    steps: dict[tuple[str, int], bytes] = {}
    for record in reader.metadata():
        if record.name not in OWN_RECORDS:
            continue
        entries = record.entries
        try:
            place = entries['topic'].rpartition('/')[0], int(entries['stamp_ns'])
            if record.name == _ROUNDING:
                steps[place] = base64.b64decode(entries['steps'], validate=True)
                continue
            found[place] = FileOrigin(
                entries['topic'],
                place[1],
                entries['file'],
                entries['unit_of_file'] or None,
                entries['unit_from'],
                entries['converted_to_m'] == 'true',
                measured_ns=_time_of(entries, 'measured_ns'),
                changed_ns=_time_of(entries, 'changed_ns'),
            )
        except (KeyError, ValueError):
            continue  # a record of another program with this name
    return {place: replace(each, rounding=steps.get(place, b'')) for place, each in found.items()}


def _time_of(entries: Mapping[str, str], name: str) -> int | None:
    return int(entries[name]) if name in entries else None


def _steps(near: Cloud, exact: Cloud) -> Steps:
    """Which neighbour of each number is the exact one, (rows, columns, 3): −1, 0 or 1."""
    return np.sign(np.where(np.isfinite(exact), exact - near, 0)).astype(np.int8)


def _stepped(values: Cloud, steps: Steps) -> Cloud:
    """The neighbours of values, as far as there are steps."""
    towards = np.where(steps > 0, np.inf, -np.inf).astype(values.dtype)
    return cast('Cloud', np.where(steps == 0, values, np.nextafter(values, towards)))
