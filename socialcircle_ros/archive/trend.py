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

from socialcircle_ros.measurements import open_measurements
from socialcircle_ros.report.entry import anchor_of
from socialcircle_ros.storage import is_url

from .control_chart import ControlLimits, control_limits, signals
from .ledger import Ledger
from .results import REPORTS

MEASURES = {
    'outlier_share': 'share of outliers',
    'measured_share': 'share of measured points',
    'sa': 'Sa [unit of the cloud]',
    'sq': 'Sq [unit of the cloud]',
    'sz': 'Sz [unit of the cloud]',
    'time_ms': 'latency of live clouds, time of the filter of others [ms]',
}
"""What is shown over time, with its label."""

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


_COLUMNS = (
    "cell, coalesce(part, ''), epoch_us(time), status, coalesce(reason, ''), recording, topic, number,"
    ' limits_passed, settings_hash, settings, version, outlier_share, measured_share, sa, sq, sz,'
    ' coalesce(latency_ms, total_ms)'
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
        times: ms since 1970.
        values: of each measure, NaN where it is not known.
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
        """Cell and part."""
        return f'{self.cell}, {self.part}' if self.part else self.cell

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
        One series for each cell and part, by their names.

    Raises:
        SocialCircleError: the folder has no measurements.
    """
    database = open_measurements(folder)
    rows = database.execute(f'select {_COLUMNS} from measurements order by cell, part, time').fetchall()  # noqa: S608 - constants
    reports = {} if is_url(folder) else _reports(Path(folder).absolute(), page.absolute().parent)
    by_series: dict[tuple[str, str], list[TrendRow]] = {}
    for row in map(TrendRow._make, rows):
        by_series.setdefault((row.cell, row.part), []).append(row)
    return [_series(members, reports, baseline) for members in by_series.values()]


def _reports(folder: Path, start: Path) -> dict[str, str]:
    """Links to the reports of recordings, by the location of the recording."""
    links = {}
    for entry in Ledger(folder).entries():
        path = folder / REPORTS / f'{entry.name}.html'
        if entry.name and path.exists():
            links[entry.location] = quote(os.path.relpath(path, start))
    return links


def _series(rows: Sequence[TrendRow], reports: Mapping[str, str], baseline: int) -> Series:
    measured = [row for row in rows if row.status in ('ok', 'warning')]
    values = {
        measure: np.array([getattr(row, measure) for row in measured], dtype=np.float64) for measure in MEASURES
    }
    series = Series(
        cell=rows[0].cell,
        part=rows[0].part,
        times=np.array([row.time_us for row in measured], dtype=np.float64) / 1000,
        values=values,
        signals={measure: np.zeros(len(measured), np.uint8) for measure in MEASURES},
        names=[f'{row.recording or "live"} {row.topic} {row.number}' for row in measured],
        links=[_link(row, reports) for row in measured],
        phases=[],
        limits_failed=sum(row.limits_passed is False for row in measured),
    )
    for row in rows:
        if row.status not in ('ok', 'warning'):
            day = datetime.fromtimestamp(row.time_us / 1e6, timezone.utc).date()
            series.refused[day] = series.refused.get(day, 0) + 1
            series.reasons[row.reason] = series.reasons.get(row.reason, 0) + 1
    changes = [number for number, row in enumerate(measured) if not number or _differs(measured[number - 1], row)]
    for first, end in itertools.pairwise([*changes, len(measured)]):
        series.phases.append(_phase(series, measured, first, end, baseline))
    return series


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
    return ', '.join(words) or 'settings'


def _link(row: TrendRow, reports: Mapping[str, str]) -> str:
    report = reports.get(row.recording or '')
    return f'{report}#{quote(anchor_of(f"{row.topic} {row.number}"))}' if report else ''
