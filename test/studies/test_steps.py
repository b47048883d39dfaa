# SPDX-License-Identifier: Apache-2.0
"""Steps of experiments: kept when they are finished, and not repeated."""

import numpy as np
import pytest

from socialcircle_ros.report.content import Column, Picture, Section, Table
from socialcircle_ros.studies.steps import Step, fingerprint_of, forget_steps, run_steps

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
        return [SECTION]

    return [Step(key, lambda key=key: make(key)) for key in ('one', 'two', 'three')]


def test_an_interrupted_run_continues_with_the_steps_that_are_left(tmp_path):
    made = []
    with pytest.raises(InterruptedStepError):
        list(run_steps(steps(made, fails_at='three'), tmp_path / 'kept', 'print'))
    assert made == ['one', 'two']
    found = list(run_steps(steps(made), tmp_path / 'kept', 'print'))
    assert made == ['one', 'two', 'three']
    assert [(each.done, each.total, each.resumed) for each in found] == [(1, 3, True), (2, 3, True), (3, 3, False)]
    assert found[0].seconds_left is None
    assert found[2].seconds_left == 0
    kept, new = found[2].sections[0], found[2].sections[2]
    assert kept.tables[0].texts() == new.tables[0].texts()
    assert kept.tables[0].csv() == new.tables[0].csv()
    assert kept.pictures == new.pictures
    assert (kept.title, kept.text, kept.findings, kept.warnings, kept.anchor) == (
        'Title', ['text'], ['A finding.'], ['warning'], 'anchor',
    )  # fmt: skip


@pytest.mark.parametrize('content', [b'', b'{}', b'[1]', b'\xff', b'{"fingerprint": "print", "sections": [{}]}'])
def test_what_is_no_kept_step_or_of_another_run_is_made_again(tmp_path, content):
    made = []
    list(run_steps(steps(made), tmp_path, 'print'))
    (tmp_path / 'two.json').write_bytes(content)
    list(run_steps(steps(made), tmp_path, 'print'))
    assert made[3:] == ['two']
    list(run_steps(steps(made), tmp_path, 'another'))
    assert made[4:] == ['one', 'two', 'three']
    forget_steps(tmp_path)
    assert not tmp_path.exists()


def test_a_fingerprint_depends_on_every_part():
    assert len({fingerprint_of('a', 1), fingerprint_of('a', 2), fingerprint_of('b', 1)}) == 3
