# SPDX-License-Identifier: Apache-2.0
"""Large chunks that are not compressed: their messages are read without a copy."""

import zlib
from typing import BinaryIO

from mcap.opcode import Opcode

from .checksums import joined_checksum
from .mcap_records import CHUNK, HEAD, LENGTH, MESSAGE

StoredMessage = tuple[bytes, bytes, int | None]
"""The head and the data of a message, and the CRC-32 of its data where it is known."""

LARGE = 1 << 20
"""Bytes from which a chunk is worth more calls for less copying."""


def read_sound_chunk(file: BinaryIO, length: int) -> list[StoredMessage] | None:
    """Read the messages of a chunk; each message's data come from the file as they are returned.

    Args:
        file: at the chunk's record, which is whole.
        length: of the record, in bytes.

    Returns:
        The messages; None if the chunk is compressed or anything is wrong with it: the
        caller then reads it in the way that finds what is wrong.
    """
    fixed = HEAD.size + CHUNK.size + LENGTH.size
    start = file.read(fixed)
    left = length - fixed
    if len(start) < fixed or start[0] != Opcode.CHUNK:
        return None
    _, _, size, stated, name_length = CHUNK.unpack_from(start, HEAD.size)
    if name_length or size != left or LENGTH.unpack_from(start, fixed - LENGTH.size)[0] != left:
        return None
    found: list[StoredMessage] = []
    checksum = 0
    while left:
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, body = HEAD.unpack(head)
        left -= HEAD.size + body
        before = file.read(MESSAGE.size) if opcode == Opcode.MESSAGE else b''
        rest = body - len(before)
        if left < 0 or rest < 0:
            return None
        data = file.read(rest)
        if len(data) < rest:
            return None
        own = zlib.crc32(data)
        if before:
            found.append((before, data, own))
        checksum = joined_checksum(zlib.crc32(before, zlib.crc32(head, checksum)), own, len(data))
    return found if stated in (0, checksum) else None
