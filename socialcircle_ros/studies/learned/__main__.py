# SPDX-License-Identifier: Apache-2.0
"""`python -m socialcircle_ros.studies.learned`: make the corpus, train the network, and write it as ONNX."""

import shlex
from pathlib import Path

import click

from socialcircle_ros.errors import SocialCircleError, install_command

from . import options


@click.command(
    'learned', epilog='Example: python -m socialcircle_ros.studies.learned --work /tmp/learned -o network.onnx'
)
@options.data
@options.work
@click.option(
    '-o',
    '--output',
    'out',
    type=click.Path(path_type=Path),
    required=True,
    help='ONNX file to write, with 8-bit weights.',
)
@click.option('--files', default=100, show_default=True, help='Files of the corpus: 100 patches, 154 MB each.')
@click.option('--steps', default=12_000, show_default=True, help='Steps of the training.')
@click.option('--workers', default=2, show_default=True, help='Processes; each has 8 crops a step.')
@click.option('--seed', default=1, show_default=True, help='Decides corpus, first weights and order of the crops.')
@click.option(
    '--leave-out', multiple=True, metavar='NAME',
    help='Surfaces that are not trained on: those whose name begins with NAME; may be given several times.'
    ' Default: the surfaces that the packaged weights leave out.',
)  # fmt: skip
@click.option(
    '--from', 'start', type=click.Path(path_type=Path, exists=True),
    help='trained.onnx of the work of an earlier training, to start from; default: random weights.',
)  # fmt: skip
def command(
    data: Path,
    work: Path,
    out: Path,
    files: int,
    steps: int,
    workers: int,
    seed: int,
    leave_out: tuple[str, ...],
    start: Path | None,
) -> None:
    """Train the network of the adaptive mode, and round it to 8 bits.

    The corpus is made first, and kept: real surfaces of the data folder and simulated ones, with outliers from
    several generators, and what a larger network, the teacher, says of them. The result depends on the options and
    on the number of workers.
    """
    try:
        from .corpus import make_corpus
        from .export import network_from
        from .measured import training_surfaces
        from .run import Run, train
        from .teacher import ask_teacher, require_weights
    except ImportError as error:
        raise click.ClickException(f'The training needs {error.name}: {install_command("train")}.') from None
    from .surfaces import HELD_OUT, read_surfaces

    require_weights()
    if start is not None:
        network_from(start)  # it must be of this shape, which is known only in hours otherwise
    left_out = leave_out or tuple(HELD_OUT)
    surfaces = read_surfaces(data)
    chosen = training_surfaces(surfaces, left_out)
    if not chosen:
        raise click.BadParameter('no surface is left to train on.', param_hint='--leave-out')
    folder = work / 'corpus'
    click.echo(f'{len(chosen)} of {len(surfaces)} surfaces are trained on; corpus in {folder}', err=True)
    make_corpus(folder, chosen, range(1000 * seed, 1000 * seed + files), lambda step: click.echo(step, err=True))
    ask_teacher(folder, lambda step: click.echo(step, err=True))
    trained = [each.name for each in chosen]
    others = [each.cloud.name for each in surfaces if each.cloud.name not in trained]
    names = {'trained_on': trained, 'held_out': others}
    train(Run(folder, work, out, steps, workers, seed, start, names))
    click.echo(f'{out} written; next: socialcircle experiment learned --network {shlex.quote(str(out))}')


if __name__ == '__main__':
    try:
        command()
    except SocialCircleError as error:
        raise SystemExit(str(error)) from None
