"""`socialcircle record`."""

from pathlib import Path

import click

from .options import quantity, require_ros


@click.command('record', epilog='Example: socialcircle record /cell1/points /cell1/outlier_mask -o night.mcap')
@click.argument('topics', nargs=-1)
@click.option(
    '-o', '--output', required=True, type=click.Path(path_type=Path), help='Where to: NAME.mcap, or a directory.'
)
@click.option('--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='none', show_default=True)
@click.option('--duration', type=float, help='Stop after so many seconds; default: at Ctrl-C.')
@click.option('--overwrite', is_flag=True, help='Replace a recording that is there.')
def command(
    topics: tuple[str, ...], output: Path, compression: str, duration: float | None, overwrite: bool
) -> None:
    """Record TOPICS, or all that are published, until Ctrl-C.

    Topics that appear later are taken up as well. The recording is complete once this command has ended.
    """
    require_ros()
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    import time

    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rich.console import Console

    from socialcircle_ros.clients.replay import Recorder
    from socialcircle_ros.recording import RecordingWriter

    counts: dict[str, int] = {}
    with RecordingWriter(output, compression=compression, overwrite=overwrite) as writer:  # type: ignore[arg-type]
        rclpy.init()
        recorder = Recorder(
            writer, topics, lambda message: counts.__setitem__(message.topic, counts.get(message.topic, 0) + 1)
        )
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)
        end = time.monotonic() + duration if duration is not None else float('inf')
        try:
            with Console(stderr=True).status('recording; Ctrl-C ends it') as status:
                while time.monotonic() < end:
                    executor.spin_once(timeout_sec=0.2)
                    status.update(
                        f'recording {sum(counts.values())} messages of {len(counts)} topics; Ctrl-C ends it'
                    )
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        finally:
            recorder.destroy_node()
            rclpy.try_shutdown()
    for name, count in sorted(counts.items()):
        click.echo(f'{name}: {count}')
    click.echo(f'{quantity(sum(counts.values()), "message")} written to {output}.')
    for name in topics:
        if name not in counts and f'/{name}' not in counts:
            click.echo(f'Nothing came on {name}.', err=True)
