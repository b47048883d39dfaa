"""Which parameters have an effect with the others as they are."""

from socialcircle_ros.panel.effects import _ONLY_WITH, has_effect
from socialcircle_ros.settings import PARAMETERS

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
