# SPDX-License-Identifier: Apache-2.0
"""Selection: the value at a rank of unsorted values."""

from socialcircle_ros.kernels.compiled import kernel

from .arrays import Floats64


@kernel
def select(values: Floats64, rank: int) -> float:
    """Return the value that has the index `rank` in the sorted values.

    C. A. R. Hoare, "Algorithm 65: Find", Communications of the ACM 4 (7), 1961,
    https://doi.org/10.1145/366622.366647.

    Args:
        values: (n,), without NaN. They are reordered: no value before `rank` is greater than the returned one,
            and none after it is less.
        rank: 0 to n - 1.

    Returns:
        The value.
    """
    left, right = 0, len(values) - 1
    while left < right:
        a, b, c = values[left], values[(left + right) // 2], values[right]
        pivot = max(min(a, b), min(max(a, b), c))  # the median of three
        i, j = left, right
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            right = j
        elif rank >= i:
            left = i
        else:
            break
    found: float = values[rank]
    return found
