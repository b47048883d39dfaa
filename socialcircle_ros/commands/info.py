# SPDX-License-Identifier: Apache-2.0
"""`socialcircle info`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from socialcircle_ros.recording.description import Description


@click.command('info', epilog='Example: socialcircle info night.mcap')
@click.argument('files', nargs=-1, required=True, metavar='FILE...', type=click.Path(path_type=Path))
def command(files: tuple[Path, ...]) -> None:
    """Say what is in each FILE: a recording, a measurement file, or a focus stack.

    \b
    recording         topics with type, number of messages, size and unit; duration; damage
    measurement file  points, measured points, unit, pitch, range of heights, fields
    focus stack       number and size of frames, range of z

    A recording is read whole, so that damage is found. A file that cannot be read is named, the others are shown
    all the same, and the exit code is 1.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.recording.description import describe

    shown = failed = 0
    for path in files:
        try:
            found = describe(path)
        except SocialCircleError as error:
            click.echo(f'Error: {error}', err=True)
            failed += 1
            continue
        if shown:
            click.echo()
        shown += 1
        _show(found)
    if failed:
        raise click.exceptions.Exit(1)


def _show(found: 'Description') -> None:
    click.echo(f'{found.path}: {found.kind}')
    width = max(map(len, found.facts))
    for name, text in found.facts.items():
        click.echo(f'  {name.ljust(width)}  {text}')
    for topic in found.topics:
        click.echo(f'  {topic.text()}')
    if found.damage:
        click.echo(f'Warning: {found.damage}', err=True)
