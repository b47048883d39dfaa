# SPDX-License-Identifier: Apache-2.0
"""Which parameters have an effect."""

import dataclasses

import pytest
from examples import surface

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.settings import PARAMETERS, effects
from socialcircle_ros.settings.effects import _ONLY_WITH, has_effect
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson

OTHERS = {
    'circle.window': 5,
    'circle.vote_region': (0, 20, 20, 20),
    'circle.radius': 0.3,
    'circle.radius_scale': 0.5,
    'circle.depth_of_field': 100.0,
    'circle.not_measured': '30',
}


@pytest.mark.parametrize('mode', ['paper', 'adaptive'])
@pytest.mark.parametrize('name', OTHERS)
def test_a_parameter_has_an_effect_where_another_value_changes_the_result(mode, name):
    field = name.removeprefix('circle.')
    found, other = (
        remove_outliers(surface(), CircleSettings(mode=mode, **values)) for values in ({}, {field: OTHERS[name]})
    )
    changes = (found.seed, found.radius) != (other.seed, other.radius) or (found.outliers != other.outliers).any()
    assert changes == has_effect(name, {'circle.mode': mode})


DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}


def test_every_parameter_is_one_of_the_node_and_depends_on_a_value_that_the_node_takes():
    for name, (other, value) in _ONLY_WITH.items():
        assert name in PARAMETERS
        row = PARAMETERS[other]
        assert type(row.default) is type(value)
        assert not row.limits.choices or value in row.limits.choices


def test_the_vote_region_is_of_mode_paper_and_the_depth_of_field_of_mode_adaptive():
    for mode in ('paper', 'adaptive'):
        values = DEFAULTS | {'circle.mode': mode}
        assert has_effect('circle.vote_region', values) == (mode == 'paper')
        assert has_effect('circle.depth_of_field', values) == (mode == 'adaptive')
        assert has_effect('circle.not_measured', values)


@pytest.mark.parametrize(
    ('group', 'values', 'without'),
    [
        ('stack', {'stack.z_source': 'step'}, {'stack.joint', 'stack.latency'}),
        ('stack', {'stack.z_source': 'joint_states'}, {'stack.z_start', 'stack.z_step', 'stack.check_stamps'}),
        ('repair', {'output.repaired': True}, set()),
        ('repair', {'output.repaired': False}, {name for name in PARAMETERS if name.startswith('repair.')}),
        ('output', {'circle.mode': 'adaptive'}, set()),
        ('output', {'circle.mode': 'paper'}, {'output.score'}),
    ],
)
def test_what_stacks_repair_and_outputs_do_not_use_has_no_effect(group, values, without):
    names = [name for name in PARAMETERS if name.startswith(f'{group}.')]
    assert {name for name in names if not has_effect(name, DEFAULTS | values)} == without


def test_a_parameter_has_an_effect_where_it_is_not_known_what_it_depends_on():
    assert has_effect('circle.window', {'circle.window': 3})
    assert has_effect('circle.flank', {'circle.flank': 1.0})


NUMBERS = (0.0,) * len(TRAITS), (1.0,) * len(TRAITS), (0.0,) * WEIGHTS
LESSONS = {judge: Lesson(('a',), (1.0, 2.0), judge, 0.2, *NUMBERS, 0.5, {}) for judge in ('network', 'rules')}


@pytest.mark.parametrize('mode', ['paper', 'adaptive'])
@pytest.mark.parametrize('judge', ['network', 'rules'])
@pytest.mark.parametrize('depth', [None, 1.5])
@pytest.mark.parametrize('lesson', [None, 'network', 'rules'])
def test_the_judge_and_what_computes_it_have_an_effect_where_the_filter_uses_them(
    tmp_path, mode, judge, depth, lesson
):
    path = tmp_path / 'part.teach'
    if lesson:
        path.write_text(LESSONS[lesson].to_text())
    settings = CircleSettings(mode=mode, judge=judge, depth_of_field=depth, lesson=str(path) if lesson else '')
    values = settings.to_ros()
    for shown in (values, {name: str(value) for name, value in values.items()}):  # the page of a report has texts
        assert has_effect('circle.provider', shown) == settings.uses_network
        assert has_effect('circle.lesson', shown) == (mode == 'adaptive')
        others = [
            CircleSettings(**{**fields_of(settings), 'judge': each}).finds_by for each in ('network', 'rules')
        ]
        assert has_effect('circle.judge', shown) == (mode == 'adaptive' and others[0] != others[1])
        uses_depth = mode == 'adaptive' and not (lesson and settings.finds_by == 'network')
        assert has_effect('circle.depth_of_field', shown) == uses_depth


def fields_of(settings):
    return {each.name: getattr(settings, each.name) for each in dataclasses.fields(settings)}


def test_a_parameter_has_an_effect_where_its_lesson_is_on_another_machine():
    values = DEFAULTS | {'circle.lesson': '/elsewhere/part.teach'}
    assert has_effect('circle.provider', values)
    assert has_effect('circle.depth_of_field', values)
    assert not has_effect('circle.judge', values)


def test_a_lesson_is_opened_only_where_its_content_decides(monkeypatch):
    opened = []
    monkeypatch.setattr(effects, 'read_lesson', lambda path: opened.append(path) or LESSONS['rules'])
    values = DEFAULTS | {'circle.lesson': 'part.teach'}
    for name in values:
        has_effect(name, values | {'circle.mode': 'paper'})
    assert not opened
    for name in values:
        has_effect(name, values)
    assert len(opened) == 2  # circle.provider and circle.depth_of_field
    has_effect('circle.depth_of_field', DEFAULTS)
    assert len(opened) == 2


def test_parameters_of_another_mode_that_are_set_are_told():
    assert CircleSettings(window=5, radius=1.0).without_effect() == ('circle.window', 'circle.radius')
    assert CircleSettings(mode='paper', window=5).without_effect() == ()
