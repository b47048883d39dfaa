"""Which parameters have an effect."""

import pytest
from examples import surface

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.settings import PARAMETERS
from socialcircle_ros.settings.effects import has_effect

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


@pytest.mark.parametrize(
    ('name', 'values', 'expected'),
    [
        ('circle.window', {}, True),
        ('circle.window', {'circle.mode': 'adaptive'}, False),
        ('circle.depth_of_field', {}, False),
        ('circle.mode', {'circle.mode': 'adaptive'}, True),
        ('repair.largest', {}, False),
        ('repair.largest', {'output.repaired': True}, True),
        ('stack.z_step', {'stack.z_source': 'joint_states'}, False),
        ('stack.joint', {'stack.z_source': 'joint_states'}, True),
        ('stack.joint', {}, False),
    ],
)
def test_the_effect_depends_on_the_other_values(name, values, expected):
    assert has_effect(name, values) == expected


def test_every_parameter_has_an_answer():
    assert {has_effect(name, {}) for name in PARAMETERS} == {True, False}
