"""The results of a sweep for people: the table of all trials, and a page with pictures of the best one."""

import io
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import CloudError
from socialcircle_ros.metrics.scores import score
from socialcircle_ros.pictures.drawings import CloudPictures
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.report.content import Cell, Column, Picture, Pictures, Section, Table
from socialcircle_ros.report.page import render
from socialcircle_ros.settings import PARAMETERS, CircleSettings, RosValue

from .clouds import CRITERION, SweepCloud
from .result import SweepResult
from .search_space import ParameterValues, Range, described

_TRUTH = (
    'The recording holds the truth. The score is F1, the harmonic mean of precision and recall. Precision is the'
    ' share of the removed points that are outliers; recall is the share of the outliers that were removed.'
)
_CRITERION = (
    f'The recording holds no truth, so a criterion takes its place. {CRITERION} The score, "agreement", is the F1'
    ' of the removed points against the points that the criterion would remove. The criterion is not the truth:'
    ' check the pictures.'
)
_MAX_ROWS = 30  # of the table on the page; the CSV file has all rows
_MAX_CLOUDS = 3  # with pictures


def trials_table(result: SweepResult) -> Table:
    """Tabulate all trials, the best first."""
    names = [dimension.name for dimension in result.search_space]
    columns = [
        *(Column(name) for name in names),
        *(Column(name, '.4f') for name in result.score_names),
        Column('removed', '.3%'),
        Column('Sq after', '.4g'),
        Column('Sz after', '.4g'),
        Column('time [ms]', '.1f'),
        Column('refused', 'd'),
    ]
    rows: list[list[Cell]] = [
        [
            *(_cell(trial.values.get(name)) for name in names), trial.score, trial.precision, trial.recall,
            trial.removed, trial.sq, trial.sz, trial.milliseconds, trial.refused,
        ]
        for trial in sorted(result.trials, key=lambda trial: (-trial.score, trial.removed))
    ]  # fmt: skip
    note = 'Scores are over all clouds together; Sq, Sz and the time are means over the clouds.'
    return Table('sweep', 'All trials, the best first', columns, rows, note)


def sweep_page(result: SweepResult, made_by: str) -> str:
    """Render the HTML page of a sweep.

    Args:
        result: the result of the sweep.
        made_by: the command or call that made it, for the page.
    """
    table = trials_table(result)
    count = len(result.trials)
    shown = replace(
        table,
        title=f'The best {min(_MAX_ROWS, count)} of {count} trials',
        rows=table.rows[:_MAX_ROWS],
        note=f'{table.note} The file sweep.csv has all trials.',
    )
    introduction = [
        f'Varied: {"; ".join(described(result.search_space))}.',
        f'Each setting filtered the same {len(result.clouds)} clouds of {result.recording}.',
        _TRUTH if result.has_truth else _CRITERION,
        f'Made by: {made_by}',
    ]
    chart = Picture('scores', _chart(result), 'Score of each trial; the best is red.')
    sections = [
        Section(
            'Trials', findings=list(_findings(result)), items=[chart, shown], warnings=list(_warnings(result))
        ),
        Section(
            'The best setting',
            [f'The {min(_MAX_CLOUDS, len(result.clouds))} clouds with the lowest score.'],
            items=list(_worst_clouds(result)),
        ),
    ]
    return render(f'Sweep over {result.recording}', introduction, sections)


def in_words(values: ParameterValues) -> str:
    """A setting as text."""
    return ', '.join(f'{name} {value}' for name, value in values.items())


def _findings(result: SweepResult) -> Iterator[str]:
    trials, best, given = result.trials, result.best, result.given
    yield f'Best of {len(trials)} trials: {in_words(best.values)}, with {result.score_names[0]} {best.score:.4f}.'
    equal = sum(trial.score == best.score for trial in trials)
    if equal > 1:
        yield f'{equal} trials reach this score. The one shown removes the fewest points, or was tried first.'
    if given.values == best.values:
        yield 'The parameters as given are the best; no other setting scores higher.'
    else:
        yield f'The parameters as given ({in_words(given.values)}) score {given.score:.4f}.'
    if best.refused:
        yield f'The best setting cannot filter {best.refused} clouds; they count as unfiltered.'
    yield f'The best setting removes {100 * best.removed:.3g} % of the measured points.'
    if given.values != best.values:
        yield f'The parameters as given remove {100 * given.removed:.3g} %.'


def _warnings(result: SweepResult) -> Iterator[str]:
    """Why the best setting may not be good."""
    best = result.best
    for dimension in result.search_space:
        value = best.values[dimension.name]
        if PARAMETERS[dimension.name].kind not in (int, float):
            continue
        if isinstance(dimension, Range):
            at_end = value in (dimension.low, dimension.high)
        else:
            at_end = len(dimension.values) > 2 and value in (dimension.values[0], dimension.values[-1])
        if at_end:
            yield (
                f'The best {dimension.name} is at the end of its range, {value}. Values beyond it may be better:'
                ' extend the range.'
            )
    if not result.has_truth and best.score < 0.5:
        yield 'No setting agrees well with the criterion. Check the pictures before you use the best setting.'


def _chart(result: SweepResult) -> bytes:
    """Plot the score over each varied parameter, as a PNG."""
    count = len(result.search_space)
    figure = new_figure(4.6 * count, 3.4)
    plots = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    scores = [trial.score for trial in result.trials]
    best = result.trials.index(result.best)
    for dimension, axes in zip(result.search_space, plots, strict=True):
        values = [trial.values[dimension.name] for trial in result.trials]
        if PARAMETERS[dimension.name].kind not in (int, float):
            values = [str(value) for value in values]
        axes.plot(values, scores, 'o', color='#2a6592', alpha=0.5, markersize=5)
        axes.plot(values[best], scores[best], 'o', color='#d00000', markersize=9)
        axes.set_xlabel(dimension.name)
        axes.grid(alpha=0.3)
    plots[0].set_ylabel(result.score_names[0])
    out = io.BytesIO()
    figure.savefig(out, format='png')
    return out.getvalue()


def _worst_clouds(result: SweepResult) -> Iterator[Pictures]:
    """Pictures of the clouds on which the best setting scores worst, also with the parameters as given."""
    base, best, given = result.base, result.best, result.given
    filtered = [(cloud, _removed(cloud, base | best.values)) for cloud in result.clouds]
    against = 'against the truth' if result.has_truth else 'against the criterion'
    for cloud, found in sorted(filtered, key=lambda pair: _f1(*pair))[:_MAX_CLOUDS]:
        drawn = CloudPictures(cloud.xyz, found)
        pictures = [
            Picture('before', drawn.before(), cloud.name),
            Picture('after', drawn.after(), 'the best setting'),
            Picture('best', drawn.against_truth(cloud.outlier, cloud.counted), f'the best setting {against}'),
        ]
        if given.values != best.values:
            other = CloudPictures(cloud.xyz, _removed(cloud, base | given.values))
            compared = other.against_truth(cloud.outlier, cloud.counted)
            pictures.append(Picture('given', compared, f'the parameters as given {against}'))
        yield Pictures(pictures)


def _f1(cloud: SweepCloud, found: Mask) -> float:
    f1 = score(found, cloud.outlier, cloud.counted).f1
    return 1.0 if np.isnan(f1) else f1


def _removed(cloud: SweepCloud, values: ParameterValues) -> Mask:
    circle = CircleSettings.from_ros(values).of_a_stack(cloud.depth_of_field)
    try:
        return remove_outliers(cloud.xyz, circle).outliers
    except CloudError:
        return np.zeros_like(cloud.outlier)


def _cell(value: RosValue | None) -> Cell:
    return value if isinstance(value, (str, int, float)) or value is None else str(value)
