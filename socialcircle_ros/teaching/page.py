# SPDX-License-Identifier: Apache-2.0
"""What the check of a lesson found, as an HTML page: figures and pictures before and after."""

from collections.abc import Iterator, Sequence

import numpy as np

from socialcircle_ros.pictures.drawings import CloudPictures
from socialcircle_ros.pictures.style import new_figure
from socialcircle_ros.report.content import Cell, Column, Picture, Pictures, Section, Table
from socialcircle_ros.report.page import environment, render

from .examples import CHECKED
from .teach import CheckedField, Teaching

_SHOWN = 8
"""Most fields with pictures."""


TITLE = 'A lesson'


def check_libraries() -> None:
    """Fail now if a library for the page is missing, and not after the work.

    Raises:
        SocialCircleError: matplotlib or Jinja2 is not installed; the message says how to install it.
    """
    new_figure(1, 1)
    environment()


def lesson_page(teaching: Teaching, damage: Sequence[str] = ()) -> str:
    """Render the page.

    Args:
        teaching: what was learnt, and its check.
        damage: a sentence for each recording that is damaged.

    Raises:
        SocialCircleError: matplotlib or Jinja2 is not installed.
    """
    names = ', '.join(teaching.lesson.taught_on)
    introduction = [
        f'Taught on: {names}.',
        'Outliers were put into some parts of the good clouds. The lesson learnt to tell them from the texture.',
        f'It decides about the points that the {teaching.lesson.judge} of the adaptive mode suspected.',
        'The figures below are of the fields kept back.',
    ]
    verdict = teaching.refusal or 'The lesson helps on the fields kept back.'
    check = Section(
        'Check', findings=[verdict], items=[_figures(teaching)], warnings=[*damage, *teaching.warnings]
    )
    return render(TITLE, introduction, [check, *_pictures(teaching.fields)])


def _figures(teaching: Teaching) -> Table:
    rows: list[list[Cell]] = [
        ['untouched: good points removed', None, teaching.before.removed, teaching.after.removed, None, None]
    ]
    for kind, before, after in zip(CHECKED, teaching.before.inserted, teaching.after.inserted, strict=True):
        share, first, last = kind.contamination.share, before.false_positive_rate, after.false_positive_rate
        rows.append([kind.name, share, first, last, before.f1, after.f1])
    columns = [
        Column('outliers put in'), Column('share', '.0%'),
        Column('good points removed, without a lesson', '.3%'), Column('with the lesson', '.3%'),
        Column('F1, without a lesson', '.3f'), Column('F1, with the lesson', '.3f'),
    ]  # fmt: skip
    note = 'σ is the robust standard deviation of the residuals to a 5×5 median along the local slope.'
    return Table('check', 'Fields kept back', columns, rows, note)


def _pictures(fields: Sequence[CheckedField]) -> Iterator[Section]:
    for checked in fields[:_SHOWN]:
        example, unit = checked.example, checked.example.field.cloud.unit
        without = CloudPictures(example.points, checked.before, unit)
        lesson = CloudPictures(example.points, checked.after, unit, without.colour_range)
        inserted = int(np.count_nonzero(example.outlier))
        counts = (
            f'{np.count_nonzero(checked.before):,} without the lesson, {np.count_nonzero(checked.after):,} with it'
        )
        if inserted:
            title, text = f'{inserted:,} outliers put in', f'Points removed: {counts}.'
            pictures = [
                Picture('without', without.against_truth(example.outlier, example.counted), 'without the lesson'),
                Picture('lesson', lesson.against_truth(example.outlier, example.counted), 'with the lesson'),
            ]
        else:
            title, text = 'untouched', f'Points removed: {counts}. A: without the lesson; B: with it.'
            name = example.field.name
            pictures = [
                Picture('before', without.before(), '', f'{name}: heights as measured'),
                Picture(
                    'differ', without.against(lesson), '', f'{name}: what is removed without and with the lesson'
                ),
            ]
        yield Section(f'{example.field.name}: {title}', [text], items=[Pictures(pictures)])
