# SPDX-License-Identifier: Apache-2.0
"""The arrays of an `.npz` archive, each loaded only if it is needed, in bounded size."""

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.formats.damage import archive_damage_told

from .compression import expansion_limit, over_the_limit

_UNREADABLE = 'is not an .npz archive of numbers, or is cut off: save it again.'


class ArrayHeader(NamedTuple):
    """What an archive says of an array before it is loaded."""

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]


class Npz:
    """An opened archive.

    Attributes:
        path: of the archive.
        headers: of each array by its name.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        """Read the headers; see `open_npz`."""
        self.path = path
        self._archive = archive
        self._expanded = 0  # bytes that compressed arrays have become
        self._members = {
            info.filename.removesuffix('.npy'): info
            for info in archive.infolist()
            if info.filename.endswith('.npy')
        }
        self.headers = {name: self._header(info) for name, info in self._members.items()}

    def load(self, name: str) -> NDArray[np.generic]:
        """Load an array.

        Raises:
            ImportFileError: it is not there, holds Python objects, is too large, or is cut off.
        """
        header, info = self.headers[name], self._members[name]
        if header.dtype.hasobject:
            raise ImportFileError(f'{self.path} has Python objects in {name!r}: save numbers.')
        if info.compress_type != zipfile.ZIP_STORED:
            self._expanded += info.file_size
        if self._expanded > expansion_limit():
            raise ImportFileError(
                f'{self.path} is not read, because with {name!r} it {over_the_limit(self._expanded)}; or save it'
                ' without compression.'
            )
        # NumPy allocates what the header states, whatever there is.
        stated = header.dtype.itemsize * int(np.prod(header.shape, dtype=object))
        if stated > info.file_size:
            raise ImportFileError(f'{self.path} {_UNREADABLE}')
        with archive_damage_told(self.path, _UNREADABLE), self._archive.open(info) as file:
            return np.asarray(npy.read_array(file, allow_pickle=False))

    def _header(self, info: zipfile.ZipInfo) -> ArrayHeader:
        with self._archive.open(info) as file:
            version = npy.read_magic(file)
            if version == (1, 0):
                shape, _, dtype = npy.read_array_header_1_0(file)
            else:
                shape, _, dtype = npy.read_array_header_2_0(file)
        return ArrayHeader(shape, dtype)


@contextmanager
def open_npz(path: Path) -> Iterator[Npz]:
    """Open an archive.

    Raises:
        ImportFileError: the file is no such archive, is cut off, or cannot be read.
    """
    with archive_damage_told(path, _UNREADABLE):
        archive = zipfile.ZipFile(path)
    with archive:
        with archive_damage_told(path, _UNREADABLE):
            found = Npz(path, archive)
        yield found
