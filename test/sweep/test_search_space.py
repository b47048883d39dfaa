# SPDX-License-Identifier: Apache-2.0
"""The search space of a sweep."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings import CircleSettings, FocusSettings
from socialcircle_ros.sweep.search_space import (
    Choice,
    Range,
    contains,
    described,
    grid,
    parse_dimension,
    setting_as_given,
    with_mode,
)


@pytest.mark.parametrize('end', [10**400, '1', None, [1.0, 2.0]])
def test_an_end_of_a_range_that_is_no_number_is_refused(end):
    with pytest.raises(
        SettingError, match='circle.radius_scale must be numbers that fit 64 bits|must be a number'
    ):
        Range('circle.radius_scale', 0.5, end)


@pytest.mark.parametrize(('name', 'value'), [('circle.mode', 'paper'), ('circle.window', 5)])
def test_a_single_value_is_a_choice_of_one(name, value):
    assert Choice(name, value) == Choice(name, [value])


@pytest.mark.parametrize(
    ('text', 'dimension'),
    [
        ('circle.radius_scale=0.5:0.9:0.1', Choice('circle.radius_scale', [0.5, 0.6, 0.7, 0.8, 0.9])),
        ('circle.radius_scale=1:1:1', Choice('circle.radius_scale', [1.0])),
        ('circle.window=3:7:2', Choice('circle.window', [3, 5, 7])),
        ('circle.window=3,7', Choice('circle.window', [3, 7])),
        ('circle.radius=1e-6,2,2.0', Choice('circle.radius', [1e-6, 2.0])),
        ('circle.mode=paper', Choice('circle.mode', ['paper'])),
        ('circle.vote_region=[0,0,0,0],[1,2,60,60]', Choice('circle.vote_region', [[0] * 4, [1, 2, 60, 60]])),
        ('circle.radius_scale=0.5:3', Range('circle.radius_scale', 0.5, 3.0)),
        ('focus.half_window=2:6', Range('focus.half_window', 2.0, 6.0)),
    ],
)
def test_a_text_gives_a_range_or_a_choice(text, dimension):
    assert parse_dimension(text) == dimension


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('circle.radius_scale', 'not of the form NAME=VALUES'),
        ('circle.radius_scale=', 'not of the form NAME=VALUES'),
        ('circle.scale=1,2', 'circle.scale cannot be swept; these parameters can: focus.step'),
        ('repair.largest=1,2', 'repair.largest cannot be swept'),
        ('circle.radius_scale=1:2:3:4', 'not a range of numbers'),
        ('circle.radius_scale=a:b', 'not a range of numbers'),
        ('circle.radius_scale=1:inf:1', 'not a range of numbers'),
        ('circle.mode=1:2:1', 'not a range of numbers'),
        ('circle.radius_scale=2:1:1', 'LOW ≤ HIGH'),
        ('circle.radius_scale=1:2:0', 'a STEP above 0'),
        ('circle.radius_scale=1:2:1e-9', 'take a larger step'),
        ('circle.window=3:5:0.5', 'give whole numbers'),
        ('circle.window=3:5', 'must be odd; give a step'),
        ('circle.window=3:6:1', 'circle.window must be odd, not 4'),
        ('circle.radius_scale=0:3', 'circle.radius_scale is 0, which is out of range'),
        ('circle.radius_scale=much,1', 'circle.radius_scale must be a number'),
        ('circle.mode=fast', "circle.mode cannot be 'fast'"),
        ('circle.window=[', 'not YAML'),
        ('circle.window=,', 'circle.window'),
    ],
)
def test_a_bad_dimension_is_one_sentence(text, sentence):
    with pytest.raises(SettingError) as caught:
        parse_dimension(text)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ('made', 'sentence'),
    [
        (lambda: Choice('circle.window', [4]), 'circle.window must be odd, not 4'),
        (lambda: Choice('circle.windw', [3]), 'circle.windw cannot be swept'),
        (lambda: Choice('circle.judge', None), 'circle.judge cannot be None'),
        (lambda: Choice('circle.window', []), 'circle.window has no value to try'),
        (lambda: Range('circle.window', 3, 5), 'circle.window must be odd; give a step'),
        (lambda: Range('circle.radius_scale', 3, 1), 'LOW ≤ HIGH'),
        (lambda: Range('circle.mode', 1, 2), 'not a range of numbers'),
        (lambda: grid([]), 'at least one parameter'),
    ],
)
def test_a_dimension_that_is_made_in_python_is_checked_as_well(made, sentence):
    with pytest.raises(SettingError) as caught:
        made()
    assert sentence in str(caught.value)


@given(st.integers(1, 90), st.integers(0, 60), st.sampled_from([0.1, 0.25, 0.01, 3.0]))
def test_steps_give_the_expected_decimal_numbers(low, count, step):
    high = round(low + count * step, 6)
    dimension = parse_dimension(f'circle.radius={low}:{high}:{step}')
    assert list(dimension.values) == [float(f'{low + number * step:.10g}') for number in range(count + 1)]


def test_a_grid_has_every_combination_and_changes_focus_parameters_last():
    search_space = [parse_dimension(text) for text in ('circle.window=3,5', 'focus.step=1,2')]
    found = grid(search_space)
    assert [(each['focus.step'], each['circle.window']) for each in found] == [(1, 3), (1, 5), (2, 3), (2, 5)]
    assert all(contains(search_space, values) for values in found)


@pytest.mark.parametrize(
    ('texts', 'sentence'),
    [
        (
            ['circle.radius_scale=0.5:3'],
            'has no step, and a grid needs one: add it, such as circle.radius_scale=0.5:3:0.25',
        ),
        (['focus.step=1:3'], 'focus.step=1:3:1'),
        (['circle.window=3', 'circle.window=5'], 'circle.window is given twice'),
        (['circle.radius_scale=1:99:0.01', 'circle.radius=1:99:1'], 'at most 100000 are tried: use --search.'),
    ],
)
def test_a_search_space_that_is_no_grid_is_refused(texts, sentence):
    with pytest.raises(SettingError) as caught:
        grid([parse_dimension(text) for text in texts])
    assert sentence in str(caught.value)


def test_a_search_space_contains_its_points():
    search_space = [parse_dimension('circle.radius_scale=0.5:3'), parse_dimension('circle.window=3,5')]
    assert contains(search_space, {'circle.radius_scale': 1, 'circle.window': 5})
    assert not contains(search_space, {'circle.radius_scale': 4.0, 'circle.window': 5})
    assert not contains(search_space, {'circle.radius_scale': 1.0, 'circle.window': 7})
    assert not contains(search_space, {'circle.radius_scale': 1.0})


def test_a_search_space_is_described_in_words():
    search_space = [
        parse_dimension(text)
        for text in (
            'circle.radius_scale=0.5:3:0.1', 'circle.window=3,5', 'circle.radius=1:2', 'focus.threshold=1:8:1',
            'focus.half_window=1:9:1',
        )
    ]  # fmt: skip
    assert list(described(search_space)) == [
        'circle.radius_scale in 26 steps from 0.5 to 3.0', 'circle.window 3, 5', 'circle.radius from 1 to 2',
        'focus.threshold 1, 2, 3, 4, 5, 6, 7, 8', 'focus.half_window in 9 steps from 1 to 9',
    ]  # fmt: skip


ADAPTIVE, PAPER = (
    {**FocusSettings().to_ros(), **CircleSettings(mode=mode).to_ros()} for mode in ('adaptive', 'paper')
)
WINDOW, FOCUS = Choice('circle.window', [3, 5]), Choice('focus.step', [1, 2])


def test_a_parameter_of_the_paper_s_mode_is_tried_in_this_mode():
    assert with_mode([WINDOW, FOCUS], ADAPTIVE) == [Choice('circle.mode', ['paper']), WINDOW, FOCUS]
    for space in ([FOCUS], [WINDOW, Choice('circle.mode', ['adaptive', 'paper'])]):
        assert with_mode(space, ADAPTIVE) == space
    assert with_mode([WINDOW], PAPER) == [WINDOW]


def test_the_setting_as_given_keeps_its_mode_and_leaves_out_what_has_no_effect_in_it():
    space = with_mode([WINDOW, FOCUS], ADAPTIVE)
    assert setting_as_given(space, ADAPTIVE) == {'circle.mode': 'adaptive', 'focus.step': 0}
    assert setting_as_given([WINDOW, FOCUS], PAPER) == {'circle.window': 3, 'focus.step': 0}
    modes = Choice('circle.mode', ['adaptive', 'paper'])
    assert setting_as_given([modes, WINDOW], ADAPTIVE) == {'circle.mode': 'adaptive', 'circle.window': 3}
