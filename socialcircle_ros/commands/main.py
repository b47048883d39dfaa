"""`socialcircle`: the group of commands; each is loaded when it is called or listed."""

import importlib
import sys

import click

from socialcircle_ros.errors import SocialCircleError

COMMANDS = {
    'demo': 'demo',
    'node': 'node',
    'tune': 'tune',
    'filter': 'filter',
    'play': 'play',
    'record': 'record',
    'import': 'import_',
    'simulate': 'simulate',
    'report': 'report',
    'sweep': 'sweep',
    'bench': 'bench',
    'experiment': 'experiment',
}


class _Commands(click.Group):
    """Loads a command's module only when it is wanted."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f'.{COMMANDS[cmd_name]}', __package__)
        command: click.Command = module.command
        return command


@click.group(
    cls=_Commands,
    context_settings={'help_option_names': ['-h', '--help'], 'max_content_width': 110},
    epilog='Start with: socialcircle demo',
)
@click.version_option(package_name='socialcircle_ros')
def socialcircle() -> None:
    """Remove the outliers of organized point clouds by the social circle method, live or from recordings.

    A recording is an MCAP file or a rosbag2 directory; what is written here, `ros2 bag play` reads.
    """


def main(arguments: list[str] | None = None) -> int:
    """Run a command, of the command line unless given; an error is one sentence, and exit code 1."""
    try:
        # Without standalone mode click gives the code of an Exit back instead of exiting.
        return int(socialcircle.main(arguments, standalone_mode=False) or 0)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except SocialCircleError as error:
        click.echo(f'Error: {error}', err=True)
        return 1
    except (KeyboardInterrupt, click.Abort):
        click.echo('Stopped.', err=True)
        return 130


if __name__ == '__main__':
    sys.exit(main())
