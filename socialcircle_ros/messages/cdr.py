"""Reading and writing CDR, the bytes of a ROS 2 message on the wire and in a recording.

A cloud is 20 MB: it is looked at where it lies, so that only what changes is ever copied. The libraries
that decode CDR build objects and copy the data; here a message is walked to the place that is wanted.
"""

import struct

from socialcircle_ros.errors import MessageError

ENCAPSULATION = 4
"""Bytes before the message; alignment counts from behind them."""

_LITTLE_ENDIAN_HEADER = b'\x00\x01\x00\x00'


class CdrReader:
    """Walks through a message (plain CDR, either byte order).

    Args:
        data: the serialized message with its encapsulation header.

    Raises:
        MessageError: not plain CDR.
    """

    def __init__(self, data: bytes | memoryview) -> None:
        if len(data) < ENCAPSULATION or data[0] != 0 or data[1] not in (0, 1):
            raise MessageError('The message is not plain CDR, as ROS 2 messages are; it may be damaged.')
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
        """Read a bool; any byte but 0 is true."""
        return self.uint8() != 0

    def int32(self) -> int:
        """Read a signed integer of 32 bits."""
        return int(self._number('i', 4))

    def uint32(self) -> int:
        """Read an unsigned integer of 32 bits."""
        return int(self._number('I', 4))

    def float64(self) -> float:
        """Read a float of 64 bits."""
        return float(self._number('d', 8))

    def count(self, least_size: int) -> int:
        """Read the length of a sequence whose elements take at least `least_size` bytes each."""
        count = self.uint32()
        self._reserve(count * least_size)
        return count

    def string(self) -> str:
        """Read a string; bytes that are not UTF-8 survive as surrogates."""
        start, length = self.octets()
        return bytes(self._data[start : start + length]).removesuffix(b'\0').decode('utf-8', 'surrogateescape')

    def octets(self) -> tuple[int, int]:
        """Pass over a sequence of bytes; its first position and its length."""
        length = self.uint32()
        self._reserve(length)
        start = self.position
        self.position += length
        return start, length

    def _reserve(self, size: int) -> None:
        if size > len(self._data) - self.position:
            raise MessageError(
                f'The message says that {size} more bytes follow, but only'
                f' {len(self._data) - self.position} do; it is damaged or of another type.'
            )


class CdrWriter:
    """Builds a message in little-endian CDR, padding set to zero."""

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
        """Write a signed integer of 32 bits."""
        self._number('i', 4, value)

    def uint32(self, value: int) -> None:
        """Write an unsigned integer of 32 bits."""
        self._number('I', 4, value)

    def float64(self, value: float) -> None:
        """Write a float of 64 bits."""
        self._number('d', 8, value)

    def string(self, value: str) -> None:
        """Write a string."""
        self.octets(value.encode('utf-8', 'surrogateescape') + b'\0')

    def octets(self, value: bytes | memoryview) -> None:
        """Write a sequence of bytes, which are read when the message is finished."""
        self.uint32(len(value))
        self._append(value)

    def finish(self) -> bytes:
        """The message."""
        return b''.join(self._parts)
