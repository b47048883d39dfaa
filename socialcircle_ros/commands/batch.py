# SPDX-License-Identifier: Apache-2.0
"""`socialcircle batch`."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Literal

import click

from .options import (
    LIMITS_FAILED,
    parameter_options,
    parameter_values,
    progress_display,
    quantity,
    shell_words,
    topics_option,
)

if TYPE_CHECKING:
    from socialcircle_ros.archive import BatchResult

_MOST_NAMES = 5  # of inputs in one sentence


@click.command('batch', epilog='Example: socialcircle batch nights/ -o out --names "{cell}/{part}_*.mcap"')
@click.argument('inputs', nargs=-1, required=True, metavar='IN...')
@click.option(
    '-o', '--output', required=True,
    help='Folder of the results, or its URL. A rerun with the same folder does only what is new. It may lie among'
    ' the inputs; results are not read again.',
)  # fmt: skip
@click.option('--no-recordings', is_flag=True, help='Write rows of measurements only, and no cleaned recordings.')
@click.option(
    '--reports',
    is_flag=True,
    help='Write a report of each input; `socialcircle trend` links to it.',
)
@click.option(
    '--names', default='', metavar='PATTERN',
    help='Cell and part from the end of the path, such as "{cell}/{part}_*.mcap". Default: the entries cell and'
    ' part of the metadata of a recording; as cell also the namespace of the topic.',
)  # fmt: skip
@topics_option
@click.option(
    '--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='none', show_default=True,
    help='Compression of the written recordings.',
)  # fmt: skip
@click.option(
    '--scheduler', metavar='ADDRESS',
    help='Dask scheduler, such as tcp://host:8786, or its scheduler file (.json). Default: processes of this'
    ' machine.',
)  # fmt: skip
@click.option(
    '--workers', type=click.IntRange(min=1), help='Number of processes of this machine. Default: one per core.'
)
@parameter_options
def command(
    inputs: tuple[str, ...],
    output: str,
    no_recordings: bool,
    reports: bool,
    names: str,
    topics: tuple[str, ...],
    compression: Literal['none', 'lz4', 'zstd'],
    scheduler: str | None,
    workers: int | None,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Filter an archive of recordings on all cores, or on a Dask cluster.

    IN is a recording, a rosbag2 directory, a measurement file, a folder with any of them, a glob, or a URL of
    these, such as s3://bucket/nights. Writes to the folder of the results:

    \b
    recordings/    a cleaned recording for each input, as `socialcircle filter` writes it
    measurements/  one row per cloud, for `socialcircle measurements` and `socialcircle trend`
    reports/       a report for each input, with --reports
    inputs/        which inputs are done

    The same command continues after an interruption, and does only what is new: content, settings and version
    count.
    Inputs that fail are listed at the end and tried again by the next run.

    The exit code is 1 if an input failed or is damaged, otherwise 3 if a cloud failed its limits, otherwise 0.
    Refused clouds do not change it: they are listed at the end.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.archive import run_batch
    from socialcircle_ros.cloud import load_row
    from socialcircle_ros.kernels.compiled import has_cached_code
    from socialcircle_ros.kernels.compiling import announce
    from socialcircle_ros.settings import PipelineSettings

    settings = PipelineSettings.from_ros(parameter_values(params_file, parameters))
    if scheduler is None and not has_cached_code(load_row):  # the workers compile, and nobody listens to them
        announce()
    with _progress() as (found, progress):
        result = run_batch(
            inputs,
            output,
            settings,
            names=names,
            topics=topics,
            recordings=not no_recordings,
            reports=reports,
            compression=compression,
            scheduler=scheduler,
            workers=workers,
            found=found,
            started=lambda dashboard: click.echo(f'Dashboard: {dashboard}', err=True),
            progress=progress,
        )
    _tell(result, output)


def _tell_failures(failed: Mapping[str, str]) -> None:
    """Print why inputs failed; a reason that differs in the name of the input only, as on a full disk, once."""
    alike: dict[str, list[str]] = {}
    for location, reason in sorted(failed.items()):
        kind = reason.replace(location, '').replace(PurePosixPath(location).name, '')
        alike.setdefault(kind, []).append(location)
    for first, *others in alike.values():
        told = failed[first] if first in failed[first] else f'{first}: {failed[first]}'
        click.echo(f'Failed: {told}', err=True)
        if others:
            click.echo(f'So failed {quantity(len(others), "other")}: {_some_of(others)}', err=True)


def _tell_refusals(result: 'BatchResult', output: str) -> None:
    """Print why clouds were refused and in which inputs, and how to list them."""
    for reason, count in sorted(result.refused.items()):
        times = f', {count} times' if count > 1 else ''
        click.echo(f'Refused{times}, in {_some_of(sorted(result.refused_in[reason]))}: {reason}', err=True)
    if result.refused:
        query = "select recording, topic, number, reason from measurements where status = 'refused'"
        click.echo(f'The refused clouds: socialcircle measurements {shell_words(output)} "{query}"', err=True)


def _some_of(locations: Sequence[str]) -> str:
    """The first of some locations, for a sentence."""
    return ', '.join(locations[:_MOST_NAMES]) + (', …' if len(locations) > _MOST_NAMES else '')


@contextmanager
def _progress() -> Iterator[tuple[Callable[[int], None], Callable[[int, int], None]]]:
    """Show on stderr how many inputs are found and done, the rate, and the time left."""
    with progress_display() as bar:
        task = bar.add_task('finding recordings', total=None)
        yield (
            lambda count: bar.update(task, completed=count),
            lambda done, total: bar.update(task, description='filtering', completed=done, total=total),
        )


def _tell(result: 'BatchResult', output: str) -> None:
    """Print what was done, and what a person should look at."""
    skipped = f', {result.skipped} done before' if result.skipped else ''
    click.echo(
        f'{quantity(result.inputs, "input")}: {result.done} filtered with {quantity(result.clouds, "cloud")}'
        f'{skipped}; {len(result.failed)} failed, {len(result.damaged)} damaged. Results are in {output}.'
    )
    if result.left_out:
        click.echo(
            f'{quantity(result.left_out, "result")} in {output} left out: results are not read again.', err=True
        )
    for location, other in sorted(result.same.items()):
        click.echo(f'{location} has the content of {other}, and is not measured twice.', err=True)
    _tell_refusals(result, output)
    if result.units:
        others = len(result.units) - 1
        click.echo(f'Warning: {min(result.units)}{f" So {others} more." if others else ""}', err=True)
    for sentence in sorted(result.damaged.values()):
        click.echo(f'Damaged: {sentence}', err=True)
    _tell_failures(result.failed)
    if result.limits_failed:
        failed = quantity(result.limits_failed, 'cloud')
        query = 'select recording, topic, number, limits_reason from measurements where not limits_passed'
        click.echo(
            f'{failed} failed the limits: socialcircle measurements {shell_words(output)} "{query}"', err=True
        )
    if result.done or result.skipped or result.same:
        click.echo(f'Next: socialcircle trend {shell_words(output)} -o trend.html', err=True)
    if result.failed or result.damaged:
        raise click.exceptions.Exit(1)
    if result.limits_failed:
        raise click.exceptions.Exit(LIMITS_FAILED)
