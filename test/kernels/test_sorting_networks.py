"""Sorting networks by the zero-one principle (Knuth 5.3.4): right on zeros and ones, right on all numbers."""

import numpy as np
import pytest

from socialcircle_ros.kernels.sorting_networks import exchange, merge_network, sort_network


def zeros_and_ones(length):
    """Every 0-1 input of `length` rows, one in each column."""
    return (np.arange(2**length) >> np.arange(length)[:, None] & 1).astype(np.float32)


@pytest.mark.parametrize('length', range(1, 12))
@pytest.mark.parametrize('keep', [1, 3, 11])
def test_sort_network_sorts(length, keep):
    keep = min(keep, length)
    comparators, order = sort_network(range(length), keep)
    values = zeros_and_ones(length)
    expected = np.sort(values, axis=0)[:keep]
    exchange(comparators, values, values.shape[1])
    np.testing.assert_array_equal(values[order], expected)


@pytest.mark.parametrize('first', range(1, 12))
@pytest.mark.parametrize('second', range(1, 12))
@pytest.mark.parametrize('keep', [4, 22])
def test_merge_network_merges_lists_of_any_two_lengths(first, second, keep):
    ones_first, ones_second = np.divmod(np.arange((first + 1) * (second + 1)), second + 1)
    ascending_first = np.arange(first)[:, None] >= first - ones_first
    ascending_second = np.arange(second)[:, None] >= second - ones_second
    values = np.vstack([ascending_first, ascending_second]).astype(np.float32)
    expected = np.sort(values, axis=0)[:keep]
    comparators, order = merge_network(range(first), range(first, first + second), keep)
    exchange(comparators, values, values.shape[1])
    np.testing.assert_array_equal(values[order], expected)


def test_unwanted_outputs_cost_nothing():
    everything, _ = sort_network(range(24), 24)
    smallest, _ = sort_network(range(24), 1)
    assert len(smallest) == 23 < len(everything)
