# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: one decorator decides about caching and its fall-back."""

import inspect
from collections.abc import Callable
from typing import Protocol, TypeVar, cast

from socialcircle_ros.errors import SocialCircleError

from .caches import KernelCache, NumbaCache
from .compiling import announce

try:
    import numba
    from numba.core import event
    from numba.core.compiler_lock import global_compiler_lock
except (OSError, ValueError) as error:  # its library cannot be loaded, or a variable has a wrong value
    raise SocialCircleError(
        f'Numba, which compiles the filter, cannot start: {str(error).rstrip(".")}. Check the variables of the'
        ' environment that begin with NUMBA_, and the memory that a process may have (ulimit -v).'
    ) from None

if numba.config.DISABLE_JIT:
    raise SocialCircleError('NUMBA_DISABLE_JIT is set, so that each cloud would take minutes: unset it.')

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


class _Compiled(Protocol):
    """What Numba makes of a function, as far as it is used here."""

    _cache: NumbaCache


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
    own: NumbaCache | None = getattr(compiled, '_cache', None)
    if own is not None:
        # Numba has no public way to give it a cache.
        cast('_Compiled', compiled)._cache = KernelCache(function, own)  # noqa: SLF001
    if _MIXES_TUPLES_UP:
        compiled.__class__ = _TypedByPython
    return cast('Function', compiled)


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


def is_cached(compiled: Callable[[], object]) -> bool:
    """Whether a kernel without arguments is in the cache; it is not compiled."""
    cache = _cache_of(compiled)
    target = getattr(compiled, 'targetctx', None)
    with global_compiler_lock:
        return cache is not None and cache.load_overload((), target) is not None


def has_cached_code(compiled: Callable[..., object]) -> bool:
    """Whether a kernel is in the cache for some types of its arguments; its machine code is not loaded."""
    cache = _cache_of(compiled)
    return cache is not None and cache.has_code()


def folder_of(compiled: Callable[..., object]) -> str | None:
    """The folder from which a kernel was loaded, or into which it was written; None: neither."""
    cache = _cache_of(compiled)
    return None if cache is None else cache.used


def _cache_of(compiled: Callable[..., object]) -> KernelCache | None:
    cache = getattr(compiled, '_cache', None)
    return cache if isinstance(cache, KernelCache) else None


@kernel
def _nothing() -> int:
    return 0


def cache_folder() -> str | None:
    """The folder into which kernels of this room are written, beside those of the others; None: there is none."""
    cache = _cache_of(_nothing)
    return None if cache is None else cache.cache_path
