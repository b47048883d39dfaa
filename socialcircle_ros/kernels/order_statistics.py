# SPDX-License-Identifier: Apache-2.0
"""Exact order statistics without a sorting network: medians of sorted and of five values, and a radix sort."""

import numpy as np
import numpy.typing as npt

from .compiled import kernel

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal distribution, in median absolute deviations."""

_DIGIT = 11  # bits
_DIGITS = 2**_DIGIT


@kernel
def median_of_sorted(values: npt.NDArray[np.float32], count: int, column: int) -> np.float64:
    """Median of the first `count` values of a sorted column; `count` is at least 1.

    Args:
        values: (rows, columns) float32, each column in ascending order from row 0 on.
        count: number of values to take.
        column: the column to take them from.
    """
    middle = count // 2
    if count % 2:
        return np.float64(values[middle, column])
    return np.float64((values[middle - 1, column] + values[middle, column]) / 2)


@kernel
def median_of_five(a: np.float32, b: np.float32, c: np.float32, d: np.float32, e: np.float32) -> np.float32:
    """Median of five values, without a branch; none may be NaN."""
    low, high = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    return max(min(low, high), min(max(low, high), e))


@kernel
def sorted_values(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Sort values by a radix sort of their bits.

    Args:
        values: (n,) float32 without NaN, contiguous; not changed.

    Returns:
        (n,) float32 in ascending order.
    """
    sign = np.uint32(1 << 31)
    bits, other = values.view(np.uint32).copy(), np.empty(values.size, np.uint32)
    for place in range(bits.size):
        # The bits of positive numbers ascend as the numbers do, those of negative numbers descend.
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
