# SPDX-License-Identifier: Apache-2.0
"""`make_report`: filter a recording and write one HTML page about it."""

import importlib.metadata
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

from socialcircle_ros.arguments import OneOrSeveral, settings_or_default, several
from socialcircle_ros.digits import share_text
from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.kernels.machine import hardware
from socialcircle_ros.kernels.ordered import in_order
from socialcircle_ros.lengths import length_scale
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.recording import RecordingReader, open_recording
from socialcircle_ros.recording.any_file import is_measurement_file
from socialcircle_ros.recording.named_clouds import NamedCloud, named_clouds, shown_name
from socialcircle_ros.recording.offline import measurements_of
from socialcircle_ros.recording.truth import truths_of
from socialcircle_ros.recording.units import unit_of
from socialcircle_ros.settings import PARAMETERS, OutputSettings, PipelineSettings, RosValue
from socialcircle_ros.settings.effects import has_effect
from socialcircle_ros.storage import check_place, folder_of_results, lies_in, write_file

from .content import Banner, Cell, Column, Section, Table, refusal_text
from .entry import ReportEntry, make_entry, value_text
from .page import check_page_name, environment, render

_READING = (
    'Sa, Sq, Sz, Ssk, Sku and Sdr follow ISO 25178-2; S-filter: none, F-operation: least squares plane, L-filter:'
    ' none. Before and after have the same colours, from the kept heights without their outer 1 %; the difference'
    ' has colours of its own, from the heights of the outliers over the surface. An outlier is measured from the'
    ' mean of the kept points next to it. Maps of large clouds are thinned; outliers are always drawn, in the'
    ' difference a little larger than they are. Kept points are unchanged. Times are those of {hardware}{busy}.'
)
_BUSY = ', with several clouds filtered at once'
_PREVIEW = 'stack.preview'
_MOST_REASONS = 12  # in the verdict; the pages of the measurements have all


@dataclass(frozen=True, eq=False)
class Report:
    """What a report shows.

    Attributes:
        path: the page.
        entries: one entry per filtered cloud, in the order of the recording.
        refused: number of refused clouds and frames, by reason.
        damage: where the recording is damaged; None if it is intact.
    """

    path: Path
    entries: Sequence[ReportEntry]
    refused: Mapping[str, int]
    damage: str | None

    @property
    def failed(self) -> Sequence[ReportEntry]:
        """The entries that failed their limits."""
        return [entry for entry in self.entries if entry.failed]

    @property
    def judged(self) -> int:
        """Number of entries with a verdict."""
        return sum(entry.measurement.verdict is not None for entry in self.entries)

    @property
    def measured(self) -> int:
        """Number of measured points of all clouds."""
        return sum(entry.measurement.measured for entry in self.entries)

    @property
    def outliers(self) -> int:
        """Number of outliers of all clouds."""
        return sum(entry.measurement.outliers for entry in self.entries)


def make_report(
    recording: str | Path,
    output: str | Path,
    settings: PipelineSettings | None = None,
    *,
    topics: OneOrSeveral[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Filter every cloud and every focus stack of a recording, and write an HTML page about them.

    The page has a summary with the verdict of `settings.limits`, and for each cloud: height maps before and after,
    what was removed, a profile through the worst outlier, the histogram of the heights, counts, Sa, Sq, Sz, Ssk,
    Sku and Sdr before and after, the settings that had an effect, and warnings. For a focus stack it adds the
    picture in focus, the quality, the frames and the reasons of bad pixels. It adds precision and recall where the
    recording holds the truth. Where the recording holds a measurement of the same cloud, the page warns of
    differences.

    Clouds are filtered on all cores. A few of them are in memory at a time; the pictures of all of them are.

    Args:
        recording: an MCAP file or a rosbag2 directory.
        output: the page; its name ends in `.html` or `.htm`. Its folder is created; an existing page is replaced.
        settings: how clouds are filtered and how stacks become clouds; the defaults if None. The page shows
            repaired clouds if `settings.output.repaired` is set.
        topics: names of the topics of clouds; empty: all topics named `points`, and all focus stacks.
        progress: called with the number of messages read so far and the number of messages in the recording.

    Returns:
        The entries of the page, and what was refused.

    Raises:
        RecordingError: the recording cannot be read, or no cloud of it can be filtered.
        SocialCircleError: the page has the name of something else or cannot be written, or matplotlib or Jinja2 is
            not installed.

    Example:
        >>> from socialcircle_ros import CircleSettings, make_report
        >>> from socialcircle_ros.settings import PipelineSettings
        >>> settings = PipelineSettings(circle=CircleSettings(mode='paper', radius_scale=1.5))
        >>> report = make_report('bags/parts.mcap', 'out/parts.html', settings)
        >>> [entry.scores.recall for entry in report.entries]
    """
    recording, output, settings = Path(recording), Path(output), settings_or_default(PipelineSettings, settings)
    new_figure(1, 1)  # fails now where matplotlib or Jinja2 is missing, and not after minutes
    environment()
    check_page_name(output)
    if lies_in(output, recording):
        raise SocialCircleError(
            f'{output} would be written into the recording that is read, {recording}: give another name.'
        )
    with folder_of_results(output.parent):
        check_place(output)
        entries: list[ReportEntry] = []
        refused: Counter[str] = Counter()
        with open_recording(recording) as reader:
            for found in _entries(reader, settings, several(topics), progress):
                if isinstance(found, Refusal):
                    refused[found.reason] += 1
                elif is_measurement_file(recording):
                    # The recording that it is read through gives it a stamp, which says nothing.
                    entries.append(replace(found, stamp=0))
                else:
                    entries.append(found)
            damage = reader.damage
        if not entries:
            reasons = ' '.join([*refused, *([damage] if damage else [])]) or 'Its topics hold no message.'
            raise RecordingError(f'{recording} has no cloud that can be filtered. {reasons}')
        write_file(output, report_page(recording.name, entries, settings, refused, damage))
    return Report(output, entries, refused, damage)


def _entries(
    reader: RecordingReader,
    settings: PipelineSettings,
    topics: tuple[str, ...],
    progress: Callable[[int, int], None] | None,
) -> Iterator[ReportEntry | Refusal]:
    """Filter the clouds of a recording on all cores, and describe them in their order."""
    truths, recorded = truths_of(reader), measurements_of(reader)
    wanted = replace(settings, output=OutputSettings(mask=True, repaired=settings.output.repaired))

    def entry_of(item: NamedCloud | Refusal) -> ReportEntry | Refusal:
        if isinstance(item, Refusal):
            return item
        cloud = item.cloud
        try:
            result = filter_cloud(cloud.points, wanted, cloud.depth_of_field)
        except SocialCircleError as error:
            return Refusal(str(error))
        truth = truths(cloud.namespace, cloud.points)
        return make_entry(
            shown_name(reader.path, item.name),
            cloud.points,
            result,
            unit='m' if cloud.image is not None else unit_of(reader, cloud.topic),
            source=cloud,
            truth=None if truth is None else (truth.outlier, truth.counted),
            recorded=recorded.get((cloud.namespace, result.measurement.values.stamp)),
        )

    clouds = named_clouds(reader, settings, topics=topics, progress=progress)
    return in_order(entry_of, _compiled_beforehand(clouds, wanted))


def _compiled_beforehand(
    clouds: Iterator[NamedCloud | Refusal], settings: PipelineSettings
) -> Iterator[NamedCloud | Refusal]:
    """Filter the first cloud once more, in advance, so that no time of the report contains a compilation."""
    compiled = False
    for item in clouds:
        if not compiled and isinstance(item, NamedCloud):
            with suppress(SocialCircleError):
                filter_cloud(item.cloud.points, settings)
            compiled = True
        yield item


def report_page(
    name: str,
    entries: Sequence[ReportEntry],
    settings: PipelineSettings,
    refused: Mapping[str, int],
    damage: str | None,
) -> str:
    """Render the HTML page of a report.

    Args:
        name: name of the recording.
        entries: the entries in their order.
        settings: the settings in force.
        refused: number of refused clouds and frames, by reason.
        damage: where the recording is damaged; None if it is intact.
    """
    now = datetime.now(timezone.utc)
    version = importlib.metadata.version('socialcircle_ros')
    quantity = '1 measurement' if len(entries) == 1 else f'{len(entries)} measurements'
    introduction = [
        f'{quantity}, filtered with socialcircle_ros {version}; report of {now:%Y-%m-%d %H:%M} UTC.',
    ]
    warnings = [refusal_text(reason, count) for reason, count in refused.items()]
    warnings += [damage] if damage else []
    warnings += [f'{entry.name}: {warning}' for entry in entries for warning in entry.warnings]
    summary = Section(
        'Summary',
        items=[
            verdict_banner(entries, sum(refused.values())),
            measurements_table(entries),
            settings_table(settings, entries),
        ],
        warnings=warnings,
    )
    busy = _BUSY if len(entries) > 1 else ''
    reading = Section('How to read it', [_READING.format(hardware=hardware(), busy=busy)])
    return render(
        f'Measurements of {name}', introduction, [summary, reading, *(each.section() for each in entries)]
    )


def verdict_banner(entries: Sequence[ReportEntry], refused: int) -> Banner:
    """The verdict over all measurements.

    Args:
        entries: the measurements.
        refused: number of clouds that could not be measured; where limits are set, they fail as well.
    """
    measured, outliers = (
        sum(getattr(entry.measurement, field) for entry in entries) for field in ('measured', 'outliers')
    )
    found = f'{outliers:,} of {measured:,} measured points are outliers ({share_text(outliers / measured)}).'
    judged = [entry for entry in entries if entry.measurement.verdict is not None]
    failed = [entry for entry in judged if entry.failed]
    if not judged:
        return Banner('none', 'No limits are set: the report holds no verdict.', [found])
    if not failed and not refused:
        return Banner(
            'passed', f'Passed: {len(judged)} of {len(judged)} measurements are within the limits.', [found]
        )
    reasons = [f'{entry.name}: {entry.measurement.verdict_reason}' for entry in failed[:_MOST_REASONS]]
    if len(failed) > _MOST_REASONS:
        reasons.append(f'and {len(failed) - _MOST_REASONS} more: see the table.')
    if refused:
        reasons.append(f'Clouds or frames that could not be measured: {refused}.')
    passed = len(judged) - len(failed)
    return Banner(
        'failed', f'Failed: {passed} of {len(judged)} measurements are within the limits.', [*reasons, found]
    )


def measurements_table(entries: Sequence[ReportEntry]) -> Table:
    """Tabulate all measurements, with links to their pages."""
    units = {entry.unit for entry in entries}
    unit = next(iter(units))
    after = [entry.after for entry in entries]
    textures = [[getattr(each, name) for each in after] for name in ('sa', 'sq', 'sz')]
    lengths = length_scale(textures, unit) if len(units) == 1 else None
    of_lengths = [
        Column(lengths.label(name), f'.{lengths.decimals_of(values)}f') if lengths else Column(name)
        for name, values in zip(('Sa', 'Sq', 'Sz'), textures, strict=True)
    ]
    columns = [
        Column('measurement'), Column('stamp', wraps=False), Column('verdict'), Column('measured', '.1%'),
        Column('outliers', ',d'), Column('share', '.2%'), *of_lengths,
        Column('warnings', 'd'),
    ]  # fmt: skip
    note = 'Sa, Sq and Sz are those of the kept points.'
    if None in units:
        note += ' The recording does not say the unit of its lengths.'
    rows = [entry.row(lengths) for entry in entries]
    return Table('measurements', 'All measurements', columns, rows, note, [entry.anchor for entry in entries])


def settings_table(settings: PipelineSettings, entries: Sequence[ReportEntry]) -> Table:
    """Tabulate the settings that have an effect on these measurements, with their units.

    Previews are clouds of unfinished stacks, which a report does not show.
    """
    values = settings.to_ros()
    groups = {'circle', 'repair', *(('focus', 'stack') if any(entry.stack for entry in entries) else ())}
    units = {entry.unit for entry in entries}
    unit = units.pop() if len(units) == 1 else None
    rows: list[list[Cell]] = []
    for name, value in values.items():
        parameter = PARAMETERS[name]
        is_limit = parameter.group == 'limits' and value != parameter.empty
        acts = parameter.group in groups and has_effect(name, values) and name != _PREVIEW
        if is_limit or acts:
            shown = [value_text(name, _text(each), unit) for each in (value, parameter.default)]
            rows.append([name, *shown, 'changed' if value != parameter.default else ''])
    columns = [Column('parameter'), Column('value'), Column('default'), Column('')]
    return Table('settings', 'Settings with an effect', columns, rows)


def _text(value: RosValue) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
