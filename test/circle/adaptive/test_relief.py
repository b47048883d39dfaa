# SPDX-License-Identifier: Apache-2.0
"""The surface of the significant differences."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import MISSING, STEPS_PER_SPREAD
from socialcircle_ros.circle.adaptive.relief import SIGNIFICANT, _divergence, _residual, _solved, relief_of
from socialcircle_ros.kernels import bands


def random_differences(shape, random, gone=0.1):
    generator = np.random.default_rng(random)
    differences = generator.integers(-127, 128, (4, *shape)).astype(np.int8)
    differences[generator.random(differences.shape) < gone] = MISSING
    differences[0, :, -1] = differences[1, -1] = MISSING
    return differences


def block_differences(shape, random, blocks=4):
    """Differences along x and y of blocks on a plane."""
    generator = np.random.default_rng(random)
    heights = np.zeros(shape)
    for _ in range(blocks):
        top, left = generator.integers(0, shape[0]), generator.integers(0, shape[1])
        height, width = generator.integers(1, 9, 2)
        heights[top : top + height, left : left + width] += generator.choice([-7, 7])
    differences = np.full((4, *shape), MISSING, np.int8)
    differences[0, :, :-1] = np.clip(STEPS_PER_SPREAD * np.diff(heights, axis=1), -127, 127)
    differences[1, :-1] = np.clip(STEPS_PER_SPREAD * np.diff(heights, axis=0), -127, 127)
    return differences


def wanted_of(differences):
    wanted = np.empty(differences.shape[1:], np.float32)
    _divergence(differences, round(SIGNIFICANT * STEPS_PER_SPREAD), 0, differences.shape[1], wanted)
    return wanted


SHAPES = st.tuples(st.integers(1, 20), st.integers(1, 20))


@settings(max_examples=100)
@given(SHAPES, st.integers(0, 2**32))
def test_only_significant_differences_are_wanted_and_their_sum_is_0(shape, random):
    differences = random_differences(shape, random)

    wanted = wanted_of(differences)

    # Multiples of 1/16 are exact in float32.
    np.testing.assert_array_equal(wanted, naive.wanted_differences(differences))
    assert wanted.sum(dtype=float) == 0


WIDE_SHAPES = st.tuples(st.integers(8, 26), st.integers(8, 26))
"""Clouds with shorter sides soon reach the coarsest grid, which hardly relates points that lie far apart."""


@settings(max_examples=60)
@given(WIDE_SHAPES, st.integers(0, 2**32), st.sampled_from([random_differences, block_differences]))
def test_one_solve_leaves_little_of_the_wanted_differences(shape, random, make):
    differences = make(shape, random)
    wanted, left = wanted_of(differences), np.empty(shape, np.float32)

    _residual(relief_of(differences), wanted, 0, shape[0], left)

    # Of 12,000 random clouds the median left 0.018, the worst 0.079.
    assert np.linalg.norm(left) <= 0.2 * np.linalg.norm(wanted)


@settings(max_examples=40)
@given(WIDE_SHAPES, st.integers(0, 2**32), st.sampled_from([random_differences, block_differences]))
def test_repeated_descents_converge_to_the_least_squares_surface(shape, random, make):
    differences = make(shape, random)
    wanted = wanted_of(differences)
    surface, left = np.zeros(shape, np.float32), wanted.copy()
    for _ in range(150):
        surface += _solved(left)
        _residual(surface, wanted, 0, shape[0], left)

    # Heights of some spreads agree to 0.01 spread; the level is arbitrary.
    np.testing.assert_allclose(surface - surface.mean(), naive.relief(differences), atol=0.01)


def test_insignificant_differences_leave_the_relief_flat():
    differences = np.full((4, 30, 40), round(SIGNIFICANT * STEPS_PER_SPREAD), np.int8)

    assert not relief_of(differences).any()


def test_a_block_stands_out_as_high_as_its_differences():
    differences = np.zeros((4, 60, 70), np.int8)
    differences[0, 20:28, 29], differences[0, 20:28, 37] = 5 * STEPS_PER_SPREAD, -5 * STEPS_PER_SPREAD
    differences[1, 19, 30:38], differences[1, 27, 30:38] = 5 * STEPS_PER_SPREAD, -5 * STEPS_PER_SPREAD

    relief = relief_of(differences)

    rise = relief[20:28, 30:38].mean() - np.median(relief)
    assert 4.5 < rise < 5.5


@settings(max_examples=60)
@given(SHAPES, st.integers(0, 2**32))
def test_a_strip_of_any_width_has_finite_heights(shape, random):
    assert np.isfinite(relief_of(random_differences(shape, random))).all()


def test_one_thread_and_two_threads_give_the_same(monkeypatch):
    differences = random_differences((450, 500), 5)
    results = []
    for limit in (1, 2):
        monkeypatch.setattr(bands, 'limit', limit)
        results.append(relief_of(differences))

    np.testing.assert_array_equal(*results)
