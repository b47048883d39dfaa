# SPDX-License-Identifier: Apache-2.0
"""`socialcircle play`."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import Number, quantity, require_ros

if TYPE_CHECKING:
    from socialcircle_ros.clients.player import Replay

_CLOCK_HZ = 40.0  # as ros2 bag play


class _ClockRate(Number):
    """A rate in Hz, which may be left out where no argument follows."""

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            self.fail(f'{error.message} What follows --clock is its rate in Hz: give --clock last.', param, ctx)


@click.command('play', epilog='Example: socialcircle play last_night.mcap --rate 0.5 --loop')
@click.argument('recording', type=click.Path(path_type=Path))
@click.argument('more', nargs=-1, metavar='')
@click.option(
    '--topics', '--topic', multiple=True, metavar='TOPIC...', help='Play only these topics; may be repeated.'
)
@click.option(
    '-r',
    '--rate',
    default=1.0,
    type=Number(min=0, min_open=True),
    show_default=True,
    help='2: twice as fast as recorded.',
)
@click.option('-l', '--loop', is_flag=True, help='Start again at the end, until Ctrl-C.')
@click.option(
    '--start-offset',
    default=0.0,
    type=Number(min=0),
    metavar='SECONDS',
    help='Leave out the messages of the first seconds.',
)
@click.option('-p', '--start-paused', is_flag=True, help='Wait for a key.')
@click.option(
    '--clock',
    is_flag=False,
    flag_value=_CLOCK_HZ,
    default=0.0,
    type=_ClockRate(min=0),
    metavar='[HZ]',
    help=f'Publish recorded time on /clock, for nodes with use_sim_time: {_CLOCK_HZ:g} times per second, or HZ.'
    ' Give it last.',
)
@click.option(
    '--namespace',
    help='Where to play, such as /cell2, or / for the root: in place of the namespace of the recorded cell. Where'
    ' none or several were recorded, it is put before every topic.',
)
@click.option('--prefix', default='', help='Instead of --namespace: put before every topic in any case.')
@click.option(
    '--wait', default=10.0, type=Number(min=0), show_default=True, help='Seconds to wait for the first subscriber.'
)
def command(
    recording: Path,
    more: tuple[str, ...],
    topics: tuple[str, ...],
    rate: float,
    loop: bool,
    start_offset: float,
    start_paused: bool,
    clock: float,
    namespace: str | None,
    prefix: str,
    wait: float,
) -> None:
    """Publish a RECORDING byte for byte, with its recorded timing and QoS.

    \b
    Keys, in a terminal:
      space    pause, and go on
      →        the next message, while paused
      ↑  ↓     10 % faster, 10 % slower

    A replay is best effort: a busy subscriber misses clouds. Use `socialcircle filter` for exact results.
    """  # noqa: D301 - click reads \b
    if more and not topics:
        raise click.UsageError(f'{more[0]!r} is not for this command: topics follow --topics.')
    require_ros()
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from socialcircle_ros.clients.keys import DOWN, RIGHT, SPACE, UP, listened_keys
    from socialcircle_ros.clients.pace import Pace
    from socialcircle_ros.clients.player import play_recording

    from .console import CommandProgress

    namespace, prefix = _checked(namespace, prefix)
    pace = Pace(rate, paused=start_paused)
    progress = CommandProgress()
    task = progress.add_task('', total=None)

    def show() -> None:
        state = 'paused' if pace.paused else f'{pace.rate:.3g} ×'
        progress.update(task, description=f'playing {recording.name} ({state})')

    def key(change: Callable[[], object]) -> Callable[[], None]:
        def press() -> None:
            change()
            show()

        return press

    keys = {
        SPACE: key(pace.toggle_pause),
        RIGHT: key(pace.step),
        UP: key(lambda: pace.multiply_rate(1.1)),
        DOWN: key(lambda: pace.multiply_rate(1 / 1.1)),
    }
    with progress, listened_keys(keys) as heard:
        if start_paused and not heard:
            raise click.BadParameter('needs a terminal, where keys can be pressed.', param_hint='--start-paused')
        show()
        replay = play_recording(
            recording,
            (*topics, *more),
            namespace=namespace,
            prefix=prefix,
            pace=pace,
            loop=loop,
            start_offset_s=start_offset,
            clock_hz=clock,
            wait_s=wait,
            tell=lambda sentence: progress.console.print(sentence, highlight=False, markup=False, soft_wrap=True),
            progress=lambda played, total: progress.update(task, completed=played, total=total),
        )
    _tell(replay, endless=loop)


def _tell(replay: 'Replay', *, endless: bool) -> None:
    """Print what was played, and end as the signal wants it that ended the replay.

    Args:
        replay: what was played.
        endless: whether Ctrl-C is the normal end.
    """
    click.echo(f'{quantity(replay.messages, "message")} played.')
    if replay.damage:
        click.echo(f'Warning: {replay.damage}', err=True)
    if replay.ended_by is signal.SIGINT and not endless:
        raise KeyboardInterrupt
    if replay.ended_by in (signal.SIGTERM, signal.SIGHUP):
        click.echo(f'Ended by {replay.ended_by.name}.', err=True)
        raise click.exceptions.Exit(128 + replay.ended_by)


def _checked(namespace: str | None, prefix: str) -> tuple[str | None, str]:
    """The namespace and the prefix in the form of ROS."""
    from socialcircle_ros.clients.replay_names import topic_prefix
    from socialcircle_ros.errors import SettingError

    if namespace is not None and prefix:
        raise click.BadParameter('cannot be given with --prefix.', param_hint='--namespace')
    try:
        return None if namespace is None else topic_prefix(namespace), topic_prefix(prefix)
    except SettingError as error:
        raise click.BadParameter(str(error), param_hint='--prefix' if prefix else '--namespace') from None
