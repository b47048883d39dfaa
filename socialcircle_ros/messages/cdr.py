# SPDX-License-Identifier: Apache-2.0
"""Reading and writing CDR, the serialization of ROS 2 messages on the wire and in a recording.

Libraries that decode CDR build objects and copy the data. A cloud has 20 MB, so that it is read in place here: the
reader only finds where its values begin.
"""

import struct

from socialcircle_ros.errors import MessageError

ENCAPSULATION = 4
"""Bytes of the encapsulation header; alignment counts from its end."""

_LITTLE_ENDIAN_HEADER = b'\x00\x01\x00\x00'


class CdrReader:
    """Reads the values of a message one after the other. The message is plain CDR in either byte order.

    Every method raises a MessageError if the message ends before the value does.

    Args:
        data: the serialized message with its encapsulation header.

    Raises:
        MessageError: the data is not plain CDR.

    Attributes:
        position: the offset of the next value in `data`, before alignment.
    """

    def __init__(self, data: bytes | memoryview) -> None:
        if len(data) < ENCAPSULATION or data[0] != 0 or data[1] not in (0, 1):
            raise MessageError('The message is not plain CDR, the serialization of ROS 2; it may be damaged.')
        self._data = data
        self._order = '<' if data[1] == 1 else '>'
        self.position = ENCAPSULATION

    def _number(self, code: str, size: int) -> int | float:
        """Read one aligned number."""
        start = self.position + (ENCAPSULATION - self.position) % size
        if start + size > len(self._data):
            raise MessageError(
                f'The message ends early, at byte {len(self._data)}; it is damaged or of another type.'
            )
        self.position = start + size
        (value,) = struct.unpack_from(self._order + code, self._data, start)
        return value  # type: ignore[no-any-return]

    def uint8(self) -> int:
        """Read one byte."""
        return int(self._number('B', 1))

    def boolean(self) -> bool:
        """Read a bool; any byte other than 0 is true."""
        return self.uint8() != 0

    def int32(self) -> int:
        """Read a signed 32-bit integer."""
        return int(self._number('i', 4))

    def uint32(self) -> int:
        """Read an unsigned 32-bit integer."""
        return int(self._number('I', 4))

    def float64(self) -> float:
        """Read a 64-bit float."""
        return float(self._number('d', 8))

    def count(self, min_size: int) -> int:
        """Read the length of a sequence.

        Args:
            min_size: the least number of bytes that an element takes. A damaged length is found by it before any
                element is read.
        """
        count = self.uint32()
        self._check_remaining(count * min_size)
        return count

    def string(self) -> str:
        """Read a string; bytes that are not UTF-8 become surrogates, so that they are written back unchanged."""
        start, length = self.octets()
        return bytes(self._data[start : start + length]).removesuffix(b'\0').decode('utf-8', 'surrogateescape')

    def octets(self) -> tuple[int, int]:
        """Skip a sequence of bytes.

        Returns:
            The offset of its first byte, and its length.
        """
        length = self.uint32()
        self._check_remaining(length)
        start = self.position
        self.position += length
        return start, length

    def _check_remaining(self, size: int) -> None:
        if size > len(self._data) - self.position:
            raise MessageError(
                f'The message says that {size} more bytes follow, but only'
                f' {len(self._data) - self.position} do; it is damaged or of another type.'
            )


class CdrWriter:
    """Builds a message in little-endian CDR; padding is 0."""

    def __init__(self) -> None:
        self._parts: list[bytes | memoryview] = [_LITTLE_ENDIAN_HEADER]
        self._length = ENCAPSULATION

    def _append(self, part: bytes | memoryview) -> None:
        self._parts.append(part)
        self._length += len(part)

    def _number(self, code: str, size: int, value: float) -> None:
        self._append(bytes((ENCAPSULATION - self._length) % size))
        self._append(struct.pack('<' + code, value))

    def uint8(self, value: int) -> None:
        """Write one byte."""
        self._number('B', 1, value)

    def boolean(self, value: bool) -> None:
        """Write a bool."""
        self.uint8(int(value))

    def int32(self, value: int) -> None:
        """Write a signed 32-bit integer."""
        self._number('i', 4, value)

    def uint32(self, value: int) -> None:
        """Write an unsigned 32-bit integer."""
        self._number('I', 4, value)

    def float64(self, value: float) -> None:
        """Write a 64-bit float."""
        self._number('d', 8, value)

    def string(self, value: str) -> None:
        """Write a string."""
        self.octets(value.encode('utf-8', 'surrogateescape') + b'\0')

    def octets(self, value: bytes | memoryview) -> None:
        """Write a sequence of bytes; the buffer is copied by `finish`, and must not change before."""
        self.uint32(len(value))
        self._append(value)

    def finish(self) -> bytes:
        """The serialized message."""
        return b''.join(self._parts)
