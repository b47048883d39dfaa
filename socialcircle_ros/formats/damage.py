# SPDX-License-Identifier: Apache-2.0
"""What libraries raise and warn of for a file that is damaged or cannot be read, as one error."""

import errno
import lzma
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from socialcircle_ros.errors import ImportFileError

_OF_PILLOW = (OSError, ValueError, SyntaxError, EOFError, KeyError, IndexError, TypeError, OverflowError)
_HARMLESS = 'Metadata Warning'  # a tag with more values than it needs, as some programs write it

# zipfile raises a RuntimeError for an encrypted archive, as for an unknown compression.
_OF_ARCHIVES = (
    OSError, ValueError, SyntaxError, EOFError, KeyError, RuntimeError, OverflowError, struct.error, zlib.error,
    lzma.LZMAError, zipfile.BadZipFile, tokenize.TokenError,
)  # fmt: skip

# Libraries raise an OSError without a number; with EINVAL, a damaged offset led to a place that no file has.
_NUMBERS_OF_DAMAGE = (None, errno.EINVAL)


def unreadable(path: Path, error: OSError) -> ImportFileError:
    """The error for a file that the system does not read."""
    if isinstance(error, FileNotFoundError):
        return ImportFileError(f'{path} does not exist: check the name of the file.')
    advice = ': check its permissions' if isinstance(error, PermissionError) else ''
    return ImportFileError(f'{path} cannot be read ({error.strerror or error}){advice}.')


@contextmanager
def picture_damage_told(path: Path, sentence: str) -> Iterator[None]:
    """Turn whatever Pillow says of a damaged file into one sentence.

    Pillow skips a tag of a TIFF that it cannot read, and only warns. Without it, values are read as another type,
    or pages are missing. In other files its warnings are about metadata.

    Args:
        path: of the file.
        sentence: behind its name.

    Raises:
        ImportFileError: Pillow cannot read the file, or not all of a TIFF.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            if path.suffix.lower() in ('.tif', '.tiff'):
                warnings.simplefilter('error', UserWarning)
                warnings.filterwarnings('ignore', _HARMLESS, UserWarning)
            yield
    except (*_OF_PILLOW, UserWarning) as error:
        raise _told(path, sentence, error) from None


@contextmanager
def archive_damage_told(path: Path, sentence: str) -> Iterator[None]:
    """Turn whatever `zipfile`, and the readers of what it holds, say of a damaged archive into one sentence.

    Args:
        path: of the file.
        sentence: behind its name.

    Raises:
        ImportFileError: the archive cannot be read.
    """
    try:
        yield
    except _OF_ARCHIVES as error:
        raise _told(path, sentence, error) from None


def _told(path: Path, sentence: str, error: Exception) -> ImportFileError:
    if isinstance(error, OSError) and error.errno not in _NUMBERS_OF_DAMAGE:
        return unreadable(path, error)
    return ImportFileError(f'{path} {sentence}')
