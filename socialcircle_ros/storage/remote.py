# SPDX-License-Identifier: Apache-2.0
"""Files at URLs, through fsspec."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from socialcircle_ros.errors import SocialCircleError, install_command

if TYPE_CHECKING:
    import fsspec


def is_below(location: str, folder: str) -> bool:
    """Whether a location is a folder or lies in it; both as `real_location` spells them."""
    return location == folder or location.startswith(f'{folder.rstrip("/")}/')


def is_url(location: str | Path) -> bool:
    """Whether a location is a URL and not a path; one of `file://` is a path."""
    return '://' in str(location) and not str(location).startswith('file://')


def real_location(location: str | Path) -> str:
    """A location in one spelling: the absolute path without links, or the URL as its file system writes it.

    Raises:
        SocialCircleError: as `file_system`.
    """
    text = str(location)
    if is_url(text):
        files, path = file_system(text)
        text = str(files.unstrip_protocol(path))
    return text if is_url(text) else os.path.realpath(text.removeprefix('file://'))


def file_system(url: str) -> tuple['fsspec.AbstractFileSystem', str]:
    """The file system of a URL, and the path in it. It lists anew each time.

    Raises:
        SocialCircleError: fsspec, or the library of the protocol, is not installed, or there is no such protocol.
    """
    try:
        from fsspec.core import url_to_fs  # noqa: PLC0415 - an extra
    except ImportError:
        raise SocialCircleError(f'URLs need fsspec: {install_command("batch")}.') from None
    try:
        # Listings are kept without end otherwise, and a second batch of one program would not see what is new.
        files, path = url_to_fs(url, use_listings_cache=False)
    except (ImportError, ValueError) as error:
        raise SocialCircleError(f'{url} cannot be opened: {reason_of(error)}') from None
    return files, path


def reason_of(error: BaseException) -> str:
    """The first line of an error of a file system, which has errors of its own, as a sentence."""
    return f'{type(error).__name__}: {error}'.splitlines()[0].rstrip('.') + '.'
