# SPDX-License-Identifier: Apache-2.0
"""`socialcircle`: the group of commands. A command is imported when it runs or when the help lists it."""

import atexit
import gc
import importlib
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

import click

from socialcircle_ros.errors import ParameterFileWarning, SocialCircleError, UnitWarning
from socialcircle_ros.kernels import compiling
from socialcircle_ros.storage import NotedSignal, SignalExit, lasting_interruption

from .failures import NotedOutput, noted_output, sentence_of
from .spelling import nearest_name

_TOLD = UnitWarning, ParameterFileWarning

GROUPS = {
    'Run': {'demo': 'demo', 'node': 'node', 'tune': 'tune', 'warm-up': 'warm_up'},
    'Recordings and files': {
        'record': 'record',
        'play': 'play',
        'filter': 'filter',
        'batch': 'batch',
        'import': 'import_',
        'export': 'export',
        'info': 'info',
        'simulate': 'simulate',
    },
    'Look': {'report': 'report', 'measurements': 'measurements', 'trend': 'trend'},
    'Study': {
        'teach': 'teach',
        'calibrate': 'calibrate',
        'sweep': 'sweep',
        'bench': 'bench',
        'experiment': 'experiment',
    },
}
"""The commands in the groups of the help: name to module."""

COMMANDS = {name: module for group in GROUPS.values() for name, module in group.items()}
"""Name of each command to its module."""


class _Commands(click.Group):
    """Imports the module of a command only when it is needed."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f'.{COMMANDS[cmd_name]}', __package__)
        command: click.Command = module.command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, and ask for the one that was meant where there is none."""
        name = args[0]
        near = None if name in COMMANDS else nearest_name(name, COMMANDS)
        if near is not None and not name.startswith('-'):
            ctx.fail(f"No such command {name!r}. Did you mean '{near}'?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the first sentence of each command, whole, in groups."""
        for title, group in GROUPS.items():
            commands = [(name, self.get_command(ctx, name)) for name in group]
            rows = [(name, command.get_short_help_str(limit=1000)) for name, command in commands if command]
            with formatter.section(title):
                formatter.write_dl(rows)


@click.group(
    cls=_Commands,
    context_settings={'help_option_names': ['-h', '--help'], 'max_content_width': 110},
    epilog='Start with: socialcircle demo. A command explains itself: socialcircle filter --help',
)
@click.version_option(package_name='socialcircle_ros')
@click.pass_context
def socialcircle(context: click.Context) -> None:
    """Remove the outliers of organized point clouds with the social circle method, live or from recordings.

    A recording is an MCAP file or a rosbag2 directory. `ros2 bag play` reads every recording that is written here.
    """
    if context.invoked_subcommand not in GROUPS['Run']:  # which say themselves what they wait for
        context.with_resource(_told_compilation())


@contextmanager
def _told_compilation() -> Iterator[None]:
    """Say once on stderr that kernels are compiled, if one was not in the cache."""
    told = False

    def tell() -> None:
        nonlocal told
        if not told:
            told = True
            click.echo('The first use compiles the filter, which can take half a minute.', err=True)

    compiling.listeners.append(tell)
    try:
        yield
    finally:
        compiling.listeners.remove(tell)


@contextmanager
def _told_warnings() -> Iterator[None]:
    """Print each warning of our own once, as a sentence on stderr."""
    told: set[str] = set()
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if not isinstance(message, _TOLD):
                others(message, category, filename, lineno, file, line)
            elif str(message) not in told:
                told.add(str(message))
                click.echo(f'Warning: {message}', err=True)

        for kind in _TOLD:
            warnings.simplefilter('always', kind)
        warnings.showwarning = show
        yield


def main(arguments: list[str] | None = None) -> int:
    """Run a command. An error is one sentence on stderr.

    Args:
        arguments: the command and its arguments; None: those of the process.

    Returns:
        The exit code: 0 for success, 1 for an error, 2 for wrong arguments, 3 if a measurement failed its limits,
        130 after Ctrl-C, 129 after SIGHUP, 143 after SIGTERM.
    """
    # The last collection of a process would visit all objects of all libraries: 0.4 s at the end of a batch.
    atexit.register(gc.freeze)
    with noted_output() as output:
        code = _told_run(arguments, output)
        unwritten = None if output is None else output.end()
    if unwritten is not None:
        click.echo(f'Error: {unwritten}', err=True)
    return code or int(unwritten is not None)


def _told_run(arguments: list[str] | None, output: NotedOutput | None) -> int:
    """Run a command, and tell on stderr how it failed, unless it is that stdout cannot be written.

    Args:
        arguments: the command and its arguments.
        output: takes the place of stdout; None: there is none.

    Returns:
        The exit code.
    """
    try:
        with _told_warnings(), lasting_interruption() as interrupted:
            return _run(arguments, interrupted)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except SocialCircleError as error:
        click.echo(f'Error: {error}', err=True)
        return 1
    except SignalExit as ended:
        click.echo(f'Ended by {ended.signal.name}.', err=True)
        return 128 + ended.signal
    except (KeyboardInterrupt, click.Abort):
        click.echo('Stopped.', err=True)
        return 130
    except Exception as error:
        if output is not None and output.has_failed_by(error):
            return 1
        sentence = sentence_of(error)
        if sentence is None:
            raise
        click.echo(f'Error: {sentence}', err=True)
        return 1


def _run(arguments: list[str] | None, interrupted: NotedSignal) -> int:
    """Run a command; whatever it does after Ctrl-C, it is stopped, unless it takes Ctrl-C as its normal end.

    Raises:
        KeyboardInterrupt: Ctrl-C came.
    """
    try:
        # Outside of standalone mode click returns an exit code instead of ending the process.
        code = int(socialcircle.main(arguments, standalone_mode=False) or 0)
    except Exception as error:
        if interrupted.first is None:
            raise
        raise KeyboardInterrupt from error  # a library made this error of it
    if interrupted.first is not None:
        raise KeyboardInterrupt  # a library dropped it
    return code


if __name__ == '__main__':
    sys.exit(main())
