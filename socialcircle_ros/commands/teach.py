# SPDX-License-Identifier: Apache-2.0
"""`socialcircle teach`."""

from pathlib import Path

import click

from .options import parameter_options, parameter_values, progress_bar, quantity, shell_words, tell_refusals

_BEGINNING = 4096  # bytes of a file that tell what it is


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
    learns to tell these from the islands, pits and scratches of the part itself. It is checked on
    the fields kept back, every second cloud or strip of a single cloud, and written only if it helps there.

    The adaptive mode uses the lesson that circle.lesson names:

    \b
    socialcircle filter night.mcap -o clean.mcap -p circle.lesson:=part.teach

    A lesson holds for one kind of part on one instrument. The clouds that it is used on must be in
    the unit of the good clouds: the warning of another surface compares lengths in this unit.
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.settings import PipelineSettings
    from socialcircle_ros.settings.lessons import LESSON_MARK
    from socialcircle_ros.storage import check_place, folder_of_results, write_file
    from socialcircle_ros.teaching.clouds import read_good_clouds
    from socialcircle_ros.teaching.page import TITLE, check_libraries, lesson_page
    from socialcircle_ros.teaching.teach import teach

    page = output.with_suffix('.html')
    if page == output:
        raise click.UsageError(f'{output} would be the page of the lesson; choose a name such as part.teach.')
    check_libraries()
    _check_target(page, good, f'<title>{TITLE}</title>', 'page about a lesson')
    _check_target(output, good, LESSON_MARK, 'lesson')
    settings = PipelineSettings.from_ros(parameter_values(params_file, parameters, good[0]))
    with folder_of_results(output.parent):
        check_place(page)
        check_place(output)
        clouds, refused, damage = read_good_clouds(
            good, settings, topics=topics, most=most, progress=lambda text: click.echo(text, err=True)
        )
        with progress_bar(f'teaching on {quantity(len(clouds), "cloud")}') as progress:
            taught = teach(clouds, progress, settings.circle)
        tell_refusals(refused, None)
        for warning in (*damage, *taught.warnings):
            click.echo(f'Warning: {warning}', err=True)
        write_file(page, lesson_page(taught, damage))
        if taught.refusal:
            raise SocialCircleError(f'{taught.refusal} No lesson was written; {page} shows what was found.')
        write_file(output, taught.lesson.to_text())
    before, after = taught.before, taught.after
    click.echo(f'F1 of the outliers put in: {before.f1:.3f} before, {after.f1:.3f} with the lesson.')
    click.echo(
        f'Of those at steps and beside holes: {before.f1_at_edges:.3f} before, {after.f1_at_edges:.3f} with the'
        ' lesson.'
    )
    click.echo(f'Good points removed: {before.removed_text} before, {after.removed_text} with the lesson.')
    click.echo(f'Next: open {shell_words(page)}, then set circle.lesson to {output}')


def _check_target(path: Path, good: tuple[Path, ...], mark: str, kind: str) -> None:
    """Check now, and not after minutes, that the result replaces nothing but an earlier one.

    Args:
        path: of the result.
        good: the files that are read.
        mark: what the beginning of an earlier result holds.
        kind: of the result, in words.

    Raises:
        SocialCircleError: it does not.
    """
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.storage import lies_in

    if path.is_dir():
        raise SocialCircleError(f'{path} is a directory: give the name of a file.')
    source = next((each for each in good if lies_in(path, each)), None)
    if source is not None:
        raise SocialCircleError(f'{path} would be written into {source}, which is read: give another name.')
    if path.is_file():
        try:
            with path.open('rb') as file:
                beginning = file.read(_BEGINNING)
        except OSError as error:
            raise SocialCircleError(f'{path} cannot be read: {error.strerror}.') from None
        if mark.encode() not in beginning:
            raise SocialCircleError(f'{path} is no {kind}, and is not replaced: give another name.')
