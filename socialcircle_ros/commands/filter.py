"""`socialcircle filter`."""

from pathlib import Path

import click

from .options import parameter_options, parameter_values, quantity, tell_refusals


@click.command('filter', epilog='Example: socialcircle filter bags/metal_groove.mcap -o cleaned.mcap')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '-o', '--output', required=True, type=click.Path(path_type=Path), help='Where to: NAME.mcap, or a directory.'
)
@click.option('--topic', 'topics', multiple=True, help='A topic of clouds; default: those named points.')
@click.option('--compression', type=click.Choice(['none', 'lz4', 'zstd']), default='none', show_default=True)
@click.option('--overwrite', is_flag=True, help='Replace a recording that is there.')
@parameter_options
def command(
    recording: Path,
    output: Path,
    topics: tuple[str, ...],
    compression: str,
    overwrite: bool,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Filter a RECORDING offline, exactly as the node does live; the same input gives the same bytes.

    Everything in the recording is kept byte for byte; beside each topic of clouds come points_filtered,
    outlier_mask and social_circle/measurement. Frames on stack/image become clouds on stack/points first: give
    the stack's parameters (stack.pitch_x ...) with -p or --params-file.
    """
    from rich.console import Console
    from rich.progress import Progress

    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.messages.diagnostics import OK
    from socialcircle_ros.pipeline.clouds import CloudOutputs
    from socialcircle_ros.recording import Message, open_recording
    from socialcircle_ros.recording.offline import filter_recording
    from socialcircle_ros.settings import PipelineSettings

    keep_freed_memory()
    job = PipelineSettings.from_ros(parameter_values(params_file, parameters))
    console = Console(stderr=True)
    with open_recording(recording) as reader:
        total = reader.message_count
    points = outliers = 0
    warnings: set[str] = set()
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(f'filtering {recording.name}', total=total)

        def seen(_: Message | None, cleaned: list[CloudOutputs]) -> None:
            nonlocal points, outliers
            points += sum(result.measured for result in cleaned)
            outliers += sum(result.outliers for result in cleaned)
            warnings.update(result.status.message for result in cleaned if result.status.level != OK)
            progress.advance(task)

        summary = filter_recording(
            recording,
            output,
            job,
            topics=topics,
            compression=compression,  # type: ignore[arg-type]
            overwrite=overwrite,
            seen=seen,
        )
    share = f' ({100 * outliers / points:.2f} %)' if points else ''
    stacks = f'{quantity(summary.stacks, "focus stack")} measured; ' if summary.stacks else ''
    click.echo(
        f'{stacks}{quantity(summary.clouds, "cloud")} filtered, {outliers} of {points} measured points are'
        f' outliers{share}; {quantity(summary.passed, "other message")} kept; written to {output}.'
    )
    for warning in sorted(warnings | summary.warnings.keys()):
        click.echo(f'Warning: {warning}', err=True)
    if summary.replaced:
        click.echo(f'Results of an earlier run were replaced: {", ".join(summary.replaced)}.', err=True)
    tell_refusals(summary.refused, summary.damage)
    if summary.clouds == 0:
        raise click.exceptions.Exit(1)
