"""Disjoint sets of numbers, each the child of another in its set or its root."""

from typing import Any

from .compiled import kernel


@kernel
def root_of(parent: Any, item: Any) -> Any:
    """The root of the set that an item belongs to; the way there is halved for the next who goes it.

    Args:
        parent: (N,) of whole numbers, changed: the parent of each item, a root its own.
        item: of which set.
    """
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item
