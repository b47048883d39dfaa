"""Selection: the value at a rank, without sorting."""

from typing import Any

from socialcircle_ros.kernels.compiled import kernel


@kernel
def select(values: Any, rank: int) -> Any:
    """The value at index `rank` of the sorted `values`, (n,) without NaN (Hoare's selection).

    Reorders `values` so that no value before `rank` is greater, and none behind it is less.
    """
    left, right = 0, len(values) - 1
    while left < right:
        a, b, c = values[left], values[(left + right) // 2], values[right]
        pivot = max(min(a, b), min(max(a, b), c))
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
    return values[rank]
