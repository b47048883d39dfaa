# SPDX-License-Identifier: Apache-2.0
"""`socialcircle import`."""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import Number, place_text, shell_words, stack_text

if TYPE_CHECKING:
    from socialcircle_ros.recording import ImportedCloud
    from socialcircle_ros.recording.create import ImportedFrame
    from socialcircle_ros.recording.frame_names import Order, ZFrom
    from socialcircle_ros.recording.origins import FileOrigin


_LARGEST_M = 1e-3
"""Pitch and step of a stack above which a warning comes: a macro lens has a pitch of 0.1 mm at most."""
_OPTIONS = {'pitch': '--pitch', 'step': '--z-step'}


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
    type=Number(),
    default=1.0,
    show_default=True,
    help='Time between two clouds, in s. The frames of a stack are 1/50 of it apart.',
)
@click.option(
    '--shape', type=(int, int), metavar='ROWS COLUMNS', help='Shape of a PLY or PCD file that does not state it.'
)
@click.option(
    '--pitch',
    type=Number(),
    help='Distance of two pixels on the part: for a focus stack, in m (default: as a TIFF says); for heights'
    ' without it, in --unit.',
)
@click.option('--unit', help='Unit of files that do not name it: m, mm, um or nm.')
@click.option('--keep-unit', is_flag=True, help='Keep the unit of the files. Default: clouds are written in m.')
@click.option(
    '--z-step',
    type=Number(),
    help='For a focus stack: length of one unit of its z, in m. Not needed if names or a TIFF say z with a unit.',
)
@click.option(
    '--z-from',
    type=click.Choice(['auto', 'name', 'order', 'file']),
    default='auto',
    show_default=True,
    help='For images: take z from the numbers in their names, from their order as evenly spaced, or from what a'
    ' TIFF with pages says.',
)
@click.option(
    '--order',
    type=click.Choice(['auto', 'natural', 'name', 'time']),
    default='auto',
    show_default=True,
    help='For a folder of images: sort them with 9 before 10, as text, or by the times of the files. name and time'
    ' imply --z-from order.',
)
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
    keep_unit: bool,
    z_step: float | None,
    z_from: 'ZFrom',
    order: 'Order',
    overwrite: bool,
) -> None:
    """Write measurement FILES into a recording.

    Each file becomes one cloud, in the order given:

    \b
    .npz        height map: z (rows, columns), NaN where not measured; pitches dx and dy, or --pitch
    .ply, .pcd  organized point cloud
    .al3d, .x3p, .opd, .dat, .plu, .sdf, .tif, .csv ...  docs/formats.md

    Clouds are written in metres, as ROS has it (REP 103), unless --keep-unit is given. The recording keeps the
    name and the unit of each file, and export writes the numbers of the file again.

    A focus stack is imported by itself: an .npz file with frames (N, rows, columns) and z (N), a TIFF with pages,
    or a folder of images. z comes from the numbers in their names, which hold z itself (part_z-12.5um) or count
    the frames, or from what ImageJ or OME say in a TIFF. A table shows what was taken. What is not certain is
    refused: --z-from or --order settles it. The stack needs --pitch and --z-step, unless the files say them.

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
        stack = record_stack(
            files[0],
            output,
            pitch=pitch,
            z_step=z_step,
            z_from=z_from,
            order=order,
            period_s=period,
            overwrite=overwrite,
            written=(table := _FrameTable()).print_frame,
            tell=lambda sentence: click.echo(f'Note: {sentence}.', err=True),
        )
        table.print_lengths(stack.pitch)
        click.echo(f'{stack.frames} frames of {files[0]} {stack_text(output, stack.parameters)}')
        return
    for_stacks = z_step is not None or (z_from, order) != ('auto', 'auto')
    if for_stacks and files[0].exists():
        raise ImportFileError(
            f'--z-step, --z-from and --order are for focus stacks, and {files[0]} is not one: leave them out.'
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
        keep_unit=keep_unit,
        overwrite=overwrite,
        written=_print_cloud,
    )
    given = shell_words(output, '-o', 'cleaned.mcap')
    click.echo(f'Written to {place_text(output)}. Next: socialcircle filter {given}')


def _print_cloud(path: Path, cloud: 'ImportedCloud', origin: 'FileOrigin') -> None:
    import numpy as np

    from socialcircle_ros.digits import size_text
    from socialcircle_ros.lengths import range_text

    rows, columns = cloud.points.shape[:2]
    fields = f', fields {", ".join(cloud.fields)}' if cloud.fields else ''
    z = cloud.points[..., 2]
    measured = np.isfinite(cloud.points).all(axis=-1)
    heights = range_text(float(z[measured].min()), float(z[measured].max()), cloud.unit)
    written = ', written in m' if origin.converted else ''
    click.echo(
        f'{path.name} ({origin.unit_text()}): {size_text(rows, columns)}, {measured.sum()} points'
        f' measured, z {heights}{fields}{written}'
    )
    for note in (cloud.unit_note, *cloud.notes) if cloud.unit_note else cloud.notes:
        click.echo(f'Note: {path.name}: {note}.', err=True)


class _FrameTable:
    """Prints what was taken of a focus stack: a line for each frame, and the lengths."""

    def __init__(self) -> None:
        self._heights: list[float] = []

    def print_frame(self, frame: 'ImportedFrame') -> None:
        self._heights.append(frame.z)
        _print_frame(frame)

    def print_lengths(self, pitch: tuple[float, float]) -> None:
        """Print the pitch and the step, and warn where one cannot be that of a microscope."""
        from statistics import median

        from socialcircle_ros.lengths import length_text

        steps = [abs(after - before) for before, after in pairwise(self._heights)]
        lengths = {'pitch': max(pitch), 'step': median(steps) if steps else 0.0}
        pitches = ' × '.join(length_text(each, 'm') for each in dict.fromkeys(pitch))
        order = ' (x × y)' if pitch[0] != pitch[1] else ''
        click.echo(f'pitch {pitches}{order}, step {length_text(lengths["step"], "m")}')
        for name, value in lengths.items():
            if value > _LARGEST_M:
                bound = f'and that of a microscope is below {length_text(_LARGEST_M, "m")}'
                unit = f'lengths are in m, so that {_OPTIONS[name]} 1e-6 is 1 µm'
                click.echo(f'Warning: the {name} is {length_text(value, "m")}, {bound}; {unit}.', err=True)


def _print_frame(frame: 'ImportedFrame') -> None:
    """Print a line of the table of what was taken."""
    pixels = frame.picture.pixels
    rows, columns = pixels.shape
    if frame.number == 0:
        click.echo(f'{"file":<24} {"z":>12}  {"rows × columns":>14}  {"mode":<18} range')
    click.echo(
        f'{frame.name:<24} {frame.z * 1e6:>9.6g} µm  {f"{rows} × {columns}":>14}  {frame.picture.mode:<18} '
        f'{pixels.min()} to {pixels.max()}'
    )
