"""`socialcircle experiment`."""

from pathlib import Path

import click

NAMES = ('table1', 'figure4', 'figure8', 'figure10', 'figure11', 'all')


@click.command('experiment', epilog='Example: socialcircle experiment table1 --quick')
@click.argument('name', type=click.Choice(NAMES))
@click.option(
    '-o', '--out', type=click.Path(path_type=Path), default=Path('out/experiments'), show_default=True,
    help='Directory of the page, the tables (CSV) and the pictures.',
)  # fmt: skip
@click.option('--quick', is_flag=True, help='Small clouds, to see it work; the numbers say little.')
@click.option('--seeds', default='1,2,3', show_default=True, help='Of the clouds that the scores come from.')
def command(name: str, out: Path, quick: bool, seeds: str) -> None:
    """Repeat the experiments of the paper with known truth, and say where its claims hold.

    Compares the social circle with the radius, the statistical and the median filter, each at its default and at
    its best settings, searched on other seeds; PCL and Open3D stand beside them where installed. Writes one HTML
    page, its tables and its pictures.
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from socialcircle_ros.evaluation.experiments import run, write
    from socialcircle_ros.evaluation.lineup import Lineup, Plan, quick_plan
    from socialcircle_ros.evaluation.pictures import new_figure

    chosen = _numbers(seeds)
    plan = quick_plan(chosen) if quick else Plan(chosen)
    new_figure(1, 1)  # says that matplotlib is missing now, not after minutes
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn('{task.description}'), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(name, total=None)
        sections = run(name, Lineup(plan, lambda step: progress.update(task, description=step)))
    called = f'socialcircle experiment {name} --seeds {seeds}{" --quick" if quick else ""}'
    written = write(out, name, called, sections)
    for section in sections:
        for finding in section.findings:
            click.echo(f'- {finding}')
    click.echo(f'{len(written)} files written; next: open {written[0]}')


def _numbers(text: str) -> tuple[int, ...]:
    try:
        numbers = tuple(int(part) for part in text.split(','))
    except ValueError:
        numbers = ()
    if not numbers or min(numbers) < 0:
        raise click.BadParameter('give whole numbers from 0, with commas, such as 1,2,3.', param_hint='--seeds')
    return numbers
