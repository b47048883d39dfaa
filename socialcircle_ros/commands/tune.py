"""`socialcircle tune`, and the executable `tune` of `ros2 run`."""

import sys
from pathlib import Path

import click

from .options import require_ros


@click.command(
    'tune',
    context_settings={'ignore_unknown_options': True, 'help_option_names': ['-h', '--help']},
    epilog='Example: socialcircle tune night.mcap --node /cell1/social_circle',
)
@click.argument('arguments', nargs=-1, type=click.UNPROCESSED, metavar='[RECORDING] [--ros-args ...]')
@click.option('--node', default='social_circle', show_default=True, help='Name of the node to tune.')
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
def command(arguments: tuple[str, ...], node: str, port: int, host: str, presets: Path | None) -> None:
    """Tune a running node on a page in the browser, and see how each setting changes the outliers.

    The printed address holds a secret token; without it, nobody can open the page. By default, only this machine
    can. With a RECORDING, the page steps through its clouds and sends
    each to the node. The page waits while the node is not running, and continues when the node is started again.
    """
    recording, ros_arguments = _split(arguments)
    require_ros()
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.panel.page import require_viser
    from socialcircle_ros.panel.presets import default_folder

    require_viser()
    from socialcircle_ros.clients.tune import tune

    def serving(name: str, address: str) -> None:
        click.echo(f'Tuning {name} at {address}; press Ctrl-C to stop.')
        if host not in ('127.0.0.1', 'localhost', '::1'):
            click.echo(
                f'Warning: whoever has this address can change the parameters of {name}, and the connection is not'
                ' encrypted.', err=True,
            )  # fmt: skip

    try:
        tune(
            node, host=host, port=port, presets=presets or default_folder(), recording=recording,
            arguments=ros_arguments, serving=serving,
        )  # fmt: skip
    except RuntimeError as error:  # rclpy raises it for arguments that it cannot read; its text has several lines
        raise SocialCircleError(f'The page cannot start: {str(error).splitlines()[0]}') from None


def _split(arguments: tuple[str, ...]) -> tuple[Path | None, list[str]]:
    """Split the arguments into the recording, if there is one, and the arguments for ROS."""
    first = arguments.index('--ros-args') if '--ros-args' in arguments else len(arguments)
    own, ros = arguments[:first], list(arguments[first:])
    if len(own) > 1 or (own and own[0].startswith('-')):
        raise click.UsageError(f'{own[-1]!r} is not for this command; give one RECORDING at most, and --ros-args.')
    return (Path(own[0]) if own else None), ros


def main() -> int:
    """Run `socialcircle tune`."""
    from .main import main as socialcircle

    return socialcircle(['tune', *sys.argv[1:]])
