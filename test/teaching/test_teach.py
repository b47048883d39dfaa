# SPDX-License-Identifier: Apache-2.0
"""Lessons from good clouds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from good_parts import drilled, from_holes, part, pitted

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.metrics.scores import tally
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
    assert teaching.after.removed < 0.0015  # two of 30 pits
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
    assert lesson.check['f1_at_edges_after'] == taught[0].after.f1_at_edges
    assert lesson.check['removed_before'] == taught[0].before.removed
    assert 1.2 < lesson.spread[0] <= lesson.spread[1] < 1.6  # differences of points with a standard deviation of 1


def test_a_lesson_that_does_not_help_is_refused():
    smooth = np.random.default_rng(1).normal(size=(140, 150))
    assert 'would change little' in teach([part(smooth)], settings=CircleSettings(judge='rules')).refusal


def checked(f1, removed, at_edges=0.6):
    """A check with this F1 of every kind but those at edges."""
    scores = [SimpleNamespace(f1=at_edges if kind.at_edges else f1) for kind in CHECKED]
    return LessonCheck(tuple(scores), removed)


@pytest.mark.parametrize(
    ('f1', 'at_edges', 'removed', 'reason'),
    [
        (0.7, 0.6, 0.00091, 'do harm: in the fields kept back 0.091 % instead of 0.010 % of the good points'),
        (0.5, 0.6, 1e-9, 'F1 would be 0.525 instead of 0.600. '),
        (0.59, 0.6, 0.0, 'do harm: in the fields kept back F1 would be 0.593 instead of 0.600. '),
        (0.5, 0.6, 0.01, 'F1 would be 0.525 instead of 0.600 and 1.000 % instead of 0.010 % of the good points'),
        (
            0.9,
            0.52,
            0.0,
            'harm: in the fields kept back F1 at steps and beside holes would be 0.520 instead of',
        ),
        (
            0.601,
            0.6,
            0.0001,
            'change little: in the fields kept back F1 would be 0.601 instead of 0.600 and 0.010',
        ),
    ],
)
def test_a_refusal_names_the_figure_that_is_worse(f1, at_edges, removed, reason):
    assert reason in _refusal(checked(0.6, 0.0001), checked(f1, removed, at_edges))


def test_a_lesson_that_helps_is_not_refused_for_little_at_edges():
    assert _refusal(checked(0.6, 0.0001), checked(0.7, 0.0001, at_edges=0.56)) == ''


def test_a_check_says_nothing_where_no_outlier_can_be_found():
    unseen, seen = checked(0.002, 0.0, at_edges=0.0), checked(0.5, 0.0)
    assert 'The check says nothing' in _refusal(unseen, unseen)
    assert _refusal(unseen, seen) == ''


def test_the_rules_find_what_is_taught_where_a_depth_of_field_is_known():
    heights = pitted()
    stack, network = replace(part(heights), depth_of_field=3.0), CircleSettings(judge='network')
    assert teach([part(heights), stack], settings=network).lesson.judge == 'rules'
    assert teach([part(heights), part(heights)], settings=network).lesson.judge == 'network'


@pytest.mark.parametrize('tilt', [0.0, 12.0])
def test_a_tilt_changes_hardly_what_is_taught(tilt):
    heights = pitted()
    y, x = np.mgrid[: heights.shape[0], : heights.shape[1]]
    teaching = teach([part(heights + tilt * (x + 0.63 * y), dtype=np.float64)])
    assert teaching.refusal == ''
    assert teaching.before.f1 > 0.5
    assert teaching.after.f1 > teaching.before.f1 + 0.1


def test_outliers_beside_holes_and_steps_are_found_with_a_lesson_too(tmp_path):
    lesson = teach([part(drilled(seed=seed)) for seed in range(4)]).lesson
    heights = drilled(seed=9)
    generator = np.random.default_rng(3)
    beside = np.flatnonzero(np.isfinite(heights) & (np.abs(from_holes(heights.shape) - 11) < 3))
    outlier = np.zeros(heights.shape, bool)
    outlier.flat[generator.choice(beside, len(beside) // 8, replace=False)] = True
    heights[outlier] += generator.choice([-1, 1], outlier.sum()) * generator.uniform(15, 80, outlier.sum())
    without = remove_outliers(heights, pitch=(1.0, 2.0)).outliers
    found = removed_with(heights, lesson, tmp_path)
    scores = [tally(mask, outlier, np.isfinite(heights)).scores for mask in (without, found)]
    assert scores[1].f1 > scores[0].f1 + 0.1
    assert found[outlier].mean() > 0.6


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
