# SPDX-License-Identifier: Apache-2.0
"""What Pillow raises and warns of for a damaged file, as one error."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from socialcircle_ros.errors import ImportFileError

_RAISED = (OSError, ValueError, SyntaxError, EOFError, KeyError, IndexError, TypeError, OverflowError)
_HARMLESS = 'Metadata Warning'  # a tag with more values than it needs, as some programs write it


@contextmanager
def damage_told(path: Path, sentence: str) -> Iterator[None]:
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
    except (*_RAISED, UserWarning):
        raise ImportFileError(f'{path} {sentence}') from None
