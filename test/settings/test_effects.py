# SPDX-License-Identifier: Apache-2.0
"""Which parameters have an effect."""

import pytest
from examples import surface

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.settings import PARAMETERS
from socialcircle_ros.settings.effects import _ONLY_WITH, has_effect

OTHERS = {
    'circle.window': 5,
    'circle.vote_region': (0, 20, 20, 20),
    'circle.radius': 0.3,
    'circle.radius_scale': 0.5,
    'circle.depth_of_field': 1.0,
    'circle.not_measured': '30',
}


@pytest.mark.parametrize('mode', ['paper', 'adaptive'])
@pytest.mark.parametrize('name', OTHERS)
def test_a_parameter_without_effect_changes_nothing(mode, name):
    if has_effect(name, {'circle.mode': mode}):
        pytest.skip('it has an effect')
    field = name.removeprefix('circle.')
    found, other = (
        remove_outliers(surface(), CircleSettings(mode=mode, **values)) for values in ({}, {field: OTHERS[name]})
    )
    assert (found.outliers == other.outliers).all()


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


def test_a_parameter_has_an_effect_where_it_is_not_known_what_it_depends_on():
    assert has_effect('circle.window', {'circle.window': 3})
    assert has_effect('circle.flank', {'circle.flank': 1.0})


def test_a_parameter_has_no_effect_where_the_one_that_it_depends_on_has_none():
    values = {'circle.mode': 'paper', 'circle.judge': 'network'}
    assert not has_effect('circle.provider', values)
    assert has_effect('circle.provider', {**values, 'circle.mode': 'adaptive'})
