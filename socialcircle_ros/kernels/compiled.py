"""How kernels are compiled: one decorator, so that caching and its fall-back are decided in one place."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar('Function', bound=Callable[..., Any])


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
