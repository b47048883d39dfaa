# SPDX-License-Identifier: Apache-2.0
"""Text files of other programs, as UTF-8 with or without a byte order mark."""

import codecs
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

from socialcircle_ros.errors import ImportFileError
from socialcircle_ros.storage import write_file

BYTE_ORDER_MARK = codecs.BOM_UTF8


def open_text(path: Path) -> TextIO:
    """Open a text; a byte order mark before it, as Excel writes it, is left out.

    Raises:
        OSError: the file cannot be opened.
    """
    return path.open(encoding='utf-8-sig', errors='replace')


def check_text(path: Path) -> None:
    """See that a file can be text in UTF-8.

    Raises:
        ImportFileError: it is empty, or text in UTF-16.
        OSError: it cannot be read.
    """
    with path.open('rb') as file:
        if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            raise ImportFileError(f'{path} is text in UTF-16: save it as UTF-8.')
        file.seek(0)
        if not any(line.strip() for line in file):
            raise ImportFileError(f'{path} is empty: save it again.')


@contextmanager
def without_mark(path: Path) -> Iterator[Path]:
    """A file that begins without a byte order mark, for a library that takes the mark for text: a copy, if needed.

    Raises:
        OSError: the file cannot be read.
        SocialCircleError: the copy cannot be written.
    """
    with path.open('rb') as file:
        if file.read(len(BYTE_ORDER_MARK)) != BYTE_ORDER_MARK:
            yield path
            return
        content = file.read()
    with TemporaryDirectory(prefix='socialcircle-') as folder:
        copy = Path(folder) / path.name
        write_file(copy, content)
        yield copy
