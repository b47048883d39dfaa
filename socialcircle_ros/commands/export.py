# SPDX-License-Identifier: Apache-2.0
"""`socialcircle export`."""

from pathlib import Path

import click

from .options import progress_bar, quantity, tell_refusals


@click.command('export', epilog='Example: socialcircle export cleaned.mcap -o parts --format x3p')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', required=True, type=click.Path(path_type=Path, file_okay=False),
    help='Folder for the files. It is created.',
)  # fmt: skip
@click.option(
    '--format', 'form', type=click.Choice(['ply', 'pcd', 'x3p', 'sdf', 'tiff', 'npz', 'csv', 'xyz']),
    default='ply', show_default=True, help='Format of the files.',
)  # fmt: skip
@click.option(
    '--topic', 'topics', multiple=True,
    help='Topic of clouds to export. May be repeated. Default: all cleaned and repaired clouds.',
)  # fmt: skip
@click.option('--unit', help='Unit of the clouds, where the recording does not say: m, mm, um or nm.')
@click.option('--overwrite', is_flag=True, help='Replace existing files.')
def command(
    recording: Path, output: Path, form: str, topics: tuple[str, ...], unit: str | None, overwrite: bool
) -> None:
    """Write the clouds of a RECORDING as files for other programs.

    RECORDING is an MCAP file, a rosbag2 directory, or a measurement file. Each cleaned and repaired cloud becomes
    one file in the folder. A recording that was not filtered gives its own clouds. The files hold the unit, and
    the settings and counts of the filter as metadata.

    \b
    ply, pcd, csv, xyz  any cloud, all fields, the mask as the field outlier_mask
    npz                 height map: z, dx, dy, fields, mask
    x3p, sdf            height map in m (ISO 25178-72 and -71); the mask is a PNG beside it
    tiff                height map in 32-bit float; the mask is a PNG beside it
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.lengths import metres_per
    from socialcircle_ros.recording.export import export_recording

    if unit is not None:
        metres_per(unit)
    with progress_bar(f'exporting {recording.name}') as progress:
        export = export_recording(
            recording, output, f'.{form}', topics=topics, unit=unit, overwrite=overwrite, progress=progress
        )
    what = '' if export.filtered else ' of clouds that are not filtered'
    click.echo(f'{quantity(len(export.files), "file")}{what} written to {output}.')
    for note, count in export.notes.items():
        click.echo(f'Note, for {quantity(count, "cloud")}: {note}', err=True)
    tell_refusals(export.refused, export.damage)
    if not export.files:
        raise click.exceptions.Exit(1)
