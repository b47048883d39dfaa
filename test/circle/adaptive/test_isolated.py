# SPDX-License-Identifier: Apache-2.0
"""Isolated points."""

import numpy as np
from clouds import recipes
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import MISSING, STEPS_PER_SPREAD, normalised_differences
from socialcircle_ros.circle.adaptive.isolated import isolated_among, isolated_points
from socialcircle_ros.circle.adaptive.spread import estimate_spread
from socialcircle_ros.kernels import bands

SHAPES = st.tuples(st.integers(1, 16), st.integers(1, 16))


def random_differences(shape, random, gone):
    """Any differences, many of them just in touch or just not."""
    generator = np.random.default_rng(random)
    differences = generator.integers(-127, 128, (4, *shape)).astype(np.int8)
    near = generator.random(differences.shape) < 0.3
    differences[near] = generator.choice([-57, -56, -55, 0, 55, 56, 57], np.count_nonzero(near))
    differences[generator.random(differences.shape) < gone] = MISSING
    for direction, (down, right) in enumerate(naive.DIRECTIONS):
        for row, column in np.ndindex(shape):
            if not naive.inside(row + down, column + right, shape):
                differences[direction, row, column] = MISSING
    return differences


@settings(max_examples=200)
@given(SHAPES, st.integers(0, 2**32), st.sampled_from([0.0, 0.2, 0.6, 1.0]))
def test_isolated_points_equal_the_reference_for_any_differences(shape, random, gone):
    differences = random_differences(shape, random, gone)

    np.testing.assert_array_equal(isolated_points(differences), naive.isolated_points(differences))


@settings(max_examples=200)
@given(SHAPES, st.integers(0, 2**32), st.sampled_from([0.0, 0.2, 0.6]), st.sampled_from([20, 56]))
def test_isolated_points_among_those_suspected_equal_the_reference(shape, random, gone, steps):
    differences = random_differences(shape, random, gone)
    suspected = np.random.default_rng(random).random(shape) < 0.5

    np.testing.assert_array_equal(
        isolated_among(suspected, differences, steps / STEPS_PER_SPREAD),
        naive.isolated_points(differences, steps) & suspected,
    )


@settings(max_examples=200)
@given(recipes(24, 20))
def test_isolated_points_of_a_cloud_equal_the_reference(recipe):
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


def test_a_spike_and_a_pit_are_isolated_also_on_the_border_and_in_the_corner():
    heights = rough()
    places = [(20, 30), (0, 25), (0, 0), (39, 49), (17, 0)]
    for number, place in enumerate(places):
        heights[place] = 30 * (-1) ** number

    assert all(isolated_points_of(heights)[place] for place in places)


def test_two_neighbouring_spikes_of_one_height_are_isolated_and_three_are_not():
    heights = np.zeros((20, 20))
    heights[5, 5:7] = 9
    heights[12, 5:8] = 9

    isolated = isolated_points_of(heights)

    assert isolated[5, 5:7].all()
    assert not isolated[12, 6]


def test_points_of_a_steep_wall_are_not_isolated():
    column = np.arange(50)
    wall = np.clip(column - 24, 0, 2) * 20  # with one column of points half way up

    assert not isolated_points_of(rough() + wall)[:, 22:28].any()


def test_one_thread_and_two_threads_give_the_same(monkeypatch):
    differences = random_differences((16, 16), 5, 0.1)
    differences = np.tile(differences, (1, 30, 32))
    assert differences[0].size > 200_000
    results = []
    for limit in (1, 2):
        monkeypatch.setattr(bands, 'limit', limit)
        results.append(isolated_points(differences))

    np.testing.assert_array_equal(*results)
