# SPDX-License-Identifier: Apache-2.0
"""`socialcircle record`."""

import re
import signal
from pathlib import Path

import click

from .options import Number, place_text, quantity, require_ros, size_in_bytes


def regular_expression(_: click.Context, parameter: click.Parameter, text: str | None) -> re.Pattern[str] | None:
    """Compile an option; click calls this."""
    if text is None:
        return None
    try:
        return re.compile(text)
    except re.error as error:
        raise click.BadParameter(f'{text!r} is no regular expression: {error}.', param=parameter) from None


@click.command('record', epilog='Example: socialcircle record /cell1/points /cell1/outlier_mask -o night.mcap')
@click.argument('topics', nargs=-1)
@click.option(
    '-o', '--output', required=True, type=click.Path(path_type=Path), help='Where to: NAME.mcap, or a directory.'
)
@click.option('-a', '--all', 'every', is_flag=True, help='Every topic; the same as to name none.')
@click.option(
    '-e',
    '--regex',
    callback=regular_expression,
    help='Also topics in whose name this regular expression is found.',
)
@click.option(
    '-x',
    '--exclude-regex',
    callback=regular_expression,
    help='No topics in whose name this regular expression is found.',
)
@click.option('--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='none', show_default=True)
@click.option('--duration', type=Number(min=0), help='Stop after this many seconds; default: at Ctrl-C.')
@click.option(
    '-b',
    '--max-bag-size',
    callback=size_in_bytes,
    metavar='SIZE',
    default='0',
    help='In a directory, begin the next file when a file has this size; 0: one file.',
)
@click.option(
    '-d',
    '--max-bag-duration',
    type=Number(min=0),
    default=0,
    metavar='SECONDS',
    help='In a directory, begin the next file after this time; 0: one file.',
)
@click.option(
    '--min-free',
    callback=size_in_bytes,
    metavar='SIZE',
    default='1G',
    show_default=True,
    help='Warn when the disk has less free space than this; 0: never.',
)
@click.option('--overwrite', is_flag=True, help='Replace an existing recording.')
def command(
    topics: tuple[str, ...],
    output: Path,
    every: bool,
    regex: re.Pattern[str] | None,
    exclude_regex: re.Pattern[str] | None,
    compression: str,
    duration: float | None,
    max_bag_size: int,
    max_bag_duration: float,
    min_free: int,
    overwrite: bool,
) -> None:
    """Record TOPICS until Ctrl-C; without any, record every topic that is published.

    Topics that appear later are recorded from then on. The recording is complete when this command has ended, also
    after SIGTERM, SIGHUP, an error or on a full disk. Then the exit code is not 0, and a message says what the
    recording holds. Sizes are in bytes, or with k, M, G or T: 4G.
    """
    require_ros()
    from socialcircle_ros.recording.names import is_mcap_name

    if is_mcap_name(output) and (max_bag_size or max_bag_duration):
        raise click.BadParameter(f'{output} is one file and cannot be split: give a name without .mcap.')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from socialcircle_ros.clients.recorder import TopicChoice, record_topics

    from .console import CommandConsole

    with CommandConsole(stderr=True).status('recording; Ctrl-C ends it') as status:
        recorded = record_topics(
            output,
            TopicChoice(topics, every, regex, exclude_regex),
            compression=compression,  # type: ignore[arg-type]
            overwrite=overwrite,
            duration_s=duration,
            max_bytes=max_bag_size,
            max_duration_s=max_bag_duration,
            min_free_bytes=min_free,
            progress=lambda messages, count: status.update(
                f'recording {messages} messages of {count} topics; Ctrl-C ends it'
            ),
        )
    counts = recorded.counts
    for name in sorted({*counts, *recorded.lost}):
        lost = f', {recorded.lost[name]} lost on the way' if recorded.lost[name] else ''
        click.echo(f'{name}: {counts[name]}{lost}')
    click.echo(f'{quantity(counts.total(), "message")} written to {place_text(output)}.')
    if recorded.lost:
        click.echo(
            f'{quantity(recorded.lost.total(), "message")} did not arrive.'
            ' Give the publisher a larger depth, or see docs/network.md.',
            err=True,
        )
    for sentence in recorded.left_out:
        click.echo(f'Warning: {sentence}', err=True)
    for name in topics:
        if name not in counts and f'/{name}' not in counts:
            click.echo(f'No message came on {name}.', err=True)
    if recorded.ended_by in (signal.SIGTERM, signal.SIGHUP):
        click.echo(f'Ended by {recorded.ended_by.name}; all later messages are missing.', err=True)
        raise click.exceptions.Exit(128 + recorded.ended_by)
