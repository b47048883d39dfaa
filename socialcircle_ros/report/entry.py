"""One cloud of a report: its pictures, its numbers and its warnings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone

import numpy as np

from socialcircle_ros.cloud import Cloud, HeightMap, Mask, measured_points
from socialcircle_ros.errors import MessageError
from socialcircle_ros.interface import MASK, REPAIRED, MeasurementValues
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.image import OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.areal import Texture, texture
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.pipeline.clouds import CloudOutputs

from . import thumbnails
from .content import Beside, Cell, Column, Panels, Section, Table
from .pictures import aspect_of

_YEAR_2000_S = 946_684_800  # an earlier stamp does not count from the epoch
_FIXED_SPACE = '\N{NO-BREAK SPACE}'
_NAME_AND_VALUE = (Column(''), Column(''))

COLUMNS = (
    Column('measurement'), Column('stamp'), Column('measured', ',d'), Column('outliers', ',d'),
    Column('share', '.2%'), Column('seed'), Column('radius', '.4g'), Column('Sa before', '.4g'),
    Column('Sa after', '.4g'), Column('Sq before', '.4g'), Column('Sq after', '.4g'), Column('Sz before', '.4g'),
    Column('Sz after', '.4g'), Column('time [ms]', '.1f'), Column('warnings', 'd'),
)  # fmt: skip
"""Columns of the table of all measurements."""


@dataclass(frozen=True, eq=False)
class ReportEntry:
    """What a report shows of one cloud.

    Attributes:
        name: topic and number of the cloud, such as `/cell1/points 3`.
        stamp: stamp of the cloud, ns.
        measurement: counts, seed and radius.
        circle: the `circle.*` parameters in force, as the measurement states them.
        times_ms: duration of each stage, and their `total`.
        is_stack: whether the cloud was measured from a focus stack, and is in metres.
        is_repaired: whether the holes that the outliers left were filled.
        before: texture of all measured points.
        after: texture of the kept points.
        scores: scores against the truth; None where the truth is not known.
        warnings: one sentence each.
        panels: pictures of the cloud.
    """

    name: str
    stamp: int
    measurement: MeasurementValues
    circle: Mapping[str, str]
    times_ms: Mapping[str, float]
    is_stack: bool
    is_repaired: bool
    before: Texture
    after: Texture
    scores: Scores | None
    warnings: Sequence[str]
    panels: Panels

    @property
    def anchor(self) -> str:
        """Target of the links to this entry."""
        return f'measurement {self.name}'.replace(' ', '-').replace('/', '-')

    def section(self) -> Section:
        """The entry's section of the page."""
        return Section(
            f'{self.name} – {stamp_text(self.stamp)}',
            items=[self.panels, Beside(list(self._tables()))],
            warnings=self.warnings,
            anchor=self.anchor,
        )

    def row(self) -> list[Cell]:
        """The entry's row in the table of all measurements; see `COLUMNS`."""
        counts, before, after = self.measurement, self.before, self.after
        return [
            self.name,
            stamp_text(self.stamp).replace(' ', _FIXED_SPACE),
            counts.measured,
            counts.outliers,
            counts.outliers / counts.measured,
            f'{counts.seed_row},{_FIXED_SPACE}{counts.seed_column}',
            counts.radius,
            *(before.sa, after.sa, before.sq, after.sq, before.sz, after.sz),
            self.times_ms['total'],
            len(self.warnings) or None,
        ]

    def _tables(self) -> Iterator[Table]:
        yield Table('', 'Points', _NAME_AND_VALUE, self._counts())
        found = self.measurement
        circle = [
            ('seed (row, column)', f'{found.seed_row}, {found.seed_column}'),
            ('radius', f'{found.radius:.4g}'),
            *self.circle.items(),
        ]
        yield Table('', 'Circle', _NAME_AND_VALUE, circle)
        columns = [Column(''), Column('before', '.4g'), Column('after', '.4g'), Column('change', '+.1%')]
        yield Table('', 'Texture', columns, self._textures())
        times = [(stage, f'{time_ms:.1f}') for stage, time_ms in self.times_ms.items()]
        yield Table('', 'Times [ms]', _NAME_AND_VALUE, times)

    def _counts(self) -> list[list[Cell]]:
        found = self.measurement
        rows: list[list[Cell]] = [
            ['points', f'{found.points:,}'],
            ['measured', f'{found.measured:,} ({found.measured / found.points:.1%})'],
            ['outliers', f'{found.outliers:,} ({found.outliers / found.measured:.2%})'],
            ['kept', f'{found.kept:,}'],
        ]
        if self.is_repaired:
            rows.append(['repaired', f'{found.repaired:,}'])
        if self.scores is not None:
            rows += [['precision', _percent(self.scores.precision)], ['recall', _percent(self.scores.recall)]]
        return rows

    def _textures(self) -> list[list[Cell]]:
        before, after = self.before, self.after
        pairs = (('Sa', before.sa, after.sa), ('Sq', before.sq, after.sq), ('Sz', before.sz, after.sz))
        return [[name, old, new, new / old - 1 if old else None] for name, old, new in pairs]


def make_entry(
    name: str,
    cloud: bytes,
    result: CloudOutputs,
    *,
    is_stack: bool = False,
    warning: str = '',
    truth: tuple[Mask, Mask] | None = None,
    recorded: diagnostics.Status | None = None,
) -> ReportEntry:
    """Draw one cloud before and after the filter, and collect its numbers and warnings.

    Args:
        name: name of the entry.
        cloud: the serialized PointCloud2 as measured.
        result: the outputs of the filter for this cloud, with the mask.
        is_stack: whether the cloud was measured from a focus stack, and is in metres.
        warning: a warning about the cloud itself, such as that its stack is incomplete; empty for none.
        truth: (H, W) the outliers, and (H, W) the points with a certain truth; None where not known.
        recorded: the measurement of this cloud that the recording holds; it is compared with `result`.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    decoded = PointCloud.decode(cloud)
    xyz = decoded.xyz()
    heights = np.where(measured_points(xyz), xyz[..., 2], np.nan)
    outliers = outliers_of(result)
    measurement = result.measurement.values
    circle = result.measurement.settings
    warnings = [warning] if warning else []
    if result.measurement.level != diagnostics.OK:
        warnings.append(result.measurement.message)
    if recorded is not None:
        warnings += _differences(recorded.values, measurement, circle)
    return ReportEntry(
        name=name,
        stamp=decoded.header.stamp,
        measurement=measurement,
        circle=circle,
        times_ms=result.measurement.times_ms,
        is_stack=is_stack,
        is_repaired=REPAIRED in result.messages,
        before=texture(heights),
        after=texture(np.where(outliers, np.nan, heights)),
        scores=None if truth is None else score(outliers, *truth),
        warnings=warnings,
        panels=_panels(xyz, heights, outliers, result.messages.get(REPAIRED), 'm' if is_stack else '', truth),
    )


def outliers_of(result: CloudOutputs) -> Mask:
    """The outlier mask of a result, (H, W).

    Raises:
        ValueError: the result was made without a mask.
    """
    if MASK not in result.messages:
        raise ValueError('The result has no mask; ask for it with OutputSettings(mask=True).')
    outliers: Mask = decode_mono8(result.messages[MASK]) == OUTLIER
    return outliers


def stamp_text(stamp: int) -> str:
    """A stamp in ns as text: date and time if it counts from the epoch, otherwise seconds."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    if seconds < _YEAR_2000_S:
        return f'{seconds}.{nanoseconds // 1_000_000:03d} s'
    date = datetime.fromtimestamp(seconds, timezone.utc)
    return f'{date:%Y-%m-%d %H:%M:%S}.{nanoseconds // 1_000_000:03d} UTC'


def _panels(
    xyz: Cloud,
    heights: HeightMap,
    outliers: Mask,
    repaired: bytes | None,
    unit: str,
    truth: tuple[Mask, Mask] | None,
) -> Panels:
    measured = np.isfinite(heights)
    colours = thumbnails.colour_range(heights, outliers)
    pictures = [
        ('as measured', thumbnails.as_measured(heights, outliers, colours)),
        (f'mask: {np.count_nonzero(outliers):,} outliers in red', thumbnails.mask(measured, outliers)),
        ('filtered', thumbnails.filtered(heights, outliers, colours)),
    ]
    if repaired is not None:
        filled = PointCloud.decode(repaired).xyz()[..., 2]
        pictures.append(('repaired', thumbnails.filtered(filled, np.zeros_like(outliers), colours)))
    if truth is not None:
        drawn = thumbnails.against_truth(outliers, *truth, measured)
        pictures.append(('true positives red, false positives black, false negatives amber', drawn))
    ends = (f'{colours.low:.4g}', f'{colours.high:.4g} {unit}'.strip())
    return Panels(pictures, aspect_of(xyz), (*ends, thumbnails.colour_bar()))


def _differences(
    recorded: Mapping[str, str], measurement: MeasurementValues, circle: Mapping[str, str]
) -> Iterator[str]:
    """Warn where a recorded measurement differs from this one."""
    changed = [
        f'{name} {recorded[name]} (here {circle[name]})'
        for name in circle
        if recorded.get(name, circle[name]) != circle[name]
    ]
    try:
        # An older version may have recorded fewer keys. A missing one counts as equal.
        then = MeasurementValues.from_text({**measurement.to_text(), **recorded})
    except MessageError as error:
        yield f'The recorded measurement of this cloud cannot be compared. {error}'
        return
    if changed:
        yield f'The recorded measurement had {", ".join(changed)} and found {then.outliers} outliers.'
    elif then.outliers != measurement.outliers:
        yield f'The recorded measurement found {then.outliers} outliers with the same circle parameters.'


def _percent(share: float) -> str:
    return '–' if np.isnan(share) else f'{share:.1%}'
