# SPDX-License-Identifier: Apache-2.0
"""`socialcircle demo`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import require_ros

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from socialcircle_ros.clients.demo import DemoCloud, RefusedCloud

_COLUMNS = ('mode', 'measured', 'outliers', 'seed', 'radius', 'total', 'latency', 'prec.', 'recall')
_CAPTION = (
    'mode: circle.mode; a row without a name is the cloud above after the mode was changed in the running node.'
    ' seed: row, column; total: all work of the node on the cloud; latency: from the publication of the cloud (or'
    ' of the last frame of a stack) to the filtered cloud; both in ms.'
)
_WIDTH = 100
"""Columns of the table where the output is no terminal."""


@click.command('demo', epilog='Example: socialcircle demo measurement.npz')
@click.argument('files', nargs=-1, type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', type=click.Path(path_type=Path), default=Path('out/demo'), show_default=True,
    help='Folder of the results.',
)  # fmt: skip
@click.option(
    '--params-file',
    type=click.Path(path_type=Path),
    help='Parameter file (YAML) of the node, such as that of a focus stack.',
)
def command(files: tuple[Path, ...], output: Path, params_file: Path | None) -> None:
    """See the node work: play recordings into it.

    Starts the node in its own process and plays FILES into it over DDS, one cloud at a time. FILES are recordings,
    or measurement files of any format in docs/formats.md, such as .npz, .ply or .x3p. Without FILES it plays
    simulated recordings with known truth, and shows precision and recall.

    The node filters each cloud, and the first one of each file in the other mode of the filter as well
    (circle.mode). Prints one table: number of outliers, seed, radius, and times in ms; and what the node warns of.
    Writes the filtered recordings, and a picture of the first cloud of each.

    The node runs in a namespace of its own and does not disturb other nodes.
    """
    require_ros()
    import os

    # The demo needs no other machine. A range that the user chose stays.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from socialcircle_ros.clients.demo import RefusedCloud, run_demo
    from socialcircle_ros.storage import check_folder_name, folder_of_results

    from .console import CommandConsole

    check_folder_name(output)

    console = CommandConsole()
    if not console.is_terminal:
        console = CommandConsole(width=_WIDTH)
    with folder_of_results(output), console.status('') as status:
        demo = run_demo(files, output, params_file=params_file, status=status.update)
    console.print(_table(demo.clouds))
    for cloud in demo.clouds:
        name = f'{cloud.name}, {cloud.mode}' if cloud.mode else cloud.name
        if isinstance(cloud, RefusedCloud):
            click.echo(f'{name} was refused: {cloud.reason}', err=True)
        elif cloud.warning:
            click.echo(f'{name}: {cloud.warning}', err=True)
    for damage in demo.damage:
        click.echo(f'Warning: {damage}', err=True)
    console.print('Written:')
    for path in demo.written:
        console.print(f'  {path}', soft_wrap=True, highlight=False)
    console.print('Next: open the pictures, then try: socialcircle filter --help', highlight=False)


def _table(clouds: 'Sequence[DemoCloud | RefusedCloud]') -> 'Table':
    from rich.table import Table

    from socialcircle_ros.clients.demo import DemoCloud

    table = Table(title='Clouds through the live node', box=None, padding=(0, 1, 0, 0), caption=_CAPTION)
    table.add_column('cloud')
    for name in _COLUMNS:
        table.add_column(name, justify='right')
    before = ''
    for cloud in clouds:
        cells = _cells(cloud) if isinstance(cloud, DemoCloud) else ['refused']
        table.add_row('' if cloud.name == before else cloud.name, cloud.mode, *cells)
        before = cloud.name
    return table


def _cells(cloud: 'DemoCloud') -> list[str]:
    """The cells of a row after its mode; empty without a known truth."""
    from socialcircle_ros.lengths import length_text

    found, scores = cloud.measurement, cloud.scores
    return [
        str(found.measured),
        str(found.outliers),
        f'{found.seed_row},{found.seed_column}',
        length_text(found.radius, cloud.unit),
        f'{cloud.total_ms:.1f}',
        f'{cloud.latency_ms:.1f}',
        *(['', ''] if scores is None else [f'{scores.precision:.3f}', f'{scores.recall:.3f}']),
    ]
