# SPDX-License-Identifier: Apache-2.0
"""Where the machine code of a kernel is kept. A cache that fails costs time, and never ends a call."""

import contextlib
import pickle
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Protocol


class NumbaCache(Protocol):
    """Numba's cache of one kernel, as far as it is used here."""

    @property
    def cache_path(self) -> str | None:
        """Its folder; None: it keeps nothing."""

    def load_overload(self, signature: object, target: object) -> object:
        """Load the machine code of a signature; None: it is not in the cache."""

    def save_overload(self, signature: object, data: object) -> None:
        """Write the machine code of a signature into the cache."""

    def flush(self) -> None:
        """Empty the cache."""


_DAMAGED = (
    ArithmeticError,
    AttributeError,
    EOFError,
    ImportError,
    LookupError,
    PermissionError,
    TypeError,
    ValueError,
    pickle.UnpicklingError,
)
"""What reading a cache may raise that is damaged, of another version or another user's. Other errors, as where
memory is short, say nothing of the cache."""

_failures: list[Exception] = []


def write_failure() -> str | None:
    """Why a kernel that this process compiled could not be kept, the first time; None: all were kept."""
    if not _failures:
        return None
    (first, *_) = _failures
    return getattr(first, 'strerror', None) or str(first) or type(first).__name__


class KernelCache:
    """Numba's cache of one kernel, and before it those that can be read only; Numba uses it as its own.

    Attributes:
        used: the folder from which the kernel was loaded, or into which it was written, the last time.
    """

    def __init__(self, function: Callable[..., object], own: NumbaCache) -> None:
        """Take the place of Numba's cache.

        Args:
            function: the kernel, not compiled.
            own: the cache that Numba found, which can be written or keeps nothing.
        """
        self._own = own
        self._read_only = list(_read_only_caches(function, own))
        self._can_write = True
        self.used: str | None = None

    @property
    def cache_path(self) -> str | None:
        """The folder into which the kernel is written; None: there is none."""
        return self._own.cache_path

    def load_overload(self, signature: object, target: object) -> object:
        """Load the machine code of a signature; None: no cache has it, or none that has it can be read.

        The next cache is asked for each signature that one lacks: a cache of another version of the package, of
        another Numba or processor, or of a warm-up that was broken off lacks some or all.
        """
        for each in (*self._read_only, self._own):
            code = self._load(each, signature, target)
            if code is not None:
                self.used = each.cache_path
                return code
        return None

    def _load(self, tried: NumbaCache, signature: object, target: object) -> object:
        """Load from one cache. One that is damaged is emptied, so that it can be written again.

        The cache refers to NamedTuples by their name and module. Numba reads it before it compares the age of the
        source, so a cache of another version of this package may name what is no more.
        """
        if tried is self._own and not self._can_write:
            return None
        try:
            return tried.load_overload(signature, target)
        except _DAMAGED:
            if tried is self._own:
                self._empty()
        except Exception as error:  # noqa: BLE001 - whatever it is, the kernel can be compiled
            if tried is self._own:
                self._leave(error)
        return None

    def _empty(self) -> None:
        try:
            self._own.flush()
        except OSError as error:
            self._leave(error)

    def _leave(self, error: Exception) -> None:
        """Use the cache no more: Numba reads it before it writes, which would fail again."""
        self._can_write = False
        _failures.append(error)

    def save_overload(self, signature: object, data: object) -> None:
        """Write the machine code of a signature, unless there is no room, or no folder that can be written."""
        if self.cache_path is None:
            _failures.append(OSError('no folder can be written'))
        if not self._can_write:
            return
        try:
            self._own.save_overload(signature, data)
        except OSError as error:
            _failures.append(error)
        else:
            self.used = self.cache_path

    def flush(self) -> None:
        """Empty the cache that can be written."""
        self._own.flush()

    def has_code(self) -> bool:
        """Whether a cache holds machine code for some signature; none is loaded."""
        for each in (*self._read_only, self._own):
            with contextlib.suppress(Exception):  # it cannot be read
                if each._cache_file._load_index():  # type: ignore[attr-defined] # noqa: SLF001 - no public way
                    return True
        return False


@cache
def _readers() -> list[tuple[type, Callable[[Callable[..., object]], NumbaCache]]]:
    """Numba's locators of the folders that `socialcircle warm-up` may have filled, each with a reader.

    A reader makes a cache that only reads what the folder holds of a function; a RuntimeError: that is nothing.
    Where Numba has other names for this, there are no readers.
    """
    try:
        from numba.core import caching  # noqa: PLC0415 - guarded

        machinery = getattr(caching, 'CacheImpl', None) or getattr(caching, '_CacheImpl')  # noqa: B009 - either
        locators = {each.__name__.lstrip('_'): each for each in machinery._locator_classes}  # noqa: SLF001 - as above
        found = [locators['UserProvidedCacheLocator'], locators['InTreeCacheLocator']]
        maker, whole = caching.CompileResultCacheImpl, caching.FunctionCache
    except (ImportError, AttributeError, KeyError):
        return []

    def reader(locator: type) -> Callable[[Callable[..., object]], NumbaCache]:
        class ReadOnlyLocator(locator):  # type: ignore[misc]
            """A folder that need not be writable, if it holds something of the function."""

            def __init__(self, function: Callable[..., object], file: str) -> None:
                super().__init__(function, file)
                version = f'py{sys.version_info.major}{sys.version_info.minor}{sys.abiflags}'
                name = function.__qualname__.replace('<', '').replace('>', '')  # as Numba does for inner functions
                self._index = f'{Path(file).stem}.{name}-{function.__code__.co_firstlineno}.{version}.nbi'

            def ensure_cache_path(self) -> None:
                """Check that there is an index; whether it can be read shows when it is read."""
                if not (Path(self.get_cache_path()) / self._index).exists():
                    raise OSError(self._index)

        class ReadOnlyMaker(maker):  # type: ignore[misc,valid-type]
            _locator_classes = (ReadOnlyLocator,)

        class ReadOnlyCache(whole):  # type: ignore[misc,valid-type]
            _impl_class = ReadOnlyMaker

        return ReadOnlyCache

    return [(each, reader(each)) for each in found]


def _read_only_caches(function: Callable[..., object], own: NumbaCache) -> Iterator[NumbaCache]:
    """The caches that Numba passed over because they cannot be written, if they hold something of the function.

    Numba asks its locators in turn for a folder that can be written. In a container, the one that it finds is new
    and empty at each start, while that of the image is full.
    """
    place = getattr(getattr(own, '_impl', None), 'locator', None)
    for locator, reader in _readers():
        if isinstance(place, locator):
            return
        with contextlib.suppress(RuntimeError, OSError):
            yield reader(function)
