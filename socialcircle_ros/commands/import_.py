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
@click.option('--pitch', type=float, help='Of a focus stack: distance of two pixels on the part, in metres.')
@click.option('--z-step', type=float, help='Of a focus stack: metres for one unit of its z.')
@click.option('--overwrite', is_flag=True, help='Replace a recording that is there.')
def command(
    files: tuple[Path, ...],
    output: Path,
    topic: str,
    frame: str,
    period: float,
    shape: tuple[int, int] | None,
    pitch: float | None,
    z_step: float | None,
    overwrite: bool,
) -> None:
    """Turn measurement FILES into a recording, one cloud each, in the order given; or one focus stack.

    Takes .npz height maps (z in rows and columns, NaN where not measured; dx, dy their pitch), and organized
    point clouds as .ply or .pcd. Coordinates keep the unit of the file.

    A focus stack is an .npz with frames (N, rows, columns) and z (N), or a folder of images in the order of
    their names. Give --pitch and --z-step; the parameters that measure it are written beside the recording.
    """
    from socialcircle_ros.errors import ImportFileError
    from socialcircle_ros.messages import point_cloud
    from socialcircle_ros.messages.header import Header
    from socialcircle_ros.recording import RecordingWriter, import_cloud, ros_topic
    from socialcircle_ros.recording.stacks import is_stack

    if not period > 0:
        raise click.BadParameter('must be above 0.', param_hint='--period')
    if any(is_stack(path) for path in files):
        _import_stack(files, output, period, pitch, z_step, overwrite)
        return
    if (pitch is not None or z_step is not None) and files[0].exists():
        raise ImportFileError(
            f'--pitch and --z-step are for focus stacks, and {files[0]} is none: its own coordinates are taken, of'
            ' a height map its dx and dy.'
        )
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


def _import_stack(
    files: tuple[Path, ...],
    output: Path,
    period: float,
    pitch: float | None,
    z_step: float | None,
    overwrite: bool,
) -> None:
    """Write one focus stack, its frames 1/50 of the period apart, and its parameters."""
    from socialcircle_ros.errors import ImportFileError, SocialCircleError
    from socialcircle_ros.recording import RecordingWriter
    from socialcircle_ros.recording.stacks import (
        add_stack_topics,
        import_stack,
        node_parameters,
        write_frame,
        write_joint_state,
    )
    from socialcircle_ros.settings import yaml_text

    if len(files) > 1:
        raise ImportFileError('A focus stack is imported by itself; give one file or folder.')
    if not pitch or not z_step or pitch < 0:
        raise ImportFileError(f'{files[0]} is a focus stack: give --pitch and --z-step in metres, such as 1e-6.')
    stack = import_stack(files[0])
    with RecordingWriter(output, compression='zstd', overwrite=overwrite) as writer:
        add_stack_topics(writer)
        shape = None
        for number, (z, pixels) in enumerate(zip(stack.z, stack.frames(), strict=True)):
            if shape is not None and pixels.shape != shape:
                raise ImportFileError(f'{files[0]}: frame {number} is {pixels.shape}, the others are {shape}.')
            shape = pixels.shape
            stamp = int((number + 1) * period * 1e9 / 50)
            write_joint_state(writer, stamp, float(z) * z_step)
            write_frame(writer, stamp, pixels)
    parameters = output.with_suffix('.yaml')
    try:
        values = node_parameters(len(stack.z), pitch, pitch)
        parameters.write_text(yaml_text(values, whole=False), encoding='utf-8')
    except OSError as error:
        raise SocialCircleError(f'{parameters} cannot be written: {error.strerror}.') from None
    click.echo(f'{len(stack.z)} frames of {stack.name} written to {output}, parameters to {parameters}.')
    click.echo(f'Next: socialcircle filter {output} --params-file {parameters} -o cleaned.mcap')
