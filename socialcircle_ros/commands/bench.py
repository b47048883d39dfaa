# SPDX-License-Identifier: Apache-2.0
"""`socialcircle bench`: options and printing; the measurements are in `studies.bench`."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from socialcircle_ros.digits import size_text
from socialcircle_ros.storage import check_place

from .options import Number, require_ros

if TYPE_CHECKING:
    from rich.table import Table

    from .console import CommandConsole


@click.command('bench', epilog='Example: socialcircle bench --json bench.json')
@click.option('--repeats', default=20, show_default=True, help='Timed runs of each measurement.')
@click.option('--sizes', is_flag=True, help='Instead: time the steps of the filter for four sizes of cloud.')
@click.option('--growth', is_flag=True, help='Instead: time the filter from 0.1 to 50 million points.')
@click.option('--depth', is_flag=True, help='Instead: measure the error of depth from focus on simulated stacks.')
@click.option('--live', is_flag=True, help='Instead: time the live node from outside, for stacks and clouds.')
@click.option(
    '--network', is_flag=True,
    help='Instead: send clouds over a simulated network that loses packets (30 min; Linux; needs root).',
)  # fmt: skip
@click.option(
    '--seconds', type=Number(1), default=60.0, show_default=True,
    help='With --live: duration of a stream of 25 clouds per second.',
)  # fmt: skip
@click.option('--json', 'path', type=click.Path(path_type=Path), help='Also write the results to this file.')
@click.option('--plot', type=click.Path(path_type=Path), help='With --growth: write a plot, NAME.png.')
def command(
    repeats: int,
    sizes: bool,
    growth: bool,
    depth: bool,
    live: bool,
    network: bool,
    seconds: float,
    path: Path | None,
    plot: Path | None,
) -> None:
    """Measure the filter's speed on this machine, next to other libraries that are installed.

    Times are medians in ms after a warm-up run. All candidates take turns in one run. Other load on the machine
    affects times more than their ratios: compare ratios. Other libraries: OpenCV, SciPy, Open3D (Python packages)
    and PCL (Debian package pcl-tools).
    """
    if repeats < 1:
        raise click.BadParameter('must be at least 1.', param_hint='--repeats')
    if sizes + growth + depth + live + network > 1:
        raise click.UsageError(
            '--sizes, --growth, --depth, --live and --network are different measurements: give one.'
        )
    if plot is not None and not growth:
        raise click.UsageError('--plot draws the result of --growth: give both.')
    if plot is not None and plot.suffix.lower() != '.png':
        raise click.BadParameter(f'{plot} would be a PNG; choose a name such as growth.png.', param_hint='--plot')
    if depth and (path is not None or _is_given('repeats')):
        raise click.UsageError('--depth writes no file and repeats nothing: give neither --json nor --repeats.')
    for each in (path, plot):
        if each is not None:
            check_place(each)  # not after minutes
    if depth:
        _depth()
    elif sizes:
        _sizes(repeats, path)
    elif growth:
        _growth(repeats, path, plot)
    elif live:
        _live(repeats, seconds, path)
    elif network:
        _network(repeats, path)
    else:
        _ratios(repeats, path)


def _is_given(option: str) -> bool:
    source = click.get_current_context().get_parameter_source(option)
    return source is not click.core.ParameterSource.DEFAULT


def _ratios(repeats: int, path: Path | None) -> None:
    """Print the time of each candidate, and the ratios with their goals."""
    import dataclasses

    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.studies.bench.candidates import COLUMNS, ROWS, SHARE, all_candidates, missing_peers
    from socialcircle_ros.studies.bench.ratios import benchmark, ratios

    from .console import CommandConsole

    keep_freed_memory()  # as the node and the other commands do
    console = CommandConsole()
    with console.status('simulating ...') as status, all_candidates() as candidates:
        figures = benchmark(candidates, repeats, status.update)
    found = ratios(figures)
    cloud = f'simulated metal groove, {size_text(ROWS, COLUMNS)}, float32, {100 * SHARE:g} % outliers'
    times = _table(f'{cloud}; medians in ms', '', 'threads', 'ms', 'repeats')
    for figure in figures:
        threads = str(figure.threads or 'its own choice')
        times.add_row(figure.name, threads, f'{figure.milliseconds:.2f}', str(figure.repeats))
    console.print(times)
    goals = _table('ratios of this run', '', 'our threads', 'ratio', 'goal', 'result')
    for ratio in found:
        goal = ratio.goal
        result = 'met' if ratio.is_met else 'MISSED'
        goals.add_row(goal.label, str(ratio.threads), f'{ratio.ratio:.2f}', f'{goal.sense} {goal.bound:g}', result)
    console.print(goals)
    missing = missing_peers()
    if missing:
        console.print(f'Not installed, and left out: {", ".join(missing)}.', highlight=False)
    results = {
        'cloud': cloud,
        'figures': [dataclasses.asdict(figure) for figure in figures],
        'ratios': [{**dataclasses.asdict(ratio), 'holds': ratio.is_met} for ratio in found],
        'left out': missing,
    }
    _finish(console, repeats, path, results)


def _growth(repeats: int, path: Path | None, plot: Path | None) -> None:
    """Print the growth of the time with the number of points."""
    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.studies.bench.growth import POINTS, draw_growth, time_growth

    from .console import CommandConsole

    keep_freed_memory()  # as the node and the other commands do
    console = CommandConsole()
    title = 'Mirrored metal groove, float32; medians in ms'
    table = _table(title, 'million points', 'vote', 'radius and expansion', 'ns/point', left=0)
    points = []
    with console.status('measuring ...') as status:
        for point in time_growth(repeats):
            points.append(point)
            status.update(f'measured {len(points)} of {len(POINTS)} sizes ...')
            table.add_row(
                f'{point.points / 1e6:.2f}',
                f'{point.vote_ms:.1f}',
                f'{point.circle_ms:.2f}',
                f'{point.ns_per_point:.1f}',
            )
    console.print(table)
    if plot is not None:
        draw_growth(points, plot)
    times = [
        {'rows': each.rows, 'columns': each.columns, 'vote': each.vote_ms, 'expansion': each.circle_ms}
        for each in points
    ]
    _finish(console, repeats, path, {'ms': times})


def _sizes(repeats: int, path: Path | None) -> None:
    """Print the times of the filter's steps on clouds of several sizes."""
    from socialcircle_ros.kernels.memory import keep_freed_memory
    from socialcircle_ros.studies.bench.sizes import SIZES, time_sizes

    from .console import CommandConsole

    keep_freed_memory()  # as the node and the other commands do
    console = CommandConsole()
    title = 'Simulated metal groove, float32, 9.55 % outliers; medians in ms'
    headings = ('rows × columns', 'vote', 'circle', 'ns/point', 'of bound', 'whole', 'copy')
    table = _table(title, *headings, left=0)
    table.caption = (
        'circle: radius and expansion; of bound: circle relative to 5 ms + 25 ns per point; whole: from a message'
        ' to the outputs; copy: copying the cloud once'
    )
    times = []
    with console.status('measuring ...') as status:
        for each in time_sizes(repeats):
            times.append(each)
            status.update(f'measured {len(times)} of {len(SIZES)} sizes ...')
            table.add_row(
                f'{each.rows} × {each.columns}',
                f'{each.vote_ms:.1f}',
                f'{each.circle_ms:.2f}',
                f'{1e6 * each.circle_ms / each.points:.1f}',
                f'{each.circle_ms / each.bound_ms:.2f}',
                f'{each.pipeline_ms:.1f}',
                f'{each.copy_ms:.2f}',
            )
    console.print(table)
    written = [
        {
            'rows': each.rows,
            'columns': each.columns,
            'vote': each.vote_ms,
            'radius_and_expansion': each.circle_ms,
            'pipeline': each.pipeline_ms,
            'copy': each.copy_ms,
        }
        for each in times
    ]
    _finish(console, repeats, path, {'ms': written})


def _table(title: str, *headings: str, left: int = 1) -> 'Table':
    """A table without borders; all columns but the first `left` are aligned to the right."""
    from rich.table import Table

    table = Table(title=title, box=None, padding=(0, 2, 0, 0))
    for number, heading in enumerate(headings):
        table.add_column(heading, justify='left' if number < left else 'right')
    return table


def _finish(console: 'CommandConsole', repeats: int, path: Path | None, results: Mapping[str, object]) -> None:
    """Print the machine, and write the results if a path is given."""
    import json

    from socialcircle_ros.kernels.machine import hardware
    from socialcircle_ros.storage import write_file

    console.print(f'{hardware()}; load {os.getloadavg()[0]:.1f} at the end', highlight=False)
    if path is None:
        return
    written = {'hardware': hardware(), 'load': os.getloadavg()[0], 'repeats': repeats, **results}
    write_file(path, json.dumps(written, indent=1))


def _live(repeats: int, seconds: float, path: Path | None) -> None:
    """Print the times of the live node, from a publisher to a subscriber."""
    require_ros()
    import dataclasses
    import tempfile

    # All processes of the benchmark run on this machine; a discovery range that the user has set stays.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    from socialcircle_ros.node.transport import prepare_process

    prepare_process()
    from socialcircle_ros.studies.bench import live

    from .console import CommandConsole

    console = CommandConsole()
    rows, columns = live.SHAPE
    with tempfile.TemporaryDirectory() as name, console.status('') as status:
        folder = Path(name)
        status.update(f'{repeats} stacks of {live.FRAMES} frames ...')
        stacks, _, _ = live.time_stacks(folder, repeats)
        status.update(f'The same, and {live.SIDE_RATE:.0f} clouds a second beside them ...')
        beside, sent, answered = live.time_stacks(folder, repeats, side_rate=live.SIDE_RATE)
        status.update(f'{repeats} clouds through the node and through a relay ...')
        filtered, relayed = live.time_clouds(folder, repeats)
        status.update(f'{repeats} nodes, one after another: ten clouds each ...')
        first, tenth = live.time_starts(folder, repeats)
        status.update(f'{live.CLOUD_RATE:.0f} clouds a second for {seconds:.0f} s ...')
        endurance = live.endure(folder, seconds)
    headings = ('from publish() to the bytes at a subscriber', 'median', 'least', 'most')
    table = _table(f'The live node at {size_text(rows, columns)}, in ms', *headings)
    for trip, times in (
        (f'last of {live.FRAMES} frames to stack/points', stacks),
        (f'the same, {live.SIDE_RATE:.0f} clouds a second beside them', beside),
        ('cloud to points_filtered', filtered),
        ('the same cloud through a bare relay', relayed),
        ('first cloud of a node', first),
        ('tenth cloud of a node', tenth),
    ):
        table.add_row(trip, *(f'{value:.1f}' for value in (times.median, times.least, times.most)))
    console.print(table)
    console.print(
        f'{repeats + 1} stacks beside clouds: no frame lost, {answered} of {sent} clouds answered\n'
        f'node to relay: {filtered.median / relayed.median:.2f} by median, {filtered.least / relayed.least:.2f} by'
        f' least\n{live.CLOUD_RATE:.0f} clouds a second for {seconds:.0f} s: {endurance.answered} of'
        f' {endurance.sent} answered; resident memory {endurance.before.whole:.0f} MB before,'
        f' {endurance.after.whole:.0f} MB after; with only its part of what processes share,'
        f' {endurance.before.proportional:.0f} and {endurance.after.proportional:.0f} MB; a cloud is'
        f' {endurance.cloud_megabytes:.1f} MB',
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
            'first_ms': first.milliseconds,
            'tenth_ms': tenth.milliseconds,
            'endurance': dataclasses.asdict(endurance),
        },
    )


def _network(clouds: int, path: Path | None) -> None:
    """Print how many clouds arrive over networks that lose packets."""
    require_ros()
    import dataclasses

    from socialcircle_ros.studies.bench.live import SHAPE
    from socialcircle_ros.studies.bench.network import INTERVAL_S, measure_network

    from .console import CommandConsole

    console = CommandConsole()
    rows, columns = SHAPE
    title = f'{size_text(rows, columns)}, 16 bytes per point, every {INTERVAL_S:g} s, between two hosts'
    headings = ('', 'loss, %', 'arrived', 'median, ms', 'most, ms', 'told lost')
    table = _table(title, *headings)
    table.columns[0].min_width = 24
    found = []
    with console.status('') as status:
        for each in measure_network(clouds):
            found.append(each)
            status.update(f'{each.setup}, loss {100 * each.loss:g} %: {each.arrived} of {each.clouds} ...')
            times = each.latency
            table.add_row(
                each.setup,
                f'{100 * each.loss:g}',
                f'{each.arrived} of {each.clouds}' + (', publisher hung' if each.hung else ''),
                f'{times.median:.0f}' if times else '',
                f'{times.most:.0f}' if times else '',
                str(each.reported),
            )
    console.print(table)
    _finish(console, clouds, path, {'deliveries': [dataclasses.asdict(each) for each in found]})


def _depth() -> None:
    """Print the error of depth from focus, and what its quality value predicts."""
    from socialcircle_ros.studies.bench.depth_error import SEEDS, depth_errors, quality_shares
    from socialcircle_ros.studies.bench.depth_trust import trust_rows

    from .console import CommandConsole

    console = CommandConsole()
    headings = ('stack', 'specimen', 'fit', 'RMS', 'bias', 'good')
    table = _table('Depth from focus: errors in z-steps over good pixels', *headings, left=3)
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
            f'quality ≥ {bound}: {100 * pixels:.1f} % of the pixels; {100 * good:.1f} % of these are good'
        )
    console.print(
        f'seeds {SEEDS[0]} to {SEEDS[-1]}; good: within a quarter of the depth of field (DOF)', highlight=False
    )
    trust = _table('Order, losses, light, drift, blank areas; 8 bits, 10 000 e-, step DOF/4', '', '', 'value')
    with console.status('simulating stacks whose frames are out of order, lost, dark, moved or blank ...'):
        for figure in trust_rows():
            trust.add_row(figure.name, figure.figure, str(figure))
    console.print(trust)
    _instruments(console)
    _depth_peers(console)
    _frame_costs(console)


def _instruments(console: 'CommandConsole') -> None:
    """Print what the quality predicts on several instruments, and what each step gives."""
    from socialcircle_ros.studies.bench import depth_instruments

    bounds = depth_instruments.BOUNDS
    quality = _table(
        'Of the pixels with at least this quality: the share that is good / their share of all, %',
        'instrument', 'step', *(f'≥ {bound}' for bound in bounds),
    )  # fmt: skip
    scales = _table(
        'Step of the focus measure on a rough plane', '', 'focus.step', 'used', 'quality ≥ 0.9', 'RMS error, DOF'
    )
    with console.status('simulating stacks of several instruments ...'):
        for each in depth_instruments.calibrations():
            cells = [f'{100 * good:.1f} / {100 * pixels:.0f}' for pixels, good in each.shares.values()]
            quality.add_row(each.name, str(each.step), *cells)
        for row in depth_instruments.scale_figures():
            scales.add_row(row.name, str(row.asked), str(row.used), f'{100 * row.trusted:.1f} %', f'{row.rms:.3f}')
    console.print(quality)
    console.print(scales)


def _depth_peers(console: 'CommandConsole') -> None:
    """Print the errors of other focus measures on the same stacks."""
    from socialcircle_ros.studies.bench.depth_peers import missing_peers, peer_rows

    table = _table(
        '8 bits, 10 000 e-; each peer at its best scale; processor time for a frame of a million pixels',
        'stack',
        'method',
        '1.48 MAD, steps',
        'good',
        'bad',
        'ms',
    )
    with console.status('measuring the same stacks with other libraries (a minute) ...'):
        for row in peer_rows():
            table.add_row(
                row.stack,
                row.method,
                f'{row.deviation:.3f}',
                f'{100 * row.good:.1f} %',
                f'{100 * row.bad:.1f} %',
                f'{row.frame_ms:.1f}',
            )
    console.print(table)
    missing = missing_peers()
    if missing:
        console.print(
            f'Not installed, and left out: {", ".join(missing)}. Install with: pip install {" ".join(missing)}'
        )


def _frame_costs(console: 'CommandConsole') -> None:
    """Print time and memory of the frames of a stack."""
    from socialcircle_ros.kernels.machine import hardware
    from socialcircle_ros.studies.bench.depth_cost import frame_costs

    table = _table(
        'Cost of a frame, 8 bits, default settings',
        'rows × columns', 'register', 'cores', 'processor ms', 'frames/s', 'fit, s', 'bytes/pixel', 'at the end',
    )  # fmt: skip
    with console.status('timing frames of a stack (20 s) ...'):
        for cost in frame_costs():
            table.add_row(
                f'{cost.shape[0]} × {cost.shape[1]}',
                'yes' if cost.register else 'no',
                str(cost.cores),
                f'{cost.processor_ms:.1f}',
                f'{cost.frames_per_s:.0f}',
                f'{cost.finish_s:.2f}',
                f'{cost.running_bytes:.1f}',
                f'{cost.peak_bytes:.1f}',
            )
    console.print(table)
    console.print(
        'bytes/pixel: while frames come, without the picture in focus; at the end: with all results\n'
        f'{hardware()}; load {os.getloadavg()[0]:.1f} at the end',
        highlight=False,
    )
