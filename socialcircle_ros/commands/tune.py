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
@click.option('--node', default='social_circle', show_default=True, help='Name of the node that is tuned.')
@click.option('--port', default=8080, show_default=True, help='Of the page; where it is taken, the next free one.')
@click.option(
    '--host', default='127.0.0.1', show_default=True,
    help='Address to listen on; 0.0.0.0 lets everybody in the network change the parameters.',
)  # fmt: skip
@click.option(
    '--presets', type=click.Path(path_type=Path, file_okay=False),
    help='Folder of the presets; default: ~/.ros/socialcircle/presets.',
)  # fmt: skip
def command(arguments: tuple[str, ...], node: str, port: int, host: str, presets: Path | None) -> None:
    """Tune a running node from a page in the browser: see the cloud and its outliers change with each setting.

    The page listens on this machine only. With a RECORDING it steps through its clouds, each of which goes to the
    node. It waits for the node where that is not there yet, and goes on when it was started again.
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
        click.echo(f'Tuning {name} at {address}; Ctrl-C ends it.')
        if host not in ('127.0.0.1', 'localhost', '::1'):
            click.echo(f'Warning: whoever reaches {address} can change the parameters of {name}.', err=True)

    try:
        tune(
            node, host=host, port=port, presets=presets or default_folder(), recording=recording,
            arguments=ros_arguments, serving=serving,
        )  # fmt: skip
    except RuntimeError as error:  # what rclpy raises for arguments that it cannot read, on several lines
        raise SocialCircleError(f'The page cannot start: {str(error).splitlines()[0]}') from None


def _split(arguments: tuple[str, ...]) -> tuple[Path | None, list[str]]:
    """The recording, if one is named, and what is for ROS."""
    first = arguments.index('--ros-args') if '--ros-args' in arguments else len(arguments)
    own, ros = arguments[:first], list(arguments[first:])
    if len(own) > 1 or (own and own[0].startswith('-')):
        raise click.UsageError(f'{own[-1]!r} is not for this command; it takes one RECORDING, and --ros-args.')
    return (Path(own[0]) if own else None), ros


def main() -> int:
    """As `socialcircle tune`."""
    from .main import main as socialcircle

    return socialcircle(['tune', *sys.argv[1:]])
