"""Points that touch nobody, and heights with such points filled."""

import numpy as np
from clouds import recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import NONE, estimate_spread, normalised_differences
from socialcircle_ros.circle.adaptive.isolated import isolated_points, with_holes_filled
from socialcircle_ros.kernels import bands

SHAPES = st.tuples(st.integers(1, 16), st.integers(1, 16))


def random_differences(shape, random, gone):
    """Any differences at all, and many that are just in touch or just not."""
    generator = np.random.default_rng(random)
    differences = generator.integers(-127, 128, (4, *shape)).astype(np.int8)
    near = generator.random(differences.shape) < 0.3
    differences[near] = generator.choice([-57, -56, -55, 0, 55, 56, 57], np.count_nonzero(near))
    differences[generator.random(differences.shape) < gone] = NONE
    for direction, (down, right) in enumerate(naive.DIRECTIONS):
        for row, column in np.ndindex(shape):
            if not naive.inside(row + down, column + right, shape):
                differences[direction, row, column] = NONE
    return differences


@settings(max_examples=200)
@given(SHAPES, st.integers(0, 2**32), st.sampled_from([0.0, 0.2, 0.6, 1.0]))
def test_loners_are_those_of_the_reference_whatever_the_jumps(shape, random, gone):
    differences = random_differences(shape, random, gone)

    np.testing.assert_array_equal(isolated_points(differences), naive.isolated_points(differences))


@settings(max_examples=200)
@given(recipes(24, 20))
def test_loners_of_a_cloud_are_those_of_the_reference(recipe):
    with np.errstate(all='ignore'):
        heights = recipe.cloud()[..., 2].astype(np.float32)
    heights[~np.isfinite(heights)] = np.nan
    with np.errstate(all='ignore'):
        differences = normalised_differences(heights, estimate_spread(heights, 16, may_predict=False))

    np.testing.assert_array_equal(isolated_points(differences), naive.isolated_points(differences))


def isolated_points_of(heights):
    heights = np.asarray(heights, np.float32)
    return isolated_points(normalised_differences(heights, estimate_spread(heights, 16, may_predict=False)))


def rough(rows=40, columns=50):
    return np.random.default_rng(2).normal(0, 1, (rows, columns))


def test_a_spike_and_a_pit_are_loners_also_on_the_border_and_in_the_corner():
    heights = rough()
    places = [(20, 30), (0, 25), (0, 0), (39, 49), (17, 0)]
    for number, place in enumerate(places):
        heights[place] = 30 * (-1) ** number

    assert all(isolated_points_of(heights)[place] for place in places)


def test_two_neighbouring_spikes_of_one_height_are_loners_and_three_are_company():
    heights = np.zeros((20, 20))
    heights[5, 5:7] = 9
    heights[12, 5:8] = 9

    lone = isolated_points_of(heights)

    assert lone[5, 5:7].all()
    assert not lone[12, 6]


def test_the_points_of_a_steep_wall_are_none():
    column = np.arange(50)
    wall = np.clip(column - 24, 0, 2) * 20  # one row of points half way up

    assert not isolated_points_of(rough() + wall)[:, 22:28].any()


def test_bands_of_rows_side_by_side_change_nothing(monkeypatch):
    differences = random_differences((16, 16), 5, 0.1)
    differences = np.tile(differences, (1, 30, 32))
    assert differences[0].size > 200_000
    results = []
    for limit in (1, 2):
        monkeypatch.setattr(bands, 'limit', limit)
        results.append(isolated_points(differences))

    np.testing.assert_array_equal(*results)


def quarters(shape, random, missing):
    generator = np.random.default_rng(random)
    heights = (generator.integers(-40, 40, shape) / 4).astype(np.float32)
    heights[generator.random(shape) < missing] = np.nan
    return heights


@settings(max_examples=200)
@given(
    SHAPES, st.integers(0, 2**32), st.sampled_from([0.0, 0.3, 0.8]), st.sampled_from([0.05, 0.4, 0.8, 0.97, 1.0])
)
def test_patched_heights_are_those_of_the_reference(shape, random, missing, share):
    heights = quarters(shape, random, missing)
    holes = np.random.default_rng(random + 1).random(shape) < share
    before = heights.copy()

    filled = with_holes_filled(heights, holes)

    # Sums of eight heights in float64 are exact to far below float32, but in which order says nobody.
    np.testing.assert_allclose(filled, naive.with_holes_filled(heights, holes), rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(filled[~holes], before[~holes])
    np.testing.assert_array_equal(heights, before)
    assert filled.dtype == np.float32


def test_the_middle_of_too_deep_a_hole_stays_empty():
    holes = np.zeros((40, 40), bool)
    holes[10:30, 10:30] = True

    filled = with_holes_filled(np.zeros((40, 40), np.float32), holes)

    assert np.isnan(filled[19, 19])
    assert np.count_nonzero(np.isnan(filled)) == 8 * 8  # six rings of twenty are filled
