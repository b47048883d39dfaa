# SPDX-License-Identifier: Apache-2.0
"""One row per cloud: the columns, their types, units and descriptions, and how a measurement becomes a row.

A new column is added at the end with a default; `SCHEMA_VERSION` is raised when a column is added, and no column
changes its meaning or its type. Rows of all versions are then read together, with NULL where a column is missing.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import date, datetime, timedelta, timezone
from typing import Literal

from socialcircle_ros.errors import printable
from socialcircle_ros.interface import PASSED
from socialcircle_ros.lengths import known_unit
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.header import FIRST_DATE, Header, stamp_text
from socialcircle_ros.metrics.areal import Texture
from socialcircle_ros.pipeline.clouds import Measurement
from socialcircle_ros.settings import markdown_table

from .settings_text import SettingsText

SCHEMA_VERSION = 2
"""Raised when a column is added."""

RowStatus = Literal['ok', 'warning', 'refused', 'failed']
ColumnType = Literal['text', 'whole number', 'number', 'true or false', 'time', 'date', 'number by name']

UNNAMED_CELL = 'unnamed'
"""The cell of a cloud where neither the recording, nor a pattern, nor a namespace names one."""

_COLUMN = 'socialcircle'
_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)


@dataclass(frozen=True)
class RowColumn:
    """A column of the table: its type, its unit and its description."""

    name: str
    type: ColumnType
    unit: str
    sentence: str


def _column(kind: ColumnType, sentence: str, unit: str = '') -> dict[str, RowColumn]:
    return {_COLUMN: RowColumn('', kind, unit, sentence)}


@dataclass(frozen=True)
class Origin:
    """Where a cloud comes from, and with what it is filtered.

    Attributes:
        source: 'batch' or 'node'.
        recording: path or URL of the recording; None: a live cloud.
        content: hash of the recording's content; None: a live cloud.
        cell: name of the cell.
        part: name or number of the part; None: unknown.
        topic: of the cloud.
        number: of the cloud on its topic, from 0.
        time_ns: when the cloud was recorded, arrived, or was measured by its file, ns since 1970.
        settings: in force.
        version: of this package.
        unit: of the coordinates; None: not known.
    """

    source: Literal['batch', 'node']
    recording: str | None
    content: str | None
    cell: str
    part: str | None
    topic: str
    number: int
    time_ns: int
    settings: SettingsText
    version: str
    unit: str | None = None


@dataclass(frozen=True)
class MeasurementRow:
    """One row of the table `measurements`: one cloud, filtered or refused, or one input that cannot be read."""

    schema_version: int = field(metadata=_column('whole number', 'Version of this schema.'))
    source: str = field(metadata=_column('text', '`batch` or `node`.'))
    status: str = field(
        metadata=_column(
            'text',
            '`ok`; `warning`: a person should look; `refused`: the cloud cannot be filtered; `failed`: the'
            ' recording cannot be read.',
        )
    )
    time: datetime = field(
        metadata=_column(
            'time',
            'When the cloud was measured, UTC: its stamp; for stamps before 2000 the time of its recording. Where'
            ' that is before 2000 as well, as for measurement files: the date that the file states, or else its'
            ' last change.',
        )
    )
    day: date = field(metadata=_column('date', 'Day of `time`; the files are partitioned by it.'))
    cell: str = field(metadata=_column('text', 'Name of the cell; the files are partitioned by it.'))
    part: str | None = field(default=None, metadata=_column('text', 'Name or number of the part, if known.'))
    recording: str | None = field(default=None, metadata=_column('text', 'Path or URL of the recording.'))
    content: str | None = field(default=None, metadata=_column('text', "Hash of the recording's content."))
    topic: str | None = field(default=None, metadata=_column('text', 'Topic of the cloud.'))
    number: int | None = field(
        default=None, metadata=_column('whole number', 'Number of the cloud on its topic, from 0.')
    )
    stamp: str | None = field(
        default=None, metadata=_column('text', 'Stamp of the cloud, in s with nine digits after the point.', 's')
    )
    frame: str | None = field(default=None, metadata=_column('text', 'Frame of the cloud.'))
    reason: str | None = field(
        default=None, metadata=_column('text', 'Sentences of the warning, of the refusal or of the failure.')
    )
    points: int | None = field(default=None, metadata=_column('whole number', 'Points of the cloud.', 'points'))
    measured: int | None = field(default=None, metadata=_column('whole number', 'Measured points.', 'points'))
    kept: int | None = field(default=None, metadata=_column('whole number', 'Points that are kept.', 'points'))
    outliers: int | None = field(default=None, metadata=_column('whole number', 'Outliers.', 'points'))
    repaired: int | None = field(default=None, metadata=_column('whole number', 'Filled points.', 'points'))
    outlier_share: float | None = field(
        default=None, metadata=_column('number', 'Outliers among the measured points, 0 to 1.')
    )
    measured_share: float | None = field(
        default=None, metadata=_column('number', 'Measured points among all points, 0 to 1.')
    )
    mode: str | None = field(default=None, metadata=_column('text', '`circle.mode`.'))
    seed_row: int | None = field(default=None, metadata=_column('whole number', 'Row of the seed.'))
    seed_column: int | None = field(default=None, metadata=_column('whole number', 'Column of the seed.'))
    radius: float | None = field(
        default=None,
        metadata=_column(
            'number',
            'Radius of the circle; in the adaptive mode the height that links neighbours.',
            '`unit`',
        ),
    )
    depth_of_field: float | None = field(
        default=None, metadata=_column('number', 'Depth of field of a stack, if its focus curves show it.', 'm')
    )
    sa: float | None = field(
        default=None, metadata=_column('number', 'Sa of the kept points after levelling (ISO 25178-2).', '`unit`')
    )
    sq: float | None = field(
        default=None, metadata=_column('number', 'Sq of the kept points after levelling (ISO 25178-2).', '`unit`')
    )
    sz: float | None = field(
        default=None, metadata=_column('number', 'Sz of the kept points after levelling (ISO 25178-2).', '`unit`')
    )
    latency_ms: float | None = field(
        default=None, metadata=_column('number', 'From arrival to publication; live clouds only.', 'ms')
    )
    total_ms: float | None = field(default=None, metadata=_column('number', 'Sum of `stages_ms`.', 'ms'))
    stages_ms: Mapping[str, float] | None = field(
        default=None, metadata=_column('number by name', 'Time of each stage.', 'ms')
    )
    limits_passed: bool | None = field(
        default=None, metadata=_column('true or false', 'Whether the limits are passed; NULL: no limit is set.')
    )
    limits_reason: str | None = field(default=None, metadata=_column('text', 'Which limits are not passed.'))
    settings: str | None = field(
        default=None, metadata=_column('text', 'Parameters with other values than their defaults, as JSON.')
    )
    settings_hash: str | None = field(
        default=None,
        metadata=_column('text', 'Hash of all parameters that have an effect on the numbers, and of the lesson.'),
    )
    version: str | None = field(default=None, metadata=_column('text', 'Version of this package.'))
    unit: str | None = field(
        default=None,
        metadata=_column('text', 'Unit of `radius`, `sa`, `sq` and `sz`, such as `m` or `um`; NULL: not known.'),
    )

    @classmethod
    def columns(cls) -> tuple[RowColumn, ...]:
        """The columns in their order."""
        return tuple(replace(each.metadata[_COLUMN], name=each.name) for each in dataclasses.fields(cls))


def row_of(
    origin: Origin, measurement: Measurement, texture: Texture | None = None, latency_ms: float | None = None
) -> MeasurementRow:
    """The row of a filtered cloud.

    Args:
        origin: where the cloud comes from.
        measurement: what the filter says of it.
        texture: of the kept points; None: not known.
        latency_ms: from arrival to publication, of a live cloud.
    """
    measurement = measurement.in_unit(origin.unit)
    values = measurement.values
    is_ok = measurement.level == diagnostics.OK
    return replace(
        _begun(origin, 'ok' if is_ok else 'warning', values.stamp),
        frame=printable(measurement.frame_id),
        reason=None if is_ok else measurement.message,
        points=values.points,
        measured=values.measured,
        kept=values.kept,
        outliers=values.outliers,
        repaired=values.repaired,
        outlier_share=_share(values.outliers, values.measured),
        measured_share=_share(values.measured, values.points),
        mode=measurement.settings.get('circle.mode'),
        seed_row=values.seed_row,
        seed_column=values.seed_column,
        radius=_finite(values.radius),
        depth_of_field=values.stack_depth_of_field,
        sa=_finite(texture.sa) if texture else None,
        sq=_finite(texture.sq) if texture else None,
        sz=_finite(texture.sz) if texture else None,
        latency_ms=latency_ms,
        total_ms=measurement.times_ms.get('total'),
        stages_ms={stage: ms for stage, ms in measurement.times_ms.items() if stage != 'total'},
        limits_passed=None if values.verdict is None else values.verdict == PASSED,
        limits_reason=values.verdict_reason,
    )


def refused_row(
    origin: Origin,
    reason: str,
    status: Literal['refused', 'failed'] = 'refused',
    header: Header | None = None,
) -> MeasurementRow:
    """The row of a cloud that cannot be filtered, or of a recording that cannot be read.

    Args:
        origin: where it comes from; an empty topic: a recording as a whole.
        reason: the sentence that says why.
        status: 'refused': a cloud; 'failed': a recording.
        header: of the cloud; None: a recording, or a cloud that is damaged.
    """
    begun = _begun(origin, status, None if header is None else stamp_text(header.stamp))
    if header is not None:
        begun = replace(begun, frame=printable(header.frame_id))
    if not origin.topic:
        begun = replace(begun, topic=None, number=None)
    return replace(begun, reason=reason)


def schema_table() -> dict[str, str]:
    """The Markdown table of `docs/archives.md`, by its name."""
    rows = [(f'`{each.name}`', each.type, each.unit, each.sentence) for each in MeasurementRow.columns()]
    return {'measurement columns': markdown_table(('column', 'type', 'unit', 'value'), rows)}


def _begun(origin: Origin, status: RowStatus, stamp: str | None) -> MeasurementRow:
    time = _time(stamp, origin.time_ns)
    return MeasurementRow(
        schema_version=SCHEMA_VERSION,
        source=origin.source,
        status=status,
        time=time,
        day=time.date(),
        cell=origin.cell or UNNAMED_CELL,
        part=origin.part,
        recording=origin.recording,
        content=origin.content,
        topic=origin.topic,
        number=origin.number,
        stamp=stamp,
        settings=origin.settings.text,
        settings_hash=origin.settings.digest,
        version=origin.version,
        unit=known_unit(origin.unit) or origin.unit,
    )


def _time(stamp: str | None, time_ns: int) -> datetime:
    """The time of a cloud: its stamp where that is a date, otherwise when it was recorded."""
    if stamp is not None:
        seconds, _, nanoseconds = stamp.partition('.')
        stamp_ns = int(seconds) * 1_000_000_000 + int(nanoseconds)
        time_ns = stamp_ns if stamp_ns >= FIRST_DATE else time_ns
    return _EPOCH + timedelta(microseconds=time_ns // 1000)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
