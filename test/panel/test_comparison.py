# SPDX-License-Identifier: Apache-2.0
"""Two settings on one cloud."""

import numpy as np
import pytest
from examples import cloud

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.panel import colours, markup
from socialcircle_ros.panel.comparison import compare
from socialcircle_ros.settings import PARAMETERS

DEFAULTS = {name: row.default for name, row in PARAMETERS.items()}


def test_the_two_results_and_their_difference():
    strict = DEFAULTS | {'circle.mode': 'paper'}
    found = compare(cloud(), ('strict', strict), ('gentle', strict | {'circle.radius_scale': 100.0}))
    assert found.a.measurement.values.outliers == 26
    assert found.b.measurement.values.outliers == 0
    assert found.counts == (0, 26, 0)
    assert found.differing == (('circle.radius_scale', 1.0, 100.0),)
    picture = found.picture()
    assert np.count_nonzero((picture == colours.ONLY_A).all(axis=2)) == 26


@pytest.mark.parametrize(('unit', 'text'), [('um', '500 nm'), (None, '0.5 (unit not known)')])
def test_the_radii_have_the_unit_of_the_cloud(unit, text):
    paper = DEFAULTS | {'circle.mode': 'paper', 'circle.radius': 0.5}
    table = markup.comparison(compare(cloud(), ('a', paper), ('b', DEFAULTS)), unit)
    assert f'<td>radius</td><td class="sc-num">{text}<' in table


def test_the_depth_of_field_of_a_stack_applies_to_both():
    known = {'circle.mode': 'adaptive'}
    given = known | {'circle.depth_of_field': 0.001}
    found = compare(cloud(), ('a', DEFAULTS | known), ('b', DEFAULTS | given), 1e9)
    assert found.a.measurement.values.outliers == 0
    assert found.b.measurement.values.outliers > 0


def test_two_equal_settings_give_the_same_outliers():
    found = compare(cloud(), ('a', DEFAULTS), ('b', DEFAULTS | {'output.mask': False}))
    assert found.counts == (26, 0, 0)
    assert np.count_nonzero((found.picture() == colours.BOTH).all(axis=2)) == 26
    assert found.differing == (('output.mask', True, False),)


def test_an_invalid_setting_is_refused():
    with pytest.raises(SocialCircleError, match=r'circle\.window'):
        compare(cloud(), ('a', DEFAULTS), ('b', DEFAULTS | {'circle.window': 4}))
