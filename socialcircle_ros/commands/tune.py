# SPDX-License-Identifier: Apache-2.0
"""`socialcircle tune`, and the executable `tune` of `ros2 run`."""

import re
import sys
from pathlib import Path

import click

from .options import require_ros

_CELL = re.compile(r'(/[A-Za-z_]\w*)+')


@click.command(
    'tune',
    context_settings={'ignore_unknown_options': True, 'help_option_names': ['-h', '--help']},
    epilog='Examples: socialcircle tune; socialcircle tune night.mcap; socialcircle tune /cell1 /cell2',
)
@click.argument('arguments', nargs=-1, type=click.UNPROCESSED, metavar='[RECORDING] [/CELL]... [--ros-args ...]')
@click.option(
    '--node', 'nodes', multiple=True, metavar='NAME',
    help='Full name of a node to tune, such as /cell1/social_circle. May be repeated.',
)  # fmt: skip
@click.option(
    '--port', type=click.IntRange(0, 65535), default=8080, show_default=True,
    help='Port of the page; the next free one if it is in use.',
)  # fmt: skip
@click.option(
    '--host', default='127.0.0.1', show_default=True,
    help='Address or name to listen on; with 0.0.0.0 the page can be opened from the network, not encrypted.',
)  # fmt: skip
@click.option(
    '--presets', type=click.Path(path_type=Path, file_okay=False),
    help='Folder of the presets; default: ~/.ros/socialcircle/presets.',
)  # fmt: skip
def command(
    arguments: tuple[str, ...], nodes: tuple[str, ...], port: int, host: str, presets: Path | None
) -> None:
    """Tune running nodes on a page in the browser, and see how each setting changes the outliers.

    The page finds the nodes that run: it shows the only one, and offers several. Give their namespaces, such as
    /cell1 /cell2, or --node to choose. It waits while there is none, and continues when a node is started again.

    The printed address holds a secret token; without it, nobody can open the page. By default, only this machine
    can. With a RECORDING, the page steps through its clouds and sends each to the node.
    """
    recording, cells, ros_arguments = _split(arguments)
    require_ros()
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from socialcircle_ros.panel.page import require_viser
    from socialcircle_ros.panel.presets import default_folder

    if recording is not None:
        _check(recording)
    require_viser()
    from socialcircle_ros.clients.tune import tune

    def serving(name: str, waiting: str, address: str) -> None:
        begin = f'Tuning {name} at' if name else 'The tuning page is at'
        click.echo(f'{begin} {address} (Ctrl-C stops it)')
        if not name:
            click.echo(waiting)
        if host not in ('127.0.0.1', 'localhost', '::1'):
            click.echo(
                f'Warning: whoever has this address can change the parameters of {name or "every node"}, and the'
                ' connection is not encrypted.', err=True,
            )  # fmt: skip

    tune(
        nodes, cells, host=host, port=port, presets=presets or default_folder(), recording=recording,
        arguments=ros_arguments, serving=serving,
    )  # fmt: skip


def _check(recording: Path) -> None:
    """End with a sentence where the recording cannot be opened, instead of a page that waits."""
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.panel.recorded import check_recording

    if not recording.exists() and _CELL.fullmatch(f'/{recording}'):
        raise SocialCircleError(
            f'{recording} does not exist; if it is the namespace of a cell, write /{recording}.'
        )
    check_recording(recording)


def _split(arguments: tuple[str, ...]) -> tuple[Path | None, list[str], list[str]]:
    """Split the arguments into the recording, if there is one, the cells, and the arguments for ROS.

    A name such as /cell1 is that of a cell unless there is a file of this name.
    """
    first = arguments.index('--ros-args') if '--ros-args' in arguments else len(arguments)
    own, ros = arguments[:first], list(arguments[first:])
    cells = [name for name in own if _CELL.fullmatch(name) and not Path(name).exists()]
    others = [name for name in own if name not in cells]
    if len(others) > 1 or (others and others[0].startswith('-')):
        raise click.UsageError(
            f'{others[-1]!r} is not for this command; give one RECORDING at most, namespaces such as /cell1, and'
            ' --ros-args.'
        )
    return (Path(others[0]) if others else None), cells, ros


def main() -> int:
    """Run `socialcircle tune`."""
    from .main import main as socialcircle

    return socialcircle(['tune', *sys.argv[1:]])
