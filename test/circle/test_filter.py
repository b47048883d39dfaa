# SPDX-License-Identifier: Apache-2.0
"""`remove_outliers`: vote, radius and expansion together, as the Python API shows them."""

import math

import numpy as np
import pytest
from clouds import LAYOUTS, Recipe, flat, grid, laid_out, recipes
from hypothesis import example, given, settings
from hypothesis import strategies as st
from naive import circle as naive

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.errors import CloudError, NoRadiusError, NoSeedError

WINDOWS = (3, 5, 7, 9)


@st.composite
def recipe_and_settings(draw):
    """A recipe and any settings. The vote region may extend beyond the cloud."""
    recipe = draw(recipes())
    region = st.tuples(
        st.integers(0, recipe.rows - 1),
        st.integers(0, recipe.columns - 1),
        st.integers(1, 24),
        st.integers(1, 24),
    )
    return recipe, CircleSettings(
        mode='paper',
        window=draw(st.sampled_from(WINDOWS)),
        vote_region=draw(st.none() | region),
        radius=draw(st.none() | st.sampled_from([1.5, 2.2, 3.0, 5.0, 0.1, 1e300])),
        radius_scale=draw(st.sampled_from([1.0, 1.0, 1.0, 0.7, 1.3, 2.0, 0.01, 100.0])),
    )


def assert_as_the_reference(xyz, chosen):
    """The result, or the refusal, is that of the reference bit for bit."""
    before = xyz.tobytes()
    try:
        expected = naive.remove_outliers(xyz, chosen)
    except CloudError as refusal:
        with pytest.raises(type(refusal)):
            remove_outliers(xyz, chosen)
    else:
        result = remove_outliers(xyz, chosen)
        assert result.seed == expected.seed
        assert result.radius == expected.radius
        np.testing.assert_array_equal(result.inliers, expected.inliers)
        np.testing.assert_array_equal(result.outliers, expected.outliers)
    assert xyz.tobytes() == before


@settings(max_examples=1000, deadline=None)
@given(recipe_and_settings())
@example((Recipe(1, 1), CircleSettings(mode='paper', radius=1.0)))
@example((Recipe(12, 13, 'float32', 'noise'), CircleSettings(mode='paper', radius=0.1, radius_scale=11.0)))
@example(
    (Recipe(12, 13, 'float32', 'noise', unit='metres'), CircleSettings(mode='paper', window=5, radius_scale=0.7))
)
def test_result_is_that_of_the_reference_bit_for_bit(drawn):
    recipe, chosen = drawn
    assert_as_the_reference(recipe.cloud(), chosen)


@settings(max_examples=10, deadline=None)
@given(recipes(3, 130, least_columns=60), st.sampled_from(WINDOWS))
def test_result_with_a_region_smaller_than_the_cloud_is_that_of_the_reference(recipe, window):
    assert_as_the_reference(recipe.cloud(), CircleSettings(mode='paper', window=window))


@settings(max_examples=200, deadline=None)
@given(recipes(16, 16))
def test_every_measured_point_is_inlier_or_outlier_and_no_other_point_is(recipe):
    xyz = recipe.cloud()
    try:
        result = remove_outliers(xyz, CircleSettings(mode='paper', window=3))
    except CloudError:
        return
    measured = np.isfinite(xyz).all(axis=2)

    assert not (result.inliers & result.outliers).any()
    np.testing.assert_array_equal(result.inliers | result.outliers, measured)


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('dtype', ['float32', 'float64'])
def test_the_layout_in_memory_does_not_matter_and_the_cloud_stays_as_it_was(layout, dtype):
    contiguous = Recipe(13, 11, dtype, 'noise', clusters=2, missing=0.1, random=5).cloud()
    expected = remove_outliers(contiguous, CircleSettings(mode='paper', window=5))
    xyz = laid_out(contiguous, layout)

    result = remove_outliers(xyz, CircleSettings(mode='paper', window=5))

    np.testing.assert_array_equal(result.inliers, expected.inliers)
    np.testing.assert_array_equal(result.outliers, expected.outliers)
    assert (result.seed, result.radius) == (expected.seed, expected.radius)
    np.testing.assert_array_equal(xyz, contiguous)


def test_the_same_cloud_gives_the_same_result():
    xyz = Recipe(20, 24, 'float32', 'noise', clusters=3, spikes=0.1).cloud()

    first = remove_outliers(xyz, CircleSettings(mode='paper', window=5))
    second = remove_outliers(xyz, CircleSettings(mode='paper', window=5))

    np.testing.assert_array_equal(first.inliers, second.inliers)
    assert (first.seed, first.radius) == (second.seed, second.radius)


# The result


@pytest.mark.parametrize('window', WINDOWS)
def test_all_points_of_a_flat_grid_are_kept_with_radius_root_5_pitches(window):
    result = remove_outliers(flat(24, 25, 0.5), CircleSettings(mode='paper', window=window))

    k = window // 2
    assert result.inliers.all()
    assert not result.outliers.any()
    assert result.radius == math.sqrt(5 * k * k * 0.25)


@pytest.mark.parametrize('height', [0.0, -4.0])
def test_points_at_or_below_height_0_are_kept(height):
    assert remove_outliers(grid(np.full((9, 8), height)), CircleSettings(mode='paper')).inliers.all()


def test_a_cluster_apart_from_the_surface_is_removed():
    heights = np.zeros((20, 24))
    heights[4:7, 5:9] = 10.0
    heights[12, 20] = -30.0

    result = remove_outliers(grid(heights), CircleSettings(mode='paper'))

    np.testing.assert_array_equal(result.outliers, heights != 0.0)
    np.testing.assert_array_equal(result.inliers, heights == 0.0)


def test_a_second_surface_beyond_a_steep_step_is_removed():
    heights = np.zeros((10, 20))
    heights[:, 12:] = 2.0  # two pitches, a slope of 63°: not inside the circle

    result = remove_outliers(grid(heights), CircleSettings(mode='paper', vote_region=(0, 0, 10, 10)))

    np.testing.assert_array_equal(result.inliers, heights == 0.0)


def test_points_that_are_not_measured_are_neither_kept_nor_removed():
    xyz = flat(8, 8)
    xyz[0, 0, 0], xyz[1, 1, 1], xyz[2, 2, 2] = np.nan, np.inf, -np.inf

    result = remove_outliers(xyz, CircleSettings(mode='paper'))

    for place in ((0, 0), (1, 1), (2, 2)):
        assert not result.inliers[place]
        assert not result.outliers[place]
    assert result.inliers.sum() == 61


def test_seed_comes_from_the_vote_region():
    heights = np.zeros((12, 20))
    heights[:, 10:] = 50.0

    low = remove_outliers(grid(heights), CircleSettings(mode='paper', vote_region=(0, 0, 12, 8)))
    high = remove_outliers(grid(heights), CircleSettings(mode='paper', vote_region=(0, 12, 12, 8)))

    np.testing.assert_array_equal(low.inliers, heights == 0.0)
    np.testing.assert_array_equal(high.inliers, heights == 50.0)
    assert low.seed[1] < 8
    assert high.seed[1] >= 12


def test_vote_region_is_clipped_to_the_cloud():
    xyz = Recipe(12, 14, surface='noise').cloud()

    clipped = remove_outliers(xyz, CircleSettings(mode='paper', vote_region=(5, 6, 60, 60)))
    inside = remove_outliers(xyz, CircleSettings(mode='paper', vote_region=(5, 6, 7, 8)))

    assert clipped.seed == inside.seed


def test_a_given_radius_takes_the_place_of_the_ring():
    heights = np.zeros((8, 8))
    heights[:, 4:] = 3.0

    narrow = remove_outliers(grid(heights), CircleSettings(mode='paper', vote_region=(0, 0, 8, 4), radius=3.0))
    wide = remove_outliers(grid(heights), CircleSettings(mode='paper', vote_region=(0, 0, 8, 4), radius=3.2))

    assert narrow.radius == 3.0
    np.testing.assert_array_equal(narrow.inliers, heights == 0.0)
    assert wide.inliers.all()


def test_a_given_radius_needs_no_ring():
    result = remove_outliers(flat(1, 2), CircleSettings(mode='paper', radius=1.5))

    assert result.inliers.all()


def test_a_given_radius_is_taken_in_the_cloud_s_own_dtype():
    result = remove_outliers(flat(4, 4, dtype='float32'), CircleSettings(mode='paper', radius=1.1))

    assert result.radius == float(np.sqrt(np.float32(1.1) * np.float32(1.1)))


@pytest.mark.parametrize('radius', [None, 1.5])
def test_radius_scale_multiplies_the_radius_given_or_found(radius):
    xyz = flat(12, 12)
    plain = remove_outliers(xyz, CircleSettings(mode='paper', radius=radius)).radius

    halved = remove_outliers(xyz, CircleSettings(mode='paper', radius=radius, radius_scale=0.5)).radius

    assert halved == plain / 2


def test_a_radius_below_the_pitch_keeps_only_the_seed():
    result = remove_outliers(flat(12, 12), CircleSettings(mode='paper', radius_scale=0.1))

    assert result.inliers.sum() == 1
    assert result.inliers[result.seed]


def test_a_single_measured_point_is_the_seed():
    heights = np.full((5, 6), np.nan)
    heights[3, 4] = 1.0

    result = remove_outliers(grid(heights), CircleSettings(mode='paper', radius=1.0))

    assert result.seed == (3, 4)
    np.testing.assert_array_equal(result.inliers, heights == 1.0)
    assert not result.outliers.any()


def test_result_has_plain_python_types():
    result = remove_outliers(flat(9, 8, dtype='float32'), CircleSettings(mode='paper'))

    assert result.inliers.dtype == result.outliers.dtype == bool
    assert result.inliers.shape == result.outliers.shape == (9, 8)
    assert [type(number) for number in result.seed] == [int, int]
    assert type(result.radius) is float


# Refusals


@pytest.mark.parametrize('shape', [(4, 5), (20,), (4, 5, 2), (4, 5, 4), (1, 4, 5, 3), (0, 5, 3), (4, 0, 3)])
def test_a_cloud_of_another_shape_is_refused_and_the_shape_is_named(shape):
    with pytest.raises(CloudError, match=', '.join(map(str, shape))):
        remove_outliers(np.zeros(shape), CircleSettings(mode='paper'))


@pytest.mark.parametrize('dtype', ['float16', 'int32', 'uint8', 'complex64', 'bool'])
def test_a_cloud_of_another_data_type_is_refused_and_the_type_is_named(dtype):
    with pytest.raises(CloudError, match=dtype):
        remove_outliers(np.zeros((4, 5, 3), dtype=dtype), CircleSettings(mode='paper'))


@pytest.mark.parametrize('region', [None, (0, 0, 2, 2)])
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_a_cloud_without_a_measured_point_has_no_seed(value, region):
    with pytest.raises(NoSeedError, match='measured'):
        remove_outliers(np.full((4, 5, 3), value), CircleSettings(mode='paper', vote_region=region))


@pytest.mark.parametrize('region', [(4, 0, 2, 2), (0, 5, 2, 2), (90, 90, 60, 60)])
def test_a_vote_region_outside_the_cloud_has_no_seed(region):
    with pytest.raises(NoSeedError, match='region'):
        remove_outliers(flat(4, 5), CircleSettings(mode='paper', vote_region=region))


def test_a_vote_region_without_a_measured_point_has_no_seed():
    xyz = flat(8, 8)
    xyz[:4, :4] = np.nan

    with pytest.raises(NoSeedError, match='region'):
        remove_outliers(xyz, CircleSettings(mode='paper', vote_region=(0, 0, 4, 4)))


def test_a_seed_without_a_ring_has_no_radius():
    with pytest.raises(NoRadiusError, match='ring'):
        remove_outliers(flat(2, 2), CircleSettings(mode='paper'))


# The adaptive mode


ADAPTIVE = CircleSettings(mode='adaptive')


@settings(max_examples=200, deadline=None)
@given(recipes(30, 34))
def test_in_the_adaptive_mode_every_measured_point_is_inlier_or_outlier_and_no_other_point_is(recipe):
    xyz = recipe.cloud()
    before = xyz.tobytes()
    measured = np.isfinite(xyz).all(axis=2)
    if not measured.any():
        with pytest.raises(NoSeedError, match='measured'):
            remove_outliers(xyz, ADAPTIVE)
        return

    with np.errstate(all='ignore'):
        result = remove_outliers(xyz, ADAPTIVE)

    assert xyz.tobytes() == before
    assert not (result.inliers & result.outliers).any()
    np.testing.assert_array_equal(result.inliers | result.outliers, measured)
    np.testing.assert_array_equal(np.isnan(result.score), ~measured)
    np.testing.assert_array_equal(result.score > 0.5, result.outliers)
    assert measured[result.seed]


@settings(max_examples=50, deadline=None)
@given(recipes(30, 34), st.sampled_from([1e-6, 0.3, 1e3]), st.sampled_from([0.0, 1e4]))
def test_in_the_adaptive_mode_x_and_y_do_not_matter(recipe, factor, offset):
    xyz = recipe.cloud().astype(np.float64)
    measured = np.isfinite(xyz).all(axis=2)
    if not measured.any():
        return
    xyz[~measured] = np.nan
    elsewhere = xyz * [factor, factor, 1] + [offset, offset, 0]
    if len(np.unique(elsewhere[measured], axis=0)) < len(np.unique(xyz[measured], axis=0)):
        return  # tiny pitches are lost in rounding, and many points at one place count as not measured

    with np.errstate(all='ignore'):
        one, other = remove_outliers(xyz, ADAPTIVE), remove_outliers(elsewhere, ADAPTIVE)

    np.testing.assert_array_equal(one.outliers, other.outliers)
    np.testing.assert_array_equal(one.score, other.score)
    assert (one.seed, one.radius) == (other.seed, other.radius)


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('dtype', ['float32', 'float64'])
def test_in_the_adaptive_mode_the_layout_in_memory_does_not_matter(layout, dtype):
    contiguous = Recipe(33, 31, dtype, 'noise', clusters=2, missing=0.1, spikes=0.1, random=5).cloud()

    expected = remove_outliers(contiguous, ADAPTIVE)
    result = remove_outliers(laid_out(contiguous, layout), ADAPTIVE)

    np.testing.assert_array_equal(result.outliers, expected.outliers)
    assert expected.outliers.any()


def rough(rows=90, columns=100):
    return np.random.default_rng(0).normal(0, 1, (rows, columns))


def test_the_adaptive_mode_removes_a_cluster_in_the_middle_of_the_vote_region_and_keeps_both_sides_of_a_step():
    heights = rough()
    heights[:, 70:] += 30
    cluster = np.zeros(heights.shape, bool)
    cluster[40:48, 30:38] = True
    heights[cluster] += 15

    result = remove_outliers(grid(heights), CircleSettings(mode='adaptive', vote_region=(14, 4, 60, 60)))

    assert result.outliers[cluster].mean() > 0.95
    assert result.outliers[~cluster].mean() < 0.005


def test_the_seed_of_the_adaptive_mode_is_the_kept_point_nearest_to_the_middle():
    heights = rough(40, 50)
    heights[20, 25] = 60
    result = remove_outliers(grid(heights), ADAPTIVE)

    assert result.outliers[20, 25]
    assert max(abs(result.seed[0] - 20), abs(result.seed[1] - 25)) == 1
    assert result.inliers[result.seed]


def test_the_radius_of_the_adaptive_mode_is_3_5_spreads_of_neighbours_heights():
    result = remove_outliers(grid(0.01 * rough(200, 220)), ADAPTIVE)

    assert result.radius == pytest.approx(3.5 * 0.01 * math.sqrt(2), rel=0.1)


def test_islands_of_one_height_are_kept_with_a_warning():
    heights = rough(160, 200)
    for top in range(10, 150, 20):
        for left in range(10, 190, 20):
            heights[top : top + 6, left : left + 6] += 20

    rules = CircleSettings(judge='rules')
    result = remove_outliers(grid(heights), rules)

    (warning,) = result.warnings
    assert 'islands of one height were kept' in warning
    assert result.outliers.mean() < 0.005
    assert remove_outliers(grid(rough()), rules).warnings == ()


def test_the_paper_s_mode_has_no_score_and_warns_of_nothing_on_a_plane():
    result = remove_outliers(flat(9, 8), CircleSettings(mode='paper'))

    assert result.score is None
    assert result.warnings == ()


def test_results_can_be_compared_and_be_keys():
    first, second = (remove_outliers(flat(9, 8)) for _ in range(2))

    assert first != second
    assert {first: 1, second: 2}[first] == 1


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 2**32),
    st.sampled_from(['network', 'rules']),
    st.sampled_from([None, 0.5]),
    st.integers(-900, 900).filter(lambda power: abs(power) >= 100),
)
@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_a_power_of_two_on_the_heights_changes_nothing_in_the_adaptive_mode(random, judge, depth_of_field, power):
    generator = np.random.default_rng(random)
    heights = rough(60, 70).astype(np.float64)
    heights[20:24, 30:35] += 40
    heights.flat[generator.choice(heights.size, 12, replace=False)] += generator.normal(0, 100, 12)
    heights.flat[generator.choice(heights.size, 40, replace=False)] = np.nan
    scaled_depth = None if depth_of_field is None else math.ldexp(depth_of_field, power)

    result = remove_outliers(grid(heights), CircleSettings(judge=judge, depth_of_field=depth_of_field))
    scaled = remove_outliers(
        grid(np.ldexp(heights, power)), CircleSettings(judge=judge, depth_of_field=scaled_depth)
    )

    assert result.outliers.any()
    np.testing.assert_array_equal(scaled.outliers, result.outliers)
    np.testing.assert_array_equal(scaled.inliers, result.inliers)
    np.testing.assert_array_equal(scaled.score, result.score)
    assert math.ldexp(scaled.radius, -power) == result.radius
    assert scaled.warnings == result.warnings
