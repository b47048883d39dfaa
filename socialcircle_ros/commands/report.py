# SPDX-License-Identifier: Apache-2.0
"""`socialcircle report`."""

from pathlib import Path

import click

from socialcircle_ros.digits import share_text

from .options import (
    parameter_options,
    parameter_values,
    progress_bar,
    quantity,
    shell_words,
    tell_failures,
    tell_refusals,
    topics_option,
)


@click.command('report', epilog='Example: socialcircle report bags/parts.mcap -o report.html')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('report.html'), show_default=True,
    help='HTML page to write. An existing page is replaced.',
)  # fmt: skip
@topics_option
@click.option(
    '--compare',
    nargs=2,
    type=click.Path(path_type=Path),
    metavar='A.yaml B.yaml',
    help='Show what the settings of two parameter files do to the same clouds, side by side.',
)
@parameter_options
def command(
    recording: Path,
    output: Path,
    topics: tuple[str, ...],
    compare: tuple[Path, Path] | None,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Write an HTML page about the clouds of a RECORDING.

    Filters each cloud and each focus stack of RECORDING, an MCAP file or a rosbag2 directory. The page shows for
    each of them:

    \b
    - height maps before and after, and what was removed, with axes, units and colour bars
    - a profile through the worst outlier, and the histogram of the heights
    - Sa, Sq, Sz, Ssk, Sku and Sdr by ISO 25178-2, before and after
    - the settings that had an effect, with their units, and warnings
    - precision and recall, where the recording holds the truth

    With limits, such as -p limits.outlier_share_max:=0.05, each measurement passes or fails. If one fails, the
    exit code is 3; the page is written all the same.

    If the recording holds a measurement that a node made of the same cloud, the page warns of differences.

    The page embeds its pictures, needs no other file, and prints with one measurement on each sheet of A4.
    """  # noqa: D301 - click reads \b
    if compare is not None:
        _compare(recording, output, topics, compare, params_file, parameters)
        return
    from socialcircle_ros.report.report import make_report
    from socialcircle_ros.settings import PipelineSettings

    settings = PipelineSettings.from_ros(parameter_values(params_file, parameters, recording))
    with progress_bar(f'filtering {recording.name}') as progress:
        report = make_report(recording, output, settings, topics=topics, progress=progress)
    click.echo(
        f'{quantity(len(report.entries), "measurement")}, {report.outliers} of {report.measured} measured points'
        f' are outliers ({share_text(report.outliers / report.measured)}).'
    )
    warned = sum(bool(entry.warnings) for entry in report.entries)
    if warned:
        click.echo(f'{quantity(warned, "measurement")} with warnings: see the page.', err=True)
    tell_refusals(report.refused, report.damage)
    click.echo(f'Next: open {shell_words(output)}')
    failures = [f'{entry.name}: {entry.measurement.verdict_reason}' for entry in report.failed]
    units = {entry.unit for entry in report.entries}
    tell_failures(failures, report.judged, sum(report.refused.values()), settings.limits, units)


def _compare(
    recording: Path,
    output: Path,
    topics: tuple[str, ...],
    files: tuple[Path, Path],
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Write the page of two settings; `parameters` apply to both."""
    from socialcircle_ros.report.compare import make_comparison
    from socialcircle_ros.settings import PipelineSettings

    if params_file is not None:
        raise click.UsageError('--compare takes two parameter files in place of --params-file.')
    first, second = (PipelineSettings.from_ros(parameter_values(file, parameters, recording)) for file in files)
    with progress_bar(f'filtering {recording.name} twice') as progress:
        compared = make_comparison(
            recording, output, (files[0].name, first), (files[1].name, second), topics=topics, progress=progress
        )
    warned = sum(bool(cloud.warnings) for cloud in compared.clouds)
    if warned:
        click.echo(f'{quantity(warned, "measurement")} with warnings: see the page.', err=True)
    tell_refusals(compared.refused, compared.damage)
    click.echo(f'{quantity(len(compared.clouds), "measurement")} compared. Next: open {shell_words(output)}')
