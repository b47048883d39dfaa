# SPDX-License-Identifier: Apache-2.0
"""Memory for large clouds: the process keeps it instead of returning each block to the system."""

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_LARGEST_MMAP_THRESHOLD = 32 << 20

_PIECE = 1 << 20


def keep_freed_memory() -> None:
    """Make glibc reuse large blocks instead of mapping new pages for each cloud.

    All threads share one arena. By default glibc gives each thread an arena of at most 64 MB, returns it to the
    system when it is empty, whatever the thresholds are, and lets no other thread use what it has freed.
    """
    if sys.platform != 'linux':
        return
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)  # absent where the C library is not glibc
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_MMAP_THRESHOLD)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
        mallopt(_M_ARENA_MAX, 1)


def reserve_memory(size: int) -> None:
    """Make the system provide memory now, which it otherwise does page by page on the first write.

    The memory is freed at once, and the process keeps it for later use: see `keep_freed_memory`.

    Args:
        size: bytes.
    """
    pieces = [b'\1' * _PIECE for _ in range(-(-size // _PIECE))]
    del pieces


def give_back_freed_memory() -> None:
    """Give the memory that is freed back to the system, which `keep_freed_memory` prevents otherwise."""
    trim = getattr(ctypes.CDLL(None), 'malloc_trim', None)  # glibc has it
    if trim is not None:
        trim(0)
