# SPDX-License-Identifier: Apache-2.0
"""Sorting networks: exact order statistics of many columns at once.

A network is a fixed list of comparators. Each comparator is applied to two whole rows of a buffer with
independent columns, so that the compiler turns it into a vector minimum and a vector maximum without a branch.
The buffer must hold no NaN: write +Inf for what is not measured, which sorts to the end. Of two zeros with
different signs either may be returned.

The networks are Batcher's odd-even merge sort (D. E. Knuth, The Art of Computer Programming, volume 3, sections
5.2.2 and 5.3.4, for two lists of any lengths) without the comparators that no wanted output depends on.
"""

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from .compiled import kernel

Comparators = npt.NDArray[np.int64]
"""(N, 3): the row that takes the minimum, the row that takes the maximum, and one of the kinds below."""

BOTH, ONLY_MINIMUM, ONLY_MAXIMUM = 0, 1, 2

_Pairs = list[tuple[int, int]]


@lru_cache(maxsize=64)
def sort_network(count: int, keep: int) -> Comparators:
    """Build the network that sorts columns.

    Args:
        count: rows of a column, from the first row of the buffer on.
        keep: number of smallest values that are wanted.

    Returns:
        The comparators. They leave the `keep` smallest values in the first `keep` rows, in ascending order; the
        other rows are undefined. The array is shared between callers: do not change it.
    """
    pairs: _Pairs = []
    order = _sort(list(range(count)), pairs)
    # A sort accepts any input order: number the rows by the rank that they end with.
    rank = {row: place for place, row in enumerate(order)}
    return _prune([(rank[low], rank[high]) for low, high in pairs], range(keep))


def merge_network(first: int, second: int, keep: int) -> tuple[Comparators, list[int]]:
    """Build the network that merges two lists of rows that are in ascending order.

    Args:
        first: length of the first list, which starts at row 0.
        second: length of the second list, which follows the first.
        keep: number of smallest values that are wanted.

    Returns:
        The comparators, and the rows that hold the smallest, second smallest, ... `keep`-th value.
    """
    pairs: _Pairs = []
    order = _merge(list(range(first)), list(range(first, first + second)), pairs)[:keep]
    return _prune(pairs, order), order


def _sort(rows: list[int], pairs: _Pairs) -> list[int]:
    """Append the comparators that sort some rows; return the rows in their sorted order."""
    if len(rows) < 2:
        return rows
    half = len(rows) // 2
    return _merge(_sort(rows[:half], pairs), _sort(rows[half:], pairs), pairs)


def _merge(first: list[int], second: list[int], pairs: _Pairs) -> list[int]:
    """Append the comparators that merge two sorted lists; return the rows in their sorted order."""
    if not first or not second:
        return first + second
    if len(first) == len(second) == 1:
        pairs.append((first[0], second[0]))
        return first + second
    odd = _merge(first[::2], second[::2], pairs)
    even = _merge(first[1::2], second[1::2], pairs)
    # `odd` has 0, 1 or 2 rows more than `even`. Its first row is the smallest; then they interleave in pairs.
    merged = odd[:1]
    for low, high in zip(even, odd[1:], strict=False):
        pairs.append((low, high))
        merged += [low, high]
    return merged + even[len(odd) - 1 :] + odd[len(even) + 1 :]


def _prune(pairs: _Pairs, wanted: Iterable[int]) -> Comparators:
    """Keep what the wanted rows depend on, going backward from the outputs."""
    needed = set(wanted)
    kept = []
    for low, high in reversed(pairs):
        if low in needed or high in needed:
            kind = BOTH if low in needed and high in needed else ONLY_MINIMUM if low in needed else ONLY_MAXIMUM
            kept.append((low, high, kind))
            needed |= {low, high}
    return np.array(kept[::-1], np.int64).reshape(-1, 3)


@kernel
def run_network(
    comparators: Comparators, buffer: npt.NDArray[np.float32] | npt.NDArray[np.float64], width: int
) -> None:
    """Run a network in place on the first `width` columns of `buffer`, (rows, columns)."""
    for step in range(comparators.shape[0]):
        low, high = buffer[comparators[step, 0]], buffer[comparators[step, 1]]
        kind = comparators[step, 2]
        # The kind is tested outside of the loops: a test inside would prevent their vectorisation.
        if kind == BOTH:
            for column in range(width):
                first, second = low[column], high[column]
                low[column] = min(first, second)
                high[column] = max(first, second)
        elif kind == ONLY_MINIMUM:
            for column in range(width):
                low[column] = min(low[column], high[column])
        else:
            for column in range(width):
                high[column] = max(low[column], high[column])
