"""How kernels are compiled and run: so that caching, its fall-back and threads are decided in one place."""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar, cast

import numba
import numpy as np

_PIXELS_PER_THREAD = 100_000
"""A thread that works on fewer pixels costs more than it saves."""

Function = TypeVar('Function', bound=Callable[..., Any])
Result = TypeVar('Result')


def kernel(function: Function) -> Function:
    """Compile `function` on its first call for each type, keep the machine code on disk, release the GIL.

    Nothing is compiled with fastmath: it assumes that there is no NaN, and "not measured" is a NaN here.
    On an install without any writable cache folder (numba raises RuntimeError there, numba #4908) the
    code is compiled anew in each process: slower to start, otherwise the same.
    """
    try:
        compiled: object = numba.njit(cache=True, nogil=True)(function)
    except RuntimeError:
        compiled = numba.njit(nogil=True)(function)
    return cast('Function', compiled)


def in_bands(work: Callable[[slice], Result], height: int, width: int) -> list[Result]:
    """Have kernels work on bands of rows, on every core, where somebody waits for the last frame's cloud.

    Args:
        work: called once for each band, with its rows; what it makes of a row depends on no other.
        height: rows of the image.
        width: its columns.

    Returns:
        What `work` gave for each band, from the first row to the last.
    """
    threads = max(1, min(os.cpu_count() or 1, height * width // _PIXELS_PER_THREAD))
    edges = np.linspace(0, height, threads + 1).astype(int)
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, [slice(first, end) for first, end in itertools.pairwise(edges)]))
