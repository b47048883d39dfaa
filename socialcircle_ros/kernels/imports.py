# SPDX-License-Identifier: Apache-2.0
"""Imports that a process does without: a library may load another one that it never uses here."""

import contextlib
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def without_module(name: str) -> Iterator[None]:
    """Let an import of a module fail, as if it were not installed, unless it is loaded."""
    if name in sys.modules:
        yield
        return
    sys.modules[name] = None  # type: ignore[assignment] # an import then raises ModuleNotFoundError
    try:
        yield
    finally:
        del sys.modules[name]
