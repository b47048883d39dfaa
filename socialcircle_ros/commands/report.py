"""`socialcircle report`."""

from pathlib import Path

import click

from .options import parameter_options, parameter_values, progress_bar, quantity, tell_refusals


@click.command('report', epilog='Example: socialcircle report bags/parts.mcap -o report.html')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('report.html'), show_default=True,
    help='HTML page to write. An existing page is replaced.',
)  # fmt: skip
@click.option(
    '--topic',
    'topics',
    multiple=True,
    help='Topic of clouds to filter. May be repeated. Default: all topics named points, and all focus stacks.',
)
@parameter_options
def command(
    recording: Path,
    output: Path,
    topics: tuple[str, ...],
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Write an HTML page about the clouds of a RECORDING.

    Filters each cloud and each focus stack of RECORDING, an MCAP file or a rosbag2 directory. The page shows for
    each of them:

    \b
    - height maps before and after, and the outlier mask
    - number of outliers, seed and radius
    - Sa, Sq and Sz before and after, in the unit of the cloud
    - times in ms, settings and warnings
    - precision and recall, where the recording holds the truth

    If the recording holds a measurement that a node made of the same cloud, the page warns of differences.

    The page embeds its pictures, needs no other file and can be printed.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.report.report import make_report
    from socialcircle_ros.settings import PipelineSettings

    settings = PipelineSettings.from_ros(parameter_values(params_file, parameters, recording))
    with progress_bar(f'filtering {recording.name}') as progress:
        report = make_report(recording, output, settings, topics=topics, progress=progress)
    click.echo(
        f'{quantity(len(report.entries), "measurement")}, {report.outliers} of {report.measured} measured points'
        f' are outliers ({report.outliers / report.measured:.2%}).'
    )
    warned = sum(bool(entry.warnings) for entry in report.entries)
    if warned:
        click.echo(f'{quantity(warned, "measurement")} with warnings: see the page.', err=True)
    tell_refusals(report.refused, report.damage)
    click.echo(f'Next: open {output}')
