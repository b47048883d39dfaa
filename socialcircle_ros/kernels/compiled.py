"""How kernels are compiled: one decorator decides about caching and its fall-back."""

import pickle
from collections.abc import Callable
from typing import Protocol, TypeVar, cast

import numba

Function = TypeVar('Function', bound=Callable[..., object])


class _Cache(Protocol):
    """Numba's cache of one kernel, as far as it is used here."""

    def load_overload(self, signature: object, target: object) -> object:
        """Load the machine code of a signature; None: it is not in the cache."""

    def flush(self) -> None:
        """Empty the cache."""


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
    else:
        cache: _Cache | None = getattr(compiled, '_cache', None)
        if cache is not None:
            _pass_over_unreadable_entries(cache)
    return cast('Function', compiled)


def _pass_over_unreadable_entries(cache: _Cache) -> None:
    """Make a cache that cannot be read empty, so that the kernel is compiled again.

    The cache refers to NamedTuples by their name and module. Numba reads it before it compares the age of the
    source, so a cache of another version of this package, in which such a name was another, would end the call.
    """
    load = cache.load_overload

    def load_overload(signature: object, target: object) -> object:
        try:
            return load(signature, target)
        except (AttributeError, ImportError, EOFError, TypeError, ValueError, pickle.UnpicklingError):
            cache.flush()
            return None

    cache.load_overload = load_overload  # type: ignore[method-assign]
