# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: one decorator decides about caching and its fall-back."""

import contextlib
import inspect
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar, cast

import numba
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock

from .compiling import announce

Function = TypeVar('Function', bound=Callable[..., object])

# Numba before 0.59, such as that of Ubuntu 24.04, loses the first 40 bytes of the description of an argument that
# is longer, such as a NamedTuple of several arrays (numba #9097).
_MIXES_TUPLES_UP = tuple(int(part) for part in numba.__version__.split('.')[:2]) < (0, 59)

if _MIXES_TUPLES_UP:
    from numba.core.registry import CPUDispatcher
    from numba.core.typing.typeof import Purpose, typeof

    class _TypedByPython(CPUDispatcher):  # type: ignore[misc]
        """A kernel that finds the types of tuples by Python code.

        Depending on what the memory held, Numba's own way ran the machine code for another type: it read columns
        as rows.
        """

        def __call__(self, *args: object, **named: object) -> object:
            """Run the machine code for the types of the arguments."""
            if named:
                bound = inspect.signature(self.py_func).bind(*args, **named)
                bound.apply_defaults()
                args = bound.args
            if not any(isinstance(value, tuple) for value in args):
                return super().__call__(*args)
            types = tuple(typeof(value, Purpose.argument) for value in args)
            known = self.overloads.get(types)
            return (self.compile(types) if known is None else known.entry_point)(*args)


class _Cache(Protocol):
    """Numba's cache of one kernel, as far as it is used here."""

    def load_overload(self, signature: object, target: object) -> object:
        """Load the machine code of a signature; None: it is not in the cache."""

    def save_overload(self, signature: object, data: object) -> None:
        """Write the machine code of a signature into the cache."""

    def flush(self) -> None:
        """Empty the cache."""


class _Announcement(event.Listener):  # type: ignore[misc]
    """Tells that Numba compiles a kernel: it was not in the cache. Numba calls it under its own lock."""

    def __init__(self) -> None:
        self.running = 0  # kernels, since compiling one compiles those that it calls

    def on_start(self, event: object) -> None:  # noqa: ARG002 - Numba's signature
        self.running += 1
        announce()

    def on_end(self, event: object) -> None:  # noqa: ARG002 - Numba's signature
        self.running -= 1


_announcement = _Announcement()
event.register('numba:compile', _announcement)


def is_compiling() -> bool:
    """Whether a thread of this process compiles a kernel now; others that need one not yet loaded wait for it."""
    return _announcement.running > 0


def kernel(function: Function) -> Function:
    """Compile `function` on its first call with each type, cache the machine code on disk, and release the GIL.

    No kernel uses fastmath, because that assumes that there is no NaN, and a point that is not measured is NaN
    here. Where no cache folder can be written, the cache beside the source is read, if `socialcircle warm-up`
    filled it when the package was installed. Without that, kernels are compiled in each process, which only makes
    its start slower (numba raises a RuntimeError then, numba #4908).
    """
    try:
        compiled: object = numba.njit(cache=True, nogil=True)(function)
    except RuntimeError:
        compiled = numba.njit(nogil=True)(function)
    else:
        cache: _Cache | None = getattr(compiled, '_cache', None)
        if cache is not None:
            _pass_over_unreadable_entries(cache)
            _keep_going_without_room(cache)
    if _MIXES_TUPLES_UP:
        compiled.__class__ = _TypedByPython
    return cast('Function', compiled)


def _read_caches_that_cannot_be_written() -> None:
    """Let Numba read the cache beside the source where the package is installed read-only.

    Numba asks its locators in turn for a folder that can be written. One more is added before the user's folder,
    which in a container is new and empty at each start. Where Numba has other names for this, nothing changes.
    """
    try:
        from numba.core import caching  # noqa: PLC0415 - guarded

        machinery = getattr(caching, 'CacheImpl', None) or getattr(caching, '_CacheImpl')  # noqa: B009 - either
        locators = machinery._locator_classes  # noqa: SLF001 - there is no public way
        names = [each.__name__.lstrip('_') for each in locators]
        place, in_tree = names.index('UserWideCacheLocator'), locators[names.index('InTreeCacheLocator')]
    except (ImportError, AttributeError, ValueError):
        return

    class InstalledCacheLocator(in_tree):  # type: ignore[misc,valid-type]
        """The cache beside the source, if this function is in it."""

        def __init__(self, function: Callable[..., object], file: str) -> None:
            super().__init__(function, file)
            version = f'py{sys.version_info.major}{sys.version_info.minor}'
            line = function.__code__.co_firstlineno
            name = function.__qualname__.replace('<', '').replace('>', '')  # as Numba does for inner functions
            self._index = f'{Path(file).stem}.{name}-{line}.{version}*.nbi'

        def ensure_cache_path(self) -> None:
            """Check that the function is in the cache; it need not be written."""
            if next(Path(self.get_cache_path()).glob(self._index), None) is None:
                raise OSError(self._index)

    locators.insert(place, InstalledCacheLocator)


_read_caches_that_cannot_be_written()


def _keep_bitcode_unread() -> None:
    """Let kernels that come from the cache keep their bitcode as bytes, until another kernel is linked with it.

    Numba builds LLVM's objects of each cached kernel, of which only its machine code runs: 50 MB for all kernels,
    ten times their bitcode. Where Numba has other names for this, nothing changes.
    """
    try:
        from numba.core import codegen  # noqa: PLC0415 - guarded

        library, generator = codegen.JITCodeLibrary, codegen.JITCPUCodegen
        parse = codegen.ll.parse_bitcode
        names = library._unserialize, library._get_module_for_linking  # noqa: SLF001 - there is no public way
        if generator._library_class is not library or not all(names):  # noqa: SLF001
            return
    except (ImportError, AttributeError):
        return

    class LeanLibrary(library):  # type: ignore[misc,valid-type]
        """A library of machine code that reads its bitcode when it is linked."""

        _bitcode: bytes | None = None
        _shared_module: object

        @classmethod
        def _unserialize(cls, generator: object, state: tuple[str, str, tuple[bytes, bytes]]) -> 'LeanLibrary':
            loaded: LeanLibrary = super()._unserialize(generator, state)
            _, kind, code = state
            if kind == 'object':
                _, loaded._bitcode = code
                loaded._shared_module = None
            return loaded

        def _get_module_for_linking(self) -> object:
            if self._shared_module is None and self._bitcode is not None:
                self._shared_module = parse(self._bitcode)
            return super()._get_module_for_linking()

    generator._library_class = LeanLibrary  # noqa: SLF001


_keep_bitcode_unread()


def _keep_going_without_room(cache: _Cache) -> None:
    """Let a kernel run that cannot be written into its cache: the disk is full, or the folder is read-only."""
    save = cache.save_overload

    def save_overload(signature: object, data: object) -> None:
        with contextlib.suppress(OSError):
            save(signature, data)

    cache.save_overload = save_overload  # type: ignore[method-assign]


_UNREADABLE = (AttributeError, ImportError, EOFError, TypeError, ValueError, pickle.UnpicklingError)
"""What reading the cache of another version may raise."""


def _pass_over_unreadable_entries(cache: _Cache) -> None:
    """Make a cache that cannot be read empty, so that the kernel is compiled again.

    The cache refers to NamedTuples by their name and module. Numba reads it before it compares the age of the
    source, so a cache of another version of this package, in which such a name was another, would end the call.
    """
    load = cache.load_overload

    def load_overload(signature: object, target: object) -> object:
        try:
            return load(signature, target)
        except _UNREADABLE:
            cache.flush()
            return None

    cache.load_overload = load_overload  # type: ignore[method-assign]


def is_cached(compiled: Callable[[], object]) -> bool:
    """Whether a kernel without arguments is in the cache; it is not compiled."""
    cache: _Cache | None = getattr(compiled, '_cache', None)
    target = getattr(compiled, 'targetctx', None)
    with global_compiler_lock, contextlib.suppress(OSError):
        return cache is not None and cache.load_overload((), target) is not None
    return False  # it cannot be read


def has_cached_code(compiled: Callable[..., object]) -> bool:
    """Whether a kernel is in the cache for some types of its arguments; its machine code is not loaded."""
    file = getattr(getattr(compiled, '_cache', None), '_cache_file', None)
    with contextlib.suppress(OSError, *_UNREADABLE):
        return file is not None and bool(file._load_index())  # noqa: SLF001 - there is no public way
    return False


@kernel
def _nothing() -> int:
    return 0


def cache_folder() -> str | None:
    """The folder of this room's cache, beside those of the others; None: none can be written or read."""
    statistics = getattr(_nothing, 'stats')  # noqa: B009 - Numba's, which a plain function does not have
    folder: str | None = statistics.cache_path
    return folder
