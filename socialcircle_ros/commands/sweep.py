"""`socialcircle sweep`."""

import dataclasses
import shlex
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import parameter_options, parameter_values, quantity, tell_refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from socialcircle_ros.pipeline.stacks import Refusal
    from socialcircle_ros.recording.offline import SourceCloud
    from socialcircle_ros.sweep.search_space import Values
    from socialcircle_ros.sweep.trials import SweepCloud

PAGE, TABLE, BEST, TRIALS = 'sweep.html', 'sweep.csv', 'best.yaml', 'trials.jsonl'


@click.command('sweep', epilog='Example: socialcircle sweep bags/parts.mcap --param circle.radius_scale=0.5:3:0.1')
@click.argument('recording', type=click.Path(path_type=Path))
@click.option(
    '--param', 'params', multiple=True, required=True, metavar='NAME=VALUES',
    help='What to vary: LOW:HIGH:STEP, values with commas, or for a search LOW:HIGH. May be repeated.',
)  # fmt: skip
@click.option(
    '--search', type=click.IntRange(min=1), help='Try so many settings, chosen by Optuna; else all of them.'
)
@click.option(
    '-o', '--out', type=click.Path(path_type=Path), default=Path('out/sweep'), show_default=True,
    help='Directory of the page, the table, the best parameters and the finished trials.',
)  # fmt: skip
@click.option(
    '--clouds', 'most', type=click.IntRange(min=1), default=10, show_default=True,
    help='At most so many clouds are filtered, evenly spread over the recording.',
)  # fmt: skip
@click.option('--topic', 'topics', multiple=True, help='A topic of clouds; default: those named points.')
@click.option('--restart', is_flag=True, help='Forget the trials of an earlier run in the same directory.')
@parameter_options
def command(
    recording: Path,
    params: tuple[str, ...],
    search: int | None,
    out: Path,
    most: int,
    topics: tuple[str, ...],
    restart: bool,
    params_file: Path | None,
    parameters: tuple[str, ...],
) -> None:
    """Filter the same clouds of a RECORDING with many settings, and find the best.

    Scored against the truth where the recording holds it (as those of `socialcircle simulate` do), else against a
    criterion that the page states. Writes sweep.html, sweep.csv, best.yaml, which the node and the other commands
    take with --params-file, and trials.jsonl: the same command goes on from there after an interruption. -p and
    --params-file set what is not varied.
    """
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress

    from socialcircle_ros.errors import RecordingError, SocialCircleError
    from socialcircle_ros.kernels.ordered import in_order
    from socialcircle_ros.recording import open_recording
    from socialcircle_ros.recording.offline import source_clouds
    from socialcircle_ros.recording.truth import truths_of
    from socialcircle_ros.report.page import prepare, save
    from socialcircle_ros.report.pictures import new_figure
    from socialcircle_ros.settings import CircleSettings, FocusSettings, PipelineSettings, StackSettings, yaml_text
    from socialcircle_ros.sweep.page import in_words, sweep_page, trials_table
    from socialcircle_ros.sweep.search_space import grid, parse_dimension
    from socialcircle_ros.sweep.trials import (
        Search,
        SweepCloud,
        Trial,
        TrialFile,
        attempt,
        best_of,
        evenly,
        fingerprint_of,
        remembered,
        sweep_cloud,
        untried,
    )

    search_space = [parse_dimension(text) for text in params]
    given = parameter_values(params_file, parameters)
    groups = [group.from_ros(given) for group in (FocusSettings, StackSettings, CircleSettings)]
    base = {name: value for group in groups for name, value in group.to_ros().items()}
    as_given = {dimension.name: base[dimension.name] for dimension in search_space}
    wanted = [as_given, *(values for values in ([] if search else grid(search_space)) if values != as_given)]
    if search:
        Search(search_space, search, ())  # says that Optuna is missing now, not after the first trial
    new_figure(1, 1)  # as well for matplotlib
    prepare(out)
    refused: Counter[str] = Counter()
    damage: str | None = None

    def load(focus: FocusSettings) -> 'list[SweepCloud]':
        """The clouds that are filtered, as `focus` measures the stacks."""
        nonlocal damage
        refused.clear()
        with open_recording(recording) as reader:
            truths = truths_of(reader)
            events = source_clouds(reader, PipelineSettings.from_ros(base | focus.to_ros()), topics=topics)
            chosen = evenly(_clouds(events, refused), most)
            damage = reader.damage

        def case(named: 'tuple[str, SourceCloud]') -> 'SweepCloud | str':
            """A cloud with what is to be removed, or why it is none."""
            name, cloud = named
            try:
                truth = truths(cloud.namespace, cloud.points)
                found = sweep_cloud(name, cloud.points, None if truth is None else (truth.outlier, truth.counted))
                return dataclasses.replace(found, depth_of_field=cloud.depth_of_field)
            except SocialCircleError as refusal:
                return str(refusal)

        cases: list[SweepCloud] = []
        for found in in_order(case, chosen):
            if isinstance(found, str):
                refused[found] += 1
            else:
                cases.append(found)
        if not cases:
            reasons = ' '.join(refused) or damage or 'It holds no message on its topics.'
            raise RecordingError(f'{recording} gave no cloud: {reasons}')
        # One measure for all: where some clouds have a truth, those alone are scored.
        return [each for each in cases if each.known] or cases

    cases = remembered(load)

    def tried(values: 'Values') -> Trial:
        return attempt(base, values, cases)

    console = Console(stderr=True)
    with console.status(f'reading {recording.name} ...'):
        fixed = {name: value for name, value in base.items() if name not in as_given}
        fingerprint = fingerprint_of(cases(FocusSettings.from_ros(base)), fixed)
    file = TrialFile(out / TRIALS, fingerprint, restart=restart)
    if file.trials:
        click.echo(f'{quantity(len(file.trials), "trial")} of an earlier run taken from {file.path}.', err=True)
    columns = (*Progress.get_default_columns(), MofNCompleteColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        left = untried(wanted, file.trials)
        done = len(file.trials) if search else len(wanted) - len(left)
        task = progress.add_task('trying settings', total=search or len(wanted), completed=done)
        try:
            for trial in in_order(tried, left):
                file.add(trial)
                progress.advance(task)
            if search:
                study = Search(search_space, search, file.trials)
                for trial in in_order(tried, study):
                    study.tell(trial)
                    file.add(trial)
                    progress.advance(task)
        except KeyboardInterrupt:
            click.echo(f'Stopped after {quantity(len(file.trials), "trial")}; the same command goes on.', err=True)
            raise
        finally:
            file.close()
    trials = file.trials
    best, before = best_of(trials), next(trial for trial in trials if trial.values == as_given)
    final = cases(FocusSettings.from_ros(base | best.values))
    known = final[0].known
    line = f'socialcircle {shlex.join(sys.argv[1:])}'
    table = trials_table(search_space, trials, known=known)
    save(out / TABLE, table.csv())
    save(out / BEST, yaml_text(given | best.values, whole=False))
    save(out / PAGE, sweep_page(recording.name, search_space, trials, before, base, final, line))
    what = 'F1' if known else 'agreement with what stands out'
    against = 'against the truth' if known else 'against a criterion, as the recording holds no truth'
    click.echo(f'{quantity(len(trials), "trial")} on {quantity(len(final), "cloud")}, {against}.')
    click.echo(f'Best: {in_words(best.values)}: {what} {best.score:.4f}, as given {before.score:.4f}.')
    tell_refusals(refused, damage)
    click.echo(f'{TABLE}, {BEST} and {TRIALS} written to {out}; next: open {out / PAGE}')


def _clouds(
    events: 'Iterator[SourceCloud | Refusal]', refused: Counter[str]
) -> 'Iterator[tuple[str, SourceCloud]]':
    """The clouds with their names; what was refused is counted."""
    from socialcircle_ros.pipeline.stacks import Refusal

    counts: Counter[str] = Counter()
    for event in events:
        if isinstance(event, Refusal):
            refused[event.reason] += 1
        else:
            yield f'{event.topic} {counts[event.topic]}', event
            counts[event.topic] += 1
