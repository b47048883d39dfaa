# SPDX-License-Identifier: Apache-2.0
"""`socialcircle sweep`."""

import shlex
import sys
from pathlib import Path

import click

from socialcircle_ros.digits import share_text

from .options import (
    parameter_options,
    parameter_values,
    progress_bar,
    quantity,
    shell_words,
    tell_refusals,
    topics_option,
)


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
    '-o', '--output', type=click.Path(path_type=Path), default=Path('out/sweep'), show_default=True,
    help='Folder of the results.',
)  # fmt: skip
@click.option(
    '--clouds', 'max_clouds', type=click.IntRange(min=1), default=10, show_default=True,
    help='Most clouds to filter, spread evenly over the recording.',
)  # fmt: skip
@topics_option
@click.option(
    '--scheduler', metavar='ADDRESS',
    help='Dask scheduler, such as tcp://host:8786, or its scheduler file (.json), whose workers see the RECORDING'
    ' under the same name. Default: the cores of this machine.',
)  # fmt: skip
@click.option('--restart', is_flag=True, help='Delete the trials of an earlier sweep in the same folder.')
@parameter_options
def command(
    recording: Path,
    params: tuple[str, ...],
    search: int | None,
    output: Path,
    max_clouds: int,
    topics: tuple[str, ...],
    scheduler: str | None,
    restart: bool,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Try many settings on the clouds of a RECORDING.

    Filters the same clouds with many settings. If the recording holds the truth, as those of `socialcircle
    simulate` do, the score of a setting is its mean F1 over the clouds, which weigh alike. A setting is called
    better than the one as given only if its margin is beyond the spread between at least three clouds; the page
    states the statistic. Otherwise the page shows candidates side by side, and a person decides.

    Writes to the folder of the results:

    \b
    sweep.html    page with the decision, the candidates side by side, a chart and a table
    sweep.csv     table of all trials
    candidates    parameters of each candidate, 1.yaml and more, for --params-file of all commands
    best.yaml     the better parameters; only if the margin is beyond the spread
    trials.log    finished trials; after an interruption the same command continues from here, and machines that
                  run it with the same folder at once work together

    --params-file and -p set the parameters that are not varied. A parameter that only the mode paper uses, such as
    circle.radius_scale, is tried in this mode, and compared with the parameters as given in their own mode;
    --param circle.mode=paper,adaptive compares the modes.

    Example of a search: socialcircle sweep bags/parts.mcap --param circle.radius_scale=0.5:3 --search 50
    """  # noqa: D301 - click reads \b
    from socialcircle_ros.sweep.page import in_words
    from socialcircle_ros.sweep.search_space import parse_dimension
    from socialcircle_ros.sweep.sweep import BEST, CANDIDATES, PAGE, TABLE, TRIALS, run_sweep

    trials_file, search_space = output / TRIALS, [parse_dimension(text) for text in params]
    given = parameter_values(params_file, parameters, recording)
    try:
        with progress_bar(f'trying settings on {recording.name}') as progress:
            result = run_sweep(
                recording,
                search_space,
                output,
                parameters=given,
                search=search,
                max_clouds=max_clouds,
                topics=topics,
                restart=restart,
                scheduler=scheduler,
                started=lambda dashboard: click.echo(f'Dashboard: {dashboard}', err=True),
                progress=progress,
                made_by=f'socialcircle {shlex.join(sys.argv[1:])}',
            )
    except KeyboardInterrupt:
        if trials_file.exists():
            click.echo(f'{trials_file} has the finished trials; the same command continues from there.', err=True)
        raise
    if result.resumed:
        click.echo(f'{quantity(result.resumed, "trial")} of an earlier run taken from {trials_file}.', err=True)
    trials, clouds = quantity(len(result.trials), 'trial'), quantity(len(result.clouds), 'cloud')
    click.echo(f'{trials} on {clouds}, {"scored against the truth" if result.has_truth else "without a truth"}.')
    click.echo(result.mode_note, nl=bool(result.mode_note))
    decision, score = result.decision, result.score_names[0]
    for number, trial in enumerate(decision.candidates, 1):
        note = ', as given' if trial is result.given else ''
        click.echo(
            f'Candidate {number}{note}: {in_words(trial.values)}: {score} {trial.score:.4f}, removes'
            f' {share_text(trial.removed)}.'
        )
    if decision.winner is None:
        click.echo(f'No verdict. {decision.reason}')
    else:
        click.echo(f'Better than as given: {in_words(decision.winner.values)}. {decision.reason}')
    tell_refusals(result.refused, result.damage)
    written = [TABLE, CANDIDATES, *([BEST] if decision.winner else []), TRIALS]
    click.echo(f'Written to {output}: {", ".join(written)}. Next: open {shell_words(output / PAGE)}')
