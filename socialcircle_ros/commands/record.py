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
@click.option('--duration', type=float, help='Stop after this many seconds; default: at Ctrl-C.')
@click.option('--overwrite', is_flag=True, help='Replace an existing recording.')
def command(
    topics: tuple[str, ...], output: Path, compression: str, duration: float | None, overwrite: bool
) -> None:
    """Record TOPICS until Ctrl-C; without any, record every topic that is published.

    Topics that appear later are recorded from then on. The recording is complete when this command has ended.
    """
    require_ros()
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from rich.console import Console

    from socialcircle_ros.clients.recorder import record_topics

    with Console(stderr=True).status('recording; Ctrl-C ends it') as status:
        counts = record_topics(
            output,
            topics,
            compression=compression,  # type: ignore[arg-type]
            overwrite=overwrite,
            duration_s=duration,
            progress=lambda messages, recorded: status.update(
                f'recording {messages} messages of {recorded} topics; Ctrl-C ends it'
            ),
        )
    for name, count in sorted(counts.items()):
        click.echo(f'{name}: {count}')
    click.echo(f'{quantity(counts.total(), "message")} written to {output}.')
    for name in topics:
        if name not in counts and f'/{name}' not in counts:
            click.echo(f'No message came on {name}.', err=True)
