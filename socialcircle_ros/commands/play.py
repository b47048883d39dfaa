"""`socialcircle play`."""

from pathlib import Path

import click

from .options import quantity, require_ros

_SETTLED = 2.0  # s: nobody listens to truth masks, or to what an earlier run made


@click.command('play', epilog='Example: socialcircle play last_night.mcap --rate 0.5 --loop')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option('--topic', 'topics', multiple=True, help='Play only this topic; may be repeated.')
@click.option('--rate', default=1.0, show_default=True, help='2: twice as fast as recorded.')
@click.option('--loop', is_flag=True, help='Begin again at the end, until Ctrl-C.')
@click.option('--clock', is_flag=True, help='Publish recorded time on /clock, for nodes with use_sim_time.')
@click.option('--namespace', default='', help='Put before every topic, such as /cell1.')
@click.option('--wait', default=10.0, show_default=True, help='Seconds to wait for the first subscriber.')
def command(
    recording: Path, topics: tuple[str, ...], rate: float, loop: bool, clock: bool, namespace: str, wait: float
) -> None:
    """Publish a RECORDING with its recorded timing, byte for byte, with the QoS it was recorded with.

    Replaying is best effort by nature: a busy subscriber misses clouds. For exact results use `socialcircle
    filter`.
    """
    require_ros()
    if not rate > 0:
        raise click.BadParameter('must be above 0.', param_hint='--rate')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    import rclpy
    from rclpy.exceptions import InvalidNamespaceException
    from rclpy.validate_namespace import validate_namespace
    from rich.console import Console
    from rich.progress import Progress

    from socialcircle_ros.clients.replay import Player
    from socialcircle_ros.errors import RecordingError
    from socialcircle_ros.recording import open_recording

    prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    try:
        validate_namespace(prefix or '/')
    except InvalidNamespaceException:
        raise click.BadParameter(
            f'{namespace!r} is no name for topics: use letters, digits, _ and /, and no digit in front.',
            param_hint='--namespace',
        ) from None
    with open_recording(recording) as reader:
        unknown = [name for name in topics if name not in reader.topics]
        if unknown:
            raise RecordingError(
                f'{recording} has no topic {unknown[0]}; it has: {", ".join(sorted(reader.topics))}.'
            )
        chosen = [topic for name, topic in reader.topics.items() if not topics or name in topics]
        rclpy.init()
        player = Player(chosen, prefix)
        try:
            for reason in player.skipped:
                click.echo(f'Not played: {reason}', err=True)
            lonely = player.wait_for_listeners([topic.name for topic in chosen], wait, _SETTLED)
            if lonely:
                click.echo(
                    f'Nobody listens to {", ".join(prefix + name for name in lonely)}; playing anyway.', err=True
                )
            count = 0
            with Progress(console=Console(stderr=True), transient=True) as progress:
                task = progress.add_task(f'playing {recording.name}', total=reader.message_count)
                while True:
                    progress.reset(task)

                    def published(_: object) -> None:
                        nonlocal count
                        count += 1
                        progress.advance(task)

                    names = [topic.name for topic in chosen]
                    player.play(reader.messages(names), rate=rate, clock=clock, published=published)
                    if not loop or not rclpy.ok() or count == 0:
                        break
            if rclpy.ok():
                player.wait_until_delivered(5.0)
            click.echo(f'{quantity(count, "message")} played.')
            if reader.damage:
                click.echo(f'Warning: {reader.damage}', err=True)
        finally:
            player.destroy_node()
            rclpy.try_shutdown()
