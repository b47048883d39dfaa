"""The surface of the surprising differences."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.differences import NONE, UNIT
from socialcircle_ros.circle.adaptive.relief import SIGNIFICANT, _divergence, _residual, _solved, relief_of
from socialcircle_ros.kernels import bands


def random_differences(shape, random, gone=0.1):
    generator = np.random.default_rng(random)
    differences = generator.integers(-127, 128, (4, *shape)).astype(np.int8)
    differences[generator.random(differences.shape) < gone] = NONE
    differences[0, :, -1] = differences[1, -1] = NONE
    return differences


def block_differences(shape, random, blocks=4):
    """Along x and y, of blocks on a plane."""
    generator = np.random.default_rng(random)
    heights = np.zeros(shape)
    for _ in range(blocks):
        top, left = generator.integers(0, shape[0]), generator.integers(0, shape[1])
        height, width = generator.integers(1, 9, 2)
        heights[top : top + height, left : left + width] += generator.choice([-7, 7])
    differences = np.full((4, *shape), NONE, np.int8)
    differences[0, :, :-1] = np.clip(UNIT * np.diff(heights, axis=1), -127, 127)
    differences[1, :-1] = np.clip(UNIT * np.diff(heights, axis=0), -127, 127)
    return differences


def wanted_of(differences):
    wanted = np.empty(differences.shape[1:], np.float32)
    _divergence(differences, round(SIGNIFICANT * UNIT), 0, differences.shape[1], wanted)
    return wanted


SHAPES = st.tuples(st.integers(1, 20), st.integers(1, 20))


@settings(max_examples=100)
@given(SHAPES, st.integers(0, 2**32))
def test_only_surprising_jumps_are_wanted_and_as_much_up_as_down(shape, random):
    differences = random_differences(shape, random)

    wanted = wanted_of(differences)

    np.testing.assert_array_equal(wanted, naive.wanted_differences(differences))  # sixteenths: exact in float32
    assert wanted.sum(dtype=float) == 0


WIDE_SHAPES = st.tuples(st.integers(8, 26), st.integers(8, 26))
"""Along a side of fewer points the coarsest grid is soon reached, and what lies far apart hardly heard of."""


@settings(max_examples=60)
@given(WIDE_SHAPES, st.integers(0, 2**32), st.sampled_from([random_differences, block_differences]))
def test_little_of_the_wanted_differences_is_left_over(shape, random, make):
    differences = make(shape, random)
    wanted, left = wanted_of(differences), np.empty(shape, np.float32)

    _residual(relief_of(differences), wanted, 0, shape[0], left)

    # Half of 12,000 random ones left 0.018, the worst 0.079 of it.
    assert np.linalg.norm(left) <= 0.2 * np.linalg.norm(wanted)


@settings(max_examples=40)
@given(WIDE_SHAPES, st.integers(0, 2**32), st.sampled_from([random_differences, block_differences]))
def test_descent_after_descent_comes_to_the_exact_least_squares_surface(shape, random, make):
    differences = make(shape, random)
    wanted = wanted_of(differences)
    surface, left = np.zeros(shape, np.float32), wanted.copy()
    for _ in range(150):
        surface += _solved(left)
        _residual(surface, wanted, 0, shape[0], left)

    # Heights of some spreads, to a hundredth of one; the level is arbitrary.
    np.testing.assert_allclose(surface - surface.mean(), naive.relief(differences), atol=0.01)


def test_jumps_that_do_not_surprise_leave_it_flat():
    differences = np.full((4, 30, 40), round(SIGNIFICANT * UNIT), np.int8)

    assert not relief_of(differences).any()


def test_a_block_stands_out_of_it_as_high_as_its_jumps():
    differences = np.zeros((4, 60, 70), np.int8)
    differences[0, 20:28, 29], differences[0, 20:28, 37] = 5 * UNIT, -5 * UNIT
    differences[1, 19, 30:38], differences[1, 27, 30:38] = 5 * UNIT, -5 * UNIT

    relief = relief_of(differences)

    rise = relief[20:28, 30:38].mean() - np.median(relief)
    assert 4.5 < rise < 5.5


@settings(max_examples=60)
@given(SHAPES, st.integers(0, 2**32))
def test_a_strip_of_any_width_has_finite_heights(shape, random):
    assert np.isfinite(relief_of(random_differences(shape, random))).all()


def test_bands_of_rows_side_by_side_change_nothing(monkeypatch):
    differences = random_differences((450, 500), 5)
    results = []
    for limit in (1, 2):
        monkeypatch.setattr(bands, 'limit', limit)
        results.append(relief_of(differences))

    np.testing.assert_array_equal(*results)
