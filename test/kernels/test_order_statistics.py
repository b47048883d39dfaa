"""Sorting and order statistics: exact, whatever the values."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from socialcircle_ros.kernels.order_statistics import median_of_sorted, sort_columns, sorted_values

VALUES = st.one_of(
    st.floats(allow_nan=False, width=32),
    st.sampled_from([0.0, -0.0, np.inf, -np.inf, 1e-45, -1e-45]),
    st.integers(-3, 3).map(float),  # many that are equal
)


def values_of(shape):
    return arrays.arrays(np.float32, shape, elements=VALUES, fill=st.nothing())


@settings(max_examples=200)
@given(values_of(st.tuples(st.integers(0, 40), st.integers(0, 5))))
def test_each_column_is_sorted_as_any_sort_does_it(values):
    expected = np.sort(values, axis=0)

    sort_columns(values)

    np.testing.assert_array_equal(values, expected)


@settings(max_examples=60)
@given(st.integers(1, 300), st.integers(1, 40), st.integers(0, 2**32), st.booleans())
def test_long_columns_are_sorted_too(rows, columns, random, few):
    generator = np.random.default_rng(random)
    values = generator.normal(0, 1, (rows, columns)).astype(np.float32)
    values = np.round(values) if few else values
    expected = np.sort(values, axis=0)

    sort_columns(values)

    np.testing.assert_array_equal(values, expected)


@settings(max_examples=200)
@given(values_of(st.tuples(st.integers(1, 9), st.just(2))), st.data())
def test_the_median_is_that_of_as_many_values_as_asked_for(values, data):
    count = data.draw(st.integers(1, len(values)))
    values = np.sort(values, axis=0)

    with np.errstate(all='ignore'):
        expected = np.median(values[:count, 1])
    np.testing.assert_array_equal(np.float32(median_of_sorted(values, count, 1)), expected)


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
