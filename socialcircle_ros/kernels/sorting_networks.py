"""Sorting networks: exact order statistics of many windows at once.

A network is a fixed list of comparators. Each is applied to two whole rows of a buffer whose columns are
independent windows, so that the compiler turns it into a vector minimum and a vector maximum without a
branch. Nothing may be NaN; what is not measured is written as +Inf and sorts to the end.

Networks are Batcher's odd-even merge sort (Knuth, The Art of Computer Programming 3, 5.2.2 and 5.3.4, for
lists of any two lengths), less every comparator that no wanted output depends on.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .compiled import kernel

Comparators = npt.NDArray[np.int64]
"""(N, 3): the row that takes the minimum, the row that takes the maximum, and one of the kinds below."""

BOTH, ONLY_MINIMUM, ONLY_MAXIMUM = 0, 1, 2

_Pairs = list[tuple[int, int]]


def sort_network(rows: Sequence[int], keep: int) -> tuple[Comparators, list[int]]:
    """A network that sorts `rows`.

    Args:
        rows: rows of the buffer, in any order.
        keep: how many of the smallest values are wanted.

    Returns:
        The comparators, and the rows that hold the smallest, second smallest, ... `keep`-th value.
    """
    pairs: _Pairs = []
    order = _sort(list(rows), pairs)[:keep]
    return _prune(pairs, order), order


def merge_network(first: Sequence[int], second: Sequence[int], keep: int) -> tuple[Comparators, list[int]]:
    """A network that merges two ascending lists of rows; otherwise as `sort_network`."""
    pairs: _Pairs = []
    order = _merge(list(first), list(second), pairs)[:keep]
    return _prune(pairs, order), order


def _sort(rows: list[int], pairs: _Pairs) -> list[int]:
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
    # `odd` has 0, 1 or 2 more than `even`; its first is the smallest of all, then they interleave in pairs.
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
def exchange(comparators: Comparators, buffer: npt.NDArray[Any], width: int) -> None:
    """Run a network in place on the first `width` columns of `buffer` (rows, columns)."""
    for step in range(comparators.shape[0]):
        low, high = buffer[comparators[step, 0]], buffer[comparators[step, 1]]
        kind = comparators[step, 2]
        # The kinds stand outside the loops: inside, the compiler would not vectorise them.
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
