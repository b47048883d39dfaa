"""How the process keeps memory for large clouds, instead of giving each block back to the system."""

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_LARGEST_MMAP_THRESHOLD = 32 << 20

_PIECE = 1 << 20


def keep_freed_memory() -> None:
    """Have glibc reuse large blocks instead of mapping new pages for each cloud.

    In one arena for all threads: those of its own that glibc gives to each thread hold 64 MB at most and are
    given back when they are empty, whatever the thresholds, and what one thread has freed serves no other.
    """
    if sys.platform != 'linux':
        return
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)  # absent where the C library is not glibc
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_MMAP_THRESHOLD)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
        mallopt(_M_ARENA_MAX, 1)


def reserve_memory(size: int) -> None:
    """Have the system give memory of so many bytes now, which it does page by page where it is first written.

    It is freed at once, and kept for whoever needs it next, see `keep_freed_memory`.
    """
    pieces = [b'\1' * _PIECE for _ in range(-(-size // _PIECE))]
    del pieces
