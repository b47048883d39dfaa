# SPDX-License-Identifier: Apache-2.0
"""Heights: relative to a middle one, and with holes filled."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import adaptive as naive

from socialcircle_ros.circle.adaptive.heights import relative_heights, with_holes_filled

SHAPES = st.tuples(st.integers(1, 16), st.integers(1, 16))


def test_float32_heights_are_not_changed():
    heights = np.array([[1, np.nan], [3e38, -7]], np.float32)

    relative, exponent = relative_heights(heights)

    np.testing.assert_array_equal(relative, heights)
    assert exponent == 0


@pytest.mark.parametrize('kind', [np.float32, np.float64])
def test_relative_heights_lie_row_by_row(kind):
    heights = np.asfortranarray(np.arange(12, dtype=kind).reshape(3, 4))

    relative, _ = relative_heights(heights)

    assert relative.flags.c_contiguous
    np.testing.assert_array_equal(np.diff(relative), 1)


@pytest.mark.parametrize('offset', [0.0, 1e6, -(2.0**40)])
def test_an_offset_costs_no_digits(offset):
    heights = np.arange(-8, 9).reshape(1, -1) / 8

    np.testing.assert_array_equal(relative_heights(heights + offset)[0], heights.astype(np.float32))


@pytest.mark.filterwarnings('error::RuntimeWarning')
@settings(max_examples=200)
@given(SHAPES, st.integers(0, 2**32), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.integers(-1000, 1000))
def test_a_power_of_two_on_float64_heights_is_one_on_the_unit(shape, random, scale, offset, power):
    heights = offset + scale * np.random.default_rng(random).standard_normal(shape)
    heights.flat[::7] = np.nan
    if not np.isfinite(heights).any():
        heights.flat[0] = offset

    relative, exponent = relative_heights(heights)
    scaled, scaled_exponent = relative_heights(np.ldexp(heights, power))

    assert exponent == 0
    assert scaled.dtype == np.float32
    np.testing.assert_array_equal(np.ldexp(scaled.astype(float), scaled_exponent - power), relative)


@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_a_far_outlier_does_not_choose_the_unit():
    heights = np.random.default_rng(0).standard_normal((20, 30))
    heights[4, 5] = 1e300

    relative, exponent = relative_heights(heights)

    assert exponent == 0
    assert np.argmax(relative) == 4 * 30 + 5
    assert np.isfinite(relative).all()


@pytest.mark.filterwarnings('error::RuntimeWarning')
@pytest.mark.parametrize('kind', [np.float32, np.float64])
@pytest.mark.parametrize('largest', [True, False])
def test_the_ends_of_a_data_type_are_held(kind, largest):
    of_kind = np.finfo(kind)
    height = of_kind.max if largest else of_kind.tiny
    heights = np.array([[height, -height], [height, height / 2]], kind)

    relative, exponent = relative_heights(heights)

    assert np.isfinite(relative).all()
    assert len(np.unique(relative)) == 3
    assert (exponent > 0) == largest


def quarters(shape, random, missing):
    generator = np.random.default_rng(random)
    heights = (generator.integers(-40, 40, shape) / 4).astype(np.float32)
    heights[generator.random(shape) < missing] = np.nan
    return heights


@settings(max_examples=200)
@given(
    SHAPES, st.integers(0, 2**32), st.sampled_from([0.0, 0.3, 0.8]), st.sampled_from([0.05, 0.4, 0.8, 0.97, 1.0])
)
def test_filled_heights_equal_the_reference(shape, random, missing, share):
    heights = quarters(shape, random, missing)
    holes = np.random.default_rng(random + 1).random(shape) < share
    before = heights.copy()

    filled = with_holes_filled(heights, holes)

    # The order of the sums in float64 is not specified; its effect is far below float32.
    np.testing.assert_allclose(filled, naive.with_holes_filled(heights, holes), rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(filled[~holes], before[~holes])
    np.testing.assert_array_equal(heights, before)
    assert filled.dtype == np.float32


def test_the_middle_of_too_deep_a_hole_stays_empty():
    holes = np.zeros((40, 40), bool)
    holes[10:30, 10:30] = True

    filled = with_holes_filled(np.zeros((40, 40), np.float32), holes)

    assert np.isnan(filled[19, 19])
    assert np.count_nonzero(np.isnan(filled)) == 8 * 8  # six rings of twenty points are filled
