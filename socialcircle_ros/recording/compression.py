# SPDX-License-Identifier: Apache-2.0
"""Decompression in bounded memory: chunks, messages and whole files.

A file of a few kilobytes may state, or expand to, many gigabytes. What a chunk or a message expands to is bounded
by the size that the file states, and by a limit, which the environment variable `SOCIALCIRCLE_MAX_EXPANDED_MB`
raises.
"""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, cast

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from socialcircle_ros.errors import RecordingError, SettingError

LIMIT_VARIABLE = 'SOCIALCIRCLE_MAX_EXPANDED_MB'
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'

_DEFAULT_MB = 1024
_PIECE = 1 << 24  # bytes
_BITE = 1 << 13  # bytes of a compressed file, which expand to 256 MB at most
_RATIO = 100  # a whole file may expand this much, or to the limit; recordings of clouds expand tenfold at most
_RESERVE = 1 << 28  # bytes of the disk that a file that is decompressed leaves free


class ExpansionError(Exception):
    """Data cannot be decompressed; the message says why."""


def expansion_limit() -> int:
    """The bytes that a chunk, a message or an array of a file may expand to.

    Raises:
        SettingError: the environment variable is not a positive number.
    """
    given = os.environ.get(LIMIT_VARIABLE) or str(_DEFAULT_MB)
    try:
        limit = int(float(given) * 1e6)
    except (ValueError, OverflowError):
        limit = 0
    if limit <= 0:
        raise SettingError(f'{LIMIT_VARIABLE} is {given!r}: it must be a number of megabytes above 0.')
    return limit


def over_the_limit(size: int) -> str:
    """Why data of a stated size are not expanded, to be put behind "because"."""
    return (
        f'expands to {size / 1e6:.0f} MB, above the limit of {expansion_limit() / 1e6:.0f} MB, which'
        f' {LIMIT_VARIABLE} raises'
    )


def expand(data: bytes, compression: str, size: int) -> bytes:
    """Decompress a chunk or a message; of data that are cut off, as much as there is.

    Args:
        data: one frame.
        compression: `lz4` or `zstd`.
        size: the size that the file states.

    Returns:
        At most `size` + 1 bytes; the last one shows that there are more than stated.

    Raises:
        ExpansionError: the stated size is above the limit.
        RuntimeError, zstandard.ZstdError: the data are damaged.
    """
    if size > expansion_limit():
        raise ExpansionError(over_the_limit(size))
    if compression == 'lz4':
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    pieces = list(_pieces(zstandard.ZstdDecompressor().stream_reader(data), size + 1))
    return pieces[0] if len(pieces) == 1 else b''.join(pieces)


def expand_message(data: bytes) -> bytes:
    """Decompress a message that rosbag2 compressed by itself; what is damaged or too large stays as it is."""
    try:
        size = zstandard.frame_content_size(data)
        expanded = expand(data, 'zstd', size if size >= 0 else expansion_limit() - 1)
    except (ExpansionError, zstandard.ZstdError, MemoryError):
        return data
    return expanded if size < 0 or len(expanded) == size else data


def expand_file(file: BinaryIO, path: Path) -> BinaryIO:
    """Decompress a zstd file into a temporary file without a name, which ends with the process.

    Args:
        file: at its beginning; it is closed.
        path: for the message.

    Raises:
        RecordingError: there is no space for it, or it expands beyond all measure.
    """
    expanded = cast('BinaryIO', tempfile.TemporaryFile())  # noqa: SIM115 - the caller closes it
    try:
        with file:
            most = max(expansion_limit(), _RATIO * os.fstat(file.fileno()).st_size)
            most = min(most, shutil.disk_usage(tempfile.gettempdir()).free - _RESERVE)
            written = 0
            # A file that is cut off or damaged gives what comes before the damage; the reader finds its end.
            with suppress(zstandard.ZstdError):
                for piece in _frames(file):
                    written += len(piece)
                    if written > most:
                        break
                    expanded.write(piece)
        expanded.seek(0)
    except OSError as error:
        expanded.close()
        raise RecordingError(f'{path} cannot be decompressed ({error.strerror}): set TMPDIR.') from None
    except BaseException:
        expanded.close()
        raise
    if written > most:
        expanded.close()
        raise RecordingError(
            f'{path} expands to more than {most / 1e6:.0f} MB: decompress it where there is space (`zstd -d`), set'
            f' TMPDIR, or raise {LIMIT_VARIABLE}.'
        )
    return expanded


def _pieces(reader: zstandard.ZstdDecompressionReader, most: int) -> Iterator[bytes]:
    """Yield pieces until the end, the damage, or until there are `most` bytes."""
    while most > 0:
        piece = reader.read(min(most, _PIECE))
        if not piece:
            return
        most -= len(piece)
        yield piece


def _frames(file: BinaryIO) -> Iterator[bytes]:
    """Yield what the frames of a file expand to, also if the last one is cut off.

    Raises:
        zstandard.ZstdError: the rest is damaged.
    """
    decompressor = zstandard.ZstdDecompressor().decompressobj()
    while packed := file.read(_BITE):
        while packed:
            yield decompressor.decompress(packed)
            packed = decompressor.unused_data if decompressor.eof else b''
            if decompressor.eof:
                decompressor = zstandard.ZstdDecompressor().decompressobj()
