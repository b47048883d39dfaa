"""One measurement for a report: its pictures, numbers and warnings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from typing import Any

import numpy as np

from socialcircle_ros.cloud import Mask, measured_points
from socialcircle_ros.kernels.machine import hardware
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.image import OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.areal import Texture, texture
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.pipeline.clouds import CloudOutputs
from socialcircle_ros.settings import PARAMETERS, Settings

from . import thumbnails as panels
from .content import Beside, Cell, Column, Panels, Section, Table
from .page import render
from .pictures import aspect_of

_ERA = 946_684_800  # s: a stamp before the year 2000 counts from something else than the epoch
_FIXED = '\N{NO-BREAK SPACE}'
_WORDS = (Column(''), Column(''))


@dataclass(frozen=True, eq=False)
class ReportEntry:
    """What a report says of one cloud.

    Attributes:
        name: such as `/cell1/points 3`.
        stamp: of its header, ns.
        result: what the filter gave, in numbers; of the messages only whether there was one.
        before: texture of all measured points.
        after: texture of the kept ones.
        scores: against the truth; None where it is not known.
        warnings: what must not be overlooked.
        panels: its pictures.
    """

    name: str
    stamp: int
    result: CloudOutputs
    before: Texture
    after: Texture
    scores: Scores | None
    warnings: Sequence[str]
    panels: Panels

    @property
    def anchor(self) -> str:
        """Where links to it lead."""
        return f'measurement {self.name}'.replace(' ', '-').replace('/', '-')

    def section(self) -> Section:
        """Its part of the page."""
        return Section(
            f'{self.name} – {when(self.stamp)}',
            items=[self.panels, Beside(list(self._tables()))],
            warnings=self.warnings,
            anchor=self.anchor,
        )

    def row(self) -> list[Cell]:
        """Its row of the table of all measurements, under `COLUMNS`."""
        result = self.result
        return [
            self.name,
            when(self.stamp).replace(' ', _FIXED),
            result.measured,
            result.outliers,
            result.outliers / result.measured,
            f'{result.seed[0]},{_FIXED}{result.seed[1]}',
            result.radius,
            *(getattr(of, name) for name in ('sa', 'sq', 'sz') for of in (self.before, self.after)),
            result.times['total'],
            len(self.warnings) or None,
        ]

    def _tables(self) -> Iterator[Table]:
        result = self.result
        counts: list[tuple[str, str]] = [
            ('points', f'{result.points:,}'),
            ('measured', f'{result.measured:,} ({result.measured / result.points:.1%})'),
            ('outliers', f'{result.outliers:,} ({result.outliers / result.measured:.2%})'),
            ('kept', f'{result.measured - result.outliers:,}'),
        ]
        if result.repaired is not None:
            counts.append(('repaired', result.status.values['repaired']))
        if self.scores is not None:
            counts += [('precision', _share(self.scores.precision)), ('recall', _share(self.scores.recall))]
        yield Table('', 'Points', _WORDS, counts)
        in_force = [(name, value) for name, value in result.status.values.items() if name.startswith('circle.')]
        circle = [
            ('seed (row, column)', f'{result.seed[0]}, {result.seed[1]}'),
            ('radius', f'{result.radius:.4g}'),
        ]
        yield Table('', 'Circle', _WORDS, [*circle, *in_force])
        columns = [Column(''), Column('before', '.4g'), Column('after', '.4g'), Column('change', '+.1%')]
        rows: list[list[Cell]] = []
        for name in ('sa', 'sq', 'sz'):
            before, after = getattr(self.before, name), getattr(self.after, name)
            rows.append([name.capitalize(), before, after, after / before - 1 if before else None])
        yield Table('', 'Texture', columns, rows)
        times = [(stage, f'{milliseconds:.1f}') for stage, milliseconds in result.times.items()]
        yield Table('', 'Times [ms]', _WORDS, times)


COLUMNS = (
    Column('measurement'), Column('stamp'), Column('measured', ',d'), Column('outliers', ',d'),
    Column('share', '.2%'), Column('seed'), Column('radius', '.4g'), Column('Sa before', '.4g'),
    Column('Sa after', '.4g'), Column('Sq before', '.4g'), Column('Sq after', '.4g'), Column('Sz before', '.4g'),
    Column('Sz after', '.4g'), Column('time [ms]', '.1f'), Column('warnings', 'd'),
)  # fmt: skip
"""Of the table of all measurements."""


def make_entry(
    name: str,
    cloud: bytes,
    result: CloudOutputs,
    *,
    unit: str = '',
    warning: str = '',
    truth: tuple[Mask, Mask] | None = None,
    recorded: diagnostics.Status | None = None,
) -> ReportEntry:
    """Draw one cloud before and after, and gather what there is to say of it.

    Args:
        name: of the measurement.
        cloud: the serialized PointCloud2 as measured.
        result: what became of it, with its mask.
        unit: of its lengths; empty: unknown.
        warning: what is to be told of how the cloud came about; empty: nothing.
        truth: (H, W) the outliers, and the points whose truth is certain; None: not known.
        recorded: what a node once said of this cloud.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    decoded = PointCloud.decode(cloud)
    xyz = decoded.xyz()
    measured = measured_points(xyz)
    outliers = outliers_of(result)
    heights = np.where(measured, xyz[..., 2], np.nan)
    scale = panels.colour_range(heights, outliers)
    pictures = [
        ('as measured', panels.as_measured(heights, outliers, scale)),
        (f'mask: {result.outliers:,} outliers in red', panels.mask(measured, outliers)),
        ('cleaned', panels.cleaned(heights, outliers, scale)),
    ]
    if result.repaired is not None:
        repaired = PointCloud.decode(result.repaired).xyz()[..., 2]
        pictures.append(('repaired', panels.cleaned(repaired, np.zeros_like(outliers), scale)))
    scores = None
    if truth is not None:
        scores = score(outliers, *truth)
        drawn = panels.judged(outliers, *truth, measured)
        pictures.append(('removed rightly red, wrongly black; missed amber', drawn))
    ends = (f'{scale.low:.4g}', f'{scale.high:.4g} {unit}'.strip())
    warnings = [warning] if warning else []
    if result.status.level != diagnostics.OK:
        warnings.append(result.status.message)
    if recorded is not None:
        warnings += _differences(recorded.values, result.status.values)
    return ReportEntry(
        name=name,
        stamp=decoded.header.stamp,
        # Without the clouds themselves: those of a night would fill the memory.
        result=replace(result, filtered=b'', mask=None, repaired=None if result.repaired is None else b''),
        before=texture(heights),
        after=texture(np.where(outliers, np.nan, heights)),
        scores=scores,
        warnings=warnings,
        panels=Panels(pictures, aspect_of(xyz), (*ends, panels.colour_bar())),
    )


def report_page(
    name: str,
    measurements: Sequence[ReportEntry],
    settings: Sequence[Settings],
    refused: Mapping[str, int],
    damage: str | None,
) -> str:
    """The HTML page of a recording.

    Args:
        name: of the recording.
        measurements: in their order.
        settings: what they were filtered with.
        refused: how many clouds or frames were refused, by reason.
        damage: where the recording breaks off; None: it is sound.
    """
    now = datetime.now(timezone.utc)
    meaning = (
        f'Filtered by the social circle on {now:%Y-%m-%d %H:%M} UTC; what is kept is as it was measured. Lengths'
        ' are in the unit of each cloud, in metres for those of focus stacks. Small pictures skip points, but no'
        ' outlier. Sa, Sq, Sz: ISO 25178-2, levelled, form not removed.'
    )
    times = f'Times are of this run, several clouds at once, on {hardware()}.'
    warnings = [f'Refused{f", {count} times" if count > 1 else ""}: {reason}' for reason, count in refused.items()]
    warnings += [damage] if damage else []
    warnings += [f'{each.name}: {warning}' for each in measurements for warning in each.warnings]
    links = [each.anchor for each in measurements]
    table = Table('measurements', '', COLUMNS, [each.row() for each in measurements], links=links)
    sections = [
        Section('All measurements', items=[table], warnings=warnings),
        Section('Settings', items=[settings_table(settings)]),
        *(each.section() for each in measurements),
    ]
    return render(f'Measurements of {name}', [meaning, times], sections)


def outliers_of(result: CloudOutputs) -> Mask:
    """The mask of a result that was asked to have one, (H, W) bool."""
    if result.mask is None:
        raise ValueError('The result has no mask; ask for it with OutputSettings(mask=True).')
    outliers: Mask = decode_mono8(result.mask) == OUTLIER
    return outliers


def settings_table(settings: Sequence[Settings]) -> Table:
    """The parameters in force beside their defaults."""
    rows: list[list[Cell]] = []
    for name, value in (item for group in settings for item in group.to_ros().items()):
        row = PARAMETERS[name]
        changed = '' if value == row.default else 'changed'
        rows.append([name, _text(value), _text(row.default), row.unit, changed])
    columns = [Column('parameter'), Column('value'), Column('default'), Column('unit'), Column('')]
    return Table('settings', '', columns, rows)


def when(stamp: int) -> str:
    """A stamp in words: date and time where it counts from the epoch, else seconds."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    if seconds < _ERA:
        return f'{seconds}.{nanoseconds // 1_000_000:03d} s'
    date = datetime.fromtimestamp(seconds, timezone.utc)
    return f'{date:%Y-%m-%d %H:%M:%S}.{nanoseconds // 1_000_000:03d} UTC'


def _differences(then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """What a recorded measurement says otherwise than this one."""
    changed = [
        f'{name} {then[name]} (here {now[name]})'
        for name in now
        if name.startswith('circle.') and name in then and then[name] != now[name]
    ]
    count = then.get('outliers', '')
    if changed:
        yield f'The node that was recorded had {", ".join(changed)}, and found {count} outliers.'
    elif count and count != now['outliers']:
        yield f'The node that was recorded found {count} outliers with the same settings of the circle.'


def _share(value: float) -> str:
    return '–' if np.isnan(value) else f'{value:.1%}'


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
