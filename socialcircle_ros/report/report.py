"""`make_report`: filter a recording and write one HTML page about it."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

from socialcircle_ros.errors import RecordingError, SocialCircleError
from socialcircle_ros.kernels.machine import hardware
from socialcircle_ros.kernels.ordered import in_order
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stacks import Refusal
from socialcircle_ros.recording import RecordingReader, open_recording
from socialcircle_ros.recording.named_clouds import NamedCloud, named_clouds
from socialcircle_ros.recording.offline import measurements_of, source_clouds
from socialcircle_ros.recording.truth import truths_of
from socialcircle_ros.settings import PARAMETERS, OutputSettings, PipelineSettings, RosValue, Settings
from socialcircle_ros.storage import write_file

from .content import Cell, Column, Section, Table
from .entry import COLUMNS, ReportEntry, make_entry
from .page import prepare, render
from .thumbnails import colour_bar

_UNITS = (
    'Lengths are in the unit of each cloud; clouds of focus stacks are in metres. Sa, Sq and Sz follow ISO 25178-2'
    ' after levelling; the form is not removed.'
)


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
    topics: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Filter every cloud and every focus stack of a recording, and write an HTML page about them.

    The page shows for each cloud: height maps before and after, the mask, counts, seed and radius, Sa, Sq and Sz
    before and after, times and warnings. It adds precision and recall where the recording holds the truth. Where
    the recording holds a measurement of the same cloud, the page warns of differences.

    Clouds are filtered on all cores. A few of them are in memory at a time; the pictures of all of them are.

    Args:
        recording: an MCAP file or a rosbag2 directory.
        output: the page, such as `report.html`. Its folder is created; an existing page is replaced.
        settings: how clouds are filtered and how stacks become clouds; the defaults if None. The page shows
            repaired clouds if `settings.output.repaired` is set.
        topics: names of the topics of clouds; empty: all topics named `points`, and all focus stacks.
        progress: called with the number of messages read so far and the number of messages in the recording.

    Returns:
        The entries of the page, and what was refused.

    Raises:
        RecordingError: the recording cannot be read, or no cloud of it can be filtered.
        SocialCircleError: the page cannot be written, or matplotlib is not installed.

    Example:
        >>> from socialcircle_ros import CircleSettings, make_report
        >>> from socialcircle_ros.settings import PipelineSettings
        >>> settings = PipelineSettings(circle=CircleSettings(radius_scale=1.5))
        >>> report = make_report('bags/parts.mcap', 'out/parts.html', settings)
        >>> [entry.scores.recall for entry in report.entries]
    """
    recording, output, settings = Path(recording), Path(output), settings or PipelineSettings()
    colour_bar()  # fails now where matplotlib is missing, and not after minutes
    if output.is_dir():
        raise SocialCircleError(f'{output} is a directory; give the name of a page, such as {output}/report.html.')
    prepare(output.parent)
    entries: list[ReportEntry] = []
    refused: Counter[str] = Counter()
    with open_recording(recording) as reader:
        for found in _entries(reader, settings, tuple(topics), progress):
            if isinstance(found, Refusal):
                refused[found.reason] += 1
            else:
                entries.append(found)
        damage = reader.damage
    if not entries:
        reasons = ' '.join([*refused, *([damage] if damage else [])]) or 'Its topics hold no message.'
        raise RecordingError(f'{recording} has no cloud that can be filtered. {reasons}')
    groups: list[Settings] = [settings.circle]
    groups += [settings.repair] if settings.output.repaired else []
    groups += [settings.focus, settings.stack] if any(entry.is_stack for entry in entries) else []
    write_file(output, report_page(recording.name, entries, groups, refused, damage))
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
    read = 0

    def count(message: object) -> None:
        nonlocal read
        read += message is not None
        if progress is not None:
            progress(read, reader.message_count)

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
            item.name,
            cloud.points,
            result,
            is_stack=cloud.image is not None,
            warning=cloud.warning,
            truth=None if truth is None else (truth.outlier, truth.counted),
            recorded=recorded.get((cloud.namespace, result.measurement.values.stamp)),
        )

    clouds = named_clouds(source_clouds(reader, settings, topics=topics, seen=count))
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
    settings: Sequence[Settings],
    refused: Mapping[str, int],
    damage: str | None,
) -> str:
    """Render the HTML page of a report.

    Args:
        name: name of the recording.
        entries: the entries in their order.
        settings: the groups of settings in force.
        refused: number of refused clouds and frames, by reason.
        damage: where the recording is damaged; None if it is intact.
    """
    now = datetime.now(timezone.utc)
    introduction = [
        f'The social circle filter made this report on {now:%Y-%m-%d %H:%M} UTC. Kept points are unchanged.',
        f'{_UNITS} Pictures of large clouds are thinned; outliers are always drawn.',
        f'Times were measured on {hardware()}, with several clouds filtered at once.',
    ]
    warnings = [f'Refused{f", {count} times" if count > 1 else ""}: {reason}' for reason, count in refused.items()]
    warnings += [damage] if damage else []
    warnings += [f'{entry.name}: {warning}' for entry in entries for warning in entry.warnings]
    links = [entry.anchor for entry in entries]
    table = Table('measurements', '', COLUMNS, [entry.row() for entry in entries], links=links)
    sections = [
        Section('All measurements', items=[table], warnings=warnings),
        Section('Settings', items=[settings_table(settings)]),
        *(entry.section() for entry in entries),
    ]
    return render(f'Measurements of {name}', introduction, sections)


def settings_table(settings: Sequence[Settings]) -> Table:
    """Tabulate the parameters in force and their defaults."""
    rows: list[list[Cell]] = []
    for name, value in (item for group in settings for item in group.to_ros().items()):
        parameter = PARAMETERS[name]
        changed = '' if value == parameter.default else 'changed'
        rows.append([name, _text(value), _text(parameter.default), parameter.unit, changed])
    columns = [Column('parameter'), Column('value'), Column('default'), Column('unit'), Column('')]
    return Table('settings', '', columns, rows)


def _text(value: RosValue) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
