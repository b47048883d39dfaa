"""Exact order statistics of many values: sorting that the processor's vectors do several at a time."""

from typing import Any

import numpy as np

from .compiled import kernel

_DIGIT = 11
_DIGITS = 2**_DIGIT


@kernel
def _exchange(low: Any, high: Any) -> None:
    """Of each pair the lesser to the first row: a function of its own, as only so it is compiled to vectors."""
    for column in range(low.size):
        one, other = low[column], high[column]
        ordered = one < other
        low[column] = one if ordered else other
        high[column] = other if ordered else one


@kernel
def sort_columns(values: Any) -> None:
    """Sort each column of (rows, columns) float32 in place, all of them side by side.

    The comparisons are the same whatever the values (Batcher's merge exchange; Knuth, The Art of Computer
    Programming, volume 3, algorithm 5.2.2M), so that each is done for a whole row at once. There must be no NaN.
    """
    count = len(values)
    largest = 1
    while 2 * largest < count:
        largest *= 2
    step = largest
    while step > 0:
        reach, part, distance = largest, 0, step
        while True:
            for row in range(count - distance):
                if row & step == part:
                    _exchange(values[row], values[row + distance])
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
def sorted_values(values: Any) -> Any:
    """(n,) float32, sorted: a radix sort of their bits. There must be no NaN."""
    sign = np.uint32(1 << 31)
    bits, other = values.view(np.uint32).copy(), np.empty(values.size, np.uint32)
    for place in range(bits.size):
        # Bits of positive numbers are ordered as these are, those of negative ones the other way round.
        bits[place] ^= ~np.uint32(0) if bits[place] & sign else sign
    for shift in range(0, 32, _DIGIT):
        starts = np.zeros(_DIGITS + 1, np.int64)
        for place in range(bits.size):
            starts[((bits[place] >> np.uint32(shift)) & np.uint32(_DIGITS - 1)) + 1] += 1
        for digit in range(_DIGITS):
            starts[digit + 1] += starts[digit]
        for place in range(bits.size):
            digit = (bits[place] >> np.uint32(shift)) & np.uint32(_DIGITS - 1)
            other[starts[digit]] = bits[place]
            starts[digit] += 1
        bits, other = other, bits
    for place in range(bits.size):
        bits[place] ^= sign if bits[place] & sign else ~np.uint32(0)
    return bits.view(np.float32)
