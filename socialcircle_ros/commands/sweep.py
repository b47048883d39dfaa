"""`socialcircle sweep`."""

import shlex
import sys
from pathlib import Path

import click

from .options import parameter_options, parameter_values, progress_bar, quantity, tell_refusals


@click.command('sweep', epilog='Example: socialcircle sweep bags/parts.mcap --param circle.radius_scale=0.5:3:0.1')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '--param', 'params', multiple=True, required=True, metavar='NAME=VALUES',
    help='Parameter of circle or focus to vary, and its values: LOW:HIGH:STEP, or VALUE,VALUE, or with --search'
    ' LOW:HIGH. May be repeated.',
)  # fmt: skip
@click.option(
    '--search',
    type=click.IntRange(min=1),
    help='Try this number of settings, chosen by Optuna. Default: all combinations.',
)
@click.option(
    '-o', '--out', type=click.Path(path_type=Path), default=Path('out/sweep'), show_default=True,
    help='Folder of the results.',
)  # fmt: skip
@click.option(
    '--clouds', 'max_clouds', type=click.IntRange(min=1), default=10, show_default=True,
    help='Most clouds to filter, spread evenly over the recording.',
)  # fmt: skip
@click.option(
    '--topic',
    'topics',
    multiple=True,
    help='Topic of clouds to filter. May be repeated. Default: all topics named points, and all focus stacks.',
)
@click.option('--restart', is_flag=True, help='Delete the trials of an earlier sweep in the same folder.')
@parameter_options
def command(
    recording: Path,
    params: tuple[str, ...],
    search: int | None,
    out: Path,
    max_clouds: int,
    topics: tuple[str, ...],
    restart: bool,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Find the best parameters on the clouds of a RECORDING.

    Filters the same clouds with many settings and scores each setting. The score is F1 against the truth where
    the recording holds it, as those of `socialcircle simulate` do. Otherwise it is F1 against a criterion, which
    the page states.

    Writes to the folder of the results:

    \b
    sweep.html    page with a chart, a table and pictures
    sweep.csv     table of all trials
    best.yaml     best parameters, for --params-file of the node and of the other commands
    trials.jsonl  finished trials; after an interruption the same command continues from here

    --params-file and -p set the parameters that are not varied. A parameter that only the mode paper uses, such as
    circle.radius_scale, sets circle.mode to paper; --param circle.mode=paper,adaptive compares the modes.

    Example of a search: socialcircle sweep bags/parts.mcap --param circle.radius_scale=0.5:3 --search 50
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.sweep.page import in_words
    from socialcircle_ros.sweep.search_space import parse_dimension
    from socialcircle_ros.sweep.sweep import BEST, PAGE, TABLE, TRIALS, run_sweep

    search_space = [parse_dimension(text) for text in params]
    given = parameter_values(params_file, parameters, recording)
    try:
        with progress_bar(f'trying settings on {recording.name}') as progress:
            result = run_sweep(
                recording,
                search_space,
                out,
                parameters=given,
                search=search,
                max_clouds=max_clouds,
                topics=topics,
                restart=restart,
                progress=progress,
                made_by=f'socialcircle {shlex.join(sys.argv[1:])}',
            )
    except KeyboardInterrupt:
        click.echo(f'{out / TRIALS} has the finished trials; the same command continues from there.', err=True)
        raise
    if result.resumed:
        click.echo(f'{quantity(result.resumed, "trial")} of an earlier run taken from {out / TRIALS}.', err=True)
    against = 'the truth' if result.has_truth else 'a criterion, because the recording holds no truth'
    trials, clouds = quantity(len(result.trials), 'trial'), quantity(len(result.clouds), 'cloud')
    click.echo(f'{trials} on {clouds}, scored against {against}.')
    best, score = in_words(result.best.values), result.score_names[0]
    click.echo(f'Best: {best}: {score} {result.best.score:.4f}; as given: {result.given.score:.4f}.')
    tell_refusals(result.refused, result.damage)
    click.echo(f'{TABLE}, {BEST} and {TRIALS} are in {out}. Next: open {out / PAGE}')
