"""`socialcircle bench`."""

from pathlib import Path

import click


@click.command('bench', epilog='Example: socialcircle bench --json bench.json')
@click.option('--repeats', default=20, show_default=True, help='How often each figure is taken.')
@click.option('--depth', is_flag=True, help='Measure the error of depth from focus on simulated stacks instead.')
@click.option('--json', 'path', type=click.Path(path_type=Path), help='Write the figures here as well.')
def command(repeats: int, depth: bool, path: Path | None) -> None:
    """Measure how long the filter takes on this machine: medians after warm-up, in ms.

    Other work on the machine makes figures worse; compare ratios of one run.
    """
    if repeats < 1:
        raise click.BadParameter('must be at least 1.', param_hint='--repeats')
    if depth:
        _depth()
        return
    import dataclasses
    import json

    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.evaluation.benchmarks import SIZES, hardware, time_filter

    console = Console()
    table = Table(
        title='Simulated metal groove, float32, 9.55 % outliers; medians in ms', box=None, padding=(0, 2, 0, 0)
    )
    columns = (
        'points',
        'vote',
        'radius + expansion',
        'ns/point',
        'whole cloud',
        'copying it',
        'of 5 ms + 25 ns/point',
    )
    for name in columns:
        table.add_column(name, justify='right')
    timings = []
    with console.status('measuring ...') as status:
        for timing in time_filter(repeats):
            timings.append(timing)
            status.update(f'measured {len(timings)} of {len(SIZES)} sizes ...')
            table.add_row(
                f'{timing.columns}×{timing.rows}',
                f'{timing.vote:.1f}',
                f'{timing.radius_and_expansion:.2f}',
                f'{1e6 * timing.radius_and_expansion / timing.points:.1f}',
                f'{timing.radius_and_expansion / timing.allowed:.2f}',
                f'{timing.pipeline:.1f}',
                f'{timing.copy:.2f}',
            )
    console.print(table)
    console.print(f'{hardware()}; {repeats} times each', highlight=False)
    if path is not None:
        figures = {
            'hardware': hardware(),
            'repeats': repeats,
            'ms': [dataclasses.asdict(timing) for timing in timings],
        }
        try:
            path.write_text(json.dumps(figures, indent=1), encoding='utf-8')
        except OSError as error:
            raise SocialCircleError(f'{path} cannot be written: {error.strerror}.') from None


def _depth() -> None:
    """Print the errors of depth from focus, and what quality is worth."""
    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.evaluation.depth_error import SEEDS, depth_errors, quality_shares

    console = Console()
    table = Table(title='Depth from focus, errors in z-steps over good pixels', box=None, padding=(0, 2, 0, 0))
    for name in ('stack', 'specimen', 'fit'):
        table.add_column(name)
    for name in ('RMS', 'bias', 'good'):
        table.add_column(name, justify='right')
    with console.status('simulating and measuring stacks (20 s) ...'):
        for row in depth_errors():
            table.add_row(
                row.case.name,
                row.specimen,
                row.fit,
                f'{row.rms:.3f}',
                f'{row.bias:+.4f}',
                f'{100 * row.good:.1f} %',
            )
        shares = quality_shares()
    console.print(table)
    for bound, (pixels, good) in shares.items():
        console.print(
            f'quality at least {bound}: {100 * pixels:.1f} % of the pixels, {100 * good:.1f} % of them good'
        )
    console.print(
        f'seeds {SEEDS[0]} to {SEEDS[-1]}; good: within a quarter of the depth of field (DOF)', highlight=False
    )
