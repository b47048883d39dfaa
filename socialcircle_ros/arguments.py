# SPDX-License-Identifier: Apache-2.0
"""What callers hand to the public functions: one name where several may come, settings, numbers and options."""

import numbers
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar, get_args

from socialcircle_ros.errors import SettingError, shown

Name = TypeVar('Name', bound=str | Path)

OneOrSeveral: TypeAlias = Name | Iterable[Name]
"""A name or a path, or several of them."""

Compression = Literal['none', 'lz4', 'zstd']
"""How the chunks of a recording are compressed."""

SettingsClass = TypeVar('SettingsClass')


def several(given: OneOrSeveral[Name] | None) -> tuple[Name, ...]:
    """All names that a caller gives; a single one counts as several of one.

    A text is iterable as well: taken for several names, `/points` would be the names `/`, `p`, `o`, ...
    Bytes are no name.

    Args:
        given: a name or a path, or several; None: none.

    Raises:
        SettingError: it is neither.
    """
    if given is None:
        return ()
    if isinstance(given, (str, Path)):
        return (given,)
    if isinstance(given, (bytes, bytearray, memoryview)) or not isinstance(given, Iterable):
        raise SettingError(f'A name or several names must be given, not {shown(given)}.')
    return tuple(given)


def settings_of(wanted: type[SettingsClass], given: object) -> SettingsClass:
    """The settings that a caller gives, if they are of the class that is wanted.

    Raises:
        SettingError: they are not.
    """
    if not isinstance(given, wanted):
        raise SettingError(f'The settings must be a {wanted.__name__}(...), not {shown(given)}.')
    return given


def settings_or_default(wanted: type[SettingsClass], given: object) -> SettingsClass:
    """The settings that a caller gives; None: the defaults.

    Raises:
        SettingError: they are not of the class that is wanted.
    """
    return wanted() if given is None else settings_of(wanted, given)


def check_count(name: str, given: object) -> None:
    """Check that a caller gives a number of things: a whole number above 0.

    Args:
        name: of the argument.
        given: what is given for it; None, which stands for a default, is not for this function.

    Raises:
        SettingError: it is none.
    """
    if isinstance(given, bool) or not isinstance(given, numbers.Integral) or given < 1:
        raise SettingError(f'{name} must be a whole number above 0, not {shown(given)}.')


def check_compression(compression: str) -> None:
    """Check that a recording can be compressed so.

    Raises:
        SettingError: it cannot.
    """
    choices = get_args(Compression)
    if compression not in choices:
        raise SettingError(f'The compression cannot be {shown(compression)}; use one of: {", ".join(choices)}.')
