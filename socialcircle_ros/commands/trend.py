# SPDX-License-Identifier: Apache-2.0
"""`socialcircle trend`."""

from pathlib import Path

import click

from .options import progress_bar, quantity, shell_words


@click.command('trend', epilog='Example: socialcircle trend out -o trend.html')
@click.argument('folder')
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('trend.html'), show_default=True,
    help='HTML page to write. An existing page is replaced.',
)  # fmt: skip
@click.option(
    '--baseline', type=click.IntRange(min=8), default=50, show_default=True,
    help='Number of clouds after each change of settings or version from which control limits are computed.',
)  # fmt: skip
def command(folder: str, output: Path, baseline: int) -> None:
    """Write an HTML page that shows the measurements in FOLDER over time.

    FOLDER is the output of `socialcircle batch`, also its URL, or the measurements.folder of nodes. The page shows
    for each cell and part:

    \b
    - share of outliers, measured share, Sa, Sq, Sz, latency
    - refused clouds and failed recordings
    - control limits, and the points that complete a Western Electric rule
    - changes of settings and versions

    A click on a point opens the report of its cloud, if `socialcircle batch --reports` made it. The page needs no
    other file and can be printed.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.archive.trend import drift_sentences
    from socialcircle_ros.archive.trend_page import write_trend
    from socialcircle_ros.report.page import check_page_name

    check_page_name(output)
    # How long is not known before the rows are read; the bar says that something happens.
    with progress_bar(f'reading the measurements of {Path(folder).name}'):
        found = write_trend(folder, output, baseline=baseline)
    clouds = sum(len(series.times) for series in found)
    click.echo(f'{quantity(clouds, "cloud")} in {quantity(len(found), "series", "series")}.')
    for sentence in drift_sentences(found):
        click.echo(sentence)
    for series in found:
        for reason, count in series.reasons.items():
            click.echo(f'{series.title}, {quantity(count, "failure")}: {reason}', err=True)
    click.echo(f'Next: open {shell_words(output)}')
