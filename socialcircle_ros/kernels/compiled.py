"""How kernels are compiled: one decorator decides about caching and its fall-back."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Function = TypeVar('Function', bound=Callable[..., object])


def kernel(function: Function) -> Function:
    """Compile `function` on its first call with each type, cache the machine code on disk, and release the GIL.

    No kernel uses fastmath, because that assumes that there is no NaN, and a point that is not measured is NaN
    here. Where no cache folder is writable, numba raises a RuntimeError (numba #4908). Kernels are then compiled
    in each process, which only makes its start slower.
    """
    try:
        compiled: object = numba.njit(cache=True, nogil=True)(function)
    except RuntimeError:
        compiled = numba.njit(nogil=True)(function)
    return cast('Function', compiled)
