"""What makes large clouds fast over DDS, set in our own processes before rclpy starts.

Measured at 1280×960 points: with Fast DDS as shipped a cloud of 20 MB does not fit its shared memory segment
and goes through UDP on loopback in fragments, which loses clouds from 20 Hz on; and glibc gives each large
block back to the system, so that every cloud pays for its pages again.
"""

import ctypes
import os
import sys
from pathlib import Path

PROFILE = Path(__file__).with_name('fastdds.xml')

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_LARGEST_MMAP_THRESHOLD = 32 << 20

_PIECE = 1 << 20

_CHOSEN_BY_USER = (
    'FASTRTPS_DEFAULT_PROFILES_FILE',
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'FASTDDS_BUILTIN_TRANSPORTS',
)


def prepare_process() -> None:
    """Set transport and allocator for large messages; what the user has set himself stays."""
    use_large_segment()
    keep_freed_memory()


def use_large_segment() -> None:
    """Give Fast DDS a shared memory segment that holds several clouds, by our profile."""
    other_middleware = 'fastrtps' not in os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')
    if not other_middleware and not any(name in os.environ for name in _CHOSEN_BY_USER):
        os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(PROFILE)


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
