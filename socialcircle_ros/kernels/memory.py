# SPDX-License-Identifier: Apache-2.0
"""Memory for large clouds: the process keeps it instead of returning each block to the system."""

import ctypes
import sys
from collections.abc import Sequence
from pathlib import Path, PurePath

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_LARGEST_MMAP_THRESHOLD = 32 << 20

_MADV_DONTNEED = 4  # linux/mman.h

_BLOCK = 16 << 20  # of what is reserved; larger ones than _LARGEST_MMAP_THRESHOLD are not kept
_FENCE, _MOST_HOLES = 1 << 16, 200  # bytes; smaller free blocks are not tried one after another

_kept = False  # whether this process keeps what it frees


def keep_freed_memory() -> None:
    """Make glibc reuse large blocks instead of mapping new pages for each cloud.

    All threads share one arena. By default glibc gives each thread an arena of at most 64 MB, returns it to the
    system when it is empty, whatever the thresholds are, and lets no other thread use what it has freed.
    """
    global _kept  # noqa: PLW0603 - the C library belongs to the process, too
    if sys.platform != 'linux':
        return
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)  # absent where the C library is not glibc
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_MMAP_THRESHOLD)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
        mallopt(_M_ARENA_MAX, 1)
        _kept = True


def new_memory(size: int) -> bytearray:
    """Memory of `size` bytes that is not set to zero.

    NumPy asks for pages of 2 MB for an array of this size. The system may have to move other memory to make each
    of them, which took up to 15 ms here.
    """
    make = ctypes.pythonapi.PyByteArray_FromStringAndSize
    make.restype, make.argtypes = ctypes.py_object, (ctypes.c_char_p, ctypes.c_ssize_t)
    memory: bytearray = make(None, size)
    return memory


def reserve_memory(large: int, small: int = 0) -> None:
    """Make the system provide memory now, which it otherwise does page by page on the first write.

    The memory is freed at once, and the process keeps it for later use. Nothing is done where the process does not
    keep it: see `keep_freed_memory`. Other threads go on meanwhile. All blocks are allocated before the first is
    written, so that they lie side by side.

    glibc takes a new block from the smallest free one that suffices. Planes of a megabyte would therefore lie in
    the room that a cloud has left, and the next cloud would find none, if there were no smaller room for planes.

    Args:
        large: bytes for clouds.
        small: bytes of a room of its own for what is smaller than a cloud; more than 16 MiB count as 16 MiB.
    """
    if not _kept:
        return
    small = min(small, _BLOCK)
    library = _allocator()
    sizes = [min(_BLOCK, large - begin) for begin in range(0, large, _BLOCK)]
    blocks = []
    if small:
        blocks.append(library.malloc(small))
        sizes.insert(0, small)
        if blocks[0]:
            _fence(library, blocks[0] + small)
    blocks += [library.malloc(each) for each in sizes[len(blocks) :]]
    for block, each in zip(blocks, sizes, strict=True):
        if block:
            ctypes.memset(block, 1, each)
    for block in blocks:
        library.free(block)


def _fence(library: ctypes.CDLL, end: int) -> None:
    """Allocate a small block behind one that ends at `end`, for good: what is free on both sides stays apart.

    The first ones may fill holes elsewhere, and are freed again.
    """
    passed = []
    for _ in range(_MOST_HOLES):
        fence = library.malloc(_FENCE)
        if fence and 0 <= fence - end < _FENCE:
            break
        passed.append(fence)
    for each in passed:
        library.free(each)


def give_back_freed_memory() -> None:
    """Give the memory that is freed back to the system, which `keep_freed_memory` prevents otherwise."""
    trim = getattr(ctypes.CDLL(None), 'malloc_trim', None)  # glibc has it
    if trim is not None:
        trim(0)


class _Mallinfo2(ctypes.Structure):
    """What glibc's `mallinfo2` returns: bytes and numbers of blocks."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in ('arena', 'ordblks', 'smblks', 'hblks', 'hblkhd', 'usmblks', 'fsmblks', 'uordblks', 'fordblks',
                     'keepcost')
    )  # fmt: skip


def freed_bytes() -> int:
    """Bytes that the process has freed; 0 where the C library does not tell.

    Those that `give_back_all_but` gives back count as freed, too, until they are used again.
    """
    look = getattr(ctypes.CDLL(None), 'mallinfo2', None)  # glibc has it from 2.33 on
    if look is None:
        return 0
    look.restype = _Mallinfo2
    found: int = look().fordblks
    return found


def give_back_all_but(sizes: Sequence[int]) -> None:
    """Give the memory that is freed back to the system, but for blocks of these sizes, which stay at hand.

    Args:
        sizes: in bytes; those of the next allocations, the smallest first.
    """
    trim = getattr(ctypes.CDLL(None), 'malloc_trim', None)
    if trim is None:
        return
    library = _allocator()
    blocks = [library.malloc(each) for each in sizes]
    trim(0)
    for block in blocks:
        library.free(block)


def _allocator() -> ctypes.CDLL:
    library = ctypes.CDLL(None)
    library.malloc.restype = ctypes.c_void_p
    library.malloc.argtypes, library.free.argtypes = [ctypes.c_size_t], [ctypes.c_void_p]
    return library


def unmap_code(library: str) -> None:
    """Unmap what is not written of a shared library until it is needed again: it stays in the file.

    The system can then use these pages for something else, as it can those of any file that is not in use.

    Args:
        library: begin of its file's name, such as `libllvmlite`.
    """
    if sys.platform != 'linux':
        return
    madvise = ctypes.CDLL(None).madvise
    madvise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    begin = end = 0
    for line in Path('/proc/self/smaps').read_text(encoding='utf-8', errors='replace').splitlines():
        word, *values = line.split(maxsplit=5)
        if not word.endswith(':'):
            begin, end = (int(address, 16) for address in word.split('-'))
            access, path = values[0], values[-1]
            wanted = 'w' not in access and PurePath(path).name.startswith(library)
        elif wanted and word == 'Anonymous:' and values[0] == '0':  # no page of it differs from the file
            madvise(begin, end - begin, _MADV_DONTNEED)
