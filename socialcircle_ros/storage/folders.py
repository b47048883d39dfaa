# SPDX-License-Identifier: Apache-2.0
"""The folder of the results of long work, and what the name of a result looks like."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError

_SUFFIX_OF_FILE = re.compile(r'\.[A-Za-z][A-Za-z0-9]{1,4}')


def has_suffix_of_file(path: Path) -> bool:
    """Whether a name ends as that of a file does, such as in .png or .x3p; night.2026-11-29 does not."""
    return _SUFFIX_OF_FILE.fullmatch(path.suffix) is not None


def check_folder_name(folder: Path) -> None:
    """Raise an error if a folder of results would get the name of a file; one that is there keeps its name.

    Raises:
        SocialCircleError: it would.
    """
    if has_suffix_of_file(folder) and not folder.is_dir():
        raise SocialCircleError(
            f'{folder} has the name of a file, and a directory is written: give a name without a suffix, such as'
            f' {folder.with_suffix("")}.'
        )


@contextmanager
def folder_of_results(folder: Path) -> Iterator[None]:
    """Create a folder before long work, so that a bad folder is told at once; nothing is left if nothing is done.

    If the folder is still empty at the end of the block, every folder that was created for it is removed.

    Raises:
        SocialCircleError: the folder cannot be created.
    """
    whole = folder.absolute()
    new = [each for each in (whole, *whole.parents) if not each.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SocialCircleError(
                f'{folder} cannot be written: {error.strerror}; choose another folder.'
            ) from None
        yield
    finally:
        with suppress(OSError):  # one that is not empty stays
            for each in new:
                each.rmdir()
