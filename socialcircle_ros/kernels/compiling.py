# SPDX-License-Identifier: Apache-2.0
"""Announce that kernels are compiled, which takes seconds. Numba is not imported: that takes half a second."""

from collections.abc import Callable

listeners: list[Callable[[], None]] = []
"""Called before each kernel is compiled that is not in the cache."""


def announce() -> None:
    """Tell all listeners that a kernel is compiled."""
    for listener in tuple(listeners):
        listener()
