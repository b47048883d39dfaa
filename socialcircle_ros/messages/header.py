"""std_msgs/Header."""

from dataclasses import dataclass

from .cdr import CdrReader, CdrWriter


@dataclass(frozen=True)
class Header:
    """When and where a message was measured."""

    seconds: int = 0
    nanoseconds: int = 0
    frame_id: str = ''

    @property
    def stamp(self) -> int:
        """Time in nanoseconds."""
        return self.seconds * 1_000_000_000 + self.nanoseconds

    @classmethod
    def at(cls, stamp: int, frame_id: str) -> 'Header':
        """A header from a time in nanoseconds."""
        return cls(*divmod(stamp, 1_000_000_000), frame_id)

    @classmethod
    def read(cls, reader: CdrReader) -> 'Header':
        """Read the header at the reader's position."""
        return cls(reader.int32(), reader.uint32(), reader.string())

    def write(self, writer: CdrWriter) -> None:
        """Append this header."""
        writer.int32(self.seconds)
        writer.uint32(self.nanoseconds)
        writer.string(self.frame_id)


def stamp_of(message: bytes) -> int:
    """The stamp, in ns, of any serialized message that begins with a header.

    Raises:
        MessageError: it ends early.
    """
    return Header.read(CdrReader(message)).stamp
