"""sensor_msgs/JointState: where the stage was."""

from collections.abc import Sequence
from dataclasses import dataclass

from .cdr import CdrReader, CdrWriter
from .header import Header

TYPE = 'sensor_msgs/msg/JointState'

_LEAST_STRING = 4


@dataclass(frozen=True)
class JointState:
    """Positions of joints at a time; prismatic ones in metres (REP 103). Velocities and efforts are left out."""

    header: Header
    names: Sequence[str]
    positions: Sequence[float]

    @classmethod
    def decode(cls, message: bytes) -> 'JointState':
        """Read a serialized message.

        Raises:
            MessageError: it ends early, or is of another type.
        """
        reader = CdrReader(message)
        header = Header.read(reader)
        names = [reader.string() for _ in range(reader.count(_LEAST_STRING))]
        positions = [reader.float64() for _ in range(reader.count(8))]
        return cls(header, names, positions)

    def encode(self) -> bytes:
        """The serialized message."""
        writer = CdrWriter()
        self.header.write(writer)
        writer.uint32(len(self.names))
        for name in self.names:
            writer.string(name)
        writer.uint32(len(self.positions))
        for position in self.positions:
            writer.float64(position)
        writer.uint32(0)
        writer.uint32(0)
        return writer.finish()
