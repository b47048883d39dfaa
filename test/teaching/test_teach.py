# SPDX-License-Identifier: Apache-2.0
"""Lessons from good clouds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from good_parts import part, pitted

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.teaching import page
from socialcircle_ros.teaching.examples import CHECKED
from socialcircle_ros.teaching.teach import LessonCheck, _refusal, teach


@pytest.fixture(scope='module', params=['network', 'rules'])
def taught(request):
    """A lesson about a pitted part, and what its steps told."""
    told = []
    settings = CircleSettings(judge=request.param)
    return teach([part(pitted())], lambda done, number: told.append((done, number)), settings), told


def removed_with(heights, lesson, folder):
    """The mask of what a lesson removes."""
    path = folder / 'part.teach'
    path.write_text(lesson.to_text())
    return remove_outliers(heights, CircleSettings(lesson=str(path)), pitch=(1.0, 2.0)).outliers


def test_a_lesson_keeps_the_texture_of_the_part_and_finds_more(taught):
    teaching, _ = taught
    assert teaching.before.removed > 0.005
    assert teaching.after.removed < 0.0005
    assert teaching.after.f1 > teaching.before.f1 + 0.1
    assert teaching.refusal == ''


def test_a_lesson_holds_for_another_part_of_that_kind_in_another_unit(taught, tmp_path):
    heights = pitted(150, 170, seed=5, pits=20)
    heights[40:50, 60:70] += 40
    lesson = taught[0].lesson
    without = remove_outliers(heights, CircleSettings(judge=lesson.judge), pitch=(1.0, 2.0)).outliers
    found = removed_with(heights, lesson, tmp_path)
    put_in = np.zeros(heights.shape, bool)
    put_in[40:50, 60:70] = True
    assert without[~put_in].mean() > 0.005
    assert found[~put_in].mean() < without[~put_in].mean() / 5
    assert found[put_in].mean() > 0.9
    np.testing.assert_array_equal(removed_with(heights * 2.0**-30, lesson, tmp_path), found)


def test_the_same_clouds_give_the_same_lesson(taught):
    settings = CircleSettings(judge=taught[0].lesson.judge)
    assert teach([part(pitted())], settings=settings).lesson == taught[0].lesson


def test_progress_counts_to_its_end(taught):
    told = taught[1]
    assert [done for done, _ in told] == list(range(1, told[0][1] + 1))


def test_a_lesson_says_what_it_was_taught_on_and_what_its_check_found(taught):
    lesson = taught[0].lesson
    assert lesson.taught_on == ('part',)
    assert lesson.check['f1_after'] == taught[0].after.f1
    assert lesson.check['removed_before'] == taught[0].before.removed
    assert 1.2 < lesson.spread[0] <= lesson.spread[1] < 1.6  # differences of points with a standard deviation of 1


def test_a_lesson_that_does_not_help_is_refused():
    smooth = np.random.default_rng(1).normal(size=(140, 150))
    assert 'would change little' in teach([part(smooth)], settings=CircleSettings(judge='rules')).refusal


@pytest.mark.parametrize(
    ('f1', 'removed', 'reason'),
    [
        (
            0.620,
            0.00091,
            'do harm: in the fields kept back 0.091 % instead of 0.010 % of the good points would be',
        ),
        (0.5, 1e-9, 'F1 would be 0.500 instead of 0.615. '),
        (0.600, 0.0, 'do harm: in the fields kept back F1 would be 0.600 instead of 0.615. '),
        (0.5, 0.01, 'F1 would be 0.500 instead of 0.615 and 1.000 % instead of 0.010 % of the good points would'),
        (
            0.616,
            0.0001,
            'change little: in the fields kept back F1 would be 0.616 instead of 0.615 and 0.010 % instead',
        ),
    ],
)
def test_a_refusal_names_the_figure_that_is_worse(f1, removed, reason):
    before, after = (
        LessonCheck((SimpleNamespace(f1=score),), share) for score, share in ((0.615, 0.0001), (f1, removed))
    )
    assert reason in _refusal(before, after)


def test_a_check_says_nothing_where_no_outlier_can_be_found():
    unseen, seen = (LessonCheck((SimpleNamespace(f1=f1),), 0.0) for f1 in (0.002, 0.5))
    assert 'The check says nothing' in _refusal(unseen, unseen)
    assert _refusal(unseen, seen) == ''


def test_the_rules_find_what_is_taught_where_a_depth_of_field_is_known():
    heights = pitted()
    stack, network = replace(part(heights), depth_of_field=3.0), CircleSettings(judge='network')
    assert teach([part(heights), stack], settings=network).lesson.judge == 'rules'
    assert teach([part(heights), part(heights)], settings=network).lesson.judge == 'network'


def test_many_points_that_stand_out_are_told(taught):
    assert taught[0].warnings[0].startswith('In the good clouds ')
    assert 'stand out and count as the texture of the part (part, part 1 of 2: ' in taught[0].warnings[0]
    assert taught[0].warnings[0].endswith('; if they are outliers, teach on clouds without them.')


def test_outliers_of_the_good_cloud_are_told_and_not_taught_as_good(tmp_path):
    heights = np.random.default_rng(1).normal(size=(140, 150))
    heights[20:23, 30:33] += 60
    teaching = teach([part(heights)])
    assert teaching.warnings[0].startswith(
        'The good clouds seem to have outliers of their own: 9 points stand out'
    )
    assert removed_with(heights, teaching.lesson, tmp_path)[20:23, 30:33].all()


def test_the_page_shows_figures_warnings_and_pictures(taught):
    pytest.importorskip('matplotlib')
    pytest.importorskip('jinja2')
    html = page.lesson_page(replace(taught[0], warnings=['Look at them.']))
    assert html.count('src="data:image') == 2 * len(taught[0].fields)
    assert 'Look at them.' in html
    assert 'The lesson helps' in html
    table = page._figures(taught[0])
    assert len(table.rows) == 1 + len(CHECKED)
    assert table.rows[0][3] == taught[0].after.removed
