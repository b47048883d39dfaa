# SPDX-License-Identifier: Apache-2.0
"""Sorting networks by the zero-one principle: one that sorts zeros and ones sorts all numbers (Knuth 5.3.4)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from kernels.values import VALUES

from socialcircle_ros.kernels.sorting_networks import merge_network, run_network, sort_network


def zeros_and_ones(length):
    """Every input of `length` zeros and ones, one in each column."""
    return (np.arange(2**length) >> np.arange(length)[:, None] & 1).astype(np.float32)


@pytest.mark.parametrize('length', range(1, 12))
@pytest.mark.parametrize('keep', [1, 3, 11])
def test_sort_network_sorts(length, keep):
    keep = min(keep, length)
    values = zeros_and_ones(length)
    expected = np.sort(values, axis=0)[:keep]
    run_network(sort_network(length, keep), values, values.shape[1])
    np.testing.assert_array_equal(values[:keep], expected)


@pytest.mark.parametrize('first', range(1, 12))
@pytest.mark.parametrize('second', range(1, 12))
@pytest.mark.parametrize('keep', [4, 22])
def test_merge_network_merges_lists_of_any_two_lengths(first, second, keep):
    ones_first, ones_second = np.divmod(np.arange((first + 1) * (second + 1)), second + 1)
    ascending_first = np.arange(first)[:, None] >= first - ones_first
    ascending_second = np.arange(second)[:, None] >= second - ones_second
    values = np.vstack([ascending_first, ascending_second]).astype(np.float32)
    expected = np.sort(values, axis=0)[:keep]
    comparators, order = merge_network(first, second, keep)
    run_network(comparators, values, values.shape[1])
    np.testing.assert_array_equal(values[order], expected)


def test_unwanted_outputs_cost_no_comparators():
    assert len(sort_network(24, 1)) == 23 < len(sort_network(24, 24))


@settings(max_examples=200)
@given(
    arrays.arrays(np.float32, st.tuples(st.integers(0, 40), st.integers(0, 5)), elements=VALUES, fill=st.nothing())
)
def test_columns_of_any_values_are_sorted(values):
    expected = np.sort(values, axis=0)

    run_network(sort_network(len(values), len(values)), values, values.shape[1])

    np.testing.assert_array_equal(values, expected)


@settings(max_examples=60)
@given(st.integers(1, 300), st.integers(1, 40), st.integers(0, 2**32), st.booleans())
def test_long_columns_are_sorted(rows, columns, random, few):
    generator = np.random.default_rng(random)
    values = generator.normal(0, 1, (rows, columns)).astype(np.float32)
    values = np.round(values) if few else values
    expected = np.sort(values, axis=0)

    run_network(sort_network(rows, rows), values, columns)

    np.testing.assert_array_equal(values, expected)


def test_columns_beyond_the_width_are_left_alone():
    values = np.array([[2, 2, 2], [1, 1, 1]], np.float32)

    run_network(sort_network(2, 2), values, 2)

    np.testing.assert_array_equal(values, [[1, 1, 2], [2, 2, 1]])
