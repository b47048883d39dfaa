# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from naive.adaptive import distances_with_few_neighbours

from socialcircle_ros import remove_outliers
from socialcircle_ros.circle.adaptive import outliers_with_few_neighbours
from socialcircle_ros.settings import CircleSettings

HEIGHTS = st.one_of(st.just(np.nan), st.integers(-3, 3).map(float), st.sampled_from([-50.0, 7.25, 100.0]))
MAPS = st.tuples(st.integers(1, 9), st.integers(1, 12)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=HEIGHTS)
)


@settings(max_examples=300)
@given(MAPS, st.sampled_from([1, 2, 5]))
def test_they_are_those_of_the_definition_on_any_number_of_threads(heights, threads):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('socialcircle_ros.kernels.bands._LEAST', 1)
        patch.setattr('socialcircle_ros.kernels.bands.limit', threads)
        found = outliers_with_few_neighbours(heights)
    distances = distances_with_few_neighbours(heights)
    clear = np.abs(distances) > 1e-9  # a tie is left to rounding
    np.testing.assert_array_equal(found[clear], distances[clear] > 0)


def sparse(random):
    """A rough surface with a strip of glare, in which single points far off were measured."""
    heights = random.normal(0, 1, (90, 120))
    heights[:, 50:70] = np.nan
    alone = np.zeros(heights.shape, bool)
    alone[10:80:7, 55], alone[40, 60:62] = True, True
    heights[alone] = random.choice([-200.0, 300.0], alone.sum())
    return heights, alone


@pytest.mark.parametrize('judge', ['network', 'rules'])
@pytest.mark.parametrize('factor', [1, 1e-9])
def test_glare_that_is_measured_alone_is_removed_whatever_the_judge_the_unit_and_the_tilt(judge, factor):
    heights, alone = sparse(np.random.default_rng(3))
    rows, columns = np.mgrid[: heights.shape[0], : heights.shape[1]]
    for tilt in (0, 20):
        z = factor * (heights + tilt * (columns - 2 * rows))
        result = remove_outliers(z, CircleSettings(judge=judge), pitch=(1.0, 1.0))
        assert result.outliers[alone].all()
        assert np.nanmin(result.score[alone]) == 1


def test_points_with_few_neighbours_within_the_heights_of_the_others_stay():
    heights, alone = sparse(np.random.default_rng(3))
    heights[alone] = np.linspace(-3, 3, alone.sum())
    assert not outliers_with_few_neighbours(heights).any()


def test_a_surface_that_was_sampled_sparsely_stays():
    heights = np.full((60, 80), np.nan)
    heights[::2, ::2] = np.random.default_rng(1).normal(size=(30, 40))
    heights[:6, :6] = 0  # some points have neighbours
    assert not outliers_with_few_neighbours(heights).any()


def test_good_points_on_a_tilt_of_less_than_a_step_stay():
    rows, columns = np.mgrid[:200, :200]
    plane = np.round(np.random.default_rng(0).normal(0, 1, rows.shape) + 0.2 * columns)
    seen = np.hypot(columns - 80, rows - 100) < 60
    seen[90:112:3, 190] = True
    assert not outliers_with_few_neighbours(np.where(seen, plane, np.nan)).any()


@pytest.mark.parametrize('kind', [np.float32, np.float64])
def test_a_point_with_few_neighbours_on_a_plane_without_noise_stays(kind):
    rows, columns = np.mgrid[:80, :90]
    plane = (0.1 * columns - 0.3 * rows + 1000).astype(kind)
    plane[:, 60:] = np.nan
    plane[40, 75] = 7.5 - 12 + 1000
    assert not outliers_with_few_neighbours(plane).any()
    plane[40, 75] += 1
    assert outliers_with_few_neighbours(plane)[40, 75]
