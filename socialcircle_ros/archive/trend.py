# SPDX-License-Identifier: Apache-2.0
"""Measurements over time: series by cell and part, their control limits, and what drifts."""

import itertools
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime, timezone
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import numpy as np
import numpy.typing as npt

from socialcircle_ros.lengths import METRES, NOT_KNOWN, known_unit, length_scale
from socialcircle_ros.measurements import open_measurements
from socialcircle_ros.recording.named_clouds import shown_name
from socialcircle_ros.report.entry import anchor_of
from socialcircle_ros.storage import is_url

from .control_chart import ControlLimits, control_limits, signals
from .ledger import Ledger
from .results import report_of

MEASURES = {
    'outlier_share': 'share of outliers [%]',
    'measured_share': 'share of measured points [%]',
    'sa': 'Sa',
    'sq': 'Sq',
    'sz': 'Sz',
    'time_ms': 'latency of live clouds, time of the filter of others [ms]',
}
"""What is shown over time, with its label; `Series.label` adds the unit of lengths."""

LENGTHS = ('sa', 'sq', 'sz')
"""The measures that are lengths."""

SHARES = ('outlier_share', 'measured_share')
"""The measures that are shares, in percent."""

_LAST, _DRIFTING = 20, 0.5


def short_label(measure: str) -> str:
    """A label for a table."""
    return 'time' if measure == 'time_ms' else MEASURES[measure].partition(' [')[0]


class TrendRow(NamedTuple):
    """One row of `measurements`, as far as it is shown; see `measurements.MeasurementRow`."""

    cell: str
    part: str
    time_us: int
    status: str
    reason: str
    recording: str | None
    topic: str | None
    number: int | None
    limits_passed: bool | None
    settings_hash: str
    settings: str | None
    version: str
    outlier_share: float | None
    measured_share: float | None
    sa: float | None
    sq: float | None
    sz: float | None
    time_ms: float | None
    unit: str | None

    @property
    def was_measured(self) -> bool:
        """Whether it is a cloud that was filtered."""
        return self.status in ('ok', 'warning')

    @property
    def common_unit(self) -> str:
        """The unit that its lengths can be converted to: m, or its own if that is not known; '': it has none."""
        return 'm' if known_unit(self.unit) else self.unit or ''


_COLUMNS = (
    "cell, coalesce(part, ''), epoch_us(time), status, coalesce(reason, ''), recording, topic, number,"
    ' limits_passed, settings_hash, settings, version, outlier_share, measured_share, sa, sq, sz,'
    ' coalesce(latency_ms, total_ms), unit'
)


@dataclass(frozen=True)
class Phase:
    """A time without a change of settings or version, which has control limits of its own.

    Attributes:
        first: time of its first cloud, ms since 1970.
        last: time of its last cloud.
        limits: of each measure that has enough values.
        change: what changed at its beginning; '': it is the first.
    """

    first: float
    last: float
    limits: dict[str, ControlLimits]
    change: str


@dataclass(eq=False)
class Series:
    """The clouds of one part in one cell, in the order of time. Arrays are (N,).

    Attributes:
        cell: name of the cell.
        part: name of the part; '': unknown.
        unit: that all lengths of its rows can be converted to; '': not known.
        length_unit: in which the values of lengths are, such as nm.
        has_others: whether the cell and part has a series with another unit as well.
        times: ms since 1970.
        values: of each measure, NaN where it is not known; lengths in one unit, shares in percent.
        signals: of each measure, the rules that each value completes, see `control_chart.signals`.
        names: recording, topic and number of each cloud.
        links: to the report of each cloud; '': there is none.
        phases: times between changes.
        refused: number of refused clouds and failed recordings, by day.
        reasons: why, with their number.
        limits_failed: number of clouds that failed their limits.
    """

    cell: str
    part: str
    unit: str
    length_unit: str
    has_others: bool
    times: npt.NDArray[np.float64]
    values: dict[str, npt.NDArray[np.float64]]
    signals: dict[str, npt.NDArray[np.uint8]]
    names: list[str]
    links: list[str]
    phases: list[Phase]
    refused: dict[date, int] = field(default_factory=dict)
    reasons: dict[str, int] = field(default_factory=dict)
    limits_failed: int = 0

    @property
    def title(self) -> str:
        """Cell and part, and the unit where it tells the series from others of the part."""
        unit = (f'in {self.unit}' if self.unit else NOT_KNOWN) if self.has_others else ''
        return ', '.join(filter(None, (self.cell, self.part, unit)))

    def label(self, measure: str) -> str:
        """The label of a measure, with its unit."""
        return f'{MEASURES[measure]} [{self.length_unit}]' if measure in LENGTHS else MEASURES[measure]

    def drifting(self) -> list[str]:
        """The measures of which more than half of the last 20 values give a signal."""
        drifting = []
        for measure, found in self.signals.items():
            last = found[~np.isnan(self.values[measure])][-_LAST:]
            if len(last) == _LAST and np.count_nonzero(last) > _DRIFTING * _LAST:
                drifting.append(measure)
        return drifting


def drift_sentences(all_series: Sequence[Series]) -> list[str]:
    """One sentence for each cell and part that drifts."""
    return [
        f'{series.title} drifts: {", ".join(map(short_label, drifting))}.'
        for series in all_series
        if (drifting := series.drifting())
    ]


def read_series(folder: str | Path, page: Path, *, baseline: int = 50) -> list[Series]:
    """Read the measurements of a folder, and compute control limits and signals.

    Args:
        folder: output of a batch, or `measurements.folder` of nodes.
        page: the page that links to the reports, relative to itself; not to those at a URL.
        baseline: number of values after each change that the control limits are computed from.

    Returns:
        One series for each cell and part, by their names. Lengths of rows with known units are converted to one
        unit. Rows with an unknown unit are a series of their own.

    Raises:
        SocialCircleError: the folder has no measurements.
    """
    database = open_measurements(folder)
    order = 'cell, part, time, recording, topic, number'
    rows = database.execute(f'select {_COLUMNS} from measurements order by {order}').fetchall()  # noqa: S608 - constants
    reports = {} if is_url(folder) else _reports(Path(folder).absolute(), page.absolute().parent)
    by_part: dict[tuple[str, str], list[TrendRow]] = {}
    for row in map(TrendRow._make, rows):
        by_part.setdefault((row.cell, row.part), []).append(row)
    found = []
    for members in by_part.values():
        by_unit = _by_unit(members)
        found += [_series(unit, each, len(by_unit) > 1, reports, baseline) for unit, each in by_unit.items()]
    return found


def _by_unit(rows: Sequence[TrendRow]) -> dict[str, list[TrendRow]]:
    """The rows of one part by the unit of their lengths, m first and the unknown one last.

    What has no lengths, such as a recording that cannot be read, goes with the first where its unit has no clouds.
    """
    units = sorted({row.common_unit for row in rows if row.was_measured}, key=lambda unit: (unit != 'm', not unit))
    by_unit: dict[str, list[TrendRow]] = {unit: [] for unit in units or ['']}
    for row in rows:
        by_unit[row.common_unit if row.common_unit in by_unit else next(iter(by_unit))].append(row)
    return by_unit


def _reports(folder: Path, start: Path) -> dict[str, str]:
    """Links to the reports of recordings, by the location of the recording."""
    links = {}
    for entry in Ledger(folder).entries():
        report = report_of(entry.name)
        # A report that the last run did not make shows other settings; an earlier version did not say what it
        # made.
        is_of_entry = bool(entry.name) if entry.outputs is None else report in entry.outputs
        if is_of_entry and (folder / report).exists():
            links[entry.location] = quote(os.path.relpath(folder / report, start))
    return links


def _series(
    unit: str, rows: Sequence[TrendRow], has_others: bool, reports: Mapping[str, str], baseline: int
) -> Series:
    measured = [row for row in rows if row.was_measured]
    values = {
        measure: np.array([getattr(row, measure) for row in measured], dtype=np.float64) for measure in MEASURES
    }
    length_unit = _convert_lengths(unit, measured, values)
    for measure in SHARES:
        values[measure] *= 100
    series = Series(
        cell=rows[0].cell,
        part=rows[0].part,
        unit=unit,
        length_unit=length_unit,
        has_others=has_others,
        times=np.array([row.time_us for row in measured], dtype=np.float64) / 1000,
        values=values,
        signals={measure: np.zeros(len(measured), np.uint8) for measure in MEASURES},
        names=[f'{row.recording or "live"} {row.topic} {row.number}' for row in measured],
        links=[_link(row, reports) for row in measured],
        phases=[],
        limits_failed=sum(row.limits_passed is False for row in measured),
    )
    for row in rows:
        if not row.was_measured:
            day = datetime.fromtimestamp(row.time_us / 1e6, timezone.utc).date()
            series.refused[day] = series.refused.get(day, 0) + 1
            series.reasons[row.reason] = series.reasons.get(row.reason, 0) + 1
    changes = [number for number, row in enumerate(measured) if not number or _differs(measured[number - 1], row)]
    for first, end in itertools.pairwise([*changes, len(measured)]):
        series.phases.append(_phase(series, measured, first, end, baseline))
    return series


def _convert_lengths(unit: str, rows: Sequence[TrendRow], values: dict[str, npt.NDArray[np.float64]]) -> str:
    """Convert the lengths of rows to one unit with a prefix that suits the usual value; returns its name."""
    metres = np.array([METRES.get(known_unit(row.unit) or '', 1.0) for row in rows], dtype=np.float64)
    for measure in LENGTHS:
        values[measure] *= metres
    known = [each[~np.isnan(each)] for each in (values[measure] for measure in LENGTHS)]
    scale = length_scale([np.median(each) for each in known if each.size], unit or None)
    for measure in LENGTHS:
        values[measure] *= scale.factor
    return scale.name


def _phase(series: Series, rows: Sequence[TrendRow], first: int, end: int, baseline: int) -> Phase:
    """Control limits between two changes; the signals are written to the series."""
    limits = {}
    for measure, values in series.values.items():
        places = first + np.flatnonzero(~np.isnan(values[first:end]))
        if measure == 'time_ms':
            # How long the filter takes offline says how busy a machine was, and nothing of the cell.
            is_live = np.array([row.recording is None for row in rows], dtype=bool)
            places = places[is_live[places]]
        found = control_limits(values[places], baseline)
        if found is not None:
            limits[measure] = found
            series.signals[measure][places] = signals(values[places], found)
    change = _change(rows[first - 1], rows[first]) if first else ''
    return Phase(series.times[first], series.times[end - 1], limits, change)


def _differs(before: TrendRow, after: TrendRow) -> bool:
    return (before.settings_hash, before.version) != (after.settings_hash, after.version)


def _change(before: TrendRow, after: TrendRow) -> str:
    """What changed between two clouds, in words."""
    words = [] if before.version == after.version else [f'version {before.version} to {after.version}']
    old, new = (json.loads(row.settings or '{}') for row in (before, after))
    words += [
        f'{name} {old.get(name, "default")} to {new.get(name, "default")}'
        for name in sorted({*old, *new})
        if old.get(name) != new.get(name)
    ]
    return ', '.join(words) or ('circle.lesson taught again' if 'circle.lesson' in new else 'settings')


def _link(row: TrendRow, reports: Mapping[str, str]) -> str:
    report = reports.get(row.recording or '')
    if not report:
        return ''
    name = shown_name(Path(row.recording or ''), f'{row.topic} {row.number}')
    return f'{report}#{quote(anchor_of(name))}'
