# SPDX-License-Identifier: Apache-2.0
"""`socialcircle experiment`: options and printing; the experiments are in `studies`."""

import importlib.metadata
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import quantity, shell_words

if TYPE_CHECKING:
    from socialcircle_ros.studies.comparison.measured import MeasuredCloud
    from socialcircle_ros.studies.steps import Finished

NAMES = ('table1', 'figure4', 'figure8', 'figure10', 'figure11', 'all', 'adaptive', 'learned')


@click.command('experiment', epilog='Example: socialcircle experiment table1 --quick')
@click.argument('name', type=click.Choice(NAMES))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('out/experiments'), show_default=True,
    help='Directory for the page, the tables (CSV) and the pictures.',
)  # fmt: skip
@click.option(
    '--quick', is_flag=True, help='Use small clouds to check that it runs; the numbers are not meaningful.'
)
@click.option(
    '--seeds', help='Seeds of the scored clouds, such as 4,5; default: 1,2,3; adaptive: 301 to 320; learned: 401.'
)
@click.option(
    '--data', type=click.Path(path_type=Path, exists=True, file_okay=False), envvar='SOCIALCIRCLE_DATA',
    help='Directory of measured surfaces (.npz) for figure8, all, adaptive, learned; default: $SOCIALCIRCLE_DATA.',
)  # fmt: skip
@click.option(
    '--network', type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help='ONNX file that learned compares; default: the packaged network.',
)  # fmt: skip
@click.option('--restart', is_flag=True, help='Forget what an earlier, interrupted run has finished.')
def command(
    name: str, output: Path, quick: bool, seeds: str | None, data: Path | None, network: Path | None, restart: bool
) -> None:
    """Repeat the experiments of the paper with known truth, and report where its claims hold.

    The social circle is compared with the radius, the statistical and the median filter, each at default settings
    and at the best settings found on other seeds. PCL and Open3D are included where installed. The command writes
    one HTML page, its tables and its pictures. `all` runs all experiments of the paper. `adaptive` evaluates the
    goals of the adaptive mode. `learned` compares a network with the rules of the adaptive mode; it needs --data.

    It says first how long it will take, estimated from a small search on this machine. The results are written
    after each step. If a run is interrupted, the same command continues with the steps that are left.
    """
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    from socialcircle_ros.pictures.style import new_figure
    from socialcircle_ros.storage import check_folder_name, folder_of_results
    from socialcircle_ros.studies.adaptive.experiment import DEFAULT_SEEDS
    from socialcircle_ros.studies.comparison.study import Plan, Study, quick_plan
    from socialcircle_ros.studies.experiments import learned_steps, run, steps_of
    from socialcircle_ros.studies.steps import fingerprint_of

    from .console import CommandConsole, CommandProgress

    if name == 'learned' and data is None:
        raise click.UsageError('learned needs measured surfaces: give --data or set SOCIALCIRCLE_DATA.')
    check_folder_name(output)
    chosen = _numbers(seeds) if seeds else {'adaptive': DEFAULT_SEEDS, 'learned': (401,)}.get(name, (1, 2, 3))
    plan = quick_plan(chosen) if quick else Plan(chosen)
    new_figure(1, 1)  # fails now, not after minutes, if matplotlib is missing
    surfaces = _surfaces(data) if data is not None and name != 'learned' else []
    if quick:
        surfaces = surfaces[:1]
    console = CommandConsole(stderr=True)
    command_line = (
        f'socialcircle experiment {name}{f" --seeds {seeds}" if seeds else ""}{" --quick" if quick else ""}'
    )
    columns = (SpinnerColumn(), TextColumn('{task.description}'), TimeElapsedColumn())
    finished = None
    with folder_of_results(output), CommandProgress(*columns, console=console) as progress:
        task = progress.add_task(name, total=None)

        def report(step: str) -> None:
            progress.update(task, description=step)
            if not console.is_terminal:
                click.echo(f'{progress.tasks[task].elapsed or 0:4.0f} s  {step}', err=True)

        study = Study(plan, report)
        if name == 'learned' and data is not None:
            steps = learned_steps(study, data, network, quick=quick)
        else:
            steps = steps_of(name, study, surfaces)
        shared = fingerprint_of(
            importlib.metadata.version('socialcircle_ros'), name, plan, data, network,
            [(cloud.name, fingerprint_of(cloud.points)) for cloud in surfaces],
        )  # fmt: skip
        for finished in run(output, name, steps, shared, command=command_line, restart=restart):
            report(_state(finished))
    if finished is None:
        return
    for section in finished.sections:
        for finding in section.findings:
            click.echo(f'- {finding}')
    click.echo(f'Next: open {shell_words(output / f"{name}.html")}')


def _state(finished: 'Finished') -> str:
    """How far an experiment is, and how long it still takes."""
    state = f'{finished.done} of {quantity(finished.total, "step")} finished'
    if finished.resumed:
        state += f', {finished.resumed} of them by an earlier run'
    if finished.done == finished.total:
        return state
    return f'{state}, about {_duration(finished.seconds_left)} left'


def _duration(seconds: float) -> str:
    """An estimated time with one or two digits."""
    if seconds < 90:
        return f'{max(1, seconds):.0f} s'
    return f'{seconds / 60:.0f} min' if seconds < 5400 else f'{seconds / 3600:.1f} h'


def _surfaces(folder: Path) -> 'list[MeasuredCloud]':
    """Import the height maps of a folder; focus stacks are skipped."""
    import numpy as np

    from socialcircle_ros.lengths import unit_name
    from socialcircle_ros.recording import import_cloud
    from socialcircle_ros.studies.comparison.measured import MeasuredCloud

    clouds = []
    for path in sorted(folder.glob('*.npz')):
        with np.load(path) as arrays:
            if 'frames' in arrays:
                continue
        cloud = import_cloud(path)
        clouds.append(
            MeasuredCloud(cloud.name, cloud.points, unit_name(cloud.unit) if cloud.unit else 'unit of the file')
        )
    return clouds


def _numbers(text: str) -> tuple[int, ...]:
    try:
        numbers = tuple(int(part) for part in text.split(','))
    except ValueError:
        numbers = ()
    if not numbers or min(numbers) < 0:
        raise click.BadParameter('give whole numbers from 0, with commas, such as 1,2,3.', param_hint='--seeds')
    return numbers
