# SPDX-License-Identifier: Apache-2.0
"""`socialcircle teach`."""

from pathlib import Path

import click

from .options import parameter_options, parameter_values, progress_bar, quantity, tell_refusals


@click.command('teach', epilog='Example: socialcircle teach good.mcap -o part.teach')
@click.argument('good', nargs=-1, required=True, metavar='GOOD...', type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('part.teach'), show_default=True,
    help='Lesson to write. An existing one is replaced. A page about the check is written beside it, as .html.',
)  # fmt: skip
@click.option(
    '--topic',
    'topics',
    multiple=True,
    help='Topic of clouds. May be repeated. Default: all topics named points, and all focus stacks.',
)
@click.option(
    '--clouds', 'most', type=click.IntRange(min=1), default=8, show_default=True,
    help='Most clouds to use of each file, spread evenly over it.',
)  # fmt: skip
@parameter_options
def command(
    good: tuple[Path, ...],
    output: Path,
    topics: tuple[str, ...],
    most: int,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Teach the adaptive mode the texture of one kind of part, from GOOD clouds of it.

    GOOD are recordings or measurement files of parts without outliers. Outliers are put into them, and a lesson
    learns to tell these from the islands, pits and scratches of the part itself. It is checked on parts of the
    clouds that were kept back, and written only if it helps there.

    The adaptive mode uses the lesson that circle.lesson names:

    \b
    socialcircle filter night.mcap -o clean.mcap -p circle.lesson:=part.teach

    A lesson holds for one kind of part on one instrument. The clouds that it is used on must be in
    the unit of the good clouds: the warning of another surface compares lengths in this unit.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.settings import PipelineSettings
    from socialcircle_ros.storage import check_place, write_file
    from socialcircle_ros.teaching.clouds import read_good_clouds
    from socialcircle_ros.teaching.page import check_libraries, lesson_page
    from socialcircle_ros.teaching.teach import teach

    page = output.with_suffix('.html')
    if page == output:
        raise click.UsageError(f'{output} would be the page of the lesson; choose a name such as part.teach.')
    check_libraries()
    for path in (page, output):
        check_place(path)  # not after minutes
    settings = PipelineSettings.from_ros(parameter_values(params_file, parameters, good[0]))
    clouds, refused = read_good_clouds(
        good, settings, topics=topics, most=most, progress=lambda text: click.echo(text, err=True)
    )
    with progress_bar(f'teaching on {quantity(len(clouds), "cloud")}') as progress:
        taught = teach(clouds, progress, settings.circle)
    tell_refusals(refused, None)
    for warning in taught.warnings:
        click.echo(f'Warning: {warning}', err=True)
    write_file(page, lesson_page(taught))
    if taught.refusal:
        raise SocialCircleError(f'{taught.refusal} No lesson was written; {page} shows what was found.')
    write_file(output, taught.lesson.to_text())
    click.echo(f'F1 of the outliers put in: {taught.before.f1:.3f} before, {taught.after.f1:.3f} with the lesson.')
    click.echo(
        f'Good points removed: {taught.before.removed:.3%} before, {taught.after.removed:.3%} with the lesson.'
    )
    click.echo(f'Next: open {page}, then set circle.lesson to {output}')
