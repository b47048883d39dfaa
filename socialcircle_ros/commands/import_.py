"""`socialcircle import`."""

from pathlib import Path

import click


@click.command('import', epilog='Example: socialcircle import part1.npz part2.npz -o parts.mcap')
@click.argument('files', nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', required=True, type=click.Path(path_type=Path), help='Where to: NAME.mcap, or a directory.'
)
@click.option('--topic', default='/points', show_default=True)
@click.option('--frame', default='microscope', show_default=True, help='frame_id of the clouds.')
@click.option('--period', default=1.0, show_default=True, help='Seconds between two clouds.')
@click.option(
    '--shape', type=(int, int), metavar='ROWS COLUMNS', help='Of PLY and PCD files that do not say it themselves.'
)
@click.option('--overwrite', is_flag=True, help='Replace a recording that is there.')
def command(
    files: tuple[Path, ...],
    output: Path,
    topic: str,
    frame: str,
    period: float,
    shape: tuple[int, int] | None,
    overwrite: bool,
) -> None:
    """Turn measurement FILES into a recording, one cloud each, in the order given.

    Takes .npz height maps (z in rows and columns, NaN where not measured; dx, dy their pitch), and organized
    point clouds as .ply or .pcd. Coordinates keep the unit of the file.
    """
    from socialcircle_ros.messages import point_cloud
    from socialcircle_ros.messages.header import Header
    from socialcircle_ros.recording import RecordingWriter, import_cloud, ros_topic

    if not period > 0:
        raise click.BadParameter('must be above 0.', param_hint='--period')
    with RecordingWriter(output, overwrite=overwrite) as writer:
        writer.add_topic(ros_topic(topic, point_cloud.TYPE))
        for number, path in enumerate(files):
            cloud = import_cloud(path, shape=shape)
            stamp = int((number + 1) * period * 1e9)
            message = point_cloud.encode_point_cloud(Header.at(stamp, frame), cloud.points, cloud.fields)
            writer.write(topic, message, stamp)
            rows, columns = cloud.points.shape[:2]
            fields = f', fields {", ".join(cloud.fields)}' if cloud.fields else ''
            click.echo(f'{path.name}: {rows}×{columns} points{f" in {cloud.unit}" if cloud.unit else ""}{fields}')
    click.echo(f'Written to {output}; next: socialcircle filter {output} -o cleaned.mcap')
