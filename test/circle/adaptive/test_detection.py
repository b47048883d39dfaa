# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode as a whole."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import Recipe, recipes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from socialcircle_ros.circle.adaptive import find_outliers
from socialcircle_ros.kernels import bands


def heights_of(recipe):
    """Heights in the recipe's own type, NaN where not measured."""
    xyz = recipe.cloud()
    return np.where(np.isfinite(xyz).all(axis=2), xyz[..., 2], xyz.dtype.type(np.nan))


def noise(rows=120, columns=150, seed=1, kind=np.float32):
    return np.random.default_rng(seed).normal(0, 1, (rows, columns)).astype(kind)


def assert_same(one, other):
    np.testing.assert_array_equal(one.outliers, other.outliers)
    np.testing.assert_array_equal(one.score, other.score)
    assert one.islands_kept == other.islands_kept


# For any cloud


@settings(max_examples=200)
@given(recipes(40, 44))
def test_outliers_are_measured_and_only_they_score_above_a_half(recipe):
    with np.errstate(all='ignore'):
        heights = heights_of(recipe)
        assume(np.isfinite(heights).any())
        before = heights.tobytes()
        result = find_outliers(heights)

    measured = np.isfinite(heights)
    assert heights.tobytes() == before
    assert not result.outliers[~measured].any()
    assert np.isnan(result.score[~measured]).all()
    np.testing.assert_array_equal(result.score > 0.5, result.outliers)
    assert ((result.score[measured] >= 0) & (result.score[measured] <= 1)).all()
    assert result.score.dtype == np.float32
    assert result.outliers.shape == result.score.shape == heights.shape


@settings(max_examples=100)
@given(recipes(40, 44), st.integers(-10, 10))
def test_the_unit_changes_nothing_where_factors_are_powers_of_2(recipe, power):
    heights = heights_of(replace(recipe, unit='ordinary'))
    assume(np.isfinite(heights).any())

    one, other = find_outliers(heights), find_outliers(heights * heights.dtype.type(2.0**power))

    assert_same(one, other)
    assume(one.spread > 1e-30)  # the spread of a plane is next to 0 in any unit
    assert other.spread == one.spread * 2.0**power


@pytest.mark.parametrize('factor', [1e-3, 0.3, 7.0, 1e3])
def test_another_unit_changes_hardly_a_point(factor):
    heights = noise(kind=np.float64)
    heights[np.random.default_rng(4).random(heights.shape) < 0.05] += 25
    heights[40:46, 70:77] += 20

    one, other = find_outliers(heights), find_outliers(heights * factor)

    # A difference that is rounded the other way may change a point near a threshold.
    assert np.count_nonzero(one.outliers != other.outliers) < 1e-3 * heights.size
    assert one.outliers.sum() > 800


@settings(max_examples=60)
@given(st.integers(1, 40), st.integers(1, 44), st.integers(0, 2**32), st.sampled_from([64.0, -4096.0, 2.0**30]))
def test_an_offset_changes_nothing_where_no_digit_is_lost(rows, columns, random, offset):
    generator = np.random.default_rng(random)
    heights = generator.integers(-64, 64, (rows, columns)) / 32
    heights[generator.random(heights.shape) < 0.1] += 50
    heights[rows // 2 : rows // 2 + 4, columns // 2 : columns // 2 + 4] -= 30
    heights[0, : columns // 2] = np.nan

    assume(np.isfinite(heights).any())

    assert_same(find_outliers(heights), find_outliers(heights + offset))


def test_one_thread_and_two_threads_give_the_same(monkeypatch):
    heights = noise(450, 500)
    heights[np.random.default_rng(4).random(heights.shape) < 0.05] += 25
    heights[200:208, 300:310] -= 20
    results = []
    for limit in (1, 2):
        monkeypatch.setattr(bands, 'limit', limit)
        results.append(find_outliers(heights))

    assert_same(*results)
    assert results[0].outliers.sum() > 5000


@pytest.mark.parametrize('turn', [np.transpose, np.flipud, np.fliplr])
def test_a_turned_cloud_has_nearly_the_same_outliers(turn):
    # Not the same, because the spreads of blocks and tiles are estimated from some of the rows.
    heights = noise()
    heights[np.random.default_rng(4).random(heights.shape) < 0.05] += 25
    heights[40:46, 70:77] += 20

    one, other = find_outliers(heights), find_outliers(np.ascontiguousarray(turn(heights)))

    assert np.count_nonzero(turn(one.outliers) != other.outliers) < 2e-3 * heights.size


def test_heights_upside_down_have_nearly_the_same_outliers():
    heights = noise()
    heights[np.random.default_rng(4).random(heights.shape) < 0.05] += 25

    one, other = find_outliers(heights), find_outliers(-heights)

    assert np.count_nonzero(one.outliers != other.outliers) < 1e-3 * heights.size


# What it finds


@pytest.mark.parametrize('seed', [1, 2, 3])
@pytest.mark.parametrize('share', [0.1, 0.3])
def test_isolated_outliers_in_noise_are_found_and_few_good_points(share, seed):
    generator = np.random.default_rng(seed)
    heights = generator.normal(0, 1, (160, 200))
    bad = generator.random(heights.shape) < share
    heights[bad] += (generator.uniform(8, 40, heights.shape) * generator.choice([-1, 1], heights.shape))[bad]

    found = find_outliers(heights).outliers

    assert found[bad].mean() > 0.95
    assert found[~bad].mean() < 0.01


@pytest.mark.parametrize('rise', [12.0, -12.0])
def test_a_dense_cluster_is_removed_and_hardly_a_point_beside_it(rise):
    heights = noise()
    cluster = np.zeros(heights.shape, bool)
    cluster[55:66, 70:82] = True
    heights[cluster] += rise

    found = find_outliers(heights).outliers

    assert found[cluster].mean() > 0.95
    assert found[~cluster].mean() < 0.005


@pytest.mark.parametrize('level', [0.0, 7.0])
def test_a_cluster_on_a_plane_is_removed_exactly(level):
    heights = np.full((40, 50), level, np.float32)
    heights[20:23, 20:23] += 5

    np.testing.assert_array_equal(find_outliers(heights).outliers, heights != level)


@pytest.mark.parametrize('kind', ['step', 'plateaus', 'groove'])
def test_the_form_of_a_part_is_kept(kind):
    row, column = np.mgrid[:160, :200]
    form = {
        'step': np.where(column > 90, 40.0, 0.0),
        'plateaus': np.where((row > 30) & (row < 130) & (column % 100 > 20) & (column % 100 < 80), 40.0, 0.0),
        'groove': -40.0 * (np.abs(np.hypot(row - 80, column - 100) - 50) < 6),  # closed, walls upright
    }[kind]

    found = find_outliers(noise(160, 200) + form).outliers

    assert found.mean() < 0.005


@pytest.mark.parametrize('noise_in_steps', [0.5, 0.7])
@pytest.mark.parametrize(
    ('step', 'offset'), [(1.0, 0.0), (0.01, 0.0), (0.01, 123.0), (1e-6, 1.5), (2**-12, 1000.0), (1e-3, 700.0)]
)
def test_a_plate_stored_in_steps_that_are_rounded_loses_no_point(step, offset, noise_in_steps):
    steps = np.round(np.random.default_rng(1).normal(0, noise_in_steps, (160, 200)))
    assert find_outliers((steps * step + offset).astype(np.float32)).outliers.mean() < 0.001


@pytest.mark.parametrize('quantum', [0.5, 1.0, 3.0])
def test_a_surface_stored_in_steps_loses_hardly_a_point(quantum):
    row, column = np.mgrid[:160, :200]
    heights = np.round((noise(160, 200) + row / 10 + np.sin(column / 15)) / quantum) * quantum

    assert find_outliers(heights).outliers.mean() < 0.005


@pytest.mark.parametrize('kind', [np.float32, np.float64])
@pytest.mark.parametrize('level', [0.0, -3.5])
@pytest.mark.parametrize('shape', [(1, 1), (1, 30), (30, 1), (2, 3), (40, 50)])
def test_a_plane_is_kept_whole(shape, level, kind):
    result = find_outliers(np.full(shape, level, kind))

    assert not result.outliers.any()
    assert not result.score.any()


def test_islands_of_one_height_are_kept_and_counted():
    heights = noise(160, 200)
    for top in range(10, 150, 20):
        for left in range(10, 190, 20):
            heights[top : top + 6, left : left + 6] += 20

    result = find_outliers(heights)

    assert result.islands_kept > 50
    assert result.outliers.mean() < 0.005


def test_a_cluster_with_blurred_flanks_is_found_at_reduced_resolution():
    row, column = np.mgrid[:160, :200]
    heights = noise(160, 200) + 30 * np.exp(-(((row - 80) ** 2 + (column - 100) ** 2) / 30))

    found = find_outliers(heights).outliers

    assert found[78:83, 98:103].all()
    assert found.mean() < 0.02


def test_both_types_of_the_same_heights_have_the_same_outliers():
    recipe = Recipe(40, 44, 'float32', 'noise', clusters=3, spikes=0.1, missing=0.1, quantum=0.5)

    one = find_outliers(heights_of(recipe))
    other = find_outliers(heights_of(recipe).astype(np.float64))

    np.testing.assert_array_equal(one.outliers, other.outliers)


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('height', [1e300, -1e300, np.finfo(np.float64).max])
def test_a_height_beyond_the_range_of_float32_is_an_outlier(height):
    heights = noise(40, 50, kind=np.float64)
    heights[3, 4] = height

    result = find_outliers(heights)

    assert result.outliers[3, 4]
    assert result.score[3, 4] > 0.5


@pytest.mark.parametrize(('depth_of_field', 'number'), [(None, 5), (1.0, 5), (1e3, 0)])
def test_removed_islands_of_one_height_are_counted_unless_the_optics_keep_them(depth_of_field, number):
    heights = noise(160, 200)
    for pin in range(5):
        heights[20 + 30 * pin :, 30 + 30 * pin :][:8, :8] += 40

    result = find_outliers(heights, depth_of_field)

    assert result.alike.number == number
    assert (np.count_nonzero(result.outliers) >= 320) == (number > 0)


def blurred(heights, times):
    """Heights that were smoothed; opposite sides join."""
    for _ in range(times):
        beside = sum(np.roll(heights, step, axis) for step in (1, -1) for axis in (0, 1))
        heights = (2 * heights + beside) / 6
    return heights


def block(height, rows=slice(40, 60), columns=slice(60, 84), shape=(120, 150)):
    heights = np.zeros(shape)
    heights[rows, columns] = height
    return heights


def test_among_many_isolated_points_an_island_needs_to_be_less_steep():
    island = block(4.0, slice(60, 66), slice(20, 27))
    isolated = np.random.default_rng(2).random(island.shape) < 0.05
    found = [
        find_outliers((noise() + island + rise * isolated).astype(np.float32)).outliers[island > 0].mean()
        for rise in (0, 25)
    ]
    assert found[0] == 0
    assert found[1] > 0.8


def test_on_a_smooth_surface_an_island_needs_to_be_less_steep():
    smooth = blurred(np.random.default_rng(3).normal(size=(90, 100)), 40)
    island = block(0.4 * smooth.std(), slice(40, 48), slice(60, 68), smooth.shape)
    found = find_outliers((smooth + island).astype(np.float32)).outliers
    assert found[island > 0].all()


def test_a_smooth_hill_of_a_smooth_surface_is_no_island():
    smooth = blurred(np.random.default_rng(0).normal(size=(90, 100)), 10)
    hill = blurred(block(10.0, slice(40, 52), slice(60, 72), smooth.shape), 20)
    heights = 0.2 * smooth / smooth.std() + hill
    assert not find_outliers(heights.astype(np.float32)).outliers.any()


def test_blurred_outliers_are_found_among_heights_that_are_stored_in_steps():
    stored = np.round(0.3 * np.random.default_rng(0).normal(size=(120, 150)) + blurred(block(8.0), 8))
    found = find_outliers(stored.astype(np.float32)).outliers
    assert found[44:56, 64:80].all()
