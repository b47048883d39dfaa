# SPDX-License-Identifier: Apache-2.0
"""One cloud of a report: its pictures, its numbers and its warnings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone

import numpy as np
import numpy.typing as npt

from socialcircle_ros.cloud import Mask, measured_only
from socialcircle_ros.digits import number_text, share_text
from socialcircle_ros.errors import MessageError
from socialcircle_ros.interface import FAILED, MASK, REPAIRED, MeasurementValues
from socialcircle_ros.lengths import LengthScale, length_scale, length_text
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.header import FIRST_DATE
from socialcircle_ros.messages.image import NOT_MEASURED, OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.metrics.areal import FILTERS, ArealTexture, areal_texture
from socialcircle_ros.metrics.scores import Scores, score
from socialcircle_ros.pictures.drawings import CloudPictures, WorstOutlier
from socialcircle_ros.pipeline.clouds import CloudOutputs
from socialcircle_ros.recording.offline import SourceCloud
from socialcircle_ros.settings import PARAMETERS
from socialcircle_ros.settings.effects import has_effect

from .content import Banner, Beside, Cell, Column, Picture, Pictures, Section, Table
from .stack import StackSummary, summarize_stack

_NAME_AND_VALUE = (Column(''), Column(''))


@dataclass(frozen=True, eq=False)
class ReportEntry:
    """What a report shows of one cloud.

    Attributes:
        name: topic and number of the cloud, such as `/cell1/points 3`.
        stamp: stamp of the cloud, ns.
        measurement: counts, seed, radius and verdict.
        circle: the `circle.*` parameters in force, as the measurement states them.
        times_ms: duration of each stage, and their `total`.
        unit: of the cloud; None: not known.
        stack: of the focus stack that the cloud was measured from; None for another cloud.
        is_repaired: whether the holes that the outliers left were filled.
        before: texture of all measured points.
        after: texture of the kept points.
        worst: the outlier farthest from the surface; None if there is no outlier.
        scores: scores against the truth; None where the truth is not known.
        notes: sentences on points that count as not measured, and on few removed islands.
        warnings: one sentence each.
        pictures: pictures of the cloud, row by row.
    """

    name: str
    stamp: int
    measurement: MeasurementValues
    circle: Mapping[str, str]
    times_ms: Mapping[str, float]
    unit: str | None
    stack: StackSummary | None
    is_repaired: bool
    before: ArealTexture
    after: ArealTexture
    worst: WorstOutlier | None
    scores: Scores | None
    notes: Sequence[str]
    warnings: Sequence[str]
    pictures: Sequence[Pictures]

    @property
    def anchor(self) -> str:
        """Target of the links to this entry."""
        return anchor_of(self.name)

    @property
    def failed(self) -> bool:
        """Whether the measurement failed its limits."""
        return self.measurement.verdict == FAILED

    def section(self) -> Section:
        """The entry's section of the page."""
        stamp = date_text(self.stamp)
        return Section(
            f'{self.name}, {stamp}' if stamp else self.name,
            self.notes,
            items=[*self._banner(), *self.pictures, *self._stack_pictures(), Beside(list(self._tables()))],
            warnings=self.warnings,
            anchor=self.anchor,
        )

    def row(self, lengths: LengthScale | None) -> list[Cell]:
        """The entry's row in the table of all measurements.

        Args:
            lengths: shows the lengths of all rows; None: the rows have different units, so each cell has its own.
        """
        counts = self.measurement

        def length(value: float) -> Cell:
            return value * lengths.factor if lengths else texture_text(value, self.unit)

        return [
            self.name,
            date_text(self.stamp),
            counts.verdict or '–',
            counts.measured / counts.points,
            counts.outliers,
            counts.outliers / counts.measured,
            *(length(value) for value in (self.after.sa, self.after.sq, self.after.sz)),
            len(self.warnings) or None,
        ]

    def _banner(self) -> Iterator[Banner]:
        found = self.measurement
        if found.verdict == FAILED:
            yield Banner('failed', f'Failed: {found.verdict_reason}')
        elif found.verdict is not None:
            yield Banner('passed', 'Passed: the measurement is within its limits.')

    def _stack_pictures(self) -> Iterator[Pictures]:
        if self.stack is not None:
            yield self.stack.pictures

    def _tables(self) -> Iterator[Table]:
        yield Table('', 'Points', _NAME_AND_VALUE, list(self._counts()))
        if self.stack is not None:
            yield self.stack.table
        columns = [Column(''), Column('before'), Column('after'), Column('change', '+.1%')]
        yield Table('', 'Texture by ISO 25178-2', columns, list(self._textures()), note=f'{FILTERS}.')
        yield Table('', 'What the filter used', _NAME_AND_VALUE, list(self._used()))

    def _used(self) -> Iterator[list[Cell]]:
        values = {name: text for name, text in self.circle.items() if name in PARAMETERS}
        for name, text in values.items():
            if has_effect(name, values):
                yield [name, value_text(name, text, self.unit)]
        if values.get('circle.mode') == 'paper':
            found = self.measurement
            yield ['radius found', length_with_unit(found.radius, self.unit)]
            yield ['seed (row, column)', f'{found.seed_row}, {found.seed_column}']

    def _counts(self) -> Iterator[list[Cell]]:
        found = self.measurement
        yield ['points', f'{found.points:,}']
        yield ['measured', f'{found.measured:,} ({share_text(found.measured / found.points, 1)})']
        yield ['outliers', f'{found.outliers:,} ({share_text(found.outliers / found.measured)})']
        yield ['kept', f'{found.kept:,}']
        if self.is_repaired:
            yield ['repaired', f'{found.repaired:,}']
        if self.worst is not None:
            over = f'{length_with_unit(self.worst.height, self.unit)} over the surface'
            yield ['worst outlier', over]
            yield ['at row, column', f'{self.worst.row}, {self.worst.column}']
        if self.scores is not None:
            yield ['precision', share_text(self.scores.precision, 1)]
            yield ['recall', share_text(self.scores.recall, 1)]
        if self.unit is None:
            yield ['unit of lengths', 'not known']
        yield ['time', f'{self.times_ms["total"]:.1f} ms']

    def _textures(self) -> Iterator[list[Cell]]:
        both = self.before, self.after
        for name in ('Sa', 'Sq', 'Sz'):
            old, new = (float(getattr(each, name.lower())) for each in both)
            yield [name, *(texture_text(value, self.unit) for value in (old, new)), new / old - 1 if old else None]
        for name in ('Ssk', 'Sku'):
            yield [name, *(number_text(getattr(each, name.lower())) for each in both), None]
        # Where the surface is flat, the share is far below what two decimals show.
        shares = (number_text(100 * each.sdr) for each in both)
        yield ['Sdr', *(share if share == '–' else f'{share} %' for share in shares), None]


def anchor_of(name: str) -> str:
    """Target of the links to the entry of a name, such as `/points 3`."""
    return f'measurement {name}'.replace(' ', '-').replace('/', '-')


def make_entry(
    name: str,
    cloud: bytes,
    result: CloudOutputs,
    *,
    unit: str | None = None,
    source: SourceCloud | None = None,
    truth: tuple[Mask, Mask] | None = None,
    recorded: diagnostics.Status | None = None,
) -> ReportEntry:
    """Draw one cloud before and after the filter, and collect its numbers and warnings.

    Args:
        name: name of the entry.
        cloud: the serialized PointCloud2 as measured.
        result: the outputs of the filter for this cloud, with the mask.
        unit: of the cloud; None: not known.
        source: what the recording holds of the cloud; None: nothing but the cloud.
        truth: (H, W) the outliers, and (H, W) the points with a certain truth; None where not known.
        recorded: the measurement of this cloud that the recording holds; it is compared with `result`.

    Raises:
        SocialCircleError: matplotlib is not installed.
    """
    decoded = PointCloud.decode(cloud)
    pixels = mask_of(result)
    drawn = CloudPictures(measured_only(decoded.xyz(), pixels != NOT_MEASURED), pixels == OUTLIER, unit)
    measurement = result.measurement.in_unit(unit).values
    circle = result.measurement.settings
    warnings = [source.warning] if source is not None and source.warning else []
    warnings += result.measurement.warnings
    if recorded is not None:
        warnings += _differences(recorded.values, measurement, circle)
    return ReportEntry(
        name=name,
        stamp=decoded.header.stamp,
        measurement=measurement,
        circle=circle,
        times_ms=result.measurement.times_ms,
        unit=unit,
        stack=None if source is None else summarize_stack(name, source, decoded, drawn),
        is_repaired=REPAIRED in result.messages,
        before=areal_texture(drawn.xyz),
        after=areal_texture(drawn.xyz, ~drawn.outliers),
        worst=drawn.worst,
        scores=None if truth is None else score(drawn.outliers, *truth),
        notes=result.measurement.notes,
        warnings=warnings,
        pictures=_pictures(name, drawn, result.messages.get(REPAIRED), truth),
    )


def value_text(name: str, value: str, unit: str | None) -> str:
    """The value of a parameter with its unit.

    Args:
        name: full name of the parameter.
        value: as ROS has it, as text.
        unit: of the cloud; None: not known.
    """
    parameter = PARAMETERS[name]
    if parameter.empty is not None and value == str(parameter.empty):
        return parameter.empty_text
    if not value:
        return 'none'
    if parameter.unit in ('cloud', 'm'):
        return length_with_unit(float(value), unit if parameter.unit == 'cloud' else 'm', digits=6)
    return f'{value} {parameter.unit}'.strip()


def mask_of(result: CloudOutputs) -> npt.NDArray[np.uint8]:
    """The pixels of the outlier mask of a result, (H, W) uint8, as `mask_pixels` defines them.

    Raises:
        ValueError: the result was made without a mask.
    """
    if MASK not in result.messages:
        raise ValueError('The result has no mask; ask for it with OutputSettings(mask=True).')
    return decode_mono8(result.messages[MASK])


def date_text(stamp: int) -> str:
    """A stamp in ns as text: date and time if it counts from the epoch, otherwise seconds; empty if it is 0."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    if stamp == 0:
        return ''
    if stamp < FIRST_DATE:
        return f'{seconds}.{nanoseconds // 1_000_000:03d} s'
    date = datetime.fromtimestamp(seconds, timezone.utc)
    return f'{date:%Y-%m-%d %H:%M:%S}.{nanoseconds // 1_000_000:03d} UTC'


def _pictures(
    name: str, drawn: CloudPictures, repaired: bytes | None, truth: tuple[Mask, Mask] | None
) -> list[Pictures]:
    """Maps before and after, what was removed, the histogram, and the profile of the worst outlier."""
    maps = [
        Picture('before', drawn.before(), '', f'{name}: heights as measured'),
        Picture('after', drawn.after(), '', f'{name}: heights without the outliers'),
    ]
    if repaired is not None:
        filled = PointCloud.decode(repaired).xyz()[..., 2]
        maps.append(Picture('repaired', drawn.repaired(filled), '', f'{name}: heights with filled holes'))
    found = [Picture('difference', drawn.difference(), '', f'{name}: what was removed')]
    if truth is not None:
        found.append(Picture('truth', drawn.against_truth(*truth), '', f'{name}: what was removed, and the truth'))
    found.append(Picture('histogram', drawn.histogram(), '', f'{name}: histogram of the heights'))
    row = 'the worst outlier' if drawn.worst else 'the middle'
    profile = Picture('profile', drawn.profile(), '', f'{name}: profile through {row}')
    return [Pictures(maps), Pictures(found), Pictures([profile])]


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


def length_with_unit(value: float, unit: str | None, *, digits: int = 3) -> str:
    """A length with its unit; a number alone where no unit is known, which the tables say once."""
    if not np.isfinite(value):
        return '–'
    if unit is None:
        return number_text(value, digits, padded=False)
    return length_text(value, unit, digits=digits)


def texture_text(value: float, unit: str | None) -> str:
    """A measured length with four digits, and its unit where it is known."""
    if not np.isfinite(value):
        return '–'
    return number_text(value, 4) if unit is None else length_scale([value], unit).text(value)
