# SPDX-License-Identifier: Apache-2.0
"""`socialcircle simulate`."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from .options import Number, progress_bar, stack_text

if TYPE_CHECKING:
    from socialcircle_ros.arguments import Compression


@click.command('simulate', epilog='Example: socialcircle simulate steep_groove -o groove.mcap --seed 3')
@click.argument('specimen', default='metal_groove')
@click.option(
    '-o',
    '--output',
    required=True,
    type=click.Path(path_type=Path),
    help='Recording to write: NAME.mcap, or a directory.',
)
@click.option(
    '--size', type=(int, int), default=(480, 640), show_default=True, metavar='ROWS COLUMNS',
    help='Size of the frames, in pixels.',
)  # fmt: skip
@click.option('--instrument', default='10x', show_default=True, help='Objective: 5x, 10x, 20x or 50x.')
@click.option('--frames', type=int, help='Number of frames. Default: as many as the surface needs.')
@click.option(
    '--z-step', type=Number(), help='Distance between two frames, in µm. Default: a quarter of the depth of field.'
)
@click.option(
    '--renderer', type=click.Choice(['layered', 'rays']), default='layered', show_default=True,
    help='rays is slower; it is for small fields with walls.',
)  # fmt: skip
@click.option('--seed', default=0, show_default=True, help='Seed of all random numbers.')
@click.option(
    '--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='zstd', show_default=True,
    help='Compression of the recording.',
)  # fmt: skip
@click.option('--overwrite', is_flag=True, help='Replace an existing recording and its parameters.')
def command(
    specimen: str,
    output: Path,
    size: tuple[int, int],
    instrument: str,
    frames: int | None,
    z_step: float | None,
    renderer: Literal['layered', 'rays'],
    seed: int,
    compression: 'Compression',
    overwrite: bool,
) -> None:
    """Simulate the focus stack of a SPECIMEN with known truth.

    SPECIMEN is metal_groove, steep_groove, closed_groove, composite, flat, ball, steps, discs, pits or islands.

    Writes a recording with the frames, the stage positions and the truth. Writes beside it the parameters with
    which the node measures the stack. Outliers follow from simulated physics: glints, darkness, steep slopes,
    missing texture and camera noise.
    """
    if seed < 0:
        raise click.BadParameter('must not be negative.', param_hint='--seed')
    from socialcircle_ros.digits import size_text
    from socialcircle_ros.recording.create import record_simulation
    from socialcircle_ros.simulation import simulate

    rows, columns = size
    simulation = simulate(
        specimen, rows, columns, instrument=instrument, frames=frames, z_step=z_step, renderer=renderer, seed=seed
    )
    with progress_bar(f'scanning {specimen}') as progress:
        stack = record_simulation(
            simulation, output, compression=compression, overwrite=overwrite, progress=progress
        )
    told = stack_text(output, stack.parameters)
    click.echo(f'{stack.frames} frames of {size_text(rows, columns)} {told}')
