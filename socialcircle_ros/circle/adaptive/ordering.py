"""Exact order statistics of many values: sorting that the processor's vectors do several at a time."""

from typing import Any

import numpy as np

from socialcircle_ros.compiled import kernel

_DIGIT = 11
_DIGITS = 2**_DIGIT


@kernel
def sort_columns(values: Any) -> None:
    """Sort each column of (rows, columns) float32 in place, all of them side by side.

    The comparisons are the same whatever the values (Batcher's merge exchange; Knuth, The Art of Computer
    Programming, volume 3, algorithm 5.2.2M), so that each is done for a whole row at once. There must be no NaN.
    """
    count, columns = values.shape
    largest = 1
    while 2 * largest < count:
        largest *= 2
    step = largest
    while step > 0:
        reach, part, distance = largest, 0, step
        while True:
            for row in range(count - distance):
                if row & step == part:
                    low, high = values[row], values[row + distance]
                    for column in range(columns):
                        one, other = low[column], high[column]
                        low[column] = min(other, one)
                        high[column] = max(one, other)
            if reach == step:
                break
            distance = reach - step
            reach //= 2
            part = step
        step //= 2


@kernel
def median_of_sorted(values: Any, count: int, column: int) -> Any:
    """Median of the first `count` values of a sorted column; there is one at least."""
    middle = count // 2
    if count % 2:
        return np.float64(values[middle, column])
    return (values[middle - 1, column] + values[middle, column]) / 2


@kernel
def sorted_sizes(values: Any) -> Any:
    """Absolute values of (n,) float32, sorted: a radix sort, as their bits are ordered as they are. No NaN."""
    sizes, other = np.abs(values).view(np.uint32), np.empty(values.size, np.uint32)
    for shift in range(0, 32, _DIGIT):
        starts = np.zeros(_DIGITS + 1, np.int64)
        for place in range(sizes.size):
            starts[((sizes[place] >> np.uint32(shift)) & np.uint32(_DIGITS - 1)) + 1] += 1
        for digit in range(_DIGITS):
            starts[digit + 1] += starts[digit]
        for place in range(sizes.size):
            digit = (sizes[place] >> np.uint32(shift)) & np.uint32(_DIGITS - 1)
            other[starts[digit]] = sizes[place]
            starts[digit] += 1
        sizes, other = other, sizes
    return sizes.view(np.float32)
