# SPDX-License-Identifier: Apache-2.0
"""`socialcircle filter`."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click

from socialcircle_ros.digits import share_text

from .options import (
    parameter_options,
    parameter_values,
    place_text,
    progress_bar,
    quantity,
    tell_failures,
    tell_refusals,
    topics_option,
)

_MOST_NOTES = 3  # of one kind

if TYPE_CHECKING:
    from socialcircle_ros.arguments import Compression
    from socialcircle_ros.pipeline.clouds import CloudOutputs, Measurement
    from socialcircle_ros.recording import Message
    from socialcircle_ros.recording.offline import KeptPoints, SourceCloud, Summary


@click.command('filter', epilog='Example: socialcircle filter bags/metal_groove.mcap -o cleaned.mcap')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '-o',
    '--output',
    required=True,
    type=click.Path(path_type=Path),
    help='Recording to write: NAME.mcap, or a directory. For one cloud also a file, such as part.x3p.',
)
@topics_option
@click.option(
    '--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='none', show_default=True,
    help='Compression of the written recording.',
)  # fmt: skip
@click.option('--overwrite', is_flag=True, help='Replace an existing recording.')
@parameter_options
def command(
    recording: Path,
    output: Path,
    topics: tuple[str, ...],
    compression: 'Compression',
    overwrite: bool,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Filter a RECORDING offline, as the node does live.

    RECORDING is an MCAP file, a rosbag2 directory, or a measurement file such as part.al3d. The written recording
    has all of its messages, unchanged, and for each cloud:

    \b
    points_filtered            the cloud with x, y and z of outliers NaN
    outlier_mask               image: 0 kept, 255 outlier, 127 not measured
    social_circle/measurement  counts, seed, radius and settings

    The frames of a focus stack on stack/image become a cloud on stack/points first. A stack needs parameters,
    such as stack.pitch_x in m: give them with --params-file or -p.

    If the output is a measurement file, such as part.x3p, it holds the cleaned cloud of the one cloud that was
    read; the mask as well, if the format has fields. docs/formats.md lists the formats.

    If limits are set, such as -p limits.outlier_share_max:=0.05, each measurement passes or fails. If one fails,
    the exit code is 3, and everything is written all the same.

    The same recording and parameters give the same bytes under the same name, which the recording holds.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.pipeline.stacks import Refusal
    from socialcircle_ros.recording import open_recording
    from socialcircle_ros.recording.export import filter_to_file, is_file_target
    from socialcircle_ros.recording.named_clouds import shown_name
    from socialcircle_ros.recording.offline import clouds_of, filter_recording, stacks_of
    from socialcircle_ros.recording.units import unit_of
    from socialcircle_ros.settings import PipelineSettings

    keep_freed_memory()
    settings = PipelineSettings.from_ros(parameter_values(params_file, parameters, recording))
    with open_recording(recording) as reader:
        total = reader.message_count
        clouds = [name for name in topics or clouds_of(reader) if name in reader.topics]
        units = {name: unit_of(reader, name) for name in clouds}
        stacks = stacks_of(reader)
    read, found = 0, _Counts()
    with progress_bar(f'filtering {recording.name}') as progress:

        def count(message: 'Message | None') -> None:
            nonlocal read
            read += message is not None
            progress(read, total)

        def take(cloud: 'SourceCloud', outputs: 'CloudOutputs | Refusal', _: 'KeptPoints | None') -> None:
            if not isinstance(outputs, Refusal):
                measurement = outputs.measurement.in_unit(units.get(cloud.topic, 'm'))  # those of stacks
                found.add(shown_name(recording, cloud.name), measurement)

        notes: tuple[str, ...] = ()
        if is_file_target(output):
            summary, notes = filter_to_file(
                recording, output, settings, topics=topics, overwrite=overwrite, seen=count, filtered=take
            )
        else:
            summary = filter_recording(
                recording,
                output,
                settings,
                topics=topics,
                compression=compression,
                overwrite=overwrite,
                seen=count,
                filtered=take,
            )
    _tell(summary, recording, output, found, notes)
    known = {*units.values(), *(['m'] if stacks else [])}
    tell_failures(found.failures, found.judged, sum(summary.refused.values()), settings.limits, known)


@dataclass
class _Counts:
    """What the measurements say, in sum.

    Attributes:
        measured: number of measured points.
        outliers: number of outliers.
        judged: number of measurements that were held to limits.
        warnings: those of all clouds.
        failures: which clouds failed their limits, and why.
        set_aside: number of clouds by the note on points that count as not measured.
        islands: number of clouds by the note on removed islands.
    """

    measured: int = 0
    outliers: int = 0
    judged: int = 0
    warnings: set[str] = field(default_factory=set)
    failures: list[str] = field(default_factory=list)
    set_aside: Counter[str] = field(default_factory=Counter)
    islands: Counter[str] = field(default_factory=Counter)

    def add(self, name: str, measurement: 'Measurement') -> None:
        """Count a measurement of the cloud of that name."""
        from socialcircle_ros.circle.not_measured import COUNT_AS
        from socialcircle_ros.interface import FAILED

        values = measurement.values
        self.measured += values.measured
        self.outliers += values.outliers
        self.judged += values.verdict is not None
        self.warnings.update(measurement.warnings)
        for note in measurement.notes:
            (self.set_aside if note.endswith(COUNT_AS) else self.islands)[note] += 1
        if values.verdict == FAILED:
            self.failures.append(f'{name}: {values.verdict_reason}')


def _most_notes(counts: Counter[str], noun: str) -> list[str]:
    """The notes that most clouds have, and how many other clouds have one.

    Args:
        counts: number of clouds by their note of one kind; a cloud has at most one.
        noun: what the notes are on.
    """
    most = counts.most_common()
    notes = [f'{count} clouds: {note}' if count > 1 else note for note, count in most[:_MOST_NOTES]]
    others = sum(count for _, count in most[_MOST_NOTES:])
    if others:
        notes.append(f'{quantity(others, "other cloud")} with such {noun}; ~/measurement says which.')
    return notes


def _tell(summary: 'Summary', recording: Path, output: Path, found: _Counts, notes: tuple[str, ...]) -> None:
    """Print what was done, and what a person should look at."""
    from socialcircle_ros.recording.export import is_file_target
    from socialcircle_ros.recording.named_clouds import shown_name
    from socialcircle_ros.recording.offline import with_found_parameters

    stacks = f'{quantity(summary.stacks, "focus stack")} measured; ' if summary.stacks else ''
    # A measurement file takes the cleaned cloud alone.
    kept = '' if is_file_target(output) else f'{quantity(summary.kept, "message")} of the recording kept; '
    share = f' ({share_text(found.outliers / found.measured)})' if found.measured else ''
    if summary.clouds:
        click.echo(
            f'{stacks}{quantity(summary.clouds, "cloud")} filtered, {found.outliers} of {found.measured} measured'
            f' points are outliers{share}; {kept}written to {place_text(output)}.'
        )
    else:
        click.echo(f'{stacks}{"no" if stacks else "No"} cloud could be filtered, so nothing was written.')
    for note in (*notes, *_most_notes(found.set_aside, 'points'), *_most_notes(found.islands, 'islands')):
        click.echo(f'Note: {note}', err=True)
    for warning in sorted(found.warnings | summary.warnings.keys()):
        click.echo(f'Warning: {warning}', err=True)
    if summary.clouds and summary.replaced:
        click.echo(f'Replaced the results of an earlier run on: {", ".join(summary.replaced)}.', err=True)
    refused = {with_found_parameters(reason, recording): count for reason, count in summary.refused.items()}
    first = {
        with_found_parameters(reason, recording): shown_name(recording, name)
        for reason, name in summary.first_refused.items()
    }
    tell_refusals(refused, summary.damage, first)
    if summary.clouds == 0:
        raise click.exceptions.Exit(1)
