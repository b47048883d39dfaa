"""`socialcircle play`."""

from pathlib import Path

import click

from .options import quantity, require_ros


@click.command('play', epilog='Example: socialcircle play last_night.mcap --rate 0.5 --loop')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option('--topic', 'topics', multiple=True, help='Play only this topic; may be repeated.')
@click.option('--rate', default=1.0, show_default=True, help='2: twice as fast as recorded.')
@click.option('--loop', is_flag=True, help='Start again at the end, until Ctrl-C.')
@click.option('--clock', is_flag=True, help='Publish recorded time on /clock, for nodes with use_sim_time.')
@click.option('--namespace', default='', help='Put before every topic, such as /cell1.')
@click.option('--wait', default=10.0, show_default=True, help='Seconds to wait for the first subscriber.')
def command(
    recording: Path, topics: tuple[str, ...], rate: float, loop: bool, clock: bool, namespace: str, wait: float
) -> None:
    """Publish a RECORDING byte for byte, with its recorded timing and QoS.

    A replay is best effort: a busy subscriber misses clouds. Use `socialcircle filter` for exact results.
    """
    require_ros()
    if not rate > 0:
        raise click.BadParameter('must be above 0.', param_hint='--rate')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from rich.console import Console
    from rich.progress import Progress

    from socialcircle_ros.clients.player import play_recording, topic_prefix
    from socialcircle_ros.errors import SettingError

    try:
        prefix = topic_prefix(namespace)
    except SettingError as error:
        raise click.BadParameter(str(error), param_hint='--namespace') from None
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(f'playing {recording.name}', total=None)
        replay = play_recording(
            recording,
            topics,
            prefix=prefix,
            rate=rate,
            loop=loop,
            clock=clock,
            wait_s=wait,
            tell=lambda sentence: progress.console.print(sentence, highlight=False, markup=False, soft_wrap=True),
            progress=lambda played, total: progress.update(task, completed=played, total=total),
        )
    click.echo(f'{quantity(replay.messages, "message")} played.')
    if replay.damage:
        click.echo(f'Warning: {replay.damage}', err=True)
