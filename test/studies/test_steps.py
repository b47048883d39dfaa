# SPDX-License-Identifier: Apache-2.0
"""Steps of experiments: kept when they are finished, and not repeated."""

from dataclasses import replace

import numpy as np
import pytest

from socialcircle_ros.report.content import Column, Picture, Section, Table
from socialcircle_ros.studies.steps import Step, fingerprint_of, forget_steps, rows_of, run_steps

SECTION = Section(
    'Title',
    ['text'],
    ['A finding.'],
    [
        Table('t', 'T', [Column('a'), Column('b', '.1f')], [['x', np.int64(3)], [None, float('nan')]], 'note'),
        Picture('p', b'\x89PNG\0', 'caption'),
    ],
    ['warning'],
    'anchor',
)


class InterruptedStepError(Exception):
    pass


def steps(made, fails_at=None):
    def make(key):
        if key == fails_at:
            raise InterruptedStepError
        made.append(key)
        return [replace(SECTION, title=key)]

    works = {'one': 1.0, 'two': 3.0, 'three': 8.0}
    return [Step(key, work, lambda _, key=key: make(key)) for key, work in works.items()]


def test_the_time_that_is_left_is_known_before_the_first_step(tmp_path):
    made = []
    first = next(run_steps(steps(made), tmp_path, 'print', lambda: 2.0))
    assert made == []
    assert (first.done, first.total, first.seconds_left) == (0, 3, 24.0)


def test_an_interrupted_run_continues_with_the_steps_that_are_left(tmp_path):
    made = []
    with pytest.raises(InterruptedStepError):
        list(run_steps(steps(made, fails_at='three'), tmp_path / 'kept', 'print', lambda: 1.0))
    assert made == ['one', 'two']
    found = list(run_steps(steps(made), tmp_path / 'kept', 'print', lambda: 0.5))
    assert made == ['one', 'two', 'three']
    assert [(each.done, each.total, each.resumed) for each in found] == [(2, 3, 2), (3, 3, 2)]
    assert [each.seconds_left for each in found] == [4.0, 0.0]
    kept, _, new = found[1].sections
    assert kept.tables[0].texts() == new.tables[0].texts()
    assert kept.tables[0].csv() == new.tables[0].csv()
    assert kept.pictures == new.pictures
    assert (kept.title, kept.text, kept.findings, kept.warnings, kept.anchor) == (
        'one', ['text'], ['A finding.'], ['warning'], 'anchor',
    )  # fmt: skip


def test_no_pilot_runs_where_no_step_is_left(tmp_path):
    list(run_steps(steps([]), tmp_path, 'print', lambda: 1.0))

    def pilot():
        raise InterruptedStepError

    (last,) = run_steps(steps([], fails_at='one'), tmp_path, 'print', pilot)
    assert (last.done, last.resumed, last.seconds_left) == (3, 3, 0.0)


def test_sections_of_one_title_are_one_with_the_rows_of_both(tmp_path):
    def step(key, *rows):
        table = Table('t', 'T', [Column('a')], [[row] for row in rows])
        return Step(key, 1.0, lambda _: [Section('Shared', ['text'], [f'Finding of {key}.'], [table])])

    def count(made):
        return [Section('Shared', findings=[f'{len(rows_of(made, "t"))} rows.'])]

    *_, last = run_steps([step('a', 1, 2), step('b', 3), Step('c', 0.0, count)], tmp_path, 'print', lambda: 1.0)
    (section,) = last.sections
    assert section.text == ['text']
    assert section.findings == ['Finding of a.', 'Finding of b.', '3 rows.']
    assert [row for table in section.tables for row in table.rows] == [[1], [2], [3]]


@pytest.mark.parametrize('content', [b'', b'{}', b'[1]', b'\xff', b'{"fingerprint": "print", "sections": [{}]}'])
def test_what_is_no_kept_step_or_of_another_run_is_made_again(tmp_path, content):
    made = []
    list(run_steps(steps(made), tmp_path, 'print', float))
    (tmp_path / 'two.json').write_bytes(content)
    list(run_steps(steps(made), tmp_path, 'print', float))
    assert made[3:] == ['two']
    list(run_steps(steps(made), tmp_path, 'another', float))
    assert made[4:] == ['one', 'two', 'three']
    forget_steps(tmp_path)
    assert not tmp_path.exists()


def test_a_fingerprint_depends_on_every_part():
    assert len({fingerprint_of('a', 1), fingerprint_of('a', 2), fingerprint_of('b', 1)}) == 3
