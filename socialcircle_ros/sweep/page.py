"""What a sweep leaves: the table of all trials, and a page with pictures of the best."""

import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.cloud import Mask, measured_points
from socialcircle_ros.errors import CloudError
from socialcircle_ros.metrics.scores import score
from socialcircle_ros.report import thumbnails as panels
from socialcircle_ros.report.content import Cell, Column, Panels, Picture, Section, Table
from socialcircle_ros.report.page import render
from socialcircle_ros.report.pictures import aspect_of, new_figure
from socialcircle_ros.settings import PARAMETERS, CircleSettings

from .search_space import Range, SearchDimension, Values, words
from .trials import CRITERION, SweepCloud, Trial, best_of

_OF_TRUTH = ('F1', 'precision', 'recall')
_OF_CRITERION = ('agreement', 'of the removed, outstanding', 'of the outstanding, removed')
_TRUTH = (
    'the truth that the recording holds: the score is F1, the harmonic mean of precision (of the points removed,'
    ' how many are outliers) and recall (of the outliers, how many were removed).'
)
_STAND_IN = (
    f'a criterion, since the recording holds no truth. {CRITERION} The score, "agreement", is the harmonic mean of'
    ' two shares: of the points removed, how many stand out, and of those that stand out, how many were removed.'
    ' It stands in for the truth, and is not it: look at the pictures.'
)
_SHOWN = 30  # rows of the table on the page; the CSV has all
_DRAWN = 3  # clouds with pictures


def trials_table(search_space: Sequence[SearchDimension], trials: Sequence[Trial], *, known: bool) -> Table:
    """All trials, the best first.

    Args:
        search_space: what was varied.
        trials: in any order.
        known: whether they were scored against the truth.
    """
    names = [each.name for each in search_space]
    columns = [
        *(Column(name) for name in names),
        *(Column(name, '.4f') for name in (_OF_TRUTH if known else _OF_CRITERION)),
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
        for trial in sorted(trials, key=lambda trial: (-trial.score, trial.removed))
    ]  # fmt: skip
    note = 'Over all clouds together; Sq, Sz and the time are means over the clouds.'
    return Table('sweep', 'All trials, the best first', columns, rows, note)


def sweep_page(
    name: str,
    search_space: Sequence[SearchDimension],
    trials: Sequence[Trial],
    given: Trial,
    base: Values,
    cases: Sequence[SweepCloud],
    command: str,
) -> str:
    """The HTML page of a sweep.

    Args:
        name: of the recording.
        search_space: what was varied.
        trials: all of them, that of the given setting included.
        given: the trial of the parameters as they were given.
        base: all parameters as they were given.
        cases: the clouds as the best setting measures them.
        command: that made it.
    """
    known = cases[0].known
    best = best_of(trials)
    table = trials_table(search_space, trials, known=known)
    title = f'The best {min(_SHOWN, len(trials))} of {len(trials)} trials'
    shown = replace(table, title=title, rows=table.rows[:_SHOWN], note=f'{table.note} All are in sweep.csv.')
    text = [
        f'Varied: {"; ".join(words(search_space))}.',
        f'On {len(cases)} clouds of {name}, scored against {_TRUTH if known else _STAND_IN}',
        f'Made by: {command}',
    ]
    chart = Picture('scores', _scores(search_space, trials, best, known=known), 'The score of each trial.')
    findings = list(_findings(trials, best, given, known=known))
    sections = [
        Section(
            'Trials', findings=findings, items=[chart, shown], warnings=list(_warnings(search_space, best, cases))
        ),
        Section(
            'The best setting',
            [f'The clouds on which it does worst, at most {_DRAWN}.'],
            items=list(_drawn(cases, base, best, given)),
        ),
    ]
    return render(f'Sweep over {name}', text, sections)


def _findings(trials: Sequence[Trial], best: Trial, given: Trial, *, known: bool) -> Iterator[str]:
    what = (_OF_TRUTH if known else _OF_CRITERION)[0]
    yield f'Best of {len(trials)} trials: {in_words(best.values)}, with {what} {best.score:.4f}.'
    equal = sum(trial.score == best.score for trial in trials) - 1
    if equal:
        yield f'As many as {equal + 1} reach this score; this one removes least, or comes first.'
    if given.values == best.values:
        yield 'That is what was given: nothing that was tried is better.'
    else:
        yield f'As given ({in_words(given.values)}) it is {given.score:.4f}.'
    if best.refused:
        yield f'{best.refused} clouds have no answer under the best setting, and count as not filtered.'
    numbers = (f'{100 * best.removed:.3g} %', f'{100 * given.removed:.3g} %')
    yield f'The best setting removes {numbers[0]} of the measured points, the given one {numbers[1]}.'


def _warnings(search_space: Sequence[SearchDimension], best: Trial, cases: Sequence[SweepCloud]) -> Iterator[str]:
    """Why the best may not be good."""
    for each in search_space:
        ends = [each.low, each.high] if isinstance(each, Range) else [each.values[0], each.values[-1]]
        numbers = PARAMETERS[each.name].kind in (int, float)
        if numbers and best.values[each.name] in ends and (isinstance(each, Range) or len(each.values) > 2):
            value = best.values[each.name]
            yield f'{each.name} is best at the end of what was tried, {value}: what lies beyond may be better.'
    if not cases[0].known and best.score < 0.5:
        yield 'No setting comes near the criterion: do not take the best over without a look at the pictures.'


def in_words(values: Values) -> str:
    """A setting as text."""
    return ', '.join(f'{name} {value}' for name, value in values.items())


def _scores(
    search_space: Sequence[SearchDimension], trials: Sequence[Trial], best: Trial, *, known: bool
) -> bytes:
    """The score over each parameter that is varied; the best in red."""
    figure = new_figure(4.6 * len(search_space), 3.4)
    for each, drawn in zip(
        search_space, np.atleast_1d(figure.subplots(1, len(search_space), sharey=True)), strict=True
    ):
        values = [trial.values[each.name] for trial in trials]
        if PARAMETERS[each.name].kind not in (int, float):
            values = [str(value) for value in values]
        scores = [trial.score for trial in trials]
        drawn.plot(values, scores, 'o', color='#2a6592', alpha=0.5, markersize=5)
        drawn.plot(values[trials.index(best)], best.score, 'o', color='#d00000', markersize=9)
        drawn.set_xlabel(each.name)
        drawn.set_ylabel((_OF_TRUTH if known else _OF_CRITERION)[0] if each is search_space[0] else '')
        drawn.grid(alpha=0.3)
    out = io.BytesIO()
    figure.savefig(out, format='png')
    return out.getvalue()


def _drawn(cases: Sequence[SweepCloud], base: Values, best: Trial, given: Trial) -> Iterator[Panels]:
    """Pictures of the clouds that the best setting does worst on, beside the given setting."""
    answers = [(case, _removed(case, base | best.values)) for case in cases]
    worst = sorted(answers, key=lambda answer: _f1(*answer))[:_DRAWN]
    bar = panels.colour_bar()
    for case, found in worst:
        xyz = case.xyz
        measured = measured_points(xyz)
        heights = np.where(measured, xyz[..., 2], np.nan)
        scale = panels.colour_range(heights, found)
        colours = 'removed rightly red, wrongly black; missed amber' if case.known else (
            'removed red, black where it does not stand out; amber stands out'
        )  # fmt: skip
        pictures = [
            (f'{case.name} as measured', panels.as_measured(heights, found | case.outlier, scale)),
            ('cleaned by the best setting', panels.cleaned(heights, found, scale)),
            (f'best: {colours}', panels.judged(found, case.outlier, case.counted, measured)),
        ]
        if given.values != best.values:
            before = _removed(case, base | given.values)
            pictures.append(('as given', panels.judged(before, case.outlier, case.counted, measured)))
        yield Panels(pictures, aspect_of(xyz), (f'{scale.low:.4g}', f'{scale.high:.4g}', bar))


def _f1(case: SweepCloud, found: Mask) -> float:
    f1 = score(found, case.outlier, case.counted).f1
    return 1.0 if np.isnan(f1) else f1


def _removed(case: SweepCloud, values: Values) -> Mask:
    try:
        return remove_outliers(case.xyz, CircleSettings.from_ros(values).of_a_stack(case.depth_of_field)).outliers
    except CloudError:
        return np.zeros_like(case.outlier)


def _cell(value: Any) -> Cell:
    return value if isinstance(value, (str, int, float)) or value is None else str(value)
