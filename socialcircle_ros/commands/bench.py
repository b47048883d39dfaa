"""`socialcircle bench`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import require_ros

if TYPE_CHECKING:
    from rich.console import Console


@click.command('bench', epilog='Example: socialcircle bench --json bench.json')
@click.option('--repeats', default=20, show_default=True, help='How often each figure is taken.')
@click.option('--sizes', is_flag=True, help='Measure the steps of the filter for four sizes of cloud instead.')
@click.option('--growth', is_flag=True, help='Measure how time grows from 0.1 to 50 million points instead.')
@click.option('--depth', is_flag=True, help='Measure the error of depth from focus on simulated stacks instead.')
@click.option('--live', is_flag=True, help='Measure the live node from outside instead: stacks, clouds, a relay.')
@click.option(
    '--seconds', type=click.FloatRange(1), default=60.0, show_default=True,
    help='With --live: how long 25 clouds a second are sent.',
)  # fmt: skip
@click.option('--json', 'path', type=click.Path(path_type=Path), help='Write the figures here as well.')
@click.option('--plot', type=click.Path(path_type=Path), help='With --growth: draw it here, as NAME.png or .svg.')
def command(
    repeats: int,
    sizes: bool,
    growth: bool,
    depth: bool,
    live: bool,
    seconds: float,
    path: Path | None,
    plot: Path | None,
) -> None:
    """Measure how fast the filter is on this machine, beside each peer that is installed.

    Figures are medians after warm-up, in ms, of candidates that take turns. Other work on the machine makes them
    worse; compare ratios of one run. Peers: OpenCV, SciPy, Open3D (Python packages), PCL (Debian's pcl-tools).
    """
    if repeats < 1:
        raise click.BadParameter('must be at least 1.', param_hint='--repeats')
    if sizes + growth + depth + live > 1:
        raise click.UsageError('--sizes, --growth, --depth and --live measure different things: give one.')
    if plot is not None and not growth:
        raise click.UsageError('--plot draws what --growth measures: give both.')
    if depth:
        _depth()
    elif sizes:
        _sizes(repeats, path)
    elif growth:
        _growth(repeats, path, plot)
    elif live:
        _live(repeats, seconds, path)
    else:
        _ratios(repeats, path)


def _ratios(repeats: int, path: Path | None) -> None:
    """Print what each candidate takes, and the goals."""
    import dataclasses

    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.studies.bench.ratios import (
        COLUMNS,
        ROWS,
        SHARE,
        all_candidates,
        benchmark,
        missing_peers,
        ratios,
    )

    keep_freed_memory()  # as the node and the other commands do
    console = Console()
    with console.status('simulating ...') as status, all_candidates() as candidates:
        figures = benchmark(candidates, repeats, status.update)
    cloud = f'simulated metal groove, {COLUMNS}×{ROWS} float32, {100 * SHARE:g} % outliers'
    table = Table(title=f'{cloud}; medians in ms', box=None, padding=(0, 2, 0, 0))
    table.add_column()
    for name in ('threads', 'ms', 'times'):
        table.add_column(name, justify='right')
    for figure in figures:
        threads = str(figure.threads or 'its own choice')
        table.add_row(figure.name, threads, f'{figure.milliseconds:.2f}', str(figure.repeats))
    console.print(table)
    goals = Table(title='ratios of this run', box=None, padding=(0, 2, 0, 0))
    for name, side in (
        ('', 'left'),
        ('our threads', 'right'),
        ('ratio', 'right'),
        ('goal', 'right'),
        ('', 'left'),
    ):
        goals.add_column(name, justify=side)  # type: ignore[arg-type]
    found = ratios(figures)
    for ratio in found:
        goal = ratio.goal
        words = f'{goal.numerator} : {goal.denominator}' if goal.denominator else f'{goal.numerator}, ms'
        holds = 'holds' if ratio.holds else 'MISSED'
        goals.add_row(words, str(ratio.threads), f'{ratio.ratio:.2f}', f'{goal.sense} {goal.bound:g}', holds)
    console.print(goals)
    missing = missing_peers()
    if missing:
        console.print(f'Not installed here, and so left out: {", ".join(missing)}.', highlight=False)
    _finish(
        console,
        repeats,
        path,
        {
            'cloud': cloud,
            'figures': [dataclasses.asdict(figure) for figure in figures],
            'ratios': [{**dataclasses.asdict(ratio), 'holds': ratio.holds} for ratio in found],
            'left out': missing,
        },
    )


def _growth(repeats: int, path: Path | None, plot: Path | None) -> None:
    """Print how time grows with the points."""
    import dataclasses

    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.studies.bench.growth import POINTS, draw_growth, time_growth

    keep_freed_memory()  # as the node and the other commands do
    console = Console()
    table = Table(title='Mirrored metal groove, float32; medians in ms', box=None, padding=(0, 2, 0, 0))
    for name in ('million points', 'vote', 'radius and expansion', 'ns/point'):
        table.add_column(name, justify='right')
    steps = []
    with console.status('measuring ...') as status:
        for step in time_growth(repeats):
            steps.append(step)
            status.update(f'measured {len(steps)} of {len(POINTS)} sizes ...')
            table.add_row(
                f'{step.points / 1e6:.2f}', f'{step.vote:.1f}', f'{step.expansion:.2f}', f'{step.nanoseconds:.1f}'
            )
    console.print(table)
    if plot is not None:
        draw_growth(steps, plot)
    _finish(console, repeats, path, {'ms': [dataclasses.asdict(step) for step in steps]})


def _sizes(repeats: int, path: Path | None) -> None:
    """Print what the steps take on clouds of several sizes."""
    import dataclasses

    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.studies.bench.sizes import SIZES, time_filter

    console = Console()
    title = 'Simulated metal groove, float32, 9.55 % outliers; medians in ms'
    table = Table(title=title, box=None, padding=(0, 2, 0, 0))
    for name in ('points', 'vote', 'circle', 'ns/point', 'of bound', 'whole', 'copy'):
        table.add_column(name, justify='right')
    table.caption = (
        'circle: radius and expansion; of bound: its share of 5 ms and 25 ns per point; whole: from a message'
        ' to the answers; copy: copying the cloud once'
    )
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
    _finish(console, repeats, path, {'ms': [dataclasses.asdict(timing) for timing in timings]})


def _finish(console: 'Console', repeats: int, path: Path | None, figures: dict[str, Any]) -> None:
    """Name the machine, and write the figures where that is wanted."""
    import json

    from socialcircle_ros.errors import SocialCircleError
    from socialcircle_ros.kernels.machine import hardware

    console.print(f'{hardware()}; load {os.getloadavg()[0]:.1f} at the end', highlight=False)
    if path is None:
        return
    written = {'hardware': hardware(), 'load': os.getloadavg()[0], 'repeats': repeats, **figures}
    try:
        path.write_text(json.dumps(written, indent=1), encoding='utf-8')
    except OSError as error:
        raise SocialCircleError(f'{path} cannot be written: {error.strerror}.') from None


def _live(repeats: int, seconds: float, path: Path | None) -> None:
    """Print how long the live node takes, from a publisher to a subscriber."""
    require_ros()
    import dataclasses
    import tempfile

    # The bench talks to itself only; what listens beyond this machine is the user's choice.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.clients import live_times

    console = Console()
    rows, columns = live_times.SHAPE
    with tempfile.TemporaryDirectory() as name, console.status('') as status:
        folder = Path(name)
        status.update(f'{repeats} stacks of {live_times.FRAMES} frames ...')
        stacks, _, _ = live_times.time_stacks(folder, repeats)
        status.update(f'The same, and {live_times.BESIDE_RATE:.0f} clouds a second beside them ...')
        beside, sent, answered = live_times.time_stacks(folder, repeats, beside=live_times.BESIDE_RATE)
        status.update(f'{repeats} clouds through the node and through a relay ...')
        filtered, relayed = live_times.time_clouds(folder, repeats)
        status.update(f'{live_times.CLOUD_RATE:.0f} clouds a second for {seconds:.0f} s ...')
        endurance = live_times.endure(folder, seconds)
    table = Table(title=f'The live node at {columns}×{rows}, in ms', box=None, padding=(0, 2, 0, 0))
    table.add_column('from publish() to the bytes at a subscriber')
    for heading in ('median', 'least', 'most'):
        table.add_column(heading, justify='right')
    for trip, times in (
        (f'last of {live_times.FRAMES} frames to stack/points', stacks),
        (f'the same, {live_times.BESIDE_RATE:.0f} clouds a second beside them', beside),
        ('cloud to points_filtered', filtered),
        ('the same cloud through a bare relay', relayed),
    ):
        table.add_row(trip, *(f'{value:.1f}' for value in (times.median, times.least, times.most)))
    console.print(table)
    console.print(
        f'{repeats + 1} stacks beside clouds: no frame lost, {answered} of {sent} clouds answered\n'
        f'node to relay: {filtered.median / relayed.median:.2f} by median, {filtered.least / relayed.least:.2f} by'
        f' least\n{live_times.CLOUD_RATE:.0f} clouds a second for {seconds:.0f} s: {endurance.answered} of'
        f' {endurance.sent} answered; resident memory {endurance.megabytes_before:.0f} MB before,'
        f' {endurance.megabytes_after:.0f} MB after; a cloud is {endurance.cloud_megabytes:.1f} MB',
        highlight=False,
    )
    _finish(
        console,
        repeats,
        path,
        {
            'stack_ms': stacks.milliseconds,
            'stack_beside_clouds_ms': beside.milliseconds,
            'clouds_beside_stacks': {'sent': sent, 'answered': answered},
            'filtered_ms': filtered.milliseconds,
            'relayed_ms': relayed.milliseconds,
            'endurance': dataclasses.asdict(endurance),
        },
    )


def _depth() -> None:
    """Print the errors of depth from focus, and what quality is worth."""
    from rich.console import Console
    from rich.table import Table

    from socialcircle_ros.studies.bench.depth_error import SEEDS, depth_errors, quality_shares

    console = Console()
    table = Table(title='Depth from focus, errors in z-steps over good pixels', box=None, padding=(0, 2, 0, 0))
    for name in ('stack', 'specimen', 'fit'):
        table.add_column(name)
    for name in ('RMS', 'bias', 'good'):
        table.add_column(name, justify='right')
    with console.status('simulating and measuring stacks (20 s) ...'):
        for row in depth_errors():
            table.add_row(
                row.scenario.name,
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
