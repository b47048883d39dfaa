# SPDX-License-Identifier: Apache-2.0
"""The space on a disk: how much is free, and a reserve that is held for the end of a long recording."""

import errno
import os
import tempfile
from contextlib import suppress
from pathlib import Path

_NO_SPACE = (errno.ENOSPC, errno.EDQUOT)


def free_bytes(folder: Path) -> int:
    """The bytes that this process may still write to the disk of a folder."""
    found = os.statvfs(folder)
    return (found.f_bfree if os.geteuid() == 0 else found.f_bavail) * found.f_frsize


def is_full(error: OSError) -> bool:
    """Whether an error says that a disk, or what a user may have of it, is full."""
    return error.errno in _NO_SPACE


class Reserve:
    """Space on a disk that is held until it is needed, by a file without a name.

    A process that is killed leaves nothing behind. Where the file system cannot allocate space, nothing is held.

    Attributes:
        size: the bytes that are held.
        used: whether the reserve was given back, so that the last bytes could be written.
    """

    def __init__(self, folder: Path) -> None:
        """Begin with nothing.

        Args:
            folder: on the disk.

        Raises:
            OSError: no file can be made in the folder.
        """
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed by `give_back`
        self._can_allocate = True
        self.size = 0
        self.used = False

    def hold(self, size: int) -> None:
        """Hold at least `size` bytes.

        Raises:
            OSError: the disk is full.
        """
        if size <= self.size or not self._can_allocate:
            return
        try:
            os.posix_fallocate(self._file.fileno(), self.size, size - self.size)
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self.size)
            if is_full(error):
                raise
            self._can_allocate = False
            return
        self.size = size

    def give_back(self) -> bool:
        """Give the space back to the disk.

        Returns:
            Whether there was any.
        """
        self._file.close()
        held, self.size = self.size, 0
        self.used = self.used or held > 0
        return held > 0

    def close(self) -> None:
        """Give the space back without need."""
        self._file.close()
        self.size = 0
