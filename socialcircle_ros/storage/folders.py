# SPDX-License-Identifier: Apache-2.0
"""The folder of the results of long work."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError


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
