# SPDX-License-Identifier: Apache-2.0
"""Order statistics are exact for any values."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from kernels.values import VALUES

from socialcircle_ros.kernels.order_statistics import median_of_five, median_of_sorted, sorted_values


def values_of(shape):
    return arrays.arrays(np.float32, shape, elements=VALUES, fill=st.nothing())


@settings(max_examples=200)
@given(values_of(st.tuples(st.integers(1, 9), st.just(2))), st.data())
def test_the_median_is_that_of_the_first_values_of_a_column(values, data):
    count = data.draw(st.integers(1, len(values)))
    values = np.sort(values, axis=0)

    with np.errstate(all='ignore'):
        expected = np.median(values[:count, 1])
    np.testing.assert_array_equal(np.float32(median_of_sorted(values, count, 1)), expected)


def test_the_median_of_five_is_right_in_every_order():
    for five in itertools.product(np.arange(5, dtype=np.float32), repeat=5):
        assert median_of_five(*five) == sorted(five)[2]


@settings(max_examples=200)
@given(values_of(st.integers(0, 60)))
def test_values_are_sorted_from_minus_infinity_to_infinity(values):
    before = values.copy()

    np.testing.assert_array_equal(sorted_values(values), np.sort(values))
    np.testing.assert_array_equal(values, before)


@settings(max_examples=30)
@given(st.integers(1, 5000), st.integers(0, 2**32), st.sampled_from([1e-30, 1.0, 1e30]))
def test_many_values_of_any_magnitude_are_sorted(count, random, unit):
    values = (np.random.default_rng(random).standard_cauchy(count) * unit).astype(np.float32)

    np.testing.assert_array_equal(sorted_values(values), np.sort(values))
