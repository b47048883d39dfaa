# SPDX-License-Identifier: Apache-2.0
"""How a lesson judges."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.circle.adaptive import (
    UNDECIDED,
    LessonJudge,
    find_outliers,
    find_probable_outliers,
    unlike,
)
from socialcircle_ros.circle.adaptive.lesson import logistic, terms
from socialcircle_ros.errors import SettingError
from socialcircle_ros.settings.lessons import TRAITS, WEIGHTS, Lesson

ALL = Lesson(
    taught_on=('good.npz',),
    spread=(0.5, 2.0),
    judge='rules',
    least=0.955,
    mean=(0.0,) * len(TRAITS),
    scale=(1.0,) * len(TRAITS),
    weights=(5.0, *(0.0,) * (WEIGHTS - 1)),
    threshold=0.7,
    check={},
)
"""Takes whatever is found for an outlier."""
NONE = replace(ALL, weights=(-5.0, *ALL.weights[1:]))


def weighing_probable(name, weight, constant):
    """A lesson on what the network finds, which weighs one trait."""
    return replace(weighing(name, weight, constant), judge='network', least=UNDECIDED)


def weighing(name, weight, constant):
    """A lesson that weighs one trait."""
    weights = [0.0] * WEIGHTS
    weights[0], weights[1 + TRAITS.index(name)] = constant, weight
    return replace(ALL, weights=tuple(weights))


@dataclass(frozen=True)
class Surface:
    heights: np.ndarray
    single: np.ndarray
    cluster: np.ndarray


@pytest.fixture(scope='module')
def surface():
    """Noise with single points and a cluster that are off."""
    heights = np.random.default_rng(3).normal(size=(90, 120)).astype(np.float32)
    single, cluster = np.zeros(heights.shape, bool), np.zeros(heights.shape, bool)
    single[20::30, 15::30] = True
    cluster[40:46, 60:67] = True
    heights[single] += 30
    heights[cluster] += 40
    return Surface(heights, single, cluster)


def test_a_lesson_that_believes_the_rules_changes_no_point(surface):
    rules, lesson = find_outliers(surface.heights), find_outliers(surface.heights, judge=LessonJudge(ALL))
    np.testing.assert_array_equal(rules.outliers, lesson.outliers)
    assert (surface.single | surface.cluster)[rules.outliers].mean() > 0.9


def test_a_lesson_decides_about_all_that_is_as_steep_as_where_it_was_taught(surface):
    heights = surface.heights.copy()
    heights[60:66, 20:27] += 3.5
    for least, falls in ((0.955, False), (0.6, True)):
        found = find_outliers(heights, judge=LessonJudge(replace(ALL, least=least))).outliers
        assert found[surface.cluster].all()
        assert found[60:66, 20:27].any() == falls


def test_a_lesson_keeps_what_it_knows_as_texture(surface):
    only_large = LessonJudge(weighing('size', 3.0, -4.0))
    found = find_outliers(surface.heights, judge=only_large).outliers
    assert found[surface.cluster].all()
    assert not found[surface.single].any()
    assert not find_outliers(surface.heights, judge=LessonJudge(NONE)).outliers.any()


@pytest.mark.parametrize('lesson', [ALL, NONE, weighing('size', 3.0, -4.0), weighing('height', -1.0, 3.0)])
def test_the_score_is_above_half_exactly_for_outliers(surface, lesson):
    heights = surface.heights.copy()
    heights[5, 7:30] = np.nan
    result = find_outliers(heights, judge=LessonJudge(lesson))
    np.testing.assert_array_equal(result.score > 0.5, result.outliers)
    np.testing.assert_array_equal(np.isnan(result.score), np.isnan(heights))
    assert np.nanmin(result.score) >= 0
    assert np.nanmax(result.score) <= 1


def likelihood_of(surface):
    """Probabilities of 0.3 for the outliers, and for a row of good points."""

    def likelihood(heights):
        probable = surface.single | surface.cluster
        probable[0] = True
        return np.where(probable & np.isfinite(heights), 77, 40).astype(np.uint8)

    return likelihood


@pytest.mark.parametrize(
    ('lesson', 'single', 'cluster', 'row'),
    [
        (weighing_probable('size', 0.0, 5.0), True, True, True),
        (weighing_probable('size', 0.0, -5.0), False, False, False),
        (weighing_probable('size', 3.0, -4.0), False, True, True),
        (weighing_probable('height', 3.0, -8.0), True, True, False),
        (weighing_probable('greatest certainty', 9.0, 0.0), True, True, True),
        (weighing_probable('greatest certainty', 9.0, -9.0), False, False, False),
    ],
)
def test_a_lesson_decides_about_communities_of_probable_points(surface, lesson, single, cluster, row):
    heights = surface.heights.copy()
    heights[5, 7:30] = np.nan
    result = find_probable_outliers(heights, likelihood_of(surface), LessonJudge(lesson))
    expected = np.zeros(heights.shape, bool)
    expected[surface.single], expected[surface.cluster], expected[0] = single, cluster, row
    np.testing.assert_array_equal(result.outliers, expected)
    np.testing.assert_array_equal(result.score > 0.5, result.outliers)
    np.testing.assert_array_equal(np.isnan(result.score), np.isnan(heights))


def test_another_unit_changes_no_point_with_a_lesson(surface):
    judge = LessonJudge(weighing('height', -1.0, 3.0))
    one = find_outliers(surface.heights, judge=judge)
    other = find_outliers(surface.heights * np.float32(2**-20), judge=judge)
    np.testing.assert_array_equal(one.outliers, other.outliers)
    np.testing.assert_array_equal(one.score, other.score)


def test_terms_are_the_traits_and_their_products():
    traits = np.arange(2.0 * len(TRAITS)).reshape(2, -1) / 10
    made = terms(traits, np.full(len(TRAITS), 0.5), np.full(len(TRAITS), 2.0))
    assert made.shape == (2, WEIGHTS)
    standard = (traits - 0.5) / 2
    np.testing.assert_array_equal(made[:, 0], 1)
    np.testing.assert_allclose(made[:, 1 : 1 + len(TRAITS)], standard)
    np.testing.assert_allclose(made[:, 1 + len(TRAITS)], standard[:, 0] ** 2)
    np.testing.assert_allclose(made[:, -2], standard[:, -2] * standard[:, -1])
    assert np.abs(terms(1e9 * traits, np.zeros(len(TRAITS)), np.ones(len(TRAITS)))).max() == 16
    np.testing.assert_allclose(logistic(np.array([-1e9, 0, 1e9])), [0, 0.5, 1], atol=1e-9)


@pytest.mark.parametrize(
    ('spread', 'told'), [(0.1, '0.2 times that'), (0.3, None), (3.9, None), (20.0, '10 times as large as that')]
)
def test_a_cloud_of_another_surface_scale_is_told(spread, told):
    warnings = unlike(ALL, spread)
    assert bool(warnings) == (told is not None)
    assert all(told in warning for warning in warnings)


@pytest.mark.parametrize(('lesson', 'falls'), [(ALL, True), (NONE, False)])
def test_a_lesson_decides_about_islands_far_off_that_the_network_misses(lesson, falls):
    heights = np.random.default_rng(3).normal(size=(60, 70)).astype(np.float32)
    heights[20:26, 30:37] += 100
    judge = LessonJudge(replace(lesson, judge='network', least=UNDECIDED))
    result = find_probable_outliers(heights, lambda given: np.zeros(given.shape, np.uint8), judge)
    expected = np.zeros(heights.shape, bool)
    expected[20:26, 30:37] = falls
    np.testing.assert_array_equal(result.outliers, expected)
    np.testing.assert_array_equal(result.score > 0.5, expected)


@pytest.mark.parametrize(
    ('judge', 'settings', 'told'),
    [
        ('network', {}, []),
        ('network', {'judge': 'rules'}, ['circle.judge has no effect']),
        ('network', {'depth_of_field': 3.0}, ['the depth of field has no effect']),
        ('rules', {}, []),
        ('rules', {'judge': 'rules'}, []),
        ('rules', {'depth_of_field': 3.0}, []),
    ],
)
def test_a_lesson_uses_what_it_was_taught_with(surface, tmp_path, judge, settings, told):
    path = tmp_path / 'part.teach'
    path.write_text(replace(ALL, judge=judge).to_text())
    result = remove_outliers(surface.heights, CircleSettings(lesson=str(path), **settings), pitch=(1.0, 2.0))
    assert ('network' in result.times_ms) == (judge == 'network')
    assert result.outliers[surface.cluster].any()
    assert len(result.warnings) == len(told)
    for warning, start in zip(result.warnings, told, strict=True):
        assert warning.startswith(start)


def test_settings_name_the_lesson_by_its_path(surface, tmp_path):
    path = tmp_path / 'part.teach'
    path.write_text(NONE.to_text())
    settings = CircleSettings(mode='adaptive', lesson=str(path))
    path.unlink()  # what a change was checked with stays in force
    heights = 10 * surface.heights
    result = remove_outliers(heights, settings, pitch=(1.0, 2.0))
    assert not result.outliers.any()
    assert 'unlike that of circle.lesson' in result.warnings[0]
    with pytest.raises(SettingError, match=r'part\.teach cannot be used \(No such file or directory\)'):
        CircleSettings(mode='adaptive', lesson=str(path))
