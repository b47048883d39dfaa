# SPDX-License-Identifier: Apache-2.0
"""The results of a sweep for people: the decision, the candidates side by side, and the table of all trials."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Mask
from socialcircle_ros.errors import CloudError
from socialcircle_ros.lengths import length_scale
from socialcircle_ros.pictures.drawings import CloudPictures
from socialcircle_ros.pictures.style import OUTLIER, SURFACE, new_figure, png_of
from socialcircle_ros.report.content import Banner, Cell, Column, Picture, Pictures, Section, Table, refusal_text
from socialcircle_ros.report.page import render
from socialcircle_ros.settings import PARAMETERS, CircleSettings, RosValue

from .clouds import CRITERION, SweepCloud
from .decision import STATISTIC
from .result import SweepResult
from .search_space import ParameterValues, Range, described
from .trials import Trial

_TRUTH = (
    'The recording holds the truth. The score of a cloud is F1, the harmonic mean of precision and recall.'
    ' Precision is the share of the removed points that are outliers; recall is the share of the outliers that'
    ' were removed.'
    ' The score of a setting is the mean over the clouds, which weigh alike.'
)
_CRITERION = (
    f'The recording holds no truth. The column "agreement" compares each setting with a criterion. {CRITERION}'
    ' Agreement is the F1 of the removed points against the points that the criterion would remove, as the mean'
    ' over the clouds. It says how alike the two are, and not which is right.'
)
_MAX_ROWS = 30  # of the table on the page; the CSV file has all rows
_MAX_CLOUDS = 3  # with pictures


def trials_table(result: SweepResult) -> Table:
    """Tabulate all trials: by score with a truth, else by the share of removed points."""
    names = [dimension.name for dimension in result.search_space]
    lengths = length_scale(
        [value for trial in result.trials for value in (trial.sq, trial.sz) if value], result.unit
    )
    headings = [lengths.label(name) for name in ('Sq after', 'Sz after')]
    columns = [
        *(Column(name) for name in names),
        *(Column(name, '.4f') for name in result.score_names),
        Column('removed', '.3%'),
        *(Column(heading, f'.{lengths.decimals}f') for heading in headings),
        Column('time [ms]', '.1f'),
        Column('refused', 'd'),
    ]
    rows: list[list[Cell]] = [
        [
            *(_cell(trial.values.get(name)) for name in names), trial.score, trial.precision, trial.recall,
            trial.removed, *(None if each is None else each * lengths.factor for each in (trial.sq, trial.sz)),
            trial.milliseconds, trial.refused,
        ]
        for trial in _ordered(result)
    ]  # fmt: skip
    note = 'All columns are means over the clouds, which weigh alike.'
    return Table('sweep', f'All trials, {_order(result)}', columns, rows, note)


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
        title=f'{min(_MAX_ROWS, count)} of {count} trials, {_order(result)}',
        rows=table.rows[:_MAX_ROWS],
        note=f'{table.note} The file sweep.csv has all trials.',
    )
    introduction = [
        f'Varied: {"; ".join(described(result.search_space))}.',
        *([result.mode_note] if result.mode_note else []),
        f'Clouds of {result.recording} that each setting filtered: {len(result.clouds)}.',
        _TRUTH if result.has_truth else _CRITERION,
        f'Made by: {made_by}',
    ]
    spread = ', with the standard error between the clouds' if len(result.clouds) > 1 else ''
    caption = f'{result.score_names[0].capitalize()} of each trial{spread}.'
    chart = Picture('scores', _chart(result), caption)
    sections = [
        Section('Decision', [STATISTIC] if result.has_truth else [], items=[_banner(result)]),
        Section(
            'Candidates side by side',
            ['The numbers are those of the files in the folder candidates.'],
            items=[_candidates_table(result), *_candidate_pictures(result)],
        ),
        Section('Trials', items=[chart, shown], warnings=list(_warnings(result))),
    ]
    return render(f'Sweep over {result.recording}', introduction, sections)


def in_words(values: ParameterValues) -> str:
    """A setting as text."""
    return ', '.join(f'{name} {value}' for name, value in values.items())


def _banner(result: SweepResult) -> Banner:
    decision, given = result.decision, result.given
    if decision.winner is None:
        return Banner('none', 'No verdict.', [decision.reason, 'best.yaml is not written.'])
    winner = decision.winner
    scores = f'{result.score_names[0]} {winner.score:.4f}, as given {given.score:.4f}.'
    return Banner('passed', f'Better than as given: {in_words(winner.values)}.', [decision.reason, scores])


def _candidates_table(result: SweepResult) -> Table:
    columns = [
        Column('candidate'), Column('setting'), Column(result.score_names[0], '.4f'),
        Column('lowest of a cloud', '.4f'), Column('highest of a cloud', '.4f'), Column('removed', '.3%'),
        Column('refused', 'd'),
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [
            str(number), _name(result, trial), trial.score, min(trial.cloud_scores, default=None),
            max(trial.cloud_scores, default=None), trial.removed, trial.refused,
        ]
        for number, trial in enumerate(result.decision.candidates, 1)
    ]  # fmt: skip
    return Table('candidates', '', columns, rows)


def _name(result: SweepResult, trial: Trial) -> str:
    given = ' (as given)' if trial.values == result.given.values else ''
    return f'{in_words(trial.values)}{given}'


def _candidate_pictures(result: SweepResult) -> Iterator[Pictures]:
    """The clouds about which the candidates differ most: before, and after each candidate, in the same colours."""
    candidates = result.decision.candidates
    removed = [
        (cloud, [_removed(cloud, result.base | trial.values) for trial in candidates]) for cloud in result.clouds
    ]
    for cloud, masks in sorted(removed, key=lambda pair: -_disagreement(pair[1]))[:_MAX_CLOUDS]:
        # A candidate that removes much of the surface must not take its colours away.
        shared = CloudPictures(cloud.xyz, np.all(masks, axis=0), cloud.unit)
        pictures = [Picture('before', shared.before(), cloud.name)]
        for number, mask in enumerate(masks, 1):
            drawn = CloudPictures(cloud.xyz, mask, cloud.unit, shared.colour_range)
            pictures.append(Picture(f'candidate-{number}', drawn.after(), f'candidate {number}'))
        yield Pictures(pictures)
        if result.has_truth:
            yield Pictures(
                [
                    Picture(
                        f'truth-{number}',
                        CloudPictures(cloud.xyz, mask, cloud.unit).against_truth(cloud.outlier, cloud.counted),
                        f'candidate {number}',
                    )
                    for number, mask in enumerate(masks, 1)
                ]
            )


def _disagreement(masks: list[Mask]) -> float:
    """The share of points about which masks differ."""
    return float(np.mean(np.any(masks, axis=0) & ~np.all(masks, axis=0)))


def _warnings(result: SweepResult) -> Iterator[str]:
    """What was not filtered, and why the setting with the highest score may not be the best that there is."""
    yield from (refusal_text(reason, count) for reason, count in result.refused.items())
    if result.damage:
        yield result.damage
    best = result.best
    if not result.has_truth:
        return
    for dimension in result.search_space:
        value = best.values.get(dimension.name)
        if PARAMETERS[dimension.name].kind not in (int, float):
            continue
        if isinstance(dimension, Range):
            at_end = value in (dimension.low, dimension.high)
        else:
            at_end = len(dimension.values) > 2 and value in (dimension.values[0], dimension.values[-1])
        if at_end:
            yield (
                f'{dimension.name} with the highest score is at the end of its range, {value}. Values beyond it'
                ' may be better: extend the range.'
            )


def _chart(result: SweepResult) -> bytes:
    """Plot the score over each varied parameter, as a PNG."""
    count = len(result.search_space)
    figure = new_figure(4.6 * count, 3.4)
    plots = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    marked = result.decision.winner
    for dimension, axes in zip(result.search_space, plots, strict=True):
        trials = [trial for trial in result.trials if dimension.name in trial.values]
        if result.given not in trials:
            axes.axhline(result.given.score, color=SURFACE, linestyle='--', label='as given')
            axes.legend()
        scores = [trial.score for trial in trials]
        errors = [trial.standard_error for trial in trials]
        values = [trial.values[dimension.name] for trial in trials]
        if PARAMETERS[dimension.name].kind not in (int, float):
            values = [str(value) for value in values]
        axes.errorbar(values, scores, errors, fmt='o', color=SURFACE, alpha=0.5, markersize=5, elinewidth=1)
        if marked is not None:
            place = trials.index(marked)
            axes.plot(values[place], scores[place], 'o', color=OUTLIER, markersize=9)
        axes.set_xlabel(dimension.name)
        axes.grid(alpha=0.3)
    plots[0].set_ylabel(result.score_names[0])
    return png_of(figure)


def _ordered(result: SweepResult) -> list[Trial]:
    if result.has_truth:
        return sorted(result.trials, key=lambda trial: (-trial.score, trial.removed))
    return sorted(result.trials, key=lambda trial: trial.removed)


def _order(result: SweepResult) -> str:
    return 'the highest score first' if result.has_truth else 'by the share of removed points'


def _removed(cloud: SweepCloud, values: ParameterValues) -> Mask:
    circle = CircleSettings.from_ros(values).of_a_stack(cloud.depth_of_field)
    try:
        return remove_outliers(cloud.xyz, circle).outliers
    except CloudError:
        return np.zeros_like(cloud.outlier)


def _cell(value: RosValue | None) -> Cell:
    return value if isinstance(value, (str, int, float)) or value is None else str(value)
