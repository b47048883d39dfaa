# SPDX-License-Identifier: Apache-2.0
"""std_msgs/Header."""

from dataclasses import dataclass

from socialcircle_ros.errors import MessageError

from .cdr import CdrReader, CdrWriter

_NANOSECONDS = 1_000_000_000

FIRST_DATE = 946_684_800_000_000_000
"""2000-01-01 in ns since 1970. An earlier time is no date: simulations and imported clouds count from 0."""


@dataclass(frozen=True)
class Header:
    """When and in which frame of reference a message was measured."""

    seconds: int = 0
    nanoseconds: int = 0
    frame_id: str = ''

    @property
    def stamp(self) -> int:
        """The time in ns."""
        return self.seconds * _NANOSECONDS + self.nanoseconds

    @classmethod
    def at(cls, stamp: int, frame_id: str) -> 'Header':
        """A header with a stamp in ns."""
        return cls(*divmod(stamp, _NANOSECONDS), frame_id)

    @classmethod
    def read(cls, reader: CdrReader) -> 'Header':
        """Read the header at the reader's position.

        Raises:
            MessageError: the message ends early.
        """
        return cls(reader.int32(), reader.uint32(), reader.string())

    def write(self, writer: CdrWriter) -> None:
        """Append this header."""
        writer.int32(self.seconds)
        writer.uint32(self.nanoseconds)
        writer.string(self.frame_id)


def stamp_of(message: bytes) -> int:
    """The stamp, in ns, of any serialized message that begins with a header.

    Raises:
        MessageError: the message ends early.
    """
    return Header.read(CdrReader(message)).stamp


def readable_header(message: bytes | memoryview) -> Header | None:
    """The header of any serialized message that begins with one; None: the message is damaged."""
    try:
        return Header.read(CdrReader(message))
    except MessageError:
        return None


def stamp_text(stamp: int) -> str:
    """A stamp in ns as a measurement writes it: seconds with nine decimals, such as `5.000000007`."""
    seconds, nanoseconds = divmod(stamp, _NANOSECONDS)
    return f'{seconds}.{nanoseconds:09d}'
