"""`socialcircle import`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from socialcircle_ros.recording import ImportedCloud


@click.command('import', epilog='Example: socialcircle import part1.npz part2.npz -o parts.mcap')
@click.argument('files', nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    '-o',
    '--output',
    required=True,
    type=click.Path(path_type=Path),
    help='Recording to write: NAME.mcap, or a directory.',
)
@click.option('--topic', default='/points', show_default=True, help='Topic of the clouds.')
@click.option('--frame', default='microscope', show_default=True, help='frame_id of the clouds.')
@click.option(
    '--period',
    default=1.0,
    show_default=True,
    help='Time between two clouds, in s. The frames of a stack are 1/50 of it apart.',
)
@click.option(
    '--shape', type=(int, int), metavar='ROWS COLUMNS', help='Shape of a PLY or PCD file that does not state it.'
)
@click.option(
    '--pitch',
    type=float,
    help='Distance of two pixels on the part: for a focus stack, in m; for heights without it, in --unit.',
)
@click.option('--unit', help='Unit of files that do not name it: m, mm, um or nm.')
@click.option('--z-step', type=float, help='For a focus stack: length of one unit of its z, in m.')
@click.option('--overwrite', is_flag=True, help='Replace an existing recording and its parameters.')
def command(
    files: tuple[Path, ...],
    output: Path,
    topic: str,
    frame: str,
    period: float,
    shape: tuple[int, int] | None,
    pitch: float | None,
    unit: str | None,
    z_step: float | None,
    overwrite: bool,
) -> None:
    """Write measurement FILES into a recording.

    Each file becomes one cloud, in the order given:

    \b
    .npz        height map: z (rows, columns), NaN where not measured; pitches dx and dy
    .ply, .pcd  organized point cloud
    .al3d, .x3p, .opd, .dat, .plu, .sdf, .tif, .csv ...  docs/formats.md

    Coordinates keep the unit of the file.

    A focus stack is imported by itself: an .npz file with frames (N, rows, columns) and z (N), or a folder of
    images in the order of their names. It needs --pitch and --z-step. The parameters that measure the stack are
    written beside the recording.

    Example of a stack: socialcircle import frames/ -o stack.mcap --pitch 1e-6 --z-step 2e-6
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.errors import ImportFileError
    from socialcircle_ros.recording.create import record_clouds, record_stack
    from socialcircle_ros.recording.stacks import is_stack

    if not period > 0:
        raise click.BadParameter('must be above 0.', param_hint='--period')
    if any(is_stack(path) for path in files):
        if len(files) > 1:
            raise ImportFileError('A focus stack is imported by itself; give one file or folder.')
        stack = record_stack(files[0], output, pitch=pitch, z_step=z_step, period_s=period, overwrite=overwrite)
        click.echo(f'{stack.frames} frames of {files[0]} written to {output}, parameters to {stack.parameters}.')
        click.echo(f'Next: socialcircle filter {output} --params-file {stack.parameters} -o cleaned.mcap')
        return
    stated = {path.suffix.lower() for path in files} & {'.npz', '.ply', '.pcd'}
    if (z_step is not None or (pitch is not None and stated)) and files[0].exists():
        raise ImportFileError(
            f'--pitch and --z-step are for focus stacks, and {files[0]} is not one; leave them out, because the'
            ' file states its own coordinates.'
        )
    record_clouds(
        files,
        output,
        topic=topic,
        frame_id=frame,
        period_s=period,
        shape=shape,
        pitch=None if pitch is None else (pitch, pitch),
        unit=unit,
        overwrite=overwrite,
        written=_print_cloud,
    )
    click.echo(f'Written to {output}. Next: socialcircle filter {output} -o cleaned.mcap')


def _print_cloud(path: Path, cloud: 'ImportedCloud') -> None:
    rows, columns = cloud.points.shape[:2]
    unit = f' in {cloud.unit}' if cloud.unit else ''
    fields = f', fields {", ".join(cloud.fields)}' if cloud.fields else ''
    click.echo(f'{path.name}: {rows}×{columns} points{unit}{fields}')
