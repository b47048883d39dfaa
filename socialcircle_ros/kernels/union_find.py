# SPDX-License-Identifier: Apache-2.0
"""Disjoint sets of integers, each set a tree of parents (union-find)."""

import numpy as np
import numpy.typing as npt

from .compiled import kernel


@kernel
def root_of(parent: npt.NDArray[np.int32], item: int) -> int:
    """Find the root of the set that an item belongs to, and halve the path to it (path halving).

    Args:
        parent: (N,) int32, the parent of each item; a root is its own parent. The paths in it are shortened.
        item: an item of the set.
    """
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item
