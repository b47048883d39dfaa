"""`socialcircle simulate`."""

from pathlib import Path

import click


@click.command('simulate', epilog='Example: socialcircle simulate steep_groove -o groove.mcap --seed 3')
@click.argument('specimen', default='metal_groove')
@click.option(
    '-o', '--output', required=True, type=click.Path(path_type=Path), help='Where to: NAME.mcap, or a directory.'
)
@click.option('--size', type=(int, int), default=(480, 640), show_default=True, metavar='ROWS COLUMNS')
@click.option('--instrument', default='10x', show_default=True, help='5x, 10x, 20x or 50x.')
@click.option('--frames', type=int, help='How many; default: as many as the surface asks for.')
@click.option('--z-step', type=float, help='Between frames, µm; default: a quarter of the depth of field.')
@click.option('--renderer', type=click.Choice(['layered', 'rays']), default='layered', show_default=True)
@click.option('--seed', default=0, show_default=True, help='Of everything random.')
@click.option('--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='zstd', show_default=True)
@click.option('--overwrite', is_flag=True, help='Replace a recording that is there.')
def command(
    specimen: str,
    output: Path,
    size: tuple[int, int],
    instrument: str,
    frames: int | None,
    z_step: float | None,
    renderer: str,
    seed: int,
    compression: str,
    overwrite: bool,
) -> None:
    """Scan a virtual SPECIMEN with a virtual focus-variation microscope.

    SPECIMEN is metal_groove, steep_groove, closed_groove, composite, flat, ball, steps, discs, pits or islands.
    Writes a recording with frames, joint states and the truth, and beside it the parameters with which the node
    measures it. Outliers come out of the physics: glints, darkness, steepness, lack of texture, noise.
    """
    if seed < 0:
        raise click.BadParameter('must not be negative.', param_hint='--seed')
    from rich.console import Console
    from rich.progress import Progress

    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.recording import RecordingWriter
    from socialcircle_ros.recording.simulated import pitch_of, write_simulation
    from socialcircle_ros.recording.stacks import node_parameters
    from socialcircle_ros.settings import yaml_text
    from socialcircle_ros.simulation import simulate

    rows, columns = size
    simulation = simulate(
        specimen,
        rows,
        columns,
        instrument=instrument,
        frames=frames,
        z_step=z_step,
        renderer=renderer,  # type: ignore[arg-type]
        seed=seed,
    )
    with (
        RecordingWriter(output, compression=compression, overwrite=overwrite) as writer,  # type: ignore[arg-type]
        Progress(console=Console(stderr=True), transient=True) as progress,
    ):
        task = progress.add_task(f'scanning {specimen}', total=len(simulation))
        write_simulation(simulation, writer, lambda done: progress.update(task, completed=done))
    parameters = output.with_suffix('.yaml')
    try:
        values = node_parameters(len(simulation), *pitch_of(simulation))
        parameters.write_text(yaml_text(values, whole=False), encoding='utf-8')
    except OSError as error:
        raise SocialCircleError(f'{parameters} cannot be written: {error.strerror}.') from None
    click.echo(
        f'{len(simulation)} frames of {rows}×{columns} pixels written to {output}, parameters to {parameters}.'
    )
    click.echo(f'Next: socialcircle filter {output} --params-file {parameters} -o cleaned.mcap')
